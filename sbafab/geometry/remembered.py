"""What was found of regions is kept for a while: rules, pages and designs ask for it again."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

from sbafab.geometry.kept import kept
from sbafab.geometry.region import Contour, Region

Asked = ParamSpec("Asked")
Found = TypeVar("Found")

MOST = 256
"""Answers that a function keeps, which bounds the memory over any number of designs."""


class _Exact:
    """A region that only the same numbers equal; regions themselves equal within SAME."""

    __slots__ = ("_hash", "region")

    def __init__(self, region: Region) -> None:
        self.region = region
        self._hash = hash(tuple([kept(one, "edges_hash", _edges_hash) for one in region.contours]))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Exact):
            return False
        mine, theirs = self.region.contours, other.region.contours
        return mine is theirs or [own.edges for own in mine] == [one.edges for one in theirs]


def _edges_hash(contour: Contour) -> int:
    return hash(contour.edges)


def remembered(ask: Callable[Asked, Found], most: int = MOST) -> Callable[Asked, Found]:
    """A function of regions and other values that hash, whose last answers are kept.

    What it returns is handed out again, and so must not be changed.
    """

    @lru_cache(maxsize=most)
    def known(*asked: Any, **named: Any) -> Found:
        return ask(*map(_own, asked), **named)

    @wraps(ask)
    def answer(*asked: Asked.args, **named: Asked.kwargs) -> Found:
        exact = (_Exact(one) if isinstance(one, Region) else one for one in asked)
        return known(*exact, **named)  # type: ignore[arg-type]

    return answer


def _own(asked: Any) -> Any:
    return asked.region if isinstance(asked, _Exact) else asked
