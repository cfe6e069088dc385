"""Whether what a scene gave can be: where the tip is, how high, how far it leans."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sbafab.laminate.laminate import Laminate
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.coarse.tip import Tip
from sbafab.simulators.sofa.conforming import pocket_radii

LEAST_RISE = 0.01
"""mm that a tip must stand above its base: no scene starts as low and stays there."""
MOST_LEAN = 1.0
"""Degrees of tilt where all chambers are alike; shells that hold stand within 0.1."""
STRETCH = 1.3
"""Times its flat length that a film may be along its meridian; more has burst it long before."""


@dataclass(frozen=True)
class TipLimits:
    """What a tip can do: stand ``highest`` mm over its base at most, and lean or not."""

    highest: float
    must_stand: bool


def limits(laminate: Laminate, told: Collection[float]) -> TipLimits | None:
    """The limits of a laminate whose chambers are told these pressures or volumes.

    A balloon is no higher than its two films are long; equal chambers lift a plate evenly, where
    the mesh has no inlets. None for a laminate on a tube, whose balloons have no common tip.
    """
    if laminate.tube is not None:
        return None
    reach = sum(pocket_radii(laminate)) / len(laminate.chambers)
    return TipLimits(2 * STRETCH * reach, len(set(told)) == 1 and why_not_round(laminate) is None)


def impossible(tips: Sequence[Tip], limit: TipLimits) -> str | None:
    """What the last tip does that cannot be, None if it can."""
    last = tips[-1]
    z = last.place[2]
    if all(abs(value) < LEAST_RISE for value in last.place):
        return "the tip lies at 0, 0, 0"
    if limit.must_stand and z < LEAST_RISE:
        return f"all chambers are told the same, and the tip has not risen (z {z:.3f} mm)"
    if z > limit.highest:
        return f"the tip is {z:.3f} mm high, and the films reach {limit.highest:.3g} mm at most"
    if limit.must_stand and last.tilt > MOST_LEAN:
        return (
            f"all chambers are told the same, and the tip leans by {last.tilt:.1f} degrees "
            f"(more than {MOST_LEAN:g})"
        )
    return None
