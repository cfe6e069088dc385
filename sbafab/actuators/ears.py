"""Ears and tails: tooling holes outside the outline that register a layer in every press step.

TPE layers and separator masks have separate ears, on separate pins: if a mask were flush with a
film's tooling hole, film would melt around the pin. Beyond its root a TPE ear is therefore free of
mask, and bonds; all ears are cut off after pressing. The two ears of a part are at unequal
distances, so that it fits on its pins in one position only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, disc, strip, union
from sbafab.laminate.laminate import Inlet, Pin

Holder = Literal["film", "mask", "sheet"]
Named = tuple[str, Region]
"""A part, and its name in messages."""
NOTE = (
    "ears are cut, pressed and meshed with the actuator: snip them off along the outline, and the "
    "tails of the inlet strips at the tab's end"
)
LONGER = {"film": (0.0, 2.0), "mask": (1.0, 3.0), "sheet": (0.0, 2.0)}
"""Offsets of the first and second ear of a part, mm, all different, so that a turned or flipped
film does not fit on the masks' pins either."""
FAR = 500.0
ROUNDING = 1e-6


def reach(region: Region, direction: Point) -> float:
    """Return the extent of the region from (0, 0) along a unit direction, mm."""
    turn = -math.degrees(math.atan2(direction[1], direction[0]))
    return region.turned(turn).bounds[2]


@dataclass(frozen=True)
class Ray:
    """A ray for an ear: it starts inside the part and runs outward.

    ``long`` is the second ear of its part. A mask ear that starts beside its mask is joined to it
    from ``joint``, a point of the mask.
    """

    name: str
    holder: Holder
    start: Point
    direction: Point
    long: bool
    joint: Point | None = None

    def at(self, distance: float, aside: float = 0.0) -> Point:
        """Return a point on the ray, or to the left of it."""
        (x, y), (dx, dy) = self.start, self.direction
        return x + dx * distance - dy * aside, y + dy * distance + dx * aside

    def reach(self, body: Region, width: float) -> float:
        """Return the extent of a body along the ray, in a band of this width, mm."""
        (x, y), band = self.start, strip(self.start, self.at(FAR), width) & body
        return 0.0 if band.is_empty else reach(band.moved(-x, -y), self.direction)


@dataclass(frozen=True)
class Ear:
    """An ear on its ray, free of masks from ``root`` to its ``end``; its ``pin``."""

    ray: Ray
    root: float
    end: float
    width: float
    pin: Pin

    @property
    def name(self) -> str:
        return f"the ear {self.ray.name}"

    @property
    def strip(self) -> Region:
        return strip(self.ray.start, self.ray.at(self.end), self.width)


def film_setback(design: Design) -> float:
    """Return the setback of the TPE's bores and lumen from the masks', mm.

    With channel pins all share the pin's edge; without pins, every mask overhangs.
    """
    return 0.0 if design.registration.method == "channel-pin" else design.mask.overhang


def placed(rays: Sequence[Ray], body: Region, plates: Region, design: Design) -> tuple[Ear, ...]:
    """Return ears on their rays, with roots clear of ``body``: all cut parts, without ears.

    ``plates`` are the films that masks separate; their fillets beside the ears also end at the
    root. Raises DesignError if a film ear starts outside the films, if two ears are closer than one
    overhang, or if fillets fill the room beside an ear.
    """
    overhang, radius = design.mask.overhang, design.fillet.radius
    # In the way of an ear and the mask round it.
    band = _width(design) + 4 * overhang
    for ray in rays:
        if ray.holder == "film" and not plates.contains(ray.start):
            x, y = ray.start
            raise DesignError(
                f"the ear {ray.name} starts at x {x:.3f}, y {y:.3f}, outside the films; enlarge "
                'the chamber there, or use registration.method = "channel-pin"'
            )
    roots = [r.reach(body, band) + radius + overhang + LONGER[r.holder][r.long] for r in rays]
    ears = [_ear(ray, root, design) for ray, root in zip(rays, roots, strict=True)]
    # At a sharp angle to its neighbour, an ear's fillet reaches farther out.
    spread = filleted(plates, ears, radius)
    ears = [
        _ear(ear.ray, max(ear.root, ear.ray.reach(spread, band) + overhang), design) for ear in ears
    ]
    spread = filleted(plates, ears, radius)
    for ear in ears:
        if ear.ray.reach(spread, band) + overhang > ear.root + ROUNDING:
            raise DesignError(
                f"fillet.radius = {radius:g} fills the room beside {ear.name}; make it smaller, "
                'or use registration.method = "channel-pin"'
            )
    outer = [(e.name, strip(e.ray.at(e.root), e.ray.at(e.end), e.width)) for e in ears]
    check_apart(combinations(outer, 2), overhang)
    return tuple(ears)


def _width(design: Design) -> float:
    """Return the width of an ear or a tail's head: a hole, and a bond around it."""
    return design.registration.hole_diameter + 2 * design.bond.width


def _ear(ray: Ray, root: float, design: Design) -> Ear:
    half = design.registration.hole_diameter / 2
    hole = root + design.bond.width + half
    end = hole + half + design.bond.width
    return Ear(ray, root, end, _width(design), _pin(ray.name, ray.at(hole), design))


def _pin(name: str, place: Point, design: Design) -> Pin:
    registration = design.registration
    return Pin(name, place, registration.pin_diameter, registration.pin_clearance)


def with_film_ears(outline: Region, ears: Sequence[Ear], radius: float) -> Region:
    """A TPE outline with its ears and filleted concave corners, for each piece separately."""
    if not ears:
        return outline
    strips = [(ear.ray.start, ear.strip) for ear in ears if ear.ray.holder == "film"]
    return union(
        fillet(union([piece, *(s for start, s in strips if piece.contains(start))]), radius)
        for piece in outline.pieces
    )


def filleted(outline: Region, ears: Sequence[Ear], radius: float) -> Region:
    """Return a TPE outline with the fillets beside its ears, without the ears themselves."""
    strips = union(ear.strip for ear in ears if ear.ray.holder == "film")
    return with_film_ears(outline, ears, radius) - (strips - outline)


def film_holes(ears: Sequence[Ear]) -> Region:
    return _holes(ears, "film")


def _holes(ears: Sequence[Ear], holder: Holder) -> Region:
    return _openings(ear.pin for ear in ears if ear.ray.holder == holder)


def _openings(pins: Iterable[Pin]) -> Region:
    return union(disc(pin.centre, pin.hole / 2) for pin in pins)


def with_mask_ears(mask: Region, ears: Sequence[Ear], overhang: float) -> Region:
    """A separator mask, grown from an eared outline, with its own ears and clear of film ears."""
    if not ears:
        return mask
    beyond = [
        strip(ear.ray.at(ear.root), ear.ray.at(ear.end + 2 * overhang), ear.width + 3 * overhang)
        for ear in ears
        if ear.ray.holder == "film"
    ]
    mask_ears = [ear for ear in ears if ear.ray.holder == "mask"]
    bars = [strip(e.ray.joint, e.ray.start, e.width) for e in mask_ears if e.ray.joint]
    eared = union([mask - union(beyond), *(ear.strip for ear in mask_ears), *bars])
    if bars:
        # No slot remains between a bar and the mask.
        eared = fillet(eared, overhang) - union(beyond)
    return eared - _holes(ears, "mask")


def with_sheet_ears(sheet: Region, ears: Sequence[Ear], radius: float) -> Region:
    """Return the sheet of a radial laminate with its ears and their holes."""
    strips = [ear.strip for ear in ears if ear.ray.holder == "sheet"]
    return fillet(union([sheet, *strips]), radius) - _holes(ears, "sheet") if strips else sheet


def check_apart(pairs: Iterable[tuple[Named, Named]], overhang: float) -> None:
    """Raise DesignError if two parts are closer than one overhang."""
    for (name, part), (name_b, neighbour) in pairs:
        if not (grow(part, overhang) & neighbour).is_empty:
            raise DesignError(
                f"{name} and {name_b} meet; make the chambers larger or registration.pin_diameter "
                'smaller, or use registration.method = "channel-pin"'
            )


# Tails: inlet strips continue past the tabs' ends to tooling holes, if ears register the layers.
#
# With its channel pin the tail's one pin holds the bottom balloon's mask; a single balloon has no
# bores, and its tail two holes. They are off the strip's axis, so that no flipped mask fits on its
# pins. The tails are cut off after pressing; the masks stay in their pockets.


ASIDE = 0.3
"""Offset of holes from the axis, as a share of the pin's diameter: flipped, they miss by 0.6."""


@dataclass(frozen=True)
class Tail:
    """The end of an inlet strip: it widens to a ``head``, which is clear of all film."""

    name: str
    strip: Region
    head: Region
    pins: tuple[Pin, ...]


def tails(
    inlets: Sequence[Inlet],
    outline: Region,
    ears: Sequence[Ear],
    design: Design,
    under: Region | None = None,
) -> tuple[Tail, ...]:
    """Return a tail for every inlet; none without ears.

    ``outline`` is the union of all plates, ``under`` other cut parts. Raises DesignError if a tail
    is closer than one overhang to an ear or another tail.
    """
    if not ears:
        return ()
    body = filleted(outline, ears, design.fillet.radius)
    if under is not None:
        body = body | under
    result = [_tail(number, inlet, body, design) for number, inlet in enumerate(inlets, start=1)]
    heads = [(tail.name, tail.head) for tail in result]
    near_ears = product(heads, [(ear.name, ear.strip) for ear in ears])
    check_apart([*near_ears, *combinations(heads, 2)], design.mask.overhang)
    return tuple(result)


def head_reach(design: Design) -> float:
    """Return the lateral reach of a tail's head from its strip's axis, mm."""
    return (ASIDE + 0.5) * design.registration.hole_diameter + design.bond.width


def _tail(number: int, inlet: Inlet, body: Region, design: Design) -> Tail:
    overhang, width = design.mask.overhang, _width(design)
    aside = ASIDE * design.registration.hole_diameter
    axis = Ray(inlet.chamber, "mask", inlet.mouth, inlet.direction, False)
    root = axis.reach(body, width + 2 * (aside + 2 * overhang)) + overhang
    bond, half = design.bond.width, design.registration.hole_diameter / 2
    first = root + bond + half
    # Two holes in line are far apart, so that their play turns the mask little.
    places = {f"strip{number}": first}
    if design.stack.balloons == 1:
        places = {f"strip{number}.1": first, f"strip{number}.2": first + 2 * width}
    end = max(places.values()) + half + bond
    return Tail(
        f"the tail of the inlet strip of {inlet.chamber}",
        strip(inlet.mouth, axis.at(end), inlet.width),
        strip(axis.at(root, aside), axis.at(end, aside), width),
        tuple(_pin(name, axis.at(place, aside), design) for name, place in places.items()),
    )


def with_tails(pockets: Region, inlet_tails: Sequence[Tail]) -> Region:
    """Return the bottom balloon's masks with their tails, which have holes for the pins."""
    parts = [part for tail in inlet_tails for part in (tail.strip, tail.head)]
    return union([pockets, *parts]) - _openings(pin for tail in inlet_tails for pin in tail.pins)
