"""Edges of a planar profile: exact lines and circular arcs, their runs and meeting points.

Lengths are millimetres, angles radians. Every arc spans at most half a turn, so its bulge
(tan of a quarter of its sweep, the DXF convention) is at most one in size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

Point = tuple[float, float]
Bounds = tuple[float, float, float, float]

EPSILON = 2e-6
"""mm: a point nearer to an edge than this, 2 nm, lies on it."""
SAME = 2 * EPSILON
"""mm: points closer than this, 4 nm, are one point, and so are chains of such points. Far below the
1 um that the cut files promise.
"""

BENT = EPSILON / 4
"""mm: an edge whose ends were moved off its line or circle by more may cross others outside the
searched places. Two edges bent by less are within EPSILON of each other where they meet.
"""
UNKNOWN = 1e9
"""Radians: an angle that is not computed yet."""


def unit(degrees: float) -> Point:
    """The unit vector at an angle from the x axis; exact at quarter turns."""
    quarters = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    angle = math.radians(degrees)
    return quarters.get(degrees % 360) or (math.cos(angle), math.sin(angle))


@dataclass(slots=True, unsafe_hash=True)
class Line:
    """A straight edge from ``start`` to ``end``."""

    start: Point
    end: Point
    _length: float = field(default=0.0, init=False, repr=False, compare=False)

    @property
    def length(self) -> float:
        length = self._length
        if length == 0.0:
            length = self._length = math.dist(self.start, self.end)
        return length

    @property
    def bulge(self) -> float:
        return 0.0

    @property
    def segment_area(self) -> float:
        """The area between the chord and the edge: 0."""
        return 0.0

    @property
    def bounds(self) -> Bounds:
        x0, y0 = self.start
        x1, y1 = self.end
        return min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)

    def reversed(self) -> Line:
        return Line(self.end, self.start)

    def at(self, t: float) -> Point:
        """Point at fraction ``t`` of the length."""
        x0, y0 = self.start
        x1, y1 = self.end
        return x0 + t * (x1 - x0), y0 + t * (y1 - y0)

    def direction(self, p: Point) -> Point:
        """Unit direction of travel (the same at every ``p``)."""
        x0, y0 = self.start
        x1, y1 = self.end
        length = self._length or self.length
        return (x1 - x0) / length, (y1 - y0) / length

    def parameter(self, p: Point) -> float:
        """Fraction of the length at the foot of ``p``."""
        x0, y0 = self.start
        x1, y1 = self.end
        dx, dy = x1 - x0, y1 - y0
        return ((p[0] - x0) * dx + (p[1] - y0) * dy) / (dx * dx + dy * dy)

    def nearest(self, p: Point) -> Point:
        """Point of the edge nearest to ``p``."""
        return self.at(min(1.0, max(0.0, self.parameter(p))))

    def farthest_from(self, p: Point) -> float:
        """Greatest distance from ``p`` to a point of the edge."""
        return max(math.dist(p, self.start), math.dist(p, self.end))

    def to_left(self, p: Point) -> float:
        """Return the distance of ``p`` to the left of the infinite line, mm."""
        x, y = self.start
        ux, uy = self.direction(self.start)
        return ux * (p[1] - y) - uy * (p[0] - x)

    def part(self, start: Point, end: Point) -> Line:
        """The piece between two points of the edge, taken in the direction of travel."""
        return Line(start, end)

    def offset(self, distance: float) -> Line:
        """The parallel edge ``distance`` to the right of the direction of travel."""
        ux, uy = self.direction(self.start)
        nx, ny = uy * distance, -ux * distance
        x0, y0 = self.start
        x1, y1 = self.end
        return Line((x0 + nx, y0 + ny), (x1 + nx, y1 + ny))


@dataclass(slots=True, unsafe_hash=True)
class Arc:
    """A circular edge round ``centre``, counter-clockwise if ``ccw``; at most half a turn.

    Its sweep and bounds are computed once.
    """

    start: Point
    end: Point
    centre: Point
    radius: float
    ccw: bool
    _start_angle: float = field(default=UNKNOWN, init=False, repr=False, compare=False)
    _sweep: float = field(default=UNKNOWN, init=False, repr=False, compare=False)
    _bounds: Bounds | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def ends_lie_on_circle(self) -> bool:
        """True if both ends lie on the circle, to within BENT."""
        first = math.dist(self.start, self.centre) - self.radius
        last = math.dist(self.end, self.centre) - self.radius
        return -BENT < first < BENT and -BENT < last < BENT

    @property
    def start_angle(self) -> float:
        angle = self._start_angle
        if angle == UNKNOWN:
            x, y = self.start
            cx, cy = self.centre
            angle = self._start_angle = math.atan2(y - cy, x - cx)
        return angle

    @property
    def sweep(self) -> float:
        """Signed angle turned through: positive counter-clockwise."""
        sweep = self._sweep
        if sweep == UNKNOWN:
            sweep = self._sweep = self._turned()
        return sweep

    def _turned(self) -> float:
        cx, cy = self.centre
        x0, y0 = self.start
        x1, y1 = self.end
        ax, ay, bx, by = x0 - cx, y0 - cy, x1 - cx, y1 - cy
        turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        if self.ccw:
            return turn if turn > -1e-9 else turn + math.tau
        return turn if turn < 1e-9 else turn - math.tau

    @property
    def length(self) -> float:
        return self.radius * abs(self.sweep)

    @property
    def bulge(self) -> float:
        return math.tan(self.sweep / 4)

    @property
    def segment_area(self) -> float:
        """Signed area between the chord and the arc: positive when counter-clockwise."""
        sweep = self.sweep
        return 0.5 * self.radius**2 * (sweep - math.sin(sweep))

    @property
    def bounds(self) -> Bounds:
        bounds = self._bounds
        if bounds is None:
            bounds = self._bounds = self._box()
        return bounds

    def _box(self) -> Bounds:
        cx, cy = self.centre
        r = self.radius
        first, last = (self.start, self.end) if self.ccw else (self.end, self.start)
        x0, y0 = first
        x1, y1 = last
        low_x, high_x = (x0, x1) if x0 < x1 else (x1, x0)
        low_y, high_y = (y0, y1) if y0 < y1 else (y1, y0)
        # The ends may be off the circle by a rounding: include them in the box.
        return (
            cx - r if y0 >= cy >= y1 and cx - r < low_x else low_x,
            cy - r if x0 <= cx <= x1 and cy - r < low_y else low_y,
            cx + r if y0 <= cy <= y1 and cx + r > high_x else high_x,
            cy + r if x0 >= cx >= x1 and cy + r > high_y else high_y,
        )

    def reversed(self) -> Arc:
        return Arc(self.end, self.start, self.centre, self.radius, not self.ccw)

    def on_circle(self, angle: float) -> Point:
        return (
            self.centre[0] + self.radius * math.cos(angle),
            self.centre[1] + self.radius * math.sin(angle),
        )

    def at(self, t: float) -> Point:
        """Point at fraction ``t`` of the length."""
        return self.on_circle(self.start_angle + t * self.sweep)

    def direction(self, p: Point) -> Point:
        """Unit direction of travel at ``p``, a point of the arc."""
        x, y = p[0] - self.centre[0], p[1] - self.centre[1]
        r = math.hypot(x, y) or 1.0
        return (-y / r, x / r) if self.ccw else (y / r, -x / r)

    def parameter(self, p: Point) -> float:
        """Fraction of the sweep at the foot of ``p``; outside 0 to 1 if the foot misses the arc."""
        cx, cy = self.centre
        ax, ay = self.start[0] - cx, self.start[1] - cy
        bx, by = p[0] - cx, p[1] - cy
        turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        sweep = self.sweep
        half = sweep / 2
        turn = half + math.remainder(turn - half, math.tau)
        return turn / sweep

    def nearest(self, p: Point) -> Point:
        """Point of the edge nearest to ``p``."""
        cx, cy = self.centre
        x0, y0 = self.start
        x1, y1 = self.end
        x, y = p[0] - cx, p[1] - cy
        after_start = (x0 - cx) * y - (y0 - cy) * x
        before_end = x * (y1 - cy) - y * (x1 - cx)
        faces = min(after_start, before_end) >= 0 if self.ccw else max(after_start, before_end) <= 0
        distance = math.hypot(x, y)
        if faces and distance > EPSILON:
            scale = self.radius / distance
            return cx + x * scale, cy + y * scale
        return self.start if math.dist(p, self.start) <= math.dist(p, self.end) else self.end

    def farthest_from(self, p: Point) -> float:
        """Greatest distance from ``p`` to a point of the edge."""
        opposite = (2 * self.centre[0] - p[0], 2 * self.centre[1] - p[1])
        if math.dist(p, self.centre) > EPSILON and 0.0 <= self.parameter(opposite) <= 1.0:
            return math.dist(p, self.centre) + self.radius
        return max(math.dist(p, self.start), math.dist(p, self.end))

    def to_left(self, p: Point) -> float:
        """Return the distance of ``p`` to the left of the whole circle, mm."""
        inside = self.radius - math.dist(p, self.centre)
        return inside if self.ccw else -inside

    def part(self, start: Point, end: Point) -> Arc:
        """The piece between two points of the edge, taken in the direction of travel."""
        return Arc(start, end, self.centre, self.radius, self.ccw)

    def offset(self, distance: float) -> Arc | None:
        """The concentric edge ``distance`` to the right; None if it shrinks to nothing."""
        radius = self.radius + distance if self.ccw else self.radius - distance
        if radius < EPSILON:
            return None
        scale = radius / self.radius
        cx, cy = self.centre

        x0, y0 = self.start
        x1, y1 = self.end
        start = cx + (x0 - cx) * scale, cy + (y0 - cy) * scale
        end = cx + (x1 - cx) * scale, cy + (y1 - cy) * scale
        return Arc(start, end, self.centre, radius, self.ccw)


Edge = Line | Arc


def edge_from_bulge(start: Point, end: Point, bulge: float) -> Edge:
    """The line (bulge 0) or arc that a polyline vertex with this bulge starts."""
    if bulge == 0.0:
        return Line(start, end)
    x0, y0 = start
    x1, y1 = end
    lean = (1 / bulge - bulge) / 4
    cx = (x0 + x1) / 2 - lean * (y1 - y0)
    cy = (y0 + y1) / 2 + lean * (x1 - x0)
    return Arc(start, end, (cx, cy), math.hypot(x0 - cx, y0 - cy), bulge > 0)


def quarter_arcs(
    start: Point, end: Point, centre: Point, radius: float, sweep: float
) -> list[Edge]:
    """The arcs of at most a quarter turn round ``centre`` that together turn ``sweep``."""
    count = max(1, math.ceil(abs(sweep) / (math.pi / 2) - 1e-6))
    circle = Arc(start, end, centre, radius, sweep > 0)
    first = circle.start_angle
    stops = [start, *(circle.on_circle(first + sweep * i / count) for i in range(1, count)), end]
    return [circle.part(a, b) for a, b in pairwise(stops)]


def from_end_to_end(edge: Edge) -> Edge:
    """Return the edge; an arc with an end off its circle by more than BENT becomes the arc of equal
    sweep through both ends.
    """
    if not isinstance(edge, Arc) or edge.ends_lie_on_circle:
        return edge
    return edge_from_bulge(edge.start, edge.end, edge.bulge)


def left_turn(before: Edge, after: Edge) -> float:
    """Angle between -pi and pi that a path turns to the left from one edge to the next."""
    ux, uy = before.direction(before.end)
    vx, vy = after.direction(after.start)
    return math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)


def left_normal(edge: Edge, p: Point) -> Point:
    """Unit normal to the left of travel at ``p``: into the material of a region's contour."""
    ux, uy = edge.direction(p)
    return -uy, ux


def distance_to(edge: Edge, p: Point) -> float:
    """Least distance from ``p`` to the edge."""
    return math.dist(p, edge.nearest(p))


def turns_round(edge: Edge, p: Point) -> int:
    """Return the contribution of an edge to its contour's winding number around ``p``."""
    px, py = p
    x0, y0 = edge.start
    x1, y1 = edge.end
    side = (x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)
    turns = 0
    if y0 <= py < y1 and side > 0:
        turns = 1
    elif y1 <= py < y0 and side < 0:
        turns = -1
    if isinstance(edge, Arc):
        cx, cy = edge.centre
        dx, dy = x1 - x0, y1 - y0
        # Only beside its chord: the chord of a short arc with snapped ends may lean either way.
        beside = 0 <= (px - x0) * dx + (py - y0) * dy <= dx * dx + dy * dy
        if beside and (px - cx) * (px - cx) + (py - cy) * (py - cy) < edge.radius * edge.radius:
            # A point exactly on the chord belongs to the side that the count above assigned.
            is_left = side > 0 or (side == 0 and (y0 > y1 or (y0 == y1 and x1 > x0)))
            if edge.ccw and not is_left:
                turns += 1
            elif not edge.ccw and is_left:
                turns -= 1
    return turns


def box_round(boxes: Sequence[Bounds]) -> Bounds:
    """Return the bounding box of all boxes; an inverted box if there are none."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for box in boxes:
        low_x = min(low_x, box[0])
        low_y = min(low_y, box[1])
        high_x = max(high_x, box[2])
        high_y = max(high_y, box[3])
    return low_x, low_y, high_x, high_y


# Runs: edges of a closed chain grouped by the line or circle that they lie on.


_Run = tuple[Edge, ...]
DRIFT = 4 * EPSILON
"""mm by which the edges of one run may deviate from its line or circle in total."""


def runs(edges: _Run) -> Iterator[_Run]:
    """Return the edges grouped by their common line or circle, from the first corner on."""
    breaks = [i for i in range(len(edges)) if not same_support(edges[i - 1], edges[i])]
    if not breaks:
        yield from _parted(edges)
        return
    for first, last in zip(breaks, [*breaks[1:], breaks[0]], strict=True):
        yield from _parted(edges[first:last] if first < last else edges[first:] + edges[:last])


def same_support(a: Edge, b: Edge) -> bool:
    """Return True if two edges lie on one circle, or are parallel lines, and turn the same way."""
    if isinstance(a, Arc) and isinstance(b, Arc):
        return (
            a.ccw == b.ccw
            and abs(a.radius - b.radius) < EPSILON
            and math.dist(a.centre, b.centre) < EPSILON
        )
    if isinstance(a, Line) and isinstance(b, Line):
        ux, uy = a.direction(a.start)
        vx, vy = b.direction(b.start)
        return ux * vx + uy * vy > 0 and abs(ux * vy - uy * vx) * (a.length + b.length) < EPSILON
    return False


def _parted(run: _Run) -> Iterator[_Run]:
    """Yield the parts of the run that each follow one line or circle.

    Every pair of neighbours may look straight although the run as a whole turns a corner.
    """
    if len(run) < 3:
        yield run
        return
    head, end = run[0], run[-1].end
    if isinstance(head, Arc):
        offs = [_off_circle(edge, head) for edge in run]
        place = next((i for i, off in enumerate(offs) if off > DRIFT), 0)
    else:
        # The point of a closed run farthest from its start.
        chord = Line(head.start, end)
        offs = [
            math.dist(edge.start, end) if head.start == end else abs(chord.to_left(edge.start))
            for edge in run
        ]
        farthest = max(range(len(run)), key=offs.__getitem__)
        place = farthest if offs[farthest] > DRIFT else 0
    if not place:
        yield run
        return
    yield from _parted(run[:place])
    yield from _parted(run[place:])


def _off_circle(edge: Edge, head: Arc) -> float:
    """Return the difference of an arc's circle from another arc's, mm."""
    if not isinstance(edge, Arc):
        return math.inf
    return max(abs(edge.radius - head.radius), math.dist(edge.centre, head.centre))


# Meeting points of two edges: crossings, touches, and the ends of a shared stretch.


def meeting_points(a: Edge, b: Edge, tolerance: float = EPSILON) -> list[Point]:
    """Return the points that lie on both edges, within the tolerance.

    Overlapping edges give the ends of the shared stretch.
    """
    ends = (b.start, b.end)
    points = [p for p in (a.start, a.end) if p in ends or distance_to(b, p) < tolerance]
    points += [p for p in ends if p not in (a.start, a.end) and distance_to(a, p) < tolerance]
    for p in _support_crossings(a, b, tolerance):
        # Prefer a known end to a computed point, which is less exact at a touch.
        if all(math.dist(p, q) > 2 * tolerance for q in points) and (
            distance_to(a, p) < tolerance and distance_to(b, p) < tolerance
        ):
            points.append(p)
    return points


def _support_crossings(a: Edge, b: Edge, tolerance: float) -> list[Point]:
    if isinstance(a, Line):
        if isinstance(b, Line):
            return _line_line(a, b)
        return line_circle(a.start, a.direction(a.start), b.centre, b.radius, tolerance)
    if isinstance(b, Line):
        return line_circle(b.start, b.direction(b.start), a.centre, a.radius, tolerance)
    return _circle_circle(a, b, tolerance)


def _line_line(a: Line, b: Line) -> list[Point]:
    ax, ay = a.start
    bx, by = b.start
    ux, uy = a.direction(a.start)
    vx, vy = b.direction(b.start)
    cross = ux * vy - uy * vx
    if abs(cross) < 1e-12:
        return []
    t = ((bx - ax) * vy - (by - ay) * vx) / cross
    return [(ax + t * ux, ay + t * uy)]


def line_circle(
    origin: Point, unit: Point, centre: Point, radius: float, tolerance: float = EPSILON
) -> list[Point]:
    """Crossings of the infinite line through ``origin`` with a circle; a tangent counts once."""
    ox, oy = origin
    ux, uy = unit
    cx, cy = centre
    along = (cx - ox) * ux + (cy - oy) * uy
    across = (cx - ox) * uy - (cy - oy) * ux
    foot = (ox + along * ux, oy + along * uy)
    room = radius - abs(across)
    if room < -tolerance:
        return []
    half = math.sqrt(max(0.0, room * (radius + abs(across))))
    if half < tolerance:
        return [foot]
    points = [
        (foot[0] - half * ux, foot[1] - half * uy),
        (foot[0] + half * ux, foot[1] + half * uy),
    ]
    return [foot, *points] if room < tolerance else points


def _circle_circle(a: Arc, b: Arc, tolerance: float) -> list[Point]:
    ax, ay = a.centre
    bx, by = b.centre
    gap = math.hypot(bx - ax, by - ay)
    if gap < 1e-12:
        return []
    outside = a.radius + b.radius - gap
    inside = gap - abs(a.radius - b.radius)
    if outside < -tolerance or inside < -tolerance:
        return []
    ux, uy = (bx - ax) / gap, (by - ay) / gap
    along = (gap * gap + (a.radius - b.radius) * (a.radius + b.radius)) / (2 * gap)
    # The product form keeps its digits if the circles nearly touch (Heron).
    rest = outside * inside * (gap + a.radius + b.radius) * (gap + abs(a.radius - b.radius))
    half = math.sqrt(max(0.0, rest)) / (2 * gap)
    if outside < tolerance or inside < tolerance:
        side = 1.0 if along > 0 else -1.0
        touch = (ax + side * a.radius * ux, ay + side * a.radius * uy)
        if half < tolerance:
            return [touch]
    foot = (ax + along * ux, ay + along * uy)
    return [
        (foot[0] - half * uy, foot[1] + half * ux),
        (foot[0] + half * uy, foot[1] - half * ux),
    ]
