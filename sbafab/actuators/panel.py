"""Registered sheets: bridges that hold the parts, and the panel that holds all copies.

A part hangs in its sheet on bridges between its inlet tabs. A stub of each bridge belongs to the
outline, so that an error of the second cut takes the stub and not the bond. Films leave a window
round the part, mask sheets a narrower one, so that mask overhangs every edge of the windows too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from sbafab.actuators.stacking import BalloonShape
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, disc, polygon, stadium, strip, union
from sbafab.laminate.laminate import Inlet, Laminate, Pin, SheetPanel

METHOD = "sheet"
NOTE = (
    "made in registered sheets: no bench has tried this way of building; the stubs of the bridges "
    "stay on the outline"
)
BRIDGES = 3
CLEAR = 0.5
"""mm between the slot of a bridge, wherever it may lie, and an inlet tab."""
GAP = 1.0
"""mm between masks and the rest of their sheet: what is weeded."""
SLOT = 0.6
"""mm that the second cut takes out along a bridge; it reaches half of that past either side."""
DEEPEST = 2.5
"""mm by which the outline may run aslant under a bridge."""
TURN = 7.5
"""Degrees between the directions that are tried for bridges."""
INSET = 6.0
"""mm from the sheet's edges to pins and fiducials."""
ASIDE = 8.0
"""mm by which one corner's pin stands aside, so that no sheet fits turned or flipped."""
CHAMFER = 5.0
PLAY = 1.0
"""mm by which the holes at two corners are wider than their pins: these keep the sheet flat."""
FILM = 1.0
"""mm of film, at least, between a corner pin's hole and the sheet's edges, windows and marks."""
FIDUCIAL = 1.0
"""Diameter of the fiducials, mm."""
FAR = 500.0


@dataclass(frozen=True)
class Root:
    """Root of a bridge on the part: the second cut crosses the ray at ``end``."""

    start: Point
    direction: Point
    end: float
    width: float

    def at(self, distance: float) -> Point:
        (x, y), (dx, dy) = self.start, self.direction
        return x + dx * distance, y + dy * distance

    @property
    def stub(self) -> Region:
        return strip(self.start, self.at(self.end), self.width)

    @property
    def slot(self) -> Region:
        return strip(self.at(self.end), self.at(self.end + SLOT), self.width + SLOT)

    def bridge(self, window: Region) -> Region:
        """The strip from the stub into the sheet round the window."""
        band = strip(self.start, self.at(FAR), self.width) & window
        far = max(edge.farthest_along(self.start, self.direction) for edge in band.edges)
        return strip(self.at(self.end - self.width / 10), self.at(far + 1.0), self.width)


def roots(
    design: Design, shapes: Sequence[BalloonShape], bottom: Region, inlets: Sequence[Inlet]
) -> tuple[Root, ...]:
    """Return bridges spread round a part, clear of its inlet tabs; none for other methods.

    Raises DesignError for a tapered stack, and where tabs leave no room for bridges.
    """
    if design.registration.method != METHOD:
        return ()
    if len(shapes) != 1:
        raise DesignError(
            "balloons of different sizes cannot be made in registered sheets, for the second cut "
            "of a small balloon's bridges would go through a larger one; give chamber.diameter one "
            'value, or use registration.method = "ears"'
        )
    outline = shapes[0].outline
    tabs = grow(bottom - outline, CLEAR)
    angles = [TURN * i for i in range(int(360 / TURN))]
    tried = {angle: _root(angle, outline, tabs, design) for angle in angles}
    candidates = {angle: root for angle, root in tried.items() if root is not None}
    mouths = [math.degrees(math.atan2(i.direction[1], i.direction[0])) for i in inlets]
    chosen = max(
        combinations(candidates, BRIDGES), key=lambda three: _spread(three, mouths), default=None
    )
    if chosen is None:
        raise DesignError(
            f"the inlet tabs leave no room for {BRIDGES} bridges of panel.bridge_width = "
            f"{design.panel.bridge_width:g}; make it or inlet.width smaller, or use "
            'registration.method = "ears"'
        )
    return tuple(candidates[angle] for angle in chosen)


def _root(angle: float, outline: Region, tabs: Region, design: Design) -> Root | None:
    """The bridge in a direction from the middle; None where it would meet a tab or a recess."""
    start, direction, width = (0.0, 0.0), unit(angle), design.panel.bridge_width
    # The slot is wider than the bridge, and may lie off: all of it stays clear of the outline.
    room = width + SLOT + 2 * design.panel.second_cut_error
    way = strip(start, (FAR * direction[0], FAR * direction[1]), room)
    reach = max(
        (edge.farthest_along(start, direction) for edge in (way & outline).edges), default=0.0
    )
    root = Root(start, direction, reach + design.panel.stub, width)
    past = (root.stub - outline).area / width
    if past > design.panel.stub + DEEPEST or not (way & tabs).is_empty:
        return None
    return root


def _spread(angles: Sequence[float], mouths: Sequence[float]) -> float:
    """Quality of the spread of bridges: least angle between them, and to the inlets, as shares."""
    apart = [_between(a, b) for a, b in combinations(angles, 2)]
    free = [_between(angle, mouth) for angle in angles for mouth in mouths]
    return min([min(apart) / (360 / BRIDGES), *(f / 60 for f in free)])


def _between(a: float, b: float) -> float:
    return abs((a - b + 180) % 360 - 180)


def with_stubs(shape: BalloonShape, bridges: Iterable[Root]) -> BalloonShape:
    """Return a balloon whose outline has the stubs of its bridges."""
    stubs = [root.stub for root in bridges]
    return replace(shape, outline=union([shape.outline, *stubs])) if stubs else shape


def on_panel(laminate: Laminate, bridges: Sequence[Root], design: Design) -> Laminate:
    """Return the laminate with its registered sheets and corner pins; unchanged without bridges.

    Raises DesignError where not even one copy fits on film and platen, or pins are too thick for
    the sheet's corners.
    """
    if not bridges:
        return laminate
    profiles = {name: layers[0].profile for name, layers in laminate.patterns.items()}
    weeded = Region(grow(union(profiles.values()), GAP).outers)
    window = Region(grow(weeded, design.mask.overhang).outers)
    strips = [root.bridge(window) for root in bridges]
    openings = {
        name: (weeded if layers[0].is_mask else window)
        - (profiles[name] if layers[0].is_mask else union([profiles[name], *strips]))
        for name, layers in laminate.patterns.items()
    }
    places, batches = _places(window, design)
    outline = _outline(window, places, design)
    pins, holes = _pins(outline, design.registration.pin_diameter)
    marks = _fiducials(outline)
    _refuse_thick_pins(pins, (outline, *(window.moved(*place) for place in places)), marks)
    holes += [circle(mark, FIDUCIAL / 2) for mark in marks]
    whole = {name: _sheet(outline, holes, opening, places) for name, opening in openings.items()}
    slots = [contour for root in bridges for contour in root.slot.contours]
    panel = SheetPanel(
        outline=outline,
        places=places,
        sheets=tuple(whole[layer.pattern] for layer in laminate.layers),
        second=Region(_repeated(slots, places)),
        fiducials=marks,
        fiducial_diameter=FIDUCIAL,
        window=window,
        batches=batches,
    )
    return replace(laminate, pins=pins, panel=panel, notes=(*laminate.notes, NOTE))


def _places(window: Region, design: Design) -> tuple[tuple[Point, ...], int]:
    """Axes of the copies of one batch, the first at the origin, and how many batches there are."""
    low_x, low_y, high_x, high_y = window.bounds
    sheets, panel = design.sheets, design.panel
    pitch = high_x - low_x + panel.web, high_y - low_y + panel.web
    room = [
        min(platen, *(film - 2 * border for film, border in films))
        for platen, films in (
            (
                design.press.platen_width,
                ((sheets.tpe.width, sheets.tpe.border), (sheets.ptfe.width, sheets.ptfe.border)),
            ),
            (
                design.press.platen_length,
                ((sheets.tpe.length, sheets.tpe.border), (sheets.ptfe.length, sheets.ptfe.border)),
            ),
        )
    ]
    fit = [
        int((r - 2 * panel.margin + panel.web) / p + 1e-9) for r, p in zip(room, pitch, strict=True)
    ]
    if min(fit) < 1:
        size = " x ".join(f"{p - panel.web + 2 * panel.margin:.1f}" for p in pitch)
        raise DesignError(
            f"a registered sheet of one copy measures {size} mm, and film and platen take "
            f"{room[0]:g} x {room[1]:g}; take larger film (sheets), a larger platen or a smaller "
            "panel.margin"
        )
    copies = design.order.quantity
    batches = math.ceil(copies / (fit[0] * fit[1]))
    each = math.ceil(copies / batches)
    columns = min(fit[0], each)
    rows = math.ceil(each / columns)
    columns = math.ceil(each / rows)
    places = [
        (pitch[0] * column, pitch[1] * row) for row in range(rows) for column in range(columns)
    ]
    return tuple(places[:each]), batches


def _outline(window: Region, places: Sequence[Point], design: Design) -> Region:
    low_x, low_y, high_x, high_y = window.bounds
    margin = design.panel.margin
    x0, y0 = low_x - margin, low_y - margin
    x1 = max(x for x, _ in places) + high_x + margin
    y1 = max(y for _, y in places) + high_y + margin
    return polygon([(x0, y0), (x1, y0), (x1, y1 - CHAMFER), (x1 - CHAMFER, y1), (x0, y1)])


def _pins(outline: Region, diameter: float) -> tuple[tuple[Pin, ...], list[Contour]]:
    """Corner pins and their holes: one fits, one is a slot, two only keep the sheet flat."""
    x0, y0, x1, y1 = outline.bounds
    left, low, right, high = x0 + INSET, y0 + INSET, x1 - INSET, y1 - INSET
    corners = [(left, low), (right, low), (right, high), (left + ASIDE, high)]
    pins = tuple(Pin(f"corner{n}", place, diameter) for n, place in enumerate(corners, start=1))
    along = stadium((0.0, 0.0), diameter, diameter + PLAY).turned(90).moved(*corners[1])
    wide = [disc(corner, (diameter + PLAY) / 2) for corner in corners[2:]]
    holes = [disc(corners[0], diameter / 2), along, *wide]
    return pins, [contour for hole in holes for contour in hole.contours]


def _refuse_thick_pins(
    pins: Sequence[Pin], around: Sequence[Region], marks: Sequence[Point]
) -> None:
    """Raises DesignError where pins leave less than FILM round their holes."""
    plays = [0.0] + [PLAY] * (len(pins) - 1)
    centres = [pin.centre for pin in pins]
    room = [
        2 * (room - FILM) - play
        for centre, play in zip(centres, plays, strict=True)
        for room in (
            *(region.index.distance(centre) for region in around),
            *(math.dist(centre, mark) - FIDUCIAL / 2 for mark in marks),
        )
    ]
    room += [
        math.dist(a, b) - FILM - (p + q) / 2
        for (a, p), (b, q) in combinations(zip(centres, plays, strict=True), 2)
    ]
    most = math.floor(10 * min(room) + 1e-6) / 10
    if pins[0].diameter > most:
        raise DesignError(
            f"registration.pin_diameter = {pins[0].diameter:g} leaves less than {FILM:g} mm of "
            f"film round the holes in the corners of a registered sheet; at most {most:g} fits: "
            'make it smaller, or use registration.method = "ears"'
        )


def _fiducials(outline: Region) -> tuple[Point, ...]:
    """Three holes in the middle of sides, one of them aside, for the second cut to be laid by."""
    x0, y0, x1, y1 = outline.bounds
    middle = (y0 + y1) / 2
    return (x0 + INSET, middle), (x1 - INSET, middle), (x0 + 0.65 * (x1 - x0), y0 + INSET)


def _sheet(
    outline: Region, holes: Sequence[Contour], opening: Region, places: Sequence[Point]
) -> Region:
    inner = [contour.reversed() for contour in (*holes, *_repeated(opening.contours, places))]
    return Region((*outline.contours, *inner))


def _repeated(contours: Iterable[Contour], places: Sequence[Point]) -> tuple[Contour, ...]:
    region = Region(tuple(contours))
    return tuple(contour for place in places for contour in region.moved(*place).contours)
