"""traveller.html before the day of the press, and names that can be read in its top view."""

from __future__ import annotations

import itertools
import re
from typing import Any

import pytest
import shapely

from sbafab.laminate.assembly import assembly
from sbafab.reports.drawing import text_width
from sbafab.reports.traveller.shapes import beds
from sbafab.reports.traveller.step_pictures import plan
from tests.reports.bench_pages import EARS, built, page, words_of


@pytest.mark.parametrize("assignments", [(), (EARS,)])
def test_what_must_be_ready_before_the_day(sheet_files: Any, assignments: tuple[str, ...]) -> None:
    tree = page(sheet_files, "3dof-15mm", *assignments)
    section = words_of(tree.get_element_by_id("before").getparent())
    # Two release films a step and one for what is turned over; reamers as in the hole table.
    steps_made = 6 if assignments else 4
    assert f"{2 * steps_made + 1} release films" in section
    assert f"each of the {steps_made} press steps" in section
    assert ("reamers H7 ⌀1 mm and ⌀1.5 mm" in section) == bool(assignments)
    # The paper has no time for warming or cooling: nothing is made up.
    assert section.count("not known, the paper gives no time") == 2
    assert "Time constant τ of the plate" in section
    assert not re.search(r"\d+ min", section)
    assert "130 °C (266 °F)" in section
    assert ("ears" in section) == bool(assignments)
    # A punch goes through the push-out hole of 0.6 diameters.
    assert ("punches ⌀0.5 mm and ⌀1.1 mm" in section) == (not assignments)
    assert ("Underlay printed at 100 %, 2 times" in section) == (not assignments)
    # No hand lays to 0.08 mm without one; ears hold every film.
    assert ("loupe" not in section) == bool(assignments)
    assert ("by eye to 0.08 mm" in section) != bool(assignments)


def test_a_part_without_pins_needs_no_reamer(sheet_files: Any) -> None:
    radial = words_of(page(sheet_files, "radial-15mm").get_element_by_id("before").getparent())
    assert "reamer" not in radial
    assert "every pin" not in radial


@pytest.mark.parametrize(
    "design",
    [
        ("3dof-15mm", EARS),
        ("1dof-5mm", EARS),
        ("radial-15mm", EARS),
        ("3dof-15mm", EARS, "chamber.count=4", "chamber.diameter=6.5", "lumen.diameter=3"),
        ("3dof-15mm",),
    ],
)
def test_names_in_the_top_view_are_apart(design: tuple[str, ...]) -> None:
    _, laminate = built(*design)
    parts = assembly(laminate)
    known = {thing.name for thing in (*laminate.pins, *laminate.chambers)}
    for part in parts:
        drawn = plan(laminate, part, beds(parts, part), "plan")
        found = re.findall(
            r'<text x="([-\d.]+)" y="([-\d.]+)" font-size="([\d.]+)"[^>]*>(.*?)<', drawn
        )
        boxes = []
        for x, y, size, words in found:
            wide, low = text_width(words, float(size)), float(y) - 0.85 * float(size)
            left = float(x) - wide / 2
            if words in known:
                boxes.append((words, shapely.box(left, low, left + wide, low + float(size))))
        names = {words for words, _ in boxes}
        assert {pin.name for pin in part.pins} <= names
        for (a, one), (b, other) in itertools.combinations(boxes, 2):
            shared = one.intersection(other).area
            assert shared <= 0.1 * min(one.area, other.area), (part.number, a, b)
