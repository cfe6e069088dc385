"""A design changed as little as a yield needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import build, load_design
from sbafab.cli import main
from sbafab.design.records import Design
from sbafab.folders.build import make_build
from sbafab.laminate.base_plate import for_a_cnc_mill
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.registration_yield import simulate
from sbafab.search.advice import CHECK_SEED, SEED, YieldDesign, reach_yield
from sbafab.search.compare import YieldEntry

SMALL = ("1dof-5mm", "stack.balloons=2", "rules.yield_builds=1000")


def lower_end(*assignments: str, seed: int = SEED) -> float:
    design: Design = load_design(SMALL[0], (*SMALL[1:], *assignments))
    return simulate(build(design), design, seed).whole.interval[0]


MORE = ("rules.yield_builds=4000",)
BOTH = {"bond.width", "mask.overhang"}


def reached(target: float, *assignments: str, fixed: set[str] | None = None) -> YieldDesign:
    design = load_design(SMALL[0], (*SMALL[1:], *MORE, *assignments))
    return reach_yield(design, target, fixed or set())


def changes(found: YieldDesign) -> dict[str, Any]:
    """The new values by key."""
    return {change.key: change.values[1] for change in found.changes}


def is_good(found: YieldDesign) -> bool:
    """Every rule passes, the target among them, and another seed gives the share that is said."""
    assert found.design is not None
    assert found.share is not None
    assert found.design.rules.target_yield == found.target <= found.share.interval[0]
    again = simulate(build(found.design), found.design, CHECK_SEED).whole
    return not make_build(found.design).failed and again == found.share


def test_what_is_good_enough_stays() -> None:
    found = reached(0.9)
    assert (found.changes, "needs no change" in found.sentence) == ((), True)
    assert found.design is not None
    assert found.design.with_({"rules.target_yield": 0.5}) == found.given.with_(
        {"rules.target_yield": 0.5}
    )


def test_the_order_of_stacking_changes_before_any_film() -> None:
    found = reached(0.945)
    assert changes(found) == {"registration.sequence": "middle-first"}
    assert is_good(found)
    assert YieldEntry.of(found)["changes"] == [
        {"key": "registration.sequence", "from": "bottom-first", "to": "middle-first"}
    ]


def test_bond_and_overhang_grow_before_ears_and_no_more_than_needed() -> None:
    found = reached(0.97, fixed={"registration.sequence"})
    assert changes(found).keys() <= BOTH
    assert is_good(found)
    usual = {"bond.width": 0.75, "mask.overhang": 0.5}
    assert 0 < max(value - usual[key] for key, value in changes(found).items()) <= 0.1
    less = [f"{key}={value - 0.02:.2f}" for key, value in changes(found).items()]
    assert min(lower_end(*MORE, *less), lower_end(*MORE, *less, seed=CHECK_SEED)) < 0.97
    assert f"needs bond.width = {changes(found)['bond.width']}" in found.sentence


def test_a_rough_hand_takes_ears() -> None:
    rough = ("registration.hand_placement=0.3", "registration.hand_turn=1.5")
    found = reached(0.9, *rough)
    assert changes(found) == {"registration.method": "ears"}
    assert is_good(found)


def test_a_rough_plate_is_made_by_a_better_machine() -> None:
    found = reached(0.9, "registration.method=ears", "registration.plate_made_by=drill-press")
    assert changes(found)["registration.plate_made_by"] in ("cnc-mill", "jig-borer")
    assert is_good(found)


@pytest.mark.long
def test_the_command_for_a_cnc_mill_makes_a_design_that_may_be_cut(tmp_path: Path) -> None:
    """Findings and bench.html name it, where a plate takes a jig borer."""
    command = for_a_cnc_mill("3dof-15mm").split()
    with pytest.raises(SystemExit) as ended:
        main([*command[1:], "-o", str(tmp_path)])
    assert ended.value.code == 0
    made = load_design(tmp_path / "3dof-15mm" / "design.toml")
    assert made.registration.plate_made_by == "cnc-mill"
    changed = made.bond.width, made.mask.overhang
    assert changed == pytest.approx((0.79, 0.53), abs=0.011)
    # As it is drawn, with wider holes' places, it must not be cut.
    given = load_design("3dof-15mm", ["registration.plate_made_by=cnc-mill"])
    assert has_failed(run_deck(build(given), given))


def test_what_is_fixed_stays_and_the_best_is_said() -> None:
    fixed = {*BOTH, "registration.method"}
    found = reached(0.99, fixed=fixed)
    assert found.design is None
    assert found.share is not None
    assert [(c.key, c.values[1]) for c in found.changes] == [
        ("registration.sequence", "middle-first")
    ]
    order = "registration.sequence=middle-first"
    design = load_design(SMALL[0], (*SMALL[1:], *MORE, order))
    assert found.share == simulate(build(design), design).whole
    assert "do not --set bond.width, mask.overhang, registration.method" in found.sentence


def test_a_design_that_fails_another_rule_stays() -> None:
    found = reached(0.9, "inlet.width=1")
    assert (found.changes, found.share) == ((), None)
    assert "fails other rules" in found.sentence
