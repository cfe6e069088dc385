"""Every cut file is read back and compared with the profile it was written from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from sbafab.cutting.cut_layers import CUT_SEQUENCE, CUT_SHEET, ENGRAVE, REFERENCE
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import DATUM_ARM, Surroundings
from sbafab.errors import OutputError
from sbafab.geometry.edges import Line, Point, distance_to
from sbafab.geometry.region import Contour, Region

TOLERANCE = 0.001
"""Written contours lie within this of the exact ones, in mm."""
AREA_TOLERANCE = 1e-4
"""Share of the area that a written file may be off by."""


def verify_file(
    path: Path,
    expected: Region,
    expected_properties: Mapping[str, str],
    chord_error: float = 0.0,
) -> ReadBack:
    """Reads the file at ``path``, compares it with what was meant, and returns it.

    ``chord_error`` is the sagitta in mm allowed on top where curves were written as chords.
    Raises OutputError with the file, the worst deviation and its place.
    """
    found = read_profile(path)
    try:
        _check_properties(found.properties, expected_properties)
        _check_sequence(found)
        check_contours(found.region, expected, TOLERANCE + chord_error)
        _check_area(found.region, expected, chord_error)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error} Write it anew.") from error
    return found


def check_surroundings(found: ReadBack, expected: Surroundings) -> None:
    """Compares what a sheet has beside its parts: engraving in the waste, parting cut, frame.

    Raises OutputError with the layer and place of what differs, or of engraving inside a part.
    """
    frame = [expected.frame] if expected.frame is not None else []
    for layer, runs in (
        (ENGRAVE, expected.engraved),
        (CUT_SHEET, expected.parting),
        (REFERENCE, [((0.0, 0.0), (x, 0.0), (x, y), (0.0, y), (0.0, 0.0)) for x, y in frame]),
    ):
        drawn = [edges for name, edges in found.strokes if name == layer]
        if len(drawn) != len(runs):
            raise OutputError(f"{layer} has {len(drawn)} strokes, not {len(runs)}.")
        for edges, run in zip(drawn, runs, strict=True):
            points = [edges[0].start, *(edge.end for edge in edges)]
            if len(points) != len(run) or any(
                math.dist(p, q) > TOLERANCE for p, q in zip(points, run, strict=True)
            ):
                x, y = run[0]
                raise OutputError(f"the stroke on {layer} at x {x:.3f}, y {y:.3f} is another.")
    for name, edges in found.strokes:
        for edge in edges if name == ENGRAVE else ():
            if found.region.contains(edge.at(0.5)) or found.region.contains(edge.start):
                x, y = edge.start
                raise OutputError(f"engraving at x {x:.3f}, y {y:.3f} lies in a part.")


def check_datum(found: ReadBack) -> None:
    """Raises OutputError where a layer's file has more beside its contours than the datum cross.

    Nor may it have less: the cross is what layers are laid over each other by.
    """
    arm = DATUM_ARM
    wanted = [((-arm, 0.0), (arm, 0.0)), ((0.0, -arm), (0.0, arm))]
    for layer, edges in found.strokes:
        ends = edges[0].start, edges[-1].end
        own = next(
            (
                line
                for line in wanted
                if min(_apart(line, ends), _apart(line, ends[::-1])) <= TOLERANCE
            ),
            None,
        )
        if layer != REFERENCE or len(edges) != 1 or own is None:
            x, y = ends[0]
            raise OutputError(
                f"a stroke on {layer} at x {x:.3f}, y {y:.3f} is not the datum cross; remove it."
            )
        wanted.remove(own)
    if wanted:
        raise OutputError("the datum cross at x 0, y 0 is not whole; write it anew.")


def _apart(line: Sequence[Point], other: Sequence[Point]) -> float:
    return max(math.dist(p, q) for p, q in zip(line, other, strict=True))


def _check_properties(found: Mapping[str, str], expected: Mapping[str, str]) -> None:
    for name in (*expected, *found):
        if found.get(name) != expected.get(name):
            raise OutputError(
                f"custom property {name} is {found.get(name)!r}, not {expected.get(name)!r}."
            )


def _check_sequence(found: ReadBack) -> None:
    ranks = [CUT_SEQUENCE.index(layer) for layer in found.layers if layer in CUT_SEQUENCE]
    for before, after in pairwise(ranks):
        if before > after:
            raise OutputError(f"{CUT_SEQUENCE[before]} is cut before {CUT_SEQUENCE[after]}.")


def check_contours(found: Region, expected: Region, tolerance: float) -> None:
    """Raises OutputError where a contour is missing, or off by more than ``tolerance`` mm."""
    for kind, ours, theirs in (
        ("holes", expected.holes, found.holes),
        ("outlines", expected.outers, found.outers),
    ):
        if len(ours) != len(theirs):
            raise OutputError(f"it has {len(theirs)} {kind}, not {len(ours)}.")
        rest = list(theirs)
        for contour in ours:
            nearest = min(rest, key=lambda other: math.dist(other.bounds, contour.bounds))
            rest.remove(nearest)
            off, (x, y) = max(_deviation(contour, nearest), _deviation(nearest, contour))
            if off > tolerance:
                raise OutputError(
                    f"an edge is {off:.6f} mm off at x {x:.3f}, y {y:.3f}, "
                    f"where {tolerance:g} is allowed."
                )


def _check_area(found: Region, expected: Region, chord_error: float) -> None:
    length = sum(contour.length for contour in expected.contours)
    off = abs(found.area - expected.area)
    if off > AREA_TOLERANCE * expected.area + chord_error * length:
        raise OutputError(f"its area is {found.area:.6f} mm2, not {expected.area:.6f}.")


def _deviation(contour: Contour, other: Contour) -> tuple[float, Point]:
    """The largest distance of sampled points of a contour from the other, and where."""
    worst, place = 0.0, contour.edges[0].start
    near = 0
    for p in _samples(contour):
        distance, near = _nearest(other, p, near)
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
            if best < TOLERANCE / 1000:
                break
    return best, where
