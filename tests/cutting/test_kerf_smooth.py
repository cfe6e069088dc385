"""The path of a beam of two widths round smooth outlines, slots and stars, judged by shapely.

SBAFAB_KERF_SHAPES=300 asks for as many random shapes; the default takes two seconds.
"""

from __future__ import annotations

import math
import os
import random
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from shapely.affinity import scale

from sbafab.actuators import load_design
from sbafab.api import build
from sbafab.cutting.chaining import check_clear
from sbafab.cutting.kerf import compensate
from sbafab.geometry.arcs import bezier, fit_arcs
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, polygon, stadium, union
from tests.quick import few

COUNT = int(os.environ.get("SBAFAB_KERF_SHAPES", "8"))
PAIRS = ((0.12, 0.1), (0.1, 0.12), (0.05, 0.2), (0.3, 0.1), (0.08, 0.085))
OFF = 0.0002
"""mm: the path's own 0.1 um, and the judge's chords."""
DROPPED = 0.01
"""Share of a beam's half width by which shapely may simplify a shape before it grows it."""


def blob(rng: random.Random) -> Region:
    """A closed path of Bézier curves through random points round the origin, often concave."""
    count, size, rough = rng.randint(5, 14), rng.uniform(2.5, 6), rng.uniform(0.05, 0.45)
    turns = [math.tau * i / count for i in range(count)]
    points = [
        (r * math.cos(t), r * math.sin(t))
        for t in turns
        for r in [size * rng.uniform(1 - rough, 1 + rough)]
    ]

    def handle(i: int, sign: int) -> Point:
        (x0, y0), (x, y), (x1, y1) = points[i - 1], points[i], points[(i + 1) % count]
        return x + sign * (x1 - x0) / 6, y + sign * (y1 - y0) / 6

    edges: list[Edge] = []
    for i in range(count):
        after = (i + 1) % count
        curve = bezier([points[i], handle(i, 1), handle(after, -1), points[after]])
        edges += fit_arcs(curve, 0.0, 1.0)
    return union([Region((Contour(tuple(edges)),))])


def slot(rng: random.Random) -> Region:
    return stadium((0.0, 0.0), rng.uniform(1, 4), rng.uniform(5, 12)).turned(rng.uniform(0, 180))


def star(rng: random.Random) -> Region:
    count, inner = 2 * rng.randint(3, 9), rng.uniform(0.45, 0.85)
    size, first = rng.uniform(3.5, 7), rng.uniform(0, 6)
    return polygon(
        [
            (r * math.cos(first + math.tau * i / count), r * math.sin(first + math.tau * i / count))
            for i in range(count)
            for r in [size * (inner if i % 2 else 1)]
        ]
    )


def assert_sum(path: Region, region: Region, pair: tuple[float, float]) -> None:
    """The path is the edge of the numeric sum with the ellipse, in place and area.

    The sum: squeezed along y until the ellipse is a disc, grown in fine chords, pulled back.
    """

    def drawn(shape: Region) -> shapely.Geometry:
        rings = shape.polygons(0.00005)
        return shapely.union_all([shapely.Polygon(ring[0], ring[1:]) for ring in rings])

    squeeze = pair[0] / pair[1]
    round_one = scale(drawn(region), 1, squeeze, origin=(0, 0)).buffer(pair[0] / 2, quad_segs=60)
    judged = scale(round_one, 1, 1 / squeeze, origin=(0, 0))
    own = drawn(path)
    assert own.is_valid
    off = OFF + DROPPED * max(pair) / 2
    assert shapely.hausdorff_distance(own, judged) < off
    assert abs(own.area - judged.area) < off / 10 * own.length


@pytest.mark.parametrize("number", few(range(COUNT), 4, setting="SBAFAB_KERF_SHAPES"))
def test_path_is_the_sum_with_the_beam_s_ellipse(number: int) -> None:
    rng = random.Random(f"kerf {number}")
    makers: tuple[Callable[[random.Random], Region], ...] = (blob, blob, slot, star)
    pocket, pair = makers[number % 4](rng), PAIRS[number % len(PAIRS)]
    # The outline a bond outside, with the corners of the pocket round, and the pocket as a hole.
    for region in (pocket, grow(pocket, 0.75), grow(pocket, 2.0) - grow(pocket, 0.5)):
        path = compensate(region, pair)
        assert len(path.contours) == len(region.contours)
        assert_sum(path, region, pair)


def test_a_hollow_narrower_than_the_beam_leaves_no_loop() -> None:
    """The beam's flat side bends less than the hole: its path crosses itself there, and ends."""
    for radius in (0.12, 0.2, 0.3, 0.39):
        region = polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]) - stadium((0, 0), 2 * radius, 2.5)
        path = compensate(region, (0.05, 0.2))
        (hole,) = path.holes
        points = np.array([edge.start for edge in hole.edges])
        assert shapely.LinearRing(points).is_simple
        assert_sum(path, region, (0.05, 0.2))
        assert any(isinstance(edge, Arc) for edge in hole.edges)


def test_a_loop_under_a_micrometre_where_tracks_cross_twice_is_taken_out() -> None:
    """Seven tapered chambers with ears: an edge of a separator's path went back by 0.2 um."""
    keys = {
        "stack.balloons": 3,
        "registration.method": "ears",
        "bond.width": 1.48,
        "mask.overhang": 0.889,
        "fillet.radius": 1.0,
        "chamber.count": 7,
        "chamber.diameter": "[7.675,7.941,7.941]",
        "lumen.diameter": 4.254,
    }
    design = load_design("3dof-15mm", [f"{key}={value}" for key, value in keys.items()])
    separator = build(design).layers[3].profile
    path = compensate(separator, (0.169, 0.064))
    check_clear(path.contours)
    assert_sum(path, separator, (0.169, 0.064))
