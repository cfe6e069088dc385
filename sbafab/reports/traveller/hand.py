"""How the share of good builds falls with a rougher hand, for the page of the findings."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from sbafab.laminate.assembly import assembly, laying_pins
from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.registration_yield import simulate

ROUGHER = (0.5, 1.5, 2.0, 2.5)
"""Times the hand that the design states."""
BUILDS = 1000
"""Enough for a slope: the interval of 95 % is 3 in a hundred at most."""


class Hand(NamedTuple):
    """A hand that shifts by up to ``placement`` mm and turns by up to ``turn`` degrees, and the
    ``share`` of builds that keep every limit with it.
    """

    placement: float
    turn: float
    share: float


def rougher_hands(laminate: Laminate, limits: Limits) -> tuple[Hand, ...]:
    """Shares of good builds of steadier and rougher hands; empty where no hand decides anything."""
    roughest = _hand(laminate, limits, ROUGHER[-1])
    if roughest.share == 1:
        return ()
    return (*(_hand(laminate, limits, factor) for factor in ROUGHER[:-1]), roughest)


def _hand(laminate: Laminate, limits: Limits, factor: float) -> Hand:
    own = limits.tolerances
    hand = replace(own, placement=factor * own.placement, turn=factor * own.turn)
    return Hand(hand.placement, hand.turn, _share(laminate, replace(limits, tolerances=hand)))


def on_laying_pins(laminate: Laminate, limits: Limits) -> Hand | None:
    """The design's hand where every step without pins is laid up on one, and only turns are left.

    None where a step has no pin that passes all its films.
    """
    steps = [step for step in assembly(laminate) if not step.pins]
    if not steps or not all(laying_pins(laminate, step) for step in steps):
        return None
    own = limits.tolerances
    on_pin = replace(limits, tolerances=replace(own, placement=own.pin))
    return Hand(own.pin, own.turn, _share(laminate, on_pin))


def _share(laminate: Laminate, limits: Limits) -> float:
    """Share of good builds. Of the limits only those of registration count, and can be hashed."""
    own = limits.tolerances, limits.worst_bond_width, limits.worst_mask_overhang
    return _counted(laminate, *own, limits.mask_overhang)


@lru_cache(maxsize=16)
def _counted(
    laminate: Laminate, tolerances: Tolerances, bond: float, overhang: float, drawn: float
) -> float:
    """Kept, for a run makes the page and then checks it."""
    asked = Limits(
        mask_overhang=drawn,
        tolerances=tolerances,
        worst_bond_width=bond,
        worst_mask_overhang=overhang,
        yield_builds=BUILDS,
    )
    return simulate(laminate, asked).whole.value
