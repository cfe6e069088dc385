"""Ears: tooling holes outside the outline that register a layer in every press step.

TPE layers and separator masks have ears of their own, on pins of their own: where a mask lay
flush with a film's tooling hole, film would melt round the pin. Beyond its root a TPE ear is
therefore free of mask, and bonds; all ears are snipped off after pressing. The two ears of a part
stand at unequal distances, so that it goes on its pins in one position only.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, strip
from sbafab.laminate.laminate import Pin

Holder = Literal["film", "mask", "sheet"]
NOTE = "ears are cut, pressed and meshed with the actuator: snip them off along the outline"
LONGER = {"film": (0.0, 2.0), "mask": (1.0, 3.0), "sheet": (0.0, 2.0)}
"""mm by which the first and second ear of a part stand off, all different, so that a film that is
turned or flipped does not go on the masks' pins either."""
FAR = 500.0


@dataclass(frozen=True)
class Ray:
    """Where an ear may stand: it starts inside the part and runs outward.

    ``long`` is the second ear of its part.
    """

    name: str
    holder: Holder
    start: Point
    direction: Point
    long: bool

    def at(self, distance: float) -> Point:
        return (
            self.start[0] + self.direction[0] * distance,
            self.start[1] + self.direction[1] * distance,
        )


@dataclass(frozen=True)
class Ear:
    """An ear on its ray: masks leave it free from ``root`` on, the hole's centre is at ``hole``."""

    ray: Ray
    root: float
    hole: float
    end: float
    width: float
    pin_diameter: float

    @property
    def strip(self) -> Region:
        return strip(self.ray.start, self.ray.at(self.end), self.width)

    @property
    def pin(self) -> Pin:
        return Pin(self.ray.name, self.ray.at(self.hole), self.pin_diameter)


def film_setback(design: Design) -> float:
    """How far bores and lumen of the TPE stand back from those of the masks.

    With channel pins all share the pin's edge; with ears every mask overhangs.
    """
    return design.mask.overhang if design.registration.method == "ears" else 0.0


def placed(rays: Iterable[Ray], body: Region, design: Design) -> tuple[Ear, ...]:
    """Ears on their rays, their roots clear of ``body``: all that is cut, without ears.

    Raises DesignError where two ears come nearer to each other than one overhang.
    """
    overhang, bond = design.mask.overhang, design.bond.width
    pin = design.registration.pin_diameter
    width = pin + 2 * bond
    ears = []
    for ray in rays:
        band = strip(ray.start, ray.at(FAR), width + 4 * overhang) & body
        reach = max(
            (edge.farthest_along(ray.start, ray.direction) for edge in band.edges), default=0.0
        )
        root = reach + design.fillet.radius + overhang + LONGER[ray.holder][ray.long]
        hole = root + bond + pin / 2
        ears.append(Ear(ray, root, hole, hole + pin / 2 + bond, width, pin))
    _check_apart(ears, overhang)
    return tuple(ears)


def with_film_ears(outline: Region, ears: Sequence[Ear], radius: float) -> Region:
    """A TPE outline with its ears, their concave corners filleted."""
    own = [ear.strip for ear in ears if ear.ray.holder == "film"]
    return fillet(union([outline, *own]), radius) if own else outline


def film_holes(ears: Sequence[Ear]) -> Region:
    return _holes(ears, "film")


def _holes(ears: Sequence[Ear], holder: Holder) -> Region:
    own = [ear for ear in ears if ear.ray.holder == holder]
    return union(disc(ear.pin.centre, ear.pin_diameter / 2) for ear in own) if own else Region()


def with_mask_ears(mask: Region, ears: Sequence[Ear], overhang: float) -> Region:
    """A separator mask, grown from an eared outline, that leaves film ears free and has its own."""
    if not ears:
        return mask
    beyond = [
        strip(ear.ray.at(ear.root), ear.ray.at(ear.end + 2 * overhang), ear.width + 3 * overhang)
        for ear in ears
        if ear.ray.holder == "film"
    ]
    own = [
        strip(ear.ray.start, ear.ray.at(ear.end), ear.width)
        for ear in ears
        if ear.ray.holder == "mask"
    ]
    return union([mask - union(beyond), *own]) - _holes(ears, "mask")


def with_sheet_ears(sheet: Region, ears: Sequence[Ear], radius: float) -> Region:
    """The sheet of a radial laminate with its own ears and their holes."""
    own = [ear.strip for ear in ears if ear.ray.holder == "sheet"]
    return fillet(union([sheet, *own]), radius) - _holes(ears, "sheet") if own else sheet


def _check_apart(ears: Sequence[Ear], overhang: float) -> None:
    for i, one in enumerate(ears):
        outer = grow(_outer(one), overhang)
        for other in ears[:i]:
            if not (outer & _outer(other)).is_empty:
                raise DesignError(
                    f"the ears {other.ray.name} and {one.ray.name} meet; make the chambers larger "
                    "or registration.pin_diameter smaller, or use registration.method = "
                    '"channel-pin"'
                )


def _outer(ear: Ear) -> Region:
    """The part of an ear that lies beyond its root."""
    return strip(ear.ray.at(ear.root), ear.ray.at(ear.end), ear.width)
