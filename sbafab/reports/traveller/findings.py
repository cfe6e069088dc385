"""findings.html: the findings of the design rules, yield against hand placement, remedies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from sbafab.design.records import Design
from sbafab.folders.build import Build
from sbafab.laminate.base_plate import for_a_cnc_mill
from sbafab.laminate.laminate import Laminate
from sbafab.reports.nets_svg import nets_svg
from sbafab.reports.traveller.formatting import frame, render
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.nets import connectivity
from sbafab.rules.registration_yield import simulate

ROUGHER = (0.5, 1.5, 2.0, 2.5)  # factors on the stated hand placement error
BUILDS = 1000  # enough builds for a slope: the 95 % interval is at most 3 in a hundred
YIELD = "registration-yield"


class Hand(NamedTuple):
    """A placement error of up to ``placement`` mm and ``turn`` degrees by hand, and the ``share``
    of builds that then meet every limit.
    """

    placement: float
    turn: float
    share: float


def findings_html(
    title: str, sha256: str, builds: Sequence[Build], between: Sequence[Finding] = ()
) -> str:
    """Return the whole page: one chapter per design, and one for the checks ``between`` parts."""
    chapters = [_chapter(build) for build in builds]
    if between:
        chapters.append(_sorted("Between the parts", between))
    return render("findings.html.j2", **frame(title, sha256), shapes="", chapters=chapters)


def _sorted(name: str, findings: Sequence[Finding]) -> dict[str, Any]:
    """Return a chapter of findings, failures and warnings first."""
    is_open = [f for f in findings if f.verdict in ("fail", "warn") or f.by_user]
    rest = [finding for finding in findings if finding not in is_open]
    return {"name": name, "open": is_open, "rest": rest, "nets": "", "design_hand": None}


def _chapter(build: Build) -> dict[str, Any]:
    """Return the chapter on one design; ``design_hand`` is its stated placement error."""
    laminate, design = build.laminate, build.design
    chapter = _sorted(design.name, build.findings)
    if laminate.nets:
        drawing = nets_svg(laminate, connectivity(laminate, design))
        chapter["nets"] = drawing[drawing.index("<svg") :]
    measured = next((finding.measured for finding in build.findings if finding.rule == YIELD), None)
    if measured is not None:
        hand = design.registration
        chapter |= {
            "design_hand": Hand(hand.hand_placement, hand.hand_turn, measured),
            "hands": other_hands(laminate, design),
            "needs_jig": design.plate_machine == "jig-borer" and len(laminate.pins) > 1,
            "for_a_mill": for_a_cnc_mill("design.toml"),
            "has_channel_pins": laminate.registration == "channel-pin",
        }
    return chapter


def other_hands(laminate: Laminate, design: Design) -> tuple[Hand, ...]:
    """Return the yields at smaller and larger placement errors; empty if all builds pass at the
    largest.
    """
    rougher = [_by_hand(design, factor) for factor in ROUGHER]
    # The margins that the largest error can violate serve smaller errors too.
    places = Measures(laminate, rougher[-1])
    hands = []
    for rougher_design in reversed(rougher):
        builds = simulate(laminate, rougher_design, measures=places.by_hand(rougher_design))
        errors = rougher_design.registration
        hands.append(Hand(errors.hand_placement, errors.hand_turn, builds.whole.value))
        if hands[0].share == 1:
            return ()
    return tuple(reversed(hands))


def _by_hand(design: Design, factor: float) -> Design:
    """Return a design with a placement error ``factor`` times as large, for yield curves."""
    errors = design.registration
    hand = {name: factor * getattr(errors, name) for name in ("hand_placement", "hand_turn")}
    rules = design.rules.model_copy(update={"yield_builds": BUILDS})
    more = {"registration": errors.model_copy(update=hand), "rules": rules}
    return design.model_copy(update=more)
