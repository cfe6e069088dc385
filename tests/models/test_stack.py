"""The stack in real time: symmetry, energy, series, loads, and what other programs found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models.balloon import inflate
from sbafab.models.elastic import blocked_force, pose_bent_by
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Balloon
from sbafab.models.rim_correction import free_shapes
from sbafab.models.stack import Plate, Stack, StackBatch, stack
from sbafab.models.stack_loads import WALL_RIM, energy

LOADS: dict[str, dict[str, Any]] = {
    "7 mN on the tip": {"tip_load": (0.0, 0.005, -0.005)},
    "gravity": {"gravity": True},
    "both": {"tip_load": (0.0, 0.005, -0.005), "gravity": True},
    "plate 12 mm high": {"plate": 12.0},
}


@pytest.fixture(scope="module")
def three() -> Stack:
    return sbafab.stack("3dof-15mm", "models.calibration=none")


@pytest.mark.parametrize(("chambers", "angle"), [(1, 30.0), (2, 60.0), (1, 90.0)])
def test_a_bend_is_met_by_the_one_pressure_that_gives_it(
    three: Stack, chambers: int, angle: float
) -> None:
    pose = pose_bent_by(three, chambers, angle)
    assert pose is not None
    assert pose.bend == pytest.approx(angle, abs=1e-6)
    more, less = (
        three.pose([factor * p for p in pose.pressures], near=pose).bend for factor in (1.01, 0.99)
    )
    assert less < angle < more


def test_a_bend_that_no_pressure_gives_is_none(three: Stack) -> None:
    assert pose_bent_by(three, 1, 175.0) is None


@pytest.mark.parametrize("angle", np.linspace(20.0, 120.0, 41).tolist())
def test_every_bend_within_reach_is_found(angle: float) -> None:
    """Once 60 degrees were left out: the bracket closed before the bend was met."""
    factors = Factors(pocket_loss=0.15, modulus_ratio=2.0)
    soft = stack(sbafab.load("3dof-15mm"), factors=factors)
    pose = pose_bent_by(soft, 1, angle)
    assert pose is not None
    assert pose.bend == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize(
    ("pressures", "load", "sentence"),
    [
        ((111, 0, 0), {}, "give 0 to 110 kPa"),
        ((1, 1), {}, "2 pressures are given for 3 chambers"),
        ((1, 2, -3), {}, "a pressure of -3 kPa"),
        (5.0, {}, "one per chamber"),
        ("abc", {}, "one per chamber"),
        ((1, 2, 3), {"gravity": (0, 0, 0)}, "the direction of gravity"),
        ((1, 2, 3), {"gravity": (0, 0)}, "the direction of gravity"),
        ((1, 2, 3), {"gravity": (0, math.nan, 1)}, "the direction of gravity"),
        ((1, 2, 3), {"plate": math.nan}, "plate's point"),
        ((1, 2, 3), {"plate": Plate((0, 0, 12), (0, 0, 0))}, "plate's normal has no direction"),
    ],
)
def test_what_is_no_pressure_or_load_is_refused(
    three: Stack, pressures: Any, load: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(DesignError, match=sentence):
        three.pose(pressures, **load)


@pytest.mark.parametrize("load", sorted(LOADS))
def test_any_start_ends_in_the_same_balance(three: Stack, load: str) -> None:
    """From nothing, and from the pose at other pressures."""
    for pressures in ((4.26, 0.56, 8.7), (0.21, 0.18, 1.46), (0.5, 8.0, 0.2), (6.0, 3.0, 1.0)):
        pose = three.pose(pressures, **LOADS[load])
        beside = three.pose([each + 0.5 for each in pressures], **LOADS[load])
        again = three.pose(pressures, near=beside, **LOADS[load])
        assert pose.frames[0] == pytest.approx(again.frames[0], abs=1e-5)
        assert pose.stable


def test_a_motion_takes_its_line_and_where_it_begins(three: Stack) -> None:
    """Water in a tube: Hagen-Poiseuille, dp = 128 mu L Q / (pi d^4)."""
    moved = sbafab.motion(three, 70.0, fluid="water", pressures=np.array([2.0, 2.0, 2.0]))
    assert moved.pressures == pytest.approx((2.0, 2.0, 2.0))
    flow = 35e3 / 60 / 3
    moved.step(0.01, flows=(flow,) * 3)
    drop = 128 * 1.002e-6 * 70.0 * flow / (math.pi * 0.635**4)
    assert moved.sources[0] - moved.pressures[0] == pytest.approx(drop, rel=1e-3)
    with pytest.raises(DesignError, match="must be one of air, water"):
        sbafab.motion(three, fluid="oil")


def test_equal_pressures_stand_straight(three: Stack) -> None:
    pose = three.pose((5, 5, 5))
    assert pose.bend == pytest.approx(0.0, abs=1e-6)
    assert pose.tip[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    alone = inflate(three.maps[0].balloon, 5.0)
    assert pose.height == pytest.approx(1.865 + 15 * alone.height[0], rel=0.01)
    assert pose.volumes == pytest.approx(np.full(3, 15 * alone.volume[0]), rel=0.01)


def test_chambers_that_change_places_turn_the_pose(three: Stack) -> None:
    first, second = three.pose((5, 2, 0)), three.pose((0, 5, 2))
    third = math.tau / 3
    turn = np.array([[math.cos(third), -math.sin(third)], [math.sin(third), math.cos(third)]])
    assert turn @ first.tip[:2] == pytest.approx(second.tip[:2], abs=1e-6)
    assert second.height == pytest.approx(first.height)
    assert second.bend == pytest.approx(first.bend)
    assert (second.direction - first.direction) % 360 == pytest.approx(120)


def test_bends_as_shells_in_other_programs_do(three: Stack) -> None:
    # SOFA, shells, 5 kPa: 81 and 91.6 degrees with two chambers on two meshes, 96 and 117 with one.
    assert 78 < three.pose((5, 5, 0)).bend < 92
    assert 96 < three.pose((5, 0, 0)).bend < 117


def test_one_chamber_is_its_balloons_in_series() -> None:
    one = sbafab.stack("1dof-5mm")
    alone = inflate(one.maps[0].balloon, [10.0, 100.0], [0.5, 0.5], tied=True)
    for pressure, force in zip((10, 100), alone.force, strict=True):
        held = one.pose((pressure,), plate=one.flat_height + 6 * 0.5)
        assert held.force == pytest.approx(force / 1000, rel=0.02)
        assert float(blocked_force(one, pressure, 6 * 0.5)) == pytest.approx(force / 1000, rel=0.02)


def test_a_tapered_stack_pushes_at_most_as_its_smallest_balloon() -> None:
    changes = {"chamber.diameter": [6.0, 5.0]}, "stack.balloons=2", "models.calibration=none"
    taper = sbafab.stack("1dof-5mm", *changes)
    bound = 100e-3 * math.pi * 2.5**2
    found = blocked_force(taper, 100.0, np.linspace(0, 2, 7))
    assert (found <= bound).all()
    assert (np.diff(found) <= 1e-9).all()
    assert found[0] > 0.9 * bound
    predicted = sbafab.predict("1dof-5mm", *changes)
    for model in ("elastic-stack", "work-on-eq-4", "work-on-eqs-1-to-3"):
        assert predicted.value("blocked_force", model, kpa=100, share=0) <= bound


def test_without_a_load_all_levels_are_alike_in_the_full_solve_too(three: Stack) -> None:
    alike = three.pose((6, 3, 1))
    full = three.pose((6, 3, 1), tip_load=(1e-9, 0, 0))
    assert full.freedoms == pytest.approx(alike.freedoms, abs=1e-5)


def test_a_plate_gets_the_work_that_the_air_does_not_leave_in_the_films(three: Stack) -> None:
    low, high = (three.pose((10, 10, 10), plate=height) for height in (12.0, 12.1))
    gained = 10 * (high.volumes - low.volumes).sum() - (high.energy - low.energy)
    force = 1000 * (low.force + high.force) / 2
    assert gained == pytest.approx(force * (high.height - low.height), rel=0.01)


def test_loads_move_the_tip_their_way(three: Stack) -> None:
    free = three.pose((5, 5, 5))
    pressed = three.pose((5, 5, 5), tip_load=(0, 0, -0.05))
    assert pressed.height < free.height
    assert pressed.tip[:2] == pytest.approx([0, 0], abs=1e-6)
    pushed = three.pose((5, 5, 5), tip_load=(0.002, 0, 0))
    assert pushed.tip[0] > 0.5
    assert pushed.direction == pytest.approx(0.0, abs=1e-6)
    # Levels weigh alike: what gravity lowers is their mean, whatever the tip does.
    upright, hanging = three.pose((5, 0, 0)), three.pose((5, 0, 0), gravity=True)
    assert hanging.frames[0][:, 2].mean() < upright.frames[0][:, 2].mean()


def test_antagonists_stand_stiffer_at_one_height() -> None:
    """Two chambers against each other: where they bend to is their difference, how firmly their
    sum.
    """
    two = sbafab.stack("3dof-15mm", "chamber.count=2")
    soft, firm = two.pose((2, 2)), two.pose((10, 10))
    assert [soft.bend, firm.bend] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert firm.height > soft.height

    def gives(pressure: float) -> float:
        return two.pose((pressure, pressure), tip_load=(1e-4, 0, 0)).bend

    assert gives(10) < gives(2)


def test_empty_chambers_do_not_sink_into_each_other(three: Stack) -> None:
    pose = three.pose((20, 0, 0))
    assert pose.gaps.min() > -0.02


def test_frames_are_a_chain_of_plates(three: Stack) -> None:
    pose = three.pose((5, 3, 0))
    places, axes = pose.frames
    assert places.shape == (16, 3)
    assert axes @ axes.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (16, 1, 1)))
    assert places[-1] == pytest.approx(pose.tip)
    top = axes[-1][:, 2]
    assert math.degrees(math.acos(top[2])) == pytest.approx(pose.bend, abs=0.01)
    assert math.degrees(math.atan2(top[1], top[0])) == pytest.approx(pose.direction, abs=0.01)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1) == pytest.approx(
        three.pitch + pose.freedoms[:, 0]
    )


def test_calibration_makes_pockets_smaller_or_films_stiffer() -> None:
    design = sbafab.load("1dof-5mm")
    smaller = stack(design, factors=Factors(pocket_loss=0.3))
    drawn = smaller.maps[0].balloon
    assert (drawn.pocket, drawn.ring) == pytest.approx((2.2, 1.05))
    assert replace(drawn, pocket=2.5, ring=0.75) == stack(design).maps[0].balloon
    # 1.1 times the neck of 0.52 + 0.75.
    with pytest.raises(
        DesignError, match=r"at least 1\.397 mm .* loss of 1\.2 mm leaves 1\.3; make"
    ):
        stack(design, factors=Factors(pocket_loss=1.2))
    narrow = sbafab.load("1dof-5mm", "chamber.diameter=2.6")
    with pytest.raises(
        DesignError, match=r"at least 1\.397 mm .* this one has 1\.3; make"
    ) as refused:
        stack(narrow)
    assert "loss" not in str(refused.value)


def test_what_has_no_round_pockets_is_refused() -> None:
    with pytest.raises(DesignError, match="no round pockets"):
        sbafab.stack("radial-15mm")


def test_a_lone_balloon_rises_as_the_free_one_does() -> None:
    lone = sbafab.stack("1dof-5mm", "stack.balloons=1", "models.calibration=none")
    free = inflate(Balloon(), 5.0)
    assert lone.pose((5,)).gaps[0, 0] == pytest.approx(free.height[0], rel=0.03)


@pytest.mark.long
def test_wide_pockets_are_mapped_as_far_as_they_hold() -> None:
    wide = sbafab.stack("1dof-10mm", "chamber.diameter=30", "models.calibration=none")
    assert 10 < wide.most_pressure < 110
    with pytest.raises(DesignError, match="outside the balloon's map"):
        wide.pose((110,))
    free = free_shapes(wide.maps[0].balloon, 1.0)
    assert wide.pose((1,)).gaps[0, 0] == pytest.approx(free.height[0], rel=0.03)


@pytest.mark.parametrize(
    "pressures",
    [
        (0.0, 4.611635825942266, 9.716094550133137),
        (0.07981506407668437, 8.901665773081637, 3.9615232622065015),
        (1.5280409290013814, 2.374658840610223, 9.791022967388143),
    ],
)
def test_a_stack_that_slips_far_under_a_plate_has_a_pose(pressures: Any) -> None:
    """Of 12,000 random ones these three were refused."""
    stack = sbafab.stack("3dof-15mm")
    plate = Plate((0.5, 0.0, 14.0), (0.1, 0.0, 1.0), sticks=False)
    pose = stack.pose(pressures, plate=plate)
    assert pose.stable
    load = stack.acting({"plate": plate})
    assert load is not None
    springs = stack.springs(np.array([pressures]), by_level=True)
    now = energy(springs, stack.pitch, load, pose.freedoms[None])
    assert np.abs(now.gradient).max() < 1e-3 * now.push


def test_a_pushed_column_buckles_the_sooner_the_longer_and_the_freer_it_is() -> None:
    """Flat, none does; at 25 % six balloons do where the tip may slide, ten where it may not."""
    factors = Factors(press_factor=0.509, pocket_loss=0.28)

    def is_straight(balloons: int, share: float, sticks: bool) -> bool:
        found = stack(sbafab.load("1dof-5mm", f"stack.balloons={balloons}"), factors=factors)
        rise = share * (balloons * 17.5 / 15 - found.flat_height)
        plate = Plate((0, 0, found.flat_height + rise), sticks=sticks)
        return found.pose((100,), plate=plate).stable

    assert is_straight(6, 0.02, sticks=False)
    assert not is_straight(6, 0.25, sticks=False)
    assert is_straight(6, 0.25, sticks=True)
    assert not is_straight(10, 0.25, sticks=True)


def test_a_plate_is_met_from_any_pressures(three: Stack) -> None:
    """Unlike chambers below a level plate: what pushes on it is the sum of their balloons."""
    for pressures in ((2.551, 4.954, 4.495), (7.623, 0.021, 4.454), (0.3, 0.2, 9.0)):
        held = three.pose(pressures, plate=12.0)
        rise = 12.0 / 15 - three.pitch
        force = three.maps[0].force(pressures, np.full(3, rise)).sum() / 1000
        assert held.stable
        assert held.force == pytest.approx(force, rel=1e-3)
        assert held.height == pytest.approx(12.0, abs=1e-3)


def test_a_plate_that_is_hardly_met_is_met_from_any_start(three: Stack) -> None:
    """By one or two points of the rim, or by none: the same balance from a pose nearby, too."""
    for pressures in (
        (0.21, 0.18, 1.46),
        (1.174, 0.91, 0.276),
        (0.832, 0.167, 0.146),
        (0.204, 2.438, 0.723),
        (0.0, 2.628, 0.887),
    ):
        pose = three.pose(pressures, plate=12.0)
        beside = three.pose([each + 0.3 for each in pressures], plate=12.0)
        again = three.pose(pressures, plate=12.0, near=beside)
        assert again.frames[0] == pytest.approx(pose.frames[0], abs=1e-5)
        assert again.force == pytest.approx(pose.force, rel=1e-4, abs=1e-9)
        # The points of the top's rim lie below the plate, and its middle on the axis.
        rim = pose.height + three.outline * float((WALL_RIM @ pose.frames[1][-1].T)[:, 2].max())
        assert rim < 12.0 + 1e-4
        assert pose.tip[:2] == pytest.approx([0.0, 0.0], abs=1e-4)
        assert pose.stable
        assert (pose.force > 0) == (rim > 12.0)


def test_a_map_is_the_balloon_that_it_was_made_from(three: Stack) -> None:
    """At places that no balloon of the map was computed at, and where films are slack."""
    balloon = three.maps[0]
    p, h = np.array([0.7, 3.3, 8.1, 47.0]), np.array([0.33, 0.81, 1.6, 0.52])
    found = inflate(balloon.balloon, p, h, tied=True)
    assert balloon.force(p, h) == pytest.approx(found.force, rel=0.025, abs=1.0)
    assert balloon.volume(p, h) == pytest.approx(found.volume, rel=0.01)
    p, h = (g.ravel() for g in np.meshgrid([0.005, 0.02, 0.05, 0.2], [0.01, 0.02, 0.05, 0.1, 0.4]))
    found = inflate(balloon.balloon, p, h, tied=True)
    assert balloon.volume(p, h) == pytest.approx(found.volume, rel=0.07)
    assert balloon.force(p, h) == pytest.approx(found.force, rel=0.02, abs=0.05)
    assert balloon.volume([0.0, 0.1, 10.0], np.zeros(3)) == pytest.approx(0.0, abs=0.05)


def test_following_a_path_ends_where_a_fresh_start_does(three: Stack) -> None:
    load = {"tip_load": (0.0, 0.005, -0.005), "gravity": True}
    followed = three.pose((6, 3, 1), **load)  # type: ignore[arg-type]
    for share in np.linspace(0, 1, 11):
        followed = three.pose((6 - share, 3 + share, 1), near=followed, **load)  # type: ignore[arg-type]
    fresh = three.pose((5, 4, 1), **load)  # type: ignore[arg-type]
    assert followed.tip == pytest.approx(fresh.tip, abs=1e-4)
    assert followed.volumes == pytest.approx(fresh.volumes, rel=1e-5)


def test_a_tall_column_under_load_stands_alone_as_it_does_among_others() -> None:
    """Newton's steps alone would end on a saddle beside it (found by another program)."""
    column = sbafab.stack("1dof-10mm", {"stack.balloons": 19, "chamber.diameter": 10.35})
    tip_load, gravity = (0.000798, 0.000145, -0.001776), (-0.4935, -0.514, -0.7016)
    alone = column.pose((0.6336,), tip_load, gravity)
    pressures = [[0.6336], [1.0], [0.3], [5.0], [0.05], [12.0]]
    among = StackBatch(column).poses(pressures, tip_load=tip_load, gravity=gravity)
    assert alone.stable
    assert alone.tip == pytest.approx(among.tips[0], abs=1e-4)
    # What the other program found: the gradient of its own energy is 0 there.
    assert alone.tip == pytest.approx((-2.96, -19.69, -10.09), abs=0.01)


def test_a_tall_column_meets_a_plate_that_it_sticks_to() -> None:
    column = sbafab.stack("1dof-5mm", {"stack.balloons": 19, "chamber.diameter": 9.27})
    plate = Plate((1.5, -3.61, 32.987), (-0.037, -0.0946, 0.9948))
    pose = column.pose((9.37964,), plate=plate)
    assert pose.stable
    assert pose.force > 0


def test_a_stable_pose_is_preferred_where_an_unstable_one_is_at_the_place() -> None:
    column = sbafab.stack("1dof-5mm", {"stack.balloons": 11, "chamber.diameter": 8.8})
    load: dict[str, Any] = {
        "tip_load": (-0.000141, 0.00609, 0.006814),
        "plate": Plate((0.64, -0.554, 8.858), (-0.0004, -0.0029, 1.0)),
    }
    for pressure in (9.32286, 18.75875):
        pose = column.pose((pressure,), **load)
        reached = column.reach(pose.tip, **load)
        assert pose.stable
        assert reached.stable
        assert reached.tip == pytest.approx(pose.tip, abs=1e-3)
