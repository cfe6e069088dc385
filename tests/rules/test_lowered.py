"""Limits below the usual ones are named, each with its key; stricter ones are not."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.sections import Laser, Rules
from sbafab.rules.deck import run_deck
from sbafab.rules.limits import lowered

WEAKER = [
    ("rules.bond_width=0.3", "bond_width 0.3 (paper 0.75)"),
    ("rules.mask_overhang=0.4", "mask_overhang 0.4 (paper 0.5)"),
    ("rules.worst_bond_width=0", "worst_bond_width 0 (default 0.5)"),
    ("rules.worst_mask_overhang=0.1", "worst_mask_overhang 0.1 (default 0.25)"),
    ("rules.validated_balloons=40", "validated_balloons 40 (paper 20)"),
    ("laser.least_feature=0.1", "least_feature 0.1 (default 0.2)"),
    ("laser.unknown_kerf=0.05", "unknown_kerf 0.05 (default 0.1)"),
    ("registration.pin_stretch=0.5", "pin_stretch 0.5 (default 0.3)"),
    ("registration.cutting_error=0.05", "cutting_error 0.05 (paper 0.1)"),
    ("registration.pin_error=0.001", "pin_error 0.001 (paper 0.004)"),
    ("registration.hand_placement=0.05", "hand_placement 0.05 (default 0.08)"),
    ("registration.hand_turn=0.2", "hand_turn 0.2 (default 0.4)"),
    ("rules.opening_pressure_kpa=150", "opening_pressure_kpa 150 (default 100)"),
    ("rules.dead_end=5", "dead_end 5 (default 2)"),
]
NO_LIMITS = {"waive", "target_yield", "yield_builds", "kerf_tpe", "kerf_ptfe"} | {
    "cut_speed",
    "travel_speed",
    "pierce_seconds",
    "heat_distance",
    "machine",
    "recipe",
    "hold_tpe",
    "hold_ptfe",
}


@pytest.mark.parametrize(("setting", "said"), WEAKER)
def test_a_lower_limit_is_named(setting: str, said: str) -> None:
    assert lowered(load_design("1dof-5mm", [setting])) == (said,)


def test_stricter_ones_are_not() -> None:
    stricter = ["rules.bond_width=0.8", "rules.validated_balloons=10", "laser.least_feature=0.3"]
    stricter += ["registration.hand_turn=2", "rules.dead_end=1", "rules.target_yield=0.5"]
    for template in ("1dof-5mm", "3dof-15mm", "radial-15mm"):
        assert lowered(load_design(template, stricter)) == lowered(load_design(template)) == ()


def test_every_key_of_rules_and_laser_is_decided_on() -> None:
    keys = {*Rules.model_fields, *Laser.model_fields} - NO_LIMITS
    named = {said.split()[0] for _, said in WEAKER}
    assert keys <= named


def test_the_findings_of_its_rules_say_so() -> None:
    design = load_design("1dof-5mm", ["stack.balloons=2", "rules.bond_width=0.3"])
    findings = run_deck(build(design), design)
    said = {f.rule for f in findings if "limits lowered: bond_width 0.3 (paper 0.75)" in f.message}
    assert said == {"bond-width", "tube-fit"}
    assert not any("lowered" in f.message for f in findings if f.rule not in said)
