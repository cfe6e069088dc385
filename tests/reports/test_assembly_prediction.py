"""What assemblies do inflated, against the paper's Sec. 5 and closed formulas."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq

import sbafab
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import assembly_of
from sbafab.cli import app
from sbafab.models.stack import Stack
from sbafab.reports.assembly_prediction import AssemblyPrediction, Grip, predict_assembly

PLATE = """
name = "made"
family = "assembly"
[parts]
plate = {kind = "base", width = 60, length = 40, thickness = 2, material = "acrylic"}
"""
PAIR = f"""{PLATE}
one = {{kind = "sba", design = "1dof-5mm", set.stack.balloons = 6, turn = 180, on = "plate",
at = "top", offset = [-8, 0]}}
shelf = {{kind = "base", width = 10, length = 10, thickness = 1, material = "acrylic", on = "two",
at = "top"}}
two = {{kind = "sba", design = "1dof-5mm", set.stack.balloons = 3, on = "plate", at = "top",
offset = [OFF, 0]}}
"""
POST = f"""{PLATE}
arm = {{kind = "sba", design = "3dof-15mm", set.models.calibration = "none", on = "plate",
at = "top"}}
post = {{kind = "tube", outer_diameter = 4, inner_diameter = 2, length = LONG, material = "steel",
on = "plate", at = "top", offset = [OFF, 0]}}
"""
ROD = """
rod = {kind = "tube", outer_diameter = 2, inner_diameter = 1, length = 14, material = "steel",
on = "arm", at = "top", offset = [4.25, 0]}
"""


def filled(text: str, off: float, long: float = 0) -> str:
    """Return an assembly file; TOML wants each inline table on one line."""
    return text.replace(",\n", ", ").replace("OFF", str(off)).replace("LONG", str(long))


def assembled(text: str, off: float, long: float = 0) -> Assembled:
    return assemble(assembly_of(tomllib.loads(filled(text, off, long)), Path("made")))


def value(found: AssemblyPrediction, part: str, name: str) -> float:
    return next(f.value for f in found.figures if f.part == part and f.name.startswith(name))


def test_the_brace_holds_its_lumen_and_lifts_the_marble() -> None:
    found = predict_assembly(sbafab.assemble("brace"))
    # Paper, Sec. 2.1: 15.33 and about 28, with films as bought; a cylinder's 28.06 is the most.
    alone = sbafab.predict("radial-15mm")
    flown = 15.328 - alone.value("deflated_diameter")
    assert value(found, "grip", "diameter, deflated") == pytest.approx(15.328 - flown)
    most = value(found, "grip", "diameter, inflated at most")
    assert most == pytest.approx(28.06 - flown, abs=0.005)
    assert value(found, "grip", "diameter, inflated free") == pytest.approx(28.0, rel=0.035)
    assert found.left_out == ()
    room = (25.4 - alone.value("deflated_diameter")) / 2
    assert value(found, "grip", "height of a balloon") == pytest.approx(room)
    push = value(found, "grip", "push of each stack")

    # Virtual work: what the air gives when the wall yields by a little, from areas of two arcs.
    def held(height: float) -> float:
        b = brentq(lambda b: 10 * (1 - math.cos(b)) / b - height, 1e-3, math.pi / 2)
        r = 10 / (2 * b)
        rise = r * (1 - math.cos(b))
        caps = 2 * math.pi * rise**2 * (3 * r - rise) / 3
        return float(r * r * (2 * b - math.sin(2 * b)) * 8.5 + caps)

    slope = (held(room + 1e-4) - held(room - 1e-4)) / 2e-4
    assert push == pytest.approx(10.0 * slope / 1000, rel=1e-3)
    friction = value(found, "grip", "friction")
    assert friction == pytest.approx(1.2e-3 * 9.80665 / (3 * push))
    # Paper, Sec. 5: about 2 cm high; the marble's weight bends it, but does not lay it down.
    (alone,) = (
        figure
        for figure in sbafab.predict("3dof-15mm", pressures_kpa=[10]).figures
        if figure.name == "free height at 10 kPa"
    )
    assert value(found, "arm", "height, inflated") == pytest.approx(alone.value, rel=1e-9)
    assert alone.interval is not None
    assert alone.interval[0] < 20.0 < alone.interval[1]
    assert 0 < value(found, "arm", "sag") < 10.0
    assert found.touches == ()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            "parts.grip.set.chamber={width = 9.5, length = 9.5}",
            "not touch the wall: 23.7",
        ),
        ("deploy.lumen_diameter=15.1", "deflated it is 15.15 mm wide already, in a lumen of 15.1"),
    ],
)
def test_a_grip_that_does_not_touch_the_wall_says_why(change: str, why: str) -> None:
    brace = sbafab.assemble("brace", change)
    parts = tuple(one for one in brace.parts if one.name in {"tube", "grip"})
    found = predict_assembly(replace(brace, parts=parts))
    assert not [one for one in found.figures if one.name.startswith(("height", "push", "fric"))]
    (said,) = found.left_out
    assert said.startswith("grip, height of a balloon in the lumen, push of each stack on the wall")
    assert why in said
    assert "set deploy.lumen_diameter" in Grip("grip", 15.33, 27.29, 28.06).why_none


@pytest.mark.parametrize(("offset", "meets"), [(8, False), (-1, True)])
def test_parts_that_meet_only_when_inflated_are_named(
    tmp_path: Path, offset: float, meets: bool
) -> None:
    path = tmp_path / "pair.toml"
    path.write_text(filled(PAIR, offset), encoding="utf-8")
    done = CliRunner().invoke(app, ["predict", str(path), "--pressure", "5", "--json"])
    assert done.exit_code == int(meets), done.output
    touches = json.loads(done.output)["touches"]
    assert [(touch["part"], touch["other"]) for touch in touches] == [("one", "shelf")] * meets


@cache
def drawn_arm() -> Stack:
    """The arm that stands beside the post, its films as drawn and bought."""
    return sbafab.stack("3dof-15mm", "models.calibration=none")


def reach(pressure: float) -> float:
    """Mm from the axis to the outermost point when the first chamber bends the arm into an arc of
    a circle: of its lobe's rims, 7.5 out, the last ones midway in their level, or of the neck on
    its top, 4.25 + 1.27 out.
    """
    pose = drawn_arm().pose((pressure, 0, 0))
    angle = math.radians(pose.bend)
    radius = (pose.freedoms[:, 0] + pose.pitch).sum() / angle
    rims = radius - (radius + 7.5) * np.cos(np.linspace(0, angle * (1 - 1 / 30), 500))
    top = radius - (radius + 4.25 + 1.27) * math.cos(angle)
    return max(float(rims.max()), top)


@pytest.mark.long
@pytest.mark.parametrize(
    ("room", "meets"), [pytest.param(10.5, False, marks=pytest.mark.long), (8.0, True)]
)
def test_a_bent_arm_is_held_against_what_stands_beside_it(room: float, meets: bool) -> None:
    """The first chamber lies at x > 0 and bends the arm towards x < 0, where a post stands."""
    made = assembled(POST, off=-room - 2, long=30)
    found = predict_assembly(made, 5.0)
    assert found.touches == ()  # 0.5 mm and more beside the straight arm
    assert 8.0 < reach(5.0) < 10.5
    if not meets:
        assert not [touch for touch in found.bent_touches if touch.other == "post"]
        left = value(found, "arm", "clearance to post, bent by chamber1")
        assert left == pytest.approx(room - reach(5.0), abs=0.15)
        return
    (met,) = [touch for touch in found.bent_touches if touch.other == "post"]
    assert (met.part, met.chambers) == ("arm", "chamber1")
    assert met.volume > 0.05
    # It meets the post as soon as it reaches so far.
    assert reach(0.8 * met.from_kpa) < room < reach(1.2 * met.from_kpa)


@pytest.mark.long
@pytest.mark.parametrize(("height", "meets"), [(5, False), (9, True)])
def test_what_stands_on_a_bent_arm_goes_along_with_its_tip(height: int, meets: bool) -> None:
    """A rod on the arm's top sweeps over a low post that the arm alone stays clear of."""
    made = assembled(POST + ROD, off=-20, long=height)
    pose = drawn_arm().pose((5, 0, 0))
    x, z = pose.frames[1][-1][:, 0], pose.frames[1][-1][:, 2]
    rod_axis = pose.tip + 4.25 * x + np.linspace(0, 14, 200)[:, None] * z
    over = rod_axis[abs(rod_axis[:, 0] + 20) < 2, 2]
    assert (over.min() - 1 < height) == (over.max() + 1 < height + 2) == meets
    touches = predict_assembly(made, 5.0).bent_touches
    assert [touch.chambers for touch in touches if touch.other == "post"] == ["chamber1"] * meets
