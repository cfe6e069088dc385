"""The order of joining films: presses, seams and folds, each with its reason.

A press bonds all its films at once; a tool heats every film under its path. Either is possible only
while the work has no faces that would weld by mistake.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, NamedTuple

from sbafab.errors import DesignError
from sbafab.geometry.cache import stored
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.films import BondProcess
from sbafab.laminate.joints import PRESS, FaceBond, Fold, Seam
from sbafab.laminate.laminate import Interface, Laminate, Layer

MOST_TRIED = 300
"""Dead ends after which the search for an order is given up."""
LEAST_WELD = 1e-3
"""Area shared by two films above which it is a weld, not rounding, mm2."""


@dataclass(frozen=True)
class Joining:
    """An act of joining, counted from 1: a press, a seam or a fold.

    ``layers`` are the layers involved, by index, and ``bodies`` groups them, lowest first:
    previously joined bodies, and single layers. ``from_below``: a film above the seam would melt
    under the tool, so the work is turned over and the path mirrored.
    """

    number: int
    process: BondProcess | Literal["fold"]
    layers: tuple[int, ...]
    bodies: tuple[tuple[int, ...], ...]
    reason: str
    seam: Seam | None = None
    fold: Fold | None = None
    from_below: bool = False


class _Task(NamedTuple):
    """A task: the interfaces from ``first`` to ``last``, to be joined in the press or by a seam."""

    first: int
    last: int
    seam: Seam | None = None

    @property
    def process(self) -> BondProcess:
        return PRESS if self.seam is None else self.seam.tool


def is_only_pressed(laminate: Laminate) -> bool:
    """Return True for films that are joined only in the press, and not folded."""
    return not laminate.seams and not laminate.folds


def joinings(laminate: Laminate) -> tuple[Joining, ...]:
    """Return all acts of joining, in order.

    Presses come before seams, and seams in the listed order, unless ``bonds`` requires another
    order or one of them is possible only earlier. Raises DesignError with the conflict if there is
    no order.
    """
    return stored(laminate, "_joinings", _joinings)


def _joinings(laminate: Laminate) -> tuple[Joining, ...]:
    _refuse_strangers(laminate)
    search = _Search(laminate)
    waiting = search.tasks()
    ordered = search.order(waiting, [], set())
    if ordered is None:
        raise DesignError(search.first_conflict(waiting))
    steps: list[Joining] = []
    for place, task in enumerate(ordered):
        done, earlier = ordered[:place], waiting[: waiting.index(task)]
        before = [search.conflict(other, waiting, done) for other in earlier]
        steps += search.steps(task, done, before, len(steps))
        waiting.remove(task)
    return tuple(steps)


def _refuse_strangers(laminate: Laminate) -> None:
    """Raise DesignError for neighbours with facing surfaces that nothing joins."""
    folded = {(fold.lower, fold.upper) for fold in laminate.folds}
    for gap in laminate.interfaces if laminate.bonds else ():
        pair = gap.below.index, gap.above.index
        if gap.pressed or gap.seams or pair in folded:
            continue
        below, above = gap.below.faces[0], gap.above.faces[1]
        raise DesignError(
            f"layers {pair[0]} and {pair[1]} face each other with {below} and {above}, which no "
            "entry of [face_bonds] joins in the press, and no seam lies between them; turn one "
            "of them over, add a seam, or add these faces to [face_bonds]"
        )
    for seam in laminate.seams if laminate.bonds else ():
        lower, upper = laminate.layer(seam.below), laminate.layer(seam.above)
        if laminate.bond_of(lower, upper, seam.tool) is None:
            raise DesignError(
                f"seam {seam.name}: layers {seam.below} and {seam.above} face each other with "
                f"{lower.faces[0]} and {upper.faces[1]}, which no entry of [face_bonds] joins by "
                f"{seam.tool}; turn one of them over, or add these faces to [face_bonds]"
            )


class _Conflict(NamedTuple):
    """Why films cannot be joined yet: the fault of a task, its place, and a remedy."""

    subject: str
    harm: str
    remedy: str
    where: str = ""

    @property
    def words(self) -> str:
        """The fault and its location."""
        return f"{self.subject} {self.harm}{self.where}"


class _Search:
    """The search for an order of tasks in which no task welds or melts films by mistake."""

    def __init__(self, laminate: Laminate) -> None:
        self.laminate, self.gaps = laminate, laminate.interfaces

    def tasks(self) -> list[_Task]:
        """Interfaces that bond in the press together, bottom to top, then seams as listed."""
        tasks = []
        for is_pressed, run in groupby(self.gaps, key=lambda gap: gap.pressed):
            indices = [gap.index for gap in run]
            if is_pressed:
                tasks.append(_Task(indices[0], indices[-1]))
        by_layers = {(gap.below.index, gap.above.index): gap.index for gap in self.gaps}
        for seam in sorted(self.laminate.seams, key=lambda seam: seam.order):
            index = by_layers[seam.below, seam.above]
            tasks.append(_Task(index, index, seam))
        return tasks

    def order(
        self, waiting: Sequence[_Task], done: Sequence[_Task], failed: set[frozenset[_Task]]
    ) -> list[_Task] | None:
        """The first order without a conflict, if any; ``failed`` holds sets that lead to none."""
        if not waiting:
            return []
        key = frozenset(done)
        if key in failed or len(failed) > MOST_TRIED:
            return None
        for task in waiting:
            if self.conflict(task, waiting, done) is None:
                rest = [other for other in waiting if other is not task]
                order = self.order(rest, [*done, task], failed)
                if order is not None:
                    return [task, *order]
        failed.add(key)
        return None

    def first_conflict(self, tasks: Sequence[_Task]) -> str:
        """Return the conflict in the listed order."""
        waiting, done = [*tasks], [*tasks[:0]]
        while True:
            conflicts = [self.conflict(task, waiting, done) for task in waiting]
            if None not in conflicts:
                conflict = next(filter(None, conflicts))
                return f"{conflict.words}; {conflict.remedy}"
            done.append(waiting.pop(conflicts.index(None)))

    def conflict(
        self, task: _Task, waiting: Sequence[_Task], done: Sequence[_Task]
    ) -> _Conflict | None:
        """Return why a task is not possible yet, or None if it is."""
        bond = self._bond(task)
        if bond is not None and bond.after is not None:
            others = [self._bond(pending) for pending in waiting if pending is not task]
            if any(pending is not None and pending.name == bond.after for pending in others):
                harm = (
                    f"comes after bond {bond.after} by face_bonds.{bond.name}.after, and that "
                    "cannot be made before"
                )
                subject = "the press" if task.seam is None else f"seam {task.seam.name}"
                return _Conflict(subject, harm, "change the order of the two")
        return self._harm(task, self._body(task, done))

    def _bond(self, task: _Task) -> FaceBond | None:
        """Return the entry of ``bonds`` for a task's faces."""
        gap = self.gaps[task.first - 1]
        return self.laminate.bond_of(gap.below, gap.above, task.process)

    def _body(self, task: _Task, done: Sequence[_Task]) -> Sequence[Interface]:
        """Return the interfaces of a task's body, with everything joined to it."""
        first, last = task.first, task.last
        joined = {index for past in done for index in range(past.first, past.last + 1)}
        while first - 1 in joined:
            first -= 1
        while last + 1 in joined:
            last += 1
        return self.gaps[first - 1 : last]

    def _harm(self, task: _Task, gaps: Sequence[Interface]) -> _Conflict | None:
        """Return the damage that a task would do to films of the interfaces, or None for none."""
        if task.seam is None:
            return self._pressed_by_mistake(task, gaps)
        return self._welded_by_mistake(task.seam, task, gaps) or _covered(task.seam, task, gaps)

    def _pressed_by_mistake(self, task: _Task, gaps: Sequence[Interface]) -> _Conflict | None:
        # Faces that do not bond in the press are safe in it; its temperature is checked later.
        for gap in gaps if not self.laminate.bonds else ():
            if task.first <= gap.index <= task.last:
                continue
            weld = self._open(gap)
            if weld.area > LEAST_WELD:
                x, y = _somewhere(weld)
                return _Conflict(
                    f"the press of layers {gaps[0].below.index} to {gaps[-1].above.index}",
                    f"would weld layers {gap.below.index} and {gap.above.index} all over, which "
                    "are bonded by seams",
                    "lay a mask between them, or say in [face_bonds] that these faces do not bond "
                    "in the press",
                    f" (x {x:.3f}, y {y:.3f})",
                )
        return None

    def _open(self, gap: Interface) -> Region:
        """Return contact between films that are not meant to bond, without a mask between them.

        Films may weld outside a chamber's seams, where they form a flap that holds no pressure.
        """
        bare = gap.unbonded - gap.mask if gap.masks else gap.unbonded
        if gap.kind != "chamber":
            return bare
        places = [centre for chamber in self.laminate.chambers for centre in chamber.centres]
        places += [port.at for port in self.laminate.ports]
        pieces = sorted(bare.pieces, key=lambda piece: Region(piece.outers).area)
        # A flap surrounds the pocket; the innermost piece around a place holds it.
        inner = [
            next((piece for piece in pieces if any(o.winding(place) for o in piece.outers)), None)
            for place in places
        ]
        pieces_inside = {id(piece): piece for piece in inner if piece is not None}.values()
        return (
            Region(tuple(c for piece in pieces_inside for c in piece.contours))
            if pieces_inside
            else bare
        )

    def _welded_by_mistake(
        self, seam: Seam, task: _Task, gaps: Sequence[Interface]
    ) -> _Conflict | None:
        for gap in gaps:
            if gap.index == task.first or not self._bonds_by(gap, seam):
                continue
            weld = self._open(gap) & seam.region
            if weld.area > LEAST_WELD:
                x, y = _somewhere(weld)
                return _Conflict(
                    _named(seam),
                    f"would weld layers {gap.below.index} and {gap.above.index} too, over "
                    f"{weld.area:.3f} mm2 at x {x:.3f}, y {y:.3f}",
                    "lay a mask between these, move the seam, or take films whose faces do not "
                    "bond there",
                )
        return None

    def _bonds_by(self, gap: Interface, seam: Seam) -> bool:
        """Return True if the heat of a seam bonds the faces of another interface."""
        if not self.laminate.bonds:
            return True
        bond_there = self.laminate.bond_of(gap.below, gap.above, seam.tool)
        below, above = self.laminate.layer(seam.below), self.laminate.layer(seam.above)
        bond = self.laminate.bond_of(below, above, seam.tool)
        if (
            bond_there is None
            or bond is None
            or None in (bond_there.temperature_c, bond.temperature_c)
        ):
            return bond_there is not None
        return (bond.temperature_c or 0.0) >= (bond_there.temperature_c or 0.0)

    # The steps of an order.

    def steps(
        self,
        task: _Task,
        done: Sequence[_Task],
        before: Sequence[_Conflict | None],
        count: int,
    ) -> Iterator[Joining]:
        """Yield a task's folds, then its joining. ``before`` tells why earlier tasks wait."""
        gaps = self._body(task, done)
        layers = tuple(range(gaps[0].below.index, gaps[-1].above.index + 1))
        laid = {index for past in done for index in self._layers(past)}
        folded = [fold for fold in self.laminate.folds if {fold.lower, fold.upper} <= laid]
        for fold in sorted(self.laminate.folds, key=lambda fold: fold.lower):
            halves = tuple(range(fold.lower, fold.upper + 1))
            if fold in folded or not {*halves} <= {*layers}:
                continue
            count += 1
            reason = f"layers {fold.lower} and {fold.upper} are halves of one film"
            bodies = self._bodies(halves, done, folded)
            yield Joining(count, "fold", halves, bodies, reason, fold=fold)
            folded.append(fold)
        bodies = self._bodies(layers, done, folded)
        from_below = task.seam is not None and _cover(task.seam, task, gaps) is not None
        reason = self._reason(task, before)
        yield Joining(
            count + 1, task.process, layers, bodies, reason, task.seam, from_below=from_below
        )

    def _layers(self, task: _Task) -> range:
        below, above = self.gaps[task.first - 1].below, self.gaps[task.last - 1].above
        return range(below.index, above.index + 1)

    def _bodies(
        self, layers: Sequence[int], done: Sequence[_Task], folded: Sequence[Fold]
    ) -> tuple[tuple[int, ...], ...]:
        """Return previously joined bodies and single layers, lowest first."""
        inside = {index for past in done for index in self._layers(past)[:-1]}
        inside |= {index for fold in folded for index in range(fold.lower, fold.upper)}
        bodies: list[list[int]] = [[]]
        for index in layers:
            bodies[-1].append(index)
            if index not in inside:
                bodies.append([])
        return tuple(tuple(body) for body in bodies if body)

    def _reason(self, task: _Task, before: Sequence[_Conflict | None]) -> str:
        bond = self._bond(task)
        layers = self._layers(task)
        if task.seam is None:
            words = f"films of layers {layers[0]} to {layers[-1]} bond in the press"
        else:
            words = f"{task.seam.tool} bonds layers {task.seam.below} and {task.seam.above}"
        if bond is not None:
            gap = self.gaps[task.first - 1]
            words += f" ({gap.below.faces[0]} and {gap.above.faces[1]}, bond {bond.name}"
            words += ")" if bond.temperature_c is None else f", {bond.temperature_c:g} C)"
        # Why the task is not possible after all others.
        is_alone = len(self.gaps) == task.last - task.first + 1
        late = None if is_alone else self._harm(task, self.gaps)
        if late is not None:
            subject = late.subject if task.seam is None else "it"
            return f"{words}; now, for once more films are joined {subject} {late.harm}"
        waits = next(filter(None, before), None)
        return words if waits is None else f"{words}; before others, for {waits.words}"


def _named(seam: Seam) -> str:
    return f"seam {seam.name} of layers {seam.below} and {seam.above}"


def _covered(seam: Seam, task: _Task, gaps: Sequence[Interface]) -> _Conflict | None:
    """Return the conflict of a seam with melting films both above and below it."""
    over = _cover(seam, task, gaps)
    under = _melting([gap.below for gap in gaps if gap.index < task.first], seam)
    if over is None or under is None:
        return None
    return _Conflict(
        _named(seam),
        f"would have to be made through layer {over.index} or layer {under.index}, which melt "
        "under the tool",
        "make it before these are joined to them, or open them there",
    )


def _cover(seam: Seam, task: _Task, gaps: Sequence[Interface]) -> Layer | None:
    """Return the film above a seam that would melt first under a tool from above, if any."""
    return _melting([gap.above for gap in gaps if gap.index > task.first], seam)


def _melting(films: Sequence[Layer], seam: Seam) -> Layer | None:
    """Return the first film over a seam that melts before the films below are warm."""
    melting = (film for film in films if not film.film.stays_solid)
    return next((f for f in melting if (f.profile & seam.region).area > LEAST_WELD), None)


def _somewhere(region: Region) -> Point:
    return max(region.pieces, key=lambda piece: piece.area).edges[0].at(0.5)
