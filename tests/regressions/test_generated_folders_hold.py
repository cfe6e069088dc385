"""Sound folders that the check of folders took for faulty ones: roles of openings, uneven kerfs."""

from __future__ import annotations

import math
from pathlib import Path

import ezdxf
import pytest

from sbafab.actuators import load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from tests.quick import few

FEW = ("rules.yield_builds=100", "registration.method=ears")
UNEVEN = ("laser.kerf_tpe=[0.12, 0.1]", "laser.kerf_ptfe=[0.08, 0.12]")
BONE = (
    "stack.balloons=1",
    "fillet.radius=1",
    "inlet.tab_length=0.001",
    "chamber.outline=bone.dxf",
    "chamber.count=4",
    "lumen.diameter=1.04",
    "rules.worst_bond_width=0",
    "rules.worst_mask_overhang=0",
    *UNEVEN,
)


def draw_bone(path: Path) -> None:
    """A closed spline, narrower in the middle than at its ends."""
    turns = [math.tau * n / 40 for n in range(40)]
    sizes = [3.2 + 1.1 * math.cos(2 * turn) for turn in turns]
    points = [(r * math.cos(t), r * math.sin(t), 0.0) for t, r in zip(turns, sizes, strict=True)]
    document = ezdxf.new("R2010", units=4)
    document.modelspace().add_spline([*points, points[0]])
    document.saveas(path)


@pytest.mark.parametrize(
    ("template", "settings"),
    few(
        [
            # A fillet wider than the tab takes its square corners: the ears were taken for tabs.
            ("3dof-15mm", ("stack.balloons=2", "fillet.radius=4")),
            # The window of the outer balloons is as wide as a tooling hole.
            ("radial-15mm", ("chamber.length=11.5",)),
            # The path round a concave corner does not tell the corner.
            ("3dof-15mm", BONE),
        ],
        2,
        names=2,
    ),
)
def test_what_was_written_holds_as_built(
    template: str, settings: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    draw_bone(Path("bone.dxf"))
    run = generate(RunRequest(load_design(template, [*FEW, *settings]), tmp_path, ("cut",)))
    assert not run.failed
    assert [f.message for f in check_folder(run.folder) if f.verdict == "fail"] == []
