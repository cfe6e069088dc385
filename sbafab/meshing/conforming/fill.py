"""Fill: films lifted off each other by the air of their balloons.

The lift is vertical in the frame of each balloon, so no element changes its volume; balloons
are then set on each other by their neck discs, leaning where chambers hold unlike amounts, and
refused where they would lean into each other. Films stretch along the meridian (1 % at 5 ul in the
paper's 5 mm balloon) and thin by as much; the flat mesh is the rest position for a solver that
takes one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.meshing.conforming.bodies import bodies
from sbafab.meshing.conforming.crossing import crossing, said
from sbafab.meshing.conforming.form import FormedFilm, flat
from sbafab.meshing.conforming.layup import Layup
from sbafab.meshing.conforming.pockets import Pocket, pockets
from sbafab.meshing.conforming.poses import UPRIGHT, RigidMotion, set_on, slopes_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROUNDS = 4
"""Leaning discs change volumes, and these the lean, by less each round."""
HALVINGS = 6
"""How closely the least fill is sought that keeps films apart: to a part in 2^6 of the largest."""


@dataclass(frozen=True)
class Fill:
    """The air asked for, in ul a balloon, by chamber; ``largest`` is what the fullest one holds."""

    ul: Mapping[str, float]

    @property
    def largest(self) -> float:
        return max(self.ul.values())

    @property
    def is_even(self) -> bool:
        return len(set(self.ul.values())) == 1


def filled(stack: Layup, fill_ul: float | Mapping[str, float]) -> tuple[Fill, list[FormedFilm]]:
    """Every film where the air has moved it to.

    ``fill_ul`` is the air in every balloon in ul, or in those of the chambers named; 0 is flat.
    Raises DesignError for a chamber that is not there, for more air than a film of constant
    length can hold, where unlike fills have no common plane, and where they would make films pass
    through each other.
    """
    fill = _fill(stack, fill_ul)
    held = pockets(stack)
    forms = formed(stack, fill, held)
    if fill.is_even:
        return fill, forms
    found = crossing(stack, forms)
    if found is not None:
        least = _least(stack, fill, held)
        names = [name for name, ul in fill.ul.items() if ul < least.ul[name]]
        asked = ", ".join(f"{name}={ul:g}ul" for name, ul in fill.ul.items())
        wanted = " and ".join(f"{least.ul[name]:.1f} ul in {name}" for name in names)
        raise DesignError(
            f"with fill {asked} {said(stack, found)}, for balloons lean by what their chambers "
            f"differ; ask for at least {wanted}, or for less in the others"
        )
    return fill, forms


def _least(stack: Layup, fill: Fill, held: list[Pocket]) -> Fill:
    """The fill that is raised least towards an even one, in steps of 0.1 ul, for films to clear."""

    def raised(share: float) -> Fill:
        return Fill(
            {
                name: min(
                    math.ceil(10 * (ul + share * (fill.largest - ul)) - 1e-6) / 10, fill.largest
                )
                if ul < fill.largest
                else ul
                for name, ul in fill.ul.items()
            }
        )

    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = (low + high) / 2
        tried = raised(share)
        crosses = crossing(stack, formed(stack, tried, held)) is not None
        low, high = (share, high) if crosses else (low, share)
    return raised(high)


def formed(stack: Layup, fill: Fill, held: list[Pocket]) -> list[FormedFilm]:
    """Every film where the air of these pockets has moved it to, films that cross included."""
    body_of_node, body_of_centre = bodies(stack)
    forms = [FormedFilm(form.base.copy(), form.up.copy()) for form in flat(stack)]
    for body in np.unique(body_of_centre).tolist():
        nodes = np.flatnonzero(body_of_node == body)
        centres = np.flatnonzero(body_of_centre == body)
        own = [pocket for pocket in held if pocket.centres[0] in centres]
        for k, form in _raised(stack, own, centres, fill).items():
            forms[k].base[nodes] = form.base[nodes]
            forms[k].up[nodes] = form.up[nodes]
    return forms


def _raised(
    stack: Layup, own: list[Pocket], centres: NDArray[np.int64], fill: Fill
) -> dict[int, FormedFilm]:
    """The films of one body, by ply; sheets stay as they are."""
    lifts = np.zeros((len(stack.plies), len(stack.plane.points)))
    # Height of each stack's neck disc on each film, above the film itself.
    necks = np.zeros((len(stack.plies), len(stack.centres)))
    places = np.array(stack.centres)[centres]
    for k in sorted({pocket.ply for pocket in own}):
        there = [pocket for pocket in own if pocket.ply == k]
        _lift(there, fill, centres, places, lifts, necks)
    poses = _poses(stack, places, necks[:, centres])
    forms = {}
    for k, (ply, rise, pose) in enumerate(zip(stack.plies, lifts, poses, strict=True)):
        if ply.layer.role != "sheet":
            local = np.column_stack([stack.plane.points, ply.z + rise])
            up = np.broadcast_to(pose.turn[:, 2], local.shape)
            forms[k] = FormedFilm(local @ pose.turn.T + pose.shift, up)
    return forms


def _fill(stack: Layup, fill_ul: float | Mapping[str, float]) -> Fill:
    names = [chamber.name for chamber in stack.laminate.chambers]
    if not isinstance(fill_ul, Mapping):
        asked = dict.fromkeys(names, float(fill_ul))
    else:
        unknown = [name for name in fill_ul if name not in names]
        if unknown:
            raise DesignError(
                f"fill names chamber {unknown[0]}, which is not there; "
                f"the chambers are {', '.join(names)}"
            )
        asked = {name: float(fill_ul.get(name, 0.0)) for name in names}
        if stack.sector is not None and len(set(asked.values())) > 1:
            raise DesignError(
                "a mesh of a part by symmetry has the same fill in every chamber; "
                "ask for symmetry full"
            )
    for name, value in asked.items():
        if not (math.isfinite(value) and value >= 0):
            raise DesignError(f"fill of {name} = {value:g} ul must be 0 ul or more")
    return Fill(asked)


def _lift(
    there: list[Pocket],
    fill: Fill,
    centres: NDArray[np.int64],
    places: NDArray[np.float64],
    lifts: NDArray[np.float64],
    necks: NDArray[np.float64],
) -> None:
    """Adds the lift of one balloon's two films, and of their necks."""
    lean = np.zeros((2, 2))
    for _ in range(ROUNDS):
        amounts = np.array([pocket.pressure(fill.ul[pocket.chamber], lean) for pocket in there])
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


def _poses(
    stack: Layup, places: NDArray[np.float64], necks: NDArray[np.float64]
) -> list[RigidMotion]:
    """The place of every film: those of a balloon move as one, each balloon stands on the last."""
    poses = [UPRIGHT]
    kinds = [interface.kind for interface in stack.laminate.interfaces]
    for k, kind in enumerate(kinds, start=1):
        if kind == "chamber":
            poses.append(poses[-1])
            continue
        below, above = stack.plies[k - 1], stack.plies[k]
        top = necks[k - 1] + below.z + below.thickness * stack.is_thick
        bottom = necks[k] + above.z
        poses.append(set_on(poses[-1], places, top, bottom, above.gap))
    return poses
