"""Channels that close: the pressure that lifts the films of a void off each other.

A channel between films bonded at both sides is a long plate clamped at its edges. Under a
pressure p it lifts by d in its middle: p = E / (1 - nu^2) / w^4 (32 t^3 d + 64/3 t d^3). The
first term is its bending (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, 2nd ed.,
Sec. 3: d = p w^4 / 384 D), the second its stretching: a parabola is longer than its chord by
8 d^2 / 3 w, and a tension T in it carries p = 8 T d / w^2. The channel counts as open if d is
the thickness of the film beside it. Films bonded behind that film there stiffen it, so that a wide
place between many films may be harder to open than a narrow one between two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import NamedTuple

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Edge, Line, Point, meeting_points
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import widened
from sbafab.geometry.width import TOUCH, Width
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.boundary import without_slivers
from sbafab.rules.void_edges import VoidEdges

BENDING = 32.0
STRETCHING = 64.0 / 3.0
BESIDE = 1e-5
"""mm aside of a place at which it surely lies on one side of the end of a bond behind it."""


WIDEST = 3.0
"""Without known films, places up to this many times as wide as the narrowest are examined."""


class OpeningPlace(NamedTuple):
    """A place of a channel as drawn, and the width ``left`` at worst, mm, with its opening kPa.

    The pressure is None if no film is known.
    """

    width: Width
    left: float
    pressure: float | None


def hardest_place(
    laminate: Laminate, interface: Interface, void: Region, edges: VoidEdges
) -> OpeningPlace | None:
    """Return the place of a void that takes most pressure to open; None if no edges face there.

    Pressures are those at which either film lifts by its thickness, where the ``edges`` lie off at
    worst; without elastic constants of either it is the narrowest place. A model, not measured.
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
        """The kPa that open a place of this width at most: with all films behind it bonded."""
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
    """The films on one side of a void, outward, and the parts of it over which each next is bonded.

    Each part lies in the one before.
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
        """Return the kPa at which the first films, bonded, lift by the thickness of the first."""
        films = self.films[:count]
        elastic = [film.elastic for film in films if film.elastic is not None]
        if len(elastic) < count:
            return None
        plane = 1000 * max(modulus / (1 - poisson**2) for modulus, poisson in elastic)
        lift, thickness = films[0].thickness, sum(film.thickness for film in films)
        stiffness = BENDING * thickness**3 * lift + STRETCHING * thickness * lift**3
        return plane * stiffness / width**4

    def pressure(self, p: Point, q: Point) -> float | None:
        """Return the kPa that lift this side somewhere between two walls.

        At most what lifts the stiffest films there over the whole width, and what lifts any
        stretch of softer ones between stiffer.
        """
        length = math.dist(p, q)
        runs = list(self._runs(Line(p, q)))
        loads = [self.lifting(count, share * length) for count, share in runs]
        loads.append(self.lifting(max(count for count, _ in runs), length))
        return min((load for load in loads if load is not None), default=None)

    def _runs(self, across: Line) -> Iterator[tuple[int, float]]:
        """Yield how many films are bonded along stretches of a line, with their shares of it."""
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
    """Return the kPa that lift either side; the larger of both if bonds behind it end."""
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
    """Return a void whose edges are cut where edges of parts of it within reach begin or turn."""
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
