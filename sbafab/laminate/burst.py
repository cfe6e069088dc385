"""Burst pressure of a laminate, scaled from the burst tests of the paper: the limit for a proof
test, and a bound that working pressures must stay well below.

The paper burst three actuators with pockets of 5 mm in its film of 0.038 mm, at 367 +- 18 kPa (Sec.
4, 7). A thin film of radius r and thickness t under p has a stress of p r / 2 t in a sphere and p r
/ t in a cylinder: a long pocket of width w becomes a cylinder of radius w / pi. The burst pressure
is scaled by film stress alone; lengths in mm, pressures in kPa.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sbafab.errors import BeyondError
from sbafab.geometry.cache import stored
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow, shrink
from sbafab.geometry.region import Region
from sbafab.geometry.width import InscribedDisc, inscribed_disc
from sbafab.laminate.films import PAPER_BURST, PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.laminate.laminate import Interface, Laminate

RADIUS = 2.5
"""Pocket diameter in the burst tests, mm."""
NOT_BURST = "no burst test of this film is known; burst one actuator"
ROUND = 1.05
"""Largest area of a round pocket without its strips, relative to its largest disc; ours. Others
count as infinitely long cylinders."""


class Burst(NamedTuple):
    """An estimate of the pressure in kPa at which the weakest pocket bursts.

    ``radius`` is that of a sphere with the same film stress, mm; ``thickness`` that of the pocket's
    thinner film, mm; ``centre`` the middle of its widest place in the ``interface``.
    """

    kpa: float
    radius: float
    thickness: float
    is_round: bool
    interface: Interface
    centre: Point


def burst(laminate: Laminate) -> Burst | None:
    """Return the burst estimate of a laminate, from its profiles; None without a pocket, or if a
    film is not the product used in the burst tests.
    """
    return stored(laminate, "_burst", _burst)


def refuse_beyond_burst(laminate: Laminate, kpa: float) -> None:
    """Raise BeyondError if a pressure in kPa exceeds the estimated burst pressure of a laminate."""
    estimate = burst(laminate)
    if estimate is not None and kpa > estimate.kpa:
        raise BeyondError(
            f"{kpa:g} kPa exceeds the estimated burst pressure of {estimate.kpa:.3g} kPa; lower "
            "the pressure, or use narrower pockets or thicker film",
            kpa / estimate.kpa - 1,
        )


def is_near_burst(laminate: Laminate, kpa: float) -> bool:
    """Return True for a pressure in kPa above half of the estimated burst pressure."""
    estimate = burst(laminate)
    return estimate is not None and kpa > estimate.kpa / 2


def _burst(laminate: Laminate) -> Burst | None:
    if any(layer.film.product != PAPER_PRODUCT for layer in laminate.tpe_layers):
        return None
    patterns = {i.pattern: i for i in laminate.interfaces if i.kind == "chamber"}
    pockets = [_pocket(interface) for interface in patterns.values()]
    return min((pocket for pocket in pockets if pocket), key=lambda each: each.kpa, default=None)


def _pocket(interface: Interface) -> Burst | None:
    """Return the estimate for an interface's widest pocket; None without one."""
    open_film = _spanned(interface)
    if open_film.is_empty:
        return None
    disc = inscribed_disc(open_film)
    is_round = _is_round(open_film, disc)
    radius = disc.radius if is_round else 4 * disc.radius / math.pi
    thickness = min(interface.below.film.thickness, interface.above.film.thickness)
    kpa = PAPER_BURST[0] * RADIUS / radius * thickness / PAPER_THICKNESS
    return Burst(kpa, radius, thickness, is_round, interface, disc.centre)


def _spanned(interface: Interface) -> Region:
    """Return the unbonded film, with bores and vias, that the other film spans."""
    kept = [c for c in interface.unbonded.contours if not c.is_hole or _holds(c, interface.bond)]
    return Region(tuple(kept))


def _holds(hole: Contour, bond: Region) -> bool:
    """Return True if the films are bonded in most of a hole of the unbonded film."""
    inside = Region((hole.reversed(),))
    return (inside & bond).area > inside.area / 2


def _is_round(region: Region, disc: InscribedDisc) -> bool:
    piece = next(piece for piece in region.pieces if piece.contains(disc.centre))
    without_strips = grow(shrink(piece, disc.radius / 2), disc.radius / 2)
    core = next(part for part in without_strips.pieces if part.contains(disc.centre))
    return core.area <= ROUND * math.pi * disc.radius**2
