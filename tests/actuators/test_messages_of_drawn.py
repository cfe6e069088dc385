"""Faults of drawn design files that are refused by name, with what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.files import design_path
from sbafab.errors import DesignError
from sbafab.rules.deck import run_rule
from sbafab.rules.measures import Measures
from sbafab.rules.tube_fit import RULE as TUBE_FIT

FAULTS = {
    "centre": ("[[0, 0]]", "[[0, 0], [0, 0]]", "the centre [0.0, 0.0] of pouch twice"),
    "kind": (
        "mechanism =",
        'ports = [{kind = "hol"}]\nmechanism =',
        "ports.0.kind = 'hol' must be 'place' or 'hole'; did you mean hole?",
    ),
    "layer": ("layers = [", "layers = [6,", "layers.0 = 6 must be a table of keys, such as"),
    "face": (
        "[shapes]",
        '[films.tpunylon.faces]\nuper = "tpu"\nlower = "nylon"\n[shapes]',
        "films.tpunylon.faces.uper is not a key of a film's faces; they are upper and lower",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_with_what_is_allowed(name: str, tmp_path: Path) -> None:
    old, new, words = FAULTS[name]
    text = design_path("pouch").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "pouch.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(DesignError) as refused:
        build(load_design(path))
    assert words in str(refused.value)


def test_a_width_unlike_the_drawn_strip_is_named() -> None:
    [chamber] = load_design("pouch").model_dump()["chambers"]
    findings = {}
    for width in (2.0, 3.0):
        design = load_design("pouch").with_({"chambers": [{**chamber, "width": width}]})
        findings[width] = run_rule(TUBE_FIT, Measures(build(design), design))
    assert [finding.verdict for finding in findings[2.0]] == ["pass"]
    *_, unlike = findings[3.0]
    assert unlike.verdict == "warn"
    assert "stated 3.000 mm wide and drawn 2.000, x 0.000, y 24.000" in unlike.message
