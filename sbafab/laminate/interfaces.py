"""Interfaces: what bonds and what stays open between two consecutive TPE layers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from sbafab.geometry.boolean import divided, union
from sbafab.geometry.once import once
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Layer

InterfaceKind = Literal["chamber", "separator", "bond"]
"""``bond`` is an interface without a mask: the films bond all over."""


@dataclass(frozen=True)
class Interface:
    """Two TPE layers, below and above, and the masks between them.

    contact: where both layers are; bond: contact without mask; unbonded: contact under mask.
    ``balloon`` is the balloon a chamber interface lies in, or the one below a separator.
    """

    index: int
    kind: InterfaceKind
    below: Layer
    above: Layer
    masks: tuple[Layer, ...]
    mask: Region
    contact: Region
    bond: Region
    unbonded: Region

    @staticmethod
    def between(
        index: int,
        below: Layer,
        above: Layer,
        masks: Sequence[Layer],
        regions: tuple[Region, Region, Region, Region],
    ) -> Interface:
        kind: InterfaceKind = "bond"
        if masks:
            kind = "chamber" if masks[0].role == "chamber-mask" else "separator"
        return Interface(index, kind, below, above, tuple(masks), *regions)

    @property
    def gap(self) -> float:
        """Height in mm between the two layers: the thickness of the masks."""
        return sum(mask.film.thickness for mask in self.masks)

    @property
    def z(self) -> float:
        """Height of the gap's lower face."""
        return self.below.z + self.below.film.thickness

    @property
    def layer_indices(self) -> tuple[int, ...]:
        return (self.below.index, *(mask.index for mask in self.masks), self.above.index)

    @once
    def pattern(self) -> tuple[str, ...]:
        """Equal for interfaces made of equal profiles."""
        return (
            self.below.pattern,
            *(mask.pattern for mask in self.masks),
            self.above.pattern,
        )


def interface_regions(
    below: Region, above: Region, masks: Sequence[Region]
) -> tuple[Region, Region, Region, Region]:
    """Mask, contact, bond and unbonded region of two TPE profiles with masks between."""
    mask = union(masks)
    _, contact = (None, below) if below.contours == above.contours else divided(below, above)
    return mask, contact, *divided(contact, mask)
