"""Random profiles against shapely, on grids where edges often coincide or only touch."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from sbafab.geometry.offset import fillet, grow, shrink
from sbafab.geometry.region import Region, disc, rectangle, stadium, strip, union

SAGITTA = 2e-5
QUADRANT = 128
"""Chords a quadrant in shapely's buffers."""

coarse = st.integers(-8, 8).map(lambda n: n / 2)
fine = st.floats(-4, 4, allow_nan=False).map(lambda x: round(x, 3))
nudges = st.sampled_from([0.0, 0.0, 0.0, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4])
sizes = st.integers(1, 8).map(lambda n: n / 2)


@st.composite
def shapes(draw: st.DrawFn) -> Region:
    """A disc, rectangle, stadium or strip, mostly on a grid, at times a hair beside it."""
    number = draw(st.sampled_from([coarse, coarse, fine]))
    x, y, width, length = draw(number), draw(number), draw(sizes), draw(sizes)
    kind = draw(st.sampled_from(["disc", "rectangle", "stadium", "strip"]))
    if kind == "disc":
        shape = disc((x, y), width)
    elif kind == "rectangle":
        shape = rectangle((x, y), (x + width, y + length))
    elif kind == "stadium":
        angle = draw(st.sampled_from([0, 90, 45, 30, 17.3]))
        shape = stadium((x, y), width, width + length).turned(angle, (x, y))
    else:
        shape = strip((x, y), (x + draw(coarse), y + length), width)
    return shape.moved(draw(nudges), draw(nudges))


profiles = st.lists(shapes(), min_size=1, max_size=4)


def flat(region: Region) -> BaseGeometry:
    pieces = [Polygon(rings[0], rings[1:]) for rings in region.polygons(SAGITTA)]
    return shapely.union_all([shapely.make_valid(piece) for piece in pieces])


def chord_error(*regions: Region) -> float:
    """The area that flattening can take from or add to the regions' edges, in mm2."""
    return 1e-4 + SAGITTA * sum(c.length for region in regions for c in region.contours)


@given(profiles, shapes())
def test_booleans(parts: list[Region], tool: Region) -> None:
    whole = union(parts)
    flat_whole, flat_tool = shapely.union_all([flat(part) for part in parts]), flat(tool)
    error = chord_error(*parts, tool)
    assert whole.area == pytest.approx(flat_whole.area, abs=error)
    assert (whole | tool).area == pytest.approx(flat_whole.union(flat_tool).area, abs=error)
    assert (whole & tool).area == pytest.approx(flat_whole.intersection(flat_tool).area, abs=error)
    assert (whole - tool).area == pytest.approx(flat_whole.difference(flat_tool).area, abs=error)
    assert (tool - whole).area == pytest.approx(flat_tool.difference(flat_whole).area, abs=error)


@given(profiles, shapes())
def test_what_booleans_make_is_sound(parts: list[Region], tool: Region) -> None:
    whole = union(parts)
    for result in (whole, whole - tool, whole & tool):
        for contour in result.contours:
            assert len({edge.start for edge in contour.edges}) == len(contour.edges)
            ends = [edge.end for edge in contour.edges]
            assert ends == [edge.start for edge in (*contour.edges[1:], contour.edges[0])]
        assert sum(piece.area for piece in result.pieces) == pytest.approx(result.area)
        assert all(abs(edge.bulge) <= math.tan(math.pi / 8) + 1e-6 for edge in result.edges)
    assert (whole & tool) | (whole - tool) == whole or (
        ((whole & tool) | (whole - tool)).area == pytest.approx(whole.area, abs=1e-4)
    )


@given(st.lists(shapes(), min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_the_order_of_a_union_does_not_matter(parts: list[Region], random: object) -> None:
    mixed = list(parts)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert union(mixed).area == pytest.approx(union(parts).area, abs=1e-4)


@st.composite
def separated(draw: st.DrawFn) -> Region:
    """A few shapes that neither coincide nor touch: shapely counts their pieces dependably."""
    spots = draw(st.lists(st.tuples(coarse, coarse), min_size=2, max_size=6, unique=True))
    radius = draw(st.sampled_from([0.2, 0.3, 0.45, 0.6, 0.8]))
    return union([disc((2 * x, y), radius) for x, y in spots])


@given(separated(), shapes())
def test_the_number_of_pieces(dots: Region, tool: Region) -> None:
    flat_dots, flat_tool = flat(dots), flat(tool).buffer(0.01)
    wider = grow(tool, 0.01)
    for ours, theirs in (
        (dots, flat_dots),
        (dots - wider, flat_dots.difference(flat_tool)),
        (dots | wider, flat_dots.union(flat_tool)),
    ):
        # Slivers this small are made or lost by flattening.
        count = sum(part.area > 1e-3 for part in shapely.get_parts(theirs))
        assert sum(piece.area > 1e-3 for piece in ours.pieces) == count


Offset = Callable[[Region, float], Region]
Buffer = Callable[[BaseGeometry, float], BaseGeometry]


def buffered(shape: BaseGeometry, distance: float) -> BaseGeometry:
    return shape.buffer(distance, quad_segs=QUADRANT)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (grow, buffered),
        (shrink, lambda shape, d: buffered(shape, -d)),
        (fillet, lambda shape, d: buffered(buffered(shape, d), -d)),
    ],
)
@given(parts=profiles, tool=shapes(), distance=st.sampled_from([0.11, 0.25, 0.37, 0.5]))
def test_offsets(
    ours: Offset, theirs: Buffer, parts: list[Region], tool: Region, distance: float
) -> None:
    """Where a gap is just twice the distance wide, a hair more or less decides: both are right."""
    region = union(parts) - tool
    area = ours(region, distance).area
    shape = flat(region)
    limits = [theirs(shape, distance * factor).area for factor in (1 - 2e-4, 1, 1 + 2e-4)]
    # Shapely first drops detail of up to a hundredth of the distance.
    error = chord_error(region) + 2e-4 * sum(contour.length for contour in region.contours)
    assert min(limits) - error <= area <= max(limits) + error
