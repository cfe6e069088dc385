"""Bores, lumen, slits and tooling holes: missing, moved, too small, too many."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.laminate import Laminate, Pin, Role
from tests.faults.record import Kind, no_lumen, redrawn
from tests.faults.specimen import Change, Picks, base, cap, mask, separator, wall

CLEAR = "channel-clear"
NOMINAL = "registration-nominal"
EARS = ('registration.method="ears"', "stack.balloons=4")
ORIGIN: Point = (0.0, 0.0)


def bore(laminate: Laminate) -> Point:
    return laminate.bores[0].centre


def aside(p: Point, by: float) -> Point:
    """A point off ``p``, away from the axis."""
    out = math.hypot(*p)
    return (p[0] + by * p[0] / out, p[1] + by * p[1] / out) if out > 1.0 else (p[0] + by, p[1])


def filled(region: Region, laminate: Laminate) -> Region:
    """Without the hole at the first bore, whatever the hole's size."""
    return region | disc(bore(laminate), 1.3)


def drilled(radius: float, by: float = 0.0) -> Change:
    """The first bore at another size or place."""
    return lambda region, laminate: (
        filled(region, laminate) - disc(aside(bore(laminate), by), radius)
    )


def holed(radius: float, by: float = 0.0) -> Change:
    """One more hole, at or beside the first bore."""
    return lambda region, laminate: region - disc(aside(bore(laminate), by), radius)


def slit(region: Region, laminate: Laminate) -> Region:
    x, y = aside(bore(laminate), 1.2)
    return region - rectangle((x - 0.05, y - 0.3), (x + 0.05, y + 0.3))


def cut_in_two(region: Region, laminate: Laminate) -> Region:
    x, _ = bore(laminate)
    low, high = region.bounds[1] - 1.0, region.bounds[3] + 1.0
    return region - rectangle((x + 1.2, low), (x + 1.6, high))


def lumen_of(radius: float) -> Change:
    return lambda region, laminate: (region | disc(ORIGIN, 1.2)) - disc(ORIGIN, radius)


def _near(place: Point, others: Iterable[Point]) -> bool:
    return any(math.dist(place, other) < 1e-6 for other in others)


def first_pin(region: Region, laminate: Laminate) -> Pin:
    """The first pin of the ears that a layer has a hole for."""
    bores = [bore.centre for bore in laminate.bores]
    drilled = [hole.circle[0] for hole in region.holes if hole.circle]
    return next(
        pin for pin in laminate.pins if not _near(pin.centre, bores) and _near(pin.centre, drilled)
    )


def tooling_hole(by: float | None) -> Change:
    """A layer's first tooling hole closed, or moved."""

    def change(region: Region, laminate: Laminate) -> Region:
        pin = first_pin(region, laminate)
        closed = region | disc(pin.centre, pin.diameter / 2 + 0.1)
        return closed if by is None else closed - disc(aside(pin.centre, by), pin.diameter / 2)

    return change


def of_roles(*roles: Role) -> Picks:
    return lambda laminate: [layer for layer in laminate.layers if layer.role in roles]


KIND = Kind(
    "Bores, lumen, slits",
    "The bore is that of the first chamber; it is moved by 0.15 mm.",
    (
        redrawn("bore missing in a wall", "sealing", wall, filled),
        redrawn("bore missing in a chamber mask", CLEAR, mask, filled),
        redrawn("bore missing in a separator", CLEAR, separator, filled),
        redrawn("bore moved in a wall", NOMINAL, wall, drilled(0.5, 0.15)),
        redrawn("bore moved in a chamber mask", NOMINAL, mask, drilled(0.5, 0.15)),
        redrawn("bore moved in a separator", NOMINAL, separator, drilled(1.25, 0.15)),
        redrawn("bore too small in a wall", CLEAR, wall, drilled(0.4)),
        redrawn("bore too small in a chamber mask", CLEAR, mask, drilled(0.4)),
        redrawn("bore too small for its pin in a wall", "pin-fit", wall, drilled(0.45)),
        redrawn("bore too large in a wall", "bond-width", wall, drilled(0.6)),
        redrawn("bore too large in a chamber mask", "bond-width", mask, drilled(0.6)),
        redrawn("hole in the base", "sealing", base, holed(0.3, 1.7)),
        redrawn("hole in the cap", "sealing", cap, holed(0.3, 1.7)),
        redrawn("hole in a wall", "sealing", wall, holed(0.3, 1.7)),
        redrawn("two bores 0.1 apart", "film-limits", wall, holed(0.2, 0.8)),
        redrawn("slit of 0.1 in a wall", "film-limits", wall, slit),
        redrawn("wall cut in two", "piece-count", wall, cut_in_two),
        redrawn(
            "lumen blocked in the cap", CLEAR, cap, lambda r, _: r | disc(ORIGIN, 1.2), no_lumen
        ),
        redrawn(
            "lumen blocked in a separator",
            CLEAR,
            separator,
            lambda r, _: r | disc(ORIGIN, 1.2),
            no_lumen,
        ),
        redrawn("lumen too small in the base", CLEAR, base, lumen_of(0.9), no_lumen),
    ),
)

EARS_KIND = Kind(
    "Tooling holes",
    'Put into the output with `registration.method = "ears"`, of 4 balloons: what most layers of a '
    "role have is taken for meant.",
    tuple(
        redrawn(f"tooling hole {name}", rule, pick, tooling_hole(by), settings=EARS)
        for name, rule, pick, by in (
            ("missing in a wall", NOMINAL, wall, None),
            ("moved by 0.15 in a wall", NOMINAL, wall, 0.15),
            ("missing in a separator", NOMINAL, separator, None),
            ("moved by 0.15 in a separator", NOMINAL, separator, 0.15),
            # The plate has its pin.
            ("missing in all films", "pin-holes", of_roles("base", "wall", "cap"), None),
            ("missing in all separators", "pin-holes", of_roles("separator-mask"), None),
        )
    ),
)
