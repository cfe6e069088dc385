"""Plan views of a layer and of a laminate, as a notebook shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import escape

from sbafab.geometry.edges import Bounds
from sbafab.geometry.svg import number, path_data

if TYPE_CHECKING:
    from sbafab.laminate.films import Material
    from sbafab.laminate.laminate import Laminate, Layer


class Ink(NamedTuple):
    """Fill and line colour of a film."""

    fill: str
    line: str


# Blue against orange: told apart in every common colour blindness, and in grey by lightness.
INK: dict[Material, Ink] = {
    "TPE": Ink("#a9cfea", "#0b4f86"),
    "PTFE": Ink("#fbe3bd", "#b35a00"),
}

SHOWN_MM = 80.0


def layer_svg(layer: Layer) -> str:
    """The layer's exact profile in plan, enlarged to fit a notebook cell."""
    title = f"{layer.name} ({layer.pattern})"
    return _document(title, layer.profile.bounds, [_profile(layer, 1.0)])


def laminate_svg(laminate: Laminate) -> str:
    """Every distinct profile in plan, bottom to top, see-through."""
    title = f"{laminate.name}: {len(laminate.layers)} layers, {number(laminate.thickness)} mm"
    shapes = [_profile(layers[0], 0.45) for layers in laminate.patterns.values()]
    return _document(title, laminate.bounds, shapes)


def _profile(layer: Layer, opacity: float) -> str:
    ink = INK[layer.film.material]
    return (
        f'<path d="{path_data(layer.profile)}" fill="{ink.fill}" stroke="{ink.line}" '
        f'fill-opacity="{number(opacity)}"/>'
    )


def _document(title: str, bounds: Bounds, shapes: list[str]) -> str:
    low_x, low_y, high_x, high_y = bounds
    margin = 0.03 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    scale = SHOWN_MM / max(width, height)
    box = " ".join(map(number, (low_x - margin, -high_y - margin, width, height)))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{number(width * scale)}mm" '
        f'height="{number(height * scale)}mm" viewBox="{box}"><title>{escape(title)}</title>'
        f'<g transform="scale(1 -1)" fill-rule="evenodd" stroke-width="{number(0.3 / scale)}">'
        f"{''.join(shapes)}</g></svg>"
    )
