"""A beam of two widths undone: the very region comes back where the beam can follow it."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design
from sbafab.as_built.kerf_removed import remove_kerf
from sbafab.cutting.kerf import compensate
from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc, rectangle, stadium

ROUNDED = [
    disc((0.0, 0.0), 3.25) - disc((0.0, 0.0), 0.5),
    stadium((1.0, 2.0), 11.5, 20.0),
    rectangle((0.0, 0.0), (8.0, 5.0)).turned(20.0),
]


def missed(found: Region, meant: Region) -> float:
    return (found - meant).area + (meant - found).area


@pytest.mark.parametrize("pair", [(0.12, 0.1), (0.08, 0.2), (0.1, 0.02)])
@pytest.mark.parametrize("meant", ROUNDED)
def test_what_the_beam_leaves_is_the_part(meant: Region, pair: tuple[float, float]) -> None:
    part = remove_kerf(compensate(meant, pair), pair)
    # Edges apart by more than 2 nm would leave slivers.
    assert missed(part, meant) == 0.0
    assert len(part.edges) == len(meant.edges)


def test_every_pattern_of_an_actuator_comes_back() -> None:
    laminate = build(load_design("3dof-15mm", ["stack.balloons=2"]))
    for layers in laminate.patterns.values():
        meant = layers[0].profile
        part = remove_kerf(compensate(meant, (0.12, 0.1)), (0.12, 0.1))
        # Corners to the right are rounded by the beam.
        assert missed(part, meant) < 0.06 * 0.05 * len(meant.edges)
        circles = sum(hole.circle is not None for hole in part.holes)
        assert circles == sum(hole.circle is not None for hole in meant.holes)


def test_corners_of_windows_are_rounded_by_the_ellipse() -> None:
    meant = rectangle((-5.0, -5.0), (5.0, 5.0)) - rectangle((-2.0, -1.0), (2.0, 1.0))
    part = remove_kerf(compensate(meant, (0.3, 0.1)), (0.3, 0.1))
    left = 4 * 0.15 * 0.05 * (1 - math.pi / 4)
    assert part.area - meant.area == pytest.approx(left, rel=0.02)


def test_a_path_with_a_sharp_corner_is_none() -> None:
    with pytest.raises(OutputError, match=r"corner at x [05]\.000, y [05]\.000 is sharp"):
        remove_kerf(rectangle((0.0, 0.0), (5.0, 5.0)), (0.3, 0.1))


def test_a_contour_narrower_than_the_kerf_is_lost() -> None:
    with pytest.raises(OutputError, match="lost in its kerf"):
        remove_kerf(disc((0.0, 0.0), 0.1), (0.3, 0.25))
