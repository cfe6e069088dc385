"""The heat-press schedule against the paper's four steps (Sec. 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import schedule
from sbafab.pressing.schedule_files import press_csv, press_json

Stack = Callable[..., Laminate]
PAPER = load_design("1dof-5mm")
CASES = [
    {"balloons": 1},
    {"balloons": 1, "lumen": True},
    {"balloons": 2},
    {"balloons": 15, "lumen": True},
    {"balloons": 1, "sheet": True},
    {"balloons": 3, "sheet": True},
]


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


@pytest.mark.parametrize("case", CASES)
def test_every_layer_joins_exactly_once(stack: Stack, case: dict[str, int]) -> None:
    laminate = stack(**case)
    plan = schedule(laminate, PAPER)
    added = [index for step in plan.steps for index in step.adds]
    assert sorted(added) == [layer.index for layer in laminate.layers]
    assert set(plan.steps[-1].layers) == set(added)
    for step in plan.steps:
        assert set(step.adds) <= set(step.layers)
        assert list(step.layers) == sorted(step.layers)


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
