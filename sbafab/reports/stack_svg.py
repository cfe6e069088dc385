"""preview/stack.svg: the section through one chamber, its height exaggerated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Generic, NamedTuple, TypeVar

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Interval, Region, coord, section
from sbafab.laminate.films import ink
from sbafab.laminate.joints import Fold
from sbafab.laminate.laminate import Interface, Laminate, Layer, Pin
from sbafab.laminate.lay_up import press_steps
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import BOND, length

MOST_BALLOONS = 4  # shown in full
BEYOND_LUMEN = 3.25
PAGE_WIDTH = 297.0
LEFT, RIGHT = 56.0, 56.0
HEAD, FOOT = 42.0, 36.0
TALLEST, TALLEST_FILM = 120.0, 8.0
BREAK = 13.0
ROW_STEP = 6.0
SLIT = 0.18  # share of the gap drawn open above and below a mask, to show what does not bond
EXAGGERATIONS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
STEEL = "#ccd2d8"
SEAM = 1.0  # height of a bond without a gap on the page, mm
PAST = 2.0  # a pin's axis and a fold's line extend past their ends by this, mm on the page
Spans = Sequence[Interval]
Shown = TypeVar("Shown", Layer, Interface)


class SectionPlane(NamedTuple):
    """The plane of the section: a point in it and a unit vector along it."""

    origin: Point
    direction: Point

    def along(self, p: Point) -> float:
        (x, y), (u, v) = self.origin, self.direction
        return (p[0] - x) * u + (p[1] - y) * v

    def cut(self, region: Region) -> Spans:
        return section(region, self.origin, self.direction)


class Band(NamedTuple, Generic[Shown]):
    """A layer in the section with the spans of its film, or an interface with its bonded spans, and
    its heights on the page.
    """

    of: Shown
    spans: Spans
    bottom: float
    top: float

    @property
    def middle(self) -> float:
        return (self.bottom + self.top) / 2


class Rod(NamedTuple):
    """A pin in the plane of the section, from ``span`` start to end.

    It holds the layers ``stacks``, the lowest and highest index of each separately pressed stack,
    and is in place at the press steps ``steps``.
    """

    name: str
    span: Interval
    stacks: Sequence[tuple[int, int]]
    steps: Sequence[int]

    @property
    def middle(self) -> float:
        return (self.span[0] + self.span[1]) / 2


class StackSection:
    """The section, in mm along the plane from the chamber's axis, positive toward its inlet, and
    its position on the page: ``across`` and ``up`` are page mm per mm.

    The plane runs through the first chamber's axis and its inlet; without a chamber along x through
    the first port. ``hidden`` balloons are omitted above the layer ``break_above`` (an index; 0 for
    none). ``lumen`` is the position of the actuator's axis along the plane, if it has a lumen.
    ``cropped``: the section beyond ``low`` is not shown. ``tab`` runs from the outline to its
    mouth.
    """

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        layers, self.hidden, self.break_above = _shown(laminate)
        self.chamber, plane = _plane(laminate)
        self.lumen = plane.along((0.0, 0.0)) if laminate.lumen else None
        patterns = {layer.pattern: layer.profile for layer in layers}
        if not any(map(plane.cut, patterns.values())):
            # The chamber lies outside every layer: rule sealing reports it, the picture shows the
            # films.
            low_x, low_y, high_x, high_y = laminate.layers[0].profile.bounds
            plane = plane._replace(origin=((low_x + high_x) / 2, (low_y + high_y) / 2))
        cuts = {name: plane.cut(region) for name, region in patterns.items()}
        ends = [end for spans in cuts.values() for span in spans for end in span]
        self.low, self.high = min(ends), max(ends)
        beyond = (laminate.lumen or 0) / 2 + BEYOND_LUMEN
        self.cropped = self.lumen is not None and self.lumen - beyond > self.low
        if self.lumen is not None and self.cropped:
            self.low = self.lumen - beyond
        self._scale([layer.film.thickness for layer in layers])
        self.slabs = list(self._slabs(layers, cuts))
        self.by_index = {slab.of.index: slab for slab in self.slabs}
        self.joints = list(self._joints(plane))
        inlet = next((inlet for inlet in laminate.inlets if inlet.chamber == self.chamber), None)
        mouth = plane.along(inlet.mouth) if inlet else 0.0
        self.tab = (mouth - inlet.length, mouth) if inlet else None
        self.rods = [rod for rod in _rods(laminate, plane) if rod.span[0] > self.low]
        self.folds = list(self._fold_ends(plane))

    def _scale(self, films: Sequence[float]) -> None:
        self.across = (PAGE_WIDTH - LEFT - RIGHT) / (self.high - self.low)
        most = min(TALLEST / sum(films), TALLEST_FILM / max(films)) / self.across
        self.factor = max(step for step in EXAGGERATIONS if step <= max(most, 1.0))
        self.up = self.across * self.factor
        self.height = sum(films) * self.up + (BREAK if self.hidden else 0.0)

    def _slabs(self, layers: Sequence[Layer], cuts: dict[str, Spans]) -> Iterator[Band[Layer]]:
        y = HEAD + self.height
        for layer in layers:
            top = y - layer.film.thickness * self.up
            yield Band(layer, self._clipped(cuts[layer.pattern]), y, top)
            y = top - BREAK * (layer.index == self.break_above)

    def _joints(self, plane: SectionPlane) -> Iterator[Band[Interface]]:
        for gap in self.laminate.interfaces:
            levels = [mask.index for mask in gap.masks] or [*gap.layer_indices]
            if (gap.masks or gap.seams) and self.by_index.keys() >= {*levels}:
                # Films that a seam bonds lie on each other: it is drawn over the line between them.
                bottom = self.by_index[levels[0 if gap.masks else -1]].bottom
                half = 0.0 if gap.masks else SEAM / 2
                top = bottom - gap.gap * self.up * bool(gap.masks)
                spans = self._clipped(plane.cut(gap.bond))
                yield Band(gap, spans, bottom + half, top - half)

    def _fold_ends(self, plane: SectionPlane) -> Iterator[tuple[Fold, float, bool]]:
        """Yield the folds in the plane at which shown films end: the position, and whether the film
        is on the far side.
        """
        (a, b), (dx, dy) = plane
        for fold in self.laminate.folds:
            (x, y), (u, v) = fold.line
            along = dx * (v - y) - dy * (u - x)
            if abs(along) < 1e-9 * math.dist((x, y), (u, v)) or fold.lower not in self.by_index:
                continue
            s = ((x - a) * (v - y) - (y - b) * (u - x)) / along
            for start, end in self.by_index[fold.lower].spans:
                if abs(start - s) < 1e-6 or abs(end - s) < 1e-6:
                    yield fold, s, abs(start - s) < 1e-6

    def _clipped(self, spans: Spans) -> Spans:
        return tuple((max(start, self.low), end) for start, end in spans if end > self.low)

    def x(self, s: float) -> float:
        return LEFT + (s - self.low) * self.across

    def boxes(
        self, spans: Spans, top: float, bottom: float, fill: str, stroke: str = "none"
    ) -> list[str]:
        return [
            draw.box((self.x(start), top), (self.x(end), bottom), fill=fill, stroke=stroke)
            for start, end in spans
        ]

    def bonds(self, kind: str) -> list[Band[Interface]]:
        return [joint for joint in self.joints if joint.of.kind == kind and joint.spans]


def _plane(laminate: Laminate) -> tuple[str, SectionPlane]:
    """Return the name of the first chamber, or of the first port, and the plane through it."""
    if not laminate.chambers:
        port = laminate.ports[0]
        return port.name, SectionPlane(port.at, (1.0, 0.0))
    chamber = laminate.chambers[0]
    bored = (bore.centre for bore in laminate.bores if bore.chamber == chamber.name)
    inlets = (inlet.direction for inlet in laminate.inlets if inlet.chamber == chamber.name)
    return chamber.name, SectionPlane(next(bored, chamber.centres[0]), next(inlets, (1.0, 0.0)))


def _shown(laminate: Laminate) -> tuple[Sequence[Layer], int, int]:
    """Return the layers to show, the number of omitted balloons, and the layer below those."""
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


def _rods(laminate: Laminate, plane: SectionPlane) -> Iterator[Rod]:
    """Yield the pins that hold layers and that the plane meets, in the laminate's order."""
    (u, v), steps = plane.direction, press_steps(laminate)
    for pin in laminate.pins:
        along, radius = plane.along(pin.centre), pin.diameter / 2
        aside = plane._replace(direction=(v, -u)).along(pin.centre)
        stacks = _stands(laminate, pin)
        if abs(aside) < radius and stacks:
            half = math.sqrt(radius**2 - aside**2)
            numbers = [step.number for step in steps if pin in step.pins]
            yield Rod(pin.name, (along - half, along + half), stacks, numbers)


def _stands(laminate: Laminate, pin: Pin) -> Sequence[tuple[int, int]]:
    """Return the lowest and highest layer that the pin holds, stack by stack."""
    pinned = {
        layer.index
        for layers in laminate.patterns.values()
        if pin in laminate.pins_holding(layers[0])
        for layer in layers
    }
    joined_layers = [pinned.intersection(s.layers) for s in press_steps(laminate) if pin in s.pins]
    spans = dict.fromkeys((min(joined), max(joined)) for joined in joined_layers if joined)
    return tuple(
        (low, high)
        for low, high in spans
        if not any(a <= low and high <= b for a, b in spans if (a, b) != (low, high))
    )


def opening(spans: Spans, at: float) -> Interval | None:
    """Return the opening between two spans around ``at``; None if ``at`` is covered or outside."""
    before = [end for _, end in spans if end <= at]
    after = [start for start, _ in spans if start >= at]
    if not before or not after or any(start < at < end for start, end in spans):
        return None
    return max(before), min(after)


# The section on its page.


def stack_svg(laminate: Laminate) -> str:
    """Return the section through the first chamber in the plane of its inlet, labelled, on A4."""
    cut = StackSection(laminate)
    page = cut.height + HEAD + FOOT
    elements = list(_heading(cut))
    for rod in cut.rods:
        elements += _rod(rod, cut)
    elements += _bonds(cut, with_masks=True)
    for layer, spans, bottom, top in cut.slabs:
        inset = SLIT * (bottom - top) if layer.is_mask else 0.0
        look = draw.film_fill(layer.film), ink(layer.film).line
        elements += cut.boxes(spans, top + inset, bottom - inset, *look)
    elements += _bonds(cut, with_masks=False)
    for fold, s, is_ahead in cut.folds:
        elements += _fold(fold, s, is_ahead, cut)
    elements += [*_breaks(cut), *_dimensions(cut), *_labels(cut), *_legend(cut, page)]
    return draw.document(PAGE_WIDTH, page, f"{laminate.name}: section", elements)


def _heading(cut: StackSection) -> Iterator[str]:
    laminate = cut.laminate
    along = "its inlet" if laminate.chambers else "x"
    scale = f"Height exaggerated {cut.factor}{draw.TIMES}" if cut.factor > 1 else "To scale"
    content = (
        f"Section through {cut.chamber} along {along}. "
        f"{scale}, {coord(laminate.thickness)} in all (nominal). All dimensions in mm."
    )
    yield draw.text((10.0, 13.0), laminate.name, size=4.6, bold=True)
    yield draw.text((10.0, 18.6), content)
    for row, note in enumerate(laminate.notes):
        yield draw.text((10.0, 23.4 + 4.2 * row), note, bold=True)


def _bonds(cut: StackSection, with_masks: bool) -> Iterator[str]:
    for gap, spans, bottom, top in cut.joints:
        if bool(gap.masks) == with_masks:
            yield from cut.boxes(spans, top, bottom, BOND)


def _fold(fold: Fold, s: float, is_ahead: bool, cut: StackSection) -> Iterator[str]:
    """Yield the film that continues from one half to the other, and the fold line."""
    lower, upper, turn = cut.by_index[fold.lower], cut.by_index[fold.upper], int(not is_ahead)
    film, thick, outer = lower.of.film, lower.bottom - lower.top, (lower.bottom - upper.top) / 2
    x, low, high = map(coord, (cut.x(s), lower.bottom, upper.top))
    round_ = f"A{coord(outer)} {coord(outer)} 0 0"
    data = f"M{x} {low}{round_} {1 - turn} {x} {high}V{coord(upper.top + thick)}"
    if outer - thick > 1e-6:
        hollow = coord(outer - thick)
        data += f"A{hollow} {hollow} 0 0 {turn} {x} {coord(lower.bottom - thick)}"
    yield draw.path(f"{data}Z", draw.style(ink(film).line, fill=draw.film_fill(film)))
    ends = f"M{x} {coord(upper.top - PAST)}V{coord(lower.bottom + PAST)}"
    yield draw.path(ends, draw.fold_style())


def _rod(rod: Rod, cut: StackSection) -> Iterator[str]:
    """Yield a dowel pin behind the films and its axis, stack by stack, not across the break."""
    x = cut.x(rod.middle)
    for lowest, highest in rod.stacks:
        slabs = [slab for slab in cut.slabs if lowest <= slab.of.index <= highest]
        below = [slab for slab in slabs if slab.of.index <= cut.break_above]
        for run in filter(None, (below, slabs[len(below) :])):
            top, bottom = run[-1].top, run[0].bottom
            yield from cut.boxes([rod.span], top, bottom, STEEL, draw.GREY)
            yield draw.line([(x, top - PAST), (x, bottom + PAST)], colour=draw.GREY)


def _breaks(cut: StackSection) -> Iterator[str]:
    if cut.hidden:
        below = [slab for slab in cut.slabs if slab.of.index <= cut.break_above]
        above, base = cut.slabs[len(below) :], below[-1].top
        x0 = cut.x(cut.low) - (0.0 if cut.cropped else 3.0)
        right = cut.x(max(end for slab in above for _, end in slab.spans)) + 3.0
        for y in (base - 1.6, base - BREAK + 1.6):
            yield _wave((x0, y), (right, y))
        words = f"\u2026 {cut.hidden} more balloon{'s' * (cut.hidden > 1)} \u2026"
        yield draw.text(((x0 + right) / 2, base - BREAK / 2 + 1.0), words, anchor="middle")
    if cut.cropped:
        x, top, bottom = cut.x(cut.low), HEAD - 2.0, HEAD + cut.height + 2.0
        # White hides the straight edges beside the line.
        yield draw.box((x - 1.5, top), (x, bottom), fill="#ffffff")
        yield _wave((x, top), (x, bottom))


def _wave(start: Point, end: Point) -> str:
    a, away = complex(*start), complex(*end) - complex(*start)
    steps = max(8, round(abs(away)))
    sway = [0.5 * math.sin(math.tau * i / 8) / abs(away) for i in range(steps + 1)]
    points = [a + away * (i / steps - 1j * side) for i, side in enumerate(sway)]
    return draw.line([(p.real, p.imag) for p in points], colour=draw.GREY, width=0.2)


def _dimensions(cut: StackSection) -> Iterator[str]:
    """Yield the overall width over the top balloon, and below the stack the tab and the extension
    of the inlet strip past its mouth.
    """
    cap, base = cut.slabs[-1], cut.slabs[0]
    whole = cap.spans[0][0], cap.spans[-1][1]
    measured = [] if cut.cropped else [(whole, "", cap.top, -ROW_STEP - 1.0)]
    if cut.tab is not None:
        mouth = cut.tab[1]
        measured.append((cut.tab, "tab", base.bottom, ROW_STEP))
        masks = [slab for slab in cut.slabs if slab.of.role == "chamber-mask" and slab.spans]
        past = mouth, max((slab.spans[-1][1] for slab in masks), default=mouth)
        if past[1] - mouth > 1e-3:
            name = "tail" if any(rod.middle > mouth for rod in cut.rods) else "overhang"
            measured.append((past, name, base.bottom, 2 * ROW_STEP))
    for span, name, y, away in measured:
        start, end, way = (cut.x(span[0]), y), (cut.x(span[1]), y), math.copysign(1.0, away)
        yield from draw.dimension(start, end, _words(name, span), (0.0, way), abs(away))


def _words(name: str, span: Interval) -> str:
    return f"{name} {length(span[1] - span[0])}".strip()


def _legend(cut: StackSection, page: float) -> Iterator[str]:
    films = dict.fromkeys(slab.of.film for slab in cut.slabs)
    signs = [
        (draw.swatch(draw.film_fill(film)), f"{film.material} film, {coord(film.thickness)}")
        for film in films
    ]
    if not cut.joints or any(joint.of.masks for joint in cut.joints):
        structural = [film.material for film in films if not film.is_mask]
        flows = structural[0] if len(structural) == 1 else "the film that melts"
        signs.append((draw.swatch(BOND), f"bond: the gap filled with {flows}"))
        signs.append((draw.swatch("#ffffff"), "unbonded: drawn as a slit beside the mask"))
    if any(joint.spans and not joint.of.masks for joint in cut.joints):
        signs.append((draw.swatch(BOND), "bond of a seam, drawn over the line between the films"))
    if cut.rods:
        signs.append((draw.swatch(STEEL), "dowel pin"))
    if cut.folds:
        signs.append((draw.strokes([draw.fold_style()]), draw.FOLD))
    x, y = 10.0, page - 10.0
    for sign, words in signs:
        width = draw.KEY_SIGN + draw.text_width(words)
        if x + width > PAGE_WIDTH - 5.0:
            x, y = 10.0, y + 5.0
        yield draw.key((x, y), sign, words)
        x += width + 7.0


# Labels at the sides, each with a leader to what it names: its height on the page, the place along
# the section, words and colour.


SideLabel = tuple[float, float, str, str]


def _labels(cut: StackSection) -> Iterator[str]:
    """Yield layer names at the right and features at the left, each with a leader."""
    low, high = HEAD - 4.0, HEAD + cut.height + 6.0
    mouth = cut.tab[1] if cut.tab else cut.high
    pins: tuple[list[SideLabel], list[SideLabel]] = ([], [])
    for rod in cut.rods:
        many = "s" if len(rod.steps) > 1 else ""
        words = f"pin {rod.name}, step{many} {', '.join(map(str, rod.steps))}"
        slab = cut.by_index[rod.stacks[-1][1]]
        pins[rod.middle > mouth].append((slab.middle, rod.middle, words, draw.DARK))
    for labels, x, side in (
        ([*_layer_labels(cut), *pins[1]], cut.x(cut.high) + 5.0, 1),
        ([*_feature_labels(cut), *pins[0]], LEFT - 6.0, -1),
    ):
        placed = sorted(labels, key=lambda label: (label[0], label[2:]))
        rows = draw.spread([label[0] for label in placed], 5.2, low, high)
        anchor: draw.Anchor = "start" if side > 0 else "end"
        for (y, s, words, colour), row in zip(placed, rows, strict=True):
            yield from draw.leader((cut.x(s), y), (x - 2.2 * side, row), (x - 0.6 * side, row))
            at = x + 0.4 * side, row + 1.05
            yield draw.text(at, words, anchor=anchor, colour=colour)


def _layer_labels(cut: StackSection) -> Iterator[SideLabel]:
    """Yield number and role of every layer shown, with a leader to its end on the inlet's side."""
    base_end = max(slab.spans[-1][1] for slab in cut.slabs if not slab.of.is_mask)
    for slab in cut.slabs:
        if slab.spans:
            layer, (start, end) = slab.of, slab.spans[-1]
            words = f"{layer.index} {layer.role.replace('-', ' ')}"
            if layer.role == "chamber-mask" and end > base_end:
                words += ", inlet strip"
            s = end - min(0.2, 0.25 * (end - start))
            yield slab.middle, s, words, ink(layer.film).line


def _feature_labels(cut: StackSection) -> Iterator[SideLabel]:
    """Yield the first of each feature: bond, pocket, neck ring, overhang, bore and lumen."""
    films = [slab for slab in cut.slabs if not slab.of.is_mask]
    bore = "bore ⌀" if cut.laminate.bores else "opening "
    for labels in (
        _bond_beside(cut),
        _pocket(cut),
        _neck_ring(cut),
        _overhang(cut),
        _openings(bore, 0.0, films),
        () if cut.lumen is None else _openings("lumen ⌀", cut.lumen, cut.slabs[-1:]),
    ):
        for at, words, place in labels:
            yield place.middle, at, words, draw.DARK
            break


Feature = tuple[float, str, Band[Interface] | Band[Layer]]


def _bond_beside(cut: StackSection) -> Iterator[Feature]:
    """Yield the bonded rings beside pockets, on the side away from the inlet."""
    for joint in cut.bonds("chamber"):
        for span in [span for span in joint.spans if span[1] < 0][-1:]:
            yield sum(span) / 2, _words("bond", span), joint


def _pocket(cut: StackSection) -> Iterator[Feature]:
    """Yield the pocket of the second balloon, or of the only one (open toward its inlet)."""
    for joint in reversed(cut.bonds("chamber")[:2]):
        pocket = opening(joint.spans, 0.0)
        if pocket is not None:
            yield 0.6 * pocket[0], _words("chamber pocket", pocket), joint
        for end in [end for _, end in joint.spans if end < 0][-1:]:
            yield 0.6 * end, "chamber pocket", joint


def _neck_ring(cut: StackSection) -> Iterator[Feature]:
    """Yield bonds beside the bore that join one balloon to the next, or a sheet's windows."""
    for joint in cut.bonds("separator"):
        windows = [span for span in joint.spans if span[0] < 0 < span[1]]
        rings = [span for span in joint.spans if span[1] <= 0][-1:]
        for name, spans in (("window, bond", windows), ("neck ring, bond", rings)):
            yield from ((sum(span) / 2, _words(name, span), joint) for span in spans)


def _overhang(cut: StackSection) -> Iterator[Feature]:
    """Yield separator masks past the wall above them, opposite the inlet if visible there."""
    for mask, wall in pairwise(cut.slabs):
        if mask.of.role == "separator-mask" and mask.spans and wall.spans:
            span = mask.spans[0][0], wall.spans[0][0]
            if cut.cropped:
                span = wall.spans[-1][1], mask.spans[-1][1]
            if span[1] - span[0] > 1e-3:
                yield sum(span) / 2, _words("overhang", span), mask


def _openings(name: str, at: float, slabs: Sequence[Band[Layer]]) -> Iterator[Feature]:
    for slab in slabs:
        through = opening(slab.spans, at)
        if through is not None:
            yield at, f"{name}{length(through[1] - through[0])}", slab
