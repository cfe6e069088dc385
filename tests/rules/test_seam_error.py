"""A seam's error of place in the worst case, sealing and nets; most on a folded film's template.

Its seams are 2 mm wide and end 1 mm past the film; the middles of both lie 2 mm from the mouth's.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.output.checked import limits
from sbafab.rules.deck import run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.nets import RULE as NETS
from sbafab.rules.registration_worst_case import RULE as WORST_CASE
from sbafab.rules.sealing import RULE as SEALING

STEADY = {"registration.hand_placement": 0, "registration.hand_turn": 0}


def findings(rule: object, **settings: object) -> list[Finding]:
    named = {key.replace("__", "."): value for key, value in settings.items()}
    design = load_design("folded").with_({**STEADY, **named})
    return run_rule(rule, build(design), limits(design))  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [0.0, 0.5, 1.2])
def test_the_tools_error_is_taken_off_a_bond_from_seam_to_edge(error: float) -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=error)
    # The film's edge and the seam's width lie off by the cutting error each.
    assert bond.measured == pytest.approx(2.0 - 2 * 0.1 - error)
    assert bond.verdict == "pass"


def test_a_tool_that_strays_too_far_fails() -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=1.6)
    assert bond.verdict == "fail"
    assert bond.measured == pytest.approx(0.2)
    assert "place of seam" in bond.message
    assert "make seam or bond.width larger" in bond.message


def test_by_default_a_laser_is_as_exact_as_its_cuts_and_other_tools_are_not() -> None:
    bond, _ = findings(WORST_CASE)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.3)
    seams = load_design("folded").model_dump()["seams"]
    laser = [{**seam, "tool": "laser"} for seam in seams]
    bond, _ = findings(WORST_CASE, seams=laser)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.1)


def test_sealing_alone_catches_a_seam_that_closes_the_mouth_when_it_strays() -> None:
    nominal, moved = findings(SEALING, registration__seam_error=0.9)
    assert (nominal.verdict, moved.verdict) == ("pass", "pass")
    # A seam 1.2 mm off reaches 0.2 mm past the middle of the mouth, where the tube goes in.
    nominal, moved = findings(SEALING, registration__seam_error=1.2)
    assert (nominal.verdict, moved.verdict) == ("pass", "fail")
    assert "off its path by up to 1.2 mm" in moved.message
    assert findings(WORST_CASE, registration__seam_error=1.2)[0].verdict == "pass"


HALVED = """
# A pouch welded round its edge, halved by a seam that runs 0.5 mm into the one round it.
name = "halved"
family = "drawn"
layers = [{role = "base", shape = "film"}, {role = "cap", shape = "film"}]
seams = [
  {name = "edge", layers = [1, 2], width = 4, tool = "hot-tip", path = [
    [-25, -3], [-20, -3], [-20, -10], [20, -10], [20, 10], [-20, 10], [-20, 3], [-25, 3]]},
  {name = "middle", layers = [1, 2], width = 3, tool = "hot-tip", path = [[0, -7], [0, 7]]},
]
chambers = [{name = "left", centres = [[-10, 0]], mouth = [-22, 0], angle = 180, width = 2}]
ports = [{name = "right", layers = [1, 2], at = [10, 0]}]
nets = {a = ["left"], b = ["right"]}

[shapes]
film = {polygon = [[-22, -12], [22, -12], [22, 12], [-22, 12]]}
"""


@pytest.mark.parametrize(("error", "verdict"), [(0.2, "pass"), (0.3, "fail")])
def test_nets_are_joined_where_seams_stray_from_each_other(
    error: float, verdict: str, tmp_path: Path
) -> None:
    """Two seams lie apart by twice the error of their tool, and run 0.5 mm into each other."""
    path = tmp_path / "halved.toml"
    path.write_text(HALVED, encoding="utf-8")
    design = load_design(path).with_({"registration.seam_error": error})
    laminate = build(design)
    joined, moved, *_ = run_rule(NETS, laminate, limits(design))
    assert (joined.verdict, moved.verdict) == ("pass", verdict)
    assert f"every seam off its path by up to {error:g} mm" in moved.message
    if verdict == "fail":
        assert "nets a and b are joined at interface 1" in moved.message
        assert abs(moved.where.x or 0.0) < 2
        assert abs(moved.where.y or 0.0) == pytest.approx(8.25, abs=0.5)


def test_a_mouth_that_a_seam_closes_when_it_strays_opens_its_net() -> None:
    for error, verdict in ((0.9, "pass"), (1.2, "fail")):
        settings = {"registration__seam_error": error, "nets": {"a": ["pouch"]}}
        joined, moved, *_ = findings(NETS, **settings)
        assert (joined.verdict, moved.verdict) == ("pass", verdict)
    assert "net a " in moved.message
