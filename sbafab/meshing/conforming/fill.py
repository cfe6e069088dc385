"""Films lifted by an equal amount of air in every balloon, and balloons stacked.

The lift is vertical in the flat laminate's frame, so no element changes its volume. Balloons are
then stacked on their neck discs. Films stretch along the meridian (1 % at 5 ul in the paper's 5 mm
balloon) and thin accordingly; the flat mesh is the rest position for solvers that use one.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc, Point
from sbafab.laminate.laminate import Interface
from sbafab.meshing.conforming.layup import Layup, bodies, flat
from sbafab.meshing.conforming.mesh import integrals
from sbafab.meshing.conforming.plane import MISSING, Plane
from sbafab.meshing.surface import Flags, Floats, Ints
from sbafab.models.closed_forms import eqs_1_to_3, lens

# The lift of one film: Poisson's equation on the triangles of a pocket.


class Lift(NamedTuple):
    """Shape (plane nodes,) in mm2 of a film over a pocket under uniform pressure.

    ``plateau`` is its height at the (first) neck disc, 0 without one, ``volume`` the enclosed
    volume.
    """

    shape: Floats
    plateau: float
    volume: float


def lift(plane: Plane, pocket: Flags, fixed: Ints, discs: list[Ints]) -> Lift:
    """Return the rise of the film over a pocket: -lap w = 1, w = 0 at the ``fixed`` nodes.

    ``discs`` are the nodes of each neck, which rise together. For a round pocket without a neck
    this is the paraboloid of the paper's Eq. 1.
    """
    try:
        from scipy.sparse import coo_matrix, csr_matrix
        from scipy.sparse.linalg import splu
    except ImportError:
        raise DesignError(MISSING.format("scipy")) from None
    triangles = plane.triangles[pocket]
    stiffness, load = integrals(plane.points, triangles)
    count = len(plane.points)
    rows = np.repeat(triangles, 6, axis=1).ravel()
    columns = np.tile(triangles, (1, 6)).ravel()
    matrix = coo_matrix((stiffness.ravel(), (rows, columns)), shape=(count, count)).tocsr()
    weights = np.bincount(triangles.ravel(), load.ravel(), count)

    # Each unknown moves one node, or all nodes of one neck disc.
    moving = np.setdiff1d(triangles, fixed)
    free = np.setdiff1d(moving, np.concatenate([moving[:0], *discs]))
    unknown = np.full(count, -1)
    unknown[free] = np.arange(len(free))
    for number, nodes in enumerate(discs, start=len(free)):
        unknown[nodes] = number
    moved = np.flatnonzero(unknown >= 0)
    shape = count, len(free) + len(discs)
    spread = csr_matrix((np.ones(len(moved)), (moved, unknown[moved])), shape=shape)
    factors = splu((spread.T @ matrix @ spread).tocsc())
    rise: Floats = spread @ factors.solve(spread.T @ weights)
    return Lift(rise, float(rise[discs[0][0]]) if discs else 0.0, float(rise @ weights))


# The pockets of a laminate.


NEAR = 1e-3
"""mm by which a round pocket may be off its chamber's axis."""


class Pocket(NamedTuple):
    """One pocket of a chamber, under film ``ply``, with the lift of the films below and above.

    ``centres`` are its stacks, as indices of the layup's centres. ``meshed`` is the number of its
    balloons that are meshed, as a sum of fractions; ``flat_ul`` is the volume of the meshed part
    before filling, ``largest_ul`` the largest volume of air in a balloon.
    """

    chamber: str
    ply: int
    layer: int
    centres: list[int]
    lower: Lift
    upper: Lift
    meshed: float
    flat_ul: float
    largest_ul: float

    def pressure(self, ul: float) -> float:
        """Return the factor of both shapes, in 1/mm, at which each balloon holds ``ul``.

        Raises DesignError if a balloon cannot hold that much.
        """
        if ul > self.largest_ul:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is more than the balloon under layer "
                f"{self.layer} can hold with a film of constant length; use at most "
                f"{math.floor(self.largest_ul * 100) / 100:.2f} ul"
            )
        added = ul * self.meshed - self.flat_ul
        if ul and added < 0:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is less than the gaps between flat films "
                f"hold; use at least {self.flat_ul / self.meshed:.2f} ul"
            )
        return added / (self.lower.volume + self.upper.volume) if ul else 0.0


def pockets(stack: Layup) -> list[Pocket]:
    """Return the pockets of every chamber, bottom to top; equal ones are computed once."""
    lifts: dict[tuple[bytes, ...], Lift] = {}
    return [
        _pocket(stack, chamber, ply, lifts)
        for ply, interface in enumerate(stack.laminate.interfaces, start=1)
        if interface.kind == "chamber"
        for chamber, void in stack.voids.items()
        if ply in void.under
    ]


def _pocket(stack: Layup, chamber: str, ply: int, lifts: dict[tuple[bytes, ...], Lift]) -> Pocket:
    plies, cells = stack.plies, stack.voids[chamber].under[ply]
    fixed = np.intersect1d(stack.nodes(cells), stack.nodes(plies[ply].bonded))
    centres = [i for i, (owner, _) in enumerate(stack.stacks) if owner == chamber]
    places = [stack.centres[i] for i in centres]
    meshed = len(places) * stack.shares[chamber]

    def lift_of(necks: Flags) -> Lift:
        key = cells.tobytes(), fixed.tobytes(), necks.tobytes()
        if key not in lifts:
            lifts[key] = lift(stack.plane, cells, fixed, list(_discs(stack, necks, fixed, places)))
        return lifts[key]

    def largest() -> float:
        """A drawn pocket holds as much as its inscribed disc, times the ratio of their lifts."""
        even = lift_of(cells & False)
        offsets = stack.plane.points[fixed][:, None] - np.array(places)
        half = float(np.linalg.norm(offsets, axis=2).min())
        wider = even.volume / float(even.shape.max()) / (math.pi * half**2 / 2)
        return eqs_1_to_3(half).largest_volume * wider / meshed

    above = plies[ply + 1].bonded if ply + 1 < len(plies) else cells & False
    return Pocket(
        chamber,
        ply,
        plies[ply].layer.index,
        centres,
        lift_of(cells & (plies[ply - 1].bonded | ~plies[ply - 1].cells)),
        lift_of(cells & (above | ~plies[ply].cells)),
        meshed,
        float(stack.plane.areas()[cells].sum()) * plies[ply].gap,
        _largest(stack.laminate.interfaces[ply - 1], places[0]) or largest(),
    )


def _discs(stack: Layup, necks: Flags, fixed: Ints, places: list[Point]) -> Iterator[Ints]:
    """Return the nodes of each neck disc, by the nearest axis."""
    nodes = np.setdiff1d(stack.nodes(necks), fixed)
    offsets = stack.plane.points[nodes][:, None] - np.array(places)
    nearest = np.linalg.norm(offsets, axis=2).argmin(axis=1)
    return (nodes[nearest == number] for number in np.unique(nearest))


def _largest(interface: Interface, centre: Point) -> float | None:
    """Return the largest air volume in ul of a round or oblong balloon around a centre; None for
    others.

    A round pocket is two paraboloids whose meridian keeps its length (paper Eqs. 1 to 3), an oblong
    one two arcs (as in ``predict``). Most of a round pocket's edge lies on a circle about the
    centre; a slot ends in two arcs of equal radius at equal distances on either side, if at least a
    third of a turn of each remains beside inlet and manifold.
    """
    turns: defaultdict[tuple[Point, float], float] = defaultdict(float)
    for edge in (edge for outer in interface.unbonded.outers for edge in outer.edges):
        if isinstance(edge, Arc):
            x, y = edge.centre
            turns[(round(x, 5), round(y, 5)), round(edge.radius, 5)] += abs(edge.sweep)
    ends = sorted(place for place, turn in turns.items() if turn > math.tau / 3)
    for middle, radius in ends:
        if math.dist(middle, centre) < NEAR and turns[middle, radius] > math.pi:
            return eqs_1_to_3(radius).largest_volume
    for (first, radius), (last, last_radius) in combinations(ends, 2):
        middle = (first[0] + last[0]) / 2, (first[1] + last[1]) / 2
        if abs(last_radius - radius) < NEAR and math.dist(middle, centre) < NEAR:
            return lens(2 * radius, math.dist(first, last)).largest_volume
    return None


# The fill of a whole actuator.


FLATNESS = 0.002
"""Fraction of the lift by which the necks of chambers may differ in height."""


def filled(stack: Layup, amounts: Mapping[str, float], all_pockets: list[Pocket]) -> Floats:
    """Return the heights (plies, plane nodes) in mm of all films over these pockets, as ``flat``
    does.

    ``amounts`` are ul of air in each balloon by chamber. Raises DesignError for more air than a
    film of constant length can hold, and if it lifts the chambers of one body by unequal heights.
    """
    heights = flat(stack)
    of_node, of_centre = bodies(stack)
    # Height of each stack's neck disc over its film, 0 without one.
    necks = np.zeros((len(heights), len(of_centre)))
    for pocket in all_pockets:
        amount = pocket.pressure(amounts[pocket.chamber])
        for k, half, way in ((pocket.ply - 1, pocket.lower, -1), (pocket.ply, pocket.upper, 1)):
            heights[k] += way * amount * half.shape
            necks[k, pocket.centres] = way * amount * half.plateau
    for k, interface in enumerate(stack.laminate.interfaces, start=1):
        if interface.kind == "chamber":
            continue
        # What lies above moves as the neck discs of the films below and above it.
        steps = necks[k - 1] - necks[k]
        for body in np.unique(of_centre):
            of_body = steps[(of_centre == body) & (steps != 0)]
            if len(of_body):
                _check_even(of_body)
                heights[k:, of_node == body] += of_body.mean()
    return heights


def _check_even(steps: Floats) -> None:
    apart = float(np.ptp(steps))
    if apart > FLATNESS * float(np.abs(steps).max()):
        raise DesignError(
            f"the fill lifts the chambers by heights that differ by {apart:.3f} mm, because "
            "their pockets differ; omit the fill"
        )
