"""registration-yield: the share of random builds in which every interface keeps its limits.

Monte Carlo with a fixed seed. The paper gives only the largest errors, so the distributions are
assumed: every cutting error and turn uniform within its most, every shift uniform over a disc.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from sbafab.laminate.interfaces import Interface
from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.freedoms import Freedom, Freedoms, freedoms
from sbafab.rules.limits import TOLERANCE, Limits
from sbafab.rules.margins import (
    QUANTITIES,
    Margin,
    Push,
    Quantity,
    interface_margins,
    own_freedoms,
    pushes,
    seated,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Bools = NDArray[np.bool_]

NAME = "registration-yield"

SEED = 20_240
PAPER_SUCCESS = 0.9
"""The paper's success rate (Sec. 2), of everything that can go wrong: a yield below it by errors
of place alone draws a warning."""
Z95 = 1.959963984540054
BATCH = 5_000
"""Builds drawn at a time, which bounds the memory."""


class Share(NamedTuple):
    """``good`` of ``builds``, with the Wilson interval of 95 %."""

    good: int
    builds: int

    @property
    def value(self) -> float:
        return self.good / self.builds

    @property
    def interval(self) -> tuple[float, float]:
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


class _Contour(NamedTuple):
    """A cut contour: by how far its film reaches beyond the nominal edge."""

    layer: int
    contour: int


_Error = _Contour | Freedom


class _Row(NamedTuple):
    """What is left at a margin beyond its limit: ``room`` and a sum over what is drawn."""

    quantity: Quantity
    room: float
    terms: tuple[tuple[_Error, tuple[float, ...]], ...]


@dataclass(frozen=True)
class _Group:
    """Rows of the first of some alike interfaces; for each, its own errors by the first's."""

    rows: tuple[_Row, ...]
    own: dict[int, dict[_Error, _Error]]


def check(laminate: Laminate, limits: Limits) -> list[Finding]:
    """The share of good builds, against ``target_yield`` if one is asked for."""
    found = simulate(laminate, limits)
    low, high = found.whole.interval
    target = limits.target_yield
    verdict: Verdict = "pass"
    if target is not None:
        verdict = "pass" if low >= target else "fail"
    elif found.whole.value < PAPER_SUCCESS:
        verdict = "warn"
    message = (
        f"{found.whole.value:.2%} of {found.whole.builds} random builds keep every limit "
        f"(95 % interval {low:.2%} to {high:.2%}){_by_interface(found)}; errors are assumed spread "
        f"evenly, up to {_by_hand(laminate, limits)}"
    )
    if verdict == "fail":
        message += (
            f"; the interval must lie above {target:.10g}: `sbafab check --target-yield` advises"
        )
    worst = min(found.interfaces, key=lambda index: found.interfaces[index].good, default=None)
    place = Place()
    if worst is not None and found.interfaces[worst].good < found.whole.builds:
        place = Place(worst, laminate.interfaces[worst - 1].layer_indices)
    return [Finding(NAME, verdict, target, found.whole.value, "", place, message)]


def _by_hand(laminate: Laminate, limits: Limits) -> str:
    """What the design assumes of the bench, in words."""
    errors = limits.tolerances
    if laminate.panel is not None:
        return f"{errors.sheet:g} mm in a registered sheet"
    return f"{errors.placement:g} mm and {errors.turn:g} degree where a hand places"


def simulate(laminate: Laminate, limits: Limits, seed: int = SEED) -> Yield:
    """Random builds of a laminate; the same seed gives the same shares."""
    moves = freedoms(laminate, limits.tolerances)
    groups = []
    for alike in interface_margins(laminate, limits, moves):
        rows = tuple(_rows(alike.first, alike.margins, limits, moves))
        errors = list(dict.fromkeys(error for row in rows for error, _ in row.terms))
        own = {
            interface.index: _renamed(errors, alike.first, interface, moves)
            for interface in alike.interfaces
        }
        groups.append(_Group(rows, own))
    return _counted(groups, limits, seed)


def _counted(groups: Sequence[_Group], limits: Limits, seed: int) -> Yield:
    """Draws the builds, in batches, and counts those in which all rows keep room."""
    import numpy as np

    generator = np.random.default_rng(seed)
    whole = 0
    quantities = dict.fromkeys(QUANTITIES, 0)
    interfaces = dict.fromkeys(sorted(index for group in groups for index in group.own), 0)
    wanted = limits.yield_builds or _quick_number(len(interfaces))
    for first in range(0, wanted, BATCH):
        builds = min(BATCH, wanted - first)
        draws = _Draws(generator, builds, limits.tolerances.cutting)
        good_of = {quantity: np.ones(builds, dtype=bool) for quantity in QUANTITIES}
        good_at = {index: np.ones(builds, dtype=bool) for index in interfaces}
        for group in groups:
            for index, own in group.own.items():
                for quantity in QUANTITIES:
                    rows = (row for row in group.rows if row.quantity == quantity)
                    kept = _kept(rows, own, draws)
                    good_of[quantity] &= kept
                    good_at[index] &= kept
        whole += int(np.logical_and.reduce(list(good_of.values())).sum())
        quantities = {name: total + int(good_of[name].sum()) for name, total in quantities.items()}
        interfaces = {i: total + int(good_at[i].sum()) for i, total in interfaces.items()}
    return Yield(
        Share(whole, wanted),
        {index: Share(good, wanted) for index, good in interfaces.items()},
        {quantity: Share(good, wanted) for quantity, good in quantities.items()},
    )


def _quick_number(interfaces: int) -> int:
    """10,000 builds up to 30 interfaces, fewer of a taller stack: its interval says so."""
    return max(1000, min(10_000, 300_000 // max(1, interfaces)))


def _kept(rows: Iterable[_Row], own: dict[_Error, _Error], draws: _Draws) -> Bools:
    """In which builds an interface, with its own errors, keeps room at all of the rows.

    Sums are taken row by row: a matrix product would round differently on another machine.
    """
    import numpy as np

    kept = np.ones(draws.builds, dtype=bool)
    for row in rows:
        left = np.full(draws.builds, row.room)
        for error, factors in row.terms:
            for factor, drawn in zip(factors, draws.of(own[error]), strict=True):
                left += factor * drawn
        kept &= left >= -TOLERANCE
    return kept


class _Draws:
    """The errors of a batch of builds, each drawn when it is first asked for."""

    def __init__(self, generator: np.random.Generator, builds: int, cutting: float) -> None:
        self.generator = generator
        self.builds = builds
        self.cutting = cutting
        self.drawn: dict[_Error, Floats] = {}

    def of(self, error: _Error) -> Floats:
        """X and y of a shift, or the one value of a cutting error or turn, for every build."""
        if error not in self.drawn:
            self.drawn[error] = self._draw(error)
        return self.drawn[error]

    def _draw(self, error: _Error) -> Floats:
        import numpy as np

        if isinstance(error, Freedom) and error.centre is None:
            # Uniform over a disc: the radius goes with the root.
            radius = error.most * np.sqrt(self.generator.random(self.builds))
            angle = math.tau * self.generator.random(self.builds)
            return np.vstack([radius * np.cos(angle), radius * np.sin(angle)])
        most = error.most if isinstance(error, Freedom) else self.cutting
        return self.generator.uniform(-most, most, (1, self.builds))


def _renamed(
    errors: Iterable[_Error], first: Interface, other: Interface, moves: Freedoms
) -> dict[_Error, _Error]:
    """Which errors of an interface stand where those of an alike one do."""
    layers = dict(zip(seated(first), seated(other), strict=True))
    twins: dict[_Error, Freedom] = {}
    pairs = zip(own_freedoms(first, moves), own_freedoms(other, moves), strict=True)
    for ours, theirs in pairs:
        twins.update(zip(ours, theirs, strict=True))
    return {
        error: twins[error]
        if isinstance(error, Freedom)
        else _Contour(layers[error.layer], error.contour)
        for error in errors
    }


def _rows(
    interface: Interface, margins: Iterable[Margin], limits: Limits, moves: Freedoms
) -> list[_Row]:
    """The margins that can come short at all; of those that feel all errors alike, the least."""
    limit_of = {"bond": limits.worst_bond_width, "overhang": limits.worst_mask_overhang}
    layers = seated(interface)
    found: dict[object, _Row] = {}
    for margin in margins:
        room = margin.nominal - limit_of[margin.quantity]
        felt_by = pushes(margin, interface, moves)
        loss = sum(push.cost for push in felt_by)
        if room - 2 * limits.tolerances.cutting - loss < -TOLERANCE:
            row = _Row(margin.quantity, room, tuple(_terms(margin, layers, felt_by)))
            felt = tuple((error, *(round(f, 3) for f in factors)) for error, factors in row.terms)
            known = found.get((margin.quantity, felt))
            if known is None or room < known.room:
                found[margin.quantity, felt] = row
    return list(found.values())


def _terms(
    margin: Margin, layers: Sequence[int], found: Iterable[Push]
) -> Iterator[tuple[_Error, tuple[float, ...]]]:
    """What widens the margin, and by how much for each unit of it."""
    nx, ny = margin.normal
    for owner in margin.owners:
        # More film widens a bond, more mask an overhang.
        widens = owner.is_film == (margin.quantity == "bond")
        yield _Contour(layers[owner.seat], owner.contour), (1.0 if widens else -1.0,)
    for push in found:
        sign = 1.0 if push.at_end else -1.0
        freedom = push.freedom
        if freedom.centre is None:
            yield freedom, (sign * nx, sign * ny)
        else:
            p = margin.end if push.at_end else margin.start
            yield freedom, (sign * freedom.lever(p, margin.normal),)


def _by_interface(found: Yield) -> str:
    """Runs of interfaces that are not always good, with the least share of each run."""
    losing = {i: share for i, share in found.interfaces.items() if share.good < share.builds}
    if not losing:
        return ""
    order = sorted(losing, key=lambda i: (losing[i].good, i))
    parts = [f"{i} {losing[i].value:.2%}" for i in order[:3]]
    others = f", {len(order) - 3} others above" if len(order) > 3 else ""
    return f"; by interface: {', '.join(parts)}{others}"
