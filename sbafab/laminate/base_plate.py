"""The base plate's holes: their fit with dowel pins, and the machines' position errors.

Deviations follow ISO 286-2, in mm (from two suppliers' tables, which agree on m6, not from the
standard itself; H7 is grade IT7 above the nominal size).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

PlateMachine = Literal["jig-borer", "cnc-mill", "drill-press"]

M6 = ((3.0, 0.002, 0.008), (6.0, 0.004, 0.012), (10.0, 0.006, 0.015), (18.0, 0.007, 0.018))
"""Lower and upper deviation of a dowel pin, m6, up to each diameter."""
H7 = ((3.0, 0.010), (6.0, 0.012), (10.0, 0.015), (18.0, 0.018))
"""Upper deviation of a hole reamed H7, up to each diameter; the lower one is 0."""
LAPPED_PLAY = 0.002
"""Greatest play in mm of a pin in a hole lapped to it: our estimate, hardly felt by hand."""


class HoleProcess(NamedTuple):
    """A machining process for the plate's holes.

    ``position`` is the largest position error of a hole, mm, in any direction; ``is_lapped``: each
    hole is lapped to fit its pin, otherwise reamed H7.
    """

    words: str
    position: float
    is_lapped: bool


HOLE_PROCESSES: Mapping[PlateMachine, HoleProcess] = {
    "jig-borer": HoleProcess("a jig borer", 0.003, True),
    "cnc-mill": HoleProcess("a CNC mill", 0.025, False),
    "drill-press": HoleProcess("a drill press, marked out by hand", 0.2, False),
}
"""Positions: a jig borer 0.003 and a hole marked out by hand 0.2 (a maker's guide to drilled and
reamed holes, fobproto.com, cnc-drilling-reaming-tolerances); a CNC mill 0.001 in, as two shops
promise for precise work (makerstage.com, cnc-tolerances-guide; olympusmachining.com)."""


def for_a_cnc_mill(design: str) -> str:
    """Return the command that widens a design's bonds and overhangs for a plate from a CNC mill, to
    a yield of nine in ten, as in the paper.
    """
    return f"sbafab generate {design} --set registration.plate_made_by=cnc-mill --target-yield 0.9"


def pin_deviations(diameter: float) -> tuple[float, float]:
    """Return the lower and upper deviation of a dowel pin's diameter, mm: m6."""
    return next(((low, high) for d, low, high in M6 if diameter <= d), M6[-1][1:])


def hole_deviation(diameter: float) -> float:
    """Return the upper deviation of a hole reamed H7, mm."""
    return next((high for d, high in H7 if diameter <= d), H7[-1][1])


def most_play(diameter: float, machine: PlateMachine) -> float:
    """Return the largest play of a pin in its plate hole, mm in diameter."""
    if HOLE_PROCESSES[machine].is_lapped:
        return LAPPED_PLAY
    return round(hole_deviation(diameter) - pin_deviations(diameter)[0], 6)


def pin_error(diameter: float, machine: PlateMachine) -> float:
    """Return the largest position error of a pin, mm: its hole's, plus half the play.

    A jig borer gives 0.003 + 0.002 / 2, the paper's 0.004 for its dowel pins (Sec. 2).
    """
    return round(HOLE_PROCESSES[machine].position + most_play(diameter, machine) / 2, 6)


def lone_pin_error(diameter: float, machine: PlateMachine) -> float:
    """Return the largest position error of a plate's only pin, mm, which moves all layers equally.

    It is the play in a hole reamed H7: again the paper's 0.004 for pins up to 6 mm.
    """
    reamed = round((hole_deviation(diameter) - pin_deviations(diameter)[0]) / 2, 6)
    return min(pin_error(diameter, machine), reamed)
