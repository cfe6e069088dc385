"""The primitive profiles against their closed formulas."""

from __future__ import annotations

import math

import pytest

from sbafab.geometry.edges import Arc, Line
from sbafab.geometry.region import disc, polygon, rectangle, stadium, strip


def test_disc_area_is_exact_and_it_is_one_circle() -> None:
    region = disc((1.5, -2.0), 3.25)
    assert region.area == pytest.approx(math.pi * 3.25**2, rel=1e-14)
    assert region.bounds == pytest.approx((-1.75, -5.25, 4.75, 1.25))
    assert region.contours[0].circle == ((1.5, -2.0), 3.25)


def test_stadium_is_two_half_discs_and_a_rectangle() -> None:
    region = stadium((1, 2), 11.5, 20)
    assert region.area == pytest.approx(math.pi * 5.75**2 + 11.5 * 8.5)
    assert region.contours[0].length == pytest.approx(math.pi * 11.5 + 2 * 8.5)
    assert region.bounds == pytest.approx((-4.75, -8, 6.75, 12))
    assert region.contours[0].circle is None


def test_a_stadium_as_long_as_wide_is_a_disc() -> None:
    assert stadium((1, 2), 4, 4) == disc((1, 2), 2)


def test_a_strip_has_its_length_and_width_in_any_direction() -> None:
    region = strip((1, 1), (4, 5), 0.8)
    assert region.area == pytest.approx(5 * 0.8)
    assert sorted(edge.length for edge in region.edges) == pytest.approx([0.8, 0.8, 5, 5])
    assert region.contains((2.5, 3.0))
    assert region.distance_to_edge((2.5, 3.0)) == pytest.approx(0.4)


def test_a_polygon_keeps_its_material_on_the_left_in_either_order() -> None:
    corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]
    assert polygon(corners).area == pytest.approx(6)
    assert polygon(corners[::-1]).area == pytest.approx(6)
    assert polygon(corners) == polygon(corners[::-1])


def test_edges_are_of_the_kind_the_shape_has() -> None:
    assert [type(edge) for edge in disc((0, 0), 1).edges] == [Arc] * 4
    assert [type(edge) for edge in rectangle((0, 0), (2, 1)).edges] == [Line] * 4
    kinds = [type(edge) for edge in stadium((0, 0), 2, 5).edges]
    assert (kinds.count(Arc), kinds.count(Line)) == (4, 2)
