"""traveller.html: what is counted, drawn and timed on it; its words are in approved/."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import shapely
from lxml import html as lxml_html

from sbafab.cutting.cut_settings import COLOURS, CUT_SEQUENCE, REFERENCE
from sbafab.design.records import keys_of
from sbafab.design.sections import Acceptance
from sbafab.folders.build import make_build
from sbafab.geometry.region import Region
from sbafab.lab.recording import entries_of
from sbafab.reports.traveller import formatting
from sbafab.reports.traveller.bench import cutting, held_films
from sbafab.reports.traveller.findings import findings_html, other_hands
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS
from sbafab.reports.traveller.work import HANDLING_MINUTES, cut_list, release_films, times
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding, Place
from tests.quick import few
from tests.reports.pages import EARS, TPU, bench, built, page, words_of, work_of

DESIGNS = [
    ("3dof-15mm",),
    ("radial-15mm", "stack.balloons=3", EARS),
    ("1dof-5mm", "stack.balloons=1"),
    ("1dof-10mm", "stack.balloons=8", "chamber.diameter=[10,9.5,9,8.5,8,7.5,7,6.5]"),
]


@pytest.mark.parametrize("given", few(DESIGNS, 3), ids=" ".join)
def test_every_layer_is_laid_once_and_in_order_within_its_step(
    sheet_files: Any, given: tuple[str, ...]
) -> None:
    work = work_of(*given, sheets=sheet_files)
    laid: list[int] = []
    for step in page(work).findall(".//article"):
        items = step.iterfind(".//li[@data-layers]")
        here = [int(n) for li in items for n in li.get("data-layers").split()]
        assert here == sorted(here)
        laid += here
    assert sorted(laid) == [layer.index for layer in work.laminate.layers]


@pytest.mark.parametrize("given", few(DESIGNS, 3), ids=" ".join)
def test_the_page_is_whole_in_itself(sheet_files: Any, given: tuple[str, ...]) -> None:
    text = traveller_html(work_of(*given, sheets=sheet_files, solid_png=b"\x89PNG"))
    tree = lxml_html.fromstring(text)
    ids = [node.get("id") for node in tree.iter() if node.get("id")]
    assert [name for name, count in Counter(ids).items() if count > 1] == []
    linking = ("href", "xlink:href", "src", "srcset", "action", "data", "aria-labelledby")
    links = [v for node in tree.iter() for name, v in node.attrib.items() if name in linking]
    assert links
    for link in links:
        assert link.startswith("data:image/png;base64,") or link.removeprefix("#") in ids
    assert set(re.findall(r"url\((.)", text)) == {"#"}
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(ids)
    assert "http" not in text
    assert "@import" not in text


def test_dials_are_the_papers() -> None:
    assert formatting.temperature(135.0) == "135 °C (275 °F)"
    assert formatting.force(110.0 * 152.4**2 / 1000) == "2555 N = 2.555 kN = 574 lbf"
    # 1 psi is the weight of 0.45359237 kg on a square inch.
    psi = 0.45359237 * 9.80665 / 0.0254**2 / 1000
    assert formatting.pressure(110.0) == f"110 kPa ({110 / psi:.1f} psi)"


def test_words_from_outside_stay_words(sheet_files: Any) -> None:
    hostile = '"><script>alert(1)</script>&amp;{{ 7*7 }}</style>'
    finding = Finding(
        "bond-width", "waived", 1.0, 1.0, "mm", Place(), hostile, waived_by="the design"
    )
    order = (f"order.made_for={json.dumps(hostile)}", f"order.note={json.dumps(hostile)}")
    work = work_of("1dof-5mm", *order, sheets=sheet_files, findings=[finding])
    named = replace(work.laminate, name=hostile)
    sheets = [replace(sheet, path=hostile, counts=((hostile, "P01", 1),)) for sheet in work.sheets]
    text = traveller_html(replace(work, laminate=named, sheets=sheets))
    tree = lxml_html.fromstring(text)
    assert len(tree.findall(".//script")) == 1
    assert len(tree.findall(".//style")) == 1
    assert words_of(tree.find(".//h1")) == hostile
    assert text.count("alert(1)") == text.count("&gt;alert(1)")


PRINTS = """
import hashlib
from sbafab.reports.traveller.page import traveller_html
from tests.reports.pages import work_of
print(hashlib.sha256(traveller_html(work_of("3dof-15mm")).encode()).hexdigest())
"""


def test_the_same_design_gives_the_same_bytes() -> None:
    root = Path(__file__).parents[2]
    printed = {
        subprocess.run(
            [sys.executable, "-c", PRINTS],
            cwd=root,
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(root)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(printed) == 1


def test_the_cut_list_counts_every_pattern(sheet_files: Any) -> None:
    work = work_of("3dof-15mm", "order.copies=3", sheets=sheet_files)
    on_sheets: Counter[str] = Counter()
    for sheet in work.sheets:
        for _, pattern, count in sheet.counts:
            on_sheets[pattern] += count
    for row in cut_list(work):
        assert row["parts"] * row["pieces"] == on_sheets[row["pattern"]]
    assert sum(row["parts"] for row in cut_list(work)) == 3 * len(work.laminate.layers)
    # Two spares of two patterns, each in three pieces.
    more = {"P02": 6, "P06": 6}
    sheets = [
        replace(sheet, counts=tuple((d, p, n + more.get(p, 0)) for d, p, n in sheet.counts))
        for sheet in work.sheets
    ]
    spares = {row["pattern"]: row["spares"] for row in cut_list(replace(work, sheets=sheets))}
    assert {pattern: n for pattern, n in spares.items() if n} == {"P02": 2, "P06": 2}


def test_times_add_up_to_the_papers() -> None:
    """A steel plate of 6 mm from 135 to 40 C in air of 20 C, four times: 3.8 MJ/(m3 K), and 10
    W/(m2 K) off each face; 500 W/(m2 K) from a platen. The paper's 105 min are handling and press.
    """
    work = work_of("3dof-15mm")
    assert (work.schedule.total_press_minutes or 0) + HANDLING_MINUTES == 105
    cooled = 3.8e6 * 0.006 / 20 * math.log(115 / 20) / 60
    warmed = 3.8e6 * 0.006 / 500 * math.log(115 / 5) / 60
    found = times(work)
    assert found.cool == pytest.approx(cooled, abs=0.15)
    assert found.warm == pytest.approx(warmed, abs=0.08)
    assert found.worked == pytest.approx(105 + 4 * (cooled + warmed), abs=1)
    # Three tubes: twice the leak test and once the proof test of 60 s each, and 2 min to connect.
    held = (2 * Acceptance().leak_seconds + Acceptance().proof_seconds) / 60
    assert found.test == pytest.approx(3 * (held + 2))
    assert found.total == found.worked + 24 * 60 + found.test
    # Of a film whose minutes nobody stated the rest is counted.
    other = times(work_of("3dof-15mm", *TPU))
    assert other.worked == pytest.approx(HANDLING_MINUTES + 4 * (other.warm + other.cool))


def test_pieces_that_come_off_the_sheet() -> None:
    # 15 masks in three pieces, on 15 storeys; one spare of either pattern.
    tip = cutting([work_of("3dof-15mm")])
    assert (tip["loose"], tip["spare"]) == (45, 6)
    # One part and one spare, of 21.3 cm2 of LDPE, 0.1 mm thick, 0.92 mg/mm3; each half weighs 98.
    [folded] = held_films([work_of("folded")])
    assert (folded["parts"], round(folded["lightest"] or 0)) == (2, 197)
    # A separator of 1dof-5mm: a disc of 5 + 2 x 0.75 + 2 x 0.5 mm less its bore, 0.025 thick.
    disc = math.pi / 4 * 5**2 * 0.025 * 2200 / 1000
    [mask] = [held for held in held_films([work_of("1dof-5mm")]) if held["film"].is_mask]
    assert 0.9 * disc < (mask["lightest"] or 0) < 2 * disc


def test_narrow_holes_are_tried_on_their_pins_before_the_press() -> None:
    """1.04 less twice 0.104 is 0.832; a pin of 1 mm m6 has up to 1.008: 21 %. In step 3 a chamber's
    pin has 27 walls and 14 masks.
    """
    work = work_of("3dof-15mm")
    tight = [one for one in run_deck(work.laminate, work.design) if one.rule == "pin-fit"]
    stretch, allowed, _, films = cutting([replace(work, findings=tight)])["tight_pin"]
    assert stretch == pytest.approx(1.008 / 0.832 - 1, abs=0.005)
    assert (allowed, films) == (pytest.approx(0.3), 41)


def test_every_blank_of_the_record_page_can_be_entered() -> None:
    """The page has a blank for each field, in one order, and a line for each name of a field is
    read as it stands on paper.
    """
    work = work_of("3dof-15mm")
    [section] = page(work).xpath("//section[@aria-labelledby='record']")
    order = [field.label for field in HISTORY_FIELDS]
    assert [words_of(label) for label in section.xpath(".//label")] == order[:2]
    heads = [[words_of(cell) for cell in row] for row in section.xpath(".//thead/tr")]
    assert {label for row in heads for label in row} == set(order[2:])
    assert all(row == sorted(row, key=order.index) for row in heads)
    samples = {"date": "2026-05-04", "expires": "2027-01-31", "decision": "rework"}
    values = {
        field.name: samples.get(field.name, "12" if ", " in field.label else "text")
        for field in HISTORY_FIELDS
        if field.name != "kerf_mm"
    }
    [entry] = entries_of(values)
    assert entry.readings == {"temperature_c": 12.0, "press_force_n": 12.0, "minutes": 12.0}
    assert (entry.item, entry.lot, entry.reason, entry.photograph) == ("text",) * 4


@pytest.mark.parametrize("program", [None, "rdworks", "epilog"])
def test_layers_of_the_laser_program_are_those_of_the_files(program: str | None) -> None:
    tree = bench(work_of("1dof-5mm", *([f"sheets.program={program}"] if program else [])))
    rows = tree.get_element_by_id("laser").getparent().findall(".//tbody/tr")
    cells = [[words_of(cell) for cell in row] for row in rows]
    assert [row[1] for row in cells] == [*CUT_SEQUENCE, REFERENCE]
    colours = [int(re.findall(r"\d+", row[2])[0]) for row in cells]
    assert colours == [COLOURS[row[1]] for row in cells]


def corners_of(use: Any, part: Region) -> tuple[float, float, float, float]:
    """Bounds on the page of a part that an SVG element draws through its matrix."""
    a, b, c, d, e, f = map(float, re.findall(r"-?[\d.]+", use.get("transform")))
    rings = [ring for piece in part.polygons(1e-3) for ring in piece]
    points = [(a * x + c * y + e, b * x + d * y + f) for ring in rings for x, y in ring]
    return shapely.MultiPoint(points).bounds


def test_the_map_shows_parts_where_the_nest_puts_them(sheet_files: Any) -> None:
    work = work_of("3dof-15mm", sheets=sheet_files)
    figures = page(work).findall(".//div[@class='sheets']/figure")
    for sheet, figure in zip(work.sheets, figures, strict=True):
        placements = sheet.nest.on_sheet(sheet.number - 1)
        frame = max(figure.iter("rect"), key=lambda rect: float(rect.get("width")))
        left, top, wide, high = (float(frame.get(key)) for key in ("x", "y", "width", "height"))
        scale, foot = wide / sheet.width, top + high
        for use, placement in zip(figure.iter("use"), placements, strict=True):
            low_x, low_y, high_x, high_y = sheet.nest.region(placement).bounds
            x0, x1, y0, y1 = (scale * value for value in (low_x, high_x, low_y, high_y))
            assert corners_of(use, sheet.nest.parts[placement.part].region) == pytest.approx(
                (left + x0, foot - y1, left + x1, foot - y0), abs=2e-3
            )


@pytest.mark.parametrize(("copies", "cycles"), [(1, 1), (3, 1), (9, 3)])
def test_release_films_count_every_press_cycle(copies: int, cycles: int) -> None:
    """Two new ones each time the press closes, one below what is turned over."""
    work = work_of("1dof-5mm", f"order.copies={copies}", "order.at_once=4")
    assert work.cycles.count == cycles
    assert release_films(work) == 2 * cycles * len(work.schedule.steps) + 1


@pytest.mark.parametrize(
    "design",
    few([("1dof-5mm", *TPU, EARS, "order.copies=5"), ("folded",), ("gripper",)], 2),
    ids=" ".join,
)
def test_keys_of_a_design_file_are_not_for_the_bench(design: tuple[str, ...]) -> None:
    """They are the designer's; commands may have them, and stand as code."""
    work = work_of(*design)
    keys = {key for key, *_ in keys_of(work.design) if "." in key}
    assert {"press.time_constant", "press.minutes_for", "registration.pin_lengths"} <= keys
    for tree in (page(work), bench(work)):
        for code in tree.xpath("//code | //style | //script"):
            code.drop_tree()
        words = words_of(tree)
        assert [key for key in sorted(keys) if re.search(rf"(?<![\w.]){key}\b", words)] == []


# findings.html: what the rules found, and how the hand tells, for whoever designs.


def test_a_rougher_hand_has_fewer_good_builds() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=2")
    hands = other_hands(laminate, design)
    assert [hand.placement for hand in hands] == [0.04, 0.12, 0.16, 0.2]
    assert all(one.share > other.share for one, other in pairwise(hands))
    # What warns stands before what holds; no pin is offered that could not be had out again.
    text = findings_html(design.name, "0" * 64, [make_build(design)])
    assert text.index("<td>warn</td>") < text.index("Remedies") < text.index("<td>pass</td>")
    assert "lumen" not in text[text.index("Remedies") : text.index("Passes")]


def test_with_ears_no_hand_decides() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=2", EARS)
    assert other_hands(laminate, design) == ()


def test_words_from_outside_stay_words_among_findings() -> None:
    hostile = "<script>alert(1)</script>"
    found = Finding("bond-width", "warn", 1.0, None, "mm", Place(), hostile)
    text = findings_html(hostile, "0" * 64, [], [found])
    assert text.count("alert(1)") == text.count("&gt;alert(1)")
