"""Verification: every cut file is read back and compared with its source profile."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from sbafab.cutting.cut_settings import CUT_SEQUENCE, CUT_SHEET, ENGRAVE, REFERENCE
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import DATUM_ARM, Surroundings
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, Line, Point, box_round, distance_to
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import EdgeIndex, boxes_meet, widened

TOLERANCE = 0.001
"""Written contours lie within this of the exact ones, in mm."""
AREA_TOLERANCE = 1e-4
"""Share of the area that a written file may be off by."""


def verify_file(
    path: Path,
    expected: Region,
    expected_properties: Mapping[str, str],
    sheet: Surroundings | None = None,
) -> ReadBack:
    """Read the file at ``path``, compare it with the intended contours, and return it.

    The lines besides the parts of a film sheet are also compared.

    Raises OutputError with the file, the worst deviation and its place.
    """
    read = read_profile(path)
    try:
        if read.units != "mm":
            raise OutputError("it does not state millimetres as its units.")
        _check_properties(read.properties, expected_properties)
        check_sequence(read)
        check_contours(read.region, expected, TOLERANCE)
        off = abs(read.region.area - expected.area)
        if off > AREA_TOLERANCE * expected.area:
            raise OutputError(f"its area is {read.region.area:.6f} mm2, not {expected.area:.6f}.")
        if sheet is not None:
            check_surroundings(read, sheet)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error} Regenerate it.") from error
    return read


def check_surroundings(read: ReadBack, expected: Surroundings) -> None:
    """Compare a sheet's lines besides its parts: engraving in the waste, parting cut, frame.

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
                    f"the stroke on {layer} at x {x:.3f}, y {y:.3f} differs from the written one."
                )
    engraved = [edge for name, edges in read.strokes if name == ENGRAVE for edge in edges]
    if not engraved:
        return
    box = box_round([edge.bounds for edge in engraved])
    # No other contours hold a point of the engraving.
    near = Region(tuple(c for c in read.region.contours if boxes_meet(c.bounds, box)))
    for edge in engraved:
        if near.contains(edge.at(0.5)) or near.contains(edge.start):
            x, y = edge.start
            raise OutputError(f"engraving at x {x:.3f}, y {y:.3f} lies in a part.")


def check_datum(read: ReadBack) -> None:
    """Raise OutputError if a layer's file holds more than its contours and the datum cross.

    The cross must be present, because it aligns the layers.
    """
    arm = DATUM_ARM
    missing = [((-arm, 0.0), (arm, 0.0)), ((0.0, -arm), (0.0, arm))]
    for layer, edges in read.strokes:
        # In either sense.
        ends = sorted((edges[0].start, edges[-1].end), key=sum)
        datum = [line for line in missing if max(map(math.dist, line, ends)) <= TOLERANCE]
        if layer != REFERENCE or len(edges) != 1 or not datum:
            x, y = edges[0].start
            raise OutputError(
                f"a stroke on {layer} at x {x:.3f}, y {y:.3f} is not the datum cross; remove it."
            )
        missing.remove(datum[0])
    if missing:
        raise OutputError("the datum cross at x 0, y 0 is incomplete; regenerate it.")


def _check_properties(properties: Mapping[str, str], expected: Mapping[str, str]) -> None:
    for name in (*expected, *properties):
        if properties.get(name) != expected.get(name):
            raise OutputError(
                f"custom property {name} is {properties.get(name)!r}, not {expected.get(name)!r}."
            )


def check_sequence(read: ReadBack) -> None:
    """Raise OutputError if an outline is cut before a hole, or any layer out of sequence."""
    ranks = [CUT_SEQUENCE.index(layer) for layer in read.layers if layer in CUT_SEQUENCE]
    for before, after in pairwise(ranks):
        if before > after:
            raise OutputError(f"{CUT_SEQUENCE[before]} is cut before {CUT_SEQUENCE[after]}.")


def check_contours(region: Region, expected: Region, tolerance: float) -> None:
    """Raise OutputError if a contour is missing, or off by more than ``tolerance`` mm."""
    for kind, ours, theirs in (
        ("holes", expected.holes, region.holes),
        ("outlines", expected.outers, region.outers),
    ):
        if len(ours) != len(theirs):
            raise OutputError(f"it has {len(theirs)} {kind}, not {len(ours)}.")
        boxes = np.array([contour.bounds for contour in theirs], dtype=float)
        for contour in ours:
            # The unmatched contour whose box is most similar.
            number = int(np.abs(boxes - contour.bounds).sum(axis=1).argmin())
            boxes[number], nearest = math.inf, theirs[number]
            # Edges whose ends, centres and radii differ by a quarter of it lie within all of it.
            if _same(contour, nearest, tolerance / 4):
                continue
            off, (x, y) = max(
                deviation(contour.edges, nearest.edges, tolerance),
                deviation(nearest.edges, contour.edges, tolerance),
            )
            if off > tolerance:
                raise OutputError(
                    f"an edge is {off:.6f} mm off at x {x:.3f}, y {y:.3f}; the limit is "
                    f"{tolerance:g}."
                )


def _same(contour: Contour, second: Contour, room: float) -> bool:
    """Return True if two contours have equal edges, from any vertex, within ``room``."""
    ours, theirs = contour.edges, second.edges
    if len(ours) != len(theirs):
        return False
    start = ours[0].start
    first = min(range(len(theirs)), key=lambda i: math.dist(theirs[i].start, start))
    theirs = (*theirs[first:], *theirs[:first])
    return all(_same_edge(a, b, room) for a, b in zip(ours, theirs, strict=True))


def _same_edge(a: Edge, b: Edge, room: float) -> bool:
    if math.dist(a.start, b.start) > room or math.dist(a.end, b.end) > room:
        return False
    if isinstance(a, Line) or isinstance(b, Line):
        return isinstance(a, Line) and isinstance(b, Line)
    is_round = abs(a.radius - b.radius) <= room and math.dist(a.centre, b.centre) <= room
    return a.ccw == b.ccw and is_round


def deviation(
    edges: Sequence[Edge], expected: Sequence[Edge], tolerance: float
) -> tuple[float, Point]:
    """Return the largest distance in mm of edges from others, and its place.

    It is measured at points along every edge: thirds of a line, eighths of an arc.
    """
    index = EdgeIndex(expected)
    worst = 0.0, edges[0].start
    for edge in edges:
        count = 3 if isinstance(edge, Line) else 8
        for p in (edge.at(i / count) for i in range(count + 1)):
            near = [*index.touching(widened((*p, *p), tolerance))] or expected
            worst = max(worst, (min(distance_to(edge_there, p) for edge_there in near), p))
    return worst
