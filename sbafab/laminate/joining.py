"""The order of joining films: presses, seams and folds, each with its reason.

A press bonds all films in it at once; a tool heats every film under its path. So both are possible
only while the work has no faces that they would weld by mistake.
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
from sbafab.laminate.joints import PRESS, BondProcess, FaceBond, Fold, Seam
from sbafab.laminate.laminate import Interface, Laminate, Layer

MOST_TRIED = 300
"""Dead ends after which the search for an order is given up."""
LEAST_WELD = 1e-3
"""Area shared by two films above which it is a weld, not rounding, mm2."""


@dataclass(frozen=True)
class Joining:
    """An act of joining, counted from 1: a press, a seam or a fold.

    ``layers`` are the layers involved, by index, and ``bodies`` the same grouped as they arrive,
    lowest first: earlier joined bodies, and single layers. ``from_below``: a film above the seam
    would melt under the tool, so the work is turned over and the path mirrored.
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
    """A task: interfaces by index, ``first`` to ``last``, to join in the press or by a seam."""

    first: int
    last: int
    seam: Seam | None = None

    @property
    def process(self) -> BondProcess:
        return PRESS if self.seam is None else self.seam.tool


def is_only_pressed(laminate: Laminate) -> bool:
    """Return True for films that are only joined in the press, and not folded."""
    return not laminate.seams and not laminate.folds


def joinings(laminate: Laminate) -> tuple[Joining, ...]:
    """Return all acts of joining, in order.

    Presses come before seams, and seams in the listed order, unless ``bonds`` say otherwise or one
    of them is only possible earlier. Raises DesignError with the conflict if there is no order.
    """
    return stored(laminate, "_joinings", _joinings)


def _joinings(laminate: Laminate) -> tuple[Joining, ...]:
    _refuse_strangers(laminate)
    waiting = [*_presses(laminate), *_seams(laminate)]
    ordered = _ordered(laminate, waiting, [], set())
    if ordered is None:
        raise DesignError(_first_conflict(laminate, waiting))
    done: list[_Task] = []
    steps: list[Joining] = []
    for task in ordered:
        earlier = waiting[: waiting.index(task)]
        before = [_conflict(laminate, other, waiting, done) for other in earlier]
        steps += _steps(laminate, task, done, before, len(steps))
        waiting.remove(task)
        done.append(task)
    return tuple(steps)


def _ordered(
    laminate: Laminate,
    waiting: Sequence[_Task],
    done: Sequence[_Task],
    failed: set[frozenset[_Task]],
) -> list[_Task] | None:
    """Return the first order without a conflict, or None; ``failed`` are sets that are dead
    ends.
    """
    if not waiting:
        return []
    key = frozenset(done)
    if key in failed or len(failed) > MOST_TRIED:
        return None
    for task in waiting:
        if _conflict(laminate, task, waiting, done) is None:
            rest = [other for other in waiting if other is not task]
            order = _ordered(laminate, rest, [*done, task], failed)
            if order is not None:
                return [task, *order]
    failed.add(key)
    return None


def _first_conflict(laminate: Laminate, tasks: Sequence[_Task]) -> str:
    """Return the conflict in the listed order."""
    waiting, done = [*tasks], [*tasks[:0]]
    while True:
        conflicts = [_conflict(laminate, task, waiting, done) for task in waiting]
        if None not in conflicts:
            conflict = next(filter(None, conflicts))
            return f"{conflict.words}; {conflict.remedy}"
        done.append(waiting.pop(conflicts.index(None)))


def _refuse_strangers(laminate: Laminate) -> None:
    """Raises DesignError for neighbours that nothing joins, although their faces meet."""
    folded = {(fold.lower, fold.upper) for fold in laminate.folds}
    for gap in laminate.interfaces if laminate.bonds else ():
        pair = gap.below.index, gap.above.index
        if gap.pressed or gap.seams or pair in folded:
            continue
        below, above = gap.below.faces[0], gap.above.faces[1]
        raise DesignError(
            f"layers {pair[0]} and {pair[1]} face each other with {below} and {above}, which "
            "nothing in face_bonds joins in the press, and no seam lies between them; turn one of "
            "them, add a seam, or say in [face_bonds] what joins these faces"
        )
    for seam in laminate.seams if laminate.bonds else ():
        lower, upper = laminate.layer(seam.below), laminate.layer(seam.above)
        if laminate.bond_of(lower, upper, seam.tool) is None:
            raise DesignError(
                f"seam {seam.name}: layers {seam.below} and {seam.above} face each other with "
                f"{lower.faces[0]} and {upper.faces[1]}, which nothing in face_bonds joins by "
                f"{seam.tool}; turn one of them, or add it to [face_bonds]"
            )


def _presses(laminate: Laminate) -> Iterator[_Task]:
    """Yield runs of interfaces that bond in the press, bottom to top."""
    for is_pressed, run in groupby(laminate.interfaces, key=lambda gap: gap.pressed):
        first, *rest = (gap.index for gap in run)
        if is_pressed:
            yield _Task(first, rest[-1] if rest else first)


def _seams(laminate: Laminate) -> Iterator[_Task]:
    by_layers = {(gap.below.index, gap.above.index): gap.index for gap in laminate.interfaces}
    for seam in sorted(laminate.seams, key=lambda seam: seam.order):
        index = by_layers[seam.below, seam.above]
        yield _Task(index, index, seam)


def _bond(laminate: Laminate, task: _Task) -> FaceBond | None:
    """The entry of ``bonds`` for a task's faces."""
    gap = laminate.interfaces[task.first - 1]
    return laminate.bond_of(gap.below, gap.above, task.process)


def _in_hand(laminate: Laminate, task: _Task, done: Sequence[_Task]) -> tuple[int, int]:
    """The first and last interface of the body that a task works on, with everything joined to
    it.
    """
    first, last = task.first, task.last
    joined = {index for past in done for index in range(past.first, past.last + 1)}
    while first - 1 in joined:
        first -= 1
    while last + 1 in joined:
        last += 1
    return first, last


class _Conflict(NamedTuple):
    """Why films cannot be joined yet: the fault of a task, its place, and a remedy."""

    subject: str
    harm: str
    remedy: str
    where: str = ""

    @property
    def words(self) -> str:
        """The fault and its place."""
        return f"{self.subject} {self.harm}{self.where}"


def _conflict(
    laminate: Laminate, task: _Task, waiting: Sequence[_Task], done: Sequence[_Task]
) -> _Conflict | None:
    """Return why a task is not possible yet, or None if it is."""
    bond = _bond(laminate, task)
    if bond is not None and bond.after is not None:
        others = [_bond(laminate, other) for other in waiting if other is not task]
        if any(other is not None and other.name == bond.after for other in others):
            harm = (
                f"comes after bond {bond.after} by face_bonds.{bond.name}.after, and that cannot "
                "be made before"
            )
            subject = "the press" if task.seam is None else f"seam {task.seam.name}"
            return _Conflict(subject, harm, "change the order of the two")
    first, last = _in_hand(laminate, task, done)
    return _harm(laminate, task, laminate.interfaces[first - 1 : last])


def _harm(laminate: Laminate, task: _Task, gaps: Sequence[Interface]) -> _Conflict | None:
    """Return what a task would do to the films of the interfaces, or None if it does no harm."""
    if task.seam is None:
        return _pressed_by_mistake(laminate, task, gaps)
    return _welded_by_mistake(laminate, task.seam, task, gaps) or _is_covered(task.seam, task, gaps)


def _named(seam: Seam) -> str:
    return f"seam {seam.name} of layers {seam.below} and {seam.above}"


def _pressed_by_mistake(
    laminate: Laminate, task: _Task, gaps: Sequence[Interface]
) -> _Conflict | None:
    # Faces that do not bond in the press are safe in it; its temperature is checked later.
    for gap in gaps if not laminate.bonds else ():
        weld = _open(laminate, gap) if not task.first <= gap.index <= task.last else Region()
        if weld.area > LEAST_WELD:
            x, y = _somewhere(weld)
            return _Conflict(
                f"the press of layers {gaps[0].below.index} to {gaps[-1].above.index}",
                f"would weld layers {gap.below.index} and {gap.above.index} all over, which are "
                "bonded by seams",
                "lay a mask between them, or say in [face_bonds] that these faces do not bond in "
                "the press",
                f" (x {x:.3f}, y {y:.3f})",
            )
    return None


def _open(laminate: Laminate, gap: Interface) -> Region:
    """Contact of films that are not meant to bond, without a mask between them.

    Films may weld outside a chamber's seams: there they are a flap that holds no pressure.
    """
    bare = gap.unbonded - gap.mask if gap.masks else gap.unbonded
    if gap.kind != "chamber":
        return bare
    places = [centre for chamber in laminate.chambers for centre in chamber.centres]
    places += [port.at for port in laminate.ports]
    pieces = sorted(bare.pieces, key=lambda piece: Region(piece.outers).area)
    # A flap surrounds the pocket; the innermost piece around a place holds it.
    inner = [
        next((piece for piece in pieces if any(o.winding(place) for o in piece.outers)), None)
        for place in places
    ]
    held = {id(piece): piece for piece in inner if piece is not None}.values()
    return Region(tuple(contour for piece in held for contour in piece.contours)) if held else bare


def _welded_by_mistake(
    laminate: Laminate, seam: Seam, task: _Task, gaps: Sequence[Interface]
) -> _Conflict | None:
    for gap in gaps:
        if gap.index == task.first or not _bonds_by(laminate, gap, seam):
            continue
        weld = _open(laminate, gap) & seam.region
        if weld.area > LEAST_WELD:
            x, y = _somewhere(weld)
            return _Conflict(
                _named(seam),
                f"would weld layers {gap.below.index} and {gap.above.index} too, over "
                f"{weld.area:.3f} mm2 at x {x:.3f}, y {y:.3f}",
                "lay a mask between these, move the seam, or take films whose faces do not bond "
                "there",
            )
    return None


def _bonds_by(laminate: Laminate, gap: Interface, seam: Seam) -> bool:
    """Return True if the heat of a seam bonds the faces of another interface."""
    if not laminate.bonds:
        return True
    other = laminate.bond_of(gap.below, gap.above, seam.tool)
    below, above = laminate.layer(seam.below), laminate.layer(seam.above)
    bond = laminate.bond_of(below, above, seam.tool)
    if other is None or bond is None or None in (other.temperature_c, bond.temperature_c):
        return other is not None
    return (bond.temperature_c or 0.0) >= (other.temperature_c or 0.0)


def _is_covered(seam: Seam, task: _Task, gaps: Sequence[Interface]) -> _Conflict | None:
    """Return the conflict of a seam covered by melting films both from above and from below."""
    below = [gap.below for gap in gaps if gap.index < task.first]
    covers = [_cover(seam, task, gaps), _melting(below, seam)]
    if None in covers:
        return None
    over, under = (layer.index for layer in covers if layer is not None)
    return _Conflict(
        _named(seam),
        f"would have to be made through layer {over} or layer {under}, which melt under the tool",
        "make it before these are joined to them, or open them there",
    )


def _cover(seam: Seam, task: _Task, gaps: Sequence[Interface]) -> Layer | None:
    """Return the film above a seam that would melt first under a tool from above, if any."""
    return _melting([gap.above for gap in gaps if gap.index > task.first], seam)


def _melting(films: Sequence[Layer], seam: Seam) -> Layer | None:
    """The first film over a seam that melts before the films under it are warm."""
    return next(
        (
            film
            for film in films
            if not film.film.stays_solid and (film.profile & seam.region).area > LEAST_WELD
        ),
        None,
    )


def _somewhere(region: Region) -> Point:
    return max(region.pieces, key=lambda piece: piece.area).edges[0].at(0.5)


def _steps(
    laminate: Laminate,
    task: _Task,
    done: Sequence[_Task],
    before: Sequence[_Conflict | None],
    count: int,
) -> Iterator[Joining]:
    """Yield a task's joining, after its folds. ``before``: why earlier ones in the list have to
    wait.
    """
    first, last = _in_hand(laminate, task, done)
    gaps = laminate.interfaces[first - 1 : last]
    layers = tuple(range(gaps[0].below.index, gaps[-1].above.index + 1))
    laid = {index for past in done for index in _layers(laminate, past)}
    folded = [fold for fold in laminate.folds if {fold.lower, fold.upper} <= laid]
    for fold in sorted(laminate.folds, key=lambda fold: fold.lower):
        halves = range(fold.lower, fold.upper + 1)
        if fold in folded or not {*halves} <= {*layers}:
            continue
        count += 1
        bodies = tuple(_bodies(laminate, halves, done, folded))
        reason = f"layers {fold.lower} and {fold.upper} are halves of one film"
        yield Joining(count, "fold", tuple(halves), bodies, reason, fold=fold)
        folded.append(fold)
    bodies = tuple(_bodies(laminate, layers, done, folded))
    reason = _reason(laminate, task, before)
    from_below = task.seam is not None and _cover(task.seam, task, gaps) is not None
    yield Joining(count + 1, task.process, layers, bodies, reason, task.seam, from_below=from_below)


def _layers(laminate: Laminate, task: _Task) -> range:
    gaps = laminate.interfaces
    return range(gaps[task.first - 1].below.index, gaps[task.last - 1].above.index + 1)


def _bodies(
    laminate: Laminate, layers: Sequence[int], done: Sequence[_Task], folded: Sequence[Fold]
) -> Iterator[tuple[int, ...]]:
    """Yield earlier joined bodies and single layers, lowest first."""
    inside = {index for past in done for index in _layers(laminate, past)[:-1]}
    inside |= {index for fold in folded for index in range(fold.lower, fold.upper)}
    body: list[int] = []
    for index in layers:
        body.append(index)
        if index not in inside:
            yield tuple(body)
            body = []


def _reason(laminate: Laminate, task: _Task, before: Sequence[_Conflict | None]) -> str:
    bond = _bond(laminate, task)
    gap = laminate.interfaces[task.first - 1]
    faces = f"{gap.below.faces[0]} and {gap.above.faces[1]}"
    if task.seam is None:
        words = f"films of layers {gap.below.index} to "
        words += f"{laminate.interfaces[task.last - 1].above.index} bond in the press"
    else:
        words = f"{task.seam.tool} bonds layers {task.seam.below} and {task.seam.above}"
    if bond is not None:
        words += f" ({faces}, bond {bond.name}"
        words += ")" if bond.temperature_c is None else f", {bond.temperature_c:g} C)"
    later = _later(laminate, task)
    if later is not None:
        return f"{words}; now, for once more films are joined {later}"
    waits = next(filter(None, before), None)
    return words if waits is None else f"{words}; before others, for {waits.words}"


def _later(laminate: Laminate, task: _Task) -> str | None:
    """Return why a task is not possible after all others, or None if it is."""
    gaps = laminate.interfaces
    conflict = _harm(laminate, task, gaps) if len(gaps) > task.last - task.first + 1 else None
    if conflict is None:
        return None
    return f"{conflict.subject if task.seam is None else 'it'} {conflict.harm}"
