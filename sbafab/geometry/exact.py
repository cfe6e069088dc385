"""Regions told apart by their very numbers."""

from __future__ import annotations

from sbafab.geometry.kept import kept
from sbafab.geometry.region import Contour, Region


class Exact:
    """A region that only the same numbers equal; regions themselves equal within SAME."""

    __slots__ = ("_hash", "region")

    def __init__(self, region: Region) -> None:
        self.region = region
        known = region.__dict__
        if "exact_hash" not in known:
            hashes = [kept(one, "edges_hash", _edges_hash) for one in region.contours]
            known["exact_hash"] = hash(tuple(hashes))
        self._hash: int = known["exact_hash"]

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Exact):
            return False
        mine, theirs = self.region.contours, other.region.contours
        return mine is theirs or [own.edges for own in mine] == [one.edges for one in theirs]


def _edges_hash(contour: Contour) -> int:
    """Alike for equal edges: where they start tells nearly all others apart."""
    return hash(tuple([edge.start for edge in contour.edges]))
