"""What the hunt does not ask: pieces, fillets and the order of a union, on grids of shapes.

Edges of drawn shapes often coincide, only touch, or lie a hair apart; shapely is the judge.
"""

from __future__ import annotations

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, disc, rectangle, stadium, strip, union
from tests.hunt.oracle import flat

FINE = 2e-5
"""mm a chord may leave its arc."""
QUADRANT = 128
"""Chords a quadrant in shapely's buffers."""

halves = st.integers(-8, 8).map(lambda n: n / 2)
sizes = st.integers(1, 8).map(lambda n: n / 2)


@st.composite
def shapes(draw: st.DrawFn) -> Region:
    """A disc, rectangle, stadium or strip, at times a hair beside its grid."""
    x, y, width, length = draw(halves), draw(halves), draw(sizes), draw(sizes)
    angle = draw(st.sampled_from([0, 90, 45, 17.3]))
    shape = draw(
        st.sampled_from(
            [
                disc((x, y), width),
                rectangle((x, y), (x + width, y + length)),
                stadium((x, y), width, width + length).turned(angle, (x, y)),
                strip((x, y), (x + draw(halves), y + length), width),
            ]
        )
    )
    by = st.sampled_from([0.0, 0.0, 0.0, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4])
    return shape.moved(draw(by), draw(by))


@given(st.lists(shapes(), min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_the_order_of_a_union_does_not_matter(parts: list[Region], random: object) -> None:
    mixed = list(parts)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert union(mixed).area == pytest.approx(union(parts).area, abs=1e-4)


@given(
    st.lists(st.tuples(halves, halves), min_size=2, max_size=6, unique=True),
    st.sampled_from([0.2, 0.3, 0.45, 0.6, 0.8]),
    shapes(),
)
def test_the_number_of_pieces(
    spots: list[tuple[float, float]], radius: float, tool: Region
) -> None:
    """Of dots that neither coincide nor touch: shapely counts them dependably."""
    dots, wider = union([disc((2 * x, y), radius) for x, y in spots]), grow(tool, 0.01)
    theirs, other = flat(dots, FINE), flat(tool, FINE).buffer(0.01)
    for ours, expected in (
        (dots, theirs),
        (dots - wider, theirs.difference(other)),
        (dots | wider, theirs.union(other)),
    ):
        # Slivers this small are made or lost by flattening.
        count = sum(part.area > 1e-3 for part in shapely.get_parts(expected))
        assert sum(piece.area > 1e-3 for piece in ours.pieces) == count


@given(
    st.lists(shapes(), min_size=1, max_size=4), shapes(), st.sampled_from([0.11, 0.25, 0.37, 0.5])
)
def test_fillets(parts: list[Region], tool: Region, radius: float) -> None:
    """Where a gap is just twice the radius wide, a hair more or less decides: both are right."""
    region = union(parts) - tool
    shape, ends = flat(region, FINE), []
    for reach in (radius * (1 - 2e-4), radius, radius * (1 + 2e-4)):
        grown = shape.buffer(reach, quad_segs=QUADRANT)
        ends.append(grown.buffer(-reach, quad_segs=QUADRANT).area)
    # Shapely first drops detail of up to a hundredth of the radius.
    error = 1e-4 + (FINE + 2e-4) * sum(contour.length for contour in region.contours)
    assert min(ends) - error <= fillet(region, radius).area <= max(ends) + error
