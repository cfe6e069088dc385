"""What a worker answers of an assembly: a form for its keys, its parts in their places."""

from __future__ import annotations

import base64
import tomllib
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sbafab import api
from sbafab.assemblies.records import KINDS, Assembly
from sbafab.assemblies.shapes import placed_surface
from sbafab.errors import DesignError
from sbafab.studio.forms import assembly
from sbafab.studio.jobs import JOBS, edited, refusal
from tests.studio.asking import EnoughError, answers, given_up_at, job

BASE = """
name = "stand"
family = "assembly"
[parts.plate]
kind = "base"
width = 40
length = 20
thickness = 2
material = "acrylic"
[parts.arm]
kind = "sba"
design = "1dof-5mm"
set.stack.balloons = 1
on = "plate"
at = "top"
offset = [-10, 0]
"""


def seen(folder: Path, text: str, has: tuple[str, ...] = ()) -> dict[str, Any]:
    """The answers before those of the rules, by kind."""
    live = JOBS["live"]({**job(folder, text), "has": list(has)}, lambda: None)
    return {a["kind"]: a for a in takewhile(lambda a: a["kind"] != "prediction", live)}


def points(answer: dict[str, Any], name: str) -> Any:
    """The points of a part where the page puts them."""
    part = next(part for part in answer["parts"] if part["name"] == name)
    packed = answer["surfaces"][part["surface"]]
    own = np.frombuffer(base64.b64decode(packed["points"]), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(packed["faces"]), "<u4").reshape(-1, 3)
    assert faces.max() == len(own) - 1
    return own @ np.array(part["rows"]).T + np.array(part["shift"])


def test_parts_stand_where_the_file_puts_them(tmp_path: Path) -> None:
    answer = seen(tmp_path, BASE)["parts"]
    plate, arm = points(answer, "plate"), points(answer, "arm")
    assert plate.min(0) == pytest.approx([-20, -10, 0])
    assert plate.max(0) == pytest.approx([20, 10, 2])
    # One balloon of two films of 0.038 mm, 10 mm off to the left on the plate.
    assert arm[:, 2].min() == pytest.approx(2, abs=1e-5)
    laminate = api.build("1dof-5mm", "stack.balloons=1")
    assert arm[:, 0].min() == pytest.approx(laminate.bounds[0] - 10, abs=0.02)
    assert [part["on"] for part in answer["parts"]] == [None, "plate"]


@pytest.mark.long
def test_parts_that_are_bent_round_a_tube_lie_as_in_the_solid(tmp_path: Path) -> None:
    text = api.template("brace")
    answer = seen(tmp_path, text)["parts"]
    assembled = api.assemble(api.loads(text))
    for placed in assembled.parts:
        theirs = placed_surface(placed, filled=True)
        assert points(answer, placed.name) == pytest.approx(theirs.points, abs=1e-4)


def test_a_part_that_moves_costs_only_its_place(tmp_path: Path) -> None:
    first = seen(tmp_path, BASE)["parts"]
    has = tuple(first["surfaces"])
    assert len(has) == 2
    moved = seen(tmp_path, edited(BASE, [("parts.arm.offset", "[5, 1]")]), has)["parts"]
    assert moved["surfaces"] == {}
    assert moved["parts"][1]["shift"] == pytest.approx([5, 1, 2])
    # What changes its own surface is sent.
    for edit in (("parts.plate.width", "30"), ("parts.arm.set.chamber.diameter", "6")):
        assert len(seen(tmp_path, edited(BASE, [edit]), has)["parts"]["surfaces"]) == 1


def test_the_form_of_an_assembly_has_every_key_of_it_and_of_its_parts() -> None:
    form = assembly(api.schema())
    tables = {field["key"].partition(".")[0] for field in form["fields"]}
    assert tables == set(Assembly.model_fields) - {"family", "parts"}
    assert form["kinds"].keys() == KINDS.keys()
    for kind, record in KINDS.items():
        fields = {field["key"] for field in form["kinds"][kind]["fields"]}
        assert fields == set(record.model_fields) - {"kind", "set"}
        assert all(field["meaning"] for field in form["kinds"][kind]["fields"])
    assert form["kinds"]["base"]["needs"] == ["width", "length", "thickness", "material"]


@pytest.mark.parametrize(
    ("key", "value", "field"),
    [
        ("parts.plate.width", "-1", "parts.plate.width"),
        ("parts.arm.turn", "400", "parts.arm.turn"),
        ("parts.arm.set.bond.width", '"wide"', "parts.arm"),
        ("rules.seat_share", "2", "rules.seat_share"),
    ],
)
def test_an_error_stands_at_the_part_s_field(
    tmp_path: Path, key: str, value: str, field: str
) -> None:
    text = edited(BASE, [(key, value)])
    with pytest.raises(DesignError) as ours:
        seen(tmp_path, text)
    assert refusal(str(ours.value))["field"] == field


def test_a_part_is_taken_out_and_another_put_in(tmp_path: Path) -> None:
    text = edited(BASE, [("parts.cup.kind", '"cup"'), ("parts.cup.on", '"plate"')])
    text = edited(text, [("parts.cup.at", '"bottom"'), ("parts.arm.offset", None)])
    answer = seen(tmp_path, text)
    assert [part["name"] for part in answer["parts"]["parts"]] == ["plate", "arm", "cup"]
    assert answer["assembly"]["values"]["parts"]["cup"]["diameter"] == 8
    gone = seen(tmp_path, edited(text, [("parts.cup", None)]))
    assert [part["name"] for part in gone["parts"]["parts"]] == ["plate", "arm"]


def test_a_key_of_a_part_s_design_is_set_beside_those_that_are() -> None:
    text = edited(BASE, [("parts.arm.set.chamber.diameter", "6"), ("parts.arm.turn", "90")])
    arm = tomllib.loads(text)["parts"]["arm"]
    assert arm["set"] == {"stack": {"balloons": 1}, "chamber": {"diameter": 6}}
    assert arm["turn"] == 90
    assert [line for line in BASE.splitlines() if line not in text.splitlines()] == []
    plain = edited(BASE.replace("set.stack.balloons = 1\n", ""), [("parts.arm.set.name", '"a"')])
    assert tomllib.loads(plain)["parts"]["arm"]["set"] == {"name": "a"}


def test_findings_of_an_assembly_name_their_design(tmp_path: Path) -> None:
    text = BASE + "set.rules.yield_builds = 100\n"
    answers = list(JOBS["live"](job(tmp_path, text), lambda: None))
    findings = next(a["findings"] for a in answers if a["kind"] == "rule")
    theirs = api.check(api.loads(text))
    assert [(f["rule"], f["verdict"], f["measured"]) for f in findings] == [
        (f.rule, f.verdict, f.measured) for f in theirs
    ]
    assert {f.get("design") for f in findings} == {"1dof-5mm", None}
    assert not any(f["message"].startswith("1dof-5mm:") for f in findings)


def test_a_change_ends_the_check_of_an_assembly_between_two_rules(tmp_path: Path) -> None:
    seen: list[str] = []
    stop = given_up_at(3)

    def follow() -> None:
        for answer in JOBS["live"](job(tmp_path, BASE), lambda: "prediction" in seen and stop()):
            seen.append(answer["kind"])

    with pytest.raises(EnoughError):
        follow()
    assert seen[-1] == "prediction"


# What moves in an assembly, and what the whole does inflated, as the page is told.


def asked(folder: Path, text: str, do: str, pose: dict[str, Any]) -> dict[str, Any]:
    """The last answer."""
    return answers({**job(folder, text), "do": do, "tab": "a", "pose": pose})[-1]


def test_a_grip_in_its_lumen_touches_the_wall_and_free_is_as_wide_as_the_paper_s() -> None:
    brace = api.assemble("brace")
    found = api.grip(brace, "grip")
    assert found is not None
    held, surface = found
    # Sec. 2.1: about 28 mm inflated; the balloons that stand in the lumen of 25.4 mm reach it.
    assert held.free == pytest.approx(28, rel=0.035)
    # A cylinder of an inextensible pocket 10 wide on the films, of which the press leaves a share.
    films = 3 * 0.038 * 0.204 + 2 * 0.025
    assert held.free < held.most == pytest.approx(15 + 2 * (20 / np.pi + films), abs=0.005)
    across = np.hypot(surface.points[:, 0], surface.points[:, 1])
    assert across.max() == pytest.approx(25.4 / 2, abs=1e-6)
    assert across.min() == pytest.approx(held.deflated / 2, abs=1e-6)
    # Three lenses of film that keeps its width: an arc 10 mm long rises half of 5.036 mm.
    x, y, _ = surface.points.T
    ring = np.abs(surface.points[:, 2]) < 1e-9
    third = ring & (np.abs(np.degrees(np.arctan2(y, x))) < 60)
    arc = surface.points[third][: third.sum() // 2]
    assert np.hypot(*np.diff(arc[:, :2], axis=0).T).sum() == pytest.approx(10, rel=0.02)
    nowhere = type(brace.assembly.deploy)()
    free = api.grip(api.assemble(brace.assembly.model_copy(update={"deploy": nowhere})), "grip")
    assert free is not None
    across = np.hypot(free[1].points[:, 0], free[1].points[:, 1])
    assert 2 * across.max() == pytest.approx(held.free, abs=1e-6)
    assert api.grip(brace, "arm") is None
    with pytest.raises(DesignError, match="use tube, grip, arm"):
        api.grip(brace, "hand")


def test_a_prediction_of_the_whole_ends_where_nobody_waits_for_it(tmp_path: Path) -> None:
    with pytest.raises(EnoughError):
        list(JOBS["elastic"](job(tmp_path, api.template("brace")), given_up_at(2)))


@pytest.mark.parametrize("pose", [{"pressure_kpa": 0}, {"load_g": -1}, {"load_g": "much"}])
def test_what_is_asked_of_the_whole_has_a_range(tmp_path: Path, pose: dict[str, Any]) -> None:
    with pytest.raises(DesignError, match="must be"):
        asked(tmp_path, BASE, "elastic", pose)


@pytest.mark.long
def test_the_parts_move_as_their_stacks_say(tmp_path: Path) -> None:
    text = api.template("brace")
    grip, arm = asked(tmp_path, text, "motion", {})["movers"]
    points = np.frombuffer(base64.b64decode(grip["surface"]["points"]), "<f4").reshape(-1, 3)
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(25.4 / 2, abs=1e-4)
    # The arm stands on the end of a tube of 40 mm, turned by 60 degrees.
    frame = np.array(arm["frame"])
    assert frame[:, 3] == pytest.approx([0, 0, 40])
    assert frame[:, 0] == pytest.approx([0.5, np.sqrt(0.75), 0], abs=1e-4)
    pressures = (6.0, 2.0, 0.0)
    theirs = api.stack("3dof-15mm").pose(pressures)
    ours = asked(tmp_path, text, "motion", {"parts": {"arm": list(pressures)}})["poses"]
    assert ours["arm"]["height"] == pytest.approx(theirs.height, abs=1e-3)
    assert ours["arm"]["bend"] == pytest.approx(theirs.bend, abs=1e-2)
    with pytest.raises(DesignError, match="pressures must be 3 finite"):
        asked(tmp_path, text, "motion", {"parts": {"arm": [1]}})


@pytest.mark.long
def test_the_whole_is_predicted_as_by_the_command(tmp_path: Path) -> None:
    text = api.template("brace")
    ours = asked(tmp_path, text, "elastic", {"pressure_kpa": 5, "load_g": 2})
    theirs = api.predict_assembly("brace", pressure_kpa=5, load_g=2)
    assert [(f["group"], f["name"], f["value"]) for f in ours["figures"]] == [
        (f.part, f.name, f.value) for f in theirs.figures
    ]
    assert ours["met"] == theirs.met()
    assert not ours["meets"]
