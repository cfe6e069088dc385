"""The flat solid: TPE films and the bonds that join them."""

from __future__ import annotations

from collections.abc import Sequence

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.prisms import SAGITTA, Slab, closed_surface
from sbafab.meshing.surface import Surface


def solid_slabs(laminate: Laminate) -> list[Slab]:
    """Every TPE layer, and every bond as the mask's thickness filled with TPE, bottom to top."""
    slabs = [
        Slab(layer.profile, layer.z, layer.z + layer.film.thickness)
        for layer in laminate.tpe_layers
    ]
    slabs += [
        Slab(interface.bond, interface.z, interface.z + interface.gap)
        for interface in laminate.interfaces
        if interface.masks and not interface.bond.is_empty
    ]
    return sorted(slabs, key=lambda slab: slab.bottom)


def solid(laminate: Laminate, sagitta: float = SAGITTA, cuts: Sequence[float] = ()) -> Surface:
    """The surface of the flat actuator, pockets, bores, inlet channels and lumen open.

    Its volume is that of :func:`solid_slabs`. No face runs across the ``cuts``, x in mm. Raises
    OutputError if it does not close.
    """
    return closed_surface("the solid", solid_slabs(laminate), sagitta, cuts)
