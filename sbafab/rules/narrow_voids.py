"""Narrow places of voids at worst: the width left by cutting, kerf and seams, and the opening
pressure.

A cut edge deviates by the cutting error, and by half of an unmeasured kerf. A seam's edge deviates
by its tool's position error; two edges of one seam move together, without loss.

A channel between films bonded at both sides is a long plate clamped at its edges. Under a pressure
p it lifts by d in its middle: p = E / (1 - nu^2) / w^4 (32 t^3 d + 64/3 t d^3). The first term is
its bending (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, 2nd ed., Sec. 3: d = p
w^4 / 384 D), the second its stretching: a parabola is longer than its chord by 8 d^2 / 3 w, and a
tension T in it carries p = 8 T d / w^2. The channel counts as open if d equals the thickness of the
adjacent film. Films bonded behind it stiffen it, so a wide place between many films may be harder
to open than a narrow one between two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Final, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, Line, Point, meeting_points
from sbafab.geometry.overlap_pairs import overlap_pairs
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import widened
from sbafab.geometry.width import TOUCH, Width, least_width
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.boundary import without_slivers
from sbafab.rules.margins import bonding_seams
from sbafab.rules.sentences import Clause, say

NEAR: Final = 1e-5
"""mm within which a place begins at an edge."""


class VoidEdges(NamedTuple):
    """The edges that bound the voids of an interface, with their position errors, mm.

    ``kerf`` is the unknown kerf; ``seams`` are the bonding seams with their tools' errors.
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
        """The largest possible loss between any two edges, mm."""
        return 2 * max([self._cut, *(error for _, error in self.seams)])

    @property
    def with_seams_in_place(self) -> VoidEdges:
        """Return the edges with every seam on its path."""
        return self._replace(seams=tuple((region, 0.0) for region, _ in self.seams))

    @property
    def _cut(self) -> float:
        return self.cutting + self.kerf / 2

    def left(self, place: Width) -> Width:
        """Return the place at its smallest width; 0 if it closes."""
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
        """Return the largest loss between the edges at two points, mm."""
        pairs = ((a, b) for a in self._at(p) for b in self._at(q))
        return max(
            (
                (0.0, 0.0) if a is not None and a == b else (of_a, of_b)
                for (a, of_a), (b, of_b) in pairs
            ),
            key=sum,
        )

    def _at(self, p: Point) -> list[tuple[int | None, float]]:
        """Return the seams with an edge through a point, by number, with their position errors."""
        beside: list[tuple[int | None, float]] = [
            (number, error)
            for number, (region, error) in enumerate(self.seams)
            if region.distance_to_edge(p) <= NEAR
        ]
        return beside or [(None, self._cut)]

    def narrow_places(self, void: Region, widest: float = 0.0) -> Iterator[tuple[Width, Width]]:
        """Yield places of a void as drawn, each with its worst case, narrow places first.

        These include the narrowest in the worst case, and every place then at most ``widest`` mm
        wide.
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
        """Return the causes of the loss, as worded in messages."""
        if self.seams:
            errors = " or ".join(f"{error:g}" for error in sorted({e for _, e in self.seams}))
            return say("words.seams-off", errors=errors)
        sentence = "words.edges-and-kerf" if self.kerf else "words.cut-edges"
        return say(sentence, cutting=self.cutting, kerf=self.kerf)


# The pressure that lifts the films of a void off each other.


BENDING = 32.0
STRETCHING = 64.0 / 3.0
BESIDE = 1e-5
"""mm aside of a place at which it surely lies on one side of the end of a bond behind it."""


WIDEST = 3.0
"""Without known films, places up to this many times as wide as the narrowest are examined."""


class OpeningPlace(NamedTuple):
    """A place of a channel as drawn, its worst-case width ``left``, mm, and opening pressure, kPa.

    The pressure is None if no film is known.
    """

    width: Width
    left: float
    pressure: float | None


def hardest_place(
    laminate: Laminate, interface: Interface, void: Region, edges: VoidEdges
) -> OpeningPlace | None:
    """Return the place of a void with the highest opening pressure; None if no edges face.

    At that pressure either film lifts by its thickness, with the ``edges`` at their worst; without
    elastic constants it is the narrowest place. A model, not a measurement.
    """
    places = edges.narrow_places(void)
    narrowest, remaining = min(places, key=lambda place: place[1].value, default=(None, None))
    if narrowest is None or remaining is None:
        return None
    sides = [_Side.of(laminate, interface, step, void) for step in (-1, 1)]
    worst = OpeningPlace(narrowest, remaining.value, _pressure(sides, remaining))
    if worst.pressure is None or math.isinf(worst.pressure):
        return worst

    def most(width: float) -> float:
        """Return an upper bound of the opening pressure, kPa, at this width: all films bonded."""
        loads = [side.lifting(len(side.films), width) for side in sides]
        return min((load for load in loads if load is not None), default=math.inf)

    # Pressures fall with the fourth power of the width: wider places open more easily.
    harder = most(remaining.value) / worst.pressure
    widest = remaining.value * (harder**0.25 if math.isfinite(harder) else WIDEST)
    if widest - remaining.value <= TOUCH:
        return worst
    bonded = [region for side in sides for region in side.bonded]
    walls = _split(void, bonded, widest + edges.most)
    for width, remaining in edges.narrow_places(walls, widest):
        if most(remaining.value) <= worst.pressure:
            continue
        pressure = _pressure(sides, remaining)
        if pressure is None:
            return OpeningPlace(width, remaining.value, None)
        if pressure > worst.pressure:
            worst = OpeningPlace(width, remaining.value, pressure)
    return worst


class _Side(NamedTuple):
    """The films on one side of a void, outward, and the parts over which each next film is bonded.

    Each part lies within the previous one.
    """

    films: tuple[Film, ...]
    bonded: tuple[Region, ...]

    @classmethod
    def of(cls, laminate: Laminate, gap: Interface, step: int, void: Region) -> _Side:
        films, bonded = [(gap.above if step > 0 else gap.below).film], []
        number = gap.index - 1 + step
        part = void
        while 0 <= number < len(laminate.interfaces):
            behind = laminate.interfaces[number]
            part = without_slivers(part & behind.bond)
            if part.is_empty:
                break
            bonded.append(part)
            films.append((behind.above if step > 0 else behind.below).film)
            number += step
        return cls(tuple(films), tuple(bonded))

    def lifting(self, count: int, width: float) -> float | None:
        """Return the pressure (kPa) that lifts the first bonded films by the first's thickness."""
        films = self.films[:count]
        elastic = [film.elastic for film in films if film.elastic is not None]
        if len(elastic) < count:
            return None
        plane = 1000 * max(modulus / (1 - poisson**2) for modulus, poisson in elastic)
        lift, thickness = films[0].thickness, sum(film.thickness for film in films)
        stiffness = BENDING * thickness**3 * lift + STRETCHING * thickness * lift**3
        return plane * stiffness / width**4

    def pressure(self, p: Point, q: Point) -> float | None:
        """Return the pressure in kPa that lifts this side somewhere between two walls.

        It is at most the pressure that lifts the stiffest films over the whole width, or any
        stretch of softer films between stiffer ones.
        """
        length = math.dist(p, q)
        runs = list(self._runs(Line(p, q)))
        loads = [self.lifting(count, share * length) for count, share in runs]
        loads.append(self.lifting(max(count for count, _ in runs), length))
        return min((load for load in loads if load is not None), default=None)

    def _runs(self, across: Line) -> Iterator[tuple[int, float]]:
        """Yield the number of bonded films along stretches of a line, and length fractions."""
        edges = (edge for part in self.bonded for edge in part.index.touching(across.bounds))
        shares = sorted(across.parameter(m) for edge in edges for m in meeting_points(across, edge))
        stretches = [
            (
                1 + sum(part.contains(across.at((low + high) / 2)) for part in self.bonded),
                high - low,
            )
            for low, high in pairwise([0.0, *shares, 1.0])
            if (high - low) * across.length > TOUCH
        ]
        for count, group in groupby(stretches, key=lambda stretch: stretch[0]):
            yield count, sum(share for _, share in group)


def _pressure(sides: Sequence[_Side], width: Width) -> float | None:
    """Return the pressure in kPa that lifts either side; the larger one if bonds behind it end."""
    if width.value <= TOUCH:
        return math.inf
    (x, y), (u, v) = width.start, width.end
    dx, dy = BESIDE * (y - v) / width.value, BESIDE * (u - x) / width.value
    pressures = []
    for sign in (-1, 1):
        p, q = (x + sign * dx, y + sign * dy), (u + sign * dx, v + sign * dy)
        loads = [load for side in sides if (load := side.pressure(p, q)) is not None]
        pressures += [min(loads)] if loads else []
    return max(pressures, default=None)


def _split(void: Region, parts: Sequence[Region], reach: float) -> Region:
    """Return a void whose edges are split where nearby edges of its parts begin or turn."""
    contours = []
    for contour in void.contours:
        edges: list[Edge] = []
        for edge in contour.edges:
            box = widened(edge.bounds, reach)
            ends = [end for part in parts for end in part.index.touching(box)]
            points = [
                p for end in ends for p in (*meeting_points(edge, end), end.start, end.at(0.5))
            ]
            room = TOUCH / edge.length
            shares = sorted(edge.parameter(edge.nearest(p)) for p in points)
            cuts = [
                t for before, t in pairwise([0.0, *shares]) if t - before > room and t < 1 - room
            ]
            marks = [edge.start, *map(edge.at, cuts), edge.end]
            edges += [edge.part(a, b) for a, b in pairwise(marks)]
        contours.append(Contour(tuple(edges)))
    return Region(tuple(contours))
