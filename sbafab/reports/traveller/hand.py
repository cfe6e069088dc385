"""How the share of good builds falls with a rougher hand, for the page of the findings."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from sbafab.laminate.laminate import Laminate
from sbafab.rules.limits import Limits
from sbafab.rules.measures import Measures
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


def at_roughest(laminate: Laminate, limits: Limits) -> Measures:
    """What the roughest hand asked about can make narrow; steadier ones are asked there too."""
    return Measures(laminate, _rougher(limits, ROUGHER[-1]))


def rougher_hands(places: Measures, limits: Limits) -> tuple[Hand, ...]:
    """Shares of good builds of steadier and rougher hands; empty where no hand decides anything."""
    roughest = _hand(places, places.limits)
    if roughest.share == 1:
        return ()
    asked = (_hand(places, _rougher(limits, factor)) for factor in ROUGHER[:-1])
    return (*asked, roughest)


def _rougher(limits: Limits, factor: float) -> Limits:
    own = limits.tolerances
    hand = replace(own, placement=factor * own.placement, turn=factor * own.turn)
    return replace(limits, tolerances=hand)


def _hand(places: Measures, limits: Limits) -> Hand:
    asked = replace(limits, yield_builds=BUILDS)
    found = simulate(places.laminate, asked, measures=places.by_hand(asked))
    return Hand(limits.tolerances.placement, limits.tolerances.turn, found.whole.value)
