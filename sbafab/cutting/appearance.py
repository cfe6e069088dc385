"""Whether a cut file's entities are shown, plotted and coloured as the shop takes them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from sbafab.cutting.cut_layers import COLOURS, REFERENCE
from sbafab.errors import OutputError

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfgfx import DXFGraphic
    from ezdxf.entities.layer import Layer

BY_LAYER = 256
PAPER = re.compile(r"(?m)^ *67\r?\n *1\r?$")
"""Where an entity may be marked as one of paper space."""
SOLID = ("continuous", "bylayer")
"""Linetypes that are drawn without gaps, in small letters; no model space entity has a block's."""


def check_appearance(document: Drawing) -> None:
    """Raises OutputError where a laser program would skip, break or re-order what is drawn.

    Every entity has to be visible, in an unbroken line, on a layer that is on, thawed and (but
    REFERENCE) plotted, and in that layer's colour. Other programs may say this in their own words:
    a colour of the entity that is the layer's, a true colour of the same red, green and blue,
    ``ByLayer`` in any letters. Layers that nothing is drawn on may look as they like, and so may
    line weights.
    """
    entities = list(document.modelspace())
    for name in dict.fromkeys(entity.dxf.layer for entity in entities):
        if name in COLOURS:
            if name not in document.layers:
                raise OutputError(f"layer {name} is not in the layer table; regenerate it.")
            _check_layer(document.layers.get(name), name)
    for entity in entities:
        if entity.dxf.layer in COLOURS:
            _check_entity(entity)


def check_space(text: str) -> None:
    """Raises OutputError for an entity that says it is in paper space, in a DXF text.

    ezdxf goes by an entity's owner alone, other programs by this.
    """
    if PAPER.search(text) is None:
        return
    lines = [line.strip() for line in text.splitlines()]
    kind, is_drawn = "", False
    for code, value in zip(lines[::2], lines[1::2], strict=False):
        if code == "0":
            kind = value
        elif code == "2" and kind == "SECTION":
            is_drawn = value == "ENTITIES"
        elif is_drawn and code == "67" and value != "0" and kind != "VIEWPORT":
            raise OutputError(f"a {kind} is in paper space; draw in model space only.")


def _check_layer(layer: Layer, name: str) -> None:
    states = (
        ("off", layer.is_off()),
        ("frozen", layer.is_frozen()),
        ("not plotted", name != REFERENCE and not layer.dxf.get("plot", 1)),
    )
    for state, holds in states:
        if holds:
            raise OutputError(f"layer {name} is {state}, so it would not be cut; regenerate it.")
    colour, linetype = abs(layer.dxf.color), layer.dxf.get("linetype", "Continuous")
    if colour != COLOURS[name] or not _is_true(layer.dxf.get("true_color"), name):
        raise OutputError(
            f"layer {name} has the colour {_shown(layer)}, not {COLOURS[name]}; regenerate it."
        )
    if linetype.lower() not in SOLID:
        raise OutputError(f"layer {name} has the linetype {linetype}; make it Continuous.")


def _check_entity(entity: DXFGraphic) -> None:
    dxf, layer = entity.dxf, entity.dxf.layer
    place = f"{entity.dxftype()} (handle {dxf.handle}) on layer {layer}"
    if dxf.get("invisible", 0):
        raise OutputError(f"{place} is invisible; show it or remove it.")
    if dxf.get("transparency") and entity.transparency > 0:
        raise OutputError(f"{place} is transparent; make it solid.")
    if dxf.get("color", BY_LAYER) not in (BY_LAYER, COLOURS[layer]) or not _is_true(
        dxf.get("true_color"), layer
    ):
        raise OutputError(
            f"{place} has the colour {_shown(entity)}, not its layer's; regenerate it."
        )
    linetype = dxf.get("linetype", "ByLayer")
    if linetype.lower() not in SOLID:
        raise OutputError(f"{place} has the linetype {linetype}; make it Continuous.")
    if dxf.get("thickness", 0.0):
        raise OutputError(f"{place} stands {dxf.thickness:g} mm high; make it flat.")


def _is_true(colour: int | None, layer: str) -> bool:
    """Whether a true colour, if there is one, is that of the layer's index."""
    if colour is None:
        return True
    from ezdxf.colors import aci2rgb, int2rgb

    own = {tuple(aci2rgb(COLOURS[layer]))}
    # Index 7 is black on white and white on black.
    both = {(0, 0, 0), (255, 255, 255)}
    return tuple(int2rgb(colour & 0xFFFFFF)) in (both if COLOURS[layer] == 7 else own)


def _shown(item: Layer | DXFGraphic) -> str:
    colour = item.dxf.get("true_color")
    return str(item.dxf.get("color")) if colour is None else f"#{colour & 0xFFFFFF:06x}"
