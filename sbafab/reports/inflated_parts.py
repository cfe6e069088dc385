"""Inflated parts of an assembly as solids, where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.assemblies.shapes import placed_surface
from sbafab.models.sizes import inflated_diameter
from sbafab.reports.inflated import COARSE, inflated

if TYPE_CHECKING:
    import manifold3d
    from numpy.typing import NDArray

    from sbafab.meshing.surface import Surface
    from sbafab.models.stack import Pose, Stack

    Solids = list[manifold3d.Manifold]


TOUCHING = 0.05
"""mm3 that two parts may share: touching, as in the check of the deflated assembly."""


def shared(own: Solids, theirs: Solids) -> float:
    """Mm3 that lie in both."""
    return sum(float((a ^ b).volume()) for a in own for b in theirs if apart(a, b) <= 0)


def apart(a: manifold3d.Manifold, b: manifold3d.Manifold) -> float:
    """Mm between the boxes of two solids; 0 or less where they meet."""
    one, other = (np.array(solid.bounding_box()).reshape(2, 3) for solid in (a, b))
    return float(np.maximum(one[0] - other[1], other[0] - one[1]).max())


def lifted(
    assembled: Assembled, placed: PlacedPart, rises: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """By what (3,) in mm a part is lifted by the actuators under it."""
    lift = np.zeros(3)
    while placed.part.on is not None:
        if placed.part.at == "top":
            lift = lift + rises.get(placed.part.on, 0.0)
        placed = assembled[placed.part.on]
    return lift


def carried(assembled: Assembled, name: str) -> set[str]:
    """A part and all that hangs on it."""
    found = {name}
    for part in assembled.parts:
        if part.part.on in found:
            found.add(part.name)
    return found


def solids(placed: PlacedSba, found: Stack, pose: Pose, lift: NDArray[np.float64]) -> Solids:
    """An inflated actuator's balloons and webs in a pose, in place."""
    pieces = []
    for part in inflated(placed.made.laminate, found, pose, COARSE):
        points = placed.upright(part.surface.points) + lift
        pieces += manifold(replace(part.surface, points=points)).decompose()
    return pieces


def manifold(surface: Surface) -> manifold3d.Manifold:
    import manifold3d

    faces = np.ascontiguousarray(surface.faces.astype(np.uint64))
    return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(surface.points), faces))


def as_it_is(placed: PlacedPart, lift: NDArray[np.float64]) -> Solids:
    """A part that no elastic stack inflates, its pockets filled; one round a tube is the cylinder
    that it becomes, free.
    """
    widest = None
    if placed.made is not None:
        widest = inflated_diameter(placed.made.design.form, placed.made.laminate)
    if widest is None:
        surface = placed_surface(placed, filled=True)
        return [manifold(replace(surface, points=surface.points + lift))]
    import manifold3d

    assert placed.made is not None
    _, low, _, high = placed.made.laminate.layers[0].profile.turned(placed.turn).bounds
    round_it = manifold3d.Manifold.cylinder(high - low, widest / 2).translate((0.0, 0.0, low))
    rows = np.column_stack([np.array(placed.pose.rows), np.array(placed.pose.shift) + lift])
    return [round_it.transform(rows)]
