"""The traveller's steps of joining: orders that can be done, words that place a part as drawn."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.reading import assembly_of
from sbafab.design.reading import read_toml, templates_folder
from sbafab.reports.traveller.joining import join_pages


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
    found = re.search(r"tab of chamber1 ([\d.]+) degrees anti-clockwise from the marked", said)
    told = 0.0 if "the tab of chamber1 over the marked line" in said else float(found[1])  # type: ignore[index]
    assert math.cos(math.radians(told - drawn)) == pytest.approx(1)


def test_stacked_actuators_go_by_each_others_tabs() -> None:
    second = {"kind": "sba", "design": "1dof-5mm", "on": "arm", "at": "top", "turn": 90}
    said = words(together("aperture", second=second), "second")
    assert "90 degrees anti-clockwise from the first tab of arm" in said
