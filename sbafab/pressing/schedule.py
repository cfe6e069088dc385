"""The heat-press schedule: steps, their layers, pins, pressures and minutes, and warnings for the
technician.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.design.sections import Press
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.films import FIRST, PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.laminate.joints import PRESS, SeamKind, SeamTool
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import (
    BondState,
    LayUpStep,
    StepName,
    distinct_layers,
    films_without_minutes,
    is_laid_by_hand,
    lay_up_steps,
    press_steps,
    pressed_layers,
    stack_count,
)
from sbafab.pressing import build_up
from sbafab.pressing.build_up import (
    BASE_PLATE,
    LAMINATE,
    PAD,
    RELEASE,
    UNDERLAY,
    BuildUpPart,
    StackShape,
)
from sbafab.pressing.dowels import (
    PinHole,
    PinSetting,
    is_sold,
    pin_holes,
    settings_by_step,
)
from sbafab.pressing.plate_heating import Heating, HeatPoint, heating


def joined_words(words: Sequence[str]) -> str:
    """Return a list in words: one, two and three."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def layers_in_words(layers: Sequence[int]) -> str:
    """Return layer indices as text; never 2-3, which a spreadsheet reads as a date."""
    runs = [
        [index for _, index in run]
        for _, run in groupby(enumerate(layers), lambda pair: pair[1] - pair[0])
    ]
    if not runs:
        return "none"
    words: list[str] = []
    for run in runs:
        words += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run)
    return f"layer{'s' if len(layers) > 1 else ''} {joined_words(words)}"


class Caution(NamedTuple):
    """A warning for the technician; its ``remedy`` in a design file is for the designer.

    ``at_step``: the step's page repeats it where the layer is laid.
    """

    words: str
    remedy: str = ""
    at_step: bool = False

    @property
    def sentence(self) -> str:
        """The warning and the remedy, for the designer."""
        return f"{self.words}; {self.remedy}" if self.remedy else self.words


# The steps: layers pressed together, in their order (paper Sec. 2).
#
# Temperatures are C, pressures kPa, forces N, times minutes, lengths mm.


STEPS: Mapping[StepName, tuple[str, str, str]] = {
    "flash_bottom": (
        "Bottom balloon, upper two layers",
        "Bottom balloons, upper two layers of each",
        "flash_bottom_minutes",
    ),
    "tack_bottom": (
        "Bottom balloon, its base tacked on",
        "Bottom balloons, their bases tacked on",
        "flash_bottom_minutes",
    ),
    "bond_bottom": (
        "Bottom balloon, with its base",
        "Bottom balloons, each with its base",
        "bond_bottom_minutes",
    ),
    "flash_middle": ("Middle layers", "Middle layers", "flash_middle_minutes"),
    "tack_all": ("Whole laminate, tacked", "Whole laminate, tacked", "flash_middle_minutes"),
    "bond_all": ("Whole laminate", "Whole laminate", "bond_all_minutes"),
}
"""Title of a step of one stack, and of several beside each other, and the key of its minutes."""

SNIP = (
    "Snip off the ears along the outline, and the tails of the inlet strips at the tab's end; the "
    "masks stay in their pockets."
)


HANDLING_MINUTES = 60.0
"""The paper's total build time of 1.75 h less its 45 minutes in the press."""


def minutes_closed(press: Press, step: StepName) -> float | None:
    """Return the minutes that the press stays closed in a step, None if unknown; tacking is a flash
    bond.
    """
    minutes: float | None = getattr(press, STEPS[step][2])
    return minutes


@dataclass(frozen=True)
class Step:
    """One closing of the press.

    ``layers`` are pressed together and ``adds`` join in this step, both by layer index; ``pins``
    names the inserted dowel pins, ``pin_settings`` gives their length and depth. ``pressure_kpa``
    is the force over the whole platen; ``film_kpa`` and the others are the pressures under the pad
    (``build_up.Pressures``). ``build_up`` goes from the lower platen up. ``minutes`` are None if
    they are not stated for the film; they start with the clock in ``time_temperature``.
    """

    step: int
    title: str
    bond: BondState
    layers: tuple[int, ...]
    adds: tuple[int, ...]
    pins: tuple[str, ...]
    temperature_c: float
    pressure_kpa: float
    force_n: float
    platen_mm: tuple[float, float]
    minutes: float | None
    film_kpa: float
    edge_kpa: float
    bond_kpa: float
    plate_kpa: float
    pressure_basis: str
    build_up: tuple[BuildUpPart, ...]
    pin_settings: tuple[PinSetting, ...]
    instructions: str
    time_temperature: tuple[HeatPoint, ...]
    reason: str = ""
    """Why the films are pressed now; empty if they are joined in the press alone."""

    @property
    def stack_mm(self) -> float:
        """The height of the pressed stack."""
        return next(item.thickness_mm for item in self.build_up if item.part == LAMINATE)

    @property
    def top_mm(self) -> float:
        """The height of the stack's top over the base plate, with every part under the stack."""
        under = 0.0
        for item in self.build_up:
            if item.part == LAMINATE:
                break
            under += 0.0 if item.part == BASE_PLATE else item.thickness_mm
        return under + self.stack_mm


@dataclass(frozen=True)
class SeamStep:
    """One seam made by a tool, counted among all steps.

    ``layers`` are in the work, and ``adds`` are laid in this step. ``length_mm`` is the length of
    the tool's centre path. Temperature and speed are None if not stated. ``from_below``: the work
    is turned over, and the path mirrored.
    """

    step: int
    title: str
    seam: str
    layers: tuple[int, ...]
    adds: tuple[int, ...]
    joins: tuple[int, int]
    tool: SeamTool
    kind: SeamKind
    width_mm: float
    length_mm: float
    temperature_c: float | None
    speed_mm_s: float | None
    instructions: str
    reason: str
    from_below: bool


@dataclass(frozen=True)
class FoldStep:
    """One film folded along a line from the first to the second of two points, mm."""

    step: int
    title: str
    layers: tuple[int, int]
    line_mm: tuple[Point, Point]
    instructions: str
    reason: str


@dataclass(frozen=True)
class Schedule:
    """All steps, their time, and warnings for the technician.

    Warnings are ``cautions``, and ``remarks`` on waived rules and lowered limits. The two totals
    are None if the minutes of any step are None; they exclude warm-up. If not ``is_timed``, the
    hand work has no stated time, so there is no total.
    """

    steps: tuple[Step, ...]
    total_press_minutes: float | None
    estimated_build_minutes: float | None
    estimate_basis: str
    cautions: tuple[Caution, ...]
    heating: Heating
    is_timed: bool = True
    seams: tuple[SeamStep, ...] = ()
    folds: tuple[FoldStep, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks and cautions, one sentence each."""
        return (*self.remarks, *(caution.sentence for caution in self.cautions))


def schedule(laminate: Laminate, design: Design, together: Sequence[int] = (1,)) -> Schedule:
    """Return the press steps of a laminate, bottom balloon first.

    Flash bonds hold layers in place on their pins. Full bonds are pressed without pins, as in the
    paper; with ears a flash bond on the pins precedes each. Raises DesignError at a temperature
    that would not bond the films or is too high for one of them or the pad, and if pad, pins or
    plate do not fit the laminate. ``together`` are the laminates that share the press, one number
    for each size of cycle, the largest first.
    """
    press = design.press
    refuse_temperature(laminate, press)
    parts = press_steps(laminate)
    under, *smaller = (
        [build_up.footprint(laminate, part.layers, count) for part in parts]
        for count in dict.fromkeys(together)
    )
    pad = build_up.pad_thickness(press, [*under, *chain.from_iterable(smaller)])
    (pins, plate), warming = pins_by_step(laminate, design), heating(laminate, press)
    has_minutes = not films_without_minutes(laminate, press.timed_films)
    steps = []
    for part, stack, step_pins in zip(parts, under, pins, strict=True):
        minutes = minutes_closed(press, part.name) if has_minutes else None
        bed = _Bed(pad, plate, _underlay(laminate, part, press), stack, step_pins)
        steps.append(_step(laminate, part, press, bed, warming.line(minutes), minutes))
    if laminate.registration == "ears" and steps:
        steps[-1] = replace(steps[-1], instructions=f"{steps[-1].instructions} {SNIP}")
    times = [step.minutes for step in steps if step.minutes is not None]
    total = sum(times, 0.0) if len(times) == len(steps) else None
    pressed = "no minutes stated for this film" if total is None else f"{total:g} min"
    is_timed = not design.form.is_drawn
    by_hand = (
        f"{HANDLING_MINUTES:g} min to cut, lay up, pin and fit the tubing; the latter is assumed "
        "the same for every design (paper: 1.75 h in all)"
        if is_timed
        else "a time by hand that nobody measured for drawn layers: no total"
    )
    has_total = total is not None and is_timed and not laminate.seams
    return Schedule(
        tuple(steps),
        total,
        (total or 0.0) + HANDLING_MINUTES if has_total else None,
        f"{pressed} in the press and {by_hand}",
        tuple(_cautions(laminate, design, parts, steps)),
        warming,
        is_timed,
        tuple(seam_steps(laminate)),
        tuple(fold_steps(laminate)),
    )


def pins_by_step(laminate: Laminate, design: Design) -> tuple[list[tuple[PinSetting, ...]], float]:
    """Return the pins of every press step, and the base plate's thickness in mm.

    Raises DesignError if pins or plate do not fit.
    """
    press, registration = design.press, design.registration
    on_plate = [
        build_up.footprint(laminate, part.layers).height
        + _underlay(laminate, part, press)
        + press.release_thickness
        for part in press_steps(laminate)
    ]
    return settings_by_step(
        [
            (round(height, 6), part.pins)
            for height, part in zip(on_plate, press_steps(laminate), strict=True)
        ],
        registration.pin_standard,
        registration.pin_lengths,
        press.plate_thickness,
    )


def plate_holes(laminate: Laminate, design: Design) -> dict[str, PinHole]:
    """Return the base plate's hole for every pin in use, by the pin's name."""
    return pin_holes(pins_by_step(laminate, design)[0])


def _underlay(laminate: Laminate, part: LayUpStep, press: Press) -> float:
    """Return the thickness of the underlay of a step, mm; 0 if nothing is laid by hand."""
    return press.underlay_thickness if is_laid_by_hand(laminate, part) else 0.0


class _Bed(NamedTuple):
    """The set-up around a stack: thickness of pad, plate and underlay, mm, and its pins."""

    pad: float
    plate: float
    underlay: float
    under: StackShape
    pins: tuple[PinSetting, ...]


def _step(
    laminate: Laminate,
    part: LayUpStep,
    press: Press,
    bed: _Bed,
    line: tuple[HeatPoint, ...],
    minutes: float | None,
) -> Step:
    estimate = build_up.pressures(press, bed.pad, bed.under)
    basis = build_up.pressure_basis(press, bed.pad, bed.under, estimate)
    count = stack_count(laminate, part.layers)
    return Step(
        step=part.number,
        title=_title(laminate, part, count),
        bond=part.bond,
        layers=part.layers,
        adds=part.adds,
        pins=tuple(pin.name for pin in part.pins),
        temperature_c=press.temperature_c,
        pressure_kpa=press.pressure_kpa,
        force_n=round(press.force_n, 1),
        platen_mm=press.platen,
        minutes=minutes,
        film_kpa=estimate.film,
        edge_kpa=estimate.edge,
        bond_kpa=estimate.bond,
        plate_kpa=estimate.plate,
        pressure_basis=basis + _round_pins(press, bed),
        build_up=tuple(_items(press, bed, _size(laminate, part))),
        pin_settings=bed.pins,
        instructions=_instructions(part, count),
        time_temperature=line,
        reason="" if part.joining is None else part.joining.reason,
    )


def _title(laminate: Laminate, part: LayUpStep, count: int) -> str:
    if part.joining is not None and len(part.layers) < len(laminate.layers):
        return f"Press of {layers_in_words(part.layers)}"
    if part.name == "flash_middle" and laminate.middle_first:
        return "All layers between base and cap"
    if part.name == "flash_bottom" and len(part.layers) > 2:
        return f"Bottom balloon{'s' * (count > 1)}, {layers_in_words(part.layers)}"
    return STEPS[part.name][count > 1]


def _size(laminate: Laminate, part: LayUpStep) -> tuple[float, float]:
    """Return the extent along x and y, mm, of the films of a step, tabs and ears included."""
    profiles = [layer.profile for layer in distinct_layers(laminate, part.layers)]
    low_x, low_y, high_x, high_y = zip(*(profile.bounds for profile in profiles), strict=True)
    return round(max(high_x) - min(low_x), 6), round(max(high_y) - min(low_y), 6)


def _round_pins(press: Press, bed: _Bed) -> str:
    beneath = bed.under.height + press.release_thickness + bed.underlay
    out = max((pin.stands_mm + pin.tolerance_mm - beneath for pin in bed.pins), default=0.0)
    return f"; up to {build_up.unpressed(press, out):.1f} mm round a pin none" if out else ""


def _items(press: Press, bed: _Bed, size: tuple[float, float]) -> Iterator[BuildUpPart]:
    """Yield the build-up from the lower platen up; ``size`` is the size of the films in mm."""
    release = BuildUpPart(RELEASE, press.release_film, press.release_thickness, press.platen)
    pad = f"{press.pad_material}, {press.pad_hardness:g} Shore A"
    yield BuildUpPart(BASE_PLATE, press.plate_material, bed.plate, press.platen)
    if bed.underlay:
        yield BuildUpPart(UNDERLAY, "plain paper, printed", bed.underlay, press.platen)
    yield release
    yield BuildUpPart(LAMINATE, "films of this step", round(bed.under.height, 6), size)
    yield release
    yield BuildUpPart(PAD, pad, bed.pad, press.platen)


def _instructions(part: LayUpStep, count: int) -> str:
    """Return the instructions of a step that makes ``count`` stacks side by side."""
    pins = [pin.name for pin in part.pins]
    stacks = ", then ".join(layers_in_words(stack) for stack in part.stacks if stack)
    on_pins = f"on the pin{'s' if len(pins) > 1 else ''} {joined_words(pins)}"
    if not part.adds:
        return f"Lay {stacks} down again, with no pin. Press to the full bond and let it cool flat."
    if part.bond == "full":
        how = on_pins if pins else "by eye, with no pin"
        return (
            f"Lay down {stacks}, {how}. Press to the full bond and let the laminate cool flat"
            + (", then draw the pins." if pins else ".")
        )
    by = on_pins if pins else "by hand"
    after = "Press to the flash bond" + (" and draw the pins." if pins else ".")
    nouns = "a stack" if count == 1 else f"{count} stacks"
    return f"Lay {stacks} on each other {by}, lowest first, as {nouns} of their own. {after}"


def seam_steps(laminate: Laminate) -> Iterator[SeamStep]:
    """Yield the seams of a laminate, in the order in which they are made."""
    for step in lay_up_steps(laminate):
        joining = step.joining
        if joining is None or joining.seam is None:
            continue
        seam = joining.seam
        bond = laminate.bond_of(laminate.layer(seam.below), laminate.layer(seam.above), seam.tool)
        laid = f"Lay {layers_in_words(step.adds)} in place by hand. " if step.adds else ""
        turn = TURN_OVER if joining.from_below else ""
        yield SeamStep(
            step=step.number,
            title=f"Seam {seam.name}",
            seam=seam.name,
            layers=step.layers,
            adds=step.adds,
            joins=(seam.below, seam.above),
            tool=seam.tool,
            kind=seam.kind,
            width_mm=seam.width,
            length_mm=round(seam.length, 6),
            temperature_c=None if bond is None else bond.temperature_c,
            speed_mm_s=None,
            instructions=f"{laid}{turn}{STAND_OUT if seam.kind == 'fin' else ''}Follow the path "
            f"with the middle of the {seam.tool}, {seam.width:g} mm wide: it bonds layers "
            f"{seam.below} and {seam.above}.",
            reason=joining.reason,
            from_below=joining.from_below,
        )


TURN_OVER = (
    "Turn the work over, left to right, so that the tool comes from below: the path is mirrored "
    "left to right. "
)
STAND_OUT = (
    "Fin seam: let the edges of both films stand out together, face to face, and weld them there. "
)


def fold_steps(laminate: Laminate) -> Iterator[FoldStep]:
    """Yield the folds of a laminate, in order."""
    for step in lay_up_steps(laminate):
        if step.joining is None or step.joining.fold is None:
            continue
        fold = step.joining.fold
        (x, y), (u, v) = fold.line
        masks = tuple(range(fold.lower + 1, fold.upper))
        laid = f", {layers_in_words(masks)} on its half {fold.lower}" if masks else ""
        yield FoldStep(
            step=step.number,
            title=f"Fold of layers {fold.lower} and {fold.upper}",
            layers=(fold.lower, fold.upper),
            line_mm=fold.line,
            instructions=f"Lay the film flat{laid}, and fold half {fold.upper} over along the line "
            f"from x {x:g}, y {y:g} to x {u:g}, y {v:g}.",
            reason=step.joining.reason,
        )


# Refusals, and warnings for the technician.


PINS_OUT = (
    "untested: with ears each full bond comes after a flash bond on the pins, and is pressed "
    "without them; that the flash bond keeps the layers in register was not tried on a bench"
)
PINS_IN = (
    "untested: the ears' pins stay in through the full bonds, where molten TPE can grip them; put "
    "a release sleeve on each or coat it with a release agent, and try it on a sample first"
)

MIDDLE_FIRST = (
    "untested: with the middle pressed first the base is pressed on together with the cap, in the "
    "last bond alone; try a sample, and look at its lowest bond"
)

HOTTEST_TRIED = 150.0
PRESSURES_TRIED = (70.0, 200.0)


def refuse_temperature(laminate: Laminate, press: Press) -> None:
    """Raise DesignError at a temperature that bonds no films, or is too hot for one or the pad."""
    pressed = pressed_layers(laminate)
    if not pressed:
        return
    is_set = f"press.temperature_c = {press.temperature_c:g}"
    for film in dict.fromkeys(layer.film for layer in pressed):
        melts = not film.is_mask and film.softens_above is not None
        if melts and press.temperature_c <= (film.softens_above or 0.0):
            raise DesignError(
                f"{is_set} does not bond {film.product}, which melts at {film.softens_above:g} C; "
                "set it higher than that"
                + (" (the paper presses at 135 C)" if film.product == PAPER_PRODUCT else "")
            )
        if press.temperature_c >= film.limit and film.material != FIRST[0]:
            is_ptfe = film.material == "PTFE"
            raise DesignError(
                f"{is_set} reaches the limit of {'the masks' if is_ptfe else film.material}, "
                f"{film.limit:g} C for {film.product}; lower it"
                + (", for hotter PTFE gives off toxic fumes" if is_ptfe else "")
            )
    _refuse_bonds(laminate, press, is_set)
    for interface in laminate.interfaces:
        below, above = interface.below, interface.above
        if interface.pressed and below.film.stays_solid and above.film.stays_solid:
            roles = " or the ".join(dict.fromkeys((below.role, above.role)))
            raise DesignError(
                f"layers {below.index} and {above.index} are of {below.film.material} and "
                f"{above.film.material}, which both stay solid in the press and do not bond; give "
                f"the {roles} another film in [layup]"
            )
    if press.temperature_c > build_up.PAD_LIMIT_C:
        raise DesignError(
            f"{is_set} exceeds the limit of a press pad of {press.pad_material}, "
            f"{build_up.PAD_LIMIT_C:g} C; lower it"
        )


def _refuse_bonds(laminate: Laminate, press: Press, is_set: str) -> None:
    """Raise DesignError if the press is too cold for its bonds, or too hot for later seams."""
    parts = [set(part.layers) for part in press_steps(laminate)]
    for gap in laminate.interfaces:
        below, above = gap.below.index, gap.above.index
        if not any({below, above} <= layers for layers in parts):
            continue
        pressed = laminate.bond_of(gap.below, gap.above, PRESS)
        if pressed is not None and (pressed.temperature_c or 0.0) > press.temperature_c:
            raise DesignError(
                f"{is_set} does not bond layers {below} and {above}, which "
                f"face_bonds.{pressed.name} bonds at {pressed.temperature_c:g} C; raise it"
            )
        for seam in gap.seams if pressed is None else ():
            bond = laminate.bond_of(gap.below, gap.above, seam.tool)
            melts = None if bond is None else bond.temperature_c
            if melts is not None and melts <= press.temperature_c:
                raise DesignError(
                    f"{is_set} would weld the whole area of layers {below} and {above}, which "
                    f"seam {seam.name} bonds locally at {melts:g} C; press before the seam, "
                    "lower the temperature, or add a mask between them"
                )


def _cautions(
    laminate: Laminate,
    design: Design,
    parts: Sequence[LayUpStep],
    steps: Sequence[Step],
) -> Iterator[Caution]:
    press, registration = design.press, design.registration
    yield from _of_films(laminate, press, parts)
    low, high = PRESSURES_TRIED
    is_tried = low <= press.pressure_kpa <= high
    if not is_tried:
        yield Caution(
            f"{press.pressure_kpa:g} kPa lies outside {low:g} to {high:g} kPa; 110 kPa is "
            "validated, and earlier work pressed at 70 kPa"
        )
    validated = design.rules.validated_balloons
    if laminate.balloons > validated:
        yield Caution(
            f"{laminate.balloons} balloons are more than the {validated} validated; "
            "heat must pass the whole laminate, so try the bond on a sample first"
        )
    elif (tall := max((step.stack_mm for step in steps), default=0.0)) > (
        most := design.rules.validated_height
    ):
        yield Caution(
            f"{tall:.3f} mm of films are more than the {most:g} mm validated; heat takes about "
            f"{(tall / most) ** 2:.1f} times as long to the middle, behind the plate's edge, so "
            "try the bond on a sample first"
        )
    uneven = [step for step in steps if is_tried and not low <= step.film_kpa <= high]
    if uneven:
        worst = max(uneven, key=lambda step: abs(step.film_kpa - press.pressure_kpa))
        yield Caution(
            f"step {worst.step}: the films get about {worst.film_kpa:.0f} kPa (estimate), outside "
            f"{low:g} to {high:g} kPa",
            "take a thicker or softer pad (press.pad_thickness, press.pad_hardness)",
        )
    if laminate.registration == "ears" and laminate.pins:
        yield Caution(PINS_IN if laminate.pins_in_full_bonds else PINS_OUT)
    if laminate.middle_first and parts[0].name == "flash_middle":
        yield Caution(MIDDLE_FIRST)
    pad = next((i.thickness_mm for s in steps for i in s.build_up if i.part == PAD), 0.0)
    if (pile := build_up.pad_sheets(pad)) > 1:
        yield Caution(
            f"the press pad is a pile of {pile} sheets, {pad:g} mm high together, which may "
            "slide aside: hold it in a frame, and see whether the press opens so far"
        )
    diameters = sorted({pin.diameter for pin in laminate.pins})
    unsold = [f"{d:g}" for d in diameters if not is_sold(d, registration.pin_standard)]
    if unsold and not registration.pin_lengths:
        yield Caution(
            f"{registration.pin_standard} has no dowel pin of diameter {joined_words(unsold)}",
            "change the diameter, or make the pins and give their lengths in "
            "registration.pin_lengths",
        )
    for step, part in zip(steps, parts, strict=True):
        if step.bond == "flash" and (layers := _unpinned(laminate, part)):
            roles = Counter(laminate.layer(index).role for index in layers)
            by_role = joined_words([f"the {count} {role}s" for role, count in roles.items()])
            which = layers_in_words(layers) if len(layers) < 4 else by_role
            words = f"step {step.step}: no pin holds {which}; align by hand"
            yield Caution(words, at_step=True)


STATED_C = 135.0
"""Temperature that the paper states its minutes for, C (Sec. 2)."""


def _of_films(laminate: Laminate, press: Press, parts: Sequence[LayUpStep]) -> Iterator[Caution]:
    """Yield warnings of films without stated minutes or melting point, or pressed too hot.

    The paper's minutes apply to its temperature. The user stated all other minutes, including those
    for films that the paper did not press.
    """
    heat, pressed = f"{press.temperature_c:g} C", pressed_layers(laminate)
    untimed = films_without_minutes(laminate, press.timed_films)
    if untimed:
        names = joined_words([f'"{film.said}"' for film in untimed])
        stated = joined_words([f"{product}, {size:g} mm" for product, size in press.timed_films])
        yield Caution(
            f"the minutes are blank: they were stated for {stated or 'no film'}, and none for "
            f"{names}; try the bond on a sample at {heat}",
            "set press.temperature_c, press.pressure_kpa and the press minutes to what held, and "
            "name the film in press.minutes_for",
        )
    blank = [str(part.number) for part in parts if minutes_closed(press, part.name) is None]
    if blank and not untimed:
        yield Caution(
            f"the minutes of step{'s' * (len(blank) > 1)} {joined_words(blank)} are blank, for "
            f"nobody stated them; try the bond on a sample at {heat}",
            "set the press minutes to what held",
        )
    for film in dict.fromkeys(layer.film for layer in pressed):
        if not film.is_mask and film.softens_above is None and not film.stays_solid:
            yield Caution(
                f"no melting point of {film.product} is known, so nobody has checked that "
                f"{heat} bonds it",
                f"add {film.table}.melting_point, in C",
            )
    if not any(layer.film.is_a(PAPER_PRODUCT, PAPER_THICKNESS) for layer in pressed):
        return
    paper = Press.model_construct()
    usual = [
        str(part.number)
        for part in parts
        if minutes_closed(press, part.name) == minutes_closed(paper, part.name)
    ]
    if usual and not untimed and press.temperature_c != STATED_C:
        which = f" of step{'s' * (len(usual) > 1)} {joined_words(usual)}"
        yield Caution(
            f"minutes{which if len(usual) < len(parts) else ''} stated for {STATED_C:g} C, the "
            f"press is set to {heat}: nobody stated minutes for that, so try the bond on scrap "
            "first, and set the press minutes to what held"
        )
    if press.temperature_c > HOTTEST_TRIED:
        yield Caution(
            f"{heat} is hotter than the {HOTTEST_TRIED:g} C of earlier work, which already "
            "over-melted more than 135 C does"
        )


def _unpinned(laminate: Laminate, part: LayUpStep) -> list[int]:
    """Return the layers that join in a step, or in a bonded stack, without a pin."""
    pinned = {
        layer.pattern
        for layer in distinct_layers(laminate, part.layers)
        if not set(part.pins).isdisjoint(laminate.pins_holding(layer))
    }
    bodies: list[tuple[int, ...]] = [(index,) for index in part.adds]
    bodies += [stack for stack in part.stacks if set(stack).isdisjoint(part.adds)]
    loose = [b for b in bodies if pinned.isdisjoint(laminate.layer(i).pattern for i in b)]
    return sorted(index for body in loose for index in body)
