"""preview/layers.svg: names, counts, dimensions, and room for all of it."""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from PIL import ImageFont
from svgelements import Path

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.layers_svg import layers_svg

SVG = "{http://www.w3.org/2000/svg}"
DESIGNS: dict[str, tuple[str, list[str]]] = {
    "1dof-5mm": ("1dof-5mm", []),
    "1dof-10mm": ("1dof-10mm", []),
    "3dof-15mm": ("3dof-15mm", []),
    "eight lobes": ("3dof-15mm", ["chamber.count=8"]),
    "radial-15mm": ("radial-15mm", []),
    "radial, three balloons": ("radial-15mm", ["stack.balloons=3"]),
    "one balloon, ears": ("1dof-5mm", ["stack.balloons=1", "registration.method=ears"]),
    "seven lobes, ears": ("3dof-15mm", ["chamber.count=7", "registration.method=ears"]),
    "tapered": ("1dof-5mm", ["chamber.diameter=[8,7,6,5,4,3]"]),
}
TIMES = "\u00d7"
Box = tuple[float, float, float, float]


def laminate_of(name: str) -> Laminate:
    template, assignments = DESIGNS[name]
    return build(load_design(template, assignments))


def cards(svg: str) -> dict[str, list[str]]:
    """The words on each pattern's card."""
    root = ElementTree.fromstring(svg.encode())
    return {
        group.attrib["id"]: [
            str(text.text).replace(TIMES, "x") for text in group.iter(f"{SVG}text")
        ]
        for group in root.iter(f"{SVG}g")
    }


@pytest.mark.parametrize("name", DESIGNS)
def test_every_pattern_is_named_and_counted(name: str) -> None:
    laminate = laminate_of(name)
    found = cards(layers_svg(laminate))
    assert list(found) == list(laminate.patterns)
    for pattern, words in found.items():
        made = [layer for layer in laminate.layers if layer.pattern == pattern]
        assert words[0].startswith(f"{pattern}  {made[0].role.replace('-', ' ')}")
        assert words[1].startswith(f"{made[0].film.material} film")
        assert words[1].endswith(f", {len(made)} needed")
        assert str(made[-1].index) in words[2].replace(",", "").split()


@pytest.mark.parametrize(
    ("name", "role", "words"),
    [
        ("1dof-5mm", "cap", {"⌀6.50"}),
        ("1dof-10mm", "cap", {"⌀11.50"}),
        ("1dof-5mm", "base", {"6.50", "11.50", "R3.25", "2x R1.00", "tab 3.45 wide"}),
        ("1dof-5mm", "separator-mask", {"⌀7.50", "neck ring ⌀2.54"}),
        ("3dof-15mm", "cap", {"fits ⌀15.00", "lumen ⌀2.00", "3x R3.25", "3x R1.00"}),
        ("3dof-15mm", "base", {"fits ⌀15.00", "3x tab 3.45 wide"}),
        ("3dof-15mm", "separator-mask", {"fits ⌀16.00", "3x neck ring ⌀2.54", "3x R3.75"}),
        ("3dof-15mm", "chamber-mask", {"3x strip 1.95 wide", "3x bore ⌀1.04", "3x R2.50"}),
        ("radial-15mm", "sheet", {f"{15 * math.pi:.2f}"}),
        ("radial-15mm", "cap", {"3x 11.50 wide", f"{10 * math.pi + 11.5:.2f}", "6x R5.75"}),
        ("radial, three balloons", "cap", {"3x 11.50 wide", "20.00"}),
    ],
)
def test_dimensions_are_those_of_the_paper(name: str, role: str, words: set[str]) -> None:
    laminate = laminate_of(name)
    pattern = next(layer.pattern for layer in laminate.layers if layer.role == role)
    assert words <= set(cards(layers_svg(laminate))[pattern])


def test_three_separate_masks_are_dimensioned_as_discs() -> None:
    laminate = laminate_of("3dof-15mm")
    pattern = next(x.pattern for x in laminate.layers[4:] if x.role == "chamber-mask")
    assert {"3x ⌀5.00", "3x bore ⌀1.04"} <= set(cards(layers_svg(laminate))[pattern])


def box_of(text: ElementTree.Element) -> Box:
    """Where a text stands, measured with a font of its own."""
    size = float(text.attrib.get("font-size", "3"))
    width = ImageFont.load_default(100).getlength(str(text.text)) * size / 100
    x, y = float(text.attrib["x"]), float(text.attrib["y"])
    shift = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.attrib.get("text-anchor", "start")]
    if "transform" in text.attrib:
        return x - 0.7 * size, y - (1 - shift) * width, x, y + shift * width
    return x - shift * width, y - 0.7 * size, x + (1 - shift) * width, y


def overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("name", DESIGNS)
def test_no_words_on_other_words_or_on_a_profile(name: str) -> None:
    root = ElementTree.fromstring(layers_svg(laminate_of(name)).encode())
    boxes = [(str(text.text), box_of(text)) for text in root.iter(f"{SVG}text")]
    page = tuple(float(part) for part in root.attrib["viewBox"].split())
    shapes = [
        Path(path.attrib["d"]).bbox()
        for group in root.iter(f"{SVG}g")
        for path in group.iter(f"{SVG}path")
        if path.attrib.get("fill-rule") == "evenodd"
    ]
    for i, (words, box) in enumerate(boxes):
        assert min(box) > 0, words
        assert box[2] < page[2], words
        assert box[3] < page[3], words
        assert not [other for other, there in boxes[i + 1 :] if overlap(box, there)], words
        assert not any(overlap(box, shape) for shape in shapes), words


def test_page_is_in_true_millimetres_and_the_scale_is_the_one_drawn() -> None:
    laminate = laminate_of("3dof-15mm")
    root = ElementTree.fromstring(layers_svg(laminate).encode())
    _, _, width, height = root.attrib["viewBox"].split()
    assert (root.attrib["width"], root.attrib["height"]) == (f"{width}mm", f"{height}mm")
    stated = next(t.text for t in root.iter(f"{SVG}text") if "scale" in str(t.text))
    scale = float(str(stated).split()[1].removesuffix(":1,"))
    cap = next(g for g in root.iter(f"{SVG}g") if g.attrib["id"] == laminate.layers[-1].pattern)
    outline = next(p for p in cap.iter(f"{SVG}path") if p.attrib.get("fill-rule") == "evenodd")
    low_x, _, high_x, _ = Path(outline.attrib["d"]).bbox()
    assert high_x - low_x == pytest.approx(scale * (4.25 * 1.5 + 6.5), rel=1e-4)


def pins_drawn(svg: str) -> dict[str, int]:
    """Filled circles on each pattern's card."""
    root = ElementTree.fromstring(svg.encode())
    return {
        group.attrib["id"]: sum(c.attrib["fill"] == "#1a1a1a" for c in group.iter(f"{SVG}circle"))
        for group in root.iter(f"{SVG}g")
    }


def test_pins_are_drawn_where_they_are_in_when_the_layer_is_laid() -> None:
    # Base P01 and cap P07 have the lumen's hole, but no pin is in when they are laid.
    svg = layers_svg(laminate_of("3dof-15mm"))
    assert pins_drawn(svg) == {"P01": 0, "P02": 3, "P03": 4, "P04": 1, "P05": 4, "P06": 3, "P07": 0}
    assert "dowel pin that holds the layer" in svg
    eared = build(load_design("3dof-15mm", ["registration.method=ears"]))
    assert pins_drawn(layers_svg(eared))["P01"] == pins_drawn(layers_svg(eared))["P07"] == 2
    assert "dowel pin" not in layers_svg(laminate_of("radial-15mm"))


def test_a_name_with_markup_is_escaped() -> None:
    laminate = replace(laminate_of("1dof-5mm"), name='<Tom & "Jerry">')
    root = ElementTree.fromstring(layers_svg(laminate).encode())
    assert laminate.name in [text.text for text in root.iter(f"{SVG}text")]


@pytest.mark.parametrize(
    ("indices", "words"),
    [
        ([1], "1"),
        ([2, 9], "2, 9"),
        ([3, 7, 11, 15, 59], "3, 7, 11 … 15, 59"),
        (list(range(5, 58, 2)), "5, 7, 9 … 57"),
        ([2, 3, 4, 5, 6], "2 to 6"),
    ],
)
def test_layer_numbers_are_shortened_without_loss(indices: list[int], words: str) -> None:
    assert layer_numbers(indices) == words


def test_seams_and_folds_are_drawn_on_the_layers_they_join() -> None:
    laminate = build(load_design("folded"))
    root = ElementTree.fromstring(layers_svg(laminate).encode())
    for card in root.findall(f"{SVG}g"):
        placed = card.findall(f"{SVG}g")
        assert len(placed) == len(laminate.seams)
        for seam, group in zip(laminate.seams, placed, strict=True):
            band, middle = group.findall(f"{SVG}path")
            assert float(band.attrib["stroke-width"]) == seam.width
            assert band.attrib["stroke-linecap"] == "round"
            for path in (band, middle):
                assert Path(path.attrib["d"]).length() == pytest.approx(seam.length, abs=1e-6)
        dashed = [path for path in card.findall(f"{SVG}path") if "stroke-dasharray" in path.attrib]
        (fold,) = (Path(path.attrib["d"]) for path in dashed)
        outline = Path(card.findall(f"{SVG}path")[0].attrib["d"]).bbox()
        assert fold.bbox()[1::2] == pytest.approx((outline[3], outline[3]))
        words = [str(text.text) for text in card.iter(f"{SVG}text")]
        assert any(said.endswith("; seams left, right") for said in words)
    legend = [str(text.text) for text in root.findall(f"{SVG}text")]
    assert "seam: its width, and the path of the hot-tip" in legend
    assert "fold: the film goes on in its other half" in legend
