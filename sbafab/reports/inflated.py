"""Inflated actuators as surfaces, from poses of the elastic stack or as lenses around a tube.

Each balloon consists of two films revolved around its chamber's axis on the plane midway between
two plates, and sheared to the plates, which may be tilted; its meridian is the one between parallel
plates at this distance (``models.balloon``). The bonded web around the pockets follows their edges
inward.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import PlacedSba
from sbafab.design.records import Slots
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, section, strip, union
from sbafab.laminate.laminate import Inlet, Laminate
from sbafab.meshing.solid import Slab, fuse
from sbafab.meshing.surface import Surface
from sbafab.models.balloon import inflate
from sbafab.models.closed_forms import inverse
from sbafab.models.pneumatics import FLUIDS, Line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose, Stack

    Array = NDArray[np.float64]

FINE, COARSE = 56, 28  # facets of a balloon around its axis
SAGITTA = 0.02  # largest distance of the web's chords from their arc, mm
INSIDE = 0.05  # distance from the end of a tab at which its width is measured, mm
HIDDEN = 0.3  # overlap of the web into a pocket, between its films, mm
REACH = 2.5  # distance over which the inward displacement of a pocket's edge fades out, mm
LEAST_GAP = 0.02  # least opening of a balloon, mm, so that its films stay separate
SAME = 100  # pressures and gaps that agree to 1 / SAME kPa and mm share a meridian
SUCTION = 1e-3  # pressure below 0 in kPa that counts as none
FLATTEST = 0.12  # least share of its height that a film keeps under tilted plates


class InflatedPart(NamedTuple):
    """A closed surface of an inflated actuator: a chamber's balloons, or the bonded web.

    ``chamber`` is its index in the laminate, None for the web; ``normals`` (n, 3) are at the
    points.
    """

    name: str
    surface: Surface
    normals: Array
    chamber: int | None


def inflated(
    laminate: Laminate, stack: Stack, pose: Pose, around: int = FINE
) -> list[InflatedPart]:
    """Return the parts of a laminate in a pose, in mm on its base: first the web, then each
    chamber.

    Balloons have ``around`` facets around their axes, and at most half as many rings per film.
    Raises DesignError if a balloon has no equilibrium.
    """
    levels = [_Level(pose, i) for i in range(len(stack.levels))]
    meridians = _meridians(stack, pose)
    webs = _webs(laminate, stack, levels, meridians)
    parts = [InflatedPart("web", webs, _normals(webs), None)]
    for number, chamber in enumerate(laminate.chambers):
        balloons = [
            _balloon(level, stack.axes[number], meridians[i][number], around)
            for i, level in enumerate(levels)
        ]
        surface = _joined(balloons)
        parts.append(InflatedPart(chamber.name, surface, _normals(surface), number))
    return parts


class FilmMeridian(NamedTuple):
    """One film from neck to rim: radii in mm, and heights as fractions of the height to its plate.
    ``drawn`` is the inward displacement of its pocket's edge, ``pocket`` the edge's original
    radius, both in mm.
    """

    radii: Array
    shares: Array
    drawn: float
    pocket: float


class _Level:
    """The frame midway between two plates, and the distance of the plates from its plane."""

    def __init__(self, pose: Pose, i: int) -> None:
        origins, axes = pose.frames
        self.low, self.high = origins[i], origins[i + 1]
        self.normals = axes[i][:, 2], axes[i + 1][:, 2]
        self.origin = (self.low + self.high) / 2
        # The rotation nearest to the mean of both.
        u, _, v = np.linalg.svd(axes[i] + axes[i + 1])
        self.axes = u @ v

    def points(self, x: Array, y: Array, z: Array) -> Array:
        """Return points of this frame in space."""
        return np.asarray(self.origin + np.stack([x, y, z], axis=-1) @ self.axes.T)

    def heights(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the heights of the lower and upper plate over points of the plane."""
        flat = self.points(x, y, np.zeros_like(x))
        up = self.axes[:, 2]
        below, above = (
            (plate - flat) @ normal / (up @ normal)
            for plate, normal in zip((self.low, self.high), self.normals, strict=True)
        )
        return below, above


def _meridians(stack: Stack, pose: Pose) -> list[list[FilmMeridian]]:
    """Return the films of each level and chamber; equal films are computed once."""
    gaps = np.maximum(np.rint(SAME * np.asarray(pose.gaps)), round(SAME * LEAST_GAP))
    p = np.rint(SAME * np.asarray(pose.pressures))
    keys = np.stack(np.broadcast_arrays(stack.levels[:, None], p, gaps), axis=-1)
    distinct, numbers = np.unique(keys.reshape(-1, 3), axis=0, return_inverse=True)
    films: list[FilmMeridian] = []
    for kind, each in enumerate(stack.maps):
        _, p, gap = distinct[distinct[:, 0] == kind].T / SAME
        balloon, shapes = each.balloon, inflate(each.balloon, p, gap, tied=True)
        part = slice(balloon.neck_edge, balloon.edge + 1)
        shares = np.clip(shapes.z[:, part] / (gap[:, None] / 2), 0.0, 1.0)
        films += [
            FilmMeridian(r[part], share, float(balloon.pocket - r[balloon.edge]), balloon.pocket)
            for r, share in zip(shapes.r, shares, strict=True)
        ]
    return [[films[number] for number in row] for row in numbers.reshape(gaps.shape)]


def _balloon(level: _Level, axis: Array, film: FilmMeridian, around: int) -> Surface:
    """Return both films of a balloon and its necks, closed."""
    turn = np.arange(around) * (math.tau / around)
    rings = np.linspace(0, len(film.radii) - 1, min(len(film.radii), around // 2 + 1))
    ring_numbers = np.rint(rings).astype(int)
    radii = np.concatenate([[0.0], film.radii[ring_numbers]])
    shares = np.concatenate([film.shares[:1], film.shares[ring_numbers]])
    x = axis[0] + radii[:, None] * np.cos(turn)
    y = axis[1] + radii[:, None] * np.sin(turn)
    below, above = level.heights(x, y)
    at_axis = level.heights(*(np.full(1, value) for value in axis))
    sides = []
    for height, middle, sign in ((above, at_axis[1][0], 1), (below, at_axis[0][0], -1)):
        # If tilted plates would meet, the films keep a little height.
        clipped = sign * np.maximum(sign * height, FLATTEST * abs(middle))
        sides.append(level.points(x, y, shares[:, None] * clipped))
    rows = len(radii)
    # Down over the upper film, around the shared rim, and back under the lower film.
    points = np.concatenate([sides[0], sides[1][-2::-1]]).reshape(-1, 3)
    k, j = np.meshgrid(np.arange(2 * rows - 2), np.arange(around), indexing="ij")
    a, b = k * around + j, k * around + (j + 1) % around
    c, d = a + around, b + around
    # The first and the last ring are one point each, on the axis.
    number = np.clip(np.arange(len(points)) - (around - 1), 0, len(points) - 2 * around + 1)
    upper, lower = np.stack([a, c, b], -1)[1:], np.stack([b, c, d], -1)[:-1]
    faces = number[np.concatenate([upper, lower]).reshape(-1, 3)]
    return Surface(points[around - 1 : len(points) - around + 1], faces)


def _webs(
    laminate: Laminate, stack: Stack, levels: Sequence[_Level], films: list[list[FilmMeridian]]
) -> Surface:
    """Return the bonded web around the pockets of every level, as a plate of two films."""
    by_region: dict[Region, Surface] = {}
    webs = []
    for i, (level, level_films) in enumerate(zip(levels, films, strict=True)):
        region = _web(laminate, stack, i)
        thick = laminate.tpe_layers[0].film.thickness * 2
        if region not in by_region:
            by_region[region] = fuse([Slab(region, -thick / 2, thick / 2)], SAGITTA)
        flat = by_region[region]
        x, y, z = flat.points.T
        moved = np.zeros((len(x), 2))
        for axis, film in zip(stack.axes, level_films, strict=True):
            off = np.column_stack([x, y]) - axis
            away = np.hypot(*off.T)
            fade = np.exp(-np.maximum(away - film.pocket, 0.0) / REACH)
            moved -= film.drawn * fade[:, None] * off / np.maximum(away, 1e-9)[:, None]
        webs.append(Surface(level.points(x + moved[:, 0], y + moved[:, 1], z), flat.faces))
    return _joined(webs)


def _web(laminate: Laminate, stack: Stack, i: int) -> Region:
    """Return the plate of a level without its pockets and ears; the lowest includes inlet tabs."""
    plate = union([layer.profile for layer in laminate.tpe_layers[2 * i : 2 * i + 2]])
    if laminate.registration == "ears":
        tabs = [plate & tab for inlet in laminate.inlets for tab in _tab(plate, inlet)]
        plate = union([plate & laminate.outline, *tabs])
    radius = stack.maps[stack.levels[i]].balloon.pocket - HIDDEN
    return plate - union(disc((float(x), float(y)), radius) for x, y in stack.axes)


def _tab(plate: Region, inlet: Inlet) -> Iterator[Region]:
    """Yield the straight strip from the axis to an inlet's mouth, with the width of the plate
    there.

    Only the films of the bottom balloon have tabs.
    """
    (x, y), (u, v) = inlet.mouth, inlet.direction
    end, long = (x - INSIDE * u, y - INSIDE * v), math.hypot(x, y)
    for low, high in section(plate, end, (-v, u)):
        if low < 0 < high:
            yield strip((x - long * u, y - long * v), inlet.mouth, high - low)


def _joined(surfaces: Sequence[Surface]) -> Surface:
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    faces = [surface.faces + start for surface, start in zip(surfaces, starts[:-1], strict=True)]
    return Surface(np.concatenate([s.points for s in surfaces]), np.concatenate(faces))


def _normals(surface: Surface) -> Array:
    """Return the unit normals (n, 3) of the points: area-weighted means of their faces."""
    a, b, c = surface.points.take(surface.faces.T, axis=0)
    of_faces = np.cross(b - a, c - a)
    normals = np.zeros_like(surface.points)
    for corner in range(3):
        np.add.at(normals, surface.faces[:, corner], of_faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return normals


def pressed(stack: Stack, volumes_ul: Sequence[float]) -> Pose:
    """Return the pose at these chamber volumes in ul, found by solving for the pressures.

    Raises DesignError for volumes that need suction or more than the stack's highest pressure.
    """
    volumes = np.asarray(volumes_ul, dtype=float)
    if volumes.shape != (stack.chambers,) or not (np.isfinite(volumes) & (volumes >= 0)).all():
        raise DesignError(
            f"volumes must be {stack.chambers} numbers in ul, at least 0, one per chamber"
        )
    motion = stack.motion(line=Line(FLUIDS["water"]))
    remedy = "volumes that lie nearer together" if np.ptp(volumes) > 0 else ""
    try:
        pose = motion.step(1.0, flows=(volumes - motion.pose.volumes).tolist())
    except DesignError:
        needed = f"more than {stack.most_pressure:g}"
        remedy = f"less, or {remedy}" if remedy else "less"
    else:
        if min(pose.pressures) > -SUCTION:
            return pose
        needed, remedy = ", ".join(f"{p:.3g}" for p in pose.pressures), remedy or "more"
    target = ", ".join(f"{v:.4g}" for v in volumes)
    raise DesignError(
        f"the volumes {target} ul are out of range: they need {needed} kPa; give {remedy}"
    )


# The balloons of an inflated radial actuator as a surface, for display.


ACROSS, ALONG = 13, 17


def gripping(placed: PlacedSba, deflated: float, height: float) -> Surface:
    """Return balloons ``height`` mm high on the tangents of their tube, in the part's frame.

    ``deflated`` is the diameter in mm over the flat films. In cross-section a film is an arc that
    keeps its pocket's width (the lens of ``models.closed_forms``); toward the pocket's round ends
    the lens shrinks with its chord.
    """
    pockets = placed.made.design.form.pockets
    assert isinstance(pockets, Slots)
    laminate, radius = placed.made.laminate, placed.radius or 0.0
    lens = _lens(pockets, height)
    aside, along, up = lens.points.T
    balloons = []
    for chamber in laminate.chambers:
        for middle in dict.fromkeys(chamber.centres):
            ((x, y, _),) = placed.turned(np.array([[*middle, 0.0]]))
            angle = x / radius if radius else 0.0
            cos, sin = math.cos(angle), math.sin(angle)
            for level in range(laminate.balloons):
                out = deflated / 2 + (level + 0.5) * height + up
                points = [out * cos - aside * sin, out * sin + aside * cos, along + y]
                balloons.append(Surface(np.column_stack(points), lens.faces))
    return _joined(balloons)


def _lens(pockets: Slots, height: float) -> Surface:
    """One balloon about its middle: x across, y along, z up; both films, with separate rims."""
    rise = np.array(height / pockets.width)
    half = float(inverse(lambda b: 2 * np.sin(b / 2) ** 2 / np.maximum(b, 1e-9), rise, math.pi / 2))
    bow = pockets.width / (2 * half)
    long = pockets.run + pockets.width
    t = np.linspace(-1.0, 1.0, ALONG)
    # Denser towards the ends, which are round.
    y = long / 2 * np.sin(t * math.pi / 2)
    beyond = np.maximum(np.abs(y) - pockets.run / 2, 0.0) / (pockets.width / 2)
    share = np.sqrt(np.maximum(1.0 - beyond**2, 0.0))
    u = np.linspace(-half, half, ACROSS)
    sheets = []
    for side in (1, -1):
        x = bow * np.sin(u) * share[:, None]
        z = side * bow * (np.cos(u) - math.cos(half)) * share[:, None]
        sheets.append(np.stack([x, np.broadcast_to(y[:, None], x.shape), z], -1).reshape(-1, 3))
    i, j = np.meshgrid(np.arange(ALONG - 1), np.arange(ACROSS - 1), indexing="ij")
    a = (i * ACROSS + j).ravel()
    b, c, d = a + 1, a + ACROSS, a + ACROSS + 1
    upper = np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    lower = upper[:, ::-1] + ALONG * ACROSS
    return Surface(np.concatenate(sheets), np.concatenate([upper, lower]))
