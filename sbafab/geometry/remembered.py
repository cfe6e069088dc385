"""What was found of regions is kept for a while: rules, pages and designs ask for it again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from threading import Lock
from typing import Generic, ParamSpec, TypeVar

from sbafab.geometry.question import Question

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
