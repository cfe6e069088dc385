"""registration-worst-case: what is left of bond and overhang when every error is at its worst.

Cut edges lie off by the cutting error, layers on pins by the pin error (paper Sec. 2), what no pin
holds by what a hand may misplace and turn it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate
from sbafab.rules.alike import Alike, interface_name
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.forms import LinearForms
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.limits import Limits, Tolerances, at, holds, least_held
from sbafab.rules.margins import InterfaceMargins, Margin, Push, Quantity, pushes
from sbafab.rules.measures import Measures

NAME = "registration-worst-case"

WHAT: dict[Quantity, str] = {"bond": "bond", "overhang": "overhang of a mask past a film edge"}
REMEDY: dict[Quantity, str] = {"bond": "bond.width", "overhang": "mask.overhang"}
SAME = 1e-8
"""mm: of values that differ by less, the first is the worst if they are equal when rounded."""


class Remaining(NamedTuple):
    """What is left at the worst margin of an interface, mm; it may be negative.

    ``pinned`` is the least that is left anywhere in it without what is laid by hand. Places that
    are short as drawn do not count for it: bond-width and mask-overhang tell of those.
    """

    worst: float
    pinned: float
    margin: Margin
    interfaces: tuple[Interface, ...]
    pushes: tuple[Push, ...]

    @property
    def alike(self) -> Alike:
        return Alike(self.interfaces[0], len(self.interfaces))


def least_remaining(
    laminate: Laminate, limits: Limits, measures: Measures | None = None
) -> list[Remaining]:
    """The worst place of every interface (one of each that are alike) for bond and overhang."""
    measures = measures or Measures(laminate, limits)
    found: list[Remaining] = []
    for group, forms in zip(measures.margins, measures.forms, strict=True):
        found += [_least(group, own, measures.moves, limits) for own in forms]
    return found


def check(laminate: Laminate, limits: Limits, measures: Measures | None = None) -> list[Finding]:
    """The least remaining bond and overhang, each with its place and the largest contribution."""
    found = least_remaining(laminate, limits, measures)
    return [
        _finding("bond", limits.worst_bond_width, found, limits, laminate),
        _finding("overhang", limits.worst_mask_overhang, found, limits, laminate),
    ]


def _least(
    group: InterfaceMargins, forms: LinearForms, moves: Freedoms, limits: Limits
) -> Remaining:
    """What is left at the worst of one quantity's margins; the first of those that are equal."""
    drawn = limits.bond_width if forms.quantity == "bond" else limits.mask_overhang
    # Both edges are cut: two contours, or one that is off on either side.
    cut = forms.nominal - 2 * limits.tolerances.cutting
    held = (cut - forms.pinned_loss)[forms.nominal >= least_held(drawn)]
    worst = cut - forms.loss
    (near,) = (worst <= worst.min() + SAME).nonzero()
    values = [round(value, 9) for value in worst[near].tolist()]
    number = int(near[values.index(min(values))])
    margin = group[forms.first + number]
    found = pushes(margin, group.first, moves)
    pinned = float(held.min(initial=math.inf))
    return Remaining(float(worst[number]), pinned, margin, group.interfaces, tuple(found))


def _finding(
    quantity: Quantity,
    limit: float,
    found: Iterable[Remaining],
    limits: Limits,
    laminate: Laminate,
) -> Finding:
    own = [place for place in found if place.margin.quantity == quantity]
    if not own:
        return Finding(NAME, "pass", limit, None, "mm", Place(), f"no {WHAT[quantity]} to measure")
    worst = min(own, key=lambda place: round(place.worst, 9))
    least_pinned = min(own, key=lambda place: round(place.pinned, 9))
    verdict: Verdict = "pass"
    if not holds(least_pinned.pinned, limit):
        verdict = "fail"
    elif not holds(worst.worst, limit):
        verdict = "warn"
    interface = worst.interfaces[0]
    message = _message(worst, limits.tolerances)
    remedy = ""
    if verdict == "fail":
        message += (
            f"; even without what is laid by hand {_mm(least_pinned.pinned)} is left at "
            f"{interface_name(least_pinned.interfaces[0])}, and it needs {limit:g}: make "
            f"{REMEDY[quantity]} larger"
        )
    elif verdict == "warn":
        short = sum(len(place.interfaces) for place in own if not holds(place.worst, limit))
        remedy = _remedy(worst, laminate)
        message = (
            f"{remedy}: {message}; that is short of {limit:g} at {short} "
            f"interface{'s' if short > 1 else ''}, {_why(least_pinned.pinned)}"
        )
    place = Place(interface.index, interface.layer_indices, *worst.margin.middle)
    left = max(0.0, worst.worst)
    return Finding(NAME, verdict, limit, left, "mm", place, message, remedy=remedy)


def _message(worst: Remaining, tolerances: Tolerances) -> str:
    """The value, its place and the largest contribution there."""
    where = f"{interface_name(worst.interfaces[0])}{worst.alike.others}"
    text = (
        f"at worst {_mm(worst.worst)} is left of the {worst.margin.nominal:.3f} mm "
        f"{WHAT[worst.margin.quantity]} at {where}, {at(worst.margin.middle)}"
    )
    bodies = costs(worst.pushes)
    if not bodies:
        return f"{text}; cutting takes {2 * tolerances.cutting:.3f} mm and nothing can move"
    freedom, cost = bodies[0]
    return f"{text}; largest contribution: {_source(freedom)}, {cost:.3f} mm"


def costs(found: Iterable[Push]) -> list[tuple[Freedom, float]]:
    """What each body costs, shift and turn together, the dearest first."""
    total: dict[tuple[int, int], tuple[Freedom, float]] = {}
    for push in found:
        key = push.freedom.step, push.freedom.body
        freedom, cost = total.get(key, (push.freedom, 0.0))
        total[key] = freedom, cost + push.cost
    return sorted(total.values(), key=lambda entry: -round(entry[1], 9))


def _moved(freedom: Freedom) -> str:
    """The layers that move."""
    one = freedom.lowest == freedom.highest
    return f"layer {freedom.lowest}" if one else f"layers {freedom.lowest} to {freedom.highest}"


def _source(freedom: Freedom) -> str:
    """What may move which layers, and in which press step."""
    what = _moved(freedom)
    if freedom.in_sheet:
        return f"stretch or transfer of {what} in its sheet"
    how = {0: "hand placement", 1: "turn about the only pin"}.get(freedom.pins, "play on the pins")
    return f"{how} of {what} in step {freedom.step}"


def _why(pinned: float) -> str:
    if math.isinf(pinned):
        return "and short as drawn"
    return f"though pins and cutting alone leave {_mm(pinned)}"


def _remedy(worst: Remaining, laminate: Laminate) -> str:
    """What to do about what the hand may take."""
    loose = next((freedom for freedom, _ in costs(worst.pushes) if freedom.pins < 2), None)
    if loose is None:
        return f"make {REMEDY[worst.margin.quantity]} larger"
    where = f"{_moved(loose)} in step {loose.step}"
    on_its_own = loose.lowest == loose.highest
    masks_pocket = on_its_own and laminate.layer(loose.lowest).role == "chamber-mask"
    if laminate.registration == "channel-pin" and not masks_pocket:
        return f'align {where} with care, or set registration.method = "ears", which pins it'
    return (
        f"align {where} with care (registration.hand_placement, registration.hand_turn), or make "
        f"{REMEDY[worst.margin.quantity]} larger"
    )


def _mm(value: float) -> str:
    return f"{value:.3f} mm" if value > 0 else "nothing"
