"""traveller.html: what stands on the page."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import shapely
from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import schedule
from sbafab.reports.drawing import TIMES
from sbafab.reports.traveller import units
from sbafab.reports.traveller.bill import cut_list
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.traveller.shapes import rounds
from sbafab.rules.finding import Finding, Place
from tests.quick import few

SHA = hashlib.sha256(b"design").hexdigest()
DESIGNS = [
    ("3dof-15mm",),
    ("1dof-5mm",),
    ("1dof-5mm", "stack.balloons=1"),
    ("radial-15mm",),
    ("radial-15mm", "stack.balloons=3", 'registration.method="ears"'),
    ("1dof-5mm", 'registration.method="ears"'),
    ("3dof-15mm", "stack.balloons=25"),
    ("1dof-10mm", "stack.balloons=8", "chamber.diameter=[10,9.5,9,8.5,8,7.5,7,6.5]"),
]


@cache
def built(template: str, *assignments: str) -> tuple[Design, Laminate]:
    design = load_design(template, assignments)
    return design, build(design)


def work_of(sheet_files: Any, template: str, *assignments: str, **job: Any) -> Work:
    design, laminate = built(template, *assignments)
    given: dict[str, Any] = {"design_sha256": SHA, "generator": "sbafab 1.0.0", **job}
    given.setdefault("fixture", "sheets/fixture.dxf" if laminate.pins else None)
    plan = schedule(laminate, design)
    sheets = sheet_files(laminate, design.order.quantity)
    return Work(design, laminate, plan, sheets, Job(**given))


def page_of(work: Work) -> str:
    return traveller_html(work)


def parsed(work: Work) -> Any:
    return lxml_html.fromstring(page_of(work))


def words_of(node: Any) -> str:
    return " ".join(node.text_content().split())


@pytest.mark.parametrize("given", few(DESIGNS, 3), ids=" ".join)
def test_every_layer_is_laid_once_and_in_order_within_its_step(
    sheet_files: Any, given: tuple[str, ...]
) -> None:
    work = work_of(sheet_files, *given)
    laid: list[int] = []
    for step in parsed(work).findall(".//article"):
        here = [
            int(n)
            for li in step.iterfind(".//li[@data-layers]")
            for n in li.get("data-layers").split()
        ]
        assert here == sorted(here)
        laid += here
    assert sorted(laid) == [layer.index for layer in work.laminate.layers]


@pytest.mark.parametrize("given", few(DESIGNS, 3), ids=" ".join)
def test_the_page_is_whole_in_itself(sheet_files: Any, given: tuple[str, ...]) -> None:
    page = page_of(work_of(sheet_files, *given, solid_png=b"\x89PNG"))
    tree = lxml_html.fromstring(page)
    ids = [node.get("id") for node in tree.iter() if node.get("id")]
    assert [name for name, count in Counter(ids).items() if count > 1] == []
    links = [
        value
        for node in tree.iter()
        for name, value in node.attrib.items()
        if name in ("href", "xlink:href", "src", "srcset", "action", "data", "aria-labelledby")
    ]
    assert links
    for link in links:
        assert link.startswith("data:image/png;base64,") or link.removeprefix("#") in ids
    assert set(re.findall(r"url\((.)", page)) == {"#"}
    assert set(re.findall(r"url\(#([^)]+)\)", page)) <= set(ids)
    assert "http" not in page
    assert "@import" not in page


def test_dials_are_the_papers() -> None:
    assert units.temperature(135.0) == "135 °C (275 °F)"
    assert units.force(110.0 * 152.4**2 / 1000) == "2555 N = 2.555 kN = 574 lbf"
    # 1 psi is the weight of 0.45359237 kg on a square inch.
    assert (
        units.pressure(110.0) == f"110 kPa ({110e3 * 0.0254**2 / (0.45359237 * 9.80665):.1f} psi)"
    )


def test_each_step_shows_its_dials(sheet_files: Any) -> None:
    steps = parsed(work_of(sheet_files, "3dof-15mm")).findall(".//article")
    dials = [
        [words_of(cell) for cell in step.findall(".//table[@class='dials']/tbody/tr/td")]
        for step in steps
    ]
    assert [row[0] for row in dials] == ["135 °C (275 °F)"] * 4
    assert {row[1] for row in dials} == {"2555 N = 2.555 kN = 574 lbf"}
    films = [step.film_kpa for step in work_of(sheet_files, "3dof-15mm").schedule.steps]
    assert [row[3] for row in dials] == [f"about {kpa:.0f} kPa" for kpa in films]
    assert [row[4] for row in dials] == ["3 min", "12 min", "10 min", "20 min"]
    assert [row[5] for row in dials] == ["4 in", "none", "4 in", "none"]


def test_pins_are_drawn_filled_where_they_are_in(sheet_files: Any) -> None:
    work = work_of(sheet_files, "3dof-15mm")
    for step, page in zip(work.schedule.steps, parsed(work).findall(".//article"), strict=True):
        plan = page.findall(".//svg")[0]
        fills = Counter(circle.get("fill") for circle in plan.iter("circle"))
        # One circle of each kind belongs to the key.
        assert fills["#1a1a1a"] == len(step.pins) + 1
        assert fills["#ffffff"] == len(work.laminate.pins) - len(step.pins) + 1


def test_what_no_pin_holds_is_laid_by_eye(sheet_files: Any) -> None:
    # One chamber has no lumen, and its separators open wider than the only pin.
    page = page_of(work_of(sheet_files, "1dof-5mm"))
    edge = "lay by eye, its edge 0.5 mm outside that of the TPE wall"
    # The lowest of its step has nothing below it.
    assert f"No pin holds P04 in layer 4: {edge} above" in page
    assert f"No pin holds P04 in layers 8, 12, 16: {edge} below" in page
    assert f"No pin holds P04: {edge} below" in page
    assert page.count("No pin holds P") == 3
    assert "No pin holds P" not in page_of(work_of(sheet_files, "3dof-15mm"))


def test_one_pattern_on_films_of_two_sizes_is_laid_along_each(sheet_files: Any) -> None:
    """A separator reaches 0.5 mm out of the smaller wall, and so 0.3 out of one 0.4 wider."""
    sizes = ("chamber.diameter=[5.4, 3, 5.4, 5, 5]", "stack.balloons=5")
    page = page_of(work_of(sheet_files, "1dof-5mm", *sizes))
    said = "No pin holds P10 in layer {}: lay by eye, its edge {} mm outside that of the TPE wall"
    assert said.format(12, 0.3) in page
    assert said.format(16, 0.5) in page


@pytest.mark.parametrize(("balloons", "turns"), [(3, 1), (4, 2), (15, 13), (20, 18)])
def test_the_middle_is_told_in_rounds(balloons: int, turns: int) -> None:
    laminate = build(load_design("3dof-15mm", (f"stack.balloons={balloons}",)))
    found = rounds(laminate.layers)
    flat = [layer.index for turn in found for layer in turn.layers]
    assert flat == [layer.index for layer in laminate.layers]
    assert max(turn.count for turn in found) == turns
    for turn in found:
        assert len({tuple(layer.pattern for layer in part) for part in turn.turns}) == 1


def test_words_from_outside_stay_words(sheet_files: Any) -> None:
    hostile = '"><script>alert(1)</script>&amp;{{ 7*7 }}</style>'
    finding = Finding("bond-width", "warn", 1.0, 1.0, "mm", Place(), hostile)
    work = work_of(
        sheet_files,
        "1dof-5mm",
        f"order.made_for={json.dumps(hostile)}",
        f"order.note={json.dumps(hostile)}",
        findings=[finding],
        generator=hostile,
    )
    named = replace(work.laminate, name=hostile)
    sheets = [replace(sheet, path=hostile, counts=((hostile, "P01", 1),)) for sheet in work.sheets]
    page = page_of(replace(work, laminate=named, sheets=sheets))
    tree = lxml_html.fromstring(page)
    assert len(tree.findall(".//script")) == 1
    assert len(tree.findall(".//style")) == 1
    assert words_of(tree.find(".//h1")) == hostile
    assert page.count("alert(1)") == page.count("&gt;alert(1)")


def test_a_blank_stands_where_nobody_is_named(sheet_files: Any) -> None:
    assert parsed(work_of(sheet_files, "1dof-5mm")).get_element_by_id("made-for").tag == "input"
    named = page_of(work_of(sheet_files, "1dof-5mm", "order.made_for=Ward 7"))
    assert "Ward 7" in named
    assert 'id="made-for"' not in named


PRINTS = """
import hashlib
from sbafab.actuators import build, load_design
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.page import traveller_html
design = load_design("3dof-15mm", ())
laminate = build(design)
plan = schedule(laminate, design)
page = traveller_html(Work(design, laminate, plan, [], Job("{sha}", "sbafab 1.0.0")))
print(hashlib.sha256(page.encode()).hexdigest())
"""


def test_the_same_design_gives_the_same_bytes() -> None:
    code = PRINTS.format(sha=SHA)
    printed = {
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=Path(__file__).parents[2],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(printed) == 1


def test_release_films_count_every_press_cycle(sheet_files: Any) -> None:
    """Two new ones each time the press closes, one below what is turned over; nine copies, four at
    most at once, take three cycles.
    """
    for order, cycles in (
        (("order.copies=1",), 1),
        (("order.copies=3",), 1),
        (("order.copies=9", "order.at_once=4"), 3),
    ):
        work = work_of(sheet_files, "1dof-5mm", *order)
        assert work.runs.count == cycles
        closings = cycles * len(work.schedule.steps)
        rows = parsed(work).get_element_by_id("materials").getparent().findall(".//tbody/tr")
        [films] = [row for row in rows if words_of(row[1]) == "Release film"]
        assert words_of(films[3]) == f"{2 * closings + 1}"
        assert f"Cut to size: {2 * closings + 1} release films." in page_of(work)


def test_the_bill_counts_what_is_needed(sheet_files: Any) -> None:
    work = work_of(sheet_files, "3dof-15mm", "order.copies=2")
    rows = parsed(work).get_element_by_id("materials").getparent().findall(".//tbody/tr")
    bill = [[words_of(cell) for cell in row][1:] for row in rows]
    found = {(name, what): quantity for name, what, quantity in bill}
    # A hole has one depth, so two stacks, 0.063 and 1.726 mm high, take two lengths of pins; both
    # copies lie in the press at once.
    pins = {
        tuple(map(float, re.findall(r"([\d.]+) mm", what))): quantity
        for (name, what), quantity in found.items()
        if name == "Dowel pins"
    }
    assert sorted(pins) == [(1, 3), (1, 5), (2, 5), (2, 6)]
    assert [pins[size] for size in sorted(pins)] == ["6 + 3 spare"] * 2 + ["2 + 2 spare"] * 2
    names = [name for name, _ in found]
    assert {"Base plate", "Release film", "Press pad"} <= set(names)
    assert found["Tube", "Braintree RPT040, outer diameter 1.016 mm"] == "6 pieces + 1 spare"
    area = 2 * sum(
        shapely.Polygon(rings[0], rings[1:]).area
        for layer in work.laminate.tpe_layers
        for rings in layer.profile.polygons(1e-4)
    )
    what = next(what for name, what, _ in bill if name == "TPE film")
    stated = re.search(r"([\d.]+) cm² of parts in (\d+) layers", what)
    assert stated is not None
    assert float(stated[1]) == pytest.approx(area / 100, abs=0.051)
    assert int(stated[2]) == 2 * 30


def test_the_cut_list_counts_every_pattern(sheet_files: Any) -> None:
    work = work_of(sheet_files, "3dof-15mm", "order.copies=3")
    on_sheets: Counter[str] = Counter()
    for sheet in work.sheets:
        for _, pattern, count in sheet.counts:
            on_sheets[pattern] += count
    for row in cut_list(work):
        assert row.count * row.pieces == on_sheets[row.pattern]
    roles = Counter(layer.role for layer in work.laminate.layers)
    assert sum(row.count for row in cut_list(work)) == 3 * sum(roles.values())


def corners_of(use: Any, part: Region) -> tuple[float, float, float, float]:
    """Bounds on the page of a part that an SVG element draws through its matrix."""
    a, b, c, d, e, f = map(float, re.findall(r"-?[\d.]+", use.get("transform")))
    rings = [ring for piece in part.polygons(1e-3) for ring in piece]
    points = [(a * x + c * y + e, b * x + d * y + f) for ring in rings for x, y in ring]
    return shapely.MultiPoint(points).bounds


def test_the_map_shows_parts_where_the_nest_puts_them(sheet_files: Any) -> None:
    work = work_of(sheet_files, "3dof-15mm")
    figures = parsed(work).findall(".//div[@class='sheets']/figure")
    for sheet, figure in zip(work.sheets, figures, strict=True):
        placements = sheet.nest.on_sheet(sheet.number - 1)
        frame = max(figure.iter("rect"), key=lambda rect: float(rect.get("width")))
        left, top, wide, high = (float(frame.get(key)) for key in ("x", "y", "width", "height"))
        scale, foot = wide / sheet.width, top + high
        for use, placement in zip(figure.iter("use"), placements, strict=True):
            low_x, low_y, high_x, high_y = sheet.nest.region(placement).bounds
            assert corners_of(use, sheet.nest.parts[placement.part].region) == pytest.approx(
                (
                    left + scale * low_x,
                    foot - scale * high_y,
                    left + scale * high_x,
                    foot - scale * low_y,
                ),
                abs=2e-3,
            )


def warnings_of(work: Work) -> dict[str, str]:
    box = parsed(work).find(".//section[@class='warnings']")
    said: dict[str, str] = {}
    for item in box.iterfind(".//li"):
        title = words_of(item.find("b")).rstrip(":")
        said[title] = said.get(title, "") + words_of(item)
    return said


def test_warnings_are_all_there(sheet_files: Any) -> None:
    finding = Finding("film-limits", "warn", 1.0, 2.0, "mm", Place(), "too near the limit")
    waived = Finding("bond-width", "waived", 0.75, 0.5, "mm", Place(), "too narrow", by_user=True)
    said = warnings_of(
        work_of(
            sheet_files,
            "1dof-5mm",
            "stack.balloons=21",
            findings=[finding, waived],
            waived=("bond-width",),
            kerf={"TPE": None, "PTFE": 0.12},
        )
    )
    assert "COF2" in said["PTFE fumes"]
    assert "calibration piece" in said["TPE kerf uncalibrated"]
    assert "PTFE kerf uncalibrated" not in said
    # What the rules warn of is the designer's, on a page of its own.
    assert "1 rule warns. findings.html" in said["For the designer"]
    assert not any("too near the limit" in words for words in said.values())
    assert "bond-width" in said["Waived rules"]
    assert "findings.html" in said["Waived rules"]
    assert "21 balloons are more than the 20 validated" in said["Press schedule"]


def test_kerf_is_told_by_material_and_axis(sheet_files: Any) -> None:
    kerf = {"TPE": (0.1, 0.14), "PTFE": 0.12}
    page = page_of(work_of(sheet_files, "1dof-5mm", kerf=kerf))
    assert "compensated for 0.1 mm along x, 0.14 mm along y" in page
    assert "compensated for 0.12 mm" in page
    assert "uncalibrated" not in page


def test_times_add_up_to_the_papers(sheet_files: Any) -> None:
    section = parsed(work_of(sheet_files, "3dof-15mm")).get_element_by_id("times").getparent()
    rows = {words_of(row[0]): words_of(row[1]) for row in section.findall(".//tbody/tr")}
    assert rows["In the press"] == "45 min"
    assert rows["Handling"] == "60 min"
    assert rows["The paper"] == "105 min = 1.75 h"
    # A steel plate of 6 mm from 135 to 40 C in air of 20 C, four times: 3.8 MJ/(m3 K), and 10
    # W/(m2 K) off each face.
    cooled = 4 * 3.8e6 * 0.006 / 20 * math.log(115 / 20) / 60
    assert float(rows["Cooling the plate"].split()[0]) == pytest.approx(cooled, abs=0.6)
    warmed = 4 * 3.8e6 * 0.006 / 500 * math.log(115 / 5) / 60
    assert float(rows["Warming the plate"].split()[0]) == pytest.approx(warmed, abs=0.3)
    hours = (105 + cooled + warmed) / 60
    tested = float(rows["Tests"].split()[0]) / 60
    assert float(rows["Total, one actuator"].split()[0]) == pytest.approx(
        hours + 24 + tested, abs=0.06
    )
    basis = next(
        words_of(row[2])
        for row in section.findall(".//tbody/tr")
        if words_of(row[0]) == "Total, one actuator"
    )
    assert basis.startswith(f"{hours:.1f} h until its tubes are glued, 24 h for the adhesive, ")


def test_every_file_has_its_size_where_it_is_cut(sheet_files: Any) -> None:
    work = work_of(sheet_files, "3dof-15mm")
    cut = words_of(parsed(work).get_element_by_id("cut").getparent())
    assert "check its size, all selected, before you cut" in cut
    for sheet in work.sheets:
        assert f"{sheet.path}: {sheet.material}, 152.4 {TIMES} 152.4 mm" in cut


def test_without_sheets_the_layer_files_are_named(sheet_files: Any) -> None:
    work = work_of(sheet_files, "1dof-5mm")
    none: list[SheetFile] = []
    assert "cut every file in <code>layers/</code>" in page_of(replace(work, sheets=none))


def test_ears_are_trimmed_and_tubes_wrapped(sheet_files: Any) -> None:
    ears = page_of(work_of(sheet_files, "1dof-5mm", 'registration.method="ears"'))
    plain = page_of(work_of(sheet_files, "1dof-5mm"))
    radial = page_of(work_of(sheet_files, "radial-15mm"))
    assert "Snip off every ear" in ears
    assert "Snip off every ear" not in plain
    assert "Wrap the sheet round its tube, outer diameter 15 mm" in radial
    assert "Wrap the sheet" not in plain
    assert "Glue: 3M 1587" in radial
    other = page_of(work_of(sheet_files, "radial-15mm", 'tube.glue="Sil-Poxy"'))
    assert other.count("Sil-Poxy") == 2
    for page in (ears, plain, radial):
        assert "Snip the strip off flush with the tab" in page
