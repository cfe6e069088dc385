"""bench.html, what is ready before the day of the press, and names that can be read from above."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import Any, get_args

import pytest
import shapely
from pydantic import BaseModel

from sbafab.actuators import FAMILIES
from sbafab.cutting.properties import COLOURS, CUT_SEQUENCE, REFERENCE
from sbafab.laminate.assembly import assembly
from sbafab.reports.drawing import text_width
from sbafab.reports.traveller.shapes import beds
from sbafab.reports.traveller.step_pictures import plan
from tests.quick import few
from tests.reports.bench_pages import EARS, bench, built, page, words_of


@pytest.mark.parametrize("assignments", [(), (EARS,)])
def test_what_must_be_ready_before_the_day(sheet_files: Any, assignments: tuple[str, ...]) -> None:
    section = words_of(bench("3dof-15mm", *assignments))
    tree = page(sheet_files, "3dof-15mm", *assignments)
    ready = words_of(tree.get_element_by_id("materials").getparent())
    # Two release films a step and one for what is turned over; reamers as in the hole table.
    steps_made = 6 if assignments else 4
    assert f"Cut to size: {2 * steps_made + 1} release films." in ready
    assert f"each of the {steps_made} press steps" in section
    assert ("reamers H7 ⌀1 mm and ⌀1.5 mm" in section) == bool(assignments)
    # The paper has no time for warming or cooling: nothing is made up.
    assert section.count("not known, the paper gives no time") == 2
    assert "Time constant τ of the plate" in section
    assert not re.search(r"\d+ min\b", section)
    assert "130 °C (266 °F)" in section
    assert ("cut ears" in section) == bool(assignments)
    # A punch goes through the push-out hole of 0.6 diameters.
    assert ("punches ⌀0.5 mm and ⌀1.1 mm" in section) == (not assignments)
    assert ("Underlay printed at 100 %, 2 times" in ready) == (not assignments)
    # No hand lays to 0.08 mm without one; ears hold every film.
    assert ("loupe" not in section) == bool(assignments)
    assert ("by eye to 0.08 mm" in section) != bool(assignments)


def test_a_part_without_pins_needs_no_reamer() -> None:
    radial = words_of(bench("radial-15mm"))
    assert "reamer" not in radial
    assert "every pin" not in radial
    assert "jig borer" not in radial.lower()


def test_what_may_be_done_without_is_said_with_its_risk() -> None:
    tree = bench("3dof-15mm")
    [table] = tree.xpath("//section[@aria-labelledby='without']//table")
    risks = {words_of(row[0]): [words_of(cell) for cell in row[1:]] for row in table.iter("tr")}
    assert {"Measured kerf", "Pressure-indicating film", "τ"} <= set(risks)
    assert all(place and risk for place, risk in risks.values())
    place, risk = risks["Jig borer, for 3dof-15mm"]
    command = "sbafab generate design.toml --set registration.plate_made_by=cnc-mill"
    assert f"{command} --target-yield 0.9" in place
    assert "within 0.025 mm" in place
    # The mill's place, and half of H7's largest play with m6: 0.025 + 0.008 / 2.
    assert "up to 0.029 mm off, not 0.004" in risk
    # A plate with one pin takes a drill press; a mill's needs no command.
    for other in (("1dof-5mm",), ("3dof-15mm", 'registration.plate_made_by="cnc-mill"')):
        assert "--target-yield" not in words_of(bench(*other))


def keys_of(section: type[BaseModel], before: str = "") -> Iterator[str]:
    """Dotted keys of a design file."""
    for name, field in section.model_fields.items():
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from keys_of(kind, f"{before}{name}.")
        yield f"{before}{name}"


@pytest.mark.parametrize(
    "design",
    few(
        [
            ("3dof-15mm",),
            ("1dof-5mm", "films.tpe.product=TPU", "films.tpe.thickness=0.05", EARS),
            ("1dof-5mm", "order.copies=5"),
            ("1dof-5mm", "bore.pin_diameter=0.7", "press.temperature_c=155"),
            ("folded",),
            ("gripper",),
        ],
        4,
    ),
    ids=" ".join,
)
def test_keys_of_a_design_file_are_not_for_the_bench(
    sheet_files: Any, design: tuple[str, ...]
) -> None:
    """They are the designer's; commands may have them, and stand as code."""
    keys = {key for family in FAMILIES.values() for key in keys_of(family.record) if "." in key}
    assert {"press.time_constant", "press.minutes_for", "registration.pin_lengths"} <= keys
    for tree in (page(sheet_files, *design), bench(*design)):
        for code in tree.xpath("//code | //style | //script"):
            code.drop_tree()
        words = words_of(tree)
        assert [key for key in sorted(keys) if re.search(rf"(?<![\w.]){key}\b", words)] == []


def test_notes_are_those_of_the_laser_program_in_use() -> None:
    programs = {"LightBurn": (), "RDWorks": ("rdworks",), "Epilog's software": ("epilog",)}
    for name, program in programs.items():
        tree = bench("1dof-5mm", *(f"sheets.program={word}" for word in program))
        section = tree.get_element_by_id("laser").getparent()
        words = words_of(section)
        assert words.startswith(f"Laser: {name}")
        others = {"LightBurn", "RDWorks", "Epilog", "Inkscape", "LibreCAD"} - {name.split("'")[0]}
        assert not [other for other in others if other in words]
        cells = [[words_of(cell) for cell in row] for row in section.findall(".//tbody/tr")]
        # Layers, their order and colours as the files have them.
        assert [row[1] for row in cells] == [*CUT_SEQUENCE, REFERENCE]
        assert [int(re.findall(r"\d+", row[2])[0]) for row in cells] == [
            COLOURS[row[1]] for row in cells
        ]


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
