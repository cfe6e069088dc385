"""preview/stack.svg: the section through one chamber."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from PIL import ImageFont

from sbafab.actuators import build, load_design
from sbafab.cli import app
from sbafab.design.files import design_path
from sbafab.laminate.laminate import Laminate
from sbafab.reports.stack_svg import BOND, chamber_section, opening, stack_svg

SVG = "{http://www.w3.org/2000/svg}"


def laminate_of(template: str, *assignments: str) -> Laminate:
    return build(load_design(template, assignments))


def words_of(svg: str) -> list[str]:
    return [str(text.text) for text in ElementTree.fromstring(svg.encode()).iter(f"{SVG}text")]


def test_the_section_of_one_dof_cuts_where_the_formulas_say() -> None:
    section = chamber_section(laminate_of("1dof-5mm"))
    spans = {slab.layer.index: slab.spans for slab in section.slabs}
    near = {"abs": 1e-9}
    assert spans[1] == (pytest.approx((-3.25, 8.25), **near),)
    assert spans[2] == (pytest.approx((-2.5, -0.52), **near), pytest.approx((0.52, 8.75), **near))
    assert spans[4] == (pytest.approx((-3.75, -1.27), **near), pytest.approx((1.27, 3.75), **near))
    assert spans[23] == (pytest.approx((-3.25, 3.25), **near),)
    bonds = {joint.interface.index: joint.spans for joint in section.joints}
    assert bonds[1] == (pytest.approx((-3.25, -2.5), **near),)
    assert bonds[2] == (pytest.approx((-1.27, -0.52), **near), pytest.approx((0.52, 1.27), **near))


def test_the_lumen_lies_where_the_chamber_axis_radius_says() -> None:
    section = chamber_section(laminate_of("3dof-15mm"))
    assert section.lumen == pytest.approx(-4.25, abs=1e-9)
    cap = section.slabs[-1].spans
    assert opening(cap, -4.25) == pytest.approx((-5.25, -3.25), abs=1e-9)


@pytest.mark.parametrize(("balloons", "hidden"), [(1, 0), (2, 0), (4, 0), (5, 2), (6, 3), (15, 12)])
def test_many_balloons_are_broken_short(balloons: int, hidden: int) -> None:
    laminate = laminate_of("1dof-5mm", f"stack.balloons={balloons}")
    section = chamber_section(laminate)
    assert section.hidden == hidden
    drawn = {slab.layer.balloon for slab in section.slabs if not slab.layer.is_mask}
    assert len(drawn) == balloons - hidden
    assert any(f"{hidden} more balloons" in words for words in words_of(stack_svg(laminate))) == (
        hidden > 0
    )


@pytest.mark.parametrize(
    ("template", "labels"),
    [
        ("1dof-5mm", {"bore ⌀1.04", "bond 0.75", "overhang 0.50", "23 cap", "6.50", "5.00"}),
        (
            "3dof-15mm",
            {"lumen ⌀2.00", "neck ring, bond 0.75", "chamber pocket 5.00", "59 cap", "tab 5.00"},
        ),
        ("radial-15mm", {"1 sheet", "3 base", "5 cap", "bond 0.75", "tab 5.00"}),
    ],
)
def test_labels_and_dimensions(template: str, labels: set[str]) -> None:
    found = words_of(stack_svg(laminate_of(template)))
    assert labels <= set(found)
    assert any(words.endswith("inlet strip") for words in found)
    assert any(re.search(r"Height exaggerated \d+\u00d7", words) for words in found)


def rectangles(svg: str) -> list[tuple[str, float, float]]:
    root = ElementTree.fromstring(svg.encode())
    return [
        (box.attrib["fill"], float(box.attrib["width"]), float(box.attrib["height"]))
        for box in root.iter(f"{SVG}rect")
    ]


def test_widths_and_heights_are_to_their_two_scales() -> None:
    svg = stack_svg(laminate_of("1dof-5mm", "stack.balloons=2"))
    stated = re.search(r"exaggerated (\d+)\u00d7", svg)
    assert stated is not None
    factor = int(stated[1])
    across = (297 - 2 * 56) / (8.75 + 3.75)
    found = {
        (fill, round(width / across, 3), round(height / across / factor, 4))
        for fill, width, height in rectangles(svg)
    }
    assert (BOND, 0.75, 0.025) in found
    assert ("#a9cfea", 6.5, 0.038) in found
    assert ("#a9cfea", 11.5, 0.038) in found


def test_eight_lobes_are_cropped_beyond_the_lumen_and_keep_all_labels() -> None:
    laminate = laminate_of("3dof-15mm", "chamber.count=8")
    assert chamber_section(laminate).cropped
    assert {"overhang 0.50", "bore ⌀1.04", "lumen ⌀2.00"} <= set(words_of(stack_svg(laminate)))


def box_of(text: ElementTree.Element) -> tuple[float, float, float, float]:
    size = float(text.attrib.get("font-size", "3"))
    width = ImageFont.load_default(100).getlength(str(text.text)) * size / 100
    shift = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.attrib.get("text-anchor", "start")]
    x, y = float(text.attrib["x"]) - shift * width, float(text.attrib["y"])
    return x, y - 0.7 * size, x + width, y


@pytest.mark.parametrize(
    ("template", "assignments"),
    [
        ("1dof-5mm", []),
        ("3dof-15mm", []),
        ("3dof-15mm", ["chamber.count=8"]),
        ("3dof-15mm", ["chamber.diameter=20", "stack.balloons=1"]),
        ("1dof-10mm", ["chamber.diameter=100", "stack.balloons=1"]),
        ("radial-15mm", ["stack.balloons=3"]),
        ("1dof-5mm", ["stack.balloons=1", "registration.method=ears"]),
        ("3dof-15mm", ["chamber.count=7", "registration.method=ears"]),
    ],
)
def test_no_words_on_other_words_or_off_the_page(template: str, assignments: list[str]) -> None:
    root = ElementTree.fromstring(stack_svg(laminate_of(template, *assignments)).encode())
    page = [float(part) for part in root.attrib["viewBox"].split()]
    boxes = [box_of(text) for text in root.iter(f"{SVG}text")]
    for a, b in combinations(boxes, 2):
        assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]), (a, b)
    assert all(min(box) > 0 and box[2] < page[2] and box[3] < page[3] for box in boxes)


def test_a_name_with_markup_is_escaped() -> None:
    laminate = replace(laminate_of("1dof-5mm"), name="a<b & c")
    assert "a<b & c" in words_of(stack_svg(laminate))


def test_channel_pins_stand_where_they_hold_layers_between_base_and_cap() -> None:
    rods = {rod.name: rod for rod in chamber_section(laminate_of("3dof-15mm")).rods}
    assert rods["chamber1"].span == pytest.approx((-0.5, 0.5))
    # The bottom balloon's upper two layers, and the middle stack, each in its own step; the
    # separators round them, wider than a bore, are between the middle stack's ends.
    assert rods["chamber1"].stacks == ((2, 3), (5, 58))
    assert rods["lumen"].span == pytest.approx((-5.25, -3.25))
    assert rods["chamber1"].words == "pin chamber1, steps 1, 3"
    assert set(rods) == {"chamber1", "lumen"}


def test_tails_run_on_to_their_pins() -> None:
    laminate = laminate_of("1dof-5mm", "registration.method=ears")
    section = chamber_section(laminate)
    rods = {rod.name: rod for rod in section.rods}
    # Overhang and bond past the tab; the chord of a pin of 1.5 that stands 0.45 off the plane.
    centre, half = 8.25 + 0.5 + 0.75 + 0.75, (0.75**2 - 0.45**2) ** 0.5
    assert rods["strip1"].span == pytest.approx((centre - half, centre + half))
    assert rods["strip1"].stacks == ((2, 2),)
    strip = next(slab.spans for slab in section.slabs if slab.layer.index == 2)
    assert strip[-1] == pytest.approx((centre + half, centre + 1.5))
    words = words_of(stack_svg(laminate))
    assert {"pin strip1, steps 1, 2, 5", "pin chamber1, steps 1, 4", "tail 3.50"} <= set(words)
    assert "dowel pin" in words


SEAMED = """
name = "seamed"
family = "drawn"
layers = [{role = "base", shape = "film"}, {role = "cap", shape = "film"}]
seams = [{name = "rim", layers = [1, 2], shape = "rim", width = 2, tool = "laser"}]
chambers = [{name = "pouch", centres = [[0, 0]], mouth = [0, 15], angle = 90}]
[shapes]
film = {disc = 30}
rim = {disc = 20}
"""


def test_a_seam_is_cut_half_its_width_on_both_sides_of_its_path(tmp_path: Path) -> None:
    design = tmp_path / "seamed.toml"
    design.write_text(SEAMED)
    laminate = build(load_design(design))
    (joint,) = chamber_section(laminate).joints
    assert joint.spans == (pytest.approx((-11, -9)), pytest.approx((9, 11)))
    svg = stack_svg(laminate)
    assert svg.count(f'fill="{BOND}"') == len(joint.spans) + 1  # one in the legend
    assert "bond of a seam, drawn over the line between the films" in words_of(svg)


def test_a_fold_is_drawn_where_the_section_meets_its_line() -> None:
    laminate = build(load_design("folded"))
    (fold,) = chamber_section(laminate).folds
    # From the chamber's centre at y = -1 to the line at y = -12; the film lies toward the mouth.
    assert (fold.s, fold.is_ahead) == (pytest.approx(-11), True)
    svg = stack_svg(laminate)
    assert "fold: the film goes on in its other half" in words_of(svg)
    assert svg.count("stroke-dasharray") == 2


def test_a_chamber_beside_all_layers_fails_by_its_rule_and_is_drawn(tmp_path: Path) -> None:
    text = design_path("pouch").read_text().replace("centres = [[0, 0]]", "centres = [[100, 0]]")
    (tmp_path / "pouch.toml").write_text(text)
    ended = CliRunner().invoke(app, ["generate", str(tmp_path / "pouch.toml"), "-o", str(tmp_path)])
    assert ended.exit_code == 1, ended.output
    assert "pouch failed: sealing" in " ".join(ended.output.split())
    assert (tmp_path / "pouch" / "findings.html").is_file()
    assert not (tmp_path / "pouch" / "layers").exists()
