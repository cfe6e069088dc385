"""registration-worst-case: bond and overhang that remain with every error at its worst.

Cut edges lie off by the cutting error, layers on pins by the pin error (paper Sec. 2), layers
without pins by the hand's placement and turn, and seams by their tool's error of place. A seam's
width is taken to be as exact as a cut edge; it does not count at overlaps of seams.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.on_demand import np
from sbafab.laminate.base_plate import for_a_cnc_mill
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.freedoms import EARS, Freedom
from sbafab.rules.limits import at, holds, least_passing
from sbafab.rules.margins import (
    InterfaceMargins,
    Margin,
    MarginKind,
    Push,
    bonding_seams,
    pushes,
)
from sbafab.rules.measures import DistinctInterface, Measures, interface_name
from sbafab.rules.rule import Explanation, Rule
from sbafab.rules.seam_overlaps import EdgeBond

NAME = "registration-worst-case"

WHAT: dict[MarginKind, str] = {"bond": "bond", "overhang": "overhang of a mask past a film edge"}
REMEDY: dict[MarginKind, str] = {
    "bond": "make bond.width larger, or draw the bond wider",
    "overhang": "make mask.overhang larger, or draw the mask so",
}
STEADIER = (
    "make the seam wider, or run it farther past the edge or the other seam, or state a smaller "
    "registration.seam_error that the tool keeps"
)
SAME = 1e-8
"""mm: of values that differ by less, the first is the worst if they are equal when rounded."""


class Remaining(NamedTuple):
    """Width that remains at the worst margin of an interface, mm; it may be negative.

    ``pinned`` is the least that remains anywhere in it without the errors of the hand. Places that
    are short as drawn do not count for it: bond-width and mask-overhang report those. ``number`` is
    the place of the margin in its ``group``.
    """

    worst: float
    pinned: float
    quantity: MarginKind
    group: InterfaceMargins
    number: int

    @property
    def margin(self) -> Margin:
        return self.group[self.number]

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        return self.group.interfaces

    @property
    def distinct(self) -> DistinctInterface:
        return DistinctInterface(self.interfaces[0], len(self.interfaces))


def least_remaining(measures: Measures) -> list[Remaining]:
    """Return the worst place of every group of equal interfaces, for bond and overhang."""
    forms, design = measures.forms, measures.design
    begins = forms.begins[:-1]
    drawn = forms.by_quantity(
        {
            "bond": least_passing(design.rules.bond_width),
            "overhang": least_passing(design.rules.mask_overhang),
        }
    )
    # Both edges are cut: two contours, or one that is off on either side.
    cut = forms.nominal - forms.cut_edges * design.registration.cutting_error
    is_counted = (forms.nominal >= drawn) | (forms.cut_edges == 0)
    firm = np.where(is_counted, cut - forms.pinned_loss, math.inf)
    pinned = np.minimum.reduceat(firm, begins).tolist()
    worst = cut - forms.loss
    (near,) = (worst <= np.minimum.reduceat(worst, begins)[forms.run] + SAME).nonzero()
    values = worst[near].tolist()
    # Many are equal, and rounding takes time.
    rounded = {value: round(value, 9) for value in set(values)}
    least = [math.inf] * len(forms.runs)
    first = [0] * len(forms.runs)
    for run, value, number in zip(forms.run[near].tolist(), values, near.tolist(), strict=True):
        if rounded[value] < least[run]:
            least[run], first[run] = rounded[value], number
    return [
        Remaining(
            float(worst[number]),
            least_pinned,
            run.quantity,
            measures.margins[run.group],
            run.first + number - begin,
        )
        for run, begin, least_pinned, number in zip(
            forms.runs, begins.tolist(), pinned, first, strict=True
        )
    ]


def check(measures: Measures) -> list[Finding]:
    """The least remaining bond and overhang, each with its place and largest contribution."""
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


RULE = Rule(
    NAME,
    check,
    Explanation(
        "with every error at its worst 0.5 mm of a bond and 0.25 mm of an overhang are left",
        "Cutting and pins must leave that (else it fails); what a hand may take only warns.",
        f"Lay up with care, {EARS}, make bond and overhang larger, or run seams farther past each "
        "other and past edges.",
        (
            "rules.worst_bond_width",
            "rules.worst_mask_overhang",
            "registration.hand_placement",
            "registration.seam_error",
        ),
    ),
)


def _finding(
    quantity: MarginKind, limit: float, remaining: Iterable[Remaining], measures: Measures
) -> Finding:
    places = [place for place in remaining if place.quantity == quantity]
    if not places:
        return Finding(NAME, "pass", limit, None, "mm", Place(), f"no {WHAT[quantity]} to measure")
    worst = min(places, key=lambda place: round(place.worst, 9))
    least_pinned = min(places, key=lambda place: round(place.pinned, 9))
    verdict: Verdict = "pass"
    if not holds(least_pinned.pinned, limit):
        verdict = "fail"
    elif not holds(worst.worst, limit):
        verdict = "warn"
    interface = worst.interfaces[0]
    margin = worst.margin
    dearest = costs(pushes(margin, worst.group.first, measures.moves))
    message = _message(worst, margin, dearest, measures.design)
    remedy = ""
    if verdict == "fail":
        by_seams = any(freedom.seam for freedom, _ in dearest)
        message += (
            f"; even without what is laid by hand {_mm(least_pinned.pinned)} is left at "
            f"{interface_name(least_pinned.interfaces[0])}, and it needs {limit:g}: "
            f"{STEADIER if by_seams else REMEDY[quantity]}"
        )
    elif verdict == "warn":
        short = sum(len(place.interfaces) for place in places if not holds(place.worst, limit))
        remedy = _remedy(quantity, dearest, measures.laminate)
        message = (
            f"{remedy}: {message}; that is short of {limit:g} at {short} "
            f"interface{'s' if short > 1 else ''}, {_why(least_pinned.pinned)}"
        )
    if quantity == "bond":
        message += _plate(verdict == "fail", measures.laminate, measures.design)
    place = Place(interface.index, interface.layer_indices, *margin.middle)
    value = max(0.0, worst.worst)
    return Finding(NAME, verdict, limit, value, "mm", place, message, remedy=remedy)


def _plate(failed: bool, laminate: Laminate, design: Design) -> str:
    """Return the command for a plate that a workshop can make, if several pins hold layers."""
    if design.plate_machine is None or len(laminate.pins) < 2:
        return ""
    command = f"`{for_a_cnc_mill('DESIGN')}`"
    if design.plate_machine == "cnc-mill":
        return f" ({command} finds by how much)" if failed else ""
    exact = ""
    if design.plate_machine == "jig-borer":
        exact = f"its pins are to stand within {design.pin_error:g} mm, which takes a jig borer: "
    return f"; {exact}for a plate from a CNC mill, {command}"


def _message(worst: Remaining, margin: Margin, dearest: Sequence[Push], design: Design) -> str:
    """The value, its place and the largest contribution there."""
    where = f"{interface_name(worst.interfaces[0])}{worst.distinct.suffix}"
    text = (
        f"at worst {_mm(worst.worst)} is left of the {margin.nominal:.3f} mm "
        f"{_what(margin, worst.group.first)} at {where}, {at(margin.middle)}"
    )
    if not dearest and margin.is_overlap:
        return f"{text}; nothing can move"
    if not dearest:
        cutting = design.registration.cutting_error
        return f"{text}; cutting takes {2 * cutting:.3f} mm and nothing can move"
    freedom, cost = dearest[0]
    return f"{text}; largest contribution: {_source(freedom)}, {cost:.3f} mm"


def _what(margin: Margin, interface: Interface) -> str:
    if not margin.is_overlap:
        return WHAT[margin.quantity]
    seams = bonding_seams(interface)
    of, on = (seams[owner.seat - 2 - len(interface.masks)].name for owner in margin.owners)
    return f"overlap of seams {of} and {on}"


def _at_edge(bond: EdgeBond, design: Design) -> Finding:
    """The finding of a seam that may end too near to the edge of a film, or short of it."""
    interface, seam, limit = bond.interface, bond.seam, design.rules.worst_bond_width
    error = design.registration.error_of_seam(seam.tool)
    left = f"bonds only {_mm(bond.width)}" if bond.width > 0 else "ends short"
    message = (
        f"with its end {error:g} mm off its path, seam {seam.name} "
        f"{left} of the film's edge at {interface_name(interface)}, {at(bond.at)}, where it parts "
        f"two voids; it needs {limit:g}: {STEADIER}"
    )
    place = Place(interface.index, interface.layer_indices, *bond.at)
    return Finding(NAME, "fail", limit, bond.width, "mm", place, message)


def costs(acting: Iterable[Push]) -> list[Push]:
    """Return the cost of each body, shift and turn together, the largest first."""
    total: dict[tuple[int, int], Push] = {}
    for push in acting:
        key = push.freedom.step, push.freedom.body
        first = total.get(key, Push(push.freedom, 0.0))
        total[key] = Push(first.freedom, first.cost + push.cost)
    return sorted(total.values(), key=lambda push: -round(push.cost, 9))


def _moved(freedom: Freedom) -> str:
    """Text for the layers of a freedom."""
    is_single = freedom.lowest == freedom.highest
    return (
        f"layer {freedom.lowest}" if is_single else f"layers {freedom.lowest} to {freedom.highest}"
    )


def _source(freedom: Freedom) -> str:
    """Text for a displacement: its cause, its layers and its press step."""
    layers = _moved(freedom)
    if freedom.seam:
        return f"place of seam {freedom.seam}"
    cause = {0: "hand placement", 1: "turn about the only pin"}.get(
        freedom.pins, "play on the pins"
    )
    return f"{cause} of {layers} in step {freedom.step}"


def _why(pinned: float) -> str:
    if math.isinf(pinned):
        return "and short as drawn"
    return f"though pins and cutting alone leave {_mm(pinned)}"


def _remedy(quantity: MarginKind, dearest: Iterable[Push], laminate: Laminate) -> str:
    """Remedy for the hand's errors."""
    loose = next((freedom for freedom, _ in dearest if freedom.pins < 2 and not freedom.seam), None)
    if loose is None:
        return REMEDY[quantity]
    where = f"{_moved(loose)} in step {loose.step}"
    on_its_own = loose.lowest == loose.highest
    masks_pocket = on_its_own and laminate.layer(loose.lowest).role == "chamber-mask"
    if laminate.registration == "channel-pin" and not masks_pocket:
        return f"align {where} with care, or {EARS}"
    return (
        f"align {where} with care (registration.hand_placement, registration.hand_turn), or "
        f"{REMEDY[quantity]}"
    )


def _mm(value: float) -> str:
    return f"{value:.3f} mm" if value > 0 else "nothing"
