"""The shell for simulators, and the coarse shell of a stack of round pockets: mid-surfaces that
share nodes where bonded.

Each round pocket has rings of nodes at bore, neck, edge and between neck and edge; the web between
the pockets and the neck rings are one layer of double thickness. Inlet tabs and strips are omitted.
Lengths mm, volumes ul.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import disc
from sbafab.laminate.films import Film, density_of
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.meshing.surface import Floats, Ints, Surface
from sbafab.models.closed_forms import last_positive

Triangles = Ints
"""Node numbers (k, 3), counter-clockwise seen from outside."""
Ring = Ints


class FilmGroup(NamedTuple):
    """Triangles of one stiffness: E t in mN/mm of a membrane, or bending stiffness in mN mm."""

    name: str
    triangles: Triangles
    stiffness: float
    poisson: float


@dataclass(frozen=True, eq=False)
class Shell:
    """Nodes (n, 3) at ``rest`` (flat) and at the start (``position``), and the films on them.

    ``membranes`` partition all triangles; in a group of ``bending`` an edge has at most two.
    ``cavities`` are closed surfaces by chamber, with normals away from the air. ``fixed`` nodes do
    not move; the plane of the ``tip`` nodes, counter-clockwise from above, gives its tilt. ``mass``
    is the true mass in kg, ``size`` the largest pocket radius over 2.5 mm, ``about`` a sentence on
    the mesh. ``roots`` and ``poles`` are the centres of the lowest and of the highest film over
    each axis of round pockets.
    """

    rest: Floats
    position: Floats
    membranes: tuple[FilmGroup, ...]
    bending: tuple[FilmGroup, ...]
    cavities: Mapping[str, Triangles]
    fixed: Ring
    tip: Ring
    roots: Ring
    poles: Ring
    mass: float = 0.0
    size: float = 1.0
    about: str = ""

    @property
    def triangles(self) -> Triangles:
        """The triangles of all films."""
        return np.concatenate([group.triangles for group in self.membranes])

    @property
    def height(self) -> float:
        """The initial height in mm."""
        return float(self.position[:, 2].max())

    def volume(self, chamber: str, nodes: Floats | None = None) -> float:
        """The volume of the chamber's cavity at the start, or with other positions of the nodes."""
        points = self.position if nodes is None else nodes
        return Surface(points, self.cavities[chamber]).volume


def areas(points: Floats, triangles: Triangles) -> Floats:
    a, b, c = points[triangles].transpose(1, 0, 2)
    sizes: Floats = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return sizes


# Round pockets on their axes, taken from a laminate's profiles.


ON_AXIS = 1e-6
SUPPORTED = "the coarse shell is made for stacks of round pockets on common plates"
NECK_SHARE, BORE_SHARE = 0.5, 0.2
"""Neck ring and bore of the paper's 5 mm pocket, for a single balloon, which lacks both."""


@dataclass(frozen=True)
class RoundStack:
    """A stack of round balloons; radii in mm.

    ``pockets`` and ``rims`` (pocket and outline) are given by balloon, bottom to top; ``axes`` by
    chamber; ``hub`` is the outline's radius between two lobes, ``lumen`` the radius of the hole in
    the films; both are 0 for a single axis.
    """

    name: str
    chambers: tuple[str, ...]
    axes: tuple[Point, ...]
    pockets: tuple[float, ...]
    rims: tuple[float, ...]
    neck: float
    bore: float
    hub: float
    lumen: float
    film: Film

    @property
    def radius(self) -> float:
        """The distance of the chamber axes from the actuator's."""
        return math.hypot(*self.axes[0])

    @property
    def lobes(self) -> int:
        return len(self.axes)

    @property
    def balloons(self) -> int:
        return len(self.pockets)

    @property
    def size(self) -> float:
        """The mean pocket radius relative to the measured pocket of 5 mm."""
        return sum(self.pockets) / self.balloons / 2.5

    @property
    def young(self) -> float:
        """Young's modulus of the film in kPa."""
        return 1000 * elastic_of(self.film)[0]

    @property
    def poisson(self) -> float:
        return elastic_of(self.film)[1]

    @property
    def membrane(self) -> float:
        """E t of one film in kPa mm = mN/mm."""
        return self.young * self.film.thickness

    def bending(self, films: int) -> float:
        """Return the bending stiffness of ``films`` bonded films, in mN mm."""
        return self.young * (films * self.film.thickness) ** 3 / (12 * (1 - self.poisson**2))

    def with_fair_rings(self, sectors: int) -> RoundStack:
        """Return the stack with rings of ``sectors`` corners that have the area of these circles.

        An inscribed octagon would have 10 % less area than the pocket.
        """
        grown = math.sqrt(math.tau / sectors / math.sin(math.tau / sectors))
        return replace(
            self,
            pockets=tuple(grown * radius for radius in self.pockets),
            rims=tuple(grown * radius for radius in self.rims),
            neck=grown * self.neck,
            bore=grown * self.bore,
        )


def round_stack(laminate: Laminate) -> RoundStack:
    """Return the stack of a laminate. Raises DesignError if its pockets are not round."""
    if any(layer.role == "sheet" for layer in laminate.layers):
        raise DesignError(
            f"{SUPPORTED}; the pockets of {laminate.name} lie on a sheet and need the conforming "
            "shell mesh"
        )
    if not laminate.chambers:
        raise DesignError(f"{SUPPORTED}; {laminate.name} has no chamber")
    films = sorted({layer.film.material for layer in laminate.tpe_layers})
    if len(films) > 1:
        raise DesignError(
            f"{SUPPORTED} of one film; {laminate.name} has films of {', '.join(films)} and needs "
            "the conforming shell mesh"
        )
    film = laminate.tpe_layers[0].film
    elastic_of(film)
    axes = tuple(chamber.centres[0] for chamber in laminate.chambers)
    rooms = [gap for gap in laminate.interfaces if gap.kind == "chamber"]
    necks = [gap for gap in laminate.interfaces if gap.kind == "separator"]
    first = axes[0]
    pockets = tuple(_pocket(gap, first) for gap in rooms)
    rims = tuple(_rim(gap, first, pocket) for gap, pocket in zip(rooms, pockets, strict=True))
    neck, bore = NECK_SHARE * pockets[0], BORE_SHARE * pockets[0]
    if necks:
        neck = min(_hole(gap.mask.holes, first, gap) for gap in necks)
        bore = max(_hole(gap.below.profile.holes, first, gap) for gap in necks)
    lumen = hub = 0.0
    if laminate.lumen is not None:
        lumen = max(_hole(gap.below.profile.holes, (0.0, 0.0), gap) for gap in rooms)
    if len(axes) > 1:
        radius, between = math.hypot(*first), math.cos(math.pi / len(axes))
        hub = max(lumen + rims[0] - pockets[0], radius - min(pockets), radius * between)
    names = tuple(chamber.name for chamber in laminate.chambers)
    return RoundStack(laminate.name, names, axes, pockets, rims, neck, bore, hub, lumen, film)


def elastic_of(film: Film, needed_by: str = "a simulation") -> tuple[float, float]:
    """Return Young's modulus in MPa and Poisson's ratio. Raises DesignError if they are unknown."""
    if film.elastic is None:
        raise DesignError(
            f"{needed_by} needs Young's modulus of {film.material}; add "
            f"films.{film.material.lower()}.modulus, in MPa, and poisson, its ratio"
        )
    return film.elastic


def pocket_radii(laminate: Laminate) -> list[float]:
    """Return half the least width of every pocket, in mm."""
    radii = []
    for gap in laminate.interfaces:
        if gap.kind == "chamber":
            # Seams bound a chamber without a mask.
            for contour in (gap.mask if gap.masks else gap.unbonded).outers:
                low_x, bottom, right, top = contour.bounds
                radii.append(min(right - low_x, top - bottom) / 2)
    return radii


def why_not_round(laminate: Laminate) -> str | None:
    """Return the reason why a laminate has no coarse shell, or None."""
    try:
        round_stack(laminate)
    except DesignError as reason:
        return str(reason)
    return None


def _pocket(gap: Interface, axis: Point) -> float:
    radius = _radius_about(gap.mask.outers, axis)
    bore = max(_radii_on(gap.mask.holes, axis), default=0.0)
    if radius is None or (disc(axis, radius) - gap.mask - disc(axis, bore + ON_AXIS)).area > 1e-4:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; the pocket below layer {gap.above.index} at x {x:.3f}, y {y:.3f} is "
            "drawn otherwise: use a chamber.diameter in place of chamber.outline"
        )
    return radius


def _rim(gap: Interface, axis: Point, pocket: float) -> float:
    radius = _radius_about(gap.contact.outers, axis)
    if radius is None or radius <= pocket:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; the outline of layer {gap.above.index} at x {x:.3f}, y {y:.3f} does "
            "not run around its pocket"
        )
    return radius


def _radius_about(contours: Iterable[Contour], axis: Point) -> float | None:
    """The predominant radius of arcs about an axis; lobes and tabs leave only part of a circle."""
    turned: dict[float, float] = {}
    for edge in (edge for contour in contours for edge in contour.edges):
        if isinstance(edge, Arc) and math.dist(edge.centre, axis) < ON_AXIS:
            radius = round(edge.radius, 6)
            turned[radius] = turned.get(radius, 0.0) + abs(edge.sweep)
    return max(turned, key=lambda r: (turned[r], r)) if turned else None


def _radii_on(holes: Iterable[Contour], axis: Point) -> list[float]:
    circles = [hole.circle for hole in holes if hole.circle is not None]
    return [radius for centre, radius in circles if math.dist(centre, axis) < ON_AXIS]


def _hole(holes: Iterable[Contour], axis: Point, gap: Interface) -> float:
    radius = max(_radii_on(holes, axis), default=None)
    if radius is None:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; interface {gap.index} has no round hole at x {x:.3f}, y {y:.3f}"
        )
    return radius


# The inflated start: the paper's parabola, with a flat neck disc.
#
# The paper's balloon is a parabola of revolution whose meridian keeps the length l of the flat
# pocket's radius (paper, Eqs. 1-3). Here the parabola begins at the neck disc, which stays flat; a
# neck of radius 0 gives the paper's shape.


STEEPEST = 40.0
SPARE = 0.95
"""Largest start volume as a share of the maximum: the edge is not yet vertical there."""
RISE = 0.15
"""Start height in mm of a 5 mm balloon: a dome flat enough to leave the film nearly at rest."""


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
        """The distance from the neck to the edge in plan view."""
        k = self.slope
        return self.length if k == 0 else 2 * self.length / (math.hypot(1, k) + math.asinh(k) / k)

    @property
    def edge(self) -> float:
        """The radius of the bonded edge, smaller than the flat pocket's."""
        return self.neck + self.run

    @property
    def height(self) -> float:
        """The height of the neck disc over the edge; a balloon is twice as high."""
        return self.slope * self.run / 2

    @property
    def volume(self) -> float:
        """The volume of a round balloon with two such films."""
        run, neck = self.run, self.neck
        return 2 * math.pi * self.height * (neck * neck + 4 * neck * run / 3 + run * run / 2)

    def point(self, distance: float) -> tuple[float, float]:
        """Return radius and height of the film at ``distance`` along the meridian from the neck."""
        if self.slope == 0:
            return self.neck + distance, 0.0
        scale = self.run / (2 * self.slope)

        def short(m: float) -> float:
            return distance - scale * (m * math.hypot(1, m) + math.asinh(m))

        share = last_positive(short, 0.0, self.slope) / self.slope
        return self.neck + share * self.run, self.height * (1 - share * share)


Start = Callable[[float, float], Meridian]
"""Start shape of a pocket, from the radii of pocket and neck (mm)."""


def fullest(pocket: float, neck: float) -> Meridian:
    """Return the volume limit of the paper's parabola: 16.95 ul in a pocket of 5 mm.

    The volume is smaller if a wide neck leaves too little free film.
    """
    most = _holding_most(0.0, pocket).volume
    spare = SPARE * _holding_most(neck, pocket - neck).volume
    return holding(neck, pocket - neck, min(most, spare))


def nearly_flat(pocket: float, neck: float) -> Meridian:
    """Return a balloon that has only just risen."""
    length = pocket - neck
    half = RISE * pocket / 2.5 / 2
    slope = last_positive(lambda k: half - Meridian(neck, length, k).height, 0.0, STEEPEST)
    return Meridian(neck, length, slope)


def holding(neck: float, length: float, volume: float) -> Meridian:
    """Return the shape with this volume, or the shape with the largest volume."""
    most = _holding_most(neck, length).slope
    slope = last_positive(lambda k: volume - Meridian(neck, length, k).volume, 0.0, most)
    return Meridian(neck, length, slope)


@cache
def _holding_most(neck: float, length: float) -> Meridian:
    low, high = 0.0, STEEPEST
    for _ in range(80):
        third = (high - low) / 3
        a, b = low + third, high - third
        rises = Meridian(neck, length, a).volume < Meridian(neck, length, b).volume
        low, high = (a, high) if rises else (low, b)
    return Meridian(neck, length, low)


# The web between the pockets of a lobed plate: half a sector is triangulated, then mirrored.


class Web(NamedTuple):
    """Half a sector of a plate's web, from the direction of a lobe to the middle between two.

    Its nodes in order: the ``junction`` mm from the axis, where two lobes meet; on the lumen at
    ``lumen_steps`` + 1 places; on the lobe's outline at ``reach`` + 1; on half the pocket's edge.
    """

    junction: float
    lumen_steps: int
    reach: int
    half: Triangles


@cache
def web_of(
    lobes: int, axis: float, pocket: float, rim: float, hub: float, lumen: float, sectors: int
) -> Web:
    """Return the web of a plate; radii in mm: of the chamber axes, pocket, rim, hub and lumen."""
    half, step = math.pi / lobes, math.tau / sectors
    apart = axis * math.sin(half)
    # Midway between two lobes the outline is on the hub, or where they meet.
    meeting = 0.0 if apart >= rim else axis * math.cos(half) + math.sqrt(rim**2 - apart**2)
    junction = max(hub, meeting)
    x, y = junction * math.cos(half), junction * math.sin(half)
    # Drop a node within a quarter of a step of the junction.
    reach = math.floor(math.atan2(y, x - axis) / step - 0.25)
    steps = 2 if lobes == 2 else 1

    def ring(radius: float, middle: float, turn: float, count: int) -> list[Point]:
        angles = [turn * i for i in range(count + 1)]
        return [(middle + radius * math.cos(a), radius * math.sin(a)) for a in angles]

    on_lumen = ring(lumen, 0.0, half / steps, steps)
    on_rim, on_pocket = ring(rim, axis, step, reach), ring(pocket, axis, step, sectors // 2)
    places = [(x, y), *on_lumen, *on_rim, *on_pocket]
    numbers = {(round(px, 9), round(py, 9)): n for n, (px, py) in enumerate(places)}
    corners = [*on_rim, (x, y), *on_lumen[::-1], *on_pocket[::-1]]
    return Web(junction, steps, reach, _triangulated(corners, numbers))


def _triangulated(corners: Iterable[Point], numbers: dict[Point, int]) -> Triangles:
    """Return Delaunay triangles of the polygon with these corners, counter-clockwise, sorted."""
    import shapely

    # Corners on the axis of symmetry must lie on it exactly for the triangulation.
    polygon = shapely.Polygon([(round(x, 9), round(y, 9)) for x, y in corners])
    triangles = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        a, b, c = (numbers[x, y] for x, y in list(triangle.exterior.coords)[:3])
        turned = [a, b, c] if triangle.exterior.is_ccw else [a, c, b]
        triangles.append(np.roll(turned, -turned.index(min(turned))).tolist())
    return np.array(sorted(triangles))


# The shell of a whole actuator.


SECTORS = 8
"""Nodes per ring; a multiple of four."""
RING_STEP = 0.25
"""Distance of the rings between neck and edge, in pocket radii."""
FILMS = {"bend_lower": 1, "bend_upper": 1, "bend_web": 2, "bend_neck": 2}
"""Groups of the coarse shell's triangles, and the number of films bonded in each."""


def node_masses(shell: Shell, film: Film) -> Floats:
    """The true mass (n,) in kg of each node of a coarse shell: a third of each triangle's."""
    masses = np.zeros(len(shell.rest))
    dense = density_of(film, "a simulation")
    for group in shell.bending:
        weight = FILMS[group.name] * film.thickness * dense * 1e-9
        of_each = areas(shell.rest, group.triangles) / 3 * weight
        np.add.at(masses, group.triangles, of_each[:, None])
    return masses


def coarse_shell(
    stack: RoundStack, sectors: int = SECTORS, start: Start = fullest, is_fair: bool = False
) -> Shell:
    """Return the shell of a stack, inflated to the ``start`` shape of each pocket and neck radius.

    ``sectors`` is the number of nodes per ring. A ring has the area of its circle if ``is_fair``,
    otherwise it is inscribed in the circle.
    """
    meshed = stack.with_fair_rings(sectors) if is_fair else stack
    meridians = [start(pocket, meshed.neck) for pocket in meshed.pockets]
    shell = _Builder(meshed, meridians, sectors).shell()
    balloon_ul = shell.volume(stack.chambers[0]) / stack.balloons
    return replace(
        shell,
        mass=float(node_masses(shell, stack.film).sum()),
        size=max(stack.pockets) / 2.5,
        about=(
            f"{len(shell.rest)} nodes, {len(shell.triangles)} triangles; rings of {sectors} "
            "corners have the area of\nthe circles. It starts "
            f"{shell.height:.4g} mm high ({balloon_ul:.3g} ul a balloon). Inlet tabs and strips "
            "are left out."
        ),
    )


class _Builder:
    """Collects nodes and triangles balloon by balloon, bottom to top."""

    def __init__(self, stack: RoundStack, meridians: list[Meridian], sectors: int) -> None:
        self.stack, self.sectors, self.meridians = stack, sectors, meridians
        # The axes follow as pockets draw in, or the web between them would tear.
        gaps = (p - m.edge for p, m in zip(stack.pockets, meridians, strict=True))
        self.shift = min(gaps) if stack.lobes > 1 else 0.0
        self.rest: list[Floats] = []
        self.position: list[Floats] = []
        self.count = 0
        self.films: dict[str, list[Triangles]] = {
            name: [np.empty((0, 3), dtype=np.int64)] for name in FILMS
        }
        self.cavities: list[list[Triangles]] = [[] for _ in stack.axes]

    def shell(self) -> Shell:
        lobes, last = range(self.stack.lobes), len(self.meridians) - 1
        z = 0.0
        base = discs = [self._disc(k, z, closed=True) for k in lobes]
        for k, disc_rings in enumerate(base):
            self._wall(k, "bend_lower", reverse(_cap(disc_rings)))
        for balloon, meridian in enumerate(self.meridians):
            middle, above = z + meridian.height, z + 2 * meridian.height
            tops = [self._disc(k, above, closed=balloon == last) for k in lobes]
            edges = []
            for k in lobes:
                edge = self._ring(k, self.stack.pockets[balloon], meridian.edge, middle)
                edges.append(edge)
                film = self._film(k, balloon, middle, -1, discs[k][-1], edge)
                self._wall(k, "bend_lower", reverse(film))
                self._wall(k, "bend_upper", self._film(k, balloon, middle, 1, tops[k][-1], edge))
                if balloon < last:
                    self.films["bend_neck"].append(annulus(*tops[k]))
            self.films["bend_web"].append(self._web(balloon, middle, edges))
            discs, z = tops, above
        for k, disc_rings in enumerate(discs):
            self._wall(k, "bend_upper", _cap(disc_rings))
        return self._finished(base, discs)

    def _finished(self, base: list[list[Ring]], discs: list[list[Ring]]) -> Shell:
        stack, nu = self.stack, self.stack.poisson
        films = {name: np.concatenate(parts) for name, parts in self.films.items()}
        lower, upper, web, neck = films.values()
        single, double = np.concatenate([lower, upper]), np.concatenate([web, neck])
        cavities = map(np.concatenate, self.cavities)
        return Shell(
            np.concatenate(self.rest).round(6),
            np.concatenate(self.position).round(6),
            (
                FilmGroup("membrane1", single, stack.membrane, nu),
                FilmGroup("membrane2", double, 2 * stack.membrane, nu),
            ),
            tuple(
                FilmGroup(name, triangles, stack.bending(FILMS[name]), nu)
                for name, triangles in films.items()
                if len(triangles)
            ),
            dict(zip(stack.chambers, cavities, strict=True)),
            fixed=np.concatenate([ring for rings in base for ring in rings]),
            tip=self._tip(discs),
            roots=np.array([rings[0][0] for rings in base]),
            poles=np.array([rings[0][0] for rings in discs]),
        )

    def _wall(self, k: int, film: str, triangles: Triangles) -> None:
        self.films[film].append(triangles)
        self.cavities[k].append(triangles)

    def _nodes(self, flat: Floats, placed: Floats, z: float) -> Ring:
        """Return numbers of new nodes at flat positions (k, 2), raised to others at a height."""
        self.rest.append(np.column_stack([flat, np.zeros(len(flat))]))
        self.position.append(np.column_stack([placed, np.full(len(placed), z)]))
        self.count += len(flat)
        return np.arange(self.count - len(flat), self.count)

    def _ring(
        self, k: int, flat: float, placed: float, z: float, steps: Iterable[int] | None = None
    ) -> Ring:
        """Return nodes around the axis of chamber k, by steps from the lobe's own direction."""
        axis = np.array(self.stack.axes[k])
        out = math.atan2(axis[1], axis[0]) if self.stack.lobes > 1 else 0.0
        numbers = range(self.sectors) if steps is None else steps
        turns = out + math.tau / self.sectors * np.array(list(numbers))
        ways = np.column_stack([np.cos(turns), np.sin(turns)])
        moved = axis - self.shift * np.array([math.cos(out), math.sin(out)])
        return self._nodes(axis + flat * ways, moved + placed * ways, z)

    def _round(self, count: int, offset: float, flat: float, placed: float, z: float) -> Ring:
        """``count`` nodes around the actuator's axis, the first ``offset`` steps past a lobe."""
        x, y = self.stack.axes[0]
        turns = math.atan2(y, x) + math.tau / count * (np.arange(count) + offset)
        ways = np.column_stack([np.cos(turns), np.sin(turns)])
        return self._nodes(flat * ways, placed * ways, z)

    def _disc(self, k: int, z: float, *, closed: bool) -> list[Ring]:
        """The rings of a neck disc, inner to outer; the base's and the cap's have a centre."""
        centre = [self._ring(k, 0.0, 0.0, z, [0])] if closed else []
        return [*centre, *(self._ring(k, r, r, z) for r in (self.stack.bore, self.stack.neck))]

    def _film(
        self, k: int, balloon: int, middle: float, way: int, neck: Ring, edge: Ring
    ) -> Triangles:
        """Add a free film from a neck disc to the edge at height ``middle``, above or below it."""
        meridian = self.meridians[balloon]
        steps = max(2, round(meridian.length / (RING_STEP * self.stack.pockets[balloon])))
        rings = [neck]
        for step in range(1, steps):
            along = meridian.length * step / steps
            radius, height = meridian.point(along)
            rings.append(self._ring(k, self.stack.neck + along, radius, middle + way * height))
        rings.append(edge)
        return np.concatenate([annulus(a, b) for a, b in zip(rings, rings[1:], strict=False)])

    def _web(self, balloon: int, z: float, edges: list[Ring]) -> Triangles:
        stack, meridian = self.stack, self.meridians[balloon]
        pocket, rim = stack.pockets[balloon], stack.rims[balloon]
        drawn_in = rim - (pocket - meridian.edge)
        if stack.lobes == 1:
            return annulus(edges[0], self._ring(0, rim, drawn_in, z))
        web = web_of(stack.lobes, stack.radius, pocket, rim, stack.hub, stack.lumen, self.sectors)
        lumen = self._round(2 * web.lumen_steps * stack.lobes, 0.0, stack.lumen, stack.lumen, z)
        closer = web.junction * (1 - self.shift / stack.radius)
        junctions = self._round(stack.lobes, 0.5, web.junction, closer, z)
        steps = range(-web.reach, web.reach + 1)
        outlines = [self._ring(k, rim, drawn_in, z, steps) for k in range(stack.lobes)]
        triangles = []
        for k, (edge, outline) in enumerate(zip(edges, outlines, strict=True)):
            for side in (1, -1):
                on_lumen = 2 * k * web.lumen_steps + side * np.arange(web.lumen_steps + 1)
                nodes = [
                    junctions[[k if side > 0 else k - 1]],
                    lumen[on_lumen % len(lumen)],
                    outline[web.reach + side * np.arange(web.reach + 1)],
                    edge[side * np.arange(len(edge) // 2 + 1) % len(edge)],
                ]
                corners = np.concatenate(nodes)[web.half]
                triangles.append(corners if side > 0 else reverse(corners))
        return np.concatenate(triangles)

    def _tip(self, discs: list[list[Ring]]) -> Ring:
        """Return the cap's centres; with fewer than three, points of its neck rims."""
        quarter = self.sectors // 4
        if len(discs) >= 3:
            return np.array([rings[0][0] for rings in discs])
        if len(discs) == 2:
            return np.array([rings[-1][i] for rings in discs for i in (-quarter, quarter)])
        return discs[0][-1][::quarter]


def _cap(rings: list[Ring]) -> Triangles:
    """Add triangles of a closed neck disc, seen counter-clockwise from above."""
    (centre,), bore, neck = rings
    fan = np.column_stack([bore, np.roll(bore, -1), np.full(len(bore), centre)])
    return np.concatenate([fan, annulus(bore, neck)])


def annulus(inner: Ring, outer: Ring) -> Triangles:
    """Return triangles between two rings, seen counter-clockwise from above.

    Diagonals alternate, so that the mesh has no handedness that would twist the actuator. The first
    edges of triangles, which set the axes of corotational elements, alternate too.
    """
    a, b, c, d = inner, outer, np.roll(outer, -1), np.roll(inner, -1)
    even = np.column_stack([a, b, c, a, c, d])
    odd = np.column_stack([b, d, a, c, d, b])
    return np.where(np.arange(len(a))[:, None] % 2 == 0, even, odd).reshape(-1, 3)


def reverse(triangles: Triangles) -> Triangles:
    """Return the triangles seen from the other side, starting with the same edge."""
    return triangles[:, [1, 0, 2]]
