"""Drawings of layers and of the section: the paper's dimensions, true scales, room for words."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import shapely
from lxml import html as lxml_html
from PIL import ImageFont
from svgelements import Path as SvgPath

from sbafab.actuators import build, load_design
from sbafab.cutting.placements import Nest
from sbafab.cutting.sheets import SheetFile
from sbafab.design.files import design_path
from sbafab.laminate.laminate import Laminate
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.layers_svg import layers_svg
from sbafab.reports.stack_svg import BOND, StackSection, opening, stack_svg
from sbafab.reports.traveller.pictures import sheet_map
from tests.reports.pages import built

SVG = "{http://www.w3.org/2000/svg}"
TIMES = "\u00d7"
DESIGNS = [
    ["1dof-5mm"],
    ["3dof-15mm"],
    ["radial-15mm", "stack.balloons=3"],
    ["1dof-5mm", "chamber.diameter=[8,7,6,5,4,3]"],
    ["3dof-15mm", "chamber.count=7", "registration.method=ears"],
]
Box = tuple[float, float, float, float]


def laminate_of(template: str, *assignments: str) -> Laminate:
    return build(load_design(template, assignments))


def root_of(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg.encode())


def words_of(node: ElementTree.Element) -> list[str]:
    return [str(text.text).replace(TIMES, "x") for text in node.iter(f"{SVG}text")]


def cards(svg: str) -> dict[str, ElementTree.Element]:
    """The drawing of each pattern."""
    return {group.attrib["id"]: group for group in root_of(svg).iter(f"{SVG}g") if group.get("id")}


def box_of(text: ElementTree.Element) -> Box:
    """The place of a text, measured with a font of its own."""
    size = float(text.attrib.get("font-size", "3"))
    width = ImageFont.load_default(100).getlength(str(text.text)) * size / 100
    x, y = float(text.attrib["x"]), float(text.attrib["y"])
    shift = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.attrib.get("text-anchor", "start")]
    if "transform" in text.attrib:
        return x - 0.7 * size, y - (1 - shift) * width, x, y + shift * width
    return x - shift * width, y - 0.7 * size, x + (1 - shift) * width, y


def overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("given", DESIGNS, ids=" ".join)
def test_words_have_room_and_every_pattern_is_named_and_counted(given: list[str]) -> None:
    laminate = replace(laminate_of(*given), name='<Tom & "Jerry">')
    for svg in (layers_svg(laminate), stack_svg(laminate)):
        root = root_of(svg)
        assert laminate.name in words_of(root)
        boxes = [box_of(text) for text in root.iter(f"{SVG}text")]
        _, _, width, height = (float(part) for part in root.attrib["viewBox"].split())
        assert root.attrib["width"] == f"{width:g}mm"
        assert all(min(box) > 0 and box[2] < width and box[3] < height for box in boxes)
        assert not [pair for pair in combinations(boxes, 2) if overlap(*pair)]
        for card in cards(svg).values():
            shape = SvgPath(next(card.iter(f"{SVG}path")).attrib["d"]).bbox()
            assert not [box for box in boxes if overlap(box, shape)]
    drawn = cards(layers_svg(laminate))
    assert list(drawn) == list(laminate.patterns)
    for (pattern, made), card in zip(laminate.patterns.items(), drawn.values(), strict=True):
        title, film, numbers = words_of(card)[:3]
        assert title.startswith(f"{pattern}  {made[0].role.replace('-', ' ')}")
        assert film.startswith(f"{made[0].film.material} film")
        assert film.endswith(f", {len(made)} needed")
        assert str(made[-1].index) in numbers.replace(",", "").split()


@pytest.mark.parametrize(
    ("template", "role", "words"),
    [
        ("1dof-5mm", "cap", {"⌀6.50"}),
        ("1dof-10mm", "cap", {"⌀11.50"}),
        ("1dof-5mm", "base", {"6.50", "11.50", "R3.25", "2x R1.00", "tab 3.45 wide"}),
        ("1dof-5mm", "separator-mask", {"⌀7.50", "neck ring ⌀2.54"}),
        ("3dof-15mm", "cap", {"fits ⌀15.00", "lumen ⌀2.00", "3x R3.25", "3x R1.00"}),
        ("3dof-15mm", "separator-mask", {"fits ⌀16.00", "3x neck ring ⌀2.54", "3x R3.75"}),
        ("3dof-15mm", "chamber-mask", {"3x strip 1.95 wide", "3x bore ⌀1.04", "3x R2.50"}),
        ("radial-15mm", "sheet", {f"{15 * math.pi:.2f}"}),
        ("radial-15mm", "cap", {"3x 11.50 wide", f"{10 * math.pi + 11.5:.2f}", "6x R5.75"}),
    ],
)
def test_dimensions_are_those_of_the_paper(template: str, role: str, words: set[str]) -> None:
    laminate = laminate_of(template)
    pattern = next(layer.pattern for layer in laminate.layers if layer.role == role)
    assert words <= set(words_of(cards(layers_svg(laminate))[pattern]))


def test_the_scale_is_the_one_drawn_and_pins_are_in_what_they_hold() -> None:
    laminate = laminate_of("3dof-15mm")
    svg = layers_svg(laminate)
    stated = next(words for words in words_of(root_of(svg)) if words.startswith("scale"))
    scale = float(stated.split()[1].removesuffix(":1,"))
    cap = cards(svg)[laminate.layers[-1].pattern]
    low_x, _, high_x, _ = SvgPath(next(cap.iter(f"{SVG}path")).attrib["d"]).bbox()
    assert high_x - low_x == pytest.approx(scale * (4.25 * 1.5 + 6.5), rel=1e-4)
    pins = {
        name: sum(dot.attrib["fill"] == "#1a1a1a" for dot in card.iter(f"{SVG}circle"))
        for name, card in cards(svg).items()
    }
    # Base P01 and cap P07 have the lumen's hole, but no pin is in when they are laid.
    assert pins == {"P01": 0, "P02": 3, "P03": 4, "P04": 1, "P05": 4, "P06": 3, "P07": 0}
    assert "dowel pin that holds the layer" in svg
    assert "dowel pin" not in layers_svg(laminate_of("radial-15mm"))


def test_layer_numbers_are_shortened_without_loss() -> None:
    assert layer_numbers([3, 7, 11, 15, 59]) == "3, 7, 11 … 15, 59"
    assert layer_numbers(range(5, 58, 2)) == "5, 7, 9 … 57"
    assert layer_numbers([2, 3, 4, 5, 6]) == "2 to 6"


def test_seams_and_folds_are_drawn_on_the_layers_they_join() -> None:
    laminate = laminate_of("folded")
    svg = layers_svg(laminate)
    for card in cards(svg).values():
        for seam, group in zip(laminate.seams, card.findall(f"{SVG}g"), strict=True):
            band, middle = group.findall(f"{SVG}path")
            assert float(band.attrib["stroke-width"]) == seam.width
            for path in (band, middle):
                assert SvgPath(path.attrib["d"]).length() == pytest.approx(seam.length, abs=1e-6)
        outline, *lines = card.findall(f"{SVG}path")
        (fold,) = (SvgPath(path.attrib["d"]) for path in lines if "stroke-dasharray" in path.attrib)
        high = SvgPath(outline.attrib["d"]).bbox()[3]
        assert fold.bbox()[1::2] == pytest.approx((high, high))
        assert any(words.endswith("; seams left, right") for words in words_of(card))
    legend = words_of(root_of(svg))
    assert "seam: its width, and the path of the hot-tip" in legend
    assert "fold: the film goes on in its other half" in legend


def test_the_section_cuts_where_the_formulas_say() -> None:
    section = StackSection(laminate_of("1dof-5mm"))
    spans = {slab.of.index: slab.spans for slab in section.slabs}
    bonds = {joint.of.index: joint.spans for joint in section.joints}
    for cut, expected in (
        (spans[1], [(-3.25, 8.25)]),
        (spans[2], [(-2.5, -0.52), (0.52, 8.75)]),
        (spans[4], [(-3.75, -1.27), (1.27, 3.75)]),
        (spans[23], [(-3.25, 3.25)]),
        (bonds[1], [(-3.25, -2.5)]),
        (bonds[2], [(-1.27, -0.52), (0.52, 1.27)]),
    ):
        assert list(cut) == [pytest.approx(span, abs=1e-9) for span in expected]
    section = StackSection(laminate_of("3dof-15mm"))
    assert section.lumen == pytest.approx(-4.25, abs=1e-9)
    assert opening(section.slabs[-1].spans, -4.25) == pytest.approx((-5.25, -3.25), abs=1e-9)


@pytest.mark.parametrize(
    ("given", "hidden", "labels"),
    [
        (["1dof-5mm", "stack.balloons=5"], 2, ["19 cap", "bond 0.75", "… 2 more balloons …"]),
        (["3dof-15mm"], 12, ["lumen ⌀2.00", "neck ring, bond 0.75", "chamber pocket 5.00"]),
        # Cropped beyond the lumen.
        (["3dof-15mm", "chamber.count=8"], 12, ["overhang 0.50", "bore ⌀1.04", "lumen ⌀2.00"]),
        (["radial-15mm"], 0, ["1 sheet", "3 base", "5 cap", "bond 0.75", "tab 5.00"]),
    ],
)
def test_labels_and_dimensions_of_the_section(
    given: list[str], hidden: int, labels: list[str]
) -> None:
    laminate = laminate_of(*given)
    section = StackSection(laminate)
    shown = {slab.of.balloon for slab in section.slabs if not slab.of.is_mask} - {None}
    assert (section.hidden, len(shown)) == (hidden, laminate.balloons - hidden)
    found = words_of(root_of(stack_svg(laminate)))
    assert {*labels} <= {*found}
    assert any(words.endswith("inlet strip") for words in found)


def test_pins_stand_where_they_hold_layers_and_tails_run_on_to_them() -> None:
    rods = {rod.name: rod for rod in StackSection(laminate_of("3dof-15mm")).rods}
    assert rods.keys() == {"chamber1", "lumen"}
    assert rods["chamber1"].span == pytest.approx((-0.5, 0.5))
    # The bottom balloon's upper two layers, and the middle stack, each in its own step; the
    # separators round them, wider than a bore, are between the middle stack's ends.
    assert rods["chamber1"].stacks == ((2, 3), (5, 58))
    assert rods["lumen"].span == pytest.approx((-5.25, -3.25))
    laminate = laminate_of("1dof-5mm", "registration.method=ears")
    (strip,) = (rod for rod in StackSection(laminate).rods if rod.name == "strip1")
    # Overhang and bond past the tab; the chord of a pin of 1.5 that stands 0.45 off the plane.
    centre, half = 8.25 + 0.5 + 0.75 + 0.75, (0.75**2 - 0.45**2) ** 0.5
    assert strip.span == pytest.approx((centre - half, centre + half))
    assert strip.stacks == ((2, 2),)
    words = {"pin strip1, steps 1, 2, 5", "pin chamber1, steps 1, 4", "tail 3.50", "dowel pin"}
    assert words <= set(words_of(root_of(stack_svg(laminate))))


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


def written(folder: Path, text: str) -> Laminate:
    path = folder / "design.toml"
    path.write_text(text, encoding="utf-8")
    return laminate_of(str(path))


def test_seams_and_folds_are_cut_where_they_lie(tmp_path: Path) -> None:
    laminate = written(tmp_path, SEAMED)
    (joint,) = StackSection(laminate).joints
    assert joint.spans == (pytest.approx((-11, -9)), pytest.approx((9, 11)))
    svg = stack_svg(laminate)
    assert svg.count(f'fill="{BOND}"') == len(joint.spans) + 1  # one in the legend
    assert "bond of a seam, drawn over the line between the films" in svg
    folded = laminate_of("folded")
    ((_, place, is_ahead),) = StackSection(folded).folds
    # From the chamber's centre at y = -1 to the line at y = -12; the film lies toward the mouth.
    assert (place, is_ahead) == (pytest.approx(-11), True)
    assert stack_svg(folded).count("stroke-dasharray") == 2


def test_widths_and_heights_are_to_their_two_scales() -> None:
    svg = stack_svg(laminate_of("1dof-5mm", "stack.balloons=2"))
    (factor,) = map(int, re.findall(r"Height exaggerated (\d+)\u00d7", svg))
    across = (297 - 2 * 56) / (8.75 + 3.75)
    found = {
        (
            box.attrib["fill"],
            round(float(box.attrib["width"]) / across, 3),
            round(float(box.attrib["height"]) / across / factor, 4),
        )
        for box in root_of(svg).iter(f"{SVG}rect")
    }
    assert {(BOND, 0.75, 0.025), ("#a9cfea", 6.5, 0.038), ("#a9cfea", 11.5, 0.038)} <= found


def test_films_are_drawn_though_the_chamber_lies_beside_all_of_them(tmp_path: Path) -> None:
    text = design_path("pouch").read_text(encoding="utf-8")
    beside = text.replace("centres = [[0, 0]]", "centres = [[100, 0]]")
    assert beside != text
    assert "1 base" in words_of(root_of(stack_svg(written(tmp_path, beside))))


# Labels of sheet maps: on their part, off each other and off windows.


def drawn(sheet: SheetFile, design: str, mark: str = "") -> Any:
    film = built("1dof-5mm")[0].films.stock[sheet.material.lower()]
    return lxml_html.fromstring(sheet_map(sheet, film, {design: mark}, "sheet-1"))


def boxes(svg: Any) -> list[Any]:
    """What the labels of a picture cover, by Helvetica's widest letters in them: 0.667 em."""
    found = []
    for text in svg.iter("text"):
        x, y, size = (float(text.get(key)) for key in ("x", "y", "font-size"))
        half = size * sum(0.278 if c in " .-" else 0.56 for c in text.text) / 2
        found.append(shapely.box(x - half, y - 0.7 * size, x + half, y))
    return found


@pytest.mark.parametrize("template", ["1dof-5mm", "3dof-15mm", "radial-15mm"])
def test_labels_do_not_lie_over_each_other(template: str, sheet_files: Any) -> None:
    for sheet in sheet_files(built(template)[1]):
        # Two designs on a sheet: every label begins with the design's name.
        for mark in ("", "B"):
            covered = boxes(drawn(sheet, template, mark))
            assert len(covered) > 4
            for i, box in enumerate(covered):
                assert all(box.intersection(other).area < 0.05 for other in covered[:i])


def test_a_long_sheet_is_drawn_in_rows_across_the_page(sheet_files: Any) -> None:
    sheet = sheet_files(built("1dof-5mm")[1])[0]
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
    svg = drawn(long, "1dof-5mm")
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
    corner = 10 * scale, 20 * scale
    far = corner[0] + (high_y - low_y) * scale, corner[1] + (high_x - low_x) * scale
    assert moved.bounds == pytest.approx((*corner, *far), abs=0.01)
    # Turned, not mirrored: the page's y points down, so the determinant stays negative.
    assert a * d - b * c < 0


def test_labels_hide_no_window(sheet_files: Any) -> None:
    _, laminate = built("radial-15mm")
    for sheet in (one for one in sheet_files(laminate) if one.material == "PTFE"):
        svg = drawn(sheet, "radial-15mm")
        frame = max(svg.iter("rect"), key=lambda rect: float(rect.get("width")))
        scale = float(frame.get("width")) / sheet.width
        foot = float(frame.get("y")) + float(frame.get("height"))
        for placement in sheet.nest.on_sheet(sheet.number - 1):
            for hole in sheet.nest.region(placement).holes:
                points = [(0.5 + scale * x, foot - scale * y) for x, y in hole.polygon()]
                window = shapely.Polygon(points)
                hidden = sum(box.intersection(window).area for box in boxes(svg))
                assert hidden < 0.2 * window.area
