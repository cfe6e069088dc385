"""Machine files against the design: each contour is cut once, with its lead-in, overcut and tabs.

The check does not trust the writer. It reads a file's curves back and measures their distance from
the contours of the sheet, the stretches they follow, and the stretches they leave out.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, Protocol

from sbafab.cutting.beam_paths import CORNER, SHARE, LaserRun
from sbafab.cutting.entries import Entries
from sbafab.cutting.properties import CUT_INNER, CUT_OUTER
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Line, Point, distance_to, left_turn, meeting_points
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Region
from sbafab.nesting.check import edge_distance

BETWEEN = (0.25, 0.5, 0.75, 1.0)
"""Shares of a curve, from its start, at which it is sampled."""
LONGEST_STEP = 0.45
"""Share of a contour: a longer step from one sample to the next does not follow the contour."""
ROOM = 4 * TOLERANCE
"""mm by which lengths along a contour may be off: ends of a stretch are off by TOLERANCE each."""


class BeamCurve(Protocol):
    """A line, an arc or a Bezier curve."""

    @property
    def start(self) -> Point: ...
    @property
    def end(self) -> Point: ...
    def at(self, t: float) -> Point: ...


class BeamRun(NamedTuple):
    """Curves one after the other with the beam on, and the layer that they are on."""

    layer: str
    curves: Sequence[BeamCurve]


# Machine files read back, against the runs that were written.


def check_runs(path: Path, read: Sequence[BeamRun], expected: Sequence[LaserRun]) -> None:
    """Raises OutputError with the file and the place of the first run that differs."""
    difference = run_difference(read, expected)
    if difference:
        raise OutputError(f"{path.name}: {difference}; regenerate it")


def run_difference(read: Sequence[BeamRun], expected: Sequence[LaserRun]) -> str:
    """Return text on a run that is missing, on another layer, or off by more than TOLERANCE;
    "" without any.
    """
    if len(read) != len(expected):
        return f"it has {len(read)} lines, not {len(expected)}"
    for drawn, run in zip(read, expected, strict=True):
        x, y = run.edges[0].start
        place = f"the line at x {x:.3f}, y {y:.3f}"
        if drawn.layer != run.layer:
            return f"{place} is one of {drawn.layer}, not of {run.layer}"
        if run.circle is None and not _agrees(drawn.curves, run.edges):
            return f"{place} differs from what was written"
        if run.circle is not None and not _is_round(drawn.curves, *run.circle):
            return f"{place} is not the circle that was written"
    return ""


def _agrees(curves: Sequence[BeamCurve], edges: Sequence[Edge]) -> bool:
    """Return True if curves lie on edges, one by one; arcs may be read in several pieces."""
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


# The parts' cuts against the contours of the sheet, measured.


class _Stretch(NamedTuple):
    """A run along a contour: where it begins and how long it is, mm, and whether it has a lead."""

    first: float
    length: float
    has_lead: bool

    @property
    def last(self) -> float:
        return self.first + self.length


class _Laps:
    """The contours of a region, and places along them."""

    def __init__(self, region: Region) -> None:
        self.region = region
        self.lengths = [contour.length for contour in region.contours]
        self._places: dict[Edge, tuple[int, float]] = {}
        for number, contour in enumerate(region.contours):
            way = 0.0
            for edge in contour.edges:
                self._places[edge] = number, way
                way += edge.length

    def near(self, p: Point, within: float = TOLERANCE) -> list[Edge]:
        """Edges within a distance of a point."""
        near = self.region.index.touching(widened((*p, *p), within))
        return [edge for edge in near if distance_to(edge, p) <= within]

    def place(self, p: Point) -> tuple[int, float]:
        """The contour at a point, and the way to it, mm. Raises OutputError for a point off all."""
        near = self.near(p)
        if not near:
            x, y = p
            raise OutputError(f"the beam is on at x {x:.3f}, y {y:.3f}, where nothing is to be cut")
        edge = min(near, key=lambda candidate: distance_to(candidate, p))
        number, way = self._places[edge]
        return number, way + min(1.0, max(0.0, edge.parameter(p))) * edge.length


def check_beam_runs(runs: Sequence[BeamRun], region: Region, entries: Entries) -> None:
    """Raises OutputError unless the runs cut exactly the region's contours, as the entries request.

    ``runs`` are those that cut parts; ``region`` holds the paths of a film sheet.
    """
    laps = _Laps(region)
    stretches: dict[int, list[_Stretch]] = defaultdict(list)
    leads: list[Line] = []
    outlines_begun = False
    for run in runs:
        number, stretch, lead = _measured(run, laps)
        is_hole = region.contours[number].is_hole
        x, y = run.curves[-1].end
        layer = CUT_INNER if is_hole else CUT_OUTER
        if run.layer != layer:
            raise OutputError(f"the cut at x {x:.3f}, y {y:.3f} is on {run.layer}, not {layer}")
        if is_hole and outlines_begun:
            raise OutputError(f"the hole at x {x:.3f}, y {y:.3f} is cut after an outline")
        outlines_begun = not is_hole
        stretches[number].append(stretch)
        if lead is not None:
            _check_lead(lead, number, laps, entries)
            leads.append(lead)
    for a, b in _near_pairs(leads, entries.clearance):
        if edge_distance(a, b).value < entries.clearance - TOLERANCE:
            x, y = a.start
            raise OutputError(f"lead-ins come too near to each other at x {x:.3f}, y {y:.3f}")
    for number in range(len(region.contours)):
        _check_lap(number, stretches[number], laps, entries)


def _near_pairs(leads: Sequence[Line], reach: float) -> list[tuple[Line, Line]]:
    ordered = sorted(leads, key=lambda lead: lead.bounds[0])
    pairs: list[tuple[Line, Line]] = []
    active: list[Line] = []
    for lead in ordered:
        active = [other for other in active if other.bounds[2] >= lead.bounds[0] - reach]
        pairs += [
            (lead, other)
            for other in active
            if other.bounds[1] <= lead.bounds[3] + reach
            and other.bounds[3] >= lead.bounds[1] - reach
        ]
        active.append(lead)
    return pairs


def _measured(run: BeamRun, laps: _Laps) -> tuple[int, _Stretch, Line | None]:
    """The contour that a run follows, the stretch of it, and the lead-in that it begins with."""
    for before, after in pairwise(run.curves):
        if math.dist(before.end, after.start) > TOLERANCE:
            x, y = after.start
            raise OutputError(f"the beam jumps to x {x:.3f}, y {y:.3f} while it is on")
    first = run.curves[0]
    has_lead = not laps.near(first.start)
    lead = _straight(first) if has_lead else None
    curves = run.curves[1:] if has_lead else run.curves
    if not curves:
        x, y = first.start
        raise OutputError(f"the beam is on at x {x:.3f}, y {y:.3f}, where nothing is to be cut")
    number, first_way, steps = _steps(curves, laps)
    length = sum(steps)
    if min(steps) < -TOLERANCE:
        # A whole lap may go either way: no more than that is asked of it.
        lap = laps.lengths[number]
        is_lap = max(steps) <= TOLERANCE and abs(length + lap) <= ROOM and not has_lead
        if not is_lap:
            x, y = curves[0].start
            raise OutputError(f"the cut at x {x:.3f}, y {y:.3f} runs backwards")
        length = lap
    return number, _Stretch(first_way, length, has_lead), lead


def _steps(curves: Sequence[BeamCurve], laps: _Laps) -> tuple[int, float, list[float]]:
    """The contour of curves, the way to their start along it, and the steps from there, mm."""
    number, first_way = laps.place(curves[0].start)
    lap, way = laps.lengths[number], first_way
    steps = []
    for curve in curves:
        for t in BETWEEN:
            here, next_way = laps.place(curve.at(t))
            step = math.remainder(next_way - way, lap)
            if here != number or abs(step) > LONGEST_STEP * lap:
                x, y = curve.at(t)
                raise OutputError(f"the cut leaves its contour at x {x:.3f}, y {y:.3f}")
            steps.append(step)
            way = next_way
    return number, first_way, steps


def _straight(curve: BeamCurve) -> Line:
    line = Line(curve.start, curve.end)
    if any(distance_to(line, curve.at(t)) > TOLERANCE for t in BETWEEN):
        x, y = curve.start
        raise OutputError(f"the lead-in at x {x:.3f}, y {y:.3f} is bent")
    return line


def _check_lead(lead: Line, number: int, laps: _Laps, entries: Entries) -> None:
    """Raises OutputError for a lead-in that was not requested, or that leaves the waste."""
    x, y = lead.start
    place = f"the lead-in at x {x:.3f}, y {y:.3f}"
    if abs(lead.length - entries.lead_in) > 2 * TOLERANCE:
        raise OutputError(f"{place} is {lead.length:.3f} mm long, not {entries.lead_in:g}")
    if laps.region.contains(lead.start):
        raise OutputError(f"{place} lies in a part")
    own = set(laps.region.contours[number].edges)
    for edge in laps.region.index.touching(widened(lead.bounds, entries.clearance)):
        if edge not in own:
            if edge_distance(lead, edge).value < entries.clearance - TOLERANCE:
                raise OutputError(
                    f"{place} is nearer than {entries.clearance:g} mm to another contour"
                )
            continue
        met = meeting_points(lead, edge)
        least = min(SHARE * lead.length, entries.clearance) - TOLERANCE
        if any(math.dist(p, lead.end) > TOLERANCE for p in met) or (
            distance_to(edge, lead.start) < least
        ):
            raise OutputError(f"{place} meets its own contour before its end")


def _check_lap(number: int, stretches: Sequence[_Stretch], laps: _Laps, entries: Entries) -> None:
    """Raises OutputError unless a contour's stretches make one lap with its overcut and tabs."""
    contour, length = laps.region.contours[number], laps.lengths[number]
    x, y = contour.edges[0].start
    place = f"the {'hole' if contour.is_hole else 'outline'} at x {x:.3f}, y {y:.3f}"
    if not stretches:
        raise OutputError(f"{place} is not cut")
    leads = [stretch.has_lead for stretch in stretches]
    if leads != [bool(entries.lead_in), *[False] * (len(stretches) - 1)]:
        raise OutputError(f"{place} has lead-ins at {sum(leads)} of its {len(leads)} cuts")
    tabs = 0 if contour.is_hole else entries.tabs
    if len(stretches) - 1 != tabs:
        raise OutputError(f"{place} has {len(stretches) - 1} tabs, not {tabs}")
    total = stretches[0].length
    for before, after in pairwise(stretches):
        gap = (after.first - before.last) % length
        if abs(gap - entries.gap) > ROOM:
            raise OutputError(f"a tab of {place} is {gap:.3f} mm of it uncut, not {entries.gap:g}")
        if _has_corner(laps, number, before.last % length, gap):
            raise OutputError(f"a tab of {place} lies over a corner")
        total += gap + after.length
    if abs(total - length - entries.overcut) > ROOM:
        over = total - length
        raise OutputError(f"{place} is cut {over:.3f} mm past its start, not {entries.overcut:g}")


def _has_corner(laps: _Laps, number: int, first: float, gap: float) -> bool:
    """Return True if a contour turns sharply in a stretch that begins at a distance along it."""
    edges, length = laps.region.contours[number].edges, laps.lengths[number]
    way = 0.0
    for before, after in zip(edges, [*edges[1:], edges[0]], strict=True):
        way += before.length
        if (way - first) % length < gap and abs(left_turn(before, after)) > CORNER:
            return True
    return False
