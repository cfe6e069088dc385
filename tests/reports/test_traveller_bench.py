"""traveller.html at the bench: what a technician could not do with it before."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest
import shapely
from lxml import html as lxml_html

from sbafab.cutting.sheets import SheetFile
from sbafab.laminate.films import Film
from sbafab.nesting.records import Nest
from sbafab.pressing.cycles import design_runs
from sbafab.pressing.schedule import schedule
from sbafab.reports.drawing import TIMES
from sbafab.reports.traveller.bench import bench_html
from sbafab.reports.traveller.bill import cut_list
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.traveller.sheet_map import sheet_map
from sbafab.rules.deck import run_deck
from tests.reports.bench_pages import EARS, SHA, bench, built, page, words_of

TPE, PTFE, BOND, OVERHANG = 0.038, 0.025, 0.75, 0.5


def film_of(sheet: SheetFile) -> Film:
    films = built("1dof-5mm")[0].films.stock
    return films[sheet.material.lower()]


def steps(tree: Any) -> list[str]:
    return [words_of(step) for step in tree.findall(".//article")]


def lay_up(tree: Any) -> dict[str, str]:
    """Pins by pattern, as the lay-up table has them."""
    rows = tree.get_element_by_id("lay-up").getparent().findall(".//tbody/tr")
    cells = [[words_of(cell) for cell in row][-6:] for row in rows]
    return {row[1]: row[-1] for row in cells}


def test_a_pin_counts_only_in_the_step_that_adds_the_layer(sheet_files: Any) -> None:
    held = lay_up(page(sheet_files, "3dof-15mm"))
    # Base and cap have the lumen, and join in steps without pins.
    assert held["P01"] == held["P07"] == "none (by hand)"
    assert held["P04"] == "lumen"
    assert held["P05"] == "chamber1, chamber2, chamber3 and lumen"
    with_ears = lay_up(page(sheet_files, "3dof-15mm", 'registration.method="ears"'))
    assert with_ears["P01"] == with_ears["P07"] == "film1 and film2"


def test_minutes_of_another_temperature_are_not_pressed_without_a_word(sheet_files: Any) -> None:
    words = "minutes stated for 135 C, the press is set to 150 C"
    assert words in words_of(page(sheet_files, "1dof-5mm", "press.temperature_c=150"))
    assert "stated for 135 C" not in words_of(page(sheet_files, "1dof-5mm"))


@pytest.mark.parametrize("template", ["1dof-5mm", "3dof-15mm", "radial-15mm"])
def test_what_the_force_means_is_said(template: str) -> None:
    words = words_of(bench(template))
    _, laminate = built(template)
    top = sum(
        shapely.Polygon(rings[0], rings[1:]).area
        for rings in laminate.layers[-1].profile.polygons(1e-4)
    )
    assert "2555 N is 110 kPa on the whole platen of 152.4" in words
    assert "What the paper laid between platen and films is not known" in words
    found = re.search(r"laminate alone: ([\d.]+) MPa on the (\d+) mm²", words)
    assert found is not None
    assert float(found[2]) == pytest.approx(top, abs=0.51)
    assert float(found[1]) == pytest.approx(110e-3 * 152.4**2 / top, abs=0.051)


def test_pins_stand_over_the_stack_by_their_chamfer_at_least(sheet_files: Any) -> None:
    tree = page(sheet_files, "3dof-15mm")
    first, second, third, fourth = steps(tree)
    depths = {row[1]: row[2] for row in hole_rows(bench("3dof-15mm"))}
    for step, stack in ((first, TPE + PTFE), (third, 27 * TPE + 28 * PTFE)):
        pins = re.findall(
            rf"⌀(\d) {TIMES} (\d) mm, ([\d.]+) mm in the plate, ([\d.]+) to ([\d.]+) mm over it, "
            r"([\d.]+) mm or more over the stack",
            step,
        )
        # Chamfers of ISO 8734: 0.2 at a diameter of 1, 0.35 at 2.
        assert [pin[0] for pin in pins] == ["1", "2"]
        for (size, *values), chamfer in zip(pins, (0.2, 0.35), strict=True):
            length, seat, low, high, over = map(float, values)
            assert depths[size] == f"{seat:g} ± 0.05"
            # A pin's length is good to 0.25, its hole's depth to 0.05.
            assert (low, high) == pytest.approx((length - seat - 0.3, length - seat + 0.3))
            # The stack lies on a release film of 0.05 mm, which the pins are pricked through.
            assert over == pytest.approx(low - 0.05 - stack, abs=0.0051)
            assert over >= chamfer
    for without in (second, fourth):
        assert "over the stack" not in without
    for step in (first, second, third, fourth):
        assert step.count("Cover and close the press") == 1
    cover = "press pad, flush with the platen all round. No second plate on top."
    assert words_of(tree).count(cover) == 1


def hole_rows(tree: Any) -> list[list[str]]:
    [table] = [t for t in tree.iter("table") if t.get("class") == "holes"]
    return [[words_of(cell) for cell in row] for row in table.findall(".//tbody/tr")]


def test_the_plate_says_how_its_holes_are_made_and_how_true() -> None:
    said = words_of(bench("3dof-15mm"))
    assert "on that shoulder the pin stands" in said
    assert "lap it to its own pins" in said
    assert (
        "within 0.003 mm of its place in the table, in any direction: which takes a jig borer"
        in said
    )
    assert "The rules count 0.004 mm for both" in said
    mill = 'registration.plate_made_by="cnc-mill"'
    said = words_of(bench("3dof-15mm", mill))
    assert "Ream it H7" in said
    assert "within 0.025 mm of its place" in said
    # 0.025 and half of H7's largest play with m6, 0.008.
    assert "up to 0.008 mm of play in its hole. The rules count 0.029 mm for both" in said
    # One pin alone may stand where it will.
    said = words_of(bench("1dof-5mm"))
    assert "a drill press is good enough, marked out to 0.2 mm. The rules count 0.004 mm" in said


def test_films_pins_and_paper_come_off_in_order(sheet_files: Any) -> None:
    for template in ("1dof-5mm", "3dof-15mm", "radial-15mm"):
        tree = page(sheet_files, template)
        whole = words_of(tree.get_element_by_id("press").getparent())
        order = [
            "Pad off first",
            "Upper release film: hold the films down with a fingertip",
            "punch pushes each pin down through its push-out hole",
            "Hold the films down on both sides of it with flat tweezers",
            "Slide the lower release film off the plate",
        ]
        if template == "radial-15mm":
            del order[2:4]
        places = [whole.index(words) for words in order]
        assert places == sorted(places)
        assert len(tree.findall(".//ol/li")) >= len(order)
        for step in steps(tree):
            parts = ["close the press", "Pad off", "upper release film off"]
            if "or more over the stack" in step:
                parts += ["push the pins out of their seats (3)", "draw the pins (4)"]
            parts += ["Lower release film off", "You now hold"]
            places = [step.index(words) for words in parts]
            assert places == sorted(places)
            # A print comes out with the step in which it lay.
            assert ("underlay off the plate" in step) == ("Tape a fresh print" in step)
        drawn = [svg.get("aria-label", "") for svg in tree.iter("svg")]
        [picture] = [label for label in drawn if label.startswith("taking down")]
        assert ("pins drawn up" in picture) == (template != "radial-15mm")


def test_the_hole_table_has_every_pin_from_the_plates_corner() -> None:
    rows = hole_rows(bench("3dof-15mm"))
    _, laminate = built("3dof-15mm")
    assert [row[0] for row in rows] == [pin.name for pin in laminate.pins]
    for row, pin in zip(rows, laminate.pins, strict=True):
        assert float(row[6]) == pytest.approx(pin.centre[0], abs=6e-4)
        assert float(row[7]) == pytest.approx(pin.centre[1], abs=6e-4)
    # Both frames differ by one shift, and the plate's own lies in its front left corner.
    shifts = {
        (round(float(r[4]) - float(r[6]), 2), round(float(r[5]) - float(r[7]), 2)) for r in rows
    }
    assert len(shifts) == 1
    assert all(60 < value < 95 for value in shifts.pop())


def test_each_kind_of_build_up_is_drawn_once(sheet_files: Any) -> None:
    """With pins in steps 1 and 3, on the printed page in steps 2 and 4."""
    tree = page(sheet_files, "3dof-15mm")
    drawn = [svg for svg in tree.iter("svg") if "build-up" in svg.get("aria-label", "")]
    assert [words_of(svg.getnext()) for svg in drawn] == [
        "Build-up as in steps 1 and 3.",
        "Build-up as in steps 2 and 4.",
    ]
    for number, svg in enumerate(drawn, 1):
        assert svg.get("aria-label").startswith(f"build-up of step {number}: press pad 15 mm")
        words = words_of(svg)
        for part in ("upper platen", "press pad", "release film", "laminate", "base plate"):
            assert part in words
        assert ("underlay" in words) == (number == 2)


def test_a_mask_on_one_pin_is_turned_to_its_edge(sheet_files: Any) -> None:
    """Separators turn about the lumen alone; walls have four pins, masks of pockets are discs."""
    first, _, third, _ = steps(page(sheet_files, "3dof-15mm"))
    edge = f"turn by eye, its edge {OVERHANG:g} mm outside that of the TPE wall"
    assert f"One pin holds P04 in layer 4: {edge} above, all round." in third
    assert f"One pin holds P04 in layers 8, 12, 16 … 52: {edge} below, all round." in third
    assert f"Lay layer 56: PTFE separator mask P04. One pin holds P04: {edge} below" in third
    assert third.count("One pin holds") == 3
    # Each strip of the mask in pieces turns about the pin of its own chamber.
    strips = f"each edge {BOND:g} mm inside that of the TPE wall above, all round but for the tabs."
    assert f"One pin holds P02: turn by eye, {strips}" in first
    # With ears all have two pins at least.
    assert "One pin holds" not in words_of(page(sheet_files, "3dof-15mm", EARS))
    # On a plate's only pin the lowest gives the angle, and the wall is turned to it.
    one, *_ = steps(page(sheet_files, "1dof-5mm"))
    assert "One pin holds P02" not in one
    assert "One pin holds P03: turn by eye, its edge 0.75 mm outside that of the PTFE" in one


def test_without_pins_each_edge_is_laid_along_another(sheet_files: Any) -> None:
    _, second, _, fourth = steps(page(sheet_files, "3dof-15mm"))
    assert "edge (layer 3) on that of the TPE base below (layer 1), all round." in second
    outside = f"{OVERHANG:g} mm outside that of the TPE wall below (layer 3), all round but"
    assert f"Lay its edge (layer 4) {outside} for the tabs." in fourth
    inside = f"{OVERHANG:g} mm inside that of the PTFE separator mask below (layer 56), all round."
    assert f"Lay its edge on that of the TPE wall below (layer 57), {inside}" in fourth
    first, *_ = steps(page(sheet_files, "radial-15mm"))
    assert f"Lay each edge {BOND:g} mm outside that of the PTFE chamber mask below" in first


def test_every_piece_on_a_sheet_has_its_place(sheet_files: Any) -> None:
    tree = page(sheet_files, "radial-15mm")
    (table,) = tree.findall(".//table[@class='places']")
    rows = [[words_of(cell) for cell in row] for row in table.findall("./tbody/tr")]
    pitch = 15 * math.pi / 3
    assert f"pitch {pitch:.3f}" in steps(tree)[-1]
    expected = [
        (what, piece, (piece - 0.5) * pitch, out)
        for what, out in (
            ("layer 2, PTFE separator mask", OVERHANG),
            ("stack of layers 3, 4, 5", 0.0),
        )
        for piece in (1, 2, 3)
    ]
    assert [(row[0], int(row[1])) for row in rows] == [(e[0], e[1]) for e in expected]
    # 1 mm of sheet past the SBAs, which are 11.5 wide and 20 long.
    for row, (_, _, x, out) in zip(rows, expected, strict=True):
        told = [float(cell) for cell in row[2:]]
        assert told == pytest.approx([x, 11.0, x - 5.75 - out, 1.0 - out], abs=0.0051)
    assert "edge on edge" not in words_of(tree)
    for other in (("3dof-15mm",), ("radial-15mm", 'registration.method="ears"')):
        assert page(sheet_files, *other).findall(".//table[@class='places']") == []


def test_several_stacks_are_not_one(sheet_files: Any) -> None:
    tree = page(sheet_files, "radial-15mm")
    first, second, third = steps(tree)
    assert "Bottom balloons, upper two layers of each" in first
    assert "the 3 stacks lie flat" in first
    assert "You now hold the 3 stacks from step 1" in first
    assert "Lay the 3 stacks from step 1" in second
    assert "the stack lies flat" in third
    assert "the stack from" not in first + second + third
    facts = tree.find(".//dl[@class='facts']")
    told = dict(zip(map(words_of, facts[::2]), map(words_of, facts[1::2]), strict=True))
    assert told["Balloons"] == "3 stacks of 1 balloon"
    whole = words_of(page(sheet_files, "3dof-15mm"))
    assert "stacks" not in whole
    joined = page(sheet_files, "radial-15mm", "inlet.manifold=true")
    assert "Bottom balloon, upper two layers" in steps(joined)[0]


def test_the_legend_names_the_cross_only_where_it_is_seen(sheet_files: Any) -> None:
    for template, pin in (("3dof-15mm", "lumen"), ("1dof-5mm", "chamber1")):
        plans = [step.findall(".//svg")[0] for step in page(sheet_files, template).iter("article")]
        said = [words_of(plan) for plan in plans]
        assert [f"middle of pin {pin}" in words for words in said] == [True, False] * 2
        assert ["+ datum" in words for words in said] == [False, True] * 2
    eared = page(sheet_files, "1dof-5mm", "stack.balloons=1", EARS)
    assert all("+ datum" in step for step in steps(eared))


def test_a_single_chamber_has_no_others(sheet_files: Any) -> None:
    one, three = (words_of(page(sheet_files, name)) for name in ("1dof-5mm", "3dof-15mm"))
    assert "raise the chamber slowly" in one
    assert "raise the chamber in 10 s to 150 kPa, hold for 60 s (" in one
    assert "each chamber" not in one
    assert "raise each chamber in 10 s to 150 kPa, hold for 60 s, the other chambers open" in three


def test_paper_counts_in_pin_heights_only_where_it_lies_below_pins(sheet_files: Any) -> None:
    """Step 3 of a single stack has pins in it and paper; of a tip no step has both."""
    one, three = (words_of(page(sheet_files, name)) for name in ("1dof-5mm", "3dof-15mm"))
    allowed = "0.1 mm of paper as large as the plate, which the pin heights allow for"
    assert allowed in one
    assert allowed not in three
    assert "pricks release film and underlay over the pins" in words_of(bench("1dof-5mm"))
    assert "pricks the release film over the pins" in words_of(bench("3dof-15mm"))
    assert "The print shows the edges of P04: lay by eye along them what no pin holds" in one


def test_what_good_hands_know_stands_where_it_happens(sheet_files: Any) -> None:
    tree = page(sheet_files, "3dof-15mm")
    cut = words_of(tree.get_element_by_id("cut").getparent())
    assert cut.index("lint-free") < cut.index("smooth card") < cut.index("sheets/TPE_1.dxf: TPE")
    assert cut.index("sheets/PTFE_1.dxf: PTFE") < cut.index("Wipe the soot")
    # 15 masks in three pieces, on 15 storeys.
    # One spare of either pattern, each kind at least one.
    assert "45 loose mask pieces and 6 spare: pick them up with antistatic tweezers" in cut
    first, second, third, fourth = steps(tree)
    for step, minutes in ((first, 3), (second, 12), (third, 10), (fourth, 20)):
        # One line says when the time begins, and nothing else on the page says otherwise.
        words = f"Start the clock, {minutes} min, only when the plate's edge reads 130 °C"
        assert words in step
        assert step.count("Start the clock") == 1
        assert step.index("Base plate down, cold") < step.index("close the press")
    press = words_of(tree.get_element_by_id("press").getparent())
    assert "Lay up on the plate while it is cold" in press
    assert (
        "Has a mask slipped? Lift what lies over it with tweezers, push it down on its pin" in press
    )
    # The masks of three stacks on a sheet have no pins.
    radial = words_of(page(sheet_files, "radial-15mm").get_element_by_id("press").getparent())
    assert "push it to its edge" in radial
    # Without a pin nothing is laid on one: it could not be had out from under loose films.
    for step in (second, fourth):
        assert "lumen" not in step
    # A tacked stack that is laid down again by itself is aligned with nothing.
    for step in steps(page(sheet_files, "1dof-5mm", "stack.balloons=1", EARS)):
        if "no pins in it" in step:
            assert "lay them by eye" not in step


def test_the_underlay_is_laid_where_it_has_a_line(sheet_files: Any) -> None:
    design, laminate = built("1dof-5mm")
    plan = schedule(laminate, design)
    job = Job(SHA, "sbafab 1.0.0", underlay="underlay.pdf")
    tree = lxml_html.fromstring(traveller_html(Work(design, laminate, plan, [], job)))
    told = [re.search(r"The print shows the edges of ([^.:]*)[.:]", step) for step in steps(tree)]
    assert [found and found[1] for found in told] == [
        None,
        "P01 and P03",
        "P04",
        "P01, P03, P04 and P07",
    ]
    assert "pricked at its grey rings over the pins" in steps(tree)[2]
    assert "underlay" not in words_of(page(sheet_files, "1dof-5mm", EARS))
    whole = words_of(tree)
    # Three steps, one copy: three prints. Tape, trim line and toner are said.
    assert "A fresh print for each of 3 closings" in whole
    assert "polyimide tape (silicone adhesive, rated 260 °C)" in whole
    assert "is cut out along its dotted line" in whole
    assert "Toner on the underlay: laser toner softens in the press" in whole


def test_spares_are_told_beside_what_is_needed(sheet_files: Any) -> None:
    design, laminate = built("3dof-15mm")
    plan = schedule(laminate, design)
    more = {"P02": 6, "P06": 6}
    sheets = [
        replace(
            sheet,
            counts=tuple(
                (name, pattern, n + more.get(pattern, 0)) for name, pattern, n in sheet.counts
            ),
        )
        for sheet in sheet_files(laminate)
    ]
    job = Job(SHA, "sbafab 1.0.0")
    work = Work(design, laminate, plan, sheets, job)
    assert {row.pattern: row.spares for row in cut_list(work) if row.spares} == {"P02": 2, "P06": 2}
    assert "14 + 2 spare" in words_of(lxml_html.fromstring(traveller_html(work)))


def test_the_cover_says_what_its_colours_are(sheet_files: Any) -> None:
    design, laminate = built("1dof-5mm")
    plan = schedule(laminate, design)
    job = Job(SHA, "sbafab 1.0.0", solid_png=b"\x89PNG")
    tree = lxml_html.fromstring(traveller_html(Work(design, laminate, plan, [], job)))
    keys = [words_of(key) for key in tree.findall(".//span[@class='key']")]
    assert keys == ["TPE", "film, cut", "bond, cut", "open gap"]


def boxes(svg: Any) -> list[Any]:
    """What the labels of a picture cover, by Helvetica's widest letters in them: 0.667 em."""
    found = []
    for text in svg.iter("text"):
        x, y, size = (float(text.get(key)) for key in ("x", "y", "font-size"))
        half = size * sum(0.278 if c in " .-" else 0.56 for c in text.text) / 2
        found.append(shapely.box(x - half, y - 0.7 * size, x + half, y))
    return found


def test_labels_do_not_lie_over_each_other_or_windows(sheet_files: Any) -> None:
    _, laminate = built("radial-15mm")
    for template in ("1dof-5mm", "3dof-15mm", "radial-15mm"):
        for sheet in sheet_files(built(template)[1]):
            # Two designs on a sheet: every label begins with the design's name.
            for marks in ({template: ""}, {template: "B"}):
                svg = lxml_html.fromstring(sheet_map(sheet, film_of(sheet), marks, "sheet-1"))
                covered = boxes(svg)
                assert len(covered) > 4
                for i, box in enumerate(covered):
                    assert all(box.intersection(other).area < 0.05 for other in covered[:i])
    masks = [sheet for sheet in sheet_files(laminate) if sheet.material == "PTFE"]
    for sheet in masks:
        svg = lxml_html.fromstring(sheet_map(sheet, film_of(sheet), {"radial-15mm": ""}, "sheet-1"))
        frame = max(svg.iter("rect"), key=lambda rect: float(rect.get("width")))
        scale = float(frame.get("width")) / sheet.width
        foot = float(frame.get("y")) + float(frame.get("height"))
        for placement in sheet.nest.on_sheet(sheet.number - 1):
            for hole in sheet.nest.region(placement).holes:
                points = [(0.5 + scale * x, foot - scale * y) for x, y in hole.polygon()]
                window = shapely.Polygon(points)
                hidden = sum(box.intersection(window).area for box in boxes(svg))
                assert hidden < 0.2 * window.area


def test_a_long_sheet_is_drawn_in_rows_across_the_page(sheet_files: Any) -> None:
    _, laminate = built("1dof-5mm")
    sheet = sheet_files(laminate)[0]
    nest = sheet.nest
    stock = nest.stock.model_copy(update={"width": 60.0, "length": 900.0, "roll": True, "pins": ()})
    part = nest.parts[0]
    low_x, low_y, high_x, high_y = part.region.bounds
    step = high_y - low_y + 1
    places = tuple(
        replace(nest.placements[0], part=0, turn=0, sheet=0, shift=(20 - low_x, 10 - low_y + y))
        for y in (step * i for i in range(70))
    )
    long = replace(sheet, width=60.0, length=581.0, nest=Nest("TPE", stock, nest.parts, places))
    svg = lxml_html.fromstring(sheet_map(long, film_of(long), {"1dof-5mm": ""}, "sheet-1"))
    rows = svg.findall(".//svg")
    sizes = [(float(row.get("width")), float(row.get("height"))) for row in rows]
    across, high = sizes[0]
    scale = high / 60
    assert scale > 84 / 152.4
    assert sum(size[0] for size in sizes) == pytest.approx(581 * scale)
    assert across <= 186
    # Every part is in a row, the first at the left end, its lower side to the left.
    assert sum(len(row.findall(".//use")) for row in rows) >= 70
    first = rows[0].find(".//use")
    a, b, c, d, e, f = map(float, re.findall(r"-?[\d.]+", first.get("transform")))
    points = [p for ring in part.region.polygons(1e-3)[0] for p in ring]
    moved = shapely.MultiPoint([(a * x + c * y + e, b * x + d * y + f) for x, y in points])
    assert moved.bounds == pytest.approx(
        (
            0.5 + 10 * scale,
            0.5 + 20 * scale,
            0.5 + (10 + high_y - low_y) * scale,
            0.5 + (20 + high_x - low_x) * scale,
        ),
        abs=0.01,
    )
    # Turned, not mirrored: the page's y points down, so the determinant stays negative.
    assert a * d - b * c < 0


def test_narrow_holes_are_tried_on_their_pins_before_the_press(sheet_files: Any) -> None:
    design, laminate = built("3dof-15mm")
    plan = schedule(laminate, design)
    tight = [finding for finding in run_deck(laminate, design) if finding.rule == "pin-fit"]
    job = Job(SHA, "sbafab 1.0.0", findings=tuple(tight))
    sheets = sheet_files(laminate)
    tree = lxml_html.fromstring(traveller_html(Work(design, laminate, plan, sheets, job)))
    cut = words_of(tree.get_element_by_id("cut").getparent())
    # 1.04 less twice 0.104 is 0.832; a pin of 1 mm m6 has up to 1.008: 21 %. In step 3 a chamber's
    # pin has 27 walls and 14 masks.
    assert "a film must stretch by 21% over its pin (30% is allowed; nobody has tried it)" in cut
    assert "up to 41 films go on one pin" in cut
    assert cut.index("Wipe the soot") < cut.index("Try one part of every pattern on its pins")


def test_tubes_and_leaks_are_those_of_every_copy() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=1", "order.copies=3")
    plan = schedule(laminate, design)
    tree = lxml_html.fromstring(
        traveller_html(Work(design, laminate, plan, [], Job(SHA, "sbafab 1.0.0")))
    )
    for part in ("tubes", "leak"):
        section = tree.get_element_by_id(part).getparent()
        assert "of all 3 copies, one after the other" in words_of(section)
        first = section.xpath(".//ul[@class='ticks']/li")[0]
        assert len(first.xpath(".//input[@type='checkbox']")) == 3
    alone = traveller_html(
        Work(design.with_("order.copies=1"), laminate, plan, [], Job(SHA, "sbafab 1.0.0"))
    )
    assert "one after the other" not in alone


def test_the_places_of_a_full_plate_are_said_as_a_grid() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=1", "order.copies=90", "order.at_once=90")
    plan = schedule(laminate, design)
    job = Job(SHA, "sbafab 1.0.0", fixture="sheets/fixture.dxf")
    work = Work(design, laminate, plan, [], job)
    words = words_of(lxml_html.fromstring(bench_html("full", SHA, "sbafab 1.0.0", [work])))
    found = re.search(
        r"rows of (\d+): .* next ([\d.]+) mm to the right, .* next ([\d.]+) mm", words
    )
    assert found is not None
    places = design_runs(design, laminate).places
    columns, right, back = int(found[1]), float(found[2]), float(found[3])
    meant = [((n % columns) * right, (n // columns) * back) for n in range(len(places))]
    assert [p for pair in meant for p in pair] == pytest.approx(
        [p for place in places for p in place], abs=2e-2
    )
    assert "place 2 by" not in words
