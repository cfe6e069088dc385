"""The coarse shell of a whole actuator: mid-surfaces that share the nodes of what is bonded.

In each pocket rings of eight nodes or more at bore, neck, between them and the edge; the web
between the pockets and the neck rings are one layer of double thickness. Inlet tabs and strips are
left out. Lengths mm, volumes ul.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.meridian import Meridian, Start, fullest
from sbafab.simulators.coarse.rounds import RoundStack
from sbafab.simulators.coarse.web import Triangle, web_of

SECTORS = 8
"""Nodes of a ring; a multiple of four."""
RING_STEP = 0.25
"""Distance of the rings between neck and edge, in pocket radii."""

Ring = tuple[int, ...]


@dataclass(frozen=True)
class CoarseMesh:
    """Nodes flat (``rest``) and inflated (``position``), and the triangles of every group.

    ``lower`` and ``upper`` are the free films, ``web`` and ``necks`` are bonded pairs. In each
    group no edge has more than two triangles. ``cavities`` holds a closed surface a chamber,
    normals out of the air. ``fixed`` are the nodes on the ground, ``tip`` those whose mean is the
    tip and whose plane is its tilt, counter-clockwise from above; ``roots`` and ``poles`` are the
    centres of the lowest and of the highest film over each chamber axis.
    """

    rest: tuple[Vector, ...]
    position: tuple[Vector, ...]
    lower: tuple[Triangle, ...]
    upper: tuple[Triangle, ...]
    web: tuple[Triangle, ...]
    necks: tuple[Triangle, ...]
    cavities: tuple[tuple[str, tuple[Triangle, ...]], ...]
    fixed: tuple[int, ...]
    tip: tuple[int, ...]
    roots: tuple[int, ...]
    poles: tuple[int, ...]

    @property
    def single(self) -> tuple[Triangle, ...]:
        """Film of single thickness."""
        return self.lower + self.upper

    @property
    def double(self) -> tuple[Triangle, ...]:
        """Two films bonded."""
        return self.web + self.necks

    @property
    def height(self) -> float:
        """Of the inflated start."""
        return max(z for _, _, z in self.position)

    def volume(self, chamber: str) -> float:
        """What the chamber's cavity holds at the start."""
        return enclosed(self.position, dict(self.cavities)[chamber])

    def mass(self, thickness: float, density: float) -> float:
        """True mass in kg of the films; thickness mm, density kg/m3."""
        single = sum(area(self.rest, triangle) for triangle in self.single)
        double = sum(area(self.rest, triangle) for triangle in self.double)
        return (single + 2 * double) * thickness * density * 1e-9


def coarse_mesh(stack: RoundStack, start: Start = fullest, sectors: int = SECTORS) -> CoarseMesh:
    """The mesh of a stack, inflated to what ``start`` makes of each pocket and neck radius."""
    meridians = tuple(start(pocket, stack.neck) for pocket in stack.pockets)
    return _Builder(stack, meridians, sectors).mesh()


def enclosed(points: tuple[Vector, ...], triangles: tuple[Triangle, ...]) -> float:
    """Volume inside a closed surface whose normals point outward."""
    total = 0.0
    for a, b, c in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points[a], points[b], points[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6


def area(points: tuple[Vector, ...], triangle: Triangle) -> float:
    a, b, c = (points[node] for node in triangle)
    u = [q - p for p, q in zip(a, b, strict=True)]
    v = [q - p for p, q in zip(a, c, strict=True)]
    return 0.5 * math.hypot(
        u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    )


class _Builder:
    """Collects nodes and triangles balloon by balloon, bottom to top."""

    def __init__(self, stack: RoundStack, meridians: tuple[Meridian, ...], sectors: int) -> None:
        self.stack = stack
        self.sectors = sectors
        self.meridians = meridians
        # As pockets draw in, their axes follow, or the web between them would be torn.
        gaps = (p - m.edge for p, m in zip(stack.pockets, meridians, strict=True))
        self.shift = min(gaps) if stack.lobes > 1 else 0.0
        self.rest: list[Vector] = []
        self.position: list[Vector] = []
        self.lower: list[Triangle] = []
        self.upper: list[Triangle] = []
        self.web: list[Triangle] = []
        self.necks: list[Triangle] = []
        self.cavities: list[list[Triangle]] = [[] for _ in stack.axes]

    def mesh(self) -> CoarseMesh:
        z = 0.0
        discs = [self._disc(k, z, closed=True) for k in range(self.stack.lobes)]
        fixed = tuple(node for disc in discs for ring in disc for node in ring)
        roots = tuple(disc[0][0] for disc in discs)
        for k, disc in enumerate(discs):
            self._cap(k, disc, self.lower, turned=True)
        last = len(self.meridians) - 1
        for balloon, meridian in enumerate(self.meridians):
            above = z + 2 * meridian.height
            tops = [self._disc(k, above, closed=balloon == last) for k in range(self.stack.lobes)]
            edges = []
            for k, (below, top) in enumerate(zip(discs, tops, strict=True)):
                edge = self._ring(
                    k, self.stack.pockets[balloon], meridian.edge, z + meridian.height
                )
                edges.append(edge)
                self._film(k, balloon, z, below[-1], edge, up=False)
                self._film(k, balloon, z, top[-1], edge, up=True)
                if balloon < last:
                    self.necks += annulus(top[0], top[1])
            self._web(balloon, z + meridian.height, edges)
            discs, z = tops, above
        for k, disc in enumerate(discs):
            self._cap(k, disc, self.upper, turned=False)
        return CoarseMesh(
            rest=tuple(self.rest),
            position=tuple(self.position),
            lower=tuple(self.lower),
            upper=tuple(self.upper),
            web=tuple(self.web),
            necks=tuple(self.necks),
            cavities=tuple(
                (name, tuple(triangles))
                for name, triangles in zip(self.stack.chambers, self.cavities, strict=True)
            ),
            fixed=fixed,
            tip=self._tip(discs),
            roots=roots,
            poles=tuple(disc[0][0] for disc in discs),
        )

    def _node(self, flat: Point, placed: Point, z: float) -> int:
        self.rest.append((round(flat[0], 6), round(flat[1], 6), 0.0))
        self.position.append((round(placed[0], 6), round(placed[1], 6), round(z, 6)))
        return len(self.rest) - 1

    def _about(self, k: int, radius: float, degrees: float, shift: float = 0.0) -> Point:
        """A point round the axis of chamber k, the angle from the lobe's own direction."""
        x, y = self.stack.axes[k]
        out = math.atan2(y, x) if self.stack.lobes > 1 else 0.0
        turn = out + math.radians(degrees)
        return (
            x - shift * math.cos(out) + radius * math.cos(turn),
            y - shift * math.sin(out) + radius * math.sin(turn),
        )

    def _ring(self, k: int, flat: float, placed: float, z: float) -> Ring:
        return tuple(
            self._node(
                self._about(k, flat, 360 / self.sectors * i),
                self._about(k, placed, 360 / self.sectors * i, self.shift),
                z,
            )
            for i in range(self.sectors)
        )

    def _disc(self, k: int, z: float, *, closed: bool) -> tuple[Ring, ...]:
        """The rings of a neck disc, inner to outer; the base's and the cap's have a centre."""
        centre: tuple[Ring, ...] = ()
        if closed:
            middle = self._about(k, 0.0, 0.0), self._about(k, 0.0, 0.0, self.shift)
            centre = ((self._node(*middle, z),),)
        rings = (self._ring(k, r, r, z) for r in (self.stack.bore, self.stack.neck))
        return (*centre, *rings)

    def _cap(self, k: int, disc: tuple[Ring, ...], film: list[Triangle], *, turned: bool) -> None:
        (centre,), bore, neck = disc
        fan = [(a, b, centre) for a, b in zip(bore, bore[1:] + bore[:1], strict=True)]
        triangles = [*fan, *annulus(bore, neck)]
        triangles = [reverse(t) for t in triangles] if turned else triangles
        film += triangles
        self.cavities[k] += triangles

    def _film(self, k: int, balloon: int, z: float, neck: Ring, edge: Ring, *, up: bool) -> None:
        """A free film from a neck disc to the edge; the lower one looks down."""
        meridian = self.meridians[balloon]
        pocket = self.stack.pockets[balloon]
        steps = max(2, round(meridian.length / (RING_STEP * pocket)))
        rings = [neck]
        for step in range(1, steps):
            along = meridian.length * step / steps
            radius, height = meridian.point(along)
            level = z + meridian.height + (height if up else -height)
            rings.append(self._ring(k, self.stack.neck + along, radius, level))
        rings.append(edge)
        triangles = [t for a, b in zip(rings, rings[1:], strict=False) for t in annulus(a, b)]
        triangles = triangles if up else [reverse(t) for t in triangles]
        film = self.upper if up else self.lower
        film += triangles
        self.cavities[k] += triangles

    def _web(self, balloon: int, z: float, edges: list[Ring]) -> None:
        stack, meridian = self.stack, self.meridians[balloon]
        pocket, rim = stack.pockets[balloon], stack.rims[balloon]
        drawn_in = rim - (pocket - meridian.edge)
        if stack.lobes == 1:
            self.web += annulus(edges[0], self._ring(0, rim, drawn_in, z))
            return
        web = web_of(stack.lobes, (stack.radius, pocket, rim, stack.hub, stack.lumen), self.sectors)
        lumen = self._polar(web.lumen, stack.lumen, stack.lumen, z)
        junctions = self._polar(
            web.between, web.junction, web.junction * (1 - self.shift / stack.radius), z
        )
        outlines = [
            {
                i: self._node(
                    self._about(k, rim, 360 / self.sectors * i),
                    self._about(k, drawn_in, 360 / self.sectors * i, self.shift),
                    z,
                )
                for i in range(-web.reach, web.reach + 1)
            }
            for k in range(stack.lobes)
        ]
        self.web += web.triangles(edges, outlines, junctions, lumen)

    def _polar(self, angles: tuple[float, ...], flat: float, placed: float, z: float) -> Ring:
        """Nodes round the actuator's axis, angles in degrees from the first lobe's direction."""
        x, y = self.stack.axes[0]
        start = math.atan2(y, x)
        turns = [start + math.radians(angle) for angle in angles]
        return tuple(
            self._node(
                (flat * math.cos(turn), flat * math.sin(turn)),
                (placed * math.cos(turn), placed * math.sin(turn)),
                z,
            )
            for turn in turns
        )

    def _tip(self, discs: list[tuple[Ring, ...]]) -> tuple[int, ...]:
        """The cap's centres; where they are fewer than three, points of its neck rims."""
        quarter = self.sectors // 4
        if len(discs) >= 3:
            return tuple(disc[0][0] for disc in discs)
        if len(discs) == 2:
            return tuple(disc[-1][i] for disc in discs for i in (-quarter, quarter))
        return tuple(discs[0][-1][i] for i in range(0, self.sectors, quarter))


def annulus(inner: Ring, outer: Ring) -> list[Triangle]:
    """Triangles between two rings, seen counter-clockwise from above.

    Diagonals alternate, so that the mesh has no hand that would twist the actuator. So do the edges
    that triangles begin with, from which corotational elements take their axes.
    """
    triangles: list[Triangle] = []
    for i in range(len(inner)):
        j = (i + 1) % len(inner)
        a, b, c, d = inner[i], outer[i], outer[j], inner[j]
        triangles += [(a, b, c), (a, c, d)] if i % 2 == 0 else [(b, d, a), (c, d, b)]
    return triangles


def reverse(triangle: Triangle) -> Triangle:
    """Return it as seen from the other side, beginning with the same edge."""
    a, b, c = triangle
    return b, a, c
