"""preview/stack.svg: the section through one chamber, its height exaggerated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import islice, pairwise
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Interval, coord, section
from sbafab.laminate.films import ink
from sbafab.laminate.laminate import Interface, Laminate, Layer, Pin
from sbafab.laminate.lay_up import press_steps
from sbafab.reports import drawing as draw
from sbafab.reports.drawing import BOND, length

MOST_BALLOONS = 4
"""Most balloons shown in full."""
BEYOND_LUMEN = 3.25
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
Spans = Sequence[Interval]


class Rod(NamedTuple):
    """A pin in the plane of the section, from ``span`` start to end.

    It holds the layers ``stacks``, the lowest and highest index of each stack pressed by itself,
    and is in place at the press steps ``steps``.
    """

    name: str
    span: Interval
    stacks: Sequence[tuple[int, int]]
    steps: Sequence[int]

    @property
    def middle(self) -> float:
        return (self.span[0] + self.span[1]) / 2

    @property
    def words(self) -> str:
        many = "s" if len(self.steps) > 1 else ""
        return f"pin {self.name}, step{many} {', '.join(map(str, self.steps))}"


class SectionSlab(NamedTuple):
    """A layer cut by the plane: the spans with film."""

    layer: Layer
    spans: Spans


class Joint(NamedTuple):
    """An interface cut by the plane: the spans where the films are bonded."""

    interface: Interface
    spans: Spans

    @property
    def layer(self) -> int:
        """Index of the layer at whose height it is drawn: a mask, or the film above."""
        masks = self.interface.masks
        return masks[0].index if masks else self.interface.above.index


class FoldEnd(NamedTuple):
    """A fold cut by the plane, at ``s`` along it; its film is on the far or the near side."""

    lower: Layer
    upper: Layer
    s: float
    is_ahead: bool


class StackSection:
    """The cut, in mm along the plane from the chamber's axis, positive toward its inlet, and its
    place on the page: ``across`` and ``up`` are page mm per mm of it.

    The plane runs through the first chamber's axis and its inlet; without a chamber along x through
    the first port. ``hidden`` balloons are left out above the layer ``break_above`` (an index; 0
    for none). ``lumen`` is the position of the actuator's axis along the plane, if it has a lumen.
    ``cropped``: the section beyond ``low`` is not shown. ``tab`` runs from the outline to its
    mouth.
    """

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        self.chamber, origin = _axis(laminate)
        inlet = next((inlet for inlet in laminate.inlets if inlet.chamber == self.chamber), None)
        direction = inlet.direction if inlet else (1.0, 0.0)
        layers, self.hidden, self.break_above = _shown(laminate)
        self.lumen = -_along(origin, (0.0, 0.0), direction) if laminate.lumen else None
        patterns = {layer.pattern: layer.profile for layer in layers}
        if not any(section(region, origin, direction) for region in patterns.values()):
            # The chamber lies outside every layer: rule sealing reports it, the picture shows the
            # films.
            low_x, low_y, high_x, high_y = laminate.layers[0].profile.bounds
            origin = ((low_x + high_x) / 2, (low_y + high_y) / 2)
        cuts = {name: section(region, origin, direction) for name, region in patterns.items()}
        ends = [end for spans in cuts.values() for span in spans for end in span]
        self.low, self.high = min(ends), max(ends)
        beyond = (laminate.lumen or 0) / 2 + BEYOND_LUMEN
        self.cropped = self.lumen is not None and self.lumen - beyond > self.low
        if self.lumen is not None and self.cropped:
            self.low = self.lumen - beyond
        self.slabs = [SectionSlab(layer, self._clipped(cuts[layer.pattern])) for layer in layers]
        shown = {layer.index for layer in layers}
        self.joints = [
            Joint(gap, self._clipped(section(gap.bond, origin, direction)))
            for gap in laminate.interfaces
            if (gap.masks or gap.seams)
            and shown.issuperset([mask.index for mask in gap.masks] or gap.layer_indices)
        ]
        mouth = _along(inlet.mouth, origin, direction) if inlet else 0.0
        self.tab = (mouth - inlet.length, mouth) if inlet else None
        rods = _rods(laminate, origin, direction)
        self.rods = [rod for rod in rods if rod.span[0] > self.low]
        self.folds = list(_fold_ends(laminate, self.slabs, origin, direction))
        self.across = (PAGE_WIDTH - LEFT - RIGHT) / (self.high - self.low)
        films = [layer.film.thickness for layer in layers]
        most = min(TALLEST / sum(films), TALLEST_FILM / max(films)) / self.across
        self.factor = max(step for step in EXAGGERATIONS if step <= max(most, 1.0))
        self.up = self.across * self.factor
        self.height = sum(films) * self.up + (BREAK if self.hidden else 0.0)

    def _clipped(self, spans: Spans) -> Spans:
        return tuple((max(start, self.low), end) for start, end in spans if end > self.low)

    def x(self, s: float) -> float:
        return LEFT + (s - self.low) * self.across

    def y(self, z: float, index: int) -> float:
        """Page height of ``z`` in the layer with this index."""
        is_above = self.hidden and index > self.break_above
        return HEAD + self.height - z * self.up + (self._drop if is_above else 0.0)

    @cached_property
    def _drop(self) -> float:
        """Page mm by which layers above the break are lower than to scale."""
        last, above = next(
            (a.layer, b.layer) for a, b in pairwise(self.slabs) if b.layer.index > self.break_above
        )
        return (above.z - last.z - last.film.thickness) * self.up - BREAK

    def bottom(self, layer: Layer, inset: float = 0.0) -> float:
        return self.y(layer.z + inset, layer.index)

    def top(self, layer: Layer, inset: float = 0.0) -> float:
        return self.y(layer.z + layer.film.thickness - inset, layer.index)

    def boxes(
        self, spans: Spans, top: float, bottom: float, fill: str, stroke: str = "none"
    ) -> list[str]:
        return [
            draw.box((self.x(start), top), (self.x(end), bottom), fill=fill, stroke=stroke)
            for start, end in spans
        ]

    def bonds(self, kind: str) -> list[Joint]:
        return [joint for joint in self.joints if joint.interface.kind == kind and joint.spans]


def _along(p: Point, origin: Point, direction: Point) -> float:
    return (p[0] - origin[0]) * direction[0] + (p[1] - origin[1]) * direction[1]


def _axis(laminate: Laminate) -> tuple[str, Point]:
    """The name and place of the first chamber's axis, or of the first port."""
    if not laminate.chambers:
        port = laminate.ports[0]
        return port.name, port.at
    chamber = laminate.chambers[0]
    bored = (bore.centre for bore in laminate.bores if bore.chamber == chamber.name)
    return chamber.name, next(bored, chamber.centres[0])


def _shown(laminate: Laminate) -> tuple[Sequence[Layer], int, int]:
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


def _rods(laminate: Laminate, origin: Point, direction: Point) -> Iterator[Rod]:
    """Yield the pins that hold layers and that the plane meets, in the laminate's order."""
    u, v = direction
    for pin in laminate.pins:
        along, aside = _along(pin.centre, origin, direction), _along(pin.centre, origin, (v, -u))
        radius = pin.diameter / 2
        stacks, steps = _stands(laminate, pin)
        if abs(aside) < radius and stacks:
            half = math.sqrt(radius**2 - aside**2)
            yield Rod(pin.name, (along - half, along + half), stacks, steps)


def _stands(laminate: Laminate, pin: Pin) -> tuple[Sequence[tuple[int, int]], Sequence[int]]:
    """Lowest and highest layer that the pin holds, stack by stack, and the steps."""
    pinned = {
        layer.index
        for layers in laminate.patterns.values()
        if pin in laminate.pins_holding(layers[0])
        for layer in layers
    }
    steps = [step for step in press_steps(laminate) if pin in step.pins]
    spans = [
        (min(joined), max(joined)) for step in steps if (joined := pinned.intersection(step.layers))
    ]
    whole = [
        span
        for span in dict.fromkeys(spans)
        if not any(a <= span[0] and span[1] <= b for a, b in spans if (a, b) != span)
    ]
    return tuple(whole), [step.number for step in steps]


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


def opening(spans: Spans, at: float) -> Interval | None:
    """The opening between two spans that holds ``at``; None if ``at`` is covered or outside."""
    before = [end for _, end in spans if end <= at]
    after = [start for start, _ in spans if start >= at]
    if not before or not after or any(start < at < end for start, end in spans):
        return None
    return max(before), min(after)


# The section on its page.


def stack_svg(laminate: Laminate) -> str:
    """The section through the first chamber in the plane of its inlet, labelled, on A4."""
    section = StackSection(laminate)
    page = section.height + HEAD + FOOT
    seams = [joint for joint in section.joints if not joint.interface.masks]
    elements = [
        *_heading(section),
        *(part for rod in section.rods for part in _rod(rod, section)),
        *(part for joint in section.joints if joint not in seams for part in _bond(joint, section)),
        *(part for slab in section.slabs for part in _slab(slab, section)),
        *(part for joint in seams for part in _bond(joint, section)),
        *(part for fold in section.folds for part in _fold(fold, section)),
        *_breaks(section),
        *_dimensions_above(section),
        *_dimensions_below(section),
        *_labels(section),
        *_legend(section, page),
    ]
    return draw.document(PAGE_WIDTH, page, f"{laminate.name}: section", elements)


def _heading(section: StackSection) -> list[str]:
    laminate = section.laminate
    along = "its inlet" if laminate.chambers else "x"
    scale = f"Height exaggerated {section.factor}{draw.TIMES}" if section.factor > 1 else "To scale"
    content = (
        f"Section through {section.chamber} along {along}. "
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


def _slab(slab: SectionSlab, section: StackSection) -> list[str]:
    layer = slab.layer
    inset = SLIT * layer.film.thickness if layer.is_mask else 0.0
    ends = section.top(layer, inset), section.bottom(layer, inset)
    return section.boxes(slab.spans, *ends, draw.film_fill(layer.film), ink(layer.film).line)


def _bond(joint: Joint, section: StackSection) -> list[str]:
    """The bonds in a gap; without masks, over the line on which the films lie on each other."""
    gap = joint.interface
    half = 0.0 if gap.masks else SEAM / 2
    top, bottom = (section.y(z, joint.layer) for z in (gap.z + gap.gap * bool(gap.masks), gap.z))
    return section.boxes(joint.spans, top - half, bottom + half, BOND)


def _fold(fold: FoldEnd, section: StackSection) -> list[str]:
    """The film that continues from one half to the other, and the line of the fold."""
    film, turn = fold.lower.film, int(not fold.is_ahead)
    bottom, top = section.bottom(fold.lower), section.top(fold.upper)
    thick, outer = film.thickness * section.up, (bottom - top) / 2
    x, low, high = map(coord, (section.x(fold.s), bottom, top))
    data = (
        f"M{x} {low}A{coord(outer)} {coord(outer)} 0 0 {1 - turn} {x} {high}V{coord(top + thick)}"
    )
    if outer - thick > 1e-6:
        hollow = coord(outer - thick)
        data += f"A{hollow} {hollow} 0 0 {turn} {x} {coord(bottom - thick)}"
    return [
        draw.path(f"{data}Z", draw.style(ink(film).line, fill=draw.film_fill(film))),
        draw.path(f"M{x} {coord(top - PAST)}V{coord(bottom + PAST)}", draw.fold_style()),
    ]


def _rod(rod: Rod, section: StackSection) -> list[str]:
    """A dowel pin behind the films, stack by stack, and its axis; nothing across the break."""
    parts: list[str] = []
    x = section.x(rod.middle)
    for lowest, highest in rod.stacks:
        layers = [s.layer for s in section.slabs if lowest <= s.layer.index <= highest]
        below = [layer for layer in layers if layer.index <= section.break_above]
        for run in filter(None, (below, layers[len(below) :])):
            top, bottom = section.top(run[-1]), section.bottom(run[0])
            parts += section.boxes([rod.span], top, bottom, STEEL, draw.GREY)
            parts.append(draw.line([(x, top - PAST), (x, bottom + PAST)], colour=draw.GREY))
    return parts


def _breaks(section: StackSection) -> list[str]:
    parts: list[str] = []
    if section.hidden:
        below = [s for s in section.slabs if s.layer.index <= section.break_above]
        above = section.slabs[len(below) :]
        base = section.top(below[-1].layer)
        x0 = section.x(section.low) - (0.0 if section.cropped else 3.0)
        right = section.x(max(end for slab in above for _, end in slab.spans)) + 3.0
        for y in (base - 1.6, base - BREAK + 1.6):
            parts.append(_wave((x0, y), (right, y)))
        words = f"\u2026 {section.hidden} more balloon{'s' * (section.hidden > 1)} \u2026"
        middle = ((x0 + right) / 2, base - BREAK / 2 + 1.0)
        parts.append(draw.text(middle, words, anchor="middle"))
    if section.cropped:
        x, top, bottom = section.x(section.low), HEAD - 2.0, HEAD + section.height + 2.0
        # White hides the straight edges beside the line.
        parts.append(draw.box((x - 1.5, top), (x, bottom), fill="#ffffff"))
        parts.append(_wave((x, top), (x, bottom)))
    return parts


def _wave(start: Point, end: Point) -> str:
    """A wavy break line."""
    away = math.dist(start, end)
    steps = max(8, round(away))
    (x0, y0), (u, v) = start, ((end[0] - start[0]) / away, (end[1] - start[1]) / away)
    points = []
    for i in range(steps + 1):
        along, sway = away * i / steps, 0.5 * math.sin(math.tau * i / 8)
        points.append((x0 + along * u + sway * v, y0 + along * v - sway * u))
    return draw.line(points, colour=draw.GREY, width=0.2)


def _dimensions_above(section: StackSection) -> list[str]:
    """Over the top balloon: chamber, the bonds beside it, the lumen, and the whole width."""
    cap = section.slabs[-1]
    chambers = [joint for joint in section.joints if joint.interface.kind == "chamber"]
    if not chambers:
        return []
    spans = chambers[-1].spans
    measured: list[Interval] = []
    pocket = opening(spans, 0.0)
    if pocket is not None:
        measured = [span for span in spans if span[1] == pocket[0] or span[0] == pocket[1]]
        measured.append(pocket)
    through = None if section.lumen is None else opening(cap.spans, section.lumen)
    measured += [through] if through else []
    shown = [span for span in measured if span[0] > section.low or not section.cropped]
    top = section.top(cap.layer)
    parts, rows = _rows(section, [(span, "") for span in shown], top, (0.0, -1.0))
    if not section.cropped:
        whole = cap.spans[0][0], cap.spans[-1][1]
        parts += _dimension(section, whole, "", top, (0.0, -1.0), ROW_STEP * (rows + 1) + 1.0)
    return parts


def _dimensions_below(section: StackSection) -> list[str]:
    """Under the stack: the tab, and how far the inlet strip reaches past its mouth."""
    if section.tab is None:
        return []
    mouth = section.tab[1]
    measured = [(section.tab, "tab")]
    masks = [slab for slab in section.slabs if slab.layer.role == "chamber-mask" and slab.spans]
    reach = max((slab.spans[-1][1] for slab in masks), default=mouth)
    if reach - mouth > 1e-3:
        tail = any(rod.middle > mouth for rod in section.rods)
        measured.append(((mouth, reach), "tail" if tail else "overhang"))
    return _rows(section, measured, section.bottom(section.slabs[0].layer), (0.0, 1.0))[0]


def _rows(
    section: StackSection, measured: Sequence[tuple[Interval, str]], y: float, away: Point
) -> tuple[list[str], int]:
    """Named dimensions in as few rows as keep their words apart, and how many rows that took."""
    rows: list[list[Interval]] = []
    parts: list[str] = []
    for span, name in measured:
        middle = section.x((span[0] + span[1]) / 2)
        half = draw.text_width(_words(name, span)) / 2 + 0.5
        low, high = middle - half, middle + half
        free = (n for n, row in enumerate(rows) if not any(a < high and low < b for a, b in row))
        row = next(free, len(rows))
        if row == len(rows):
            rows.append([])
        rows[row].append((low, high))
        parts += _dimension(section, span, name, y, away, ROW_STEP * (row + 1))
    return parts, len(rows)


def _dimension(
    section: StackSection, span: Interval, name: str, y: float, away: Point, distance: float
) -> list[str]:
    start, end = (section.x(s) for s in span)
    return draw.dimension((start, y), (end, y), _words(name, span), away, distance)


def _words(name: str, span: Interval) -> str:
    return f"{name} {length(span[1] - span[0])}".strip()


def _legend(section: StackSection, page: float) -> Iterator[str]:
    films = dict.fromkeys(slab.layer.film for slab in section.slabs)
    signs = [
        (draw.swatch(draw.film_fill(film)), f"{film.material} film, {coord(film.thickness)}")
        for film in films
    ]
    gaps = [joint.interface for joint in section.joints]
    if not gaps or any(gap.masks for gap in gaps):
        structural = [film.material for film in films if not film.is_mask]
        flows = structural[0] if len(structural) == 1 else "the film that melts"
        signs.append((draw.swatch(BOND), f"bond: the gap filled with {flows}"))
        signs.append((draw.swatch("#ffffff"), "unbonded: drawn as a slit beside the mask"))
    if any(joint.spans and not joint.interface.masks for joint in section.joints):
        signs.append((draw.swatch(BOND), "bond of a seam, drawn over the line between the films"))
    if section.rods:
        signs.append((draw.swatch(STEEL), "dowel pin"))
    if section.folds:
        signs.append((draw.strokes([draw.fold_style()]), draw.FOLD))
    x, y = 10.0, page - 10.0
    for sign, words in signs:
        width = draw.KEY_SIGN + draw.text_width(words)
        if x + width > PAGE_WIDTH - 5.0:
            x, y = 10.0, y + 5.0
        yield draw.key((x, y), sign, words)
        x += width + 7.0


# Labels at the sides, each with a leader to what it names.


class StackLabel(NamedTuple):
    """Label for the place ``s`` along the section, ``z`` high in or beside a layer (its index)."""

    words: str
    s: float
    z: float
    layer: int
    colour: str = draw.DARK


def _labels(section: StackSection) -> list[str]:
    """Layer names at the right, features at the left, each with a leader."""
    low, high = HEAD - 4.0, HEAD + section.height + 6.0
    mouth = section.tab[1] if section.tab else section.high
    slabs = {slab.layer.index: slab for slab in section.slabs}
    pins: tuple[list[StackLabel], list[StackLabel]] = ([], [])
    for rod in section.rods:
        pins[rod.middle > mouth].append(_in_slab(rod.words, rod.middle, slabs[rod.stacks[-1][1]]))
    parts: list[str] = []
    for labels, x, side in (
        ([*_layer_labels(section), *pins[1]], section.x(section.high) + 5.0, 1),
        ([*_feature_labels(section), *pins[0]], LEFT - 6.0, -1),
    ):
        placed = sorted((section.y(label.z, label.layer), label) for label in labels)
        rows = draw.spread([y for y, _ in placed], 5.2, low, high)
        anchor: draw.Anchor = "start" if side > 0 else "end"
        for (y, label), row in zip(placed, rows, strict=True):
            parts += draw.leader(
                (section.x(label.s), y), (x - 2.2 * side, row), (x - 0.6 * side, row)
            )
            at = x + 0.4 * side, row + 1.05
            parts.append(draw.text(at, label.words, anchor=anchor, colour=label.colour))
    return parts


def _layer_labels(section: StackSection) -> Iterator[StackLabel]:
    """Number and role of every layer shown, pointing near its end at the inlet's side."""
    base_end = max(slab.spans[-1][1] for slab in section.slabs if not slab.layer.is_mask)
    for slab in section.slabs:
        if slab.spans:
            start, end = slab.spans[-1]
            words = f"{slab.layer.index} {slab.layer.role.replace('-', ' ')}"
            if slab.layer.role == "chamber-mask" and end > base_end:
                words += ", inlet strip"
            label = _in_slab(words, end - min(0.2, 0.25 * (end - start)), slab)
            yield label._replace(colour=ink(slab.layer.film).line)


def _feature_labels(section: StackSection) -> Iterator[StackLabel]:
    """Yield bond, pocket, neck ring, overhang, bore and lumen, where the section has them."""
    films = [slab for slab in section.slabs if not slab.layer.is_mask]
    bore = "bore ⌀" if section.laminate.bores else "opening "
    for labels in (
        _bond_beside(section),
        _pocket(section),
        _neck_ring(section),
        _overhang(section),
        _openings(bore, 0.0, films),
        () if section.lumen is None else _openings("lumen ⌀", section.lumen, section.slabs[-1:]),
    ):
        yield from islice(labels, 1)


def _in_gap(words: str, s: float, joint: Joint) -> StackLabel:
    interface = joint.interface
    return StackLabel(words, s, interface.z + interface.gap / 2, joint.layer)


def _in_slab(words: str, s: float, slab: SectionSlab) -> StackLabel:
    layer = slab.layer
    return StackLabel(words, s, layer.z + layer.film.thickness / 2, layer.index)


def _bond_beside(section: StackSection) -> Iterator[StackLabel]:
    """Yield the bonded rings beside pockets, on the side away from the inlet."""
    for joint in section.bonds("chamber"):
        for span in [span for span in joint.spans if span[1] < 0][-1:]:
            yield _in_gap(_words("bond", span), sum(span) / 2, joint)


def _pocket(section: StackSection) -> Iterator[StackLabel]:
    """Yield the pocket of the second balloon, or of the only one (open toward its inlet)."""
    for joint in reversed(section.bonds("chamber")[:2]):
        pocket = opening(joint.spans, 0.0)
        if pocket is not None:
            yield _in_gap(_words("chamber pocket", pocket), 0.6 * pocket[0], joint)
        for end in [end for _, end in joint.spans if end < 0][-1:]:
            yield _in_gap("chamber pocket", 0.6 * end, joint)


def _neck_ring(section: StackSection) -> Iterator[StackLabel]:
    """Yield bonds beside the bore that carry one balloon on the next, or a sheet's windows."""
    for joint in section.bonds("separator"):
        for span in joint.spans:
            if span[0] < 0 < span[1]:
                yield _in_gap(_words("window, bond", span), sum(span) / 2, joint)
        for span in [span for span in joint.spans if span[1] <= 0][-1:]:
            yield _in_gap(_words("neck ring, bond", span), sum(span) / 2, joint)


def _overhang(section: StackSection) -> Iterator[StackLabel]:
    """Yield separator masks past the wall above them, away from the inlet if that shows."""
    for mask, wall in pairwise(section.slabs):
        if mask.layer.role == "separator-mask" and mask.spans and wall.spans:
            span = mask.spans[0][0], wall.spans[0][0]
            if section.cropped:
                span = wall.spans[-1][1], mask.spans[-1][1]
            if span[1] - span[0] > 1e-3:
                yield _in_slab(_words("overhang", span), sum(span) / 2, mask)


def _openings(name: str, at: float, slabs: Sequence[SectionSlab]) -> Iterator[StackLabel]:
    for slab in slabs:
        through = opening(slab.spans, at)
        if through is not None:
            yield _in_slab(f"{name}{length(through[1] - through[0])}", at, slab)
