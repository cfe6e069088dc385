"""svgelements reads the pictures beside film sheets contour by contour."""

from __future__ import annotations

import pytest
import shapely

from tests.interop.made import LENGTH, WIDTH, Sheet, outline_bounds
from tests.interop.page import contours_are_as_on_the_page
from tests.interop.svg_contours import svg_contours

EXACT = 1e-4
BLUE, RED, GREY = "#0000ff", "#ff0000", "#808080"


def test_every_contour_has_its_colour_and_area(sheet: Sheet) -> None:
    found = svg_contours(sheet.picture)
    assert found.areas(RED) == pytest.approx(sheet.outers, rel=EXACT)
    assert found.areas(BLUE) == pytest.approx(sheet.holes, rel=EXACT)
    contours_are_as_on_the_page("svgelements 1.9", sheet, found.areas(RED), found.areas(BLUE))
    assert found.areas(GREY) == pytest.approx([WIDTH * LENGTH], rel=EXACT)


@pytest.mark.usefixtures("fine_arcs")
def test_it_lies_as_the_cut_file_does(sheet: Sheet) -> None:
    found = svg_contours(sheet.picture)
    assert (found.width, found.height) == pytest.approx((WIDTH, LENGTH), abs=0.001)
    low_x, low_y, high_x, high_y = shapely.total_bounds(found.contours[RED])
    upright = (low_x, LENGTH - high_y, high_x, LENGTH - low_y)
    assert upright == pytest.approx(outline_bounds(sheet.files["bulges"]), abs=0.001)
