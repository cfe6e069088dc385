"""Verification: every cut file is read back and compared with the profile it was written from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import DATUM_ARM, Surroundings
from sbafab.cutting.properties import CUT_SEQUENCE, CUT_SHEET, ENGRAVE, REFERENCE
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, Line, Point, distance_to
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region

TOLERANCE = 0.001
"""Written contours lie within this of the exact ones, in mm."""
ROUNDING = TOLERANCE / 1000
"""Edges that agree to this, in mm, are the same edge, written and read."""
AREA_TOLERANCE = 1e-4
"""Share of the area that a written file may be off by."""


def verify_file(
    path: Path,
    expected: Region,
    expected_properties: Mapping[str, str],
) -> ReadBack:
    """Reads the file at ``path``, compares it with the intended contours, and returns it.

    Raises OutputError with the file, the worst deviation and its place.
    """
    read = read_profile(path)
    try:
        if read.units != "mm":
            raise OutputError("it does not say that its units are millimetres.")
        _check_properties(read.properties, expected_properties)
        _check_sequence(read)
        check_contours(read.region, expected, TOLERANCE)
        _check_area(read.region, expected)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error} Regenerate it.") from error
    return read


def check_surroundings(read: ReadBack, expected: Surroundings) -> None:
    """Compares a sheet's lines beside its parts: engraving in the waste, parting cut, frame.

    Raises OutputError with the layer and place of a difference, or of engraving inside a part.
    """
    for layer, runs in (
        (ENGRAVE, expected.engraved),
        (CUT_SHEET, expected.parting),
        (REFERENCE, expected.frames),
    ):
        drawn = [edges for name, edges in read.strokes if name == layer]
        if len(drawn) != len(runs):
            raise OutputError(f"{layer} has {len(drawn)} strokes, not {len(runs)}.")
        for edges, run in zip(drawn, runs, strict=True):
            points = [edges[0].start, *(edge.end for edge in edges)]
            if len(points) != len(run) or any(
                math.dist(p, q) > TOLERANCE for p, q in zip(points, run, strict=True)
            ):
                x, y = run[0]
                raise OutputError(
                    f"the stroke on {layer} at x {x:.3f}, y {y:.3f} differs from what was written."
                )
    engraved = [edge for name, edges in read.strokes if name == ENGRAVE for edge in edges]
    near = _near(read.region, engraved)
    for edge in engraved:
        if near.contains(edge.at(0.5)) or near.contains(edge.start):
            x, y = edge.start
            raise OutputError(f"engraving at x {x:.3f}, y {y:.3f} lies in a part.")


def _near(region: Region, edges: Sequence[Edge]) -> Region:
    """The contours of a region that reach into the box round some edges: no others hold a point."""
    left, bottom, right, top = Region((Contour(tuple(edges)),)).bounds
    return Region(
        tuple(
            contour
            for contour in region.contours
            for low_x, low_y, high_x, high_y in (contour.bounds,)
            if low_x <= right and high_x >= left and low_y <= top and high_y >= bottom
        )
    )


def check_datum(read: ReadBack) -> None:
    """Raises OutputError if a layer's file holds more than its contours and the datum cross.

    The cross must be present: layers are aligned by it.
    """
    arm = DATUM_ARM
    expected = [((-arm, 0.0), (arm, 0.0)), ((0.0, -arm), (0.0, arm))]
    for layer, edges in read.strokes:
        ends = edges[0].start, edges[-1].end
        datum = next(
            (
                line
                for line in expected
                if min(_distance(line, ends), _distance(line, ends[::-1])) <= TOLERANCE
            ),
            None,
        )
        if layer != REFERENCE or len(edges) != 1 or datum is None:
            x, y = ends[0]
            raise OutputError(
                f"a stroke on {layer} at x {x:.3f}, y {y:.3f} is not the datum cross; remove it."
            )
        expected.remove(datum)
    if expected:
        raise OutputError("the datum cross at x 0, y 0 is not whole; regenerate it.")


def _distance(line: Sequence[Point], second: Sequence[Point]) -> float:
    return max(math.dist(p, q) for p, q in zip(line, second, strict=True))


def _check_properties(properties: Mapping[str, str], expected: Mapping[str, str]) -> None:
    for name in (*expected, *properties):
        if properties.get(name) != expected.get(name):
            raise OutputError(
                f"custom property {name} is {properties.get(name)!r}, not {expected.get(name)!r}."
            )


def _check_sequence(read: ReadBack) -> None:
    ranks = [CUT_SEQUENCE.index(layer) for layer in read.layers if layer in CUT_SEQUENCE]
    for before, after in pairwise(ranks):
        if before > after:
            raise OutputError(f"{CUT_SEQUENCE[before]} is cut before {CUT_SEQUENCE[after]}.")


def check_contours(region: Region, expected: Region, tolerance: float) -> None:
    """Raises OutputError if a contour is missing, or off by more than ``tolerance`` mm."""
    for kind, ours, theirs in (
        ("holes", expected.holes, region.holes),
        ("outlines", expected.outers, region.outers),
    ):
        if len(ours) != len(theirs):
            raise OutputError(f"it has {len(theirs)} {kind}, not {len(ours)}.")
        if all(map(_same, ours, theirs)):
            continue
        for contour, nearest in _paired(ours, theirs):
            # Edges whose ends, centres and radii differ by a quarter of it lie within all of it.
            if _same(contour, nearest, tolerance / 4):
                continue
            off, (x, y) = max(_deviation(contour, nearest), _deviation(nearest, contour))
            if off > tolerance:
                raise OutputError(
                    f"an edge is {off:.6f} mm off at x {x:.3f}, y {y:.3f}, "
                    f"where {tolerance:g} is allowed."
                )


def _paired(
    ours: Sequence[Contour], theirs: Sequence[Contour]
) -> Iterator[tuple[Contour, Contour]]:
    """Each of our contours with the unmatched contour of theirs whose box is most similar."""
    boxes = np.array([contour.bounds for contour in theirs], dtype=float)
    for contour in ours:
        number = int(np.abs(boxes - contour.bounds).sum(axis=1).argmin())
        boxes[number] = math.inf
        yield contour, theirs[number]


def _same(contour: Contour, second: Contour, room: float = ROUNDING) -> bool:
    """Return True if two contours have equal edges, from whichever vertex, to within ``room``."""
    ours, theirs = contour.edges, second.edges
    if len(ours) != len(theirs):
        return False
    start = ours[0].start
    if math.dist(theirs[0].start, start) > room:
        first = min(range(len(theirs)), key=lambda i: math.dist(theirs[i].start, start))
        theirs = (*theirs[first:], *theirs[:first])
    return all(_same_edge(a, b, room) for a, b in zip(ours, theirs, strict=True))


def _same_edge(a: Edge, b: Edge, room: float) -> bool:
    if math.dist(a.start, b.start) > room or math.dist(a.end, b.end) > room:
        return False
    if isinstance(a, Line) or isinstance(b, Line):
        return isinstance(a, Line) and isinstance(b, Line)
    return (
        a.ccw == b.ccw
        and abs(a.radius - b.radius) <= room
        and math.dist(a.centre, b.centre) <= room
    )


def _check_area(region: Region, expected: Region) -> None:
    off = abs(region.area - expected.area)
    if off > AREA_TOLERANCE * expected.area:
        raise OutputError(f"its area is {region.area:.6f} mm2, not {expected.area:.6f}.")


def _deviation(contour: Contour, second: Contour) -> tuple[float, Point]:
    """The largest distance of sampled points of a contour from the other, and where."""
    worst, place = 0.0, contour.edges[0].start
    near = 0
    for p in _samples(contour):
        distance, near = _nearest(second, p, near)
        if distance > worst:
            worst, place = distance, p
    return worst, place


def _samples(contour: Contour) -> Sequence[Point]:
    """Every vertex, and points along every edge: thirds of a line, eighths of an arc."""
    points: list[Point] = []
    for edge in contour.edges:
        count = 3 if isinstance(edge, Line) else 8
        points += [edge.start, *(edge.at(i / count) for i in range(1, count))]
    return points


def _nearest(contour: Contour, p: Point, hint: int) -> tuple[float, int]:
    """Distance to the contour's nearest edge and its index, trying the edges from ``hint`` on.

    An edge within a thousandth of the tolerance is near enough to end the search.
    """
    best, where = math.inf, hint
    count = len(contour.edges)
    for step in range(count):
        # Both senses, for the contours may start at different vertices.
        index = (hint + (step + 1) // 2 * (1 if step % 2 else -1)) % count
        distance = distance_to(contour.edges[index], p)
        if distance < best:
            best, where = distance, index
            if best < ROUNDING:
                break
    return best, where
