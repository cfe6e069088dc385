"""Where parts come to lie, and what bending round a tube keeps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sbafab.assemblies.build import (
    FLIPPED,
    LYING,
    OUTWARD,
    PartPose,
    about_axis,
    along,
    assemble,
    shifted,
)
from sbafab.assemblies.files import load_assembly
from sbafab.assemblies.records import Cup
from sbafab.assemblies.shapes import (
    AROUND,
    DOWEL,
    DOWEL_PLAY,
    cup_mould,
    own_surface,
    placed_surface,
)
from sbafab.meshing.surface import open_edges


@pytest.mark.parametrize(
    "pose", [FLIPPED, LYING, OUTWARD, about_axis(30), along((0.6, 0.0, 0.8), (1, 2, 3))]
)
def test_poses_turn_and_do_not_mirror(pose: PartPose) -> None:
    rows = np.array(pose.rows)
    assert np.allclose(rows @ rows.T, np.eye(3))
    assert np.linalg.det(rows) == pytest.approx(1)


def test_poses_follow_each_other_as_matrices_do() -> None:
    outer, inner = shifted(1, 2, 3).then(about_axis(40)), FLIPPED.then(shifted(0.3, 0.2, 0.1))
    point = (0.7, -0.4, 2.0)
    assert outer.then(inner).at(point) == pytest.approx(outer.at(inner.at(point)))
    assert outer.points(np.array([point]))[0] == pytest.approx(outer.at(point))


def test_both_halves_of_a_mould_leave_room_for_the_cup_alone() -> None:
    """Block, halves and cup are of as many facets, so that their volumes add up to rounding."""
    placed = assemble(load_assembly("brace"))["cup"]
    assert isinstance(placed.part, Cup)
    lower, upper = cup_mould(placed.part)
    cup, part = own_surface(placed), placed.part
    for half in (lower, upper):
        assert len(open_edges(half)) == 0
        assert half.volume > 0
    turn = AROUND / 2 * math.sin(2 * math.pi / AROUND)
    low, high = lower.points[:, 2].min(), upper.points[:, 2].max()
    block = turn * (np.hypot(*lower.points[:, :2].T).max()) ** 2 * (high - low)
    # Round the pin of the bore, 0.1 mm wide and 2 deep.
    bore = part.bore / 2
    play = turn * ((bore + DOWEL_PLAY) ** 2 - bore**2) * DOWEL
    assert lower.volume + upper.volume + cup.volume + play == pytest.approx(block, rel=1e-9)


def test_parts_stand_where_the_file_says() -> None:
    assembled = assemble(load_assembly("brace"))
    thickness = 30 * 0.038 + 29 * 0.025
    assert assembled["arm"].at((0, 0, 0)) == pytest.approx((0, 0, 40))
    assert assembled["cup"].at((0, 0, 0)) == pytest.approx((0, 0, 40 + thickness))
    assert assembled["vacuum"].at((0, 0, 50)) == pytest.approx((0, 0, 42.5))
    # The middle of the sheet, half a turn about its own axis: tabs point to the tube's start.
    assert assembled["grip"].at((0, 0, 0)) == pytest.approx((7.5, 0, 18))
    assert assembled["grip"].at((0, 5, 0)) == pytest.approx((7.5, 0, 13))


def test_a_magnet_hangs_under_its_base() -> None:
    box = placed_surface(assemble(load_assembly("aperture"))["magnet"]).points
    assert box[:, 2].min() == pytest.approx(-25.4 / 16)
    assert box[:, 2].max() == pytest.approx(0)
    assert box[:, 0].mean() == pytest.approx(4.25, abs=1e-6)


def test_a_line_leaves_its_inlet_outward() -> None:
    feed = [f"parts.feed.{k}={v}" for k, v in {"kind": "line", "on": "arm", "at": "inlet"}.items()]
    assembled = assemble(load_assembly("aperture", [*feed, "parts.feed.chamber=chamber2"]))
    start, end = assembled["feed"].at((0, 0, 0)), assembled["feed"].at((0, 0, 10))
    # Chamber 2 lies at 120 degrees; its tab ends 5 mm past the outline.
    assert math.degrees(math.atan2(start[1], start[0])) == pytest.approx(120)
    assert math.hypot(*start[:2]) == pytest.approx(7.5 + 5)
    assert math.hypot(*end[:2]) == pytest.approx(7.5 + 5 + 10, abs=1e-3)


@pytest.mark.parametrize("template", ["aperture", "brace", "standing"])
def test_every_solid_in_place_keeps_its_volume(template: str) -> None:
    for placed in assemble(load_assembly(template)).parts:
        volume = placed_surface(placed).volume
        flat = placed.made and sum(
            layer.profile.area * layer.film.thickness for layer in placed.made.laminate.tpe_layers
        )
        assert volume > 0
        if flat:
            # Films and bonds: bent ones are stretched outside the tube by at most their height.
            assert volume > flat
