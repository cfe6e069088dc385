"""registration-yield: the share of random builds in which every interface keeps its limits.

Monte Carlo with a fixed seed. The paper gives only the largest errors, so the distributions are
assumed: every cutting error and turn uniform within its most, every shift uniform over a disc.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate
from sbafab.rules.draws import CutContour, DrawnBuilds, Error, rows_by_error
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.forms import LinearForms
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.margin_rows import MarginRows, rows_of
from sbafab.rules.margins import QUANTITIES, Quantity, seated
from sbafab.rules.measures import Measures

if TYPE_CHECKING:
    from sbafab.geometry.arrays import Indices
    from sbafab.rules.random_builds import RowsAsked

NAME = "registration-yield"

SEED = 20_240
PAPER_SUCCESS = 0.9
"""The paper's success rate (Sec. 2), of everything that can go wrong: a yield that is surely below
it by errors of place alone draws a warning. The hand is calibrated on this very rate, so that what
the interval leaves open is no news."""
Z95 = 1.959963984540054
BATCH = 5_000
"""Builds drawn at a time, which bounds the memory."""


class Share(NamedTuple):
    """``good`` of ``builds``, with the Wilson interval of 95 %."""

    good: int
    builds: int

    @property
    def value(self) -> float:
        """The share of good builds."""
        return self.good / self.builds

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of 95 % of the share."""
        n, p, z = self.builds, self.value, Z95
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
        return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True)
class Yield:
    """Shares of good builds: of all interfaces together, of each (by index), of each quantity."""

    whole: Share
    interfaces: dict[int, Share]
    quantities: dict[Quantity, Share]


@dataclass(frozen=True)
class _Group:
    """Rows of the first of some alike interfaces, each with the numbers of its errors; and for
    every interface, by index, its own errors by number.
    """

    rows: dict[Quantity, list[tuple[MarginRows, list[int]]]]
    own: dict[int, list[Error]]


def check(laminate: Laminate, limits: Limits, measures: Measures | None = None) -> list[Finding]:
    """The share of good builds, against ``target_yield`` if one is asked for."""
    found = simulate(laminate, limits, SEED, measures)
    low, high = found.whole.interval
    target = limits.target_yield
    verdict: Verdict = "pass"
    if target is not None:
        verdict = "pass" if low >= target else "fail"
    elif high < PAPER_SUCCESS:
        verdict = "warn"
    message = (
        f"{found.whole.value:.2%} of {found.whole.builds} random builds keep every limit "
        f"(95 % interval {low:.2%} to {high:.2%}){_by_interface(found)}; errors are assumed spread "
        f"evenly, up to {_by_hand(laminate, limits)}"
    )
    if target is None:
        message += "; no least share is asked for (rules.target_yield)"
    else:
        message += f"; the lower end of the interval must be {100 * target:.10g}% at least"
    if verdict == "fail":
        message += ": `sbafab check --target-yield` advises"
    remedy = _remedy(laminate) if verdict == "warn" else ""
    if remedy:
        message = f"{remedy}: {message}"
    worst = min(found.interfaces, key=lambda index: found.interfaces[index].good, default=None)
    place = Place()
    if worst is not None and found.interfaces[worst].good < found.whole.builds:
        place = Place(worst, laminate.interfaces[worst - 1].layer_indices)
    share = found.whole.value
    return [Finding(NAME, verdict, target, share, "", place, message, remedy=remedy)]


def _remedy(laminate: Laminate) -> str:
    """What makes more builds good."""
    wider = "ask `sbafab check --target-yield 0.95` how much wider bonds and overhangs should be"
    if laminate.registration == "channel-pin":
        return f'{wider}, or set registration.method = "ears"'
    return wider


def _by_hand(laminate: Laminate, limits: Limits) -> str:
    """What the design assumes of the bench, in words."""
    errors = limits.tolerances
    if laminate.panel is not None:
        return f"{errors.sheet:g} mm in a registered sheet"
    return (
        f"{errors.placement:g} mm and {errors.turn:g} degree where a hand places"
        f"{_calibrated(errors)}"
    )


def _calibrated(tolerances: Tolerances) -> str:
    """Where the hand's figures come from, if they are the usual ones."""
    usual = Tolerances()
    if (tolerances.placement, tolerances.turn) != (usual.placement, usual.turn):
        return ""
    return f" (calibrated on the paper's success rate of {PAPER_SUCCESS:.0%}, not measured)"


def simulate(
    laminate: Laminate, limits: Limits, seed: int = SEED, measures: Measures | None = None
) -> Yield:
    """Random builds of a laminate; the same seed gives the same shares."""
    measures = measures or Measures(laminate, limits)
    groups = []
    for alike, forms in zip(measures.margins, measures.forms, strict=True):
        rows = _rows(forms, seated(alike.first), limits)
        # In the order in which they are drawn.
        numbers: dict[Error, int] = {}
        numbered = {
            quantity: [
                (one, [numbers.setdefault(error, len(numbers)) for error in one.errors])
                for one in some
            ]
            for quantity, some in rows.items()
        }
        own = {
            interface.index: _renamed(list(numbers), alike.first, interface, measures.moves)
            for interface in alike.interfaces
        }
        groups.append(_Group(numbered, own))
    return _counted(groups, limits, seed, measures.pause)


def _rows(
    forms: Iterable[LinearForms], layers: Sequence[int], limits: Limits
) -> dict[Quantity, tuple[MarginRows, ...]]:
    """The rows of an interface by quantity, those of the first margins first."""
    limit = {"bond": limits.worst_bond_width, "overhang": limits.worst_mask_overhang}
    found = (
        one
        for form in forms
        for one in rows_of(form, layers, limit[form.quantity], limits.tolerances.cutting)
    )
    ordered = sorted(found, key=lambda one: one[0])
    return {
        quantity: tuple(rows for _, rows in ordered if rows.quantity == quantity)
        for quantity in QUANTITIES
    }


def _counted(
    groups: Sequence[_Group], limits: Limits, seed: int, pause: Callable[[], None]
) -> Yield:
    """Draws the builds, in batches, and counts those in which all rows keep room."""
    import numpy as np

    from sbafab.rules.random_builds import RandomBuilds

    interfaces = dict.fromkeys(sorted(index for group in groups for index in group.own), 0)
    wanted = limits.yield_builds or _quick_number(len(interfaces))
    whole = 0
    quantities = dict.fromkeys(QUANTITIES, 0)
    told, count = _told(groups)
    of_builds = RandomBuilds([asked for *_, asked in told], limits.tolerances.cutting)
    own_index = np.array([index for _, index, _ in told], dtype=np.intp)
    is_of = {
        quantity: np.array([one == quantity for one, *_ in told], dtype=bool)
        for quantity in QUANTITIES
    }
    for first in range(0, wanted, BATCH):
        pause()
        builds = min(BATCH, wanted - first)
        asked, bad = of_builds.short(DrawnBuilds(seed, first * count, count, builds))
        whole += _different(bad)
        for quantity in QUANTITIES:
            quantities[quantity] += _different(bad[is_of[quantity][asked]])
        every = np.sort(own_index[asked] * builds + bad)
        short = every[np.diff(every, prepend=-1) > 0] // builds
        for index, number in enumerate(np.bincount(short).tolist()):
            if number:
                interfaces[index] += number
    return Yield(
        Share(wanted - whole, wanted),
        {index: Share(wanted - bad, wanted) for index, bad in interfaces.items()},
        {quantity: Share(wanted - bad, wanted) for quantity, bad in quantities.items()},
    )


def _told(groups: Sequence[_Group]) -> tuple[list[tuple[Quantity, int, RowsAsked]], int]:
    """What is asked of each interface, by quantity and index; and how many rows are drawn."""
    from sbafab.rules.random_builds import RowsAsked

    rows, count = rows_by_error(
        error for group in groups for own in group.own.values() for error in own
    )
    found = []
    for group in groups:
        first = [(index, [rows[error] for error in own]) for index, own in group.own.items()]
        for quantity, asked in group.rows.items():
            for some, numbers in asked:
                for index, own in first:
                    places = tuple([own[number] for number in numbers])
                    found.append((quantity, index, RowsAsked(some, places)))
    return found, count


def _different(builds: Indices) -> int:
    """How many builds are named, some more than once."""
    return len(set(builds.tolist()))


def _quick_number(interfaces: int) -> int:
    """10,000 builds up to 30 interfaces, fewer of a taller stack: its interval says so."""
    return max(1000, min(10_000, 300_000 // max(1, interfaces)))


def _renamed(
    errors: list[Error], first: Interface, other: Interface, moves: Freedoms
) -> list[Error]:
    """Which errors of an interface stand where those of an alike one do."""
    if other is first:
        return errors
    layers = dict(zip(seated(first), seated(other), strict=True))
    twins: dict[int, Freedom] = {}
    pairs = zip(moves.unshared(seated(first)), moves.unshared(seated(other)), strict=True)
    for ours, theirs in pairs:
        twins.update(zip(map(id, ours), theirs, strict=True))
    return [
        twins[id(error)]
        if isinstance(error, Freedom)
        else CutContour(layers[error.layer], error.contour)
        for error in errors
    ]


def _by_interface(found: Yield) -> str:
    """Runs of interfaces that are not always good, with the least share of each run."""
    losing = {i: share for i, share in found.interfaces.items() if share.good < share.builds}
    if not losing:
        return ""
    order = sorted(losing, key=lambda i: (losing[i].good, i))
    parts = [f"{i} {losing[i].value:.2%}" for i in order[:3]]
    others = f", {len(order) - 3} others above" if len(order) > 3 else ""
    return f"; by interface: {', '.join(parts)}{others}"
