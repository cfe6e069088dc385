"""Cases that other kernels refused or got wrong, drawn anew from the numbers in their trackers.

Each is held against shapely on fine chords and against single points, as in the hunt. OCCT 191 and
cavalier_contours 20 give no coordinates: a circle of OCCT 1452 and two arcs that overlap in part
stand for them. Of the larger outline in cavalier_contours 42 the corners near the smaller one are
taken, and its far end is closed with one straight edge. JTS 1195, on the noding of curves, gives no
coordinates: the failures of the same noder in GEOS, its port, stand for it.
"""

from __future__ import annotations

import math
from random import Random

import pytest

from sbafab.geometry.arcs import ellipse, fit_arcs
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, edge_from_bulge
from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region, disc, rectangle, union
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
    "cavalier_contours 42": (
        [
            (-188.500000000023, -166.831646988729, 0),
            (-188.5, -195.881478300073, 0),
            (-189, -196.91384910249, 0.553407781718062),
            (-170.999999999999, -225.631646989572, -0.553407781718061),
            (-153, -196.91384910249, -0.553407781718095),
            (-153.5, -195.881478300072, 0),
            (-153.5, -166.831646988778, 0),
            (-153.5, -166.820646988779, 0),
            (-188.500000000023, -166.820646988729, 0),
        ],
        [
            (412, -246.331646989572, 0),
            (412, -156.831646989572, 0),
            (319, -156.831646989571, 0),
            (319, -193.831646989571, 0),
            (317, -193.831646989571, 0),
            (317, -156.831646989572, 0),
            (-153.5, -156.831646989572, 0),
            (-153.5, -195.881478300072, 0),
            (-153, -196.91384910249, -0.553407781718061),
            (-171, -225.631646989571, -0.553407781718061),
            (-189, -196.91384910249, 0),
            (-188.5, -195.881478300073, 0),
            (-188.5, -156.831646989571, 0),
            (-498, -156.831646989571, 0),
            (-498, -246.331646989572, 0),
        ],
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
    "cavalier_contours 16": (
        [
            (0, 0, 0),
            (0, -882.3073569599583, 0.19403531582953024),
            (30.99567883971031, -942.6919889602286, 0.1940353158226031),
            (0, -1003.0766209573267, 0),
            (0, -1880, 0),
            (4, -1880, 0),
            (4, -1003.2606547873729, -0.19502429444774674),
            (34.00003211540752, -945.3840053746535, -0.19502429171847763),
            (64, -1003.2606547872638, 0),
            (64, -1880, 0),
            (68, -1880, 0),
            (68, -1003.0766209572321, 0.1940353134888888),
            (37.00432115854346, -942.6919889585697, 0.194035313489369),
            (68, -882.3073569597691, 0),
            (68, 0, 0),
            (64, 0, 0),
            (64, -882.1233231297883, -0.19502431066879408),
            (33.999968577962136, -939.9999731353018, -0.19502429444816094),
            (4, -882.1233231296792, 0),
            (4, 0, 0),
        ],
        (1, 2, 5, -1, -1.5),
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


def test_an_offset_that_falls_apart() -> None:
    """build123d 800: two discs joined by a narrow waist, and a plate whose hole cuts it in two."""
    waist = disc((0, 0), 2) | disc((3.9, 0), 2)
    parts = shrink(waist, 0.5)
    assert len(parts.pieces) == 2
    # More than the discs of 1.5: each runs out in a tip between the arcs round the waist's corners.
    assert parts.area > 2 * math.pi * 1.5**2
    assert offset_complaint(waist, -0.5, Random(1)) is None
    plate = rectangle((-7.5, -5), (7.5, 5)) - disc((0, 0), 4.9)
    cut = shrink(plate, 0.15)
    assert len(cut.pieces) == 2
    # A rectangle 14.7 x 9.7 less the disc of 5.05, of which two segments 0.2 high reach out of it.
    half = math.acos(4.85 / 5.05)
    out = 2 * 5.05**2 * (half - math.sin(half) * math.cos(half))
    assert cut.area == pytest.approx(14.7 * 9.7 - math.pi * 5.05**2 + out)


def test_a_small_circle_shrinks() -> None:
    """OCCT 1452: circles of 2 mm and less across crashed under a negative offset."""
    for radius in (0.99, 1.0, 1.005):
        less = shrink(disc((0, 0), radius), 0.052365194784652756)
        assert less.contours[0].circle == ((0, 0), pytest.approx(radius - 0.052365194784652756))


def test_a_ring_round_an_ellipse_is_closed() -> None:
    """CadQuery 1919: an ellipse of 15 x 16 grown by 5 and shrunk by 3 at once."""
    curve = ellipse((0.0, 0.0), (15.0, 0.0), (0.0, 16.0))
    edges = list(fit_arcs(curve, 0.0, math.tau, 1e-4))
    edges[-1] = edges[-1].part(edges[-1].start, edges[0].start)
    shape = Region((Contour(tuple(edges)),))
    band = grow(shape, 5) - shrink(shape, 3)
    assert len(band.contours) == 2
    # Steiner, outwards and (no curvature is tighter than 14 mm) inwards.
    around = sum(edge.length for edge in edges)
    expected = around * 8 + math.pi * (25 - 9)
    assert band.area == pytest.approx(expected, abs=1e-3)


def test_unions_do_not_depend_on_the_order() -> None:
    for first, second in PAIRS.values():
        a, b = outline(first), outline(second)
        assert union([a, b]) == union([b, a])
