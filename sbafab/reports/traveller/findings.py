"""findings.html: the findings of the design rules, yield against hand placement, remedies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.laminate.base_plate import for_a_cnc_mill
from sbafab.laminate.laminate import Laminate
from sbafab.reports.nets_svg import nets_svg
from sbafab.reports.traveller.formatting import frame, render
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.nets import connectivity
from sbafab.rules.registration_yield import simulate

ROUGHER = (0.5, 1.5, 2.0, 2.5)
"""Factors on the stated hand placement error."""
BUILDS = 1000
"""Enough builds for a slope: the 95 % interval is at most 3 in a hundred."""


class Hand(NamedTuple):
    """A placement error of up to ``placement`` mm and ``turn`` degrees by hand, and the ``share``
    of builds that keep every limit at it.
    """

    placement: float
    turn: float
    share: float


def at_roughest(laminate: Laminate, design: Design) -> Measures:
    """Return the margins that the largest placement error can violate; smaller errors use them
    too.
    """
    return Measures(laminate, _rougher(design, ROUGHER[-1]))


def rougher_hands(places: Measures, design: Design) -> tuple[Hand, ...]:
    """Return the yields at smaller and larger placement errors; empty if the largest loses no
    build.
    """
    roughest = _hand(places, places.design)
    if roughest.share == 1:
        return ()
    hands = (_hand(places, _rougher(design, factor)) for factor in ROUGHER[:-1])
    return (*hands, roughest)


def _rougher(design: Design, factor: float) -> Design:
    errors = design.registration
    hand = {
        "hand_placement": factor * errors.hand_placement,
        "hand_turn": factor * errors.hand_turn,
    }
    return design.model_copy(update={"registration": errors.model_copy(update=hand)})


def _hand(places: Measures, design: Design) -> Hand:
    rules = design.rules.model_copy(update={"yield_builds": BUILDS})
    counted = design.model_copy(update={"rules": rules})
    builds = simulate(places.laminate, counted, measures=places.by_hand(counted))
    return _hand_of(design, builds.whole.value)


def _hand_of(design: Design, share: float) -> Hand:
    return Hand(design.registration.hand_placement, design.registration.hand_turn, share)


YIELD = "registration-yield"


@dataclass(frozen=True)
class Inspected:
    """A design with its findings; the laminate is None for the checks of an assembly."""

    name: str
    findings: Sequence[Finding]
    laminate: Laminate | None = None
    design: Design | None = None


class _Chapter(NamedTuple):
    """The page's chapter on one design; ``design_hand`` is the placement error that the design
    states.
    """

    name: str
    open: Sequence[Finding]
    rest: Sequence[Finding]
    design_hand: Hand | None
    hands: Sequence[Hand]
    remedies: Sequence[str]
    nets: str
    """A drawing of the nets with their faults; empty if the design declares none."""


def findings_html(title: str, sha256: str, inspected: Sequence[Inspected]) -> str:
    """Return the whole page, with one chapter per design."""
    chapters = [_chapter(design) for design in inspected]
    return render("findings.html.j2", **frame(title, sha256), shapes="", chapters=chapters)


def _chapter(inspected: Inspected) -> _Chapter:
    is_open = [f for f in inspected.findings if f.verdict in ("fail", "warn") or f.by_user]
    rest = [f for f in inspected.findings if f not in is_open]
    hands, remedies = _hands(inspected)
    hand = _design_hand(inspected)
    return _Chapter(inspected.name, is_open, rest, hand, hands, remedies, _nets(inspected))


def _nets(inspected: Inspected) -> str:
    laminate, design = inspected.laminate, inspected.design
    if laminate is None or design is None or not laminate.nets:
        return ""
    drawing = nets_svg(laminate, connectivity(laminate, design))
    return drawing[drawing.index("<svg") :]


def _design_hand(inspected: Inspected) -> Hand | None:
    finding = next((f for f in inspected.findings if f.rule == YIELD), None)
    if finding is None or finding.measured is None or inspected.design is None:
        return None
    return _hand_of(inspected.design, finding.measured)


def _hands(inspected: Inspected) -> tuple[Sequence[Hand], Sequence[str]]:
    """Return larger placement errors and remedies; empty if the builds could not be counted."""
    if inspected.laminate is None or inspected.design is None or _design_hand(inspected) is None:
        return (), ()
    places = at_roughest(inspected.laminate, inspected.design)
    hands = rougher_hands(places, inspected.design)
    return hands, tuple(_remedies(places)) if hands else ()


def _remedies(places: Measures) -> Iterator[str]:
    """Yield remedies that need less accuracy by hand, cheapest first."""
    yield (
        "Print underlay.pdf at 1:1 and lay up on it: its lines show where every edge goes that no "
        "pin holds. Nobody has measured how much steadier that makes a hand; the first row is for "
        "half the error."
    )
    yield (
        "sbafab check design.toml --target-yield 0.99 computes the wider bonds and overhangs that "
        "reach 99 % with this hand."
    )
    if places.design.plate_machine == "jig-borer" and len(places.laminate.pins) > 1:
        yield (
            f"No jig borer for the base plate? {for_a_cnc_mill('design.toml')} makes bonds and "
            "overhangs wide enough for one from a CNC mill."
        )
    if places.laminate.registration == "channel-pin":
        yield (
            'registration.method = "ears" pins every film and separator in every step; the ears '
            "are snipped off afterwards."
        )
    yield (
        "Measure your own builds and set registration.hand_placement and registration.hand_turn "
        "accordingly."
    )
