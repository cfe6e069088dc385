"""registration-yield: the share of random builds in which every interface keeps its limits.

Monte Carlo with a fixed seed. The paper gives only the largest errors, so the distributions are
assumed: every cutting error and turn uniform within its most, every shift uniform over a disc.

Each error has a row of random numbers a batch (a shift has two).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from sbafab.design.records import Design
from sbafab.design.sections import Registration
from sbafab.geometry.on_demand import np
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.margins import QUANTITIES, LinearForms, MarginKind, Owner, seated
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Clause, explained, say

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Floats, Indices


class CutContour(NamedTuple):
    """A cut contour: by how far its film reaches beyond the nominal edge."""

    layer: int
    contour: int


Error = CutContour | Freedom


def is_shift(error: Error) -> bool:
    """Return True if an error has an x and a y, and two rows of numbers."""
    return isinstance(error, Freedom) and error.centre is None


def rows_by_error(errors: Iterable[Error]) -> tuple[dict[Error, int], int]:
    """The first row of each error, in the order in which they are drawn, and the row count."""
    rows: dict[Error, int] = {}
    count = 0
    for error in errors:
        if rows.setdefault(error, count) == count:
            count += 2 if is_shift(error) else 1
    return rows, count


# Rows: the width left at margins beyond their limit, as its room and a sum over the errors drawn.


class RowKind(NamedTuple):
    """The rows between the edges of two contours, of the interfaces of a group.

    They depend on the ``errors``: two contours, which count by their ``signs``, then moves.
    """

    group: int
    quantity: MarginKind
    errors: Sequence[Error]
    signs: tuple[float, float]


class MarginRows(NamedTuple):
    """Margins' rests beyond their limit: ``room`` and a sum of errors.

    All rows of all kinds, kind after kind: ``begins`` gives their starts. Shifts count by the
    normal and their sign, turns by the ``levers``, a line for each move, 0 for shifts. ``shift``
    (mm), ``turn`` (radians) and ``sign`` are each move's range and sign, by kind.
    """

    kinds: Sequence[RowKind]
    begins: Indices
    room: Floats
    normal: Floats
    levers: Floats
    shift: Floats
    turn: Floats
    sign: Floats


def rows_of(forms: LinearForms, layers: Sequence[Sequence[int]], design: Design) -> MarginRows:
    """Return the margins that can fall short at all, by the two contours whose edges they join.

    Kinds are in the order of their first margin. ``layers`` are each group's layers, by seat.
    """
    room = forms.nominal - forms.by_quantity(
        {"bond": design.rules.worst_bond_width, "overhang": design.rules.worst_mask_overhang}
    )
    cut = forms.cut_edges * design.registration.cutting_error
    (short,) = np.nonzero(room - cut - forms.loss < -TOLERANCE)
    between = forms.between.take(short)
    # Owners in the order of their first short margin.
    owners = list(dict.fromkeys(between.tolist()))
    rank = np.zeros(len(forms.owners), dtype=np.intp)
    rank[owners] = np.arange(len(owners))
    ranks = rank.take(between)
    chosen = short.take(ranks.argsort(kind="stable"))
    begins = np.cumsum([0, *np.bincount(ranks, minlength=len(owners)).tolist()])
    kinds = []
    for both, run in zip(owners, forms.run[chosen[begins[:-1]]].tolist(), strict=True):
        group, quantity, _ = forms.runs[run]
        owner_a, owner_b = forms.owners[both]
        cuts = [
            CutContour(layers[group][owner.seat], owner.contour) for owner in (owner_a, owner_b)
        ]
        signs = _sign(quantity, owner_a), _sign(quantity, owner_b)
        kinds.append(RowKind(group, quantity, [*cuts, *forms.moves.freedoms[both]], signs))
    return MarginRows(
        kinds,
        begins,
        room[chosen],
        forms.normal.take(chosen, axis=1),
        forms.levers.take(chosen, axis=1),
        forms.moves.shift[:, owners],
        forms.moves.turn[:, owners],
        forms.moves.sign[:, owners],
    )


def _sign(quantity: MarginKind, owner: Owner) -> float:
    """More film widens a bond, more mask an overhang."""
    if not owner.is_cut:
        return 0.0
    return 1.0 if owner.is_film == (quantity == "bond") else -1.0


# Random builds in which a margin of an interface comes short.


ROUNDING = 1e-9
"""mm: more than the rounding of a sum of all errors."""
AT_ONCE = 200_000
"""Sums of rows in builds that are worked out at once, which bounds the memory."""


def short_builds(
    rows: MarginRows, kind: int, first: Indices, cutting: float, numbers: Floats
) -> tuple[Indices, Indices]:
    """Return in which interfaces and builds a row of a kind comes short.

    ``first`` are the numbers of the first row of each error of the kind, a column for each
    interface; ``numbers`` are from 0 to 1, a row for each error and a column for each build.
    """
    span = slice(*rows.begins[kind : kind + 2])
    room, levers = rows.room[span], rows.levers[:, span]
    shift, turn = rows.shift[:, kind].tolist(), rows.turn[:, kind].tolist()
    lines = range(len(first) - 2)
    cuts = sum(
        sign * cutting * (2 * numbers[row] - 1)
        for sign, row in zip(rows.kinds[kind].signs, first, strict=False)
    )
    # Most builds keep their limits however the shifts point and whatever turns.
    farthest = sum(shift[line] * np.sqrt(numbers[first[2 + line]]) for line in lines if shift[line])
    least = room - sum(turn[line] * abs(levers[line]) for line in lines)
    interfaces, builds = np.nonzero(cuts - farthest + least.min() < ROUNDING - TOLERANCE)
    is_short = np.zeros(len(builds), dtype=bool)
    step = max(1, AT_ONCE // len(room))
    for begin in range(0, len(builds), step):
        some = slice(begin, begin + step)
        place, build = interfaces[some], builds[some]
        remaining = room[:, None] + cuts[place, build]
        moved = np.zeros((2, len(build)))
        for line in lines:
            row = first[2 + line, place]
            number = numbers[row, build]
            if shift[line]:
                angle = math.tau * numbers[row + 1, build]
                way = np.array([np.cos(angle), np.sin(angle)])
                moved += rows.sign[line, kind] * shift[line] * np.sqrt(number) * way
            elif turn[line]:
                remaining += levers[line, :, None] * (turn[line] * (2 * number - 1))
        # Not a matrix product, which would round differently on another machine.
        for normal, move in zip(rows.normal[:, span], moved, strict=True):
            remaining += normal[:, None] * move
        is_short[some] = (remaining < -TOLERANCE).any(axis=0)
    return interfaces[is_short], builds[is_short]


# The rule.


NAME = "registration-yield"

SEED = 20_240
PAPER_SUCCESS = 0.9
"""The paper's success rate (Sec. 2), of everything that can go wrong: a yield that is surely below
it by errors of place alone draws a warning. The hand is calibrated on this very rate, so a rate
within the interval tells nothing new."""
Z95 = 1.959963984540054
BATCH = 5_000
"""Builds drawn at a time, which bounds the memory."""
HALF_INTERVAL = 0.005
"""Half the interval's width at most, if the design gives no number of builds: then the share of
other builds lies within one percentage point of it."""


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
    quantities: dict[MarginKind, Share]


def check(measures: Measures) -> list[Finding]:
    """Return the share of good builds, against ``target_yield`` if the design sets one."""
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
    """Return the interfaces that are not always good, with the least shares."""
    if not order:
        return say(f"{NAME}.no-losing")
    first = ", ".join(f"{i} {shares[i].value:.2%}" for i in order[:3])
    others = len(order) - 3
    sentence = "losing-others" if others > 0 else "losing"
    return say(f"{NAME}.{sentence}", first=first, others=others)


def simulate(
    laminate: Laminate, design: Design, seed: int = SEED, measures: Measures | None = None
) -> Yield:
    """Return the yield of random builds of a laminate; the same seed gives the same shares."""
    measures = measures or Measures(laminate, design)
    layers = [seated(group.first) for group in measures.margins]
    rows = rows_of(measures.forms, layers, design)
    indices = sorted(
        {interface.index for group in measures.margins for interface in group.interfaces}
    )
    return _counted(rows, indices, measures, seed)


class _DrawnErrors(NamedTuple):
    """Numbers of the first rows of a kind's errors, a column for each interface (by index)."""

    interfaces: Sequence[int]
    first: Indices


def _drawn_errors(kinds: Sequence[RowKind], measures: Measures) -> tuple[list[_DrawnErrors], int]:
    """Return the rows of every kind, each interface with its own errors, and the row count."""
    # In the order in which they are drawn.
    errors: list[dict[Error, int]] = [{} for _ in measures.margins]
    places = []
    for kind in kinds:
        numbers = errors[kind.group]
        places.append([numbers.setdefault(error, len(numbers)) for error in kind.errors])
    felt = [
        [
            _renamed(list(numbers), group.first, interface, measures.moves)
            for interface in group.interfaces
        ]
        for group, numbers in zip(measures.margins, errors, strict=True)
    ]
    rows, count = rows_by_error(
        error for group in felt for of_interface in group for error in of_interface
    )
    first = [np.array([[rows[error] for error in one] for one in group]).T for group in felt]
    drawn = [
        _DrawnErrors(
            [interface.index for interface in measures.margins[kind.group].interfaces],
            first[kind.group][places[number]],
        )
        for number, kind in enumerate(kinds)
    ]
    return drawn, count


def _counted(
    rows: MarginRows,
    indices: Sequence[int],
    measures: Measures,
    seed: int,
) -> Yield:
    """Draw the builds, in batches, and count the builds in which no row is short."""
    design = measures.design
    errors, drawn_rows = _drawn_errors(rows.kinds, measures)
    places = [np.searchsorted(indices, of_kind.interfaces) for of_kind in errors]
    total = first_builds = design.rules.yield_builds or _quick_number(len(indices))
    short_of = np.zeros(len(indices), dtype=np.intp)
    quantities = dict.fromkeys(QUANTITIES, 0)
    whole = drawn_builds = 0
    generator = np.random.default_rng(seed)
    while drawn_builds < total:
        measures.pause()
        builds = min(BATCH, total - drawn_builds)
        numbers = generator.random((drawn_rows, builds))
        is_short = np.zeros((len(indices), builds), dtype=bool)
        lacks = {quantity: np.zeros(builds, dtype=bool) for quantity in QUANTITIES}
        for number, (kind, of_kind) in enumerate(zip(rows.kinds, errors, strict=True)):
            interface, build = short_builds(
                rows, number, of_kind.first, design.registration.cutting_error, numbers
            )
            is_short[places[number][interface], build] = True
            lacks[kind.quantity][build] = True
        short_of += np.count_nonzero(is_short, axis=1)
        whole += int(np.count_nonzero(is_short.any(axis=0)))
        for quantity, one in lacks.items():
            quantities[quantity] += int(np.count_nonzero(one))
        drawn_builds += builds
        if design.rules.yield_builds is None and drawn_builds == first_builds:
            total = _precise_number(Share(total - whole, total))
    return Yield(
        Share(total - whole, total),
        {
            index: Share(total - short, total)
            for index, short in zip(indices, short_of.tolist(), strict=True)
        },
        {quantity: Share(total - short, total) for quantity, short in quantities.items()},
    )


def _quick_number(interfaces: int) -> int:
    """10,000 builds up to 30 interfaces, first fewer of a taller stack."""
    return max(1000, min(10_000, 300_000 // max(1, interfaces)))


def _precise_number(share: Share) -> int:
    """Builds that make the interval of a share narrow: as many, or whole batches up to 40,000."""
    low, high = share.interval
    # A half scatters most: of all shares in the interval the one nearest to it.
    worst = min(max(0.5, low), high)
    needed = worst * (1 - worst) * (Z95 / HALF_INTERVAL) ** 2
    return share.builds if needed <= share.builds else math.ceil(needed / BATCH) * BATCH


def _renamed(
    errors: list[Error], first: Interface, target: Interface, moves: Freedoms
) -> list[Error]:
    """Errors of ``target`` that correspond to the errors of an equal interface."""
    if target is first:
        return errors
    from_layers, to_layers = seated(first), seated(target)
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
