"""Bores and tooling holes found in the profiles: what most layers agree on, not what one says."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Contour
from sbafab.laminate.laminate import LOOSE, Layer

ORIGIN: Point = (0.0, 0.0)


class Opening(NamedTuple):
    """A hole that many layers have at about one place: medians, and in how many layers."""

    centre: Point
    diameter: float
    layers: int


def bores(layers: Sequence[Layer], stated: float, lumen: float | None) -> list[Opening]:
    """The channel bores, bottom to top the same place in walls and chamber masks.

    A place counts where most of those layers and half of the masks have a hole within half of
    the ``stated`` diameter, so that one layer's missing or moved hole does not hide.
    """
    masks = [layer for layer in layers if layer.role == "chamber-mask"]
    bored = [layer for layer in layers if layer.role in ("wall", "chamber-mask")]
    if len(masks) < 2:
        return []
    found = [
        opening
        for opening in openings(bored, stated / 2)
        if 2 * opening.layers > len(bored)
        and 2 * _near(opening.centre, masks, stated / 2) >= len(masks)
    ]
    if lumen is None:
        return found
    return [opening for opening in found if math.dist(opening.centre, ORIGIN) > lumen / 2]


def tooling(layers: Sequence[Layer], pin_diameter: float, taken: Iterable[Point]) -> list[Opening]:
    """Pin holes of ears and tails: in most TPE layers, most separator masks, the sheet or the
    lowest chamber mask, nowhere else.
    """
    places = list(taken)

    def fits(hole: Contour) -> bool:
        circle = hole.circle
        return circle is not None and abs(2 * circle[1] - pin_diameter) < LOOSE

    groups = (
        [layer for layer in layers if layer.role in ("base", "wall", "cap")],
        [layer for layer in layers if layer.role == "separator-mask"],
        [layer for layer in layers if layer.role == "sheet"],
        [layer for layer in layers if layer.role == "chamber-mask"][:1],
    )
    return [
        opening
        for group in groups
        for opening in openings(group, LOOSE, fits)
        if 2 * opening.layers > len(group)
        and all(math.dist(opening.centre, place) > pin_diameter for place in places)
    ]


def openings(
    layers: Sequence[Layer], nearness: float, fits: Callable[[Contour], bool] = lambda hole: True
) -> list[Opening]:
    """Holes of all layers gathered by place, in the order of their first layer."""
    from statistics import median

    places: list[list[tuple[Point, float]]] = []
    for layer in layers:
        for hole in filter(fits, layer.profile.holes):
            centre, diameter = _place(hole)
            group = next((g for g in places if math.dist(g[0][0], centre) < nearness), None)
            if group is None:
                places.append(group := [])
            group.append((centre, diameter))
    return [
        Opening(
            (median(c[0] for c, _ in group), median(c[1] for c, _ in group)),
            median(d for _, d in group),
            len(group),
        )
        for group in places
    ]


def _near(place: Point, layers: Iterable[Layer], nearness: float) -> int:
    """How many layers have a hole at the place."""
    return sum(
        any(math.dist(_place(hole)[0], place) < 2 * nearness for hole in layer.profile.holes)
        for layer in layers
    )


def _place(hole: Contour) -> tuple[Point, float]:
    if hole.circle is not None:
        centre, radius = hole.circle
        return centre, 2 * radius
    low_x, low_y, high_x, high_y = hole.bounds
    return ((low_x + high_x) / 2, (low_y + high_y) / 2), min(high_x - low_x, high_y - low_y)
