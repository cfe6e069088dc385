"""Random numbers for builds: a stream that begins alike for every laminate, read where needed.

Each error has a row of numbers a batch (a shift has two); what they mean is worked out only for the
builds that nothing simpler decides. The beginning of the stream is kept, for the next laminate asks
for it again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.freedoms import Freedom, Freedoms
from sbafab.rules.limits import TOLERANCE, Limits, Tolerances
from sbafab.rules.margins import QUANTITIES, LinearForms, Owner, Quantity, seated
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

if TYPE_CHECKING:
    from sbafab.geometry.edge_table import Bools, Floats, Indices

KEPT = 4_000_000
"""Numbers at the stream's beginning that are kept: 32 MB at most, of which a page is taken up when
it is first written.
"""


class CutContour(NamedTuple):
    """A cut contour: by how far its film reaches beyond the nominal edge."""

    layer: int
    contour: int


Error = CutContour | Freedom


def is_shift(error: Error) -> bool:
    """Whether an error has an x and a y, and two rows of numbers."""
    return isinstance(error, Freedom) and error.centre is None


def rows_by_error(errors: Iterable[Error]) -> tuple[dict[Error, int], int]:
    """The first row of each error, in the order in which they are drawn, and how many rows."""
    rows: dict[Error, int] = {}
    count = 0
    for error in errors:
        if rows.setdefault(error, count) == count:
            count += 2 if is_shift(error) else 1
    return rows, count


class _Stream:
    """The beginning of the numbers of one seed."""

    def __init__(self, seed: int) -> None:
        import numpy as np

        self.generator = np.random.default_rng(seed)
        self.numbers = np.empty(KEPT)
        self.known = 0

    def until(self, last: int) -> Floats:
        if last > self.known:
            self.generator.random(out=self.numbers[self.known : last])
            self.known = last
        return self.numbers


_stream = lru_cache(maxsize=1)(_Stream)


class DrawnBuilds(NamedTuple):
    """Builds drawn at a time: which numbers of the seed's stream, a row of ``builds`` an error."""

    seed: int
    first: int
    rows: int
    builds: int

    @property
    def numbers(self) -> Floats:
        """Numbers from 0 to 1, a row each, from the ``first`` of the seed's stream on."""
        return numbers(*self)


def numbers(seed: int, first: int, rows: int, builds: int) -> Floats:
    """Numbers from 0 to 1, a row of ``builds`` each, from the ``first`` of the seed's stream on."""
    import numpy as np

    last = first + rows * builds
    if last <= KEPT:
        return _stream(seed).until(last)[first:last].reshape(rows, builds)
    ahead = np.random.PCG64(seed)
    ahead.advance(first)
    return np.random.Generator(ahead).random((rows, builds))


# What is left at the margins of all interfaces beyond their limits: a row each, with its factors.
#
# A row is its room and a sum over the errors drawn (``random_builds.py``).


UNITS = 1000
"""Factors that are equal to so many parts are one: rows that feel all errors alike."""


class RowKind(NamedTuple):
    """The rows between the edges of two contours, of the interfaces of a group.

    They feel the ``errors``: two contours, which count by their ``signs``, then moves.
    """

    group: int
    quantity: Quantity
    errors: Sequence[Error]
    signs: tuple[float, float]


class MarginRows(NamedTuple):
    """What is left at margins beyond their limit: ``room`` and a sum of errors.

    All rows of all kinds, kind after kind: ``begins`` says where. Shifts count by the normal and
    their sign, turns by the ``levers``, a line for each move, 0 of what shifts. ``shift`` (mm),
    ``turn`` (radians) and ``sign`` are how far it goes and how it counts, by kind.
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
    """The margins that can come short at all, by the two contours whose edges they join; of those
    that feel all errors alike, the least.

    Kinds are in the order of the first of them. ``layers`` are those of each group, by seat.
    """
    import numpy as np

    room = forms.nominal - forms.by_quantity(
        {"bond": limits.worst_bond_width, "overhang": limits.worst_mask_overhang}
    )
    (short,) = np.nonzero(room - 2 * limits.tolerances.cutting - forms.loss < -TOLERANCE)
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
        one, other = forms.owners[both]
        cuts = [CutContour(layers[group][own.seat], own.contour) for own in (one, other)]
        signs = _sign(quantity, one), _sign(quantity, other)
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
    return 1.0 if owner.is_film == (quantity == "bond") else -1.0


def _least_alike(forms: LinearForms, room: Floats, short: Indices) -> Indices:
    """Of the short margins between each two owners those with the least room of all with the same
    factors, rounded.
    """
    import numpy as np

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
    import numpy as np

    scaled = factors * UNITS
    parts = np.rint(scaled)
    doubtful = np.abs(scaled - np.floor(scaled) - 0.5) < 1e-6
    if doubtful.any():
        parts[doubtful] = [round(round(one, 3) * UNITS) for one in factors[doubtful].tolist()]
    return parts


# Builds in which something may come short, by what hangs on no size: cuts and shifts.
#
# The same errors are drawn for every laminate with the same layers and contours, and so are the
# builds that they bring near a limit: what was found for one laminate is kept, with some room, for
# the next.


SLACK = 0.01
"""mm: how much more than it asks for is kept from the second laminate on, for those after it."""
MOST_KEPT = 40_000
"""Builds of all that ask which are kept, a few MB; where there are more, none are."""


class ErrorsAsked(NamedTuple):
    """The errors of what asks, a column each.

    ``first`` are the numbers of their first rows: two cuts, then moves. ``signs`` is how the cuts
    count, ``shift`` (mm) how far each move shifts, 0 where it turns, and ``sign`` how it counts.
    ``turning`` are the lines of moves that turn anything.
    """

    first: Indices
    signs: Floats
    shift: Floats
    sign: Floats
    turning: Indices
    cutting: float

    @property
    def name(self) -> bytes:
        """Equal for equal errors."""
        return b"".join([np.float64(self.cutting).tobytes(), *(one.tobytes() for one in self[:5])])


class LikelyBuilds(NamedTuple):
    """Builds by the number of what asks, in rising order.

    ``cuts`` (mm) is what both cuts leave, ``moves`` are x and y of all shifts together, as they
    count, and how far each line turns that turns anything, -1 to 1 of its most. ``left`` is what
    the cuts leave less the length of the shifts, which no normal loses more than. What asks has no
    other builds below its ``level``.
    """

    asked: Indices
    build: Indices
    cuts: Floats
    moves: Floats
    left: Floats
    level: Floats

    def covers(self, need: Floats) -> bool:
        """Whether no build below these is missing."""
        return bool((need <= self.level).all())


class _Kept:
    """What was found last, if anything."""

    found: LikelyBuilds | None = None


@lru_cache(maxsize=4)
def _kept(batch: DrawnBuilds, name: bytes) -> _Kept:
    del batch, name
    return _Kept()


def likely_builds(batch: DrawnBuilds, errors: ErrorsAsked, need: Floats) -> LikelyBuilds:
    """All builds in which cuts and shifts leave less than what asks needs, and perhaps others."""
    kept = _kept(batch, errors.name)
    known = kept.found
    if known is not None and known.covers(need):
        return known
    if known is not None:
        wide = _found(batch, errors, np.maximum(need + SLACK, known.level))
        if len(wide.asked) <= MOST_KEPT:
            kept.found = wide
            return wide
    found = _found(batch, errors, need)
    kept.found = found if len(found.asked) <= MOST_KEPT else None
    return found


def _found(batch: DrawnBuilds, errors: ErrorsAsked, level: Floats) -> LikelyBuilds:
    """The builds below a level: one error after the other is counted, as most decide soon."""
    numbers = batch.numbers
    drawn, count = numbers.ravel(), numbers.shape[1]
    shift = errors.shift
    asked, builds, held = _cut(numbers, errors, level + shift.sum(axis=0))
    order = np.argsort(-shift, axis=0, kind="stable")[: (shift > 0).sum(axis=0).max(initial=0)]
    reach = np.take_along_axis(shift, order, 0)
    places = np.take_along_axis(errors.first[2:], order, 0) * count
    after = np.cumsum(reach[::-1], axis=0)[::-1] - reach
    left = held
    for place, own, rest in zip(places, reach, after, strict=True):
        number = drawn.take(place.take(asked) + builds)
        left = left - own.take(asked) * np.sqrt(number)
        some = picked(left < (level + rest).take(asked))
        asked, builds = asked.take(some), builds.take(some)
        held, left = held.take(some), left.take(some)
    shifts = np.zeros((2, len(asked)))
    for line, most in enumerate(shift):
        own = picked(most.take(asked) > 0)
        some = asked.take(own)
        place = errors.first[2 + line].take(some) * count + builds[own]
        reached = (errors.sign[line] * most).take(some) * np.sqrt(drawn.take(place))
        angle = math.tau * drawn.take(place + count)
        shifts[0, own] += reached * np.cos(angle)
        shifts[1, own] += reached * np.sin(angle)
    left = held - np.hypot(*shifts)
    some = picked(left < level.take(asked))
    asked, builds = asked.take(some), builds.take(some)
    moves = np.empty((2 + len(errors.turning), len(some)))
    moves[:2] = shifts[:, some]
    for row, line in enumerate(errors.turning.tolist(), 2):
        moves[row] = 2 * drawn.take(errors.first[2 + line].take(asked) * count + builds) - 1
    return LikelyBuilds(asked, builds, held.take(some), moves, left.take(some), level)


def _cut(numbers: Floats, errors: ErrorsAsked, level: Floats) -> tuple[Indices, Indices, Floats]:
    """Builds in which cutting errors together come below a level, and how far they come, mm."""
    cutting, (one_sign, other_sign) = errors.cutting, errors.signs
    share = np.where(level > 0, math.inf, -math.inf)
    if cutting > 0:
        share = level / (2 * cutting) + (one_sign + other_sign) / 2
    least = np.minimum(one_sign, 0) + np.minimum(other_sign, 0)
    counts: list[int] = []
    found: list[Indices] = [np.zeros(0, dtype=np.intp)]
    totals = [np.zeros(0)]
    asking = picked(share > least)
    for number in asking.tolist():
        one, other = numbers[errors.first[0, number]], numbers[errors.first[1, number]]
        total = one_sign[number] * one + other_sign[number] * other
        builds = picked(total < share[number])
        counts.append(len(builds))
        found.append(builds)
        totals.append(total.take(builds))
    asked = np.repeat(asking, counts)
    signs = (one_sign + other_sign).take(asked)
    return asked, np.concatenate(found), cutting * (2 * np.concatenate(totals) - signs)


def picked(some: Bools) -> Indices:
    """The numbers of those that are true."""
    (numbers,) = some.nonzero()
    return numbers


# Random builds: in which of them every margin of an interface keeps its limit.
#
# What is left at a margin beyond its limit is a row: its room and a sum over the errors drawn.
# Most builds are decided without that sum: by the cuts alone where the films hardly move, and by
# the length of all shifts together, which no normal can lose more than. What rests is summed up,
# row by row, and what is summed decides: bounds only say where it need not be done. All interfaces
# are asked at once, in arrays.


SURE = 1e-9 - TOLERANCE
"""mm: what is bounded to be left so far above what holds is so, however the sum is rounded."""
ROOM = 1e-12
"""mm: far more than the rounding of a sum of two errors."""
NEAR = 1e-9
"""mm: more than the rounding of a sum of all errors."""
AT_ONCE = 200_000
"""Sums of rows in builds that are worked out at once, which bounds the memory."""


class RowsAsked(NamedTuple):
    """Rows of an interface: the number of their kind, and where the numbers of each of its errors
    begin, as ``RowKind.errors`` names them. They are asked for kind by kind.
    """

    kind: int
    first: Sequence[int]


class _Drawn(NamedTuple):
    """Builds of what is asked: by number of what asks, of its kind and of the build.

    ``cuts`` (mm) is what both cuts leave; ``moves`` are x and y of all shifts together, as they
    count, a line for each turn (radians), and 1 for the room.
    """

    asked: Indices
    kind: Indices
    build: Indices
    cuts: Floats
    moves: Floats


class RandomBuilds:
    """Tells in which builds the rows of interfaces come short, of all interfaces at once.

    Rows that are asked for of several interfaces stand beside each other.
    """

    def __init__(self, rows: MarginRows, asked: Sequence[RowsAsked], cutting: float) -> None:
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
        self.kind = kind = np.array([one.kind for one in asked], dtype=np.intp)
        first = [(*one.first, *[0] * (2 + lines - len(one.first))) for one in asked]
        signs = np.array([own.signs for own in rows.kinds]).reshape(-1, 2)
        self.errors = ErrorsAsked(
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

    def short(self, batch: DrawnBuilds) -> tuple[Indices, Indices]:
        """What was asked for, by number, and the builds in which it comes short."""
        drawn = self._drawn(batch)
        if not len(drawn.asked):
            return drawn.asked, drawn.build
        least = self._least(drawn)
        # What is so near to the limit that it hangs on rounding is summed up in one order.
        is_short = least < -TOLERANCE
        for near in picked(abs(least + TOLERANCE) < NEAR).tolist():
            place = int(drawn.asked[near]), int(drawn.build[near])
            is_short[near] = self._is_short(batch.numbers, *place)
        return drawn.asked[is_short], drawn.build[is_short]

    def _drawn(self, batch: DrawnBuilds) -> _Drawn:
        """What was drawn for those of which no row may be left for sure, sorted by kind."""
        likely = likely_builds(batch, self.errors, self.need)
        asked, turns = likely.asked, likely.moves[2:]
        low, high = self.low.take(asked, axis=1), self.high.take(asked, axis=1)
        left = likely.left + self.least.take(asked)
        left += np.minimum(low * turns, high * turns).sum(axis=0)
        own = picked((likely.left < self.need.take(asked)) & (left < SURE))
        asked = asked.take(own)
        kind = self.kind.take(asked)
        moves = np.vstack([likely.moves.take(own, axis=1), np.ones(len(own))])
        moves[2:-1] *= self.turn.take(kind, axis=1)
        return _Drawn(asked, kind, likely.build.take(own), likely.cuts.take(own), moves)

    def _least(self, drawn: _Drawn) -> Floats:
        """What is left at the worst row of each, but for rounding."""
        least = np.zeros(len(drawn.kind))
        kinds = range(len(self.rows.begins))
        begins = np.searchsorted(drawn.kind, kinds).tolist()
        rows = self.rows.begins.tolist()
        for number, (start, stop) in enumerate(pairwise(begins)):
            if start == stop:
                continue
            own = slice(rows[number], rows[number + 1])
            step = max(1, AT_ONCE // (own.stop - own.start))
            for first in range(start, stop, step):
                builds = slice(first, min(stop, first + step))
                left = self.factors[own] @ drawn.moves[:, builds]
                np.minimum.reduce(left, axis=0, out=least[builds])
        found: Floats = least + drawn.cuts
        return found

    def _is_short(self, numbers: Floats, asked: int, build: int) -> bool:
        """Whether a row comes short when all is summed up in one order, the same everywhere.

        A matrix product would round differently on another machine.
        """
        rows, kind, errors = self.rows, int(self.kind[asked]), self.errors
        own = slice(*rows.begins[kind : kind + 2])
        left, cutting = rows.room[own], errors.cutting
        first = errors.first[:, asked].tolist()
        for row, sign in zip(first, errors.signs[:, asked].tolist(), strict=False):
            left = left + sign * (-cutting + (cutting + cutting) * float(numbers[row, build]))
        for line, row in enumerate(first[2:]):
            shift, turn, sign = (
                float(one[line, kind]) for one in (rows.shift, rows.turn, rows.sign)
            )
            number = float(numbers[row, build])
            if shift > 0:
                radius = shift * math.sqrt(number)
                angle = math.tau * float(numbers[row + 1, build])
                x, y = sign * rows.normal[:, own]
                left = left + x * (radius * math.cos(angle))
                left = left + y * (radius * math.sin(angle))
            elif turn > 0:
                left = left + rows.levers[line, own] * (-turn + (turn + turn) * number)
        return bool((left < -TOLERANCE).any())


# registration-yield: the share of random builds in which every interface keeps its limits.
#
# Monte Carlo with a fixed seed. The paper gives only the largest errors, so the distributions are
# assumed: every cutting error and turn uniform within its most, every shift uniform over a disc.


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


def check(measures: Measures) -> list[Finding]:
    """The share of good builds, against ``target_yield`` if one is asked for."""
    laminate, limits = measures.laminate, measures.limits
    return [finding_of(simulate(laminate, limits, SEED, measures), laminate, limits)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "enough random builds keep what registration-worst-case asks",
        "The worst of all errors at once is rare; this counts how rare. The hand is calibrated on "
        "the paper's success of nine in ten, not measured.",
        "Run sbafab check DESIGN --target-yield 0.95: it advises bond and overhang.",
        ("rules.target_yield", "registration.hand_placement", "registration.hand_turn"),
    ),
)


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
