"""Tails: inlet strips run on past the tabs' ends to tooling holes, where ears register the layers.

With its channel pin the tail's one pin holds the bottom balloon's mask; a single balloon has no
bores, and its tail two holes. They stand off the strip's axis, so that no mask goes on its pins
flipped. The tails are snipped off after pressing; the masks stay in their pockets.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from sbafab.actuators.ears import Ear, check_apart, filleted
from sbafab.design.records import Design
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, strip
from sbafab.laminate.laminate import Inlet, Pin

ASIDE = 0.3
"""Share of the pin's diameter by which holes stand off the axis: flipped, they miss by 0.6."""
FAR = 500.0


@dataclass(frozen=True)
class Tail:
    """What lengthens an inlet strip: it widens to a ``head``, and that lies clear of all film."""

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
    """A tail for every inlet; none without ears.

    ``outline`` is that of all plates together, ``under`` what else is cut. Raises
    DesignError where a tail comes nearer than one overhang to an ear or to another tail.
    """
    if not ears:
        return ()
    body = filleted(outline, ears, design.fillet.radius)
    if under is not None:
        body = body | under
    made = [_tail(number, inlet, body, design) for number, inlet in enumerate(inlets, start=1)]
    heads = [(tail.name, tail.head) for tail in made]
    near_ears = product(heads, [(ear.name, ear.strip) for ear in ears])
    check_apart([*near_ears, *combinations(heads, 2)], design.mask.overhang)
    return tuple(made)


def head_reach(design: Design) -> float:
    """How far a tail's head reaches to the side from its strip's axis."""
    return (ASIDE + 0.5) * design.registration.hole_diameter + design.bond.width


def _tail(number: int, inlet: Inlet, body: Region, design: Design) -> Tail:
    bond, overhang = design.bond.width, design.mask.overhang
    pin = design.registration.hole_diameter
    own = design.registration.pin_diameter, design.registration.pin_clearance
    width = pin + 2 * bond
    (x, y), (dx, dy) = inlet.mouth, inlet.direction

    def at(distance: float, aside: float = 0.0) -> Point:
        return x + dx * distance - dy * aside, y + dy * distance + dx * aside

    ahead = strip(at(0.0), at(FAR), width + 2 * (ASIDE * pin + 2 * overhang)) & body
    reach = max((edge.farthest_along(at(0.0), (dx, dy)) for edge in ahead.edges), default=0.0)
    root = reach + overhang
    first = root + bond + pin / 2
    # Two holes in line stand apart, so that what play they have turns the mask little.
    places = [first] if design.stack.balloons > 1 else [first, first + 2 * width]
    end = places[-1] + pin / 2 + bond
    aside = ASIDE * pin
    names = [f"strip{number}"] if len(places) == 1 else [f"strip{number}.{n}" for n in (1, 2)]
    return Tail(
        f"the tail of the inlet strip of {inlet.chamber}",
        strip(at(0.0), at(end), inlet.width),
        strip(at(root, aside), at(end, aside), width),
        tuple(Pin(name, at(place, aside), *own) for name, place in zip(names, places, strict=True)),
    )


def with_tails(pockets: Region, made: Iterable[Tail]) -> Region:
    """The bottom balloon's masks with their tails, and the holes of these."""
    made = tuple(made)
    if not made:
        return pockets
    grown = union([pockets, *(part for tail in made for part in (tail.strip, tail.head))])
    return grown - union(disc(pin.centre, pin.hole / 2) for tail in made for pin in tail.pins)
