"""Labels of sheet maps: on their part, off each other and off windows."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
import shapely
from lxml import html as lxml_html

from sbafab.cutting.placements import Nest
from sbafab.cutting.sheets import SheetFile
from sbafab.reports.traveller.pictures import sheet_map
from tests.reports.pages import built


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
