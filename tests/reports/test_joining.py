"""The traveller's steps of joining: an order that can be done, parts placed as they are drawn."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import assembly_of
from sbafab.design.files import read_toml, templates_folder
from sbafab.reports.traveller.assembly_page import PartJoint, joints


def together(template: str, **parts: dict[str, Any]) -> Assembled:
    data = read_toml(templates_folder() / f"{template}.toml")
    for name, keys in parts.items():
        data["parts"].setdefault(name, {}).update(keys)
    return assemble(assembly_of(data, templates_folder() / "some.toml"))


def joint(assembled: Assembled, name: str) -> PartJoint:
    [found] = [one for one in joints(assembled) if one.placed.name == name]
    return found


def test_a_line_is_threaded_while_both_ends_can_be_reached() -> None:
    brace = together("brace")
    names = [one.placed.name for one in joints(brace)]
    assert names == ["tube", "grip", "vacuum", "arm", "cup"]
    assert joint(brace, "arm").lines == ["vacuum"]
    # The root is there before what it carries.
    line = {"kind": "line", "on": "arm", "at": "lumen", "length": 30, "along": -5}
    names = [one.placed.name for one in joints(together("aperture", feed=line))]
    assert names.index("arm") == 0 < names.index("feed")


@pytest.mark.parametrize("end", ["end", "start"])
@pytest.mark.parametrize("turn", [0, 60, 180, 250])
def test_the_tab_points_where_it_is_said_to(end: str, turn: float) -> None:
    assembled = together("standing", head={"at": end, "turn": turn})
    head = assembled["head"]
    assert head.made is not None
    (mouth_x, mouth_y) = head.made.laminate.inlets[0].mouth
    # The tube lies; in its own frame the marked line is at x, and its end is looked at from above.
    tube = assembled["tube"]
    at = head.at((mouth_x, mouth_y, 0.0))
    x_axis, y_axis = (
        [b - a for a, b in zip(tube.at((0, 0, 0)), tube.at(unit), strict=True)]
        for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )
    x, y = (sum(a * b for a, b in zip(at, axis, strict=True)) for axis in (x_axis, y_axis))
    drawn = math.degrees(math.atan2(y, x)) * (1 if end == "end" else -1) % 360
    told = joint(assembled, "head").heading
    assert math.cos(math.radians(told - drawn)) == pytest.approx(1)


@pytest.mark.parametrize(("at", "up"), [("top", 5), ("bottom", -5)])
def test_a_place_on_a_plate_is_said_as_it_is_seen(at: str, up: float) -> None:
    plate = {"kind": "base", "width": 60, "length": 30, "thickness": 2, "material": "acrylic"}
    two = {"kind": "sba", "design": "1dof-5mm", "on": "plate", "at": at, "offset": [-15, 5]}
    tables = {"name": "own", "family": "assembly", "parts": {"plate": plate, "two": two}}
    own = assemble(assembly_of(tables, templates_folder() / "some.toml"))
    assert joint(own, "two").aside == (-15, up)


def test_supply_tubes_run_where_no_balloon_opens() -> None:
    """Three SBAs at 0, 120 and 240 degrees round the tube; the gaps are half way between."""
    runs = joint(together("brace"), "arm").supply
    assert [run.angle % 360 for run in runs] == pytest.approx([60, 180, 300])
    assert [run.over for run in runs] == [()] * 3
    crossing = joint(together("brace", arm={"turn": 0}), "arm").supply
    assert {name for run in crossing for name in run.over} == {"grip"}
    assert joint(together("aperture"), "arm").supply == ()


def test_stacked_actuators_go_by_each_others_tabs() -> None:
    second = {"kind": "sba", "design": "1dof-5mm", "on": "arm", "at": "top", "turn": 90}
    assert joint(together("aperture", second=second), "second").heading == 90
    tube = {"kind": "tube", "on": "arm", "at": "top", "turn": 30}
    assert joint(together("aperture", tube=tube), "tube").heading == 30


def test_a_wrap_is_glued_with_what_its_design_names() -> None:
    bare = together("brace")
    part = bare["grip"].part.model_copy(update={"glue": None})
    parts = tuple(replace(p, part=part) if p.name == "grip" else p for p in bare.parts)
    assert joint(replace(bare, parts=parts), "grip").glue == "3M 1587"
