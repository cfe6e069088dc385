"""Predicted yields against plain random builds of what was written."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.registration_yield import simulate
from tests.judge.yields import judged_yield

pytestmark = pytest.mark.long
"""Closed formulas in tests/rules see what changes a yield; these look at whole folders."""
TWO = "stack.balloons=2"
DESIGNS = {
    "by hand": ("1dof-5mm", (TWO, "registration.hand_placement=0.12")),
    "middle first": (
        "1dof-5mm",
        (TWO, "registration.sequence=middle-first", "registration.hand_turn=0.8"),
    ),
    "round a tube": ("radial-15mm", ("registration.hand_turn=0.5",)),
}
ROUGHER = {
    "hand_placement = 0.12": "hand_placement = 0.16",
    "hand_turn = 0.4": "hand_turn = 0.8",
    "cutting_error = 0.1": "cutting_error = 0.12",
    "worst_bond_width = 0.5": "worst_bond_width = 0.55",
    "worst_mask_overhang = 0.25": "worst_mask_overhang = 0.3",
}
"""Lines of a design file, and others with which fewer builds are good."""


def folder_of(name: str, out: Path) -> tuple[float, Path]:
    """The predicted share of good builds, and a written folder."""
    source, keys = DESIGNS[name]
    design = load_design(source, keys)
    share = simulate(build(design), design).whole.value
    quick = design.with_({"rules.yield_builds": 100})
    return share, generate(RunRequest(quick, out, ("cut", "press"))).folder


@pytest.mark.parametrize("name", DESIGNS)
def test_a_predicted_yield_is_that_of_plain_builds(name: str, tmp_path: Path) -> None:
    share, folder = folder_of(name, tmp_path)
    assert share < 0.97
    assert judged_yield(folder, builds=10_000) == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize("line", ROUGHER)
def test_the_judge_counts_every_error_and_limit(line: str, tmp_path: Path) -> None:
    share, folder = folder_of("by hand", tmp_path)
    file = folder / "design.toml"
    text = file.read_text(encoding="utf-8")
    assert text.count(line + "\n") == 1
    file.write_text(text.replace(line + "\n", ROUGHER[line] + "\n"), encoding="utf-8")
    assert judged_yield(folder, builds=1_000) < share - 0.03
