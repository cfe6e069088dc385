"""How the share of good builds falls with a rougher hand, for the page of the findings."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from sbafab.laminate.assembly import assembly, laying_pins
from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import Limits
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
    asked = replace(limits, tolerances=hand, yield_builds=BUILDS)
    return Hand(hand.placement, hand.turn, simulate(laminate, asked).whole.value)


def on_laying_pins(laminate: Laminate, limits: Limits) -> Hand | None:
    """The design's hand where every step without pins is laid up on one, and only turns are left.

    None where a step has no pin that passes all its films.
    """
    steps = [step for step in assembly(laminate) if not step.pins]
    if not steps or not all(laying_pins(laminate, step) for step in steps):
        return None
    own = limits.tolerances
    asked = replace(limits, tolerances=replace(own, placement=own.pin), yield_builds=BUILDS)
    return Hand(own.pin, own.turn, simulate(laminate, asked).whole.value)
