"""findings.html: what the rules found, for whoever designs; the bench has the traveller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from sbafab.laminate.laminate import Laminate
from sbafab.reports.traveller.page import environment, frame
from sbafab.rules.finding import Finding
from sbafab.rules.limits import Limits
from sbafab.rules.measures import Measures
from sbafab.rules.registration_yield import simulate

# How the share of good builds falls with a rougher hand, for the page of the findings.


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


TEMPLATE = "findings.html.j2"
YIELD, WORST = "registration-yield", "registration-worst-case"


@dataclass(frozen=True)
class Inspected:
    """A design's laminate, or None for an assembly's own checks, and what was found in it."""

    name: str
    findings: Sequence[Finding]
    laminate: Laminate | None = None
    limits: Limits | None = None


class _Chapter(NamedTuple):
    """What the page says of one design; ``own`` is the share of good builds of its own hand."""

    name: str
    open: Sequence[Finding]
    rest: Sequence[Finding]
    own: Hand | None
    hands: Sequence[Hand]
    helps: Sequence[str]


def findings_html(title: str, sha256: str, generator: str, inspected: Sequence[Inspected]) -> str:
    """The whole page, a chapter a design."""
    said = frame(title, sha256, generator)
    chapters = [_chapter(one) for one in inspected]
    return environment().get_template(TEMPLATE).render(**said, shapes="", chapters=chapters)


def _chapter(one: Inspected) -> _Chapter:
    is_open = [f for f in one.findings if f.verdict in ("fail", "warn") or f.by_user]
    rest = [f for f in one.findings if f not in is_open]
    hands, helps = _hands(one)
    return _Chapter(one.name, is_open, rest, _own(one), hands, helps)


def _own(one: Inspected) -> Hand | None:
    found = next((f for f in one.findings if f.rule == YIELD), None)
    if found is None or found.measured is None or one.limits is None:
        return None
    own = one.limits.tolerances
    return Hand(own.placement, own.turn, found.measured)


def _hands(one: Inspected) -> tuple[Sequence[Hand], Sequence[str]]:
    """Rougher hands and what helps, asked about where the laminate could be counted at all."""
    if one.laminate is None or one.limits is None or _own(one) is None:
        return (), ()
    places = at_roughest(one.laminate, one.limits)
    hands = rougher_hands(places, one.limits)
    return hands, tuple(_helps(places)) if hands else ()


def _helps(places: Measures) -> Iterator[str]:
    """What leaves less to the hand, cheapest first."""
    yield (
        "Print underlay.pdf at 1:1 and lay up on it: its lines show where every edge goes that no "
        "pin holds. How much steadier that makes a hand nobody has measured; half the error "
        "gives the first row."
    )
    yield (
        "sbafab check design.toml --target-yield 0.99 says how much wider bonds and overhangs "
        "reach 99 % with the hand as it is."
    )
    if places.laminate.registration == "channel-pin":
        yield (
            'registration.method = "ears" pins every film and separator in every step; the ears '
            "are snipped off afterwards."
        )
        yield (
            'registration.method = "sheet", for round and lobed actuators, keeps films and masks '
            "whole on corner pins until all copies are pressed; no bench has tried it, so it takes "
            "--experimental."
        )
    yield (
        "Count your own builds and set registration.hand_placement and registration.hand_turn to "
        "what they say."
    )
