"""Pictures of layers and laminates for notebooks."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from shapely.geometry import Polygon
from svgelements import Arc, Move, Path

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate, Layer

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def laminate() -> Laminate:
    return build(load_design("3dof-15mm", ["stack.balloons=2"]))


def drawing(shown: Layer | Laminate) -> ElementTree.Element:
    """The picture at the beginning of what a notebook shows."""
    page = shown._repr_html_()
    return ElementTree.fromstring(page[: page.index("</svg>") + len("</svg>")])


def signed_area(data: str) -> float:
    area = 0.0
    for piece in Path(data).as_subpaths():
        points = []
        for segment in Path(piece):
            if not isinstance(segment, Move):
                steps = 150 if isinstance(segment, Arc) else 1
                points += [segment.point(i / steps) for i in range(steps)]
        ring = Polygon([(p.x, p.y) for p in points])
        area += ring.area if ring.exterior.is_ccw else -ring.area
    return area


def test_every_pattern_is_drawn_with_its_exact_area(laminate: Laminate) -> None:
    for layers in laminate.patterns.values():
        layer = layers[0]
        root = drawing(layer)
        [path] = root.iter(f"{SVG}path")
        data = path.attrib["d"]
        assert signed_area(data) == pytest.approx(layer.profile.area, rel=1e-4)
        assert "A" in data


def test_only_the_laminate_is_see_through(laminate: Laminate) -> None:
    [alone] = drawing(laminate.layer(1)).iter(f"{SVG}path")
    assert float(alone.attrib["fill-opacity"]) == 1.0
    for path in drawing(laminate).iter(f"{SVG}path"):
        assert 0.2 < float(path.attrib["fill-opacity"]) < 0.8


def test_notebooks_get_a_scale_and_a_legend(laminate: Laminate) -> None:
    # The longer side of 23.493 mm and its margins, 1.06 times that, are shown 80 mm wide.
    low_x, low_y, high_x, high_y = laminate.bounds
    longer = max(high_x - low_x, high_y - low_y)
    assert longer == pytest.approx(23.49, abs=0.01)
    page = laminate._repr_html_()
    [width] = re.findall(r"width:([\d.]+)mm;border-top", page)
    assert float(width) == pytest.approx(5 * 80 / (1.06 * longer), rel=1e-4)
    assert "5 mm</span>" in page
    assert "TPE, Stretchlon 200, 0.038 mm" in page


def test_a_name_with_markup_is_escaped(laminate: Laminate) -> None:
    named = replace(laminate, name="<b> & co")
    title = drawing(named).find(f"{SVG}title")
    assert title is not None
    assert str(title.text).startswith("<b> & co: 7 layers")
