"""Edges of voids at worst: the width of a channel that cutting, kerf and seams leave.

A cut edge lies off by the cutting error, and by half of a kerf that is not measured. An edge of a
seam lies off by its tool's error of place; two edges of one seam move together, and lose nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.overlap_pairs import overlap_pairs
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_width
from sbafab.laminate.laminate import Interface
from sbafab.rules.margins import bonding_seams
from sbafab.rules.sentences import Clause, say

NEAR: Final = 1e-5
"""mm within which a place begins at an edge."""


class VoidEdges(NamedTuple):
    """The edges that bound the voids of an interface, with their errors of place, mm.

    ``kerf`` is the unknown kerf, ``seams`` the bonding seams with their tools' errors.
    """

    cutting: float
    kerf: float
    seams: tuple[tuple[Region, float], ...]

    @staticmethod
    def of(interface: Interface, design: Design) -> VoidEdges:
        cutting, seams = design.registration.cutting_error, bonding_seams(interface)
        cut = interface.masks or (interface.below, interface.above)
        is_known = all(design.kerf_widths.get(layer.film.material) is not None for layer in cut)
        return VoidEdges(
            cutting,
            0.0 if is_known else design.laser.unknown_kerf,
            tuple((seam.region, design.registration.error_of_seam(seam.tool)) for seam in seams),
        )

    @property
    def most(self) -> float:
        """The most that can be lost between any two edges, mm."""
        return 2 * max([self._cut, *(error for _, error in self.seams)])

    @property
    def with_seams_in_place(self) -> VoidEdges:
        """The edges with every seam on its path."""
        return self._replace(seams=tuple((region, 0.0) for region, _ in self.seams))

    @property
    def _cut(self) -> float:
        return self.cutting + self.kerf / 2

    def left(self, place: Width) -> Width:
        """Return the place as narrow as it can become; its width is 0 if it closes."""
        at_start, at_end = self._lost(place.start, place.end)
        if at_start + at_end >= place.value:
            return Width(0.0, place.middle, place.middle)
        (x, y), (u, v) = place.start, place.end
        dx, dy = (u - x) / place.value, (v - y) / place.value
        return Width(
            place.value - at_start - at_end,
            (x + dx * at_start, y + dy * at_start),
            (u - dx * at_end, v - dy * at_end),
        )

    def _lost(self, p: Point, q: Point) -> tuple[float, float]:
        """The most that the edges at two points lose towards each other, mm."""
        pairs = ((a, b) for a in self._at(p) for b in self._at(q))
        return max(
            (
                (0.0, 0.0) if a is not None and a == b else (of_a, of_b)
                for (a, of_a), (b, of_b) in pairs
            ),
            key=sum,
        )

    def _at(self, p: Point) -> list[tuple[int | None, float]]:
        """The seams whose edges run through a point, by number, with their errors of place."""
        beside: list[tuple[int | None, float]] = [
            (number, error)
            for number, (region, error) in enumerate(self.seams)
            if region.distance_to_edge(p) <= NEAR
        ]
        return beside or [(None, self._cut)]

    def narrow_places(self, void: Region, widest: float = 0.0) -> Iterator[tuple[Width, Width]]:
        """Yield places of a void as drawn, each with its worst case, narrow places first.

        They include the narrowest at worst, and every place at most ``widest`` mm wide at worst.
        """
        least = least_width(void, 0.0)
        if least is None:
            return
        yield least, self.left(least)
        slack = max(self.left(least).value, widest) + self.most - least.value
        if not self.seams and not widest:
            return
        places = overlap_pairs(void, max(0.0, slack), 0.0, least)
        for number in places.value.argsort(kind="stable").tolist():
            (x, y), (u, v) = places.start[:, number].tolist(), places.end[:, number].tolist()
            place = Width(float(places.value[number]), (x, y), (u, v))
            yield place, self.left(place)

    def causes(self) -> Clause:
        """Return the causes of the loss, as sentences name them."""
        if self.seams:
            errors = " or ".join(f"{error:g}" for error in sorted({e for _, e in self.seams}))
            return say("words.seams-off", errors=errors)
        sentence = "words.edges-and-kerf" if self.kerf else "words.cut-edges"
        return say(sentence, cutting=self.cutting, kerf=self.kerf)
