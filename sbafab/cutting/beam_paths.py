"""Paths of the beam on a film sheet: contours, with lead-ins, overcuts and tabs if requested.

A lead-in is a straight line in the waste that meets the contour at 90 or 45 degrees: inside a hole,
outside an outline. An overcut continues along the contour past its start. A tab is an uncut stretch
of an outline that holds the part in the skeleton; holes have no tabs, since their slugs are waste.
Tabs lie on smooth stretches, clear of corners and of the start. Only machine files have these
features: the sheet's DXF and the layer files hold the design.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import NamedTuple, Protocol

from sbafab.cutting.cut_settings import ENGRAVE, LeadIns
from sbafab.cutting.dxf_write import (
    LaserRun,
    Surroundings,
    contour_runs,
    layer_of,
    stroke_run,
)
from sbafab.cutting.placements import edge_distance
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, Line, Point, distance_to, left_turn, meeting_points
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import EdgeIndex, boxes_meet, widened

CORNER = math.radians(10)
"""A turn from edge to edge by more is a corner."""
TRIED = 32
"""Places along a contour where a lead-in is tried, after the middles of its longest edges."""
STEPS = 60
"""Places between one tab and the next where the tab is tried."""
DEPTHS = (0.25, 0.5, 0.75, 1.0)
"""Shares of a lead-in, from its end, at which its distance from its own contour is checked."""
TILTED = math.sqrt(0.5)
SHARE = 0.99 * TILTED
"""Least distance from the own contour at a depth, as a share of that depth."""
TINY = 1e-7
"""mm; no edge is cut so short."""


KeepOff = tuple[float, float, float]
"""x, y and diameter of a pin that holds the sheet down."""


def beam_runs(
    contours: Sequence[Contour],
    lead_ins: LeadIns,
    sheet: Surroundings,
    pins: Sequence[KeepOff] = (),
    name: str = "the sheet",
) -> list[LaserRun]:
    """Return the beam's paths for the contours of the sheet ``name``, in order.

    Raises DesignError with the place if a lead-in or a tab does not fit.
    """
    if lead_ins.is_plain:
        return list(contour_runs(contours))
    waste = _Waste(contours, lead_ins.clearance, sheet, pins)
    runs: list[LaserRun] = []
    for contour in contours:
        lap = _Lap(contour)
        start, lead = 0.0, None
        if lead_ins.lead_in:
            start, lead = _lead_in(lap, lead_ins, waste, name)
            waste.add(lead)
        runs += _contour_runs(lap, start, lead, lead_ins, name)
    return runs


def _contour_runs(
    lap: _Lap, start: float, lead: Line | None, lead_ins: LeadIns, name: str
) -> Iterator[LaserRun]:
    """Yield the runs of a contour that starts at a distance along it, mm from its first vertex."""
    contour, end = lap.contour, start + lap.length + lead_ins.overcut
    tabs = [] if contour.is_hole or not lead_ins.tabs else _tabs(lap, start, lead_ins, name)
    if lead is None and not tabs and not lead_ins.overcut:
        yield from contour_runs([contour])
        return
    half = lead_ins.gap / 2
    stops = [start, *(side for tab in tabs for side in (tab - half, tab + half)), end]
    for first, last in zip(stops[::2], stops[1::2], strict=True):
        edges = lap.stretch(first, last)
        yield LaserRun(
            layer_of(contour), (*([lead] if lead and first == start else []), *edges), False
        )


class _Lap:
    """Positions along a contour, as distances from its first vertex, mm."""

    def __init__(self, contour: Contour) -> None:
        self.contour = contour
        self._edges = contour.edges
        self._ends = [*accumulate(edge.length for edge in self._edges)]
        self.length = self._ends[-1]

    def place(self, way: float) -> tuple[Edge, Point]:
        """Return the edge at a position, and the point."""
        number, rest = self._number(way % self.length)
        edge = self._edges[number]
        return edge, edge.at(min(1.0, rest / edge.length))

    def _number(self, way: float) -> tuple[int, float]:
        number = min(bisect.bisect_right(self._ends, way), len(self._ends) - 1)
        return number, way - (self._ends[number] - self._edges[number].length)

    def stretch(self, first: float, last: float) -> list[Edge]:
        """Return the edges from one position to a later one, up to two laps ahead."""
        number, rest = self._number(first % self.length)
        edges, rest_length = [], last - first
        while rest_length > TINY:
            edge = self._edges[number % len(self._edges)]
            taken = min(edge.length - rest, rest_length)
            if taken > TINY:
                a, b = rest / edge.length, (rest + taken) / edge.length
                start = edge.start if a <= 0 else edge.at(a)
                end = edge.end if b >= 1 - 1e-12 else edge.at(b)
                edges.append(edge if taken == edge.length else edge.part(start, end))
            rest_length -= taken
            number, rest = number + 1, 0.0
        return edges

    @property
    def middles(self) -> list[float]:
        """Yield the midpoints of the edges, longest edges first, then positions all along."""
        spans = zip(self._edges, self._ends, strict=True)
        longest = sorted(spans, key=lambda span: -round(span[0].length, 6))[:TRIED]
        middles = [end - edge.length / 2 for edge, end in longest]
        return [*middles, *(self.length * k / TRIED for k in range(TRIED))]

    def is_smooth(self, first: float, last: float, tight: float) -> bool:
        """Return True if a stretch has no corner and no arc with a radius below ``tight``."""
        edges = self.stretch(first % self.length, first % self.length + last - first)
        bent = any(isinstance(edge, Arc) and edge.radius < tight for edge in edges)
        turns = map(left_turn, edges, edges[1:])
        return not bent and all(abs(turn) <= CORNER for turn in turns)


class _Waste:
    """Obstacles for lead-ins: contours, engraving, parting cut, frame, pins and other lead-ins."""

    def __init__(
        self,
        contours: Sequence[Contour],
        clearance: float,
        sheet: Surroundings,
        pins: Sequence[KeepOff],
    ) -> None:
        self._region = Region(tuple(contours))
        strokes = *sheet.engraved, *sheet.parting
        self._others = EdgeIndex([e for run in strokes for e in stroke_run(ENGRAVE, run).edges])
        self._clearance, self._frame, self._pins = clearance, sheet.frame, pins
        self._leads: list[Line] = []

    def add(self, lead: Line) -> None:
        self._leads.append(lead)

    def takes(self, lead: Line, contour: Contour) -> bool:
        """Return True if a lead-in to a contour is clear of all obstacles."""
        reach = self._clearance
        box = widened(lead.bounds, reach)
        own_edges = set(contour.edges)
        near = [*self._region.index.touching(box)]
        other_edges = [edge for edge in near if edge not in own_edges]
        other_edges += self._others.touching(box)
        other_edges += [
            lead_there for lead_there in self._leads if boxes_meet(lead_there.bounds, box)
        ]
        width, length = self._frame or (math.inf, math.inf)
        is_inside = self._frame is None or (
            min(box[:2]) >= 0 and box[2] <= width and box[3] <= length
        )
        return (
            is_inside
            and all(distance_to(lead, (x, y)) >= d / 2 + reach for x, y, d in self._pins)
            and self._leaves(lead, [edge for edge in near if edge in own_edges])
            and all(edge_distance(lead, edge).value >= reach for edge in other_edges)
        )

    def _leaves(self, lead: Line, own_edges: Sequence[Edge]) -> bool:
        """Return True if a lead-in meets its contour only at its end."""
        for depth in DEPTHS:
            p = lead.at(1 - depth)
            least = min(SHARE * depth * lead.length, self._clearance)
            if any(distance_to(edge, p) < least for edge in own_edges):
                return False
        return all(
            math.dist(p, lead.end) <= 1e-5 for edge in own_edges for p in meeting_points(lead, edge)
        )


def _lead_in(lap: _Lap, lead_ins: LeadIns, waste: _Waste, name: str) -> tuple[float, Line]:
    """Return the first position along a contour with room for a lead-in, and the lead-in."""
    length = lead_ins.lead_in
    for way in lap.middles:
        edge, (x, y) = lap.place(way)
        ux, uy = edge.direction((x, y))
        # The film lies to the left of every contour, the waste to the right.
        for across, back in ((1.0, 0.0), (TILTED, TILTED)):
            p = (
                x + length * (across * uy - back * ux),
                y + length * (-across * ux - back * uy),
            )
            lead = Line(p, (x, y))
            if waste.takes(lead, lap.contour):
                return way, lead
    key, clear = lead_ins.key, lead_ins.clearance
    raise DesignError(
        f"{key}.lead_in = {length:g} has no room at the {_about(lap.contour)} of {name}, "
        f"{clear:g} mm clear of other cuts; shorten it, or increase {key}.spacing"
    )


def _about(contour: Contour) -> str:
    low_x, low_y, high_x, high_y = contour.bounds
    kind = "hole" if contour.is_hole else "outline"
    return f"{kind} about x {(low_x + high_x) / 2:.1f}, y {(low_y + high_y) / 2:.1f}"


def _tabs(lap: _Lap, start: float, lead_ins: LeadIns, name: str) -> list[float]:
    """Return the midpoints of an outline's tabs, in cutting order; evenly spaced if possible."""
    gap, pitch = lead_ins.gap, lap.length / lead_ins.tabs
    # A gap's width from a corner, from the start and the overcut, and from another tab.
    first, last = start + lead_ins.overcut + 1.5 * gap, start + lap.length - 1.5 * gap
    tabs: list[float] = []
    for number in range(lead_ins.tabs):
        target = start + (number + 0.5) * pitch
        tries = (
            target + sign * step * pitch / STEPS for step in range(STEPS // 2) for sign in (1, -1)
        )
        tab = next(
            (
                way
                for way in tries
                if max(first, tabs[-1] + 2 * gap if tabs else first) <= way <= last
                and lap.is_smooth(way - 1.5 * gap, way + 1.5 * gap, gap)
            ),
            None,
        )
        if tab is None:
            raise DesignError(
                f"{lead_ins.key}.tabs = {lead_ins.tabs} of {lead_ins.tab_width:g} mm do not fit "
                f"on the {_about(lap.contour)} of {name}, clear of corners and of the start; use "
                "fewer or narrower tabs"
            )
        tabs.append(tab)
    return tabs


# Machine files read back, against the runs that were written.


BETWEEN = (0.25, 0.5, 0.75, 1.0)
"""Shares of a curve, from its start, at which it is sampled."""


class BeamCurve(Protocol):
    """A line, an arc or a Bezier curve."""

    @property
    def start(self) -> Point: ...
    @property
    def end(self) -> Point: ...
    def at(self, t: float) -> Point: ...


class BeamRun(NamedTuple):
    """Consecutive curves with the beam on, and their layer."""

    layer: str
    curves: Sequence[BeamCurve]


def run_difference(read: Sequence[BeamRun], expected: Sequence[LaserRun]) -> str:
    """Return a description of a run that is missing, on another layer, or off by more than
    TOLERANCE; "" if there is none.
    """
    if len(read) != len(expected):
        return f"it has {len(read)} lines, not {len(expected)}"
    for drawn, run in zip(read, expected, strict=True):
        x, y = run.edges[0].start
        place = f"the line at x {x:.3f}, y {y:.3f}"
        if drawn.layer != run.layer:
            return f"{place} is one of {drawn.layer}, not of {run.layer}"
        if run.circle is None and not _agrees(drawn.curves, run.edges):
            return f"{place} differs from the written one"
        if run.circle is not None and not _is_round(drawn.curves, *run.circle):
            return f"{place} is not the circle that was written"
    return ""


def _agrees(curves: Sequence[BeamCurve], edges: Sequence[Edge]) -> bool:
    """Return True if curves match edges, one by one; an arc may be read in several pieces."""
    if math.dist(curves[0].start, edges[0].start) > TOLERANCE:
        return False
    number, share = 0, 0.0
    for curve in curves:
        if number == len(edges):
            return False
        edge = edges[number]
        if any(distance_to(edge, curve.at(t)) > TOLERANCE for t in BETWEEN):
            return False
        share = edge.parameter(curve.end)
        if math.dist(curve.end, edge.end) <= TOLERANCE:
            number, share = number + 1, 0.0
    return number == len(edges) and share == 0.0


def _is_round(curves: Sequence[BeamCurve], centre: Point, radius: float) -> bool:
    points = [curve.at(t) for curve in curves for t in BETWEEN]
    low, high = (f(x for x, _ in points) for f in (min, max))
    on = all(abs(math.dist(p, centre) - radius) <= TOLERANCE for p in points)
    return on and high - low > 1.9 * radius
