"""The picture beside a cut file: SVG in physical millimetres, in the colours of its layers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from sbafab.cutting.cut_layers import CUT_INNER, CUT_OUTER, CUT_SHEET, ENGRAVE, REFERENCE
from sbafab.cutting.dxf_write import Surroundings
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Contour, Region
from sbafab.geometry.svg import number, path_data

COLOURS = {
    ENGRAVE: "#000000",
    CUT_INNER: "#0000ff",
    CUT_OUTER: "#ff0000",
    CUT_SHEET: "#ff00ff",
    REFERENCE: "#808080",
}
"""The DXF colours of the layers; ENGRAVE is black, as that colour is on white."""
STROKE = 0.1
"""Width of the lines in mm; the cut runs along their middle."""


def sheet_svg(
    contours: Sequence[Contour], sheet: Surroundings, width: float, height: float, title: str
) -> str:
    """The contours in the order given, with what surrounds them, on a page of this size in mm.

    The page's lower left corner is the origin; true arcs, coordinates without transforms.
    """
    frame = [] if sheet.frame is None else _box(*sheet.frame)
    drawn = {
        ENGRAVE: [_run(run, height) for run in sheet.engraved],
        CUT_INNER: [_closed(c, height) for c in contours if c.is_hole],
        CUT_OUTER: [_closed(c, height) for c in contours if not c.is_hole],
        CUT_SHEET: [_run(run, height) for run in sheet.parting],
        REFERENCE: [_run(frame, height)] if frame else [],
    }
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{number(width)}mm" '
            f'height="{number(height)}mm" viewBox="0 0 {number(width)} {number(height)}">',
            f"<title>{escape(title)}</title>",
            *_groups(drawn),
            "</svg>\n",
        )
    )


def _groups(drawn: dict[str, list[str]]) -> Iterator[str]:
    for layer, shapes in drawn.items():
        if shapes:
            yield (
                f'<g id="{layer}" fill="none" stroke="{COLOURS[layer]}" '
                f'stroke-width="{number(STROKE)}">'
            )
            yield from shapes
            yield "</g>"


def _box(x: float, y: float) -> list[Point]:
    return [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y), (0.0, 0.0)]


def _closed(contour: Contour, height: float) -> str:
    if contour.circle is not None:
        (x, y), radius = contour.circle
        return f'<circle cx="{number(x)}" cy="{number(height - y)}" r="{number(radius)}"/>'
    flipped = Region((contour,)).mapped(lambda p: (p[0], height - p[1]), 1.0, True)
    return f'<path d="{path_data(flipped)}"/>'


def _run(run: Sequence[Point], height: float) -> str:
    points = [f"{number(x)} {number(height - y)}" for x, y in run]
    closed = "Z" if run[0] == run[-1] else ""
    return f'<path d="M{"L".join(points[:-1] if closed else points)}{closed}"/>'
