"""Drawings that are no outline: each is refused in one sentence that names what and where."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from sbafab.design.outline import read_outline
from sbafab.errors import DesignError
from tests.design.drawing import ARROW, dxf, svg

RISING = [(-3, -2, 0), (3, -2, 0), (0, 4, 3), (-3, -2, 0)]


def _endless_spline(space: Any) -> None:
    spline = space.add_open_spline([(*p, 0) for p in [*ARROW, ARROW[0]]])
    knots = list(spline.knots)
    knots[-4:] = [1e308] * 4
    spline.knots = knots


BAD_DXF: dict[str, tuple[Callable[[Any], object], str]] = {
    "two": (lambda m: (m.add_circle((0, 0), 2), m.add_circle((0, 0), 1)), "2 closed paths"),
    "open": (
        lambda m: m.add_lwpolyline([(-3, -2), (3, -2), (3, 2), (-3, 2), (-3, -1.98)]),
        r"gap of 0\.0200 mm at x -3\.0000, y -\d\.",
    ),
    "drawn twice": (
        lambda m: (m.add_circle((0, 0), 2), m.add_circle((0, 0), 2)),
        r"twice, at x 1\.4142, y 1\.4142",
    ),
    "bow tie": (
        lambda m: m.add_lwpolyline([(-3, -2), (3, 2), (3, -2), (-3, 2)], close=True),
        r"crosses or touches itself at x 0\.0000, y 0\.0000",
    ),
    "corner on a corner": (
        lambda m: m.add_lwpolyline(
            [(0, -1), (3, -2), (3, 2), (0, -1), (-3, 2), (-3, -2)], close=True
        ),
        r"crosses or touches itself at x 0\.0000, y -1\.0000",
    ),
    "crescent": (
        lambda m: m.add_lwpolyline([(4, -5, 1.0), (4, 5, -0.8)], format="xyb", close=True),
        "has its centroid outside itself",
    ),
    "too large": (lambda m: m.add_circle((0, 0), 75.1), r"150\.2 x 150\.2 mm"),
    "NaN": (lambda m: m.add_circle((0, math.nan), 4), "coordinate of x 0, y nan"),
    "tilted": (
        lambda m: m.add_circle((0, 0), 4, dxfattribs={"extrusion": (0, 1, 0)}),
        "CIRCLE tilted",
    ),
    "degree": (
        lambda m: m.add_open_spline([(*p, 0) for p in [*ARROW, *ARROW]], degree=12),
        "SPLINE of degree 12",
    ),
    "endless spline": (_endless_spline, "cusp near"),
    "too many edges": (
        lambda m: m.add_lwpolyline([(math.cos(k), math.sin(k)) for k in range(2001)]),
        "more than 500 edges",
    ),
    "line that rises": (
        lambda m: [m.add_line(a, b) for a, b in pairwise(RISING)],
        "LINE at z 3, but another point at z 0; flatten the whole outline",
    ),
    "spline through points that rise": (
        lambda m: m.add_spline([(*p, p[0]) for p in [*ARROW, ARROW[0]]]),
        "SPLINE at z",
    ),
    "half at a height, from behind": (
        lambda m: (
            m.add_arc((0, 0, 5), 4, 0, 180),
            m.add_arc((0, 0, 5), 4, 0, 180, dxfattribs={"extrusion": (0, 0, -1)}),
        ),
        "ARC at z -5, but another point at z 5",
    ),
    "ellipse that rises": (lambda m: m.add_ellipse((0, 0), (5, 1, 2), 0.4), "ELLIPSE at z 2"),
    "mesh": (lambda m: m.add_polymesh((3, 3)), "POLYLINE that is a mesh"),
    "invisible": (
        lambda m: m.add_circle((0, 0), 3, dxfattribs={"invisible": 1}),
        "only hidden entities",
    ),
    "blocks are not followed": (lambda m: m.add_blockref("POCKET", (0, 0)), "entity INSERT"),
}


@pytest.mark.parametrize("name", BAD_DXF)
def test_a_drawing_that_is_no_outline_is_refused(tmp_path: Path, name: str) -> None:
    draw, message = BAD_DXF[name]
    with pytest.raises(DesignError, match=message) as caught:
        read_outline(dxf(tmp_path, draw))
    assert "outline.dxf" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_other_units_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=r"\$INSUNITS 2"):
        read_outline(dxf(tmp_path, lambda m: m.add_circle((0, 0), 2), 2))


BAD_SVG = {
    "many elements": ("<g/>" * 2001, "more than 2000 elements"),
    "nested deeply": ("<g>" * 1500 + "</g>" * 1500, "no closed path"),
    "long path": (f'<path d="M0 0{"c1 1 2 2 3 3" * 3000}"/>', "more than 5000 edges"),
}


@pytest.mark.parametrize("name", BAD_SVG)
def test_a_long_svg_is_refused(tmp_path: Path, name: str) -> None:
    body, message = BAD_SVG[name]
    with pytest.raises(DesignError, match=message):
        read_outline(svg(tmp_path, body))


BAD_FILES = {
    "text.dxf": (b"not a drawing", "not a valid DXF file"),
    "large.dxf": (b"0" * 5_000_001, "5,000,001 bytes"),
    "page.svg": (b"<html/>", "not an SVG"),
    "utf16.svg": ("<svg/>".encode("utf-16"), "UTF-8"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_of_another_kind_is_refused(tmp_path: Path, name: str) -> None:
    content, message = BAD_FILES[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DesignError, match=message):
        read_outline(tmp_path / name)


@pytest.mark.parametrize("name", ["missing.dxf", ".", "nul\0.dxf", "n" * 5000])
def test_a_path_without_a_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DesignError, match="check its path"):
        read_outline(tmp_path / name)


@pytest.mark.parametrize("state", ["compensated", "uncalibrated: nominal edges"])
def test_a_compensated_cut_file_is_no_outline(tmp_path: Path, state: str) -> None:
    path = dxf(tmp_path, lambda m: m.add_circle((0, 0), 3))
    document = ezdxf.readfile(path)
    document.header.custom_vars.append("KERF_STATE", state)
    document.header.custom_vars.append("KERF_WIDTH", "0.12 x 0.1")
    document.saveas(path)
    if state == "compensated":
        with pytest.raises(DesignError, match=r"compensated for a kerf of 0\.12 x 0\.1 mm"):
            read_outline(path)
    else:
        assert read_outline(path).area == pytest.approx(9 * math.pi)
