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
from tests.studio.worked import EnoughError, given_up_at, job

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
