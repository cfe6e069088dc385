"""Cases that other kernels refused or got wrong, drawn anew from the numbers in their trackers.

Each is held against shapely on fine chords and against single points, as in the hunt. Two arcs that
overlap in part stand for cavalier_contours 20, and failures of GEOS for JTS 1195 on the noding of
curves, of which it is a port: both give no coordinates.
"""

from __future__ import annotations

import math
from random import Random

import pytest

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, edge_from_bulge
from sbafab.geometry.region import Region, union
from tests.hunt.oracle import OPERATIONS, complaint, offset_complaint

QUARTER = math.tan(math.pi / 8)
"""Bulge of a quarter circle."""
Vertices = list[tuple[float, float, float]]


def outline(vertices: Vertices) -> Region:
    """The region inside a closed polyline of x, y and bulge."""
    edges: list[Edge] = [
        edge_from_bulge((x, y), (u, v), bulge)
        for (x, y, bulge), (u, v, _) in zip(vertices, [*vertices[1:], vertices[0]], strict=True)
    ]
    contour = Contour(tuple(edges))
    return Region((contour if contour.area > 0 else contour.reversed(),))


PAIRS: dict[str, tuple[Vertices, Vertices]] = {
    "cavalier_contours 20": (
        [(-5, 0, -0.3), (5, 0, 0), (5, -4, 0), (-5, -4, 0)],
        [(-5, 0, -0.3), (5, 0, 0), (5, 6, 0), (-5, 6, 0)],
    ),
    "cavalier_contours 23": (
        [(155.575, 113.665, 0), (161.29, 113.665, 1), (161.29, 114.935, 0), (155.575, 114.935, 1)],
        [(161.29, 113.665, 0), (167.64, 113.665, 1), (167.64, 114.935, 0), (161.29, 114.935, 1)],
    ),
    "cavalier_contours 38": (
        [(233.5, 0, 0), (222, 233.5, 0), (-233.5, 233.5, 0), (-233.5, 0, 0)],
        [(222, 233.5, 0), (232.934, 11.486, 0.4), (-0.283, 233.5, 0)],
    ),
    "CavalierContours 71": (
        [(100, 200, -1), (120, 200, 0), (120, 100, -1), (100, 100, 0)],
        [(110, 190, -1), (110, 210, 0), (210, 210, -1), (210, 190, 0)],
    ),
    # Cutting one by the other lost the curved part: they share half a circle.
    "GEOS 1497": (
        [(5, 0, 0), (0, 0, 0), (0, 5, 0), (5, 5, -1)],
        [(5, 0, 0), (0, 0, 0), (5, 5, -1)],
    ),
    # A disc and itself were refused, for an end of an arc came out as a point inside it.
    "GEOS 1510": (
        [(-1, 0, -QUARTER), (0, 1, -QUARTER), (1, 0, -QUARTER), (0, -1, -QUARTER)],
        [(-1, 0, -QUARTER), (0, 1, -QUARTER), (1, 0, -QUARTER), (0, -1, -QUARTER)],
    ),
    # A clover of half circles; the other shape touches none of its edges but was said to.
    "GEOS 1456": (
        [
            *[(3, 19, -1), (3, 25, -1), (9, 25, 0), (14, 20, 0)],
            *[(19, 25, -1), (25, 25, -1), (25, 19, 0), (20, 14, 0)],
            *[(25, 9, -1), (25, 3, -1), (19, 3, 0), (14, 8, 0)],
            *[(9, 3, -1), (3, 3, -1), (3, 9, 0), (8, 14, 0)],
        ],
        [(0, 0, 0), (1, 1, 0), (0, 1, 0)],
    ),
    # A disc in a square touches all four sides: straight on was taken for a turn.
    "MobilityDB 2629": (
        [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)],
        [(2, 0, QUARTER), (4, 2, QUARTER), (2, 4, QUARTER), (0, 2, QUARTER)],
    ),
}


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize("case", PAIRS)
def test_booleans(case: str, operation: str) -> None:
    a, b = (outline(vertices) for vertices in PAIRS[case])
    for seed in range(5):
        assert complaint(operation, a, b, Random(seed)) is None
        assert complaint(operation, b, a, Random(seed)) is None


OFFSETS: dict[str, tuple[Vertices, tuple[float, ...]]] = {
    "cavalier_contours 13": (
        [
            (0, 0, 0.39225530213565374),
            (-2466.3785800210244, -67.26296602434104, 0.484923954116067),
            (-2161.7248988609135, -2900.376762550583, 0.44171257084882926),
            (422.7001801508977, -2181.678349165927, 0.21373279590439873),
            (1217.850643134374, -1733.2038795014323, 0.47915321276268247),
            (4134.244054592013, -1954.8763015675465, 0.5643966953535755),
            (3262.8872828398416, 1137.416074109292, 0.41127495953982673),
            (961.0754444813574, -155.87051634718955, 0.22947158823257166),
        ],
        (100, -250),
    ),
    "CavalierContours 37": (
        [
            (30.123475382979791, -17, 0),
            (42, -17, 0),
            (42, 17, 0),
            (30.123475382979798, 17, -0.093311550024413187),
            (30.5, 15, 0),
            (30.5, -15, -0.093311550024413409),
        ],
        (2, -2),
    ),
}


@pytest.mark.parametrize("case", OFFSETS)
def test_offsets(case: str) -> None:
    vertices, distances = OFFSETS[case]
    for distance in distances:
        assert offset_complaint(outline(vertices), distance, Random(1)) is None


def test_unions_do_not_depend_on_the_order() -> None:
    for first, second in PAIRS.values():
        a, b = outline(first), outline(second)
        assert union([a, b]) == union([b, a])
