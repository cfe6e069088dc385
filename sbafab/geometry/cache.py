"""What is worked out of a contour and kept with it: bores and outlines bound several regions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from threading import Lock
from typing import Any, Generic, ParamSpec, TypeVar, overload

from sbafab.geometry.region import Contour, Region

Value = TypeVar("Made")


def kept(contour: Contour, name: str, make: Callable[[Contour], Value]) -> Value:
    """What ``make`` says of a contour, asked once; it must not hold the contour itself."""
    known = contour.__dict__
    if name not in known:
        known[name] = make(contour)
    found: Value = known[name]
    return found


# Values of records that do not change, worked out once.


Made = TypeVar("Made")
Record = TypeVar("Record")


def keeping(kind: type[Record]) -> type[Record]:
    """Says that records of this class keep values: compiled, too, each has its dictionary."""
    return kind


class once(Generic[Made]):  # noqa: N801
    """An attribute that is worked out when it is first asked for, and then stays with its record.

    As ``functools.cached_property``, but without the lock that it takes before Python 3.12.
    """

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self.make = make
        self.__doc__ = make.__doc__

    def __set_name__(self, kind: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, record: None, kind: type) -> once[Made]: ...
    @overload
    def __get__(self, record: object, kind: type) -> Made: ...
    def __get__(self, record: object | None, kind: type) -> once[Made] | Made:
        if record is None:
            return self
        found = record.__dict__[self.name] = self.make(record)
        return found


# Questions about regions, told apart by their very numbers.


class Question:
    """What a function is asked: regions, tuples of them, and other values that hash.

    Only the same numbers make the same question; regions themselves equal within SAME.
    """

    __slots__ = ("_hash", "asked")

    def __init__(self, asked: tuple[object, ...]) -> None:
        self.asked = asked
        self._hash = hash(tuple([_hash(one) for one in asked]))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Question) and _are_same(self.asked, other.asked)


def _hash(asked: object) -> int:
    if isinstance(asked, Region):
        known = asked.__dict__
        if "exact_hash" not in known:
            known["exact_hash"] = hash(
                tuple([kept(one, "edges_hash", _edges_hash) for one in asked.contours])
            )
        found: int = known["exact_hash"]
        return found
    if isinstance(asked, tuple) and asked and isinstance(asked[0], Region):
        return hash(tuple([_hash(one) for one in asked]))
    return hash(asked)


def _edges_hash(contour: Contour) -> int:
    """Alike for equal edges: where they start tells nearly all others apart."""
    return hash(tuple([edge.start for edge in contour.edges]))


def _are_same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    return len(one) == len(other) and all(map(_is_same, one, other))


def _is_same(one: object, other: object) -> bool:
    if isinstance(one, Region):
        return isinstance(other, Region) and (
            one.contours is other.contours
            or [own.edges for own in one.contours] == [own.edges for own in other.contours]
        )
    if isinstance(one, tuple) and one and isinstance(one[0], Region):
        return isinstance(other, tuple) and _are_same(one, other)
    return one == other


# What was found of regions is kept for a while: rules, pages and designs ask for it again.


Asked = ParamSpec("Asked")
Found = TypeVar("Found")
Several = TypeVar("Several", bound=tuple[object, ...])

MOST = 256
"""Answers that a function keeps, which bounds the memory over any number of designs."""


class _Answers(Generic[Found]):
    """The last answers of a function."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.known: dict[Question, Found] = {}
        self.lock = Lock()

    def keep(self, question: Question, found: Found) -> None:
        with self.lock:
            self.known[question] = found
            if len(self.known) > self.most:
                del self.known[next(iter(self.known))]


def remembered(ask: Callable[Asked, Found], most: int = MOST) -> Callable[Asked, Found]:
    """A function of regions and other values that hash, whose last answers are kept.

    What it returns is handed out again, and so must not be changed.
    """
    answers: _Answers[tuple[Found]] = _Answers(most)
    known = answers.known

    @wraps(ask)
    def answer(*asked: Asked.args, **named: Asked.kwargs) -> Found:
        question = Question((*asked, *named.items()) if named else asked)
        kept = known.get(question)
        if kept is None:
            kept = (ask(*asked, **named),)
            answers.keep(question, kept)
        return kept[0]

    return answer


def remembered_together(
    ask: Callable[[list[Several]], Sequence[Found]], most: int = MOST
) -> Callable[[Sequence[Several]], list[Found]]:
    """A function that answers several questions at once, of which it keeps the last answers.

    A question is a tuple of regions and other values that hash. What it is asked for the first time
    is worked out together; answers must not be changed.
    """
    answers: _Answers[Found] = _Answers(most)
    known = answers.known

    @wraps(ask)
    def answer(asked: Sequence[Several]) -> list[Found]:
        questions = [Question(one) for one in asked]
        found = {one: known[one] for one in questions if one in known}
        new = {one: own for one, own in zip(questions, asked, strict=True) if one not in found}
        if new:
            for one, own in zip(new, ask(list(new.values())), strict=True):
                found[one] = own
                answers.keep(one, own)
        return [found[one] for one in questions]

    return answer
