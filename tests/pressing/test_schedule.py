"""The heat-press schedule against the paper's four steps (Sec. 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.cutting.fixture import fixture
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.build_up import footprint
from sbafab.pressing.cycles import (
    design_runs,
    press_runs,
    runs_of,
)
from sbafab.pressing.schedule import schedule
from sbafab.pressing.schedule_files import press_csv, press_json

Stack = Callable[..., Laminate]
PAPER = load_design("1dof-5mm")


def test_fifteen_balloons_take_the_papers_steps(stack: Stack) -> None:
    plan = schedule(stack(15, lumen=True), PAPER)
    assert [step.adds for step in plan.steps] == [(2, 3), (1,), tuple(range(4, 59)), (59,)]
    assert [set(step.layers) for step in plan.steps] == [
        {2, 3},
        {1, 2, 3},
        set(range(4, 59)),
        set(range(1, 60)),
    ]
    assert [step.bond for step in plan.steps] == ["flash", "full", "flash", "full"]
    assert [step.minutes for step in plan.steps] == [3, 12, 10, 20]
    assert [step.step for step in plan.steps] == [1, 2, 3, 4]
    assert plan.total_press_minutes == 45
    # "about 1.75 h" from film to actuator.
    assert plan.estimated_build_minutes == 105
    assert "assumed" in plan.estimate_basis
    assert plan.warnings == ()


def test_one_balloon_is_done_after_its_base(stack: Stack) -> None:
    plan = schedule(stack(1), PAPER)
    assert [(step.adds, step.bond, step.pins) for step in plan.steps] == [
        ((2, 3), "flash", ()),
        ((1,), "full", ()),
    ]
    assert plan.total_press_minutes == 15
    assert plan.warnings == ("step 1: no pin holds layers 2 and 3; align by hand",)


def test_radial_with_one_balloon_ends_on_its_sheet(stack: Stack) -> None:
    plan = schedule(stack(1, sheet=True), PAPER)
    assert [step.adds for step in plan.steps] == [(4, 5), (3,), (1, 2)]
    assert [step.bond for step in plan.steps] == ["flash", "full", "full"]
    assert plan.steps[-1].layers == (1, 2, 3, 4, 5)
    assert plan.total_press_minutes == 3 + 12 + 20


BY_HAND = "no pin holds"


def beside_hand_placing(warnings: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(warning for warning in warnings if BY_HAND not in warning)


def test_what_no_pin_holds_is_named(stack: Stack) -> None:
    # The openings of separators are the neck rings, wider than the channel pin.
    assert schedule(stack(2), PAPER).warnings == ("step 3: no pin holds layer 4; align by hand",)
    assert schedule(stack(15), PAPER).warnings == (
        "step 3: no pin holds the 14 separator-masks; align by hand",
    )


def test_the_tpe_must_melt(stack: Stack) -> None:
    for temperature in (20, 120):
        with pytest.raises(DesignError, match="does not bond Stretchlon 200, which melts at 120"):
            schedule(stack(2), PAPER.with_(press={"temperature_c": temperature}))
    film = {"product": "TPU", "thickness": 0.038, "melting_point": 135}
    tpu = PAPER.with_(films={"tpe": film})
    with pytest.raises(DesignError, match=r"TPU, which melts at 135 C; set it higher than that$"):
        schedule(build(tpu), tpu)
    warm = schedule(stack(2), PAPER.with_("press.temperature_c=121"))
    (only,) = beside_hand_placing(warm.warnings)
    assert only.startswith("minutes stated for 135 C, the press is set to 121 C")


def test_the_masks_must_stand_the_heat(stack: Stack) -> None:
    for temperature in (260, 300):
        with pytest.raises(DesignError, match=r"limit of the masks, 260 C .* fumes"):
            schedule(stack(2), PAPER.with_(press={"temperature_c": temperature}))


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        ("press.temperature_c=151", "151 C is hotter than the 150 C"),
        ("press.pressure_kpa=69", "69 kPa lies outside 70 to 200"),
        ("press.pressure_kpa=201", "201 kPa lies outside 70 to 200"),
        ("rules.validated_balloons=5", "6 balloons are more than the 5 validated"),
    ],
)
def test_what_was_never_tried_is_warned_about(stack: Stack, change: str, warning: str) -> None:
    found = beside_hand_placing(schedule(stack(6), PAPER.with_(change)).warnings)
    (found,) = (text for text in found if not text.startswith("minutes stated"))
    assert found.startswith(warning)


def test_films_higher_than_as_many_balloons_of_the_papers_are_warned_about() -> None:
    """6 balloons: 12 x 0.038 + 11 x 0.2 mm; heat's time goes with the square of the height."""
    high = load_design("1dof-5mm", ("stack.balloons=6", "films.ptfe.thickness=0.2"))
    words = "2.656 mm of films are more than the 2.5 mm validated; heat takes about 1.1 times"
    assert any(text.startswith(words) for text in schedule(build(high), high).warnings)


def test_ears_and_tails_are_snipped_off_at_the_end(stack: Stack) -> None:
    on_ears = schedule(replace(stack(2), registration="ears"), PAPER)
    assert [step.minutes for step in on_ears.steps] == [3, 3, 12, 10, 10, 20]
    assert any("untested: with ears each full bond" in words for words in on_ears.warnings)
    kept = replace(stack(2), registration="ears", pins_in_full_bonds=True)
    assert any("release sleeve" in words for words in schedule(kept, PAPER).warnings)
    *before, last = [step.instructions for step in on_ears.steps]
    assert last.endswith("the masks stay in their pockets.")
    assert "Snip off the ears along the outline, and the tails of the inlet strips" in last
    assert not any("Snip" in words for words in before)
    assert not any("Snip" in step.instructions for step in schedule(stack(2), PAPER).steps)
    assert "Snip off the ears" in press_csv(on_ears)


def test_no_time_by_hand_is_claimed_for_drawn_layers() -> None:
    def times(name: str) -> tuple[object, object, str]:
        design = load_design(name)
        table = press_json(schedule(build(design), design))
        return table["hands_minutes"], table["estimated_build_minutes"], table["estimate_basis"]

    assert times("1dof-5mm")[:2] == (60, 105)
    hands, total, basis = times("pouch")
    assert (hands, total) == (None, None)
    assert "nobody measured" in basis


# Copies side by side in the press.


INCH = 25.4


@pytest.mark.parametrize(
    ("copies", "size", "expected"),
    [
        # n of width w with 5 between them take n w + (n - 1) 5.
        (3, (40.0, 40.0), (3, 1)),
        (9, (47.4666, 47.4666), (9, 1)),
        (9, (47.5, 47.5), (4, 3)),
        (5, (100.0, 70.0), (2, 3)),
        (1, (10.0, 10.0), (1, 1)),
        (2, (150.0, 150.0), (1, 2)),
    ],
)
def test_as_many_as_the_heated_area_takes(
    copies: int, size: tuple[float, float], expected: tuple[int, int]
) -> None:
    runs = press_runs(copies, (-3.0, 2.0, size[0] - 3.0, size[1] + 2.0), (6 * INCH, 6 * INCH))
    assert (runs.together, runs.count) == expected


def laminate(*changes: str) -> Laminate:
    return build(load_design("1dof-5mm", changes))


def test_a_batch_fills_the_plate_in_rows_and_ends_in_a_smaller_cycle() -> None:
    # A plate of 6 mm round 4 columns of 20 and 3 rows of 30, 5 apart: 107 x 112.
    runs = press_runs(30, (-10.0, -5.0, 10.0, 25.0), (107.0, 112.0), 6.0)
    assert runs.cycles == (12, 12, 6)
    assert runs.places[:5] == ((0, 0), (25, 0), (50, 0), (75, 0), (0, 35))
    assert press_runs(30, (-10.0, -5.0, 10.0, 25.0), (106.99, 112.0), 6.0).together == 9


def test_one_plate_has_every_hole_of_every_place() -> None:
    column = laminate("stack.balloons=2")
    platen = (152.4, 152.4)
    runs = runs_of(column, 7, platen)
    plate = fixture(column, platen, runs.places)
    assert plate is not None
    holes = {(round(h.circle[0][0], 6), round(h.circle[0][1], 6)) for h in plate.holes if h.circle}
    assert holes == set(runs.places)
    # As large as the platen, and all that lies on it is in its middle, to the 0.1 mm it is cut to.
    x0, y0, x1, y1 = plate.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx(platen)
    low_x, low_y, high_x, high_y = column.bounds
    taken = [low_x, low_y, high_x + max(x for x, _ in runs.places)]
    taken.append(high_y + max(y for _, y in runs.places))
    assert taken[0] - x0 == pytest.approx(x1 - taken[2], abs=0.11)
    assert taken[1] - y0 == pytest.approx(y1 - taken[3], abs=0.11)
    assert min(taken[0] - x0, taken[1] - y0) > 5
    assert fixture(column, platen, ((0.0, 0.0),)) == fixture(column, platen)


def test_all_laminates_of_a_cycle_share_the_force() -> None:
    column = laminate("stack.balloons=6")
    design = load_design("1dof-5mm")
    one, twelve = schedule(column, design), schedule(column, design, (12, 1))
    for single, shared in zip(one.steps, twelve.steps, strict=True):
        assert shared.force_n == single.force_n
        pad = {item.part: item for item in shared.build_up}["press pad"]
        assert pad == {item.part: item for item in single.build_up}["press pad"]
        area = 12 * footprint(column, single.layers).area
        # What the films take and what the plate takes is the whole force.
        total = shared.film_kpa * area + shared.plate_kpa * (152.4**2 - area)
        assert total == pytest.approx(1000 * shared.force_n, rel=1e-3)
        assert shared.film_kpa <= single.film_kpa
    assert twelve.steps[-1].film_kpa < one.steps[-1].film_kpa


def test_a_cycle_takes_what_one_person_makes_in_eight_hours_or_what_is_ordered() -> None:
    # 45 + 7 x 60 = 465 min fit in 480, and 45 + 8 x 60 do not; ten have room on the plate.
    for most, cycles in (
        ("", (7, 7, 6)),
        ("order.at_once=10", (10, 10)),
        ("order.at_once=3", (3,) * 6 + (2,)),
    ):
        changes = [*filter(None, [most]), "stack.balloons=2", "order.copies=20"]
        design = load_design("1dof-5mm", changes)
        assert design_runs(design, build(design)).cycles == cycles
