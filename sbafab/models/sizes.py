"""Overall sizes in closed form, each with the paper's figure it answers to."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sbafab.actuators.radial import RadialDesign
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
    if isinstance(design, RadialDesign):
        found |= {
            "pitch": design.pitch,
            "deflated_diameter": deflated_diameter(design, laminate),
        }
        if design.chamber.outline is None:
            found["inflated_diameter"] = inflated_diameter(design, laminate)
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


def deflated_diameter(design: RadialDesign, laminate: Laminate) -> float:
    """Tube plus the flat laminate on both sides; the paper gives 15.33 (Sec. 2.1)."""
    return design.tube.outer_diameter + 2 * laminate.thickness


def inflated_diameter(design: RadialDesign, laminate: Laminate) -> float:
    """Tube plus fully inflated SBAs; the paper gives about 28 (Sec. 2.1).

    A flat pocket of width w whose films do not stretch becomes a cylinder of diameter 2 w / pi.
    """
    pocket = min(design.chamber.width, design.chamber.length) - 2 * design.bond.width
    height = design.stack.balloons * 2 * pocket / math.pi
    return design.tube.outer_diameter + 2 * (height + laminate.thickness)
