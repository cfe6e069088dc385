"""A design for a yield from Python: its folder holds it, and what was asked for stays."""

from __future__ import annotations

import sbafab
from sbafab.actuators import build
from sbafab.rules.registration_yield import simulate

ROUGH = {
    "stack.balloons": 2,
    "rules.yield_builds": 500,
    "registration": {"hand_placement": 0.2, "hand_turn": 1.0},
}


def test_the_changed_design_reaches_the_share_and_costs_what_its_ears_do() -> None:
    given = sbafab.load("1dof-5mm", ROUGH)
    reached = sbafab.reach_yield("1dof-5mm", ROUGH, target=0.9)
    design, comparison = reached.design, reached.comparison
    assert design is not None
    assert comparison is not None
    assert [row.key for row in reached.changes] == ["registration.method"]
    assert reached.changes[0].values == ("channel-pin", "ears")
    assert design == given.with_(registration={"method": "ears"}, rules={"target_yield": 0.9})
    # Ears stand on the outline and leave it as it is.
    (outline,) = (pair for pair in comparison.figures if pair.name == "outline diameter")
    (overall,) = (pair for pair in comparison.figures if pair.name == "overall diameter")
    assert not outline.differs
    assert overall.differs
    # Builds drawn by a third seed.
    share = simulate(build(design), design.with_("rules.yield_builds=1000"), 91).whole
    assert share.interval[1] >= 0.9
