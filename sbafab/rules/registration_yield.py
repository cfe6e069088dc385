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
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.margin_rows import MarginRows, RowKind, rows_of
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


def check(laminate: Laminate, limits: Limits, measures: Measures | None = None) -> list[Finding]:
    """The share of good builds, against ``target_yield`` if one is asked for."""
    return [finding_of(simulate(laminate, limits, SEED, measures), laminate, limits)]


def finding_of(found: Yield, laminate: Laminate, limits: Limits) -> Finding:
    """What is said of a yield."""
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
    return Finding(NAME, verdict, target, share, "", place, message, remedy=remedy)


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
    layers = [seated(alike.first) for alike in measures.margins]
    rows = rows_of(measures.forms, layers, limits)
    indices = sorted(one.index for alike in measures.margins for one in alike.interfaces)
    return _counted(rows, _asked(rows.kinds, measures), indices, limits, seed, measures.pause)


class _Asked(NamedTuple):
    """What is asked: rows of a kind for an interface, by index, and how many rows are drawn."""

    of: list[tuple[int, RowsAsked]]
    drawn: int


def _asked(kinds: Sequence[RowKind], measures: Measures) -> _Asked:
    """The rows of every interface, each with its own errors."""
    from sbafab.rules.random_builds import RowsAsked

    # In the order in which they are drawn.
    errors: list[dict[Error, int]] = [{} for _ in measures.margins]
    places = []
    for kind in kinds:
        own = errors[kind.group]
        places.append([own.setdefault(error, len(own)) for error in kind.errors])
    felt = [
        [
            (one.index, _renamed(list(own), alike.first, one, measures.moves))
            for one in alike.interfaces
        ]
        for alike, own in zip(measures.margins, errors, strict=True)
    ]
    rows, drawn = rows_by_error(error for group in felt for _, own in group for error in own)
    first = [[(index, [rows[error] for error in own]) for index, own in group] for group in felt]
    found = [
        (index, RowsAsked(number, [own[place] for place in places[number]]))
        for number, kind in enumerate(kinds)
        for index, own in first[kind.group]
    ]
    return _Asked(found, drawn)


def _counted(
    rows: MarginRows,
    asked: _Asked,
    indices: Iterable[int],
    limits: Limits,
    seed: int,
    pause: Callable[[], None],
) -> Yield:
    """Draws the builds, in batches, and counts those in which all rows keep room."""
    import numpy as np

    from sbafab.rules.random_builds import RandomBuilds

    interfaces = dict.fromkeys(indices, 0)
    wanted = limits.yield_builds or _quick_number(len(interfaces))
    whole = 0
    quantities = dict.fromkeys(QUANTITIES, 0)
    of_builds = RandomBuilds(rows, [one for _, one in asked.of], limits.tolerances.cutting)
    place_of = {index: place for place, index in enumerate(interfaces)}
    own_place = np.array([place_of[index] for index, _ in asked.of], dtype=np.intp)
    is_of = {
        quantity: np.array([one.quantity == quantity for one in rows.kinds], dtype=bool)
        for quantity in QUANTITIES
    }
    for first in range(0, wanted, BATCH):
        pause()
        builds = min(BATCH, wanted - first)
        drawn = DrawnBuilds(seed, first * asked.drawn, asked.drawn, builds)
        number, bad = of_builds.short(drawn)
        whole += _different(bad, builds)
        for quantity in QUANTITIES:
            quantities[quantity] += _different(bad[is_of[quantity][of_builds.kind[number]]], builds)
        is_short = np.zeros((len(interfaces), builds), dtype=bool)
        is_short[own_place[number], bad] = True
        for index, short in zip(interfaces, is_short, strict=True):
            interfaces[index] += int(np.count_nonzero(short))
    return Yield(
        Share(wanted - whole, wanted),
        {index: Share(wanted - bad, wanted) for index, bad in interfaces.items()},
        {quantity: Share(wanted - bad, wanted) for quantity, bad in quantities.items()},
    )


def _different(named: Indices, builds: int) -> int:
    """How many of the builds are named, some more than once."""
    import numpy as np

    is_named = np.zeros(builds, dtype=bool)
    is_named[named] = True
    return int(np.count_nonzero(is_named))


def _quick_number(interfaces: int) -> int:
    """10,000 builds up to 30 interfaces, fewer of a taller stack: its interval says so."""
    return max(1000, min(10_000, 300_000 // max(1, interfaces)))


def _renamed(
    errors: list[Error], first: Interface, other: Interface, moves: Freedoms
) -> list[Error]:
    """Which errors of an interface stand where those of an alike one do."""
    if other is first:
        return errors
    from_layers, to_layers = seated(first), seated(other)
    layers = dict(zip(from_layers, to_layers, strict=True))
    twins: dict[int, Freedom] = {}
    pairs = zip(moves.unshared(from_layers), moves.unshared(to_layers), strict=True)
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
