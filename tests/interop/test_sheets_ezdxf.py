"""ezdxf's drawing add-on draws film sheets in their colours, sizes and areas."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import pytest
from ezdxf.addons.drawing import Frontend, RenderContext, layout, svg

from tests.interop.made import EXACT, LENGTH, WIDTH, Sheet
from tests.interop.page import contours_are_as_on_the_page
from tests.interop.svg_contours import Drawing, svg_contours

BLUE, RED = "#0000ff", "#ff0000"


def drawn(path: Path, folder: Path) -> Drawing:
    """The sheet as ezdxf draws it, as large as it is."""
    document = ezdxf.readfile(path)
    backend = svg.SVGBackend()
    Frontend(RenderContext(document), backend).draw_layout(document.modelspace())
    page = layout.Page(0, 0, layout.Units.mm, layout.Margins.all(0))
    picture = folder / "drawn.svg"
    picture.write_text(backend.get_string(page, settings=layout.Settings(fit_page=False)))
    return svg_contours(picture)


def test_every_contour_has_its_colour_and_area(sheet: Sheet, tmp_path: Path) -> None:
    found = drawn(sheet.files["bulges"], tmp_path)
    assert found.areas(RED) == pytest.approx(sheet.outers, rel=EXACT)
    assert found.areas(BLUE) == pytest.approx(sheet.holes, rel=EXACT)
    program = "ezdxf 1.4 drawing add-on"
    contours_are_as_on_the_page(program, sheet, found.areas(RED), found.areas(BLUE))


def test_the_drawing_is_as_large_as_the_sheet(sheet: Sheet, tmp_path: Path) -> None:
    found = drawn(sheet.files["bulges"], tmp_path)
    assert (found.width, found.height) == pytest.approx((WIDTH, LENGTH), abs=0.001)
