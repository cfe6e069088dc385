"""A whole actuator in real time: poses with their derivatives, inverse kinematics, and the motion
as chambers fill through their lines.

Lengths mm, pressures kPa, volumes ul; forces mN inside, N outside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sbafab.actuators import build
from sbafab.design.records import Design, Form
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, film_mass
from sbafab.models.balloon import Balloon
from sbafab.models.balloon_map import BalloonMap, balloon_map
from sbafab.models.balloons import balloons_of
from sbafab.models.derivatives import Derivatives, derivatives
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.models.motion import Motion
from sbafab.models.pneumatics import Line
from sbafab.models.reach import P0, Search
from sbafab.models.stack_loads import (
    vector_of,
)
from sbafab.models.stack_poses import NO_LOAD, Plate, Pose, PosedStack

__all__ = ["MOST_PRESSURE", "NO_LOAD", "Motion", "Plate", "Pose", "Stack", "stack"]

MOST_PRESSURE = 110.0
"""Highest pressure of maps in kPa, unless a request has a higher one."""
GRAVITY = 9.80665
GRIP = 0.15
"""Radius, as a share of its pocket's, of the disc by which plates hold a lone balloon."""
PRESSURE_SHARES = (1.0, 0.5, 0.2, 0.1)
"""Shares of the highest pressure, tried one after the other."""


@dataclass(frozen=True, eq=False)
class Stack(PosedStack):
    """An actuator as plates joined by balloons: poses, derivatives, inverse kinematics, motion."""

    def derivatives(self, pressures: Sequence[float], **load: Any) -> Derivatives:
        """Return the equilibrium pose at pressures (kPa, one a chamber) with its derivatives;
        ``load`` are keyword arguments of ``pose`` beside pressures.

        Raises DesignError as ``pose`` does, and for a pose that is about to buckle.
        """
        pose = self.pose(pressures, **load)
        return derivatives(self, pose, self.acting(load), load.get("sucked", False))

    def stiffness(self, pressures: Sequence[float], **load: Any) -> Array:
        """Return the stiffness (6, 6) of the tip in N/mm, N and N mm, as of ``derivatives``."""
        return self.derivatives(pressures, **load).stiffness

    def reach(
        self,
        tip: Sequence[float],
        most_pressure: float | None = None,
        near: Pose | None = None,
        **load: Any,
    ) -> Pose:
        """Return a pose whose tip is at a place (3) in mm, within 1e-3 mm; its ``pressures`` (kPa)
        are from 0 to ``most_pressure``, by default the maps' highest.

        ``near`` is a pose to start from, such as the last one of a motion; ``load`` are keyword
        arguments of ``pose`` beside pressures. If a stack with many chambers has several solutions,
        the result is one near the start. Raises UnreachableError, with the nearest tip found, and
        DesignError for bad input.
        """
        place = vector_of(tip, "the place of the tip in mm")
        most = self.reach_limit(most_pressure)
        search = Search(self, self.acting(load), math.asinh(most / P0))
        return self.pose_of(search.reached(place[None], near))

    def reach_limit(self, most_pressure: float | None) -> float:
        """Return the highest pressure in kPa of ``reach``. Raises DesignError."""
        most = self.most_pressure if most_pressure is None else float(most_pressure)
        if not 0 < most <= self.most_pressure:
            raise DesignError(
                f"most_pressure = {most:g} kPa must be above 0 and at most "
                f"{self.most_pressure:g} kPa, to which the stack was made"
            )
        return most

    def motion(
        self, pressures: Sequence[float] | None = None, line: Line | None = None, **load: Any
    ) -> Motion:
        """Return a motion that starts at pressures (kPa, by default 0); ``line`` feeds each
        chamber, and ``load`` are keyword arguments of ``pose`` beside pressures.
        """
        start = self.pose((0.0,) * self.chambers if pressures is None else pressures, **load)
        return Motion(self, line or Line(), load, start)


def stack(
    design: Design,
    laminate: Laminate | None = None,
    most_pressure: float = MOST_PRESSURE,
    factors: Factors | None = None,
    form: Form | None = None,
) -> Stack:
    """Return the stack of a design with round pockets on one axis or side by side.

    ``most_pressure`` in kPa is the range of its maps; maps of wide pockets end earlier. A lone
    balloon is held by a small disc. ``factors`` are calibrated ones; ``form`` replaces the
    design's, for drawn pockets that are nearly round (``drawn_pockets.model_form``). Raises
    DesignError for pockets of another shape, for actuators round a tube and for films of unknown
    modulus.
    """
    flat = laminate or build(design)
    factors = factors or Factors()
    ratio = factors.modulus_ratio
    # Maps scale with the modulus, so a map for the film as bought serves every ratio.
    drawn = balloons_of(design, flat, replace(factors, modulus_ratio=1.0), form)
    row = [_clamped(balloon) for balloon in drawn]
    kinds = list(dict.fromkeys(row))
    axes = np.array([chamber.centres[0] for chamber in flat.chambers])
    if len(axes) == 1:
        axes = np.zeros((1, 2))
    reach = float(np.hypot(*axes.T).max()) + max(balloon.pocket + balloon.ring for balloon in row)
    has_densities = all(layer.film.density is not None for layer in flat.layers)
    return Stack(
        tuple(_mapped(kind, most_pressure / ratio).stiffened(ratio) for kind in kinds),
        np.array([kinds.index(balloon) for balloon in row]),
        axes,
        factors.folded(flat).height / len(row),
        reach,
        film_mass(flat) * GRAVITY / len(row) if has_densities else None,
        factors.calibration,
    )


def _clamped(balloon: Balloon) -> Balloon:
    """Return a balloon with a disc by which plates hold it, if it lacks a neck."""
    if balloon.neck:
        return balloon
    mate = None if balloon.mate is None else replace(balloon.mate, neck=GRIP * balloon.pocket)
    return replace(balloon, neck=GRIP * balloon.pocket, mate=mate)


def _mapped(kind: Balloon, most_pressure: float) -> BalloonMap:
    """Return a balloon's map, to a lower pressure if a wide pocket has no equilibrium."""
    for share in PRESSURE_SHARES:
        try:
            return balloon_map(kind, share * most_pressure)
        except DesignError:
            if share == PRESSURE_SHARES[-1]:
                raise
    raise AssertionError
