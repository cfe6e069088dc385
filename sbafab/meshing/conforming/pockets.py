"""The pockets of a laminate as the fill needs them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc, Point
from sbafab.laminate.interfaces import Interface
from sbafab.meshing.conforming.layup import Layup
from sbafab.meshing.conforming.poisson import Lift, lift
from sbafab.models.lens import fullest as fullest_slot
from sbafab.models.parabola import fullest

if TYPE_CHECKING:
    from numpy.typing import NDArray

NEAR = 1e-3
"""mm by which a round pocket may stand off its chamber's axis."""


@dataclass(frozen=True)
class Pocket:
    """One pocket of a chamber, under film ``ply``, with the lift of the films below and above.

    ``centres`` are its stacks, as places in the layup's. ``share`` of each of them is meshed;
    ``flat_ul`` is what the meshed part holds before it is filled, ``largest_ul`` the most air
    that a balloon can hold.
    """

    chamber: str
    ply: int
    layer: int
    centres: tuple[int, ...]
    lower: Lift
    upper: Lift
    share: float
    flat_ul: float
    largest_ul: float

    def pressure(self, ul: float, lean: NDArray[np.float64]) -> float:
        """The amount of the even shape, in 1/mm, at which each balloon holds ``ul``.

        ``lean`` (2, 2) are the slopes of the lower and the upper neck disc. Raises DesignError
        where a balloon cannot hold that much.
        """
        if ul > self.largest_ul:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is more than the balloon under layer "
                f"{self.layer} can hold with a film of constant length: "
                f"ask for {math.floor(self.largest_ul * 100) / 100:.2f} ul at most"
            )
        wanted = ul * len(self.centres) * self.share
        if 0 < wanted < self.flat_ul:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is less than the gaps between flat films "
                f"hold; ask for {self.flat_ul / len(self.centres) / self.share:.2f} ul or more"
            )
        if ul == 0:
            return 0.0
        even = self.lower.volumes[0] + self.upper.volumes[0]
        leaning = lean[0] @ self.lower.volumes[1:] + lean[1] @ self.upper.volumes[1:]
        return float((wanted - self.flat_ul - leaning) / even)


def pockets(stack: Layup) -> list[Pocket]:
    """The pockets of every chamber, bottom to top; equal ones are worked out once."""
    known: dict[tuple[bytes, ...], Lift] = {}
    limits: dict[tuple[bytes, bytes], float] = {}
    return [
        _pocket(stack, chamber, ply, known, limits)
        for ply, interface in enumerate(stack.laminate.interfaces, start=1)
        if interface.kind == "chamber"
        for chamber, void in stack.voids.items()
        if ply in void.under
    ]


def _pocket(
    stack: Layup,
    chamber: str,
    ply: int,
    known: dict[tuple[bytes, ...], Lift],
    limits: dict[tuple[bytes, bytes], float],
) -> Pocket:
    plane, plies = stack.plane, stack.plies
    cells = stack.voids[chamber].under[ply]
    inner = np.unique(plane.triangles[cells])
    held = np.intersect1d(inner, np.unique(plane.triangles[plies[ply].bonded]))
    centres = tuple(i for i, owner in enumerate(stack.centre_chambers) if owner == chamber)
    places = [stack.centres[i] for i in centres]

    def lift_of(necks: NDArray[np.bool_]) -> Lift:
        key = cells.tobytes(), held.tobytes(), necks.tobytes()
        if key not in known:
            discs = list(_discs(stack, necks, held, places))
            known[key] = lift(plane, cells, held, discs)
        return known[key]

    above = plies[ply + 1].bonded if ply + 1 < len(plies) else cells & False
    lower = lift_of(cells & (plies[ply - 1].bonded | ~plies[ply - 1].cells))
    upper = lift_of(cells & (above | ~plies[ply].cells))
    share = stack.shares[chamber]
    key = cells.tobytes(), held.tobytes()
    if key not in limits:
        interface = stack.laminate.interfaces[ply - 1]
        limits[key] = _largest(stack, interface, lift_of(cells & False), held, places, share)
    return Pocket(
        chamber,
        ply,
        plies[ply].layer.index,
        centres,
        lower,
        upper,
        share,
        float(plane.areas()[cells].sum()) * plies[ply].gap,
        limits[key],
    )


def _discs(
    stack: Layup, necks: NDArray[np.bool_], held: NDArray[np.int64], places: list[Point]
) -> Iterator[tuple[NDArray[np.int64], Point]]:
    """The nodes of each neck disc, and the axis it is on."""
    nodes = np.setdiff1d(np.unique(stack.plane.triangles[necks]), held)
    offsets = stack.plane.points[nodes][:, None] - np.array(places)
    nearest = np.linalg.norm(offsets, axis=2).argmin(axis=1)
    for number, place in enumerate(places):
        if (nearest == number).any():
            yield nodes[nearest == number], place


def _largest(
    stack: Layup,
    interface: Interface,
    even: Lift,
    held: NDArray[np.int64],
    places: list[Point],
    share: float,
) -> float:
    """Most air in ul that a balloon can hold, of which ``share`` is meshed.

    A round pocket's is that of two paraboloids whose meridian keeps its length (paper Eqs. 1 to
    3), an oblong one's that of two arcs (as ``predict`` says); a drawn one holds as much more than
    the disc in it as the even lift of equal height does.
    """
    ends = _round_ends(interface, places[0])
    if len(ends) == 1:
        return 2 * fullest(ends[0][1]).volume
    if len(ends) == 2:
        (first, radius), (last, _) = ends
        return fullest_slot(2 * radius, math.dist(first, last)).volume
    offsets = stack.plane.points[held][:, None] - np.array(places)
    half = float(np.linalg.norm(offsets, axis=2).min())
    disc = math.pi * half**2 / 2
    wider = float(even.volumes[0] / even.shapes[0].max()) / disc
    return 2 * fullest(half).volume * wider / len(places) / share


def _round_ends(interface: Interface, centre: Point) -> list[tuple[Point, float]]:
    """Middles and radii of the circles that the pocket round a centre ends in.

    One on the centre where most of its edge is that circle; two of one radius and at equal
    distances on either side of it for a slot, of which at least a third of a turn is left beside
    inlet and manifold.
    """
    turns: dict[tuple[Point, float], float] = {}
    for outer in interface.unbonded.outers:
        for edge in outer.edges:
            if isinstance(edge, Arc):
                x, y = edge.centre
                place = (round(x, 5), round(y, 5)), round(edge.radius, 5)
                turns[place] = turns.get(place, 0.0) + abs(edge.sweep)
    found = sorted(place for place, turn in turns.items() if turn > math.tau / 3)
    on_centre = [one for one in found if math.dist(one[0], centre) < NEAR and turns[one] > math.pi]
    if on_centre:
        return on_centre[:1]
    for number, (first, radius) in enumerate(found):
        for last, other in found[number + 1 :]:
            middle = (first[0] + last[0]) / 2, (first[1] + last[1]) / 2
            if abs(other - radius) < NEAR and math.dist(middle, centre) < NEAR:
                return [(first, radius), (last, other)]
    return []
