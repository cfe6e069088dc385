"""The traveller's steps of joining: orders that can be done, words that place a part as drawn."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.checks import supply_runs
from sbafab.assemblies.files import assembly_of
from sbafab.design.files import read_toml, templates_folder
from sbafab.reports.traveller.assembly_page import join_pages


def together(template: str, **parts: dict[str, Any]) -> Assembled:
    data = read_toml(templates_folder() / f"{template}.toml")
    for name, keys in parts.items():
        data["parts"].setdefault(name, {}).update(keys)
    return assemble(assembly_of(data, templates_folder() / "some.toml"))


def words(assembled: Assembled, name: str) -> str:
    (page,) = [page for page in join_pages(assembled) if page.title.split()[0].strip(",") == name]
    return " ".join(action.text for action in page.actions)


def test_a_line_is_threaded_while_both_ends_can_be_reached() -> None:
    titles = [page.title for page in join_pages(together("brace"))]
    assert titles == [
        "tube",
        "grip (radial-15mm), on the outside of tube",
        "vacuum (vacuum or fluid line), in the lumen of arm",
        "arm (3dof-15mm), at the end of tube",
        "cup (suction cup), on the top of arm",
    ]
    assert words(together("brace"), "arm").startswith(
        "Take arm with vacuum in it. Lead vacuum through tube."
    )


def test_a_line_in_the_root_comes_after_it() -> None:
    line = {"kind": "line", "on": "arm", "at": "lumen", "length": 30, "along": -5}
    titles = [page.title for page in join_pages(together("aperture", feed=line))]
    assert titles[0] == "arm (3dof-15mm)"
    assert "feed (vacuum or fluid line), in the lumen of arm" in titles[1:]


@pytest.mark.parametrize("end", ["end", "start"])
@pytest.mark.parametrize("turn", [0, 60, 180, 250])
def test_the_tab_points_where_the_words_say(end: str, turn: float) -> None:
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
    said = words(assembled, "head")
    found = re.search(r"glued, the tab of chamber1 ([\d.]+) degrees anti-clockwise", said)
    told = 0.0 if "glued, the tab of chamber1 over the marked line" in said else float(found[1])  # type: ignore[index]
    assert math.cos(math.radians(told - drawn)) == pytest.approx(1)


def test_stacked_actuators_go_by_each_others_tabs() -> None:
    second = {"kind": "sba", "design": "1dof-5mm", "on": "arm", "at": "top", "turn": 90}
    said = words(together("aperture", second=second), "second")
    assert "with the tab of chamber1 to the right" in said
    assert "its base glued, the tab of chamber1 90 degrees anti-clockwise from there" in said


@pytest.mark.parametrize(("at", "way"), [("top", "5 mm up"), ("bottom", "5 mm down")])
def test_a_place_on_a_plate_is_said_as_it_is_seen(at: str, way: str) -> None:
    plate = {"kind": "base", "width": 60, "length": 30, "thickness": 2, "material": "acrylic"}
    two = {"kind": "sba", "design": "1dof-5mm", "on": "plate", "at": at, "offset": [-15, 5]}
    tables = {"name": "own", "family": "assembly", "parts": {"plate": plate, "two": two}}
    own = assemble(assembly_of(tables, templates_folder() / "some.toml"))
    assert f"with the arrow to the right, its middle 15 mm left and {way}" in words(own, "two")
    assert "arrow along the 60 mm" in words(own, "plate")


def test_a_tube_on_an_actuator_says_its_end_and_its_line() -> None:
    tube = {"kind": "tube", "on": "arm", "at": "top", "turn": 30}
    said = words(together("aperture", tube=tube), "tube")
    assert "its start glued, the marked line 30 degrees anti-clockwise from there" in said


def test_supply_tubes_run_where_no_balloon_opens() -> None:
    said = words(together("brace"), "arm")
    # Three SBAs at 0, 120 and 240 degrees round the tube; the gaps are half way between.
    assert "chamber1 at 60, chamber2 at 180 and chamber3 at 300 degrees;" in said
    assert "toward its start" in said
    assert "leave it slack" not in said
    crossing = words(together("brace", arm={"turn": 0}), "arm")
    assert "where one crosses grip, leave it slack" in crossing
    assert "Gather its tubes below the base" in words(together("aperture"), "arm")


@pytest.mark.parametrize("turn", [0, 20, 60, 100])
def test_the_gaps_are_those_of_the_sheet(turn: float) -> None:
    made = together("brace", arm={"turn": turn})
    # 11.5 of 15.708 mm are covered; a tube 1.016 wide needs room on both sides.
    half = math.degrees((11.5 / 2 + 1.016 / 2) / 7.5)
    for run in supply_runs(made["arm"], made):
        off = min(run.angle % 120, 120 - run.angle % 120)
        assert bool(run.over) == (off < half)


def test_a_wrap_is_glued_with_what_its_design_names() -> None:
    bare = together("brace")
    part = bare["grip"].part.model_copy(update={"glue": None})
    parts = tuple(replace(p, part=part) if p.name == "grip" else p for p in bare.parts)
    assert "Glue: 3M 1587" in words(replace(bare, parts=parts), "grip")
