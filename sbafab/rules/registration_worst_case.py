"""registration-worst-case: bond and overhang that remain with every error at its worst.

Cut edges deviate by the cutting error, layers on pins by the pin error (paper Sec. 2), layers
without pins by the placement and rotation of the hand, and seams by their tool's position error. A
seam's width is assumed to be as accurate as a cut edge; it does not count at overlaps of seams.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.base_plate import for_a_cnc_mill
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.limits import holds, least_passing
from sbafab.rules.margins import MarginKind, Margins, bonding_seams
from sbafab.rules.measures import DistinctInterface, Measures, interface_name, place_in
from sbafab.rules.placement_errors import Freedom
from sbafab.rules.rule import Rule
from sbafab.rules.seam_overlaps import EdgeBond
from sbafab.rules.sentences import Clause, explained, say

NAME = "registration-worst-case"

SAME = 1e-8
"""mm: of values that differ by less, the first is the worst if they are equal when rounded."""


class Remaining(NamedTuple):
    """Width that remains at the worst margin of an interface, mm; it may be negative.

    ``pinned`` is the least width that remains in the interface without hand errors. It excludes
    places that are short as drawn, which bond-width and mask-overhang report. ``number`` is the
    column of the worst of the ``margins`` between the same owners.
    """

    worst: float
    pinned: float
    margins: Margins
    number: int

    @property
    def quantity(self) -> MarginKind:
        return self.margins.quantity

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        return self.margins.interfaces

    @property
    def middle(self) -> Point:
        return self.margins.places.middle(self.number)

    @property
    def is_overlap(self) -> bool:
        """True for the depth of an overlap of two seams."""
        return not self.margins.cut_edges

    @property
    def dearest(self) -> list[tuple[Freedom, float]]:
        """The bodies that can move, and the mm lost by their shift and rotation, largest first."""
        total: dict[tuple[int, int], tuple[Freedom, float]] = {}
        costs = self.margins.costs[:, self.number].tolist()
        for (freedom, _), cost in zip(self.margins.moves, costs, strict=True):
            first, before = total.get((freedom.step, freedom.body), (freedom, 0.0))
            total[freedom.step, freedom.body] = first, before + cost
        return sorted(total.values(), key=lambda push: -round(push[1], 9))


def least_remaining(measures: Measures) -> list[Remaining]:
    """Return the worst place of every group of equal interfaces, for bond and overhang."""
    runs = groupby(measures.margins, key=lambda margins: (id(margins.interfaces), margins.quantity))
    return [_least([*run], measures.design) for _, run in runs]


def _least(run: Sequence[Margins], design: Design) -> Remaining:
    """Return the worst of all margins of one quantity of an interface."""
    bond, overhang = design.rules.bond_width, design.rules.mask_overhang
    drawn = least_passing(bond if run[0].quantity == "bond" else overhang)
    pinned = math.inf
    rows: list[tuple[float, int, float, Margins, int]] = []
    for margins in run:
        # Both edges are cut: two contours, or one that is off on either side.
        cut = margins.places.nominal - margins.cut_edges * design.registration.cutting_error
        counted = (margins.places.nominal >= drawn) | (margins.cut_edges == 0)
        firm = cut[counted] - margins.pinned_loss
        pinned = min(pinned, float(firm.min(initial=math.inf)))
        worst = cut - margins.costs.sum(axis=0)
        (near,) = (worst <= worst.min() + SAME).nonzero()
        for number in near.tolist():
            value = float(worst[number])
            rows.append(
                (round(value, 9), int(margins.places.numbers[number]), value, margins, number)
            )
    _, _, value, margins, number = min(rows, key=lambda row: row[:2])
    return Remaining(value, pinned, margins, number)


def check(measures: Measures) -> list[Finding]:
    """Return the least remaining bond and overhang, with their places and largest contributions."""
    design, remaining = measures.design, least_remaining(measures)
    bond = _finding("bond", design.rules.worst_bond_width, remaining, measures)
    overhang = _finding("overhang", design.rules.worst_mask_overhang, remaining, measures)
    # bond-width reports seams that are too narrow as drawn.
    edges = [
        edge
        for ends in measures.seam_ends
        for edge in ends.edges
        if holds(edge.seam.width, design.rules.bond_width)
    ]
    least = min(edges, key=lambda edge: round(edge.width, 9), default=None)
    if least is not None and bond.verdict != "fail" and not holds(least.width, bond.limit or 0.0):
        bond = _at_edge(least, design)
    return [bond, overhang]


RULE = Rule(NAME, check, explained(NAME))


def _finding(
    quantity: MarginKind, limit: float, remaining: Iterable[Remaining], measures: Measures
) -> Finding:
    places = [place for place in remaining if place.quantity == quantity]
    if not places:
        return judged(NAME, True, limit, None, "mm", Place(), f"no-{quantity}")
    worst = min(places, key=lambda place: round(place.worst, 9))
    least_pinned = min(places, key=lambda place: round(place.pinned, 9))
    verdict: Verdict = "pass"
    if not holds(least_pinned.pinned, limit):
        verdict = "fail"
    elif not holds(worst.worst, limit):
        verdict = "warn"
    dearest = worst.dearest
    by_seams = any(freedom.seam for freedom, _ in dearest)
    pinned, interface = least_pinned.pinned, worst.interfaces[0]
    facts = {
        "rest": _mm(worst.worst),
        "nominal": float(worst.margins.places.nominal[worst.number]),
        "what": _what(worst),
        "where": DistinctInterface(interface, len(worst.interfaces)).name,
        "cause": _cause(worst, measures.design),
        "firm": _mm(pinned),
        "firm_where": interface_name(least_pinned.interfaces[0]),
        "count": sum(len(place.interfaces) for place in places if not holds(place.worst, limit)),
        "why": say(f"{NAME}.{'drawn-short' if math.isinf(pinned) else 'firm-leaves'}"),
        "mending": say(f"{NAME}.{'steadier' if by_seams else f'wider-{quantity}'}"),
        "plate": say(f"{NAME}.no-plate"),
    }
    if verdict == "warn":
        facts["advice"] = _advice(quantity, dearest, measures.laminate)
    if quantity == "bond":
        facts["plate"] = _plate(verdict == "fail", measures.laminate, measures.design)
    sentence = {"pass": "kept", "warn": "short", "fail": "fails"}[verdict]
    place, value = place_in(interface, worst.middle), max(0.0, worst.worst)
    return judged(NAME, verdict, limit, value, "mm", place, sentence, **facts)


def _plate(failed: bool, laminate: Laminate, design: Design) -> Clause:
    """Return the command for a plate that a workshop can make, if several pins hold layers."""
    machine = design.plate_machine if len(laminate.pins) > 1 else None
    sentence = {
        None: "no-plate",
        "cnc-mill": "how-much" if failed else "no-plate",
        "jig-borer": "jig-borer",
    }.get(machine, "mill")
    command = f"`{for_a_cnc_mill('DESIGN')}`"
    return say(f"{NAME}.{sentence}", command=command, pin_error=design.pin_error)


def _cause(worst: Remaining, design: Design) -> Clause:
    """Return the largest contribution to a loss."""
    if worst.dearest:
        freedom, cost = worst.dearest[0]
        return say(f"{NAME}.largest", source=_source(freedom), cost=cost)
    if worst.is_overlap:
        return say(f"{NAME}.still")
    return say(f"{NAME}.cutting", cutting_mm=2 * design.registration.cutting_error)


def _what(worst: Remaining) -> Clause:
    if not worst.is_overlap:
        return say(f"{NAME}.{worst.quantity}")
    interface = worst.interfaces[0]
    seams, first = bonding_seams(interface), 2 + len(interface.masks)
    of, on = (seams[owner.seat - first].name for owner in worst.margins.places.owners)
    return say(f"{NAME}.overlap", of=of, on=on)


def _at_edge(bond: EdgeBond, design: Design) -> Finding:
    """Return the finding of a seam that may end too near the edge of a film, or short of it."""
    interface, seam, limit = bond.interface, bond.seam, design.rules.worst_bond_width
    facts = {
        "error": design.registration.error_of_seam(seam.tool),
        "seam_name": seam.name,
        "held": say(f"{NAME}.{'bonds-only' if bond.width > 0 else 'ends-short'}"),
        "where": interface_name(interface),
    }
    place = place_in(interface, bond.at)
    return judged(NAME, False, limit, bond.width, "mm", place, "edge", **facts)


def _moved(freedom: Freedom) -> Clause:
    """Return the layers that a freedom moves."""
    sentence = "layer" if freedom.lowest == freedom.highest else "layers"
    return say(f"{NAME}.{sentence}", lowest=freedom.lowest, highest=freedom.highest)


def _source(freedom: Freedom) -> Clause:
    """Return the source of a displacement: its cause, its layers and its press step."""
    if freedom.seam:
        return say(f"{NAME}.seam", seam_name=freedom.seam)
    cause = {0: "hand", 1: "turn"}.get(freedom.pins, "play")
    return say(f"{NAME}.{cause}", moved=_moved(freedom), step=freedom.step)


def _advice(
    quantity: MarginKind, dearest: Iterable[tuple[Freedom, float]], laminate: Laminate
) -> Clause:
    """Return the remedy for hand-placement errors."""
    wider = say(f"{NAME}.wider-{quantity}")
    loose = next((freedom for freedom, _ in dearest if freedom.pins < 2 and not freedom.seam), None)
    if loose is None:
        return wider
    on_its_own = loose.lowest == loose.highest
    masks_pocket = on_its_own and laminate.layer(loose.lowest).role == "chamber-mask"
    is_pinned = laminate.registration == "channel-pin" and not masks_pocket
    sentence = "align-or-ears" if is_pinned else "align"
    return say(f"{NAME}.{sentence}", moved=_moved(loose), step=loose.step, mending=wider)


def _mm(value: float) -> Clause:
    return say("words.mm", value=value) if value > 0 else say("words.nothing")
