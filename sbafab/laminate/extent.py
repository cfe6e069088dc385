"""How far a laminate reaches from its axis."""

from __future__ import annotations

from collections.abc import Iterable

from sbafab.geometry.region import Region
from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate


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


def beyond_the_outline(laminate: Laminate) -> str:
    """What makes the overall diameter larger than the outline's, counted: "3 inlet tabs"."""
    count = len(laminate.inlets)
    tabs = f"{count} inlet tab{'s' if count > 1 else ''}"
    return f"{tabs} and the ears" if laminate.registration == "ears" else tabs


def film_mass(laminate: Laminate) -> float:
    """Mass in g of all films, tabs and ears included; without tubing, glue and fluid.

    Raises DesignError where the density of a film is not known.
    """
    return sum(
        layer.profile.area * layer.film.thickness * density_of(layer.film) * 1e-6
        for layer in laminate.layers
    )


def _round_axis(regions: Iterable[Region]) -> float:
    return 2 * max(
        (edge.farthest_from((0.0, 0.0)) for region in regions for edge in region.edges), default=0.0
    )
