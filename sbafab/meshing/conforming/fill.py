"""Films lifted by the air of their balloons, and balloons set on each other.

The lift is vertical in the frame of each balloon, so no element changes its volume. Balloons are
then stacked by their neck discs. They lean if chambers hold different amounts, and are refused if
they would lean into each other. Films stretch along the meridian (1 % at 5 ul in the paper's 5 mm
balloon) and thin accordingly; the flat mesh is the rest position for a solver that takes one.
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
from sbafab.meshing.conforming.layup import (
    FormedFilm,
    Layup,
    bodies,
    crossing,
    flat,
)
from sbafab.meshing.conforming.mesh import integrals
from sbafab.meshing.conforming.plane import MISSING, Plane
from sbafab.meshing.surface import Flags, Floats, Ints
from sbafab.models.closed_forms import eqs_1_to_3, lens

# The lift of one film: Poisson's equation on the triangles of a pocket.


class Lift(NamedTuple):
    """Shapes (3, plane nodes) of a film over a pocket, in mm2, mm and mm.

    The first is the shape under even pressure; the others are the shapes for a neck disc with a
    slope of one along x or y. ``plateaus`` (3,) are their heights at the middle of the (first) neck
    disc, ``volumes`` (3,) the volumes that they enclose.
    """

    shapes: Floats
    plateaus: Floats
    volumes: Floats


def lift(
    plane: Plane, pocket: Flags, fixed: Ints, discs: list[tuple[Ints, tuple[float, float]]]
) -> Lift:
    """Return the rise of the film over a pocket: -lap w = 1, w = 0 at the ``fixed`` nodes.

    ``discs`` are the nodes of each neck and its middle: they rise together. For a round pocket
    without a neck this is the paraboloid of the paper's Eq. 1.
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
    free = np.setdiff1d(moving, np.concatenate([moving[:0], *(nodes for nodes, _ in discs)]))
    unknown = np.full(count, -1)
    unknown[free] = np.arange(len(free))
    lean = np.zeros((2, count))
    for number, (nodes, middle) in enumerate(discs):
        unknown[nodes] = len(free) + number
        lean[:, nodes] = (plane.points[nodes] - middle).T
    size = len(free) + len(discs)
    moved = np.flatnonzero(unknown >= 0)
    spread = csr_matrix((np.ones(len(moved)), (moved, unknown[moved])), shape=(count, size))
    factors = splu((spread.T @ matrix @ spread).tocsc())
    shapes = np.empty((3, count))
    shapes[0] = spread @ factors.solve(spread.T @ weights)
    for axis in range(2):
        push = spread.T @ (matrix @ lean[axis])
        shapes[1 + axis] = lean[axis] - spread @ factors.solve(push)
    plateaus = np.zeros(3)
    if discs:
        first = discs[0][0][0]
        plateaus = shapes[:, first] - np.array([0.0, *lean[:, first]])
    return Lift(shapes, plateaus, shapes @ weights)


# The pockets of a laminate.


NEAR = 1e-3
"""mm by which a round pocket may be off its chamber's axis."""


class Pocket(NamedTuple):
    """One pocket of a chamber, under film ``ply``, with the lift of the films below and above.

    ``centres`` are its stacks, as indices of the layup's centres. ``share`` of each is meshed;
    ``flat_ul`` is the volume of the meshed part before filling, ``largest_ul`` the most air that a
    balloon can hold.
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

    def pressure(self, ul: float, lean: Floats) -> float:
        """The amount of the even shape, in 1/mm, at which each balloon holds ``ul``.

        ``lean`` (2, 2) are the slopes of the lower and the upper neck disc. Raises DesignError
        if a balloon cannot hold that much.
        """
        if ul > self.largest_ul:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is more than the balloon under layer "
                f"{self.layer} can hold with a film of constant length: "
                f"ask for {math.floor(self.largest_ul * 100) / 100:.2f} ul at most"
            )
        target = ul * len(self.centres) * self.share
        if 0 < target < self.flat_ul:
            raise DesignError(
                f"fill of {self.chamber} = {ul:g} ul is less than the gaps between flat films "
                f"hold; ask for {self.flat_ul / len(self.centres) / self.share:.2f} ul or more"
            )
        if ul == 0:
            return 0.0
        even = self.lower.volumes[0] + self.upper.volumes[0]
        leaning = lean[0] @ self.lower.volumes[1:] + lean[1] @ self.upper.volumes[1:]
        return float((target - self.flat_ul - leaning) / even)


def pockets(stack: Layup) -> list[Pocket]:
    """The pockets of every chamber, bottom to top; equal ones are computed once."""
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
    centres = tuple(i for i, (owner, _) in enumerate(stack.stacks) if owner == chamber)
    places = [stack.centres[i] for i in centres]

    def lift_of(necks: Flags) -> Lift:
        key = cells.tobytes(), fixed.tobytes(), necks.tobytes()
        if key not in lifts:
            lifts[key] = lift(stack.plane, cells, fixed, list(_discs(stack, necks, fixed, places)))
        return lifts[key]

    def largest() -> float:
        """A drawn pocket's volume over its inscribed disc's is the ratio of their even lifts."""
        even = lift_of(cells & False)
        offsets = stack.plane.points[fixed][:, None] - np.array(places)
        half = float(np.linalg.norm(offsets, axis=2).min())
        wider = float(even.volumes[0] / even.shapes[0].max()) / (math.pi * half**2 / 2)
        return eqs_1_to_3(half).largest_volume * wider / len(places) / stack.shares[chamber]

    above = plies[ply + 1].bonded if ply + 1 < len(plies) else cells & False
    return Pocket(
        chamber,
        ply,
        plies[ply].layer.index,
        centres,
        lift_of(cells & (plies[ply - 1].bonded | ~plies[ply - 1].cells)),
        lift_of(cells & (above | ~plies[ply].cells)),
        stack.shares[chamber],
        float(stack.plane.areas()[cells].sum()) * plies[ply].gap,
        _largest(stack.laminate.interfaces[ply - 1], places[0]) or largest(),
    )


def _discs(
    stack: Layup, necks: Flags, fixed: Ints, places: list[Point]
) -> Iterator[tuple[Ints, Point]]:
    """The nodes of each neck disc, and the axis it is on."""
    nodes = np.setdiff1d(stack.nodes(necks), fixed)
    offsets = stack.plane.points[nodes][:, None] - np.array(places)
    nearest = np.linalg.norm(offsets, axis=2).argmin(axis=1)
    for number, place in enumerate(places):
        if (nearest == number).any():
            yield nodes[nearest == number], place


def _largest(interface: Interface, centre: Point) -> float | None:
    """Most air in ul that a round or oblong balloon round a centre can hold; None for others.

    A round pocket is two paraboloids whose meridian keeps its length (paper Eqs. 1 to 3), an oblong
    one two arcs (as in ``predict``). A circle on the centre is most of a round one's edge; a slot
    ends in two of equal radius at equal distances on either side, if at least a third of a turn of
    each remains beside inlet and manifold.
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


# Balloons set on each other by the planes of their neck discs.


FLATNESS = 0.01
"""Fraction of the lift by which necks may deviate from a common plane."""


def slopes_of(centres: Floats, heights: Floats) -> Floats:
    """Slopes along x and y of the plane through the heights at the centres (n, 2).

    Raises DesignError if they have no common plane.
    """
    offsets = centres - centres.mean(axis=0)
    rises = heights - heights.mean()
    slopes: Floats = np.linalg.lstsq(offsets, rises, rcond=1e-9)[0]
    worst = float(np.abs(rises - offsets @ slopes).max())
    if worst > FLATNESS * float(np.abs(heights).max()):
        raise DesignError(
            f"the fills asked for lift the chambers {worst:.3f} mm off a common plane; fill more "
            "than three chambers, or chambers in one row, alike"
        )
    return slopes


def _frame(slopes: Floats) -> Floats:
    """The smallest rotation (3, 3) of the upright axis onto the normal of a plane."""
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    x, y, z = (normal / np.linalg.norm(normal)).tolist()
    xx, xy, yy = x * x / (1 + z), x * y / (1 + z), y * y / (1 + z)
    return np.array([[1 - xx, -xy, x], [-xy, 1 - yy, y], [-x, -y, z]])


# The fill of a whole actuator.


ROUNDS = 4
"""Iterations: leaning discs change volumes, and volumes the lean, by less each round."""
HALVINGS = 6
"""Bisection steps for the least fill that keeps films apart: to 1/2^6 of the largest fill."""


Fill = Mapping[str, float]
"""The requested air, in ul per balloon, by chamber."""


def filled(stack: Layup, fill_ul: float | Fill) -> tuple[Fill, list[FormedFilm]]:
    """Every film at the position that the air has moved it to.

    ``fill_ul`` is the air in every balloon in ul, or in the balloons of the named chambers; 0 is
    flat. Raises DesignError for an unknown chamber, for more air than a film of constant length can
    hold, if different fills have no common plane, and if films would pass through each other.
    """
    fill = _fill(stack, fill_ul)
    all_pockets = pockets(stack)
    forms = formed(stack, fill, all_pockets)
    worst = crossing(stack, forms) if len(set(fill.values())) > 1 else None
    if worst is not None:
        least = _least(stack, fill, all_pockets)
        amounts = ", ".join(f"{name}={ul:g}ul" for name, ul in fill.items())
        minima = [f"{least[name]:.1f} ul in {name}" for name in fill if fill[name] < least[name]]
        raise DesignError(
            f"with fill {amounts} {worst}, for balloons lean by what "
            f"their chambers differ; ask for at least {' and '.join(minima)}, or for less in the "
            "others"
        )
    return fill, forms


def _least(stack: Layup, fill: Fill, all_pockets: list[Pocket]) -> Fill:
    """The fill raised just enough towards an even one, in steps of 0.1 ul, to keep films apart."""
    most = max(fill.values())

    def raised(share: float) -> Fill:
        amounts = {name: ul + share * (most - ul) for name, ul in fill.items()}
        return {name: min(math.ceil(10 * ul - 1e-6) / 10, most) for name, ul in amounts.items()}

    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = (low + high) / 2
        crosses = crossing(stack, formed(stack, raised(share), all_pockets)) is not None
        low, high = (share, high) if crosses else (low, share)
    return raised(high)


def formed(stack: Layup, fill: Fill, all_pockets: list[Pocket]) -> list[FormedFilm]:
    """Every film at the position that the air of these pockets gives it, even if films cross."""
    of_node, of_centre = bodies(stack)
    forms = [FormedFilm(form.base.copy(), form.up.copy()) for form in flat(stack)]
    for body in np.unique(of_centre).tolist():
        nodes, centres = np.flatnonzero(of_node == body), np.flatnonzero(of_centre == body)
        places = np.array(stack.centres)[centres]
        lifts = np.zeros((len(forms), len(of_node)))
        # Height of each stack's neck disc on each film, above the film itself.
        necks = np.zeros((len(forms), len(stack.centres)))
        of_body = [pocket for pocket in all_pockets if pocket.centres[0] in centres]
        for k in sorted({pocket.ply for pocket in of_body}):
            there = [pocket for pocket in of_body if pocket.ply == k]
            _lift(there, fill, centres, places, lifts, necks)
        poses = _poses(stack, places, necks[:, centres])
        for ply, form, rise, (turn, shift) in zip(stack.plies, forms, lifts, poses, strict=True):
            if not ply.is_sheet:
                local = np.column_stack([stack.plane.points[nodes], ply.z + rise[nodes]])
                form.base[nodes], form.up[nodes] = local @ turn.T + shift, turn[:, 2]
    return forms


def _fill(stack: Layup, fill_ul: float | Fill) -> Fill:
    names = [chamber.name for chamber in stack.laminate.chambers]
    volumes = fill_ul if isinstance(fill_ul, Mapping) else dict.fromkeys(names, fill_ul)
    unknown = [name for name in volumes if name not in names]
    if unknown:
        raise DesignError(
            f"fill names chamber {unknown[0]}, which is not there; "
            f"the chambers are {', '.join(names)}"
        )
    amounts = {name: float(volumes.get(name, 0.0)) for name in names}
    if stack.sector is not None and len(set(amounts.values())) > 1:
        raise DesignError(
            "a mesh of a part by symmetry has the same fill in every chamber; ask for symmetry full"
        )
    for name, value in amounts.items():
        if not 0 <= value < math.inf:
            raise DesignError(f"fill of {name} = {value:g} ul must be 0 ul or more")
    return amounts


def _lift(
    there: list[Pocket], fill: Fill, centres: Ints, places: Floats, lifts: Floats, necks: Floats
) -> None:
    """Adds the lift of one balloon's two films, and of their necks."""
    lean = np.zeros((2, 2))
    for _ in range(ROUNDS):
        amounts = np.array([pocket.pressure(fill[pocket.chamber], lean) for pocket in there])
        heights = np.zeros((2, necks.shape[1]))
        for pocket, amount in zip(there, amounts, strict=True):
            for side, half in enumerate((pocket.lower, pocket.upper)):
                heights[side, list(pocket.centres)] = half.plateaus @ [amount, *lean[side]]
        lean = np.array([slopes_of(places, row) for row in heights[:, centres]])
    for pocket, amount in zip(there, amounts, strict=True):
        lifts[pocket.ply - 1] -= np.array([amount, *lean[0]]) @ pocket.lower.shapes
        lifts[pocket.ply] += np.array([amount, *lean[1]]) @ pocket.upper.shapes
    necks[there[0].ply - 1] = -heights[0]
    necks[there[0].ply] = heights[1]


def _poses(stack: Layup, places: Floats, necks: Floats) -> list[tuple[Floats, Floats]]:
    """The pose of every film: a turn (3, 3), then a shift (3,) in mm.

    A balloon's films move together; each balloon stands on the neck discs of the last.
    """
    turn, shift, middle = np.eye(3), np.zeros(3), places.mean(axis=0)
    poses = [(turn, shift)]
    for k, interface in enumerate(stack.laminate.interfaces, start=1):
        if interface.kind != "chamber":
            below, above = stack.plies[k - 1], stack.plies[k]
            top = necks[k - 1] + below.z + below.thickness * stack.is_thick
            bottom = necks[k] + above.z
            upright = turn @ _frame(slopes_of(places, top))
            meeting = turn @ np.array([*middle, top.mean()]) + shift + above.gap * upright[:, 2]
            turn = upright @ _frame(slopes_of(places, bottom)).T
            shift = meeting - turn @ np.array([*middle, bottom.mean()])
        poses.append((turn, shift))
    return poses
