"""Plan views of a layer and of a laminate, as a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from sbafab.geometry.edges import Bounds
from sbafab.geometry.svg import number, path_data
from sbafab.laminate.inks import ink
from sbafab.markup import escape
from sbafab.notebook import table_html

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Laminate, Layer


SHOWN_MM = 80.0
BARS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)


def laminate_html(laminate: Laminate) -> str:
    """The laminate in plan, with what each colour is, a scale and its layers in order."""
    rows = [
        (f"{layers[0].pattern}", layers[0].film.material, layers[0].role, _numbers(layers))
        for layers in laminate.patterns.values()
    ]
    table = table_html(("pattern", "film", "role", "layers, bottom to top"), rows)
    return laminate_svg(laminate) + _legend(laminate.bounds, laminate.layers) + table


def layer_html(layer: Layer) -> str:
    """The layer in plan, with what its colour is and a scale."""
    return layer_svg(layer) + _legend(layer.profile.bounds, (layer,))


def _numbers(layers: Sequence[Layer]) -> str:
    """Layer indices, many of them as first, second ... last."""
    indices = [str(layer.index) for layer in layers]
    return ", ".join(indices if len(indices) < 6 else [*indices[:2], "...", indices[-1]])


def _legend(bounds: Bounds, layers: Iterable[Layer]) -> str:
    """A scale bar in HTML, and a swatch for each film."""
    low_x, low_y, high_x, high_y = bounds
    longer = 1.06 * max(high_x - low_x, high_y - low_y)
    bar = max((step for step in BARS if step < longer / 3), default=BARS[0])
    films = dict.fromkeys(layer.film for layer in layers)
    swatches = "".join(
        f'<span style="background:{ink(film).fill};border:1px solid '
        f'{ink(film).line}">&emsp;</span> {film.material}, {escape(film.product)}, '
        f"{number(film.thickness)} mm &ensp; "
        for film in films
    )
    width = number(bar * SHOWN_MM / longer)
    return (
        f'<div><span style="display:inline-block;width:{width}mm;border-top:2px solid">'
        f"{bar:g} mm</span> &ensp; {swatches}</div>"
    )


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
    own = ink(layer.film)
    return (
        f'<path d="{path_data(layer.profile)}" fill="{own.fill}" stroke="{own.line}" '
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
