"""Questions about regions, told apart by their very numbers."""

from __future__ import annotations

from sbafab.geometry.kept import kept
from sbafab.geometry.region import Contour, Region


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
