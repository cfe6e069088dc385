"""registration-yield: the share of random builds in which every interface keeps its limits.

Monte Carlo with a fixed seed. The paper gives only maximum errors; assumed are a uniform cutting
error and rotation up to the maximum, and a shift uniform over a disc.

Each error has a row of random numbers a batch (a shift has two).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from sbafab.design.records import Design
from sbafab.design.sections import Registration
from sbafab.geometry.lazy_numpy import np
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margins import Margins, seated
from sbafab.rules.measures import Measures
from sbafab.rules.placement_errors import Freedom, Freedoms, unshared
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Clause, explained, say

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Floats, Indices


NAME = "registration-yield"

SEED = 20_240
PAPER_SUCCESS = 0.9
"""The paper's success rate (Sec. 2), of everything that can go wrong: a yield that is surely below
it by errors of place alone draws a warning. The hand is calibrated on this very rate, so a rate
within the interval tells nothing new."""
Z95 = 1.959963984540054
BATCH = 5_000
"""Builds drawn at a time, which bounds the memory."""
AT_ONCE = 200_000
"""Sums of margins in builds that are worked out at once, which bounds the memory."""
HALF_INTERVAL = 0.005
"""Half the interval's width at most, if the design gives no number of builds: then the share of
other builds lies within one percentage point of it."""
ROUNDING = 1e-9
"""mm: more than the rounding of a sum of all errors."""


class Share(NamedTuple):
    """The number ``good`` of ``builds``, with the 95 % Wilson interval of the share."""

    good: int
    builds: int

    @property
    def value(self) -> float:
        """The share of good builds."""
        return self.good / self.builds

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % Wilson interval of the share."""
        n, p, z = self.builds, self.value, Z95
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
        return max(0.0, middle - half), min(1.0, middle + half)


class Yield(NamedTuple):
    """Shares of good builds: for all interfaces together, and for each (by index)."""

    whole: Share
    interfaces: dict[int, Share]


def check(measures: Measures) -> list[Finding]:
    """Return the share of good builds, compared with ``target_yield`` if the design sets one."""
    laminate, design = measures.laminate, measures.design
    return [finding_of(simulate(laminate, design, SEED, measures), laminate, design)]


RULE = Rule(NAME, check, explained(NAME))


def finding_of(outcome: Yield, laminate: Laminate, design: Design) -> Finding:
    """Return the finding of a yield."""
    share, hand, target = outcome.whole, design.registration, design.rules.target_yield
    low, high = share.interval
    verdict: Verdict = "pass"
    sentence = "free"
    if target is not None:
        verdict, sentence = "pass" if low >= target else "fail", "target"
    elif high < PAPER_SUCCESS:
        sentence = "low-ears" if laminate.registration == "channel-pin" else "low"
        if not design.uses("bond.width"):
            sentence = "low-drawn"
        verdict = "warn"
    usual = Registration.model_construct()
    is_usual = (hand.hand_placement, hand.hand_turn) == (usual.hand_placement, usual.hand_turn)
    losing = {i: each for i, each in outcome.interfaces.items() if each.good < each.builds}
    order = sorted(losing, key=lambda i: (losing[i].good, i))
    facts = {
        "builds": share.builds,
        "low": low,
        "high": high,
        "losing": _losing(losing, order),
        "placement": hand.hand_placement,
        "turn": hand.hand_turn,
        "source": say(f"{NAME}.{'calibrated' if is_usual else 'stated'}", paper=PAPER_SUCCESS),
        "percent": 100 * (target or 0.0),
    }
    place = Place(order[0], laminate.interfaces[order[0] - 1].layer_indices) if order else Place()
    finding = judged(NAME, verdict, target, share.value, "", place, sentence, **facts)
    return replace(finding, interval=share.interval)


def _losing(shares: Mapping[int, Share], order: Sequence[int]) -> Clause:
    """Return the interfaces that lose builds, with the lowest shares."""
    if not order:
        return say(f"{NAME}.no-losing")
    first = ", ".join(f"{i} {shares[i].value:.2%}" for i in order[:3])
    others = len(order) - 3
    sentence = "losing-others" if others > 0 else "losing"
    return say(f"{NAME}.{sentence}", first=first, others=others)


# Random builds in which a margin of an interface comes short.


CutContour = tuple[int, int]
"""A layer and its cut contour, by how far the film reaches beyond its nominal edge."""
Error = CutContour | Freedom


class ShortMargins(NamedTuple):
    """Margins between two contours that can fall short, by their ``room`` beyond the limit, mm.

    They depend on ``errors``: first the two contours, with their ``signs``, then the moves.
    """

    margins: Margins
    room: Floats
    errors: Sequence[Error]
    signs: tuple[float, float]


def short_margins(margins: Margins, design: Design) -> ShortMargins | None:
    """Return the margins that fall short with every error at its worst; None if there are none."""
    rules, is_bond, places = design.rules, margins.quantity == "bond", margins.places
    room = places.nominal - (rules.worst_bond_width if is_bond else rules.worst_mask_overhang)
    cut = margins.cut_edges * design.registration.cutting_error
    (short,) = (room - cut - margins.costs.sum(axis=0) < -TOLERANCE).nonzero()
    if not len(short):
        return None
    layers = seated(margins.interfaces[0])
    cuts = [(layers[owner.seat], owner.contour) for owner in places.owners]
    # More film widens a bond, more mask an overhang; no cut moves an overlap of seams.
    a, b = (
        (1.0 if owner.is_film == is_bond else -1.0) if owner.is_cut else 0.0
        for owner in places.owners
    )
    levers = margins.levers[:, short]
    of_short = margins._replace(places=places.at(short), levers=levers)
    errors: list[Error] = [*cuts, *(freedom for freedom, _ in margins.moves)]
    return ShortMargins(of_short, room[short], errors, (a, b))


def short_builds(
    short: ShortMargins, first: Indices, cutting: float, numbers: Floats
) -> tuple[Indices, Indices]:
    """Return the interfaces and builds in which one of the margins falls short.

    ``first`` are the numbers of the first row of each error, one column for each interface;
    ``numbers`` are from 0 to 1, one row for each error and one column for each build.
    """
    margins, room, _, signs = short
    moves = list(zip(margins.moves, margins.levers, first[2:], strict=True))
    shifts = [(way.most, row) for (way, _), _, row in moves if way.centre is None]
    turns = [way.most * abs(lever) for (way, _), lever, _ in moves if way.centre is not None]
    # Most builds keep their limits by their cuts alone, and others however the shifts point,
    # whatever turns.
    least = ROUNDING - TOLERANCE - float((room - sum(turns)).min())
    there = first[:2]
    off = sum(2 * sign * cutting * numbers[row] for sign, row in zip(signs, there, strict=True))
    shifted = sum(most for most, _ in shifts)
    may = np.flatnonzero(off < least + shifted + cutting * sum(signs))
    place, build = np.divmod(may, numbers.shape[1])
    cuts = sum(
        sign * cutting * (2 * numbers[row[place], build] - 1)
        for sign, row in zip(signs, there, strict=True)
    )
    farthest = sum(most * np.sqrt(numbers[row[place], build]) for most, row in shifts)
    (near,) = np.nonzero(cuts - farthest < least)
    place, build, cuts = place[near], build[near], cuts[near]
    is_short = np.zeros(len(build), dtype=bool)
    step = max(1, AT_ONCE // len(room))
    for some in (slice(begin, begin + step) for begin in range(0, len(build), step)):
        remaining = room[:, None] + cuts[some]
        moved = np.zeros((2, remaining.shape[1]))
        for (freedom, sign), lever, row in moves:
            number = numbers[row[place[some]], build[some]]
            if freedom.centre is not None:
                remaining += lever[:, None] * (freedom.most * (2 * number - 1))
            else:
                angle = math.tau * numbers[row[place[some]] + 1, build[some]]
                way = np.array([np.cos(angle), np.sin(angle)])
                moved += sign * freedom.most * np.sqrt(number) * way
        # Not a matrix product, which would round differently on another machine.
        for normal, move in zip(margins.places.normal, moved, strict=True):
            remaining += normal[:, None] * move
        is_short[some] = (remaining < -TOLERANCE).any(axis=0)
    return place[is_short], build[is_short]


def simulate(
    laminate: Laminate, design: Design, seed: int = SEED, measures: Measures | None = None
) -> Yield:
    """Return the yield of random builds of a laminate; the same seed gives the same shares."""
    measures = measures or Measures(laminate, design)
    indices = sorted({gap.index for equal in measures.equal for gap in equal})
    shortfalls, drawn_rows = _drawn(measures)
    total = first_builds = design.rules.yield_builds or max(
        1000, min(10_000, 300_000 // max(1, len(indices)))
    )
    short_of = np.zeros(len(indices), dtype=np.intp)
    whole = drawn_builds = 0
    generator = np.random.default_rng(seed)
    numbers = np.empty((drawn_rows, 0))
    while drawn_builds < total:
        measures.pause()
        builds = min(BATCH, total - drawn_builds)
        if numbers.shape[1] != builds:
            numbers = np.empty((drawn_rows, builds))
        generator.random(out=numbers)
        is_short = np.zeros((len(indices), builds), dtype=bool)
        for margins, first in shortfalls:
            interface, build = short_builds(
                margins, first, design.registration.cutting_error, numbers
            )
            of_group = [gap.index for gap in margins.margins.interfaces]
            is_short[np.searchsorted(indices, of_group)[interface], build] = True
        short_of += np.count_nonzero(is_short, axis=1)
        whole += int(np.count_nonzero(is_short.any(axis=0)))
        drawn_builds += builds
        if design.rules.yield_builds is None and drawn_builds == first_builds:
            total = _precise_number(Share(total - whole, total))
    shares = (Share(total - short, total) for short in short_of.tolist())
    return Yield(Share(total - whole, total), dict(zip(indices, shares, strict=True)))


def _drawn(measures: Measures) -> tuple[list[tuple[ShortMargins, Indices]], int]:
    """Return all margins that can fall short, the first rows of their errors (one column per
    interface) and the number of rows.

    Errors are drawn in the order of the first margin that they narrow, interface by interface.
    """
    rows: dict[Error, int] = {}
    count = 0
    drawn: list[tuple[ShortMargins, Indices]] = []
    for equal in measures.equal:
        candidates = (
            short_margins(m, measures.design) for m in measures.margins if m.interfaces is equal
        )
        every = sorted(
            filter(None, candidates),
            key=lambda s: (s.margins.quantity, s.margins.places.numbers[0]),
        )
        errors = list(dict.fromkeys(error for short in every for error in short.errors))
        felt = [_renamed(errors, equal[0], gap, measures.moves) for gap in equal]
        for error in (error for errors_felt in felt for error in errors_felt):
            if rows.setdefault(error, count) == count:
                count += 2 if isinstance(error, Freedom) and error.centre is None else 1
        first = np.array(
            [[rows[error] for error in errors_felt] for errors_felt in felt], dtype=np.intp
        ).T
        place = {error: number for number, error in enumerate(errors)}
        drawn += [(short, first[[place[error] for error in short.errors]]) for short in every]
    return drawn, count


def _precise_number(share: Share) -> int:
    """Return enough builds for a narrow interval: the given number, or batches up to 40,000."""
    low, high = share.interval
    # A half scatters most: of all shares in the interval the one nearest to it.
    worst = min(max(0.5, low), high)
    needed = worst * (1 - worst) * (Z95 / HALF_INTERVAL) ** 2
    return share.builds if needed <= share.builds else math.ceil(needed / BATCH) * BATCH


def _renamed(
    errors: list[Error], first: Interface, target: Interface, moves: Freedoms
) -> list[Error]:
    """Return the errors of ``target`` that correspond to those of an equal interface."""
    if target is first:
        return errors
    from_layers, to_layers = seated(first), seated(target)
    layers = dict(zip(from_layers, to_layers, strict=True))
    twins: dict[int, Freedom] = {}
    pairs = zip(unshared(moves, from_layers), unshared(moves, to_layers), strict=True)
    for ours, theirs in pairs:
        twins.update(zip(map(id, ours), theirs, strict=True))
    return [
        twins[id(error)] if isinstance(error, Freedom) else (layers[error[0]], error[1])
        for error in errors
    ]
