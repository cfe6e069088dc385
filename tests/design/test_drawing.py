"""Drawings of whole layers: several contours with holes, by layer, against closed formulas."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.laminate_file import FILE, laminate_json
from sbafab.design.outline import read_drawing
from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc
from tests.design.drawing import dxf, svg

PLATE = [(-20, -10), (20, -10), (20, 10), (-20, 10)]


def plate(space: Any) -> None:
    """Two parts: a plate with two holes, one of which holds an island, and a disc beside it."""
    space.add_lwpolyline(PLATE, close=True, dxfattribs={"layer": "CUT_OUTER"})
    for x, radius in ((-10, 4), (10, 5), (10, 2)):
        space.add_circle((x, 0), radius, dxfattribs={"layer": "CUT_INNER"})
    space.add_line((30, 3), (30, -3))
    space.add_arc((30, 0), 3, -90, 90)


def test_contours_are_nested_where_they_lie(tmp_path: Path) -> None:
    region = read_drawing(dxf(tmp_path, plate))
    half_disc = math.pi * 9 / 2
    assert region.area == pytest.approx(800 + math.pi * (4 - 16 - 25) + half_disc, rel=1e-9)
    assert (len(region.outers), len(region.holes)) == (3, 2)
    assert region.bounds == pytest.approx((-20, -10, 33, 10))
    assert any(isinstance(edge, Arc) and edge.radius == 3 for edge in region.edges)


@pytest.mark.parametrize(
    ("layer", "area"), [("CUT_OUTER", 800), ("CUT_INNER", math.pi * (16 + 25 - 4))]
)
def test_a_layer_of_a_dxf_is_read_alone(layer: str, area: float, tmp_path: Path) -> None:
    assert read_drawing(dxf(tmp_path, plate), layer).area == pytest.approx(area)


def test_what_is_not_plotted_counts_only_by_name(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        space.doc.layers.add("REFERENCE", plot=False)
        space.add_line((-1, 0), (1, 0), dxfattribs={"layer": "REFERENCE"})
        space.add_circle((0, 0), 2)

    path = dxf(tmp_path, draw)
    assert read_drawing(path).area == pytest.approx(4 * math.pi)
    with pytest.raises(DesignError, match="is open: a gap of 2"):
        read_drawing(path, "REFERENCE")


GROUPS = """
<g transform="translate(1 2)"><g id="film" xmlns:i="http://www.inkscape.org/namespaces/inkscape"
i:label="Film 1"><circle r="4"/><circle r="1"/></g><text>film</text></g><g id="mask"><rect x="0"
y="0" width="3" height="2"/></g>"""


@pytest.mark.parametrize(
    ("layer", "area"), [("film", 15 * math.pi), ("Film 1", 15 * math.pi), ("mask", 6.0)]
)
def test_a_group_of_an_svg_is_read_alone(layer: str, area: float, tmp_path: Path) -> None:
    region = read_drawing(svg(tmp_path, GROUPS), layer)
    assert region.area == pytest.approx(area)
    if layer == "film":
        assert region.bounds == pytest.approx((-3, -6, 5, 2))


def test_a_pattern_of_a_laminate_is_exact(tmp_path: Path) -> None:
    laminate = build(load_design("3dof-15mm"))
    path = tmp_path / FILE
    path.write_text(laminate_json(laminate), encoding="utf-8")
    for layer in laminate.layers:
        assert read_drawing(path, layer.pattern).is_exactly(layer.profile)
    assert read_drawing(path, "outline").is_exactly(laminate.outline)
    with pytest.raises(DesignError, match=r'laminate\.json has no pattern .P99.; use "P01"'):
        read_drawing(path, "P99")
    with pytest.raises(DesignError, match="is a laminate; name one of its patterns as layer"):
        read_drawing(path)


def two(first: Callable[[Any], object], second: Callable[[Any], object]) -> Callable[[Any], object]:
    return lambda space: (first(space), second(space))


def ring(x: float, radius: float) -> Callable[[Any], object]:
    return lambda space: space.add_circle((x, 0), radius)


REFUSED: dict[str, tuple[Callable[[Any], object], str | None, str]] = {
    "crossing": (two(ring(0, 3), ring(4, 3)), None, r"cross or touch each other at x 2\.0000, y "),
    "touching": (two(ring(0, 3), ring(6, 3)), None, r"cross or touch each other at x 3\.0000, y 0"),
    "inner touch": (two(ring(0, 3), ring(1, 2)), None, r"touch each other at x 3\.0000, y 0"),
    "itself": (
        lambda space: space.add_lwpolyline([(0, 0), (4, 4), (4, 0), (0, 4)], close=True),
        None,
        r"crosses or touches itself at x 2\.0000, y 2\.0000",
    ),
    "open": (
        two(ring(9, 3), lambda space: space.add_lwpolyline([(0, 0), (4, 0), (4, 4), (0, 0.02)])),
        None,
        r"is open: a gap of 0\.0200 mm at x 0\.0000, y 0\.",
    ),
    "no such layer": (
        plate,
        "CUT",
        "has no paths on a layer 'CUT'; paths lie on 0, CUT_INNER",
    ),
    "far apart": (two(ring(0, 3), ring(2500, 3)), None, "measures 2506 x 6 mm, where at most 2000"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_a_layer_is_refused_at_its_place(name: str, tmp_path: Path) -> None:
    draw, layer, sentence = REFUSED[name]
    with pytest.raises(DesignError, match=sentence) as caught:
        read_drawing(dxf(tmp_path, draw), layer)
    assert "outline.dxf" in str(caught.value)
    assert "\n" not in str(caught.value)
