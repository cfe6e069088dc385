"""What assemblies do inflated, against the paper's Sec. 5 and closed formulas."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.reports.assembly_prediction import AssemblyPrediction, predict_assembly

PAIR = """
name = "pair"
family = "assembly"
[parts.plate]
kind = "base"
width = 60
length = 40
thickness = 2
material = "acrylic"
[parts.one]
kind = "sba"
design = "1dof-5mm"
set.stack.balloons = 6
on = "plate"
at = "top"
offset = [-8, 0]
turn = 180
[parts.shelf]
kind = "base"
width = 10
length = 10
thickness = 1
material = "acrylic"
on = "two"
at = "top"
[parts.two]
kind = "sba"
design = "1dof-5mm"
set.stack.balloons = 3
on = "plate"
at = "top"
offset = [OFF, 0]
"""


def value(found: AssemblyPrediction, part: str, name: str) -> float:
    return next(f.value for f in found.figures if f.part == part and f.name.startswith(name))


def test_the_brace_holds_its_lumen_and_lifts_the_marble() -> None:
    found = predict_assembly(sbafab.assemble("brace"))
    # Paper, Sec. 2.1: 15.33 and about 28.
    assert value(found, "grip", "diameter, deflated") == pytest.approx(15.33, abs=0.01)
    assert value(found, "grip", "diameter, inflated") == pytest.approx(28.0, abs=0.1)
    room = (25.4 - 15.328) / 2
    assert value(found, "grip", "height of a balloon") == pytest.approx(room)
    push = value(found, "grip", "push of each stack")

    # Virtual work: what the air gives when the wall yields by a little, from areas of two arcs.
    def held(height: float) -> float:
        low, high = 1e-3, math.pi / 2
        for _ in range(60):
            b = (low + high) / 2
            low, high = (b, high) if 10 * (1 - math.cos(b)) / b < height else (low, b)
        r = 10 / (2 * low)
        rise = r * (1 - math.cos(low))
        caps = 2 * math.pi * rise**2 * (3 * r - rise) / 3
        return r * r * (2 * low - math.sin(2 * low)) * 8.5 + caps

    slope = (held(room + 1e-4) - held(room - 1e-4)) / 2e-4
    assert push == pytest.approx(10.0 * slope / 1000, rel=1e-3)
    friction = value(found, "grip", "friction")
    assert friction == pytest.approx(1.2e-3 * 9.80665 / (3 * push))
    # Paper, Sec. 5: about 2 cm high; the marble's weight bends it, but does not lay it down.
    assert 17.0 < value(found, "arm", "height, inflated") < 25.0
    assert 0 < value(found, "arm", "sag") < 10.0
    assert found.touches == ()


@pytest.mark.parametrize(("offset", "meets"), [(8, False), (-1, True)])
def test_parts_that_meet_only_when_inflated_are_named(
    tmp_path: Path, offset: float, meets: bool
) -> None:
    path = tmp_path / "pair.toml"
    path.write_text(PAIR.replace("OFF", str(offset)), encoding="utf-8")
    done = CliRunner().invoke(app, ["predict", str(path), "--pressure", "5", "--json"])
    assert done.exit_code == int(meets), done.output
    touches = json.loads(done.output)["touches"]
    assert [(touch["part"], touch["other"]) for touch in touches] == (
        [("one", "shelf")] if meets else []
    )
