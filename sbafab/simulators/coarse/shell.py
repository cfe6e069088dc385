"""The inflated start shape of the scenes: the paper's parabola, with a flat neck disc.

The paper's balloon is a parabola of revolution whose meridian keeps the length l of the flat
pocket's radius (paper, Eqs. 1-3). Here the parabola begins at the neck disc, which stays flat; a
neck of radius 0 gives the paper's shape. Lengths mm, volumes ul.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.rounds import RoundStack, equal_area, round_stack
from sbafab.simulators.simulator import refuse_unknown

STEEPEST = 40.0
ROUNDS = 80
SPARE = 0.95
"""Largest start volume as a share of the maximum: the edge is not yet vertical there."""


@dataclass(frozen=True)
class Meridian:
    """One film of a balloon: flat up to ``neck``, then down to height 0 at ``edge``.

    ``length`` is the meridian's length from neck to edge, ``slope`` its downward slope at the edge.
    """

    neck: float
    length: float
    slope: float

    @property
    def run(self) -> float:
        """Distance from the neck to the edge, seen from above."""
        k = self.slope
        return self.length if k == 0 else 2 * self.length / (math.hypot(1, k) + math.asinh(k) / k)

    @property
    def edge(self) -> float:
        """Radius of the bonded edge, smaller than the flat pocket's."""
        return self.neck + self.run

    @property
    def height(self) -> float:
        """Height of the neck disc over the edge; a balloon is twice as high."""
        return self.slope * self.run / 2

    @property
    def volume(self) -> float:
        """Volume of a round balloon with two such films."""
        run, neck = self.run, self.neck
        return 2 * math.pi * self.height * (neck * neck + 4 * neck * run / 3 + run * run / 2)

    def point(self, distance: float) -> tuple[float, float]:
        """Radius and height of the film ``distance`` along the meridian from the neck."""
        if self.slope == 0:
            return self.neck + distance, 0.0
        scale = self.run / (2 * self.slope)
        low, high = 0.0, self.slope
        for _ in range(ROUNDS):
            m = (low + high) / 2
            longer = scale * (m * math.hypot(1, m) + math.asinh(m)) > distance
            low, high = (low, m) if longer else (m, high)
        share = low / self.slope
        return self.neck + share * self.run, self.height * (1 - share * share)


Start = Callable[[float, float], Meridian]
"""Start shape of a pocket, from the radii of pocket and neck (mm)."""


def fullest(pocket: float, neck: float) -> Meridian:
    """The volume limit of the paper's parabola: 16.95 ul in a pocket of 5 mm.

    The volume is smaller if a wide neck leaves too little free film.
    """
    most = _holding_most(0.0, pocket).volume
    spare = SPARE * _holding_most(neck, pocket - neck).volume
    return holding(neck, pocket - neck, min(most, spare))


def standing(balloon: float) -> Start:
    """Start with balloons ``balloon`` mm high, or as high as their film allows."""

    def start(pocket: float, neck: float) -> Meridian:
        return _bisected(neck, pocket - neck, STEEPEST, lambda m: 2 * m.height < balloon)

    return start


RISE = 0.15
"""Start height in mm of a 5 mm balloon: a dome flat enough to leave the film nearly at rest."""


def nearly_flat(pocket: float, neck: float) -> Meridian:
    """A balloon that has only just risen."""
    return standing(RISE * pocket / 2.5)(pocket, neck)


def holding(neck: float, length: float, volume: float) -> Meridian:
    """The shape with this volume, or the shape with the largest volume."""
    most = _holding_most(neck, length).slope
    return _bisected(neck, length, most, lambda m: m.volume < volume)


def _bisected(
    neck: float, length: float, steepest: float, is_low: Callable[[Meridian], bool]
) -> Meridian:
    low, high = 0.0, steepest
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        if is_low(Meridian(neck, length, middle)):
            low = middle
        else:
            high = middle
    return Meridian(neck, length, high)


@cache
def _holding_most(neck: float, length: float) -> Meridian:
    low, high = 0.0, STEEPEST
    for _ in range(ROUNDS):
        third = (high - low) / 3
        a, b = low + third, high - third
        if Meridian(neck, length, a).volume < Meridian(neck, length, b).volume:
            low = a
        else:
            high = b
    return Meridian(neck, length, low)


# The web between the pockets of a lobed plate: half a sector is triangulated, then mirrored.


Triangle = tuple[int, int, int]
WebNode = tuple[str, int]
"""A node of a half sector: pocket, outline or lumen with its step, or the junction."""


@dataclass(frozen=True)
class Web:
    """Angles in degrees of the nodes round the actuator's axis, and the triangles of half a sector.

    ``reach`` is the number of steps with nodes on a lobe's outline, to either side; one node lies
    between neighbouring lobes, ``junction`` mm from the axis.
    """

    lobes: int
    reach: int
    junction: float
    half: tuple[tuple[WebNode, WebNode, WebNode], ...]

    @property
    def lumen_steps(self) -> int:
        """Steps on the lumen from a lobe's direction to the middle between two lobes."""
        return 2 if self.lobes == 2 else 1

    @property
    def lumen(self) -> tuple[float, ...]:
        count = 2 * self.lumen_steps * self.lobes
        return tuple(360 / count * i for i in range(count))

    @property
    def between(self) -> tuple[float, ...]:
        return tuple(360 / self.lobes * (k + 0.5) for k in range(self.lobes))

    def triangles(
        self,
        edges: Sequence[Sequence[int]],
        outlines: Sequence[Mapping[int, int]],
        junctions: Sequence[int],
        lumen: Sequence[int],
    ) -> list[Triangle]:
        """The web's triangles, counter-clockwise from above, from the nodes of all its edges."""
        triangles: list[Triangle] = []
        for k in range(self.lobes):
            for side in (1, -1):

                def node(place: WebNode, k: int = k, side: int = side) -> int:
                    kind, step = place
                    if kind == "pocket":
                        return edges[k][side * step % len(edges[k])]
                    if kind == "outline":
                        return outlines[k][side * step]
                    if kind == "lumen":
                        return lumen[(2 * k * self.lumen_steps + side * step) % len(lumen)]
                    return junctions[k if side > 0 else k - 1]

                for a, b, c in self.half:
                    corners = (node(a), node(b), node(c))
                    # A mirrored triangle begins with the mirrored edge.
                    triangles.append(corners if side > 0 else (corners[1], corners[0], corners[2]))
        return triangles


@cache
def web_of(lobes: int, radii: tuple[float, float, float, float, float], sectors: int) -> Web:
    """The web of a plate; radii in mm: of the chamber axes, pocket, rim, hub and lumen."""
    axis, pocket, rim, hub, lumen = radii
    half = math.pi / lobes
    step = math.tau / sectors

    def off_axis(radius: float, i: int) -> Point:
        return axis + radius * math.cos(step * i), radius * math.sin(step * i)

    junction = _junction(axis, rim, hub, half)
    x, y = junction * math.cos(half), junction * math.sin(half)
    # Drop a node within a quarter of a step of the junction.
    reach = math.floor(math.atan2(y, x - axis) / step - 0.25)
    bare = Web(lobes, reach, junction, ())
    lumen_turn = half / bare.lumen_steps
    places: dict[WebNode, Point] = {("outline", i): off_axis(rim, i) for i in range(reach + 1)}
    places["junction", 0] = x, y
    for i in range(bare.lumen_steps, -1, -1):
        places["lumen", i] = lumen * math.cos(lumen_turn * i), lumen * math.sin(lumen_turn * i)
    for i in range(sectors // 2, -1, -1):
        places["pocket", i] = off_axis(pocket, i)
    return Web(lobes, reach, junction, _triangulated(places))


def _junction(axis: float, rim: float, hub: float, half: float) -> float:
    """Return the outline's point midway between two lobes: on the hub, or where they meet."""
    apart = axis * math.sin(half)
    return hub if apart >= rim else max(hub, axis * math.cos(half) + math.sqrt(rim**2 - apart**2))


def _triangulated(places: dict[WebNode, Point]) -> tuple[tuple[WebNode, WebNode, WebNode], ...]:
    """Delaunay triangles of the polygon whose corners are given counter-clockwise."""
    import shapely

    # Corners on the axis of symmetry must lie on it exactly for the triangulation.
    names = {(round(x, 9), round(y, 9)): place for place, (x, y) in places.items()}
    polygon = shapely.Polygon(list(names))
    triangles = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        a, b, c = (names[x, y] for x, y in list(triangle.exterior.coords)[:3])
        corners = (a, b, c) if triangle.exterior.is_ccw else (a, c, b)
        first = corners.index(min(corners))
        triangles.append((corners[first], corners[first - 2], corners[first - 1]))
    return tuple(sorted(triangles))


# The coarse shell of a whole actuator: mid-surfaces that share nodes where they are bonded.
#
# Each pocket has rings of eight nodes or more at bore, neck, edge and between neck and edge; the
# web between the pockets and the neck rings are one layer of double thickness. Inlet tabs and
# strips are omitted. Lengths mm, volumes ul.


SECTORS = 8
"""Nodes per ring; a multiple of four."""
RING_STEP = 0.25
"""Distance of the rings between neck and edge, in pocket radii."""

Ring = tuple[int, ...]


@dataclass(frozen=True)
class CoarseMesh:
    """Nodes flat (``rest``) and inflated (``position``), and the triangles of every group.

    ``lower`` and ``upper`` are the free films, ``web`` and ``necks`` are bonded pairs. In each
    group an edge has at most two triangles. ``cavities`` holds one closed surface per chamber,
    normals out of the air. ``fixed`` are the nodes on the ground. ``tip`` are nodes whose mean is
    the tip and whose plane gives its tilt, counter-clockwise from above; ``roots`` and ``poles``
    are the centres of the lowest and of the highest film over each chamber axis.
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
        """Triangles of a single film."""
        return self.lower + self.upper

    @property
    def double(self) -> tuple[Triangle, ...]:
        """Triangles of two bonded films."""
        return self.web + self.necks

    @property
    def height(self) -> float:
        """Height at the inflated start."""
        return max(z for _, _, z in self.position)

    def volume(self, chamber: str) -> float:
        """Volume of the chamber's cavity at the start."""
        return enclosed(self.position, dict(self.cavities)[chamber])

    def mass(self, thickness: float, density: float) -> float:
        """True mass in kg of the films; thickness mm, density kg/m3."""
        single = sum(area(self.rest, triangle) for triangle in self.single)
        double = sum(area(self.rest, triangle) for triangle in self.double)
        return (single + 2 * double) * thickness * density * 1e-9


def coarse_mesh(stack: RoundStack, start: Start = fullest, sectors: int = SECTORS) -> CoarseMesh:
    """The mesh of a stack, inflated to the ``start`` shape of each pocket and neck radius."""
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
        # The axes follow as pockets draw in, or the web between them would tear.
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
        """The cap's centres; with fewer than three, points of its neck rims."""
        quarter = self.sectors // 4
        if len(discs) >= 3:
            return tuple(disc[0][0] for disc in discs)
        if len(discs) == 2:
            return tuple(disc[-1][i] for disc in discs for i in (-quarter, quarter))
        return tuple(discs[0][-1][i] for i in range(0, self.sectors, quarter))


def annulus(inner: Ring, outer: Ring) -> list[Triangle]:
    """Triangles between two rings, seen counter-clockwise from above.

    Diagonals alternate, so that the mesh has no handedness that would twist the actuator. The first
    edges of triangles, which set the axes of corotational elements, alternate too.
    """
    triangles: list[Triangle] = []
    for i in range(len(inner)):
        j = (i + 1) % len(inner)
        a, b, c, d = inner[i], outer[i], outer[j], inner[j]
        triangles += [(a, b, c), (a, c, d)] if i % 2 == 0 else [(b, d, a), (c, d, b)]
    return triangles


def reverse(triangle: Triangle) -> Triangle:
    """Return the triangle seen from the other side, beginning with the same edge."""
    a, b, c = triangle
    return b, a, c


# Shared by all models of an actuator: its stack, its film, the pressure of each chamber.


PRESSURE = 5.0
"""Default pressure of a chamber, kPa."""


@dataclass(frozen=True)
class CoarseActuator:
    """A stack of round balloons, the pressure in kPa of every chamber, and how it is meshed.

    ``sectors`` is the number of nodes per ring. A ring has the area of its circle if ``is_fair``,
    otherwise it is inscribed in the circle.
    """

    stack: RoundStack
    pressures: tuple[tuple[str, float], ...]
    sectors: int = SECTORS
    start: Start = fullest
    is_fair: bool = False

    @cached_property
    def mesh(self) -> CoarseMesh:
        """The coarse shell, inflated."""
        return self.mesh_from(self.start)

    def mesh_from(self, start: Start) -> CoarseMesh:
        """The coarse shell, inflated to another start."""
        ringed = equal_area(self.stack, self.sectors) if self.is_fair else self.stack
        return coarse_mesh(ringed, start, self.sectors)

    @property
    def young(self) -> float:
        """Young's modulus of the film in kPa."""
        return 1000 * self.stack.elastic[0]

    @property
    def poisson(self) -> float:
        return self.stack.elastic[1]

    @property
    def membrane(self) -> float:
        """E t of one film in kPa mm = mN/mm."""
        return self.young * self.stack.film.thickness

    def bending(self, films: int) -> float:
        """Bending stiffness of ``films`` bonded films, in mN mm."""
        return self.young * (films * self.stack.film.thickness) ** 3 / (12 * (1 - self.poisson**2))

    @cached_property
    def mass(self) -> float:
        """True mass of the films in kg, without tabs."""
        return self.mesh.mass(
            self.stack.film.thickness, density_of(self.stack.film, "a simulation")
        )

    @property
    def balloons(self) -> int:
        return len(self.stack.pockets)

    @property
    def size(self) -> float:
        """Mean pocket radius relative to the measured pocket of 5 mm."""
        return sum(self.stack.pockets) / self.balloons / 2.5

    def volumes(self, requested: Mapping[str, float] | None, default: float) -> dict[str, float]:
        """Return the air of every chamber, in ul. Raises DesignError for unknown chambers."""
        return checked(self.stack.chambers, requested, default, "volume", "ul")


def actuator(
    laminate: Laminate,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
    start: Start = fullest,
) -> CoarseActuator:
    """An actuator under pressure: 5 kPa per chamber, or given by chamber in kPa and 0 elsewhere.

    ``sectors`` is the number of nodes per ring; ``start`` the start shape of each balloon. Raises
    DesignError if the pockets are not round or not of one film, or a chamber is unknown.
    """
    stack = round_stack(laminate)
    by_chamber = checked(stack.chambers, pressures, PRESSURE, "pressure", "kPa")
    return CoarseActuator(stack, tuple(by_chamber.items()), sectors, start)


def checked(
    chambers: tuple[str, ...],
    requested: Mapping[str, float] | None,
    default: float,
    quantity: str,
    unit: str,
) -> dict[str, float]:
    """Return a value for every chamber: the default, or the requested ones and 0 for the rest."""
    if requested is None:
        return dict.fromkeys(chambers, default)
    refuse_unknown(chambers, requested, quantity)
    for name, value in requested.items():
        if not (math.isfinite(value) and value >= 0):
            raise DesignError(
                f"{quantity} of {name} = {value:g} {unit} must be 0 or more; vacuum has not "
                "been tried"
            )
    return {name: float(requested.get(name, 0.0)) for name in chambers}
