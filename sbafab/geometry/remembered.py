"""What was found of regions is kept for a while: rules, pages and designs ask for it again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

from sbafab.geometry.exact import Exact
from sbafab.geometry.region import Region

Asked = ParamSpec("Asked")
Found = TypeVar("Found")
Question = TypeVar("Question", bound=tuple[object, ...])

MOST = 256
"""Answers that a function keeps, which bounds the memory over any number of designs."""


def remembered(ask: Callable[Asked, Found], most: int = MOST) -> Callable[Asked, Found]:
    """A function of regions and other values that hash, whose last answers are kept.

    What it returns is handed out again, and so must not be changed.
    """

    @lru_cache(maxsize=most)
    def known(*asked: Any, **named: Any) -> Found:
        return ask(*map(_own, asked), **named)

    @wraps(ask)
    def answer(*asked: Asked.args, **named: Asked.kwargs) -> Found:
        exact = [Exact(one) if isinstance(one, Region) else one for one in asked]
        return known(*exact, **named)  # type: ignore[arg-type]

    return answer


def remembered_together(
    ask: Callable[[list[Question]], Sequence[Found]], most: int = MOST
) -> Callable[[Sequence[Question]], list[Found]]:
    """A function that answers several questions at once, of which it keeps the last answers.

    A question is a tuple of regions and other values that hash. What it is asked for the first time
    is worked out together; answers must not be changed.
    """
    known: dict[tuple[object, ...], Found] = {}

    @wraps(ask)
    def answer(asked: Sequence[Question]) -> list[Found]:
        names = [tuple(map(_named, one)) for one in asked]
        new = {name: one for name, one in zip(names, asked, strict=True) if name not in known}
        found = dict(zip(new, ask(list(new.values())) if new else (), strict=True))
        for name in names:
            # What was asked for last is given up last.
            found[name] = known[name] = known.pop(name) if name in known else found[name]
        while len(known) > most:
            del known[next(iter(known))]
        return [found[name] for name in names]

    return answer


def _named(asked: object) -> object:
    """What stands for a value, or for several regions, in the name of a question."""
    if isinstance(asked, Region):
        return Exact(asked)
    if isinstance(asked, tuple) and asked and isinstance(asked[0], Region):
        return tuple(map(Exact, asked))
    return asked


def _own(asked: Any) -> Any:
    return asked.region if isinstance(asked, Exact) else asked
