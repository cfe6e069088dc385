"""The traveller of registered sheets at the bench: nothing missing between the platens."""

from __future__ import annotations

import csv
import re
from functools import cache
from itertools import pairwise
from typing import Any

import pytest
from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.output.checked import press_settings
from sbafab.pressing.schedule import schedule
from sbafab.pressing.work_plan import plan_csv
from sbafab.reports.traveller.job import Job
from sbafab.reports.traveller.page import traveller_html

SHA = "0123456789abcdef" * 4


@cache
def tree() -> Any:
    design = load_design(
        "3dof-15mm", ('registration.method="sheet"', "registration.experimental=true")
    )
    laminate = build(design)
    plan = schedule(laminate, press_settings(design))
    return lxml_html.fromstring(traveller_html(design, laminate, plan, [], Job(SHA, "sbafab 1")))


def words_of(node: Any) -> str:
    return " ".join(node.text_content().split())


def steps() -> list[str]:
    return [words_of(step) for step in tree().find_class("step")]


def test_every_press_step_has_its_pad_its_pins_and_one_time() -> None:
    first, last = steps()
    for step, minutes in ((first, 10), (last, 20)):
        # Without the pad the force would lie on the sheets alone.
        assert "Cover and close the press" in step
        assert step.count("Start the clock") == 1
        assert f"Start the clock, {minutes} min, only when the plate's edge reads 130" in step
        assert "every pin reaches through the highest sheet" in step
        assert "do not stand higher" not in step
    assert "pins in on their shoulders, heights gauged" in first
    press = words_of(tree().get_element_by_id("press").getparent())
    assert "Cover with a release film and the press pad" in press
    assert "Set the pins on the shoulders of their holes" in press
    assert last.index("pad off") < last.index("Pins out") < last.index("Take off the lower release")
    # The stack stays on its pins, so that they are set once, for the highest stack.
    heights = {
        found[1]
        for step in (first, last)
        if (found := re.search(r"([\d.]+) to [\d.]+ mm over it", step))
    }
    # The highest stack, the release film under it and the chamfer of a pin of 1.5 mm.
    [height] = heights
    assert 0 <= float(height) - (30 * 0.038 + 29 * 0.025 + 0.05 + 0.3) < 0.06
    tack = words_of(tree().get_element_by_id("sheets").getparent())
    assert "a release film and the press pad on top" in tack


def test_registered_sheets_are_held_by_film_that_reaches_past_them() -> None:
    sheets = words_of(tree().get_element_by_id("sheets").getparent())
    assert "out of film that reaches 10 mm past it all round" in sheets
    assert "hold it down all along that rim with tape or magnets" in sheets
    assert "Air assist off" in sheets
    size = re.search(r"is one sheet of ([\d.]+) \u00d7 ([\d.]+) mm", sheets)
    assert size is not None
    materials = words_of(tree().get_element_by_id("materials").getparent())
    # 30 films and 29 masks, in patterns: base, wall of the inlets, cap, 27 walls (two spares, as
    # 1.35 is rounded up); chamber masks 1 and 14, separators 14. One spare else.
    for film, number in (("TPE", 30 + 1 + 1 + 1 + 2), ("PTFE", 29 + 1 + 1 + 1)):
        bought = re.search(
            rf"{film} film.*?(\d+) sheets of at least ([\d.]+) \u00d7 ([\d.]+) mm", materials
        )
        assert bought is not None
        assert int(bought[1]) == number
        for side in (1, 2):
            assert float(bought[side + 1]) == pytest.approx(float(size[side]) + 20, abs=0.011)


EMS = {" ": 0.35, ",": 0.38, ".": 0.38, ":": 0.4, "…": 1.0, "-": 0.42}
"""Widths of letters in DejaVu Sans Bold, the widest font that a page falls back to."""


def test_labels_of_the_picture_do_not_run_into_each_other() -> None:
    pictures = tree().xpath('//svg[contains(@aria-label, "taken apart")]')
    assert len(pictures) == 2
    for picture in pictures:
        width = float(picture.get("viewbox", picture.get("viewBox")).split()[2])
        rows: dict[str, list[tuple[float, float]]] = {}
        for text in picture.iter("text"):
            size, x = float(text.get("font-size")), float(text.get("x"))
            bold = text.get("font-weight") == "bold"
            ems = sum(EMS.get(letter, 0.696) for letter in text.text)
            wide = size * ems * (1.0 if bold else 0.88)
            rows.setdefault(text.get("y"), []).append((x, x + wide))
        for spans in rows.values():
            spans.sort()
            assert all(b <= c for (_, b), (c, _) in pairwise(spans))
            assert spans[-1][1] <= width


def test_every_actuator_of_a_batch_has_its_serial_number() -> None:
    design = load_design(
        "1dof-5mm",
        (
            'registration.method="sheet"',
            "registration.experimental=true",
            "stack.balloons=2",
            "order.copies=3",
        ),
    )
    laminate = build(design)
    plan = schedule(laminate, press_settings(design))
    job = Job(SHA, "sbafab 1", copies=3)
    page = lxml_html.fromstring(traveller_html(design, laminate, plan, [], job))
    rows = page.find_class("serials")[0].findall("tbody/tr")
    assert [words_of(row.find("th")) for row in rows] == ["1", "2", "3"]
    assert all(len(row.findall("td/input")) == 4 for row in rows)
    leak = words_of(page.get_element_by_id("leak").getparent())
    assert "Write both results beside its serial number" in leak


def test_the_working_days_of_a_batch_are_those_of_its_plan() -> None:
    """The table of times states the last day of plan.csv."""
    design = load_design("1dof-5mm", ("stack.balloons=2", "order.copies=30"))
    laminate = build(design)
    plan = schedule(laminate, press_settings(design))
    page = traveller_html(design, laminate, plan, [], Job(SHA, "sbafab 1", copies=30))
    text = plan_csv(design, laminate, plan)
    assert text is not None
    last = max(int(row["day"]) for row in csv.DictReader(text.splitlines()))
    assert last > 1
    rows = [[words_of(cell) for cell in row] for row in lxml_html.fromstring(page).iter("tr")]
    assert [row[1] for row in rows if row[0] == "In working days"] == [str(last)]
