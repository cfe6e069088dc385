"""findings.html: the findings of the design rules, yield against hand placement, remedies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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
YIELD = "registration-yield"


class Hand(NamedTuple):
    """A placement error of up to ``placement`` mm and ``turn`` degrees by hand, and the ``share``
    of builds that keep every limit at it.
    """

    placement: float
    turn: float
    share: float


@dataclass(frozen=True)
class Inspected:
    """A design with its findings; the laminate is None for the checks of an assembly."""

    name: str
    findings: Sequence[Finding]
    laminate: Laminate | None = None
    design: Design | None = None


def findings_html(title: str, sha256: str, inspected: Sequence[Inspected]) -> str:
    """Return the whole page, with one chapter per design."""
    chapters = [_chapter(design) for design in inspected]
    return render("findings.html.j2", **frame(title, sha256), shapes="", chapters=chapters)


def _chapter(inspected: Inspected) -> dict[str, Any]:
    """Return the chapter on one design; ``design_hand`` is the placement error that it states."""
    laminate, design, findings = inspected.laminate, inspected.design, inspected.findings
    is_open = [f for f in findings if f.verdict in ("fail", "warn") or f.by_user]
    chapter: dict[str, Any] = {
        "name": inspected.name,
        "open": is_open,
        "rest": [finding for finding in findings if finding not in is_open],
        "nets": "",
        "design_hand": None,
        "hands": (),
    }
    if laminate is None or design is None:
        return chapter
    if laminate.nets:
        drawing = nets_svg(laminate, connectivity(laminate, design))
        chapter["nets"] = drawing[drawing.index("<svg") :]
    measured = next((finding.measured for finding in findings if finding.rule == YIELD), None)
    if measured is not None:
        hand = design.registration
        chapter["design_hand"] = Hand(hand.hand_placement, hand.hand_turn, measured)
        chapter["hands"] = other_hands(laminate, design)
        chapter["needs_jig"] = design.plate_machine == "jig-borer" and len(laminate.pins) > 1
        chapter["for_a_mill"] = for_a_cnc_mill("design.toml")
        chapter["has_channel_pins"] = laminate.registration == "channel-pin"
    return chapter


def other_hands(laminate: Laminate, design: Design) -> tuple[Hand, ...]:
    """Return the yields at smaller and larger placement errors; empty if the largest loses no
    build.
    """
    *steadier, largest = (_by_hand(design, factor) for factor in ROUGHER)
    # The margins that the largest error can violate serve smaller errors too.
    places = Measures(laminate, largest)
    roughest = _hand(places, largest)
    if roughest.share == 1:
        return ()
    return (*(_hand(places, other) for other in steadier), roughest)


def _by_hand(design: Design, factor: float) -> Design:
    """Return a design whose hand is ``factor`` times as rough, and whose yield is a slope's."""
    errors = design.registration
    hand = {
        "hand_placement": factor * errors.hand_placement,
        "hand_turn": factor * errors.hand_turn,
    }
    rules = design.rules.model_copy(update={"yield_builds": BUILDS})
    registration = errors.model_copy(update=hand)
    return design.model_copy(update={"registration": registration, "rules": rules})


def _hand(places: Measures, design: Design) -> Hand:
    builds = simulate(places.laminate, design, measures=places.by_hand(design))
    hand = design.registration
    return Hand(hand.hand_placement, hand.hand_turn, builds.whole.value)
