"""registration-yield: the share of random builds in which every interface keeps its limits.

Monte Carlo with a fixed seed. The paper gives only the largest errors, so the distributions are
assumed: every cutting error and turn uniform within its most, every shift uniform over a disc.

Each error has a row of random numbers a batch (a shift has two) from a stream that begins equally
for every laminate. Bounds decide most builds; the rest are summed up row by row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from sbafab.geometry.on_demand import np
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.freedoms import EARS, Freedom, Freedoms
from sbafab.rules.limits import TOLERANCE, Limits, Tolerances
from sbafab.rules.margins import QUANTITIES, LinearForms, Owner, Quantity, seated
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

# Random numbers: a row a build for each error, two for a shift.


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


def random_numbers(seed: int, first: int, rows: int, builds: int) -> Floats:
    """Return numbers from 0 to 1, a row of ``builds`` each, from the ``first`` of a seed's stream.

    The stream is the same for every laminate.
    """
    generator = np.random.PCG64(seed)
    generator.advance(first)
    return np.random.Generator(generator).random((rows, builds))


# Rows: the width left at margins beyond their limit, as its room and a sum over the errors drawn.


UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


class RowKind(NamedTuple):
    """The rows between the edges of two contours, of the interfaces of a group.

    They depend on the ``errors``: two contours, which count by their ``signs``, then moves.
    """

    group: int
    quantity: Quantity
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


def rows_of(forms: LinearForms, layers: Sequence[Sequence[int]], limits: Limits) -> MarginRows:
    """Return the margins that can come short at all, by the two contours whose edges they join.

    Of those that depend on all errors equally, the least. Kinds are in the order of the first of
    them. ``layers`` are those of each group, by seat.
    """
    room = forms.nominal - forms.by_quantity(
        {"bond": limits.worst_bond_width, "overhang": limits.worst_mask_overhang}
    )
    cut = forms.cut_edges * limits.tolerances.cutting
    (short,) = np.nonzero(room - cut - forms.loss < -TOLERANCE)
    between = forms.between.take(short)
    # Owners in the order of their first short margin.
    owners = list(dict.fromkeys(between.tolist()))
    rank = np.zeros(len(forms.owners), dtype=np.intp)
    rank[owners] = np.arange(len(owners))
    chosen = _least_alike(forms, room, short)
    ranks = rank.take(forms.between.take(chosen))
    chosen = chosen.take(ranks.argsort(kind="stable"))
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


def _sign(quantity: Quantity, owner: Owner) -> float:
    """More film widens a bond, more mask an overhang."""
    if not owner.is_cut:
        return 0.0
    return 1.0 if owner.is_film == (quantity == "bond") else -1.0


def _least_alike(forms: LinearForms, room: Floats, short: Indices) -> Indices:
    """Of the short margins between each two owners those with the least room of all with the same
    factors, rounded.
    """
    between = forms.between.take(short)
    # Where nothing but cutting is felt all factors are 0, and all are alike.
    shifts = (forms.moves.shift.max(axis=0, initial=0.0) > 0).take(between)
    factors = forms.normal.take(short, axis=1) * shifts, forms.levers.take(short, axis=1)
    parts = _parts(np.concatenate(factors)).astype(np.int64)
    keys = np.concatenate([between[None], parts]).T.copy()
    names = keys.view(f"V{keys.itemsize * keys.shape[1]}").ravel()
    # Of each name the last stays: that with the least room, of equal ones the first.
    order = room.take(short).argsort(kind="stable")[::-1]
    least = dict(zip(names.take(order).tolist(), order.tolist(), strict=True))
    return short.take(sorted(least.values()))


def _parts(factors: Floats) -> Floats:
    """Factors as whole parts, rounded as the decimal number is."""
    scaled = factors * UNITS
    parts = np.rint(scaled)
    doubtful = np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6
    if doubtful.any():
        parts[doubtful] = [round(round(factor, 3) * UNITS) for factor in factors[doubtful].tolist()]
    return parts


# Builds that cuts and shifts bring near a limit, whatever the widths.


class ErrorsQuery(NamedTuple):
    """The errors of each query, a column each.

    ``first`` are the numbers of their first rows: two cuts, then moves. ``signs`` are those of the
    cuts, ``shift`` (mm) the range of each move that shifts, 0 where it turns, and ``sign`` its
    sign. ``turning`` are the lines of moves that turn anything.
    """

    first: Indices
    signs: Floats
    shift: Floats
    sign: Floats
    turning: Indices
    cutting: float


class LikelyBuilds(NamedTuple):
    """Builds by the number of the query, in rising order.

    ``cuts`` (mm) is the rest after both cuts, ``moves`` are x and y of all shifts together, with
    their signs, and the turn of each line that turns anything, -1 to 1 of its most. ``remaining``
    is the rest after the cuts less the length of the shifts, the most that any normal loses.
    """

    query: Indices
    build: Indices
    cuts: Floats
    moves: Floats
    remaining: Floats


def likely_builds(numbers: Floats, errors: ErrorsQuery, level: Floats) -> LikelyBuilds:
    """Return the builds in which cuts and shifts leave less than the ``level`` of a query, mm.

    One error after the other is counted, as most decide soon.
    """
    drawn, count = numbers.ravel(), numbers.shape[1]
    shift = errors.shift
    query, builds, after_cuts = _cut(numbers, errors, level + shift.sum(axis=0))
    order = np.argsort(-shift, axis=0, kind="stable")[: (shift > 0).sum(axis=0).max(initial=0)]
    reach = np.take_along_axis(shift, order, 0)
    places = np.take_along_axis(errors.first[2:], order, 0) * count
    after = np.cumsum(reach[::-1], axis=0)[::-1] - reach
    remaining = after_cuts
    for place, most_shift, rest in zip(places, reach, after, strict=True):
        number = drawn.take(place.take(query) + builds)
        remaining = remaining - most_shift.take(query) * np.sqrt(number)
        some = picked(remaining < (level + rest).take(query))
        query, builds = query.take(some), builds.take(some)
        after_cuts, remaining = after_cuts.take(some), remaining.take(some)
    shifts = np.zeros((2, len(query)))
    for line, most in enumerate(shift):
        acting = picked(most.take(query) > 0)
        some = query.take(acting)
        place = errors.first[2 + line].take(some) * count + builds[acting]
        reached = (errors.sign[line] * most).take(some) * np.sqrt(drawn.take(place))
        angle = math.tau * drawn.take(place + count)
        shifts[0, acting] += reached * np.cos(angle)
        shifts[1, acting] += reached * np.sin(angle)
    remaining = after_cuts - np.hypot(*shifts)
    some = picked(remaining < level.take(query))
    query, builds = query.take(some), builds.take(some)
    moves = np.empty((2 + len(errors.turning), len(some)))
    moves[:2] = shifts[:, some]
    for row, line in enumerate(errors.turning.tolist(), 2):
        moves[row] = 2 * drawn.take(errors.first[2 + line].take(query) * count + builds) - 1
    return LikelyBuilds(query, builds, after_cuts.take(some), moves, remaining.take(some))


def _cut(numbers: Floats, errors: ErrorsQuery, level: Floats) -> tuple[Indices, Indices, Floats]:
    """Builds in which cutting errors together come below a level, with their sum, mm."""
    cutting, (one_sign, other_sign) = errors.cutting, errors.signs
    share = np.where(level > 0, math.inf, -math.inf)
    if cutting > 0:
        share = level / (2 * cutting) + (one_sign + other_sign) / 2
    least = np.minimum(one_sign, 0) + np.minimum(other_sign, 0)
    counts: list[int] = []
    chosen: list[Indices] = [np.zeros(0, dtype=np.intp)]
    totals = [np.zeros(0)]
    asking = picked(share > least)
    for number in asking.tolist():
        numbers_a, numbers_b = numbers[errors.first[0, number]], numbers[errors.first[1, number]]
        total = one_sign[number] * numbers_a + other_sign[number] * numbers_b
        builds = picked(total < share[number])
        counts.append(len(builds))
        chosen.append(builds)
        totals.append(total.take(builds))
    query = np.repeat(asking, counts)
    signs = (one_sign + other_sign).take(query)
    return query, np.concatenate(chosen), cutting * (2 * np.concatenate(totals) - signs)


def picked(some: Bools) -> Indices:
    """The numbers of those that are true."""
    (numbers,) = some.nonzero()
    return numbers


# Random builds in which every margin of an interface keeps its limit.
#
# Most builds are decided without the sum of a row: by the cuts alone where the films hardly move,
# and by the length of all shifts together, the most that any normal loses. The rest is summed up
# row by row, and the sum decides. All interfaces are queried at once, in arrays.


SURE = 1e-9 - TOLERANCE
"""mm: what is bounded to be left so far above what holds is so, however the sum is rounded."""
ROOM = 1e-12
"""mm: far more than the rounding of a sum of two errors."""
NEAR = 1e-9
"""mm: more than the rounding of a sum of all errors."""
AT_ONCE = 200_000
"""Sums of rows in builds that are worked out at once, which bounds the memory."""


class RowsQuery(NamedTuple):
    """Rows of an interface: the number of their kind, and the first number of each of its errors.

    Errors are in the order of ``RowKind.errors``; queries in the order of kinds.
    """

    kind: int
    first: Sequence[int]


class _Drawn(NamedTuple):
    """Builds of what is asked: by number of what asks, of its kind and of the build.

    ``cuts`` (mm) is what both cuts leave; ``moves`` are x and y of all shifts together, as they
    count, a line for each turn (radians), and 1 for the room.
    """

    query: Indices
    kind: Indices
    build: Indices
    cuts: Floats
    moves: Floats


class RandomBuilds:
    """Tells in which builds the rows of interfaces come short, of all interfaces at once.

    Rows that are asked for of several interfaces stand beside each other.
    """

    def __init__(self, rows: MarginRows, queries: Sequence[RowsQuery], cutting: float) -> None:
        self.rows = rows
        begins, lines = rows.begins[:-1], len(rows.turn)
        least = np.minimum.reduceat(rows.room, begins)
        turn = rows.turn.repeat(np.diff(rows.begins), axis=1)
        # However all turns, no row leaves less, before what cuts and shifts take.
        turned = rows.room - (turn * np.abs(rows.levers)).sum(axis=0)
        need = SURE - np.minimum.reduceat(turned, begins) + ROOM
        turning = picked(rows.turn.max(axis=1, initial=0.0) > 0)
        levers, self.turn = rows.levers[turning], rows.turn[turning]
        low = np.minimum.reduceat(levers, begins, axis=1) * self.turn
        high = np.maximum.reduceat(levers, begins, axis=1) * self.turn
        self.kind = kind = np.array([query.kind for query in queries], dtype=np.intp)
        first = [(*query.first, *[0] * (2 + lines - len(query.first))) for query in queries]
        signs = np.array([row_kind.signs for row_kind in rows.kinds]).reshape(-1, 2)
        self.errors = ErrorsQuery(
            np.array(first, dtype=np.intp).reshape(-1, 2 + lines).T.copy(),
            signs.T[:, kind],
            rows.shift[:, kind],
            rows.sign[:, kind],
            turning,
            cutting,
        )
        self.need = need[kind]
        """What asks may come short where cuts and shifts leave less than this, mm."""
        self.least = least[kind]
        self.low, self.high = low[:, kind], high[:, kind]
        """What the full turn of each line adds to the rows of what asks, at least and at most."""
        self.factors = np.vstack([rows.normal, levers, rows.room]).T.copy()
        """Of each row, a column for each line of ``_Drawn.moves``."""

    def short(self, numbers: Floats) -> tuple[Indices, Indices]:
        """Return the numbers of queries that come short, and the builds in which they do.

        ``numbers`` are from 0 to 1, rows of errors by builds.
        """
        drawn = self._drawn(numbers)
        if not len(drawn.query):
            return drawn.query, drawn.build
        least = self._least(drawn)
        # What is so near to the limit that it hangs on rounding is summed up in one order.
        is_short = least < -TOLERANCE
        for near in picked(abs(least + TOLERANCE) < NEAR).tolist():
            place = int(drawn.query[near]), int(drawn.build[near])
            is_short[near] = self._is_short(numbers, *place)
        return drawn.query[is_short], drawn.build[is_short]

    def _drawn(self, numbers: Floats) -> _Drawn:
        """Builds that the bounds do not decide, sorted by kind."""
        likely = likely_builds(numbers, self.errors, self.need)
        query, turns = likely.query, likely.moves[2:]
        low, high = self.low.take(query, axis=1), self.high.take(query, axis=1)
        remaining = likely.remaining + self.least.take(query)
        remaining += np.minimum(low * turns, high * turns).sum(axis=0)
        chosen = picked(remaining < SURE)
        query = query.take(chosen)
        kind = self.kind.take(query)
        moves = np.vstack([likely.moves.take(chosen, axis=1), np.ones(len(chosen))])
        moves[2:-1] *= self.turn.take(kind, axis=1)
        return _Drawn(query, kind, likely.build.take(chosen), likely.cuts.take(chosen), moves)

    def _least(self, drawn: _Drawn) -> Floats:
        """The rest at the worst row of each build, but for rounding."""
        least = np.zeros(len(drawn.kind))
        kinds = range(len(self.rows.begins))
        begins = np.searchsorted(drawn.kind, kinds).tolist()
        rows = self.rows.begins.tolist()
        for number, (start, stop) in enumerate(pairwise(begins)):
            if start == stop:
                continue
            span = slice(rows[number], rows[number + 1])
            step = max(1, AT_ONCE // (span.stop - span.start))
            for first in range(start, stop, step):
                builds = slice(first, min(stop, first + step))
                remaining = self.factors[span] @ drawn.moves[:, builds]
                np.minimum.reduce(remaining, axis=0, out=least[builds])
        result: Floats = least + drawn.cuts
        return result

    def _is_short(self, numbers: Floats, query: int, build: int) -> bool:
        """Return True if a row comes short when summed in one order, the same everywhere.

        A matrix product would round differently on another machine.
        """
        rows, kind, errors = self.rows, int(self.kind[query]), self.errors
        span = slice(*rows.begins[kind : kind + 2])
        remaining, cutting = rows.room[span], errors.cutting
        first = errors.first[:, query].tolist()
        for row, sign in zip(first, errors.signs[:, query].tolist(), strict=False):
            remaining = remaining + sign * (
                -cutting + (cutting + cutting) * float(numbers[row, build])
            )
        for line, row in enumerate(first[2:]):
            shift, turn, sign = (
                float(table[line, kind]) for table in (rows.shift, rows.turn, rows.sign)
            )
            number = float(numbers[row, build])
            if shift > 0:
                radius = shift * math.sqrt(number)
                angle = math.tau * float(numbers[row + 1, build])
                x, y = sign * rows.normal[:, span]
                remaining = remaining + x * (radius * math.cos(angle))
                remaining = remaining + y * (radius * math.sin(angle))
            elif turn > 0:
                remaining = remaining + rows.levers[line, span] * (-turn + (turn + turn) * number)
        return bool((remaining < -TOLERANCE).any())


# The rule.


NAME = "registration-yield"

SEED = 20_240
PAPER_SUCCESS = 0.9
"""The paper's success rate (Sec. 2), of everything that can go wrong: a yield that is surely below
it by errors of place alone draws a warning. The hand is calibrated on this very rate, so that what
the interval leaves open is no news."""
Z95 = 1.959963984540054
BATCH = 5_000
"""Builds drawn at a time, which bounds the memory."""
HALF_INTERVAL = 0.005
"""Half the interval's width at most, where the design gives no number of builds: then the share of
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
    quantities: dict[Quantity, Share]


def check(measures: Measures) -> list[Finding]:
    """Return the share of good builds, against ``target_yield`` if the design sets one."""
    laminate, limits = measures.laminate, measures.limits
    return [finding_of(simulate(laminate, limits, SEED, measures), laminate, limits)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "enough random builds keep what registration-worst-case asks",
        "The worst of all errors at once is rare; this counts how rare. The hand is calibrated on "
        "the paper's success of nine in ten, not measured.",
        "Run sbafab check DESIGN --target-yield 0.95: it advises bond and overhang; generate with "
        "the same option changes the design as little as the share needs.",
        ("rules.target_yield", "registration.hand_placement", "registration.hand_turn"),
    ),
)


def finding_of(outcome: Yield, laminate: Laminate, limits: Limits) -> Finding:
    """Return the finding of a yield."""
    low, high = outcome.whole.interval
    target = limits.target_yield
    verdict: Verdict = "pass"
    if target is not None:
        verdict = "pass" if low >= target else "fail"
    elif high < PAPER_SUCCESS:
        verdict = "warn"
    message = (
        f"{outcome.whole.value:.2%} of {outcome.whole.builds} random builds keep every limit "
        f"(95 % interval {low:.2%} to {high:.2%}){_by_interface(outcome)}; errors are assumed "
        f"spread evenly, up to {_by_hand(limits.tolerances)}"
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
    worst = min(outcome.interfaces, key=lambda index: outcome.interfaces[index].good, default=None)
    place = Place()
    if worst is not None and outcome.interfaces[worst].good < outcome.whole.builds:
        place = Place(worst, laminate.interfaces[worst - 1].layer_indices)
    share = outcome.whole
    return Finding(
        NAME,
        verdict,
        target,
        share.value,
        "",
        place,
        message,
        remedy=remedy,
        interval=share.interval,
    )


def _remedy(laminate: Laminate) -> str:
    """Remedy for a low yield."""
    wider = "ask `sbafab check --target-yield 0.95` how much wider bonds and overhangs should be"
    if laminate.registration == "channel-pin":
        return f"{wider}, or {EARS}"
    return wider


def _by_hand(errors: Tolerances) -> str:
    """The design's assumed placement errors in words."""
    return (
        f"{errors.placement:g} mm and {errors.turn:g} degree where a hand places"
        f"{_calibrated(errors)}"
    )


def _calibrated(tolerances: Tolerances) -> str:
    """Source of the hand's figures, if they are the usual ones."""
    usual = Tolerances()
    if (tolerances.placement, tolerances.turn) != (usual.placement, usual.turn):
        return ""
    return f" (calibrated on the paper's success rate of {PAPER_SUCCESS:.0%}, not measured)"


def simulate(
    laminate: Laminate, limits: Limits, seed: int = SEED, measures: Measures | None = None
) -> Yield:
    """Return the yield of random builds of a laminate; the same seed gives the same shares."""
    measures = measures or Measures(laminate, limits)
    layers = [seated(group.first) for group in measures.margins]
    rows = rows_of(measures.forms, layers, limits)
    indices = sorted(
        interface.index for group in measures.margins for interface in group.interfaces
    )
    return _counted(rows, _row_queries(rows.kinds, measures), indices, limits, seed, measures.pause)


class _RowQueries(NamedTuple):
    """Rows of a kind for each interface, by index, and the number of rows drawn."""

    of: list[tuple[int, RowsQuery]]
    drawn: int


def _row_queries(kinds: Sequence[RowKind], measures: Measures) -> _RowQueries:
    """The rows of every interface, each with its own errors."""
    # In the order in which they are drawn.
    errors: list[dict[Error, int]] = [{} for _ in measures.margins]
    places = []
    for kind in kinds:
        numbers = errors[kind.group]
        places.append([numbers.setdefault(error, len(numbers)) for error in kind.errors])
    felt = [
        [
            (interface.index, _renamed(list(numbers), group.first, interface, measures.moves))
            for interface in group.interfaces
        ]
        for group, numbers in zip(measures.margins, errors, strict=True)
    ]
    rows, drawn = rows_by_error(
        error for entries in felt for _, numbers in entries for error in numbers
    )
    first = [
        [(index, [rows[error] for error in numbers]) for index, numbers in entries]
        for entries in felt
    ]
    queries = [
        (index, RowsQuery(number, [numbers[place] for place in places[number]]))
        for number, kind in enumerate(kinds)
        for index, numbers in first[kind.group]
    ]
    return _RowQueries(queries, drawn)


def _counted(
    rows: MarginRows,
    queries: _RowQueries,
    indices: Iterable[int],
    limits: Limits,
    seed: int,
    pause: Callable[[], None],
) -> Yield:
    """Draw the builds, in batches, and count those in which all rows keep room."""
    interfaces = dict.fromkeys(indices, 0)
    total = limits.yield_builds or _quick_number(len(interfaces))
    first_builds = total
    whole = drawn_builds = 0
    quantities = dict.fromkeys(QUANTITIES, 0)
    of_builds = RandomBuilds(rows, [query for _, query in queries.of], limits.tolerances.cutting)
    place_of = {index: place for place, index in enumerate(interfaces)}
    own_place = np.array([place_of[index] for index, _ in queries.of], dtype=np.intp)
    is_of = {
        quantity: np.array([kind.quantity == quantity for kind in rows.kinds], dtype=bool)
        for quantity in QUANTITIES
    }
    while drawn_builds < total:
        pause()
        builds = min(BATCH, total - drawn_builds)
        first = drawn_builds * queries.drawn
        number, bad = of_builds.short(random_numbers(seed, first, queries.drawn, builds))
        whole += _different(bad, builds)
        for quantity in QUANTITIES:
            quantities[quantity] += _different(bad[is_of[quantity][of_builds.kind[number]]], builds)
        is_short = np.zeros((len(interfaces), builds), dtype=bool)
        is_short[own_place[number], bad] = True
        for index, short in zip(interfaces, is_short, strict=True):
            interfaces[index] += int(np.count_nonzero(short))
        drawn_builds += builds
        if limits.yield_builds is None and drawn_builds == first_builds:
            total = _precise_number(Share(total - whole, total))
    return Yield(
        Share(total - whole, total),
        {index: Share(total - bad, total) for index, bad in interfaces.items()},
        {quantity: Share(total - bad, total) for quantity, bad in quantities.items()},
    )


def _different(named: Indices, builds: int) -> int:
    """Number of distinct builds among those named."""
    is_named = np.zeros(builds, dtype=bool)
    is_named[named] = True
    return int(np.count_nonzero(is_named))


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
    """Errors of ``target`` that correspond to those of an equal interface."""
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


def _by_interface(outcome: Yield) -> str:
    """Runs of interfaces that are not always good, with the least share of each run."""
    losing = {i: share for i, share in outcome.interfaces.items() if share.good < share.builds}
    if not losing:
        return ""
    order = sorted(losing, key=lambda i: (losing[i].good, i))
    parts = [f"{i} {losing[i].value:.2%}" for i in order[:3]]
    rest = f", {len(order) - 3} others above" if len(order) > 3 else ""
    return f"; by interface: {', '.join(parts)}{rest}"
