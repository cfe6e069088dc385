"""Overall sizes in closed form, each with the paper's figure it answers to."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sbafab.design.form import Form, Slots, Wrap
from sbafab.design.records import Design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate


def sizes(design: Design, laminate: Laminate) -> dict[str, float]:
    """Sizes in mm by name: of the flat laminate and, for radial designs, round the tube.

    Width, length and overall diameter are those of all that is cut: masks, inlet tabs and ears
    belong to them. The outline diameter is that of the films without tabs and ears.
    """
    low_x, low_y, high_x, high_y = laminate.bounds
    found = {
        "thickness": laminate.thickness,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    form = design.form
    if form.wrap is not None:
        found["pitch"] = form.wrap.pitch
        found["deflated_diameter"] = deflated_diameter(form.wrap, laminate)
        inflated = inflated_diameter(form, laminate)
        if inflated is not None:
            found["inflated_diameter"] = inflated
    else:
        if not laminate.outline.is_empty:
            found["outline_diameter"] = outline_diameter(laminate)
        found["overall_diameter"] = overall_diameter(laminate)
    return found


def outline_diameter(laminate: Laminate) -> float:
    """Diameter of the circle round the axis that holds all films, tabs and ears taken off.

    The paper's 3-DoF actuator fits 15 (Sec. 2). Measured on every film as it is cut: what of it
    lies within the laminate's outline.
    """
    films = {layer.pattern: layer.profile for layer in laminate.tpe_layers}
    return _round_axis(Region(film.outers) & laminate.outline for film in films.values())


def overall_diameter(laminate: Laminate) -> float:
    """Diameter of the circle round the axis that holds every layer, with tabs, tails and ears."""
    return _round_axis(layers[0].profile for layers in laminate.patterns.values())


def _round_axis(regions: Iterable[Region]) -> float:
    return 2 * max(
        (edge.farthest_from((0.0, 0.0)) for region in regions for edge in region.edges), default=0.0
    )


def deflated_diameter(wrap: Wrap, laminate: Laminate) -> float:
    """Tube plus the flat laminate on both sides; the paper gives 15.33 (Sec. 2.1)."""
    return wrap.tube_diameter + 2 * laminate.thickness


def inflated_diameter(form: Form, laminate: Laminate) -> float | None:
    """Tube plus fully inflated SBAs; the paper gives about 28 (Sec. 2.1).

    None without a tube, or for pockets of another shape. A flat pocket of width w whose films do
    not stretch becomes a cylinder of diameter 2 w / pi.
    """
    if form.wrap is None or not isinstance(form.pockets, Slots):
        return None
    height = laminate.balloons * 2 * form.pockets.width / math.pi
    return form.wrap.tube_diameter + 2 * (height + laminate.thickness)
