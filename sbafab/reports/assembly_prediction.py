"""What an assembly does inflated: reach, load, grip in its lumen, and what its parts then touch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.design.records import Discs, Slots
from sbafab.models.figures import REACHED, WIDEST
from sbafab.models.lens import fullest, rate
from sbafab.models.paper import BALLOON, FLAT_HEIGHT_OF_FILMS, counterpart, counterparts_of_pose
from sbafab.models.stack import Stack, stack
from sbafab.reports.inflated import TOUCHING, apart, as_it_is, carried, lifted, shared, solids

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose
    from sbafab.reports.inflated import Solids

# What an arm of an assembly meets, or how far it stays clear, when some chambers bend it.
#
# Each chamber alone and each two side by side are pressed, the others empty, while every other
# actuator stands inflated; what stands on the arm goes along with its tip.


FARTHEST = 10.0
"""mm up to which clearances are looked for."""
SLIGHTEST = 0.1
"""kPa, the least at which an arm is looked at."""
HALVINGS = 5
FOOT = 3
"""Levels from below that may rest on what the arm stands on."""


class Clearance(NamedTuple):
    """Mm that are left between a bent arm, with what stands on it, and another part."""

    other: str
    chambers: str
    gap: float


class BentTouch(NamedTuple):
    """An arm that shares ``volume`` mm3 with another part when its ``chambers`` are pressed.

    It meets it from about ``from_kpa`` on, bent by ``bend`` degrees.
    """

    part: str
    other: str
    chambers: str
    volume: float
    from_kpa: float
    bend: float


class _Around(NamedTuple):
    """An arm and what is round it: ``carried`` are solids on its top, when it is flat."""

    placed: PlacedSba
    found: Stack
    lift: NDArray[np.float64]
    carried: Solids
    others: dict[str, Solids]


def bent_arms(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
    pause: Callable[[], None] = lambda: None,
) -> Iterator[Clearance | BentTouch]:
    """For each other part the least clearance, or each way of bending in which the arm meets it.

    ``rises`` says by what each actuator lifts what stands on it. Of what it stands
    on and of parts that stay farther away than ``FARTHEST`` no clearance is said.
    """
    found = stacks[placed.name]
    if found.chambers < 2:
        return
    around = _around(assembled, placed, stacks, rises, pressure)
    nearest: dict[str, Clearance] = {}
    met = set()
    for pressed in _ways(found.chambers):
        pause()
        names = " and ".join(placed.made.laminate.chambers[i].name for i in pressed)
        own = _moved(around, _bent(found, pressed, pressure))
        for other, theirs in around.others.items():
            volume = shared(own.beyond(other, placed), theirs)
            if volume > TOUCHING:
                met.add(other)
                first = _first(around, other, pressed, pressure)
                yield BentTouch(
                    placed.name, other, names, volume, first.pressures[pressed[0]], first.bend
                )
                continue
            if other == placed.part.on:
                continue
            gap = _gap(own.beyond(other, placed), theirs)
            if gap < min(FARTHEST, nearest[other].gap if other in nearest else FARTHEST):
                nearest[other] = Clearance(other, names, gap)
    yield from (one for other, one in nearest.items() if other not in met)


def _ways(chambers: int) -> list[tuple[int, ...]]:
    """Which chambers are pressed: each alone, and each two side by side."""
    alone: list[tuple[int, ...]] = [(i,) for i in range(chambers)]
    return alone + [(i, (i + 1) % chambers) for i in range(chambers) if chambers > 2]


def _bent(found: Stack, pressed: Sequence[int], pressure: float) -> Pose:
    return found.pose(tuple(pressure if i in pressed else 0.0 for i in range(found.chambers)))


def _around(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> _Around:
    moving = carried(assembled, placed.name)
    lift = lifted(assembled, placed, rises)
    on_top: Solids = []
    others = {}
    for other in assembled.parts:
        if other.name == placed.name or other.part.kind == "line":
            continue
        raised = lifted(assembled, other, rises)
        if other.name in moving:
            raised = raised - rises[placed.name]
        if isinstance(other, PlacedSba) and other.name in stacks:
            own = stacks[other.name]
            made = solids(other, own, own.pose((pressure,) * own.chambers), raised)
        else:
            made = as_it_is(other, raised)
        if other.name in moving:
            on_top += made
        else:
            others[other.name] = made
    return _Around(placed, stacks[placed.name], lift, on_top, others)


class _Arm(NamedTuple):
    """A bent arm's solids with those that stand on it; ``foot`` are those of its lowest levels."""

    foot: Solids
    rest: Solids

    def beyond(self, other: str, placed: PlacedPart) -> Solids:
        """What may meet another part: not its foot what it stands on."""
        return self.rest if other == placed.part.on else self.foot + self.rest


def _moved(around: _Around, pose: Pose) -> _Arm:
    """The bent arm and what stands on it."""
    places = around.placed.upright(pose.frames[0]) + around.lift
    levels = (places[1:] + places[:-1]) / 2
    arm = _Arm([], [])
    for one in solids(around.placed, around.found, pose, around.lift):
        middle = np.array(one.bounding_box()).reshape(2, 3).mean(0)
        level = int(np.linalg.norm(levels - middle, axis=1).argmin())
        (arm.foot if level < FOOT else arm.rest).append(one)
    if not around.carried:
        return arm
    # From the flat arm's top to the bent one's, in the arm's own frame, then in the assembly's.
    tip = np.eye(4)
    tip[:3, :3] = pose.frames[1][-1]
    tip[:3, 3] = pose.tip - tip[:3, :3] @ np.array([0.0, 0.0, around.found.flat_height])
    frame = _frame(around.placed)
    frame[:3, 3] += around.lift
    rows = np.ascontiguousarray((frame @ tip @ np.linalg.inv(frame))[:3])
    return arm._replace(rest=arm.rest + [one.transform(rows) for one in around.carried])


def _frame(placed: PlacedPart) -> NDArray[np.float64]:
    """Matrix (4, 4) of a part's own frame in the assembly's."""
    corners = placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    found = np.eye(4)
    found[:3, 3] = corners[0]
    found[:3, :3] = (corners[1:] - corners[0]).T
    return found


def _gap(own: Solids, theirs: Solids) -> float:
    """Mm between the nearest two, at most ``FARTHEST``."""
    least = FARTHEST
    pairs = ((apart(a, b), a, b) for a in own for b in theirs)
    for boxes, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if boxes >= least:
            break
        least = min(least, float(a.min_gap(b, least)))
    return least


def _first(around: _Around, other: str, pressed: Sequence[int], pressure: float) -> Pose:
    """About the first pose in which the arm meets another part, on the way to a pressure."""
    low, high = min(SLIGHTEST, pressure / 2), pressure
    pose = _bent(around.found, pressed, high)
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        tried = _bent(around.found, pressed, middle)
        own = _moved(around, tried).beyond(other, around.placed)
        if shared(own, around.others[other]) > TOUCHING:
            high, pose = middle, tried
        else:
            low = middle
    return pose


GRAVITY = 9.80665
MARBLE_G = 1.2
"""Mass of the marble that the paper's brace lifts, g (Sec. 5)."""
ELASTIC = "elastic stack"
LENS = f"{REACHED}, virtual work p dV/dh"
STATIC = "statics"
IN_THE_LUMEN = (
    "height of a balloon in the lumen",
    "push of each stack on the wall",
    "friction",
)
SEVERAL = 3
"""Chambers of an arm that bends."""
PAPERS = ("aperture", "brace", "standing")
"""The assemblies that the paper built: figures of others stand beside nothing."""


class AssemblyFigure(NamedTuple):
    """One figure of a part: value in ``unit``, model, and what the paper says, if it does.

    ``measured`` is what it measured of a single actuator, where the model is off by more than a
    quarter of that.
    """

    part: str
    name: str
    value: float
    unit: str
    model: str
    paper: str = ""
    measured: str = ""


class Touch(NamedTuple):
    """Two parts that share ``volume`` mm3 when the first one is inflated."""

    part: str
    other: str
    volume: float


class AssemblyPrediction(NamedTuple):
    """Figures at ``pressure_kpa``; ``touches`` are parts in each other's way when all stand up
    straight, ``bent_touches`` what arms meet when bent; ``left_out`` says what no model reaches.
    """

    name: str
    pressure_kpa: float
    load_g: float
    figures: tuple[AssemblyFigure, ...]
    touches: tuple[Touch, ...]
    left_out: tuple[str, ...]
    bent_touches: tuple[BentTouch, ...] = ()

    def met(self) -> list[str]:
        """Sentences on what inflated parts meet, and what would mend it."""
        said = [
            f"{touch.part} and {touch.other} meet when inflated: they share "
            f"{touch.volume:.2f} mm3; move them apart, or give less pressure"
            for touch in self.touches
        ]
        said += [
            f"press {bent.chambers} of {bent.part} to less than {bent.from_kpa:.2g} kPa, or move "
            f"{bent.other}: from there on, bent by {bent.bend:.0f} degrees, they meet, and at "
            f"{self.pressure_kpa:g} kPa they share {bent.volume:.2f} mm3 "
            f"({counterparts_of_pose(SEVERAL)['bend'].sentence()})"
            for bent in self.bent_touches
        ]
        if not self.touches:
            how = "standing straight" if self.bent_touches else "straight or bent"
            said.append(f"no inflated part meets another one, {how}")
        return said


class Grip(NamedTuple):
    """A radial actuator: diameters ``deflated``, inflated ``free``, out of any lumen, and ``most``,
    the upper end, in mm.

    In the assembly's ``lumen`` a balloon is ``room`` mm high; each stack pushes on the wall with
    ``push`` N a kPa. Both are None without a lumen that it reaches.
    """

    part: str
    deflated: float
    free: float
    most: float
    lumen: float | None = None
    room: float | None = None
    push: float | None = None

    @property
    def why_none(self) -> str:
        """Why nothing is told of its hold in the lumen."""
        if self.lumen is None:
            return "no lumen is given: set deploy.lumen_diameter"
        if self.deflated >= self.lumen:
            return (
                f"deflated it is {self.deflated:.2f} mm wide already, in a lumen of "
                f"{self.lumen:g} mm; make it narrower"
            )
        return (
            f"its stacks do not touch the wall: {self.free:.2f} mm by the lens of two arcs in a "
            f"lumen of {self.lumen:g} mm; use wider or longer chambers, more balloons or a thicker "
            "tube"
        )


def predict_assembly(
    assembled: Assembled,
    pressure_kpa: float = 10.0,
    load_g: float = MARBLE_G,
    pause: Callable[[], None] = lambda: None,
) -> AssemblyPrediction:
    """What the parts do at one pressure, with a mass at the tips; the paper's marble has 1.2 g.

    ``pause`` is called between parts of the work, which takes seconds; what it raises ends it.
    Raises DesignError for pressures that the models do not reach.
    """
    figures: list[AssemblyFigure] = []
    touches: list[Touch] = []
    left_out: list[str] = []
    bent: list[BentTouch] = []
    stacks = _stacks(assembled)
    rises = {name: _rise(assembled[name], one, pressure_kpa) for name, one in stacks.items()}
    for placed in assembled.parts:
        if not isinstance(placed, PlacedSba):
            continue
        pause()
        pockets = placed.made.design.form.pockets
        if isinstance(pockets, Slots):
            held = grip(assembled, placed)
            assert held is not None
            figures += _held(held, placed.made.design.form.stacks, pressure_kpa, load_g)
            if held.push is None:
                left_out.append(f"{placed.name}, {', '.join(IN_THE_LUMEN)}: {held.why_none}")
        elif isinstance(pockets, Discs):
            figures += _arm(placed, stacks[placed.name], pressure_kpa, load_g)
            touches += _touches(assembled, placed, stacks, rises, pressure_kpa)
            pause()
            for bend in bent_arms(assembled, placed, stacks, rises, pressure_kpa, pause):
                if isinstance(bend, Clearance):
                    what = f"clearance to {bend.other}, bent by {bend.chambers}"
                    figures.append(AssemblyFigure(placed.name, what, bend.gap, "mm", ELASTIC))
                else:
                    bent.append(bend)
        else:
            left_out.append(f"{placed.name}: no model knows the form of a drawn pocket outline")
    if assembled.assembly.name not in PAPERS:
        figures = [figure._replace(paper="") for figure in figures]
    return AssemblyPrediction(
        assembled.assembly.name,
        pressure_kpa,
        load_g,
        tuple(figures),
        tuple(touches),
        tuple(left_out),
        tuple(bent),
    )


def as_json(found: AssemblyPrediction) -> dict[str, object]:
    """The same for programs."""
    return {
        **found._asdict(),
        "figures": [figure._asdict() for figure in found.figures],
        "touches": [touch._asdict() for touch in found.touches],
        "bent_touches": [touch._asdict() for touch in found.bent_touches],
    }


def _arm(
    placed: PlacedSba, found: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Height, reach, bend and load of an actuator with round pockets."""
    for figure in _figures_of_arm(placed, found, pressure, load_g):
        beside = counterpart(placed.made.design.form, *_as_predicted(figure.name, pressure))
        yield figure._replace(measured=beside.sentence() if beside else "")


def _as_predicted(name: str, pressure: float) -> tuple[str, str]:
    """The figure of a design's own prediction that says the same, and its model."""
    at = f"at {pressure:g} kPa"
    known = {
        "height, flat": ("deflated height", FLAT_HEIGHT_OF_FILMS),
        "height, inflated": (f"free height {at}", BALLOON),
        "push at 75 % of its stroke": (f"blocked force {at}, at 75 % of full stroke", ELASTIC),
        "bend by one chamber": (f"bend {at} in one chamber, the others empty", ELASTIC),
        "reach of the tip aside": (f"tip aside {at} in one chamber, the others empty", ELASTIC),
    }
    # A sag is a load over a stiffness.
    return known.get(name, (f"lateral tip stiffness {at}, pressure held", ELASTIC))


def _figures_of_arm(
    placed: PlacedSba, found: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    name, weight = placed.name, load_g * 1e-3 * GRAVITY
    every = (pressure,) * found.chambers
    free = found.pose(every)
    flat = found.flat_height
    yield AssemblyFigure(name, "height, flat", flat, "mm", ELASTIC, "about 1 (Sec. 6)")
    yield AssemblyFigure(name, "height, inflated", free.height, "mm", ELASTIC, "about 20 (Sec. 5)")
    three_quarters = found.pose(every, plate=flat + 0.75 * (free.height - flat))
    yield AssemblyFigure(name, "push at 75 % of its stroke", three_quarters.force, "N", ELASTIC)
    if found.chambers > 1:
        one = found.pose((pressure, *(0.0,) * (found.chambers - 1)))
        yield AssemblyFigure(name, "bend by one chamber", one.bend, "deg", ELASTIC)
        aside = float(np.hypot(*one.tip[:2]))
        yield AssemblyFigure(name, "reach of the tip aside", aside, "mm", ELASTIC)
    if weight > 0:
        hung = found.pose(every, tip_load=(weight, 0.0, 0.0), near=free)
        sag = float(np.linalg.norm(hung.tip - free.tip))
        said = "lifts 1.2 g (Sec. 5)" if load_g == MARBLE_G else ""
        yield AssemblyFigure(
            name, f"sag of the tip, {load_g:g} g across it", sag, "mm", ELASTIC, said
        )


def grip(assembled: Assembled, placed: PlacedSba) -> Grip | None:
    """How a radial actuator holds in the assembly's lumen; None for one of another form."""
    form, laminate = placed.made.design.form, placed.made.laminate
    pockets = form.pockets
    if not isinstance(pockets, Slots):
        return None
    tube = form.wrap.tube_diameter if form.wrap is not None else 2 * (placed.radius or 0.0)
    balloons = laminate.balloons
    deflated = tube + 2 * laminate.thickness
    rise, widest = fullest(pockets.width, pockets.run).stroke, 2 * pockets.width / math.pi
    free, most = (deflated + 2 * balloons * high for high in (rise, widest))
    lumen = assembled.assembly.deploy.lumen_diameter
    found = Grip(placed.name, deflated, free, most, lumen)
    if lumen is None:
        return found
    room = (lumen - deflated) / 2 / balloons
    if not 0 < room <= rise:
        return found
    # 1 kPa mm2 is 1 mN.
    push = float(rate(room, pockets.width, pockets.run)) / 1000
    return found._replace(room=room, push=push)


def _held(found: Grip, stacks: int, pressure: float, load_g: float) -> Iterator[AssemblyFigure]:
    """Diameter of a radial actuator, and how hard its stacks hold in the assembly's lumen."""
    name, paper = found.part, "about 28 (Sec. 2.1)"
    said = (
        ("diameter, deflated", found.deflated, "films", "15.33 (Sec. 2.1)"),
        ("diameter, inflated free", found.free, REACHED, paper),
        ("diameter, inflated at most", found.most, WIDEST, paper),
    )
    for what, value, model, paper in said:
        yield AssemblyFigure(name, what, value, "mm", model, paper)
    if found.room is None or found.push is None:
        return
    force = pressure * found.push
    height, push, friction = IN_THE_LUMEN
    lumen = f"{height} of {found.lumen:g} mm"
    yield AssemblyFigure(name, lumen, found.room, "mm", STATIC)
    yield AssemblyFigure(name, push, force, "N", LENS, "holds (Sec. 5)")
    if load_g > 0:
        needed = load_g * 1e-3 * GRAVITY / (stacks * force)
        hold = f"{friction} that holds {load_g:g} g along the lumen"
        yield AssemblyFigure(name, hold, needed, "", STATIC)


def _stacks(assembled: Assembled) -> dict[str, Stack]:
    """The stacks of all actuators with round pockets, by part; alike ones are one."""
    known: dict[int, Stack] = {}
    found = {}
    for placed in assembled.parts:
        if isinstance(placed, PlacedSba) and isinstance(placed.made.design.form.pockets, Discs):
            key = id(placed.made)
            if key not in known:
                known[key] = stack(placed.made.design, placed.made.laminate)
            found[placed.name] = known[key]
    return found


def _rise(placed: PlacedPart, found: Stack, pressure: float) -> NDArray[np.float64]:
    """By what (3,) in mm an actuator lifts what stands on its top."""
    free = found.pose((pressure,) * found.chambers)
    ends = np.array([[0.0, 0.0, found.flat_height], [0.0, 0.0, free.height]])
    low, high = placed.upright(ends)
    lift: NDArray[np.float64] = high - low
    return lift


def _touches(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> Iterator[Touch]:
    """Other parts that an actuator meets when all stand up straight."""
    names = [part.name for part in assembled.parts]
    own = _upright(placed, stacks[placed.name], pressure, lifted(assembled, placed, rises))
    moved = carried(assembled, placed.name)
    for other in assembled.parts:
        # What stands on it moves along, and what it stands on it touches as it does flat.
        if other.name in moved or other.name == placed.part.on or other.part.kind == "line":
            continue
        lift = lifted(assembled, other, rises)
        if isinstance(other, PlacedSba) and other.name in stacks:
            if names.index(other.name) < names.index(placed.name):
                continue  # each pair once
            theirs = _upright(other, stacks[other.name], pressure, lift)
        else:
            theirs = as_it_is(other, lift)
        volume = shared(own, theirs)
        if volume > TOUCHING:
            yield Touch(placed.name, other.name, volume)


def _upright(placed: PlacedSba, found: Stack, pressure: float, lift: NDArray[np.float64]) -> Solids:
    return solids(placed, found, found.pose((pressure,) * found.chambers), lift)
