"""preview/stack.svg: the section through one chamber, its height exaggerated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Interval, coord, section
from sbafab.laminate.assembly import assembly
from sbafab.laminate.films import Film, ink
from sbafab.laminate.laminate import Inlet, Interface, Laminate, Layer, Pin
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import BOND, length

# The dowel pins that the section cuts: the layers each passes through, and its press steps.


@dataclass(frozen=True)
class Rod:
    """A pin in the plane of the section, from ``span`` start to end.

    It holds the layers ``stacks``, the lowest and highest index of each stack pressed by itself,
    and is in place at the press steps ``steps``.
    """

    name: str
    span: Interval
    stacks: tuple[tuple[int, int], ...]
    steps: tuple[int, ...]

    @property
    def middle(self) -> float:
        return (self.span[0] + self.span[1]) / 2

    @property
    def words(self) -> str:
        many = "s" if len(self.steps) > 1 else ""
        return f"pin {self.name}, step{many} {', '.join(map(str, self.steps))}"


def rods(laminate: Laminate, origin: Point, direction: Point) -> tuple[Rod, ...]:
    """The pins that a vertical plane meets, in the laminate's order; places from ``origin``."""
    pin_rods = []
    for pin in laminate.pins:
        dx, dy = pin.centre[0] - origin[0], pin.centre[1] - origin[1]
        along, aside = dx * direction[0] + dy * direction[1], dx * direction[1] - dy * direction[0]
        radius = pin.diameter / 2
        if abs(aside) < radius:
            half = math.sqrt(radius**2 - aside**2)
            stacks, steps = _stands(laminate, pin)
            pin_rods.append(Rod(pin.name, (along - half, along + half), stacks, steps))
    return tuple(rod for rod in pin_rods if rod.stacks)


def _stands(laminate: Laminate, pin: Pin) -> tuple[tuple[tuple[int, int], ...], tuple[int, ...]]:
    """Lowest and highest layer that the pin holds, stack by stack, and the steps."""
    pinned = {
        layer.index
        for layers in laminate.patterns.values()
        if pin in laminate.pins_holding(layers[0])
        for layer in layers
    }
    steps = [step for step in assembly(laminate) if pin in step.pins]
    spans = [
        (min(joined), max(joined)) for step in steps if (joined := pinned.intersection(step.layers))
    ]
    whole = [
        span
        for span in dict.fromkeys(spans)
        if not any(a <= span[0] and span[1] <= b for a, b in spans if (a, b) != span)
    ]
    return tuple(whole), tuple(step.number for step in steps)


# The section through one chamber: which layers it shows and where each is cut.


MOST_BALLOONS = 4
"""Most balloons shown in full."""
BEYOND_LUMEN = 3.25


@dataclass(frozen=True)
class SectionSlab:
    """A layer cut by the plane: the spans with film."""

    layer: Layer
    spans: tuple[Interval, ...]


@dataclass(frozen=True)
class Joint:
    """An interface cut by the plane: the spans where the films are bonded."""

    interface: Interface
    spans: tuple[Interval, ...]

    @property
    def layer(self) -> int:
        """Index of the layer at whose height it is drawn: a mask, or the film above."""
        masks = self.interface.masks
        return masks[0].index if masks else self.interface.above.index


@dataclass(frozen=True)
class FoldEnd:
    """A fold cut by the plane, at ``s`` along it; its film is on the far or the near side."""

    lower: Layer
    upper: Layer
    s: float
    is_ahead: bool


@dataclass(frozen=True)
class StackSection:
    """The cut, in mm along the plane from the chamber's axis, positive toward its inlet.

    ``hidden`` balloons are left out above the layer ``break_above`` (an index; 0 for none).
    ``lumen`` is the position of the actuator's axis along the plane, if it has a lumen.
    ``cropped``: the section beyond ``low`` is not shown. ``tab`` runs from the outline to its
    mouth. ``is_bored``: the chamber's axis runs through bores.
    """

    chamber: str
    slabs: tuple[SectionSlab, ...]
    joints: tuple[Joint, ...]
    low: float
    high: float
    cropped: bool
    lumen: float | None
    tab: Interval | None
    hidden: int
    break_above: int
    rods: tuple[Rod, ...]
    folds: tuple[FoldEnd, ...] = ()
    is_bored: bool = True


def chamber_section(laminate: Laminate) -> StackSection:
    """The section in the plane of the first chamber's axis and its inlet.

    Without a chamber it is the section along x through the first port.
    """
    name, origin = _axis(laminate)
    inlet = next((candidate for candidate in laminate.inlets if candidate.chamber == name), None)
    direction = inlet.direction if inlet else (1.0, 0.0)
    layers, hidden, break_above = _shown(laminate)
    lumen = -(origin[0] * direction[0] + origin[1] * direction[1]) if laminate.lumen else None
    patterns = {layer.pattern: layer.profile for layer in layers}
    if not any(section(region, origin, direction) for region in patterns.values()):
        # The chamber lies outside every layer: rule sealing reports it, the picture shows the
        # films.
        low_x, low_y, high_x, high_y = laminate.layers[0].profile.bounds
        origin = ((low_x + high_x) / 2, (low_y + high_y) / 2)
    cuts = {name: section(region, origin, direction) for name, region in patterns.items()}
    ends = [end for spans in cuts.values() for span in spans for end in span]
    low, high = min(ends), max(ends)
    crop = low if lumen is None else max(low, lumen - (laminate.lumen or 0) / 2 - BEYOND_LUMEN)
    shown = {layer.index for layer in layers}
    joints = [
        Joint(interface, _clipped(section(interface.bond, origin, direction), crop))
        for interface in laminate.interfaces
        if (interface.masks or interface.seams)
        and shown.issuperset(mask.index for mask in interface.masks)
        and (interface.masks or shown.issuperset(interface.layer_indices))
    ]
    slabs = [SectionSlab(layer, _clipped(cuts[layer.pattern], crop)) for layer in layers]
    return StackSection(
        name,
        tuple(slabs),
        tuple(joints),
        crop,
        high,
        crop > low,
        lumen,
        _tab(inlet, origin) if inlet else None,
        hidden,
        break_above,
        tuple(rod for rod in rods(laminate, origin, direction) if rod.span[0] > crop),
        tuple(_fold_ends(laminate, slabs, origin, direction)),
        bool(laminate.bores),
    )


def _fold_ends(
    laminate: Laminate, slabs: Sequence[SectionSlab], origin: Point, direction: Point
) -> Iterator[FoldEnd]:
    """Yield the folds cut by the plane, if the films shown end at them."""
    spans = {slab.layer.index: slab.spans for slab in slabs}
    for fold in laminate.folds:
        (x, y), (u, v) = fold.line
        along = direction[0] * (v - y) - direction[1] * (u - x)
        if abs(along) < 1e-9 * math.dist((x, y), (u, v)):
            continue
        s = ((x - origin[0]) * (v - y) - (y - origin[1]) * (u - x)) / along
        both = laminate.layer(fold.lower), laminate.layer(fold.upper)
        for start, end in spans.get(fold.lower, ()):
            if abs(start - s) < 1e-6 or abs(end - s) < 1e-6:
                yield FoldEnd(*both, s, abs(start - s) < 1e-6)


def _axis(laminate: Laminate) -> tuple[str, Point]:
    """The name and place of the first chamber's axis, or of the first port."""
    if not laminate.chambers:
        port = laminate.ports[0]
        return port.name, port.at
    chamber = laminate.chambers[0]
    bored = (bore.centre for bore in laminate.bores if bore.chamber == chamber.name)
    return chamber.name, next(bored, chamber.centres[0])


def _tab(inlet: Inlet, origin: Point) -> Interval:
    (x, y), (u, v) = inlet.mouth, inlet.direction
    mouth = (x - origin[0]) * u + (y - origin[1]) * v
    return mouth - inlet.length, mouth


def _shown(laminate: Laminate) -> tuple[tuple[Layer, ...], int, int]:
    """The layers to show, the number of balloons left out, and the layer above which they are."""
    count = laminate.balloons
    if count <= MOST_BALLOONS:
        return laminate.layers, 0, 0
    bottom = [layer for layer in laminate.layers if layer.balloon is None or layer.balloon <= 2]
    top = [
        layer
        for layer in laminate.layers
        if layer.balloon == count or (layer.balloon == count - 1 and layer.role == "separator-mask")
    ]
    return (*bottom, *top), count - 3, bottom[-1].index


def _clipped(spans: Sequence[Interval], low: float) -> tuple[Interval, ...]:
    return tuple((max(start, low), end) for start, end in spans if end > low)


def opening(spans: Sequence[Interval], at: float) -> Interval | None:
    """The opening between two spans that holds ``at``; None if ``at`` is covered or outside."""
    before = [end for _, end in spans if end <= at]
    after = [start for start, _ in spans if start >= at]
    if not before or not after or any(start < at < end for start, end in spans):
        return None
    return max(before), min(after)


PAGE_WIDTH = 297.0
LEFT, RIGHT = 56.0, 56.0
HEAD, FOOT = 42.0, 36.0
TALLEST = 120.0
TALLEST_FILM = 8.0
BREAK = 13.0
ROW_STEP = 6.0
SLIT = 0.18
"""Share of the gap drawn open above and below a mask, to show what does not bond."""
EXAGGERATIONS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
STEEL = "#ccd2d8"
SEAM = 1.0
"""Height of a bond without a gap on the page, mm."""
PAST = 2.0
"""Length by which a pin's axis extends past its ends, mm."""

SectionDimension = tuple[Interval, str]
"""A stretch of the section to dimension, and its name (may be empty)."""


@dataclass(frozen=True)
class StackView:
    """The place of the section on the page."""

    section: StackSection
    across: float
    factor: int
    height: float

    @property
    def up(self) -> float:
        """Page mm per mm of laminate height."""
        return self.across * self.factor

    def x(self, s: float) -> float:
        return LEFT + (s - self.section.low) * self.across

    def y(self, z: float, index: int) -> float:
        """Page height of ``z`` in the layer with this index."""
        return HEAD + self.height - (z - self._left_out(index)) * self.up - self._lift(index)

    def _left_out(self, index: int) -> float:
        """Height of the layers the break leaves out below a layer."""
        if not self.section.hidden or index <= self.section.break_above:
            return 0.0
        below = [
            slab for slab in self.section.slabs if slab.layer.index <= self.section.break_above
        ]
        above = self.section.slabs[len(below)].layer
        last = below[-1].layer
        return above.z - last.z - last.film.thickness

    def _lift(self, index: int) -> float:
        return BREAK if self.section.hidden and index > self.section.break_above else 0.0


def stack_svg(laminate: Laminate) -> str:
    """The section through the first chamber in the plane of its inlet, labelled, on A4."""
    view = _view(chamber_section(laminate))
    page = view.height + HEAD + FOOT
    elements = [
        *_heading(laminate, view),
        *(part for rod in view.section.rods for part in _rod(rod, view)),
        *(part for joint in view.section.joints for part in _joint(joint, view)),
        *(part for slab in view.section.slabs for part in _slab(slab, view)),
        *(part for joint in view.section.joints for part in _seam(joint, view)),
        *(part for fold in view.section.folds for part in _fold(fold, view)),
        *_breaks(view),
        *_dimensions_above(view),
        *_dimensions_below(view),
        *_labels(view),
        *_legend(view, page),
    ]
    return draw.document(PAGE_WIDTH, page, f"{laminate.name}: section", elements)


def _view(section: StackSection) -> StackView:
    across = (PAGE_WIDTH - LEFT - RIGHT) / (section.high - section.low)
    thickness = sum(slab.layer.film.thickness for slab in section.slabs)
    thickest = max(slab.layer.film.thickness for slab in section.slabs)
    most = min(TALLEST / thickness, TALLEST_FILM / thickest) / across
    factor = max(step for step in EXAGGERATIONS if step <= max(most, 1.0))
    height = thickness * across * factor + (BREAK if section.hidden else 0.0)
    return StackView(section, across, factor, height)


def _slab(slab: SectionSlab, view: StackView) -> list[str]:
    layer = slab.layer
    line = ink(layer.film).line
    inset = SLIT * layer.film.thickness if layer.is_mask else 0.0
    bottom = view.y(layer.z + inset, layer.index)
    top = view.y(layer.z + layer.film.thickness - inset, layer.index)
    fill = draw.film_fill(layer.film)
    return [
        draw.box((view.x(start), top), (view.x(end), bottom), fill=fill, stroke=line)
        for start, end in slab.spans
    ]


def _joint(joint: Joint, view: StackView) -> list[str]:
    interface, index = joint.interface, joint.layer
    if not interface.masks:
        return []
    bottom, top = view.y(interface.z, index), view.y(interface.z + interface.gap, index)
    return [
        draw.box((view.x(start), top), (view.x(end), bottom), fill=BOND)
        for start, end in joint.spans
    ]


def _seam(joint: Joint, view: StackView) -> list[str]:
    """The bonds of a gap without masks, over the line on which the films lie on each other."""
    if joint.interface.masks:
        return []
    y = view.y(joint.interface.z, joint.layer)
    return [
        draw.box((view.x(start), y - SEAM / 2), (view.x(end), y + SEAM / 2), fill=BOND)
        for start, end in joint.spans
    ]


def _fold(fold: FoldEnd, view: StackView) -> list[str]:
    """The film that continues from one half to the other, and the line of the fold."""
    x, away = view.x(fold.s), -1.0 if fold.is_ahead else 1.0
    bottom = view.y(fold.lower.z, fold.lower.index)
    top = view.y(fold.upper.z + fold.upper.film.thickness, fold.upper.index)
    inner = fold.lower.film.thickness * view.up
    outer = (bottom - top) / 2
    low, high = coord(bottom), coord(top)
    turn = int(away > 0)
    data = (
        f"M{coord(x)} {low}A{coord(outer)} {coord(outer)} 0 0 {1 - turn} {coord(x)} {high}"
        f"V{coord(top + inner)}"
    )
    hollow = outer - inner
    if hollow > 1e-6:
        data += f"A{coord(hollow)} {coord(hollow)} 0 0 {turn} {coord(x)} {coord(bottom - inner)}"
    film = fold.lower.film
    ends = f"M{coord(x)} {coord(top - PAST)}V{coord(bottom + PAST)}"
    return [
        f'<path d="{data}Z" fill="{draw.film_fill(film)}" stroke="{ink(film).line}" '
        f'stroke-width="{draw.THIN}"/>',
        f'<path d="{ends}" {draw.fold_style()}/>',
    ]


def _rod(rod: Rod, view: StackView) -> list[str]:
    """A dowel pin behind the films, stack by stack, and its axis; nothing across the break."""
    parts: list[str] = []
    x = view.x(rod.middle)
    for lowest, highest in rod.stacks:
        layers = [s.layer for s in view.section.slabs if lowest <= s.layer.index <= highest]
        below = [layer for layer in layers if layer.index <= view.section.break_above]
        above = [layer for layer in layers if layer.index > view.section.break_above]
        for run in filter(None, (below, above)):
            bottom = view.y(run[0].z, run[0].index)
            top = view.y(run[-1].z + run[-1].film.thickness, run[-1].index)
            low, high = (view.x(rod.span[0]), top), (view.x(rod.span[1]), bottom)
            parts.append(draw.box(low, high, fill=STEEL, stroke=draw.GREY))
            parts.append(draw.line([(x, top - PAST), (x, bottom + PAST)], colour=draw.GREY))
    return parts


def _heading(laminate: Laminate, view: StackView) -> list[str]:
    along = "its inlet" if laminate.chambers else "x"
    scale = f"Height exaggerated {view.factor}{draw.TIMES}" if view.factor > 1 else "To scale"
    content = (
        f"Section through {view.section.chamber} along {along}. "
        f"{scale}, {coord(laminate.thickness)} in all (nominal). All dimensions in mm."
    )
    return [
        draw.text((10.0, 13.0), laminate.name, size=4.6, bold=True),
        draw.text((10.0, 18.6), content),
        *(
            draw.text((10.0, 23.4 + 4.2 * row), note, bold=True)
            for row, note in enumerate(laminate.notes)
        ),
    ]


def _breaks(view: StackView) -> list[str]:
    section = view.section
    parts: list[str] = []
    if section.hidden:
        last = next(s.layer for s in section.slabs if s.layer.index == section.break_above)
        base = view.y(last.z + last.film.thickness, last.index)
        x0 = view.x(section.low) - (0.0 if section.cropped else 3.0)
        right = view.x(_reach(section)) + 3.0
        for y in (base - 1.6, base - BREAK + 1.6):
            parts.append(_wave((x0, y), (right, y)))
        noun = "balloon" if section.hidden == 1 else "balloons"
        words = f"\u2026 {section.hidden} more {noun} \u2026"
        middle = ((x0 + right) / 2, base - BREAK / 2 + 1.0)
        parts.append(draw.text(middle, words, anchor="middle"))
    if section.cropped:
        x = view.x(section.low)
        parts.append(_wave((x, HEAD - 2.0), (x, HEAD + view.height + 2.0), white=1.5))
    return parts


def _reach(section: StackSection) -> float:
    """Return the shift of the layers above the break toward the inlet."""
    above = [s for s in section.slabs if s.layer.index > section.break_above]
    return max(end for slab in above for _, end in slab.spans)


def _wave(start: Point, end: Point, white: float = 0.0) -> str:
    """A wavy break line, with a white band beside it that hides straight edges."""
    away = math.dist(start, end)
    steps = max(8, round(away))
    (x0, y0), (u, v) = start, ((end[0] - start[0]) / away, (end[1] - start[1]) / away)
    points = []
    for i in range(steps + 1):
        along, sway = away * i / steps, 0.5 * math.sin(math.tau * i / 8)
        points.append((x0 + along * u + sway * v, y0 + along * v - sway * u))
    curve = draw.line(points, colour=draw.GREY, width=0.2)
    if not white:
        return curve
    return draw.box((x0 - white, y0), (x0, end[1]), fill="#ffffff") + curve


def _dimensions_above(view: StackView) -> list[str]:
    """Over the top balloon: chamber, the bonds beside it, the lumen, and the whole width."""
    cap = view.section.slabs[-1]
    chambers = [j for j in view.section.joints if j.interface.kind == "chamber"]
    if not chambers:
        return []
    spans = chambers[-1].spans
    top = view.y(cap.layer.z + cap.layer.film.thickness, cap.layer.index)
    measured: list[Interval] = []
    pocket = opening(spans, 0.0)
    if pocket is not None:
        measured = [span for span in spans if span[1] == pocket[0] or span[0] == pocket[1]]
        measured.append(pocket)
    if view.section.lumen is not None:
        through = opening(cap.spans, view.section.lumen)
        measured += [through] if through else []
    shown = [span for span in measured if span[0] > view.section.low or not view.section.cropped]
    parts, rows = _levels(view, [(span, "") for span in shown], top, (0.0, -1.0))
    if not view.section.cropped:
        whole = cap.spans[0][0], cap.spans[-1][1]
        parts += _level(view, (whole, ""), top, (0.0, -1.0), ROW_STEP * (rows + 1) + 1.0)
    return parts


def _dimensions_below(view: StackView) -> list[str]:
    """Under the stack: the tab, and how far the inlet strip reaches past its mouth."""
    section = view.section
    if section.tab is None:
        return []
    lowest = section.slabs[0].layer
    bottom = view.y(lowest.z, lowest.index)
    mouth = section.tab[1]
    measured: list[SectionDimension] = [(section.tab, "tab")]
    masks = [slab for slab in section.slabs if slab.layer.role == "chamber-mask" and slab.spans]
    reach = max((slab.spans[-1][1] for slab in masks), default=mouth)
    if reach - mouth > 1e-3:
        tail = any(rod.middle > mouth for rod in section.rods)
        measured.append(((mouth, reach), "tail" if tail else "overhang"))
    return _levels(view, measured, bottom, (0.0, 1.0))[0]


def _levels(
    view: StackView, measured: Sequence[SectionDimension], y: float, away: Point
) -> tuple[list[str], int]:
    """Dimensions in as few rows as keep their words apart, and how many rows that took."""
    rows: list[list[Interval]] = []
    parts: list[str] = []
    for span, name in measured:
        middle = view.x((span[0] + span[1]) / 2)
        half = draw.text_width(_words(span, name)) / 2 + 0.5
        taken = middle - half, middle + half
        free = [not any(a < taken[1] and taken[0] < b for a, b in row) for row in rows]
        row = free.index(True) if True in free else len(rows)
        if row == len(rows):
            rows.append([])
        rows[row].append(taken)
        parts += _level(view, (span, name), y, away, ROW_STEP * (row + 1))
    return parts, len(rows)


def _level(
    view: StackView, measured: SectionDimension, y: float, away: Point, distance: float
) -> list[str]:
    (start, end), name = measured
    words = _words((start, end), name)
    return draw.dimension((view.x(start), y), (view.x(end), y), words, away, distance)


def _words(span: Interval, name: str) -> str:
    return f"{name} {length(span[1] - span[0])}".strip()


def _labels(view: StackView) -> list[str]:
    """Layer names at the right, features at the left, each with a leader."""
    low, high = HEAD - 4.0, HEAD + view.height + 6.0
    right = view.x(view.section.high) + 5.0
    parts: list[str] = []
    for labels, x, side in (
        (layer_labels(view.section) + pin_labels(view.section, True), right, 1),
        (feature_labels(view.section) + pin_labels(view.section, False), LEFT - 6.0, -1),
    ):
        placed = sorted((view.y(label.z, label.layer), label) for label in labels)
        rows = draw.spread([y for y, _ in placed], 5.2, low, high)
        for (y, label), row in zip(placed, rows, strict=True):
            parts += _label(label, (view.x(label.s), y), (x, row), side)
    return parts


def _label(label: StackLabel, feature: Point, at: Point, side: int) -> list[str]:
    x, row = at
    elbow = (x - 2.2 * side, row)
    anchor: draw.Anchor = "start" if side > 0 else "end"
    colour = ink(label.film).line if label.film else draw.DARK
    return [
        *draw.leader(feature, elbow, (x - 0.6 * side, row)),
        draw.text((x + 0.4 * side, row + 1.05), label.words, anchor=anchor, colour=colour),
    ]


def _legend(view: StackView, page: float) -> list[str]:
    y = page - 10.0
    films = dict.fromkeys(slab.layer.film for slab in view.section.slabs)
    entries = [
        (f"{film.material} film, {coord(film.thickness)}", draw.film_fill(film)) for film in films
    ]
    gaps = [joint.interface for joint in view.section.joints]
    if not gaps or any(gap.masks for gap in gaps):
        entries.append((f"bond: the gap filled with {_bonding(films)}", BOND))
        entries.append(("unbonded: drawn as a slit beside the mask", "#ffffff"))
    if any(joint.spans and not joint.interface.masks for joint in view.section.joints):
        entries.append(("bond of a seam, drawn over the line between the films", BOND))
    if view.section.rods:
        entries.append(("dowel pin", STEEL))
    parts: list[str] = []
    x = 10.0
    for words, fill in entries:
        width = 7.6 + draw.text_width(words) + 7.0
        if x + width - 7.0 > PAGE_WIDTH - 5.0:
            x, y = 10.0, y + 5.0
        parts.append(draw.box((x, y - 2.6), (x + 6.0, y + 0.6), fill=fill, stroke=draw.GREY))
        parts.append(draw.text((x + 7.6, y), words))
        x += width
    if view.section.folds:
        words = "fold: the film goes on in its other half"
        if x + 7.6 + draw.text_width(words) > PAGE_WIDTH - 5.0:
            x, y = 10.0, y + 5.0
        parts.append(f'<path d="M{coord(x)} {coord(y - 1.0)}h6" {draw.fold_style()}/>')
        parts.append(draw.text((x + 7.6, y), words))
    return parts


def _bonding(films: Iterable[Film]) -> str:
    """Return the material that flows into a gap: the structural film if it is the only one."""
    structural = [film.material for film in films if not film.is_mask]
    return structural[0] if len(structural) == 1 else "the film that melts"


# Targets of the section's leaders, measured on the section itself.


class StackLabel(NamedTuple):
    """Label for the place ``s`` along the section, ``z`` high in or beside a layer (its index)."""

    words: str
    s: float
    z: float
    layer: int
    film: Film | None = None


def layer_labels(section: StackSection) -> list[StackLabel]:
    """Number and role of every layer shown, pointing near its end at the inlet's side."""
    base_end = max(slab.spans[-1][1] for slab in section.slabs if not slab.layer.is_mask)
    labels = []
    for slab in section.slabs:
        if not slab.spans:
            continue
        end = slab.spans[-1][1]
        words = f"{slab.layer.index} {slab.layer.role.replace('-', ' ')}"
        if slab.layer.role == "chamber-mask" and end > base_end:
            words += ", inlet strip"
        placed_label = _in_slab(words, end - min(0.2, 0.25 * (end - slab.spans[-1][0])), slab)
        labels.append(placed_label._replace(film=slab.layer.film))
    return labels


def pin_labels(section: StackSection, beyond_tab: bool) -> list[StackLabel]:
    """Name and press steps of the pins on this side of the tab's end, or beyond it."""
    mouth = section.tab[1] if section.tab else section.high
    slabs = {slab.layer.index: slab for slab in section.slabs}
    return [
        _in_slab(rod.words, rod.middle, slabs[rod.stacks[-1][1]])
        for rod in section.rods
        if (rod.middle > mouth) == beyond_tab
    ]


def feature_labels(section: StackSection) -> list[StackLabel]:
    """Bond, neck ring, overhang, bore, pocket and lumen, where the section has them."""
    features = [
        _bond(section),
        _pocket(section),
        _neck_ring(section),
        _overhang(section),
        _bore(section),
        _lumen(section),
    ]
    return [label for label in features if label is not None]


def _joints(section: StackSection, kind: str) -> list[Joint]:
    return [joint for joint in section.joints if joint.interface.kind == kind and joint.spans]


def _in_gap(words: str, s: float, joint: Joint) -> StackLabel:
    interface = joint.interface
    return StackLabel(words, s, interface.z + interface.gap / 2, joint.layer)


def _bond(section: StackSection) -> StackLabel | None:
    """The bonded ring beside the bottom pocket, on the side away from the inlet."""
    for joint in _joints(section, "chamber"):
        beside = [span for span in joint.spans if span[1] < 0]
        if beside:
            start, end = beside[-1]
            return _in_gap(f"bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _pocket(section: StackSection) -> StackLabel | None:
    """The pocket of the second balloon, or of the only one (open toward its inlet)."""
    joints = _joints(section, "chamber")[:2]
    for joint in reversed(joints):
        pocket = opening(joint.spans, 0.0)
        if pocket is not None:
            words = f"chamber pocket {length(pocket[1] - pocket[0])}"
            return _in_gap(words, 0.6 * pocket[0], joint)
        before = [end for _, end in joint.spans if end < 0]
        if before:
            return _in_gap("chamber pocket", 0.6 * max(before), joint)
    return None


def _neck_ring(section: StackSection) -> StackLabel | None:
    """The bond beside the bore that carries one balloon on the next, or a sheet's window."""
    for joint in _joints(section, "separator"):
        for start, end in joint.spans:
            if start < 0 < end:
                return _in_gap(f"window, bond {length(end - start)}", (start + end) / 2, joint)
        beside = [span for span in joint.spans if span[1] <= 0]
        if beside:
            start, end = max(beside)
            return _in_gap(f"neck ring, bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _overhang(section: StackSection) -> StackLabel | None:
    """The lowest separator mask past the wall above it, away from the inlet if that shows."""
    for mask, wall in pairwise(section.slabs):
        if mask.layer.role != "separator-mask" or not mask.spans or not wall.spans:
            continue
        start, end = mask.spans[0][0], wall.spans[0][0]
        if section.cropped:
            start, end = wall.spans[-1][1], mask.spans[-1][1]
        if end - start > 1e-3:
            return _in_slab(f"overhang {length(end - start)}", (start + end) / 2, mask)
    return None


def _bore(section: StackSection) -> StackLabel | None:
    for slab in section.slabs:
        through = opening(slab.spans, 0.0)
        if not slab.layer.is_mask and through is not None:
            name = "bore ⌀" if section.is_bored else "opening "
            return _in_slab(f"{name}{length(through[1] - through[0])}", 0.0, slab)
    return None


def _lumen(section: StackSection) -> StackLabel | None:
    if section.lumen is None:
        return None
    cap = section.slabs[-1]
    through = opening(cap.spans, section.lumen)
    if through is None:
        return None
    return _in_slab(f"lumen ⌀{length(through[1] - through[0])}", section.lumen, cap)


def _in_slab(words: str, s: float, slab: SectionSlab) -> StackLabel:
    layer = slab.layer
    return StackLabel(words, s, layer.z + layer.film.thickness / 2, layer.index)
