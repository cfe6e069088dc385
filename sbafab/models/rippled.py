"""Free balloons with wide pockets, whose films wrinkle in step with the rim's ripples.

``balloon`` holds the pocket's edge while its rim ripples, and averages the films' wrinkles. Where
a pocket is wide beside its ring, CalculiX shows films whose waves fall in step with the rim's, and
an edge that moves with them. ``rippled`` resolves those waves (``rim_modes``): nothing is
averaged, nothing fitted. Rims stay level as a whole. Lengths mm, pressures kPa, volumes ul.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes, inflate, ripples_at
from sbafab.models.least_energy import NoEquilibrium, equilibrium
from sbafab.models.rim_modes import EDGE, PLACES, UP, R, Waves, Waving, Z

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from sbafab.models.film_elements import Array

WIDE = 4.0
"""Ring widths in a pocket's radius from which on films fall in step with the rim: strokes of
narrower ones are within 0.5 % with either model.
"""
START = 0.0005
"""Film strain, p R / (E t), at which ripples are first followed: they come from 0.001 on."""
USUAL = 0.013
"""Film strain at which the number of waves is chosen, where none is given."""
END = 0.256
"""Film strain from which on films are stretched so far that waves make no difference."""
STEP = 2.0
"""Ratio of the pressures of two rungs, along which ripples are continued."""
SEED = 0.02
"""Initial tilt in rad of a level rim."""
LEVEL = 0.001
"""Tilt in rad below which a rim does not ripple."""
KICK = 0.02
"""Share of the radius by which films are pushed in step with the rim, as a trial."""
CLEARLY = 1e-5
"""Relative gain of energy from which on a balloon counts as in step."""
LATEST = 0.02
"""Film strain up to which films fall in step, if ever."""
ALIKE = 0.9
"""Cosine of the angle between waves that belong to one branch."""
TAUT = 1.4
"""Height over the free one at which waves are pulled straight."""
NUDGE = 1e-3
"""Relative step of the finite differences by pressure."""
HALVINGS = 3
"""Times that a step between rungs is halved where it finds no equilibrium."""


class Rippled(NamedTuple):
    """Free balloons: ``shapes`` with r and z of the mean meridian, their rims' ``waves``, and the
    amplitudes in mm of the pocket's ``edge`` and the rim's ``outside``, a row each.
    """

    shapes: Shapes
    waves: int
    edge: Array
    outside: Array


def free_shapes(balloon: Balloon, pressure: ArrayLike) -> Shapes:
    """Return free balloons at pressures (kPa): with waves in step where the pocket is wide and its
    rim ripples, else by ``inflate``.
    """
    shapes = inflate(balloon, pressure)
    rows = np.flatnonzero(shapes.pressure < _first_pressure(balloon) * END / START)
    if not resolves_waves(balloon) or not len(rows):
        return shapes
    resolved_balloons = rippled(balloon, shapes.pressure[rows])
    grown = np.abs(resolved_balloons.outside - resolved_balloons.edge) > LEVEL * balloon.ring
    parts = [part.copy() for part in shapes]
    for part, resolved_part in zip(parts, resolved_balloons.shapes, strict=True):
        part[rows[grown]] = resolved_part[grown]
    return Shapes(*parts)


def compressed_shapes(
    balloon: Balloon, pressure: ArrayLike, height: ArrayLike, tied: bool = False
) -> Shapes:
    """Return balloons between plates at heights (mm), by ``inflate`` with a correction for waves.

    Where waves are in step with the rim a balloon rises freely by a share more. Between plates it
    is taken for one that is lower, W(p, h) = W'(p, h - e(p) f(h / h1)), with force and volume its
    slopes: e is the excess of the free height h1 over that of ``inflate``, and f grows from 0
    where it is pressed flat to 1 where it stands freely, and is 0 again where it is pulled to
    TAUT times that: plates press waves flat, and a pull draws them straight. Shapes r and z are the
    lower one's.
    """
    p, h = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(height, float))
    share, rate = height_ratio(balloon, p)
    if not (rate.any() or (share != 1).any()):
        return inflate(balloon, p, h, tied=tied)
    free_height, slope = _free_heights(balloon, p)
    stands, stands_rate = share * free_height, rate * free_height + share * slope
    more, more_rate = stands - free_height, stands_rate - slope
    place = h / stands
    faded, fading = _fade(place)
    lower = more * faded
    by_height = 1 - more * fading / stands
    by_pressure = more * fading * place * stands_rate / stands - more_rate * faded
    shapes = inflate(balloon, p, h - lower, tied=tied)
    more_air = shapes.force * by_pressure
    return shapes._replace(
        height=shapes.height + lower,
        force=shapes.force * by_height,
        volume=shapes.volume + more_air,
        energy=shapes.energy + shapes.pressure * more_air,
    )


def _free_heights(balloon: Balloon, p: Array) -> tuple[Array, Array]:
    """Return free heights in mm by ``inflate``, and their rate by pressure; 1 where p is 0."""
    pressures = np.unique(p[p > 0])
    each = inflate(
        balloon, np.concatenate([pressures * (1 - NUDGE), pressures, pressures * (1 + NUDGE)])
    ).height
    low, height, high = each.reshape(3, -1)
    height = np.append(height, 1.0)
    slope = np.append((high - low) / (2 * NUDGE * pressures), 0.0)
    at = np.where(p > 0, np.searchsorted(pressures, p), len(pressures))
    return height[at], slope[at]


def _fade(place: Array) -> tuple[Array, Array]:
    """Return the share of the waves' rise at heights over the free one, and its slope."""
    up = np.clip(place, 0.0, 1.0)
    off = np.clip((place - 1) / (TAUT - 1), 0.0, 1.0)
    value = up**2 * (3 - 2 * up) - off**2 * (3 - 2 * off)
    return value, 6 * up * (1 - up) - 6 * off * (1 - off) / (TAUT - 1)


class HeightRatio(NamedTuple):
    """A ratio of heights, and its rate by pressure in 1/kPa."""

    share: Array
    rate: Array


def height_ratio(balloon: Balloon, pressure: Array) -> HeightRatio:
    """Return free heights at pressures (kPa) over those of ``inflate``: 1 where waves are not in
    step with the rim. Between rungs a cubic of the pressure's logarithm.
    """
    first, rungs = _first_pressure(balloon), round(math.log(END / START) / math.log(STEP))
    at = np.log(np.maximum(pressure, first) / first) / math.log(STEP)
    inside = (at > 0) & (at < rungs)
    if not resolves_waves(balloon) or not inside.any():
        return HeightRatio(np.ones_like(pressure), np.zeros_like(pressure))
    waves = usual_waves(balloon)
    x = np.array([_rung(balloon, waves, k).x for k in range(rungs)])
    high = inflate(balloon, first * STEP ** np.arange(rungs)).height
    ratio = 2 * x[:, PLACES * balloon.neck_edge + Z] / high
    ratio = np.append(np.where([_ripples(balloon, state) for state in x], ratio, 1.0), 1.0)
    ratio[0] = 1.0
    slopes = np.gradient(ratio)
    slopes[[0, -1]] = 0.0
    k = np.clip(at.astype(np.int_), 0, rungs - 1)
    u = np.clip(at - k, 0.0, 1.0)
    a, b, rise = ratio[k], slopes[k], ratio[k + 1] - ratio[k]
    c, d = 3 * rise - 2 * b - slopes[k + 1], b + slopes[k + 1] - 2 * rise
    rate = (b + u * (2 * c + 3 * u * d)) * inside / (np.maximum(pressure, first) * math.log(STEP))
    return HeightRatio(a + u * (b + u * (c + u * d)), rate)


def resolves_waves(balloon: Balloon) -> bool:
    """Return True if its waves are resolved: a wide pocket, equal films of the usual law."""
    usual = balloon.wrinkles and not balloon.inextensible and balloon.order == 2
    return usual and balloon.mate is None and balloon.pocket >= WIDE * balloon.ring


def rippled(balloon: Balloon, pressure: ArrayLike, waves: int | None = None) -> Rippled:
    """Return free balloons at pressures in kPa, all with as many ``waves`` round the rim; else with
    those of least energy where ripples are well grown.

    A balloon with a bore is pulled on by the air in it. Raises DesignError for pressures that are
    not above 0, or where Newton's method finds no equilibrium.
    """
    p = np.atleast_1d(np.asarray(pressure, dtype=float))
    if not (np.isfinite(p) & (p > 0)).all():
        raise DesignError("pressure of a balloon must be above 0 kPa")
    n = waves or usual_waves(balloon)
    of = _waving(balloon, n)
    at = np.maximum(np.log(p / _first_pressure(balloon)) / math.log(STEP), 0.0)
    starts = [_starts(of, float(place)) for place in at]
    x = np.stack([start for several in starts for start in several], 1)
    row = np.repeat(np.arange(len(p)), [len(several) for several in starts])
    problem = Waves(of, p[row], _normals(of, x))
    try:
        x = _equilibrium(problem, x)
    except DesignError:
        # One by one, and on smaller steps.
        rungs = _first_pressure(balloon) * STEP ** at.astype(np.int_)
        each = (_continued(of, x[:, [i]], rungs[which], p[which]) for i, which in enumerate(row))
        x = np.concatenate(list(each), 1)
    energy = problem.total(x, np.arange(len(row))).energy
    x = x[:, [min(np.flatnonzero(row == i), key=energy.__getitem__) for i in range(len(p))]]
    state = Waves(of, p, _normals(of, x)).total(x, np.arange(len(p)))
    r, z = (np.ascontiguousarray(x[k::PLACES].T) for k in (R, Z))
    z[:, : balloon.neck_edge] = z[:, balloon.neck_edge, None]
    shapes = Shapes(p, 2 * z[:, 0], 2 * state.volume, np.zeros(len(p)), 2 * state.stored, r, z)
    edge = x[PLACES * balloon.edge + UP]
    return Rippled(shapes, n, edge, edge + balloon.ring * _tilt(balloon, x))


@lru_cache(maxsize=256)
def usual_waves(balloon: Balloon) -> int:
    """Return the number of waves of least energy of well-grown ripples, by ``ripples_at``."""
    shape = inflate(balloon, _first_pressure(balloon) * USUAL / START)
    (ripple,) = ripples_at((balloon,), ((shape.r, shape.z),))
    return int(ripple.waves[0])


def _starts(of: Waving, at: float) -> list[Array]:
    """Return starts between two rungs: one interpolated on a common branch, else both."""
    k = int(at)
    near = [_rung(of.balloon, of.waves, each).x for each in (k, k + 1)]
    if not _are_one_branch(of, *near):
        return near
    for each, front in ((k - 1, True), (k + 2, False)):
        if each >= 0 and START * STEP**each < END:
            more = _rung(of.balloon, of.waves, each).x
            if _are_one_branch(of, more, near[0 if front else -1]):
                near = [more, *near] if front else [*near, more]
                k -= front
    # The polynomial through them (Lagrange).
    u, places = at - k, range(len(near))
    shares = [math.prod((u - j) / (i - j) for j in places if j != i) for i in places]
    return [sum((share * x for share, x in zip(shares, near, strict=True)), np.zeros_like(near[0]))]


def _are_one_branch(of: Waving, first: Array, second: Array) -> bool:
    """Return True if the waves of two equilibria belong to one branch."""
    waves = of.is_free.copy()
    waves[:, :2] = False
    a, b = (each[waves.ravel()] for each in (first, second))
    return bool(a @ b > ALIKE * math.sqrt((a @ a) * (b @ b)))


def _first_pressure(balloon: Balloon) -> float:
    """Return the pressure in kPa of the first rung."""
    return START * balloon.membrane_stiffness / balloon.pocket


@lru_cache(maxsize=32)
def _waving(balloon: Balloon, waves: int) -> Waving:
    return Waving(balloon, waves)


class Rung(NamedTuple):
    """Coordinates at a pressure; ``in_step`` if films have fallen in step with the rim by then."""

    x: Array
    in_step: bool


@lru_cache(maxsize=512)
def _rung(balloon: Balloon, waves: int, k: int) -> Rung:
    """Return a balloon at the pressure of rung ``k``, continued from the rung below."""
    of, p = _waving(balloon, waves), np.array([_first_pressure(balloon) * STEP**k])
    if k == 0:
        shape = inflate(balloon, p)
        x, in_step = np.zeros((of.is_free.size, 1)), False
        x[R::PLACES], x[Z::PLACES] = shape.r.T, shape.z.T
    else:
        below = _rung(balloon, waves, k - 1)
        x, in_step = below.x[:, None].copy(), below.in_step
    if not _ripples(balloon, x[:, 0]):
        x[PLACES * balloon.edge + EDGE] = -SEED * balloon.thickness / 2
        x[PLACES * balloon.edge + UP] = SEED * balloon.ring / 3
    if not in_step and START * STEP**k <= LATEST:
        # Also from there with films pushed in step with the rim.
        x = np.repeat(x, 2, axis=1)
        x[UP::PLACES, 1] += math.copysign(KICK, x[PLACES * balloon.edge + UP, 1]) * _film_wave(of)
    x = _continued(of, x, p[0] / STEP, p[0])
    rows = np.arange(x.shape[1])
    energy = Waves(of, np.repeat(p, len(rows)), _normals(of, x)).total(x, rows).energy
    best = int(energy.argmin())
    return Rung(x[:, best], in_step or energy[best] < energy[0] * (1 + CLEARLY))


def _film_wave(of: Waving) -> Array:
    """Return a film's wave beside the rim, one arch long, mm for each mm of radius: (nodes,)."""
    balloon = of.balloon
    off = np.clip((balloon.pocket - balloon.nodes) / (0.4 * balloon.pocket), 0.0, 1.0)
    wave = np.where(of.is_free[:, UP], balloon.pocket * np.sin(math.pi * off), 0.0)
    wave[balloon.edge :] = 0.0
    return wave


def _tilt(balloon: Balloon, x: Array) -> Array:
    """Return the tilt of the rim, in rad."""
    return np.asarray(-2 / balloon.thickness * x[PLACES * balloon.edge + EDGE])


def _ripples(balloon: Balloon, x: Array) -> bool:
    return bool(np.abs(_tilt(balloon, x)) > LEVEL)


def _normals(of: Waving, x: Array) -> Array:
    """Return the normals of the mean film, in r and z, and its stretch: (rows, elements, 3)."""
    balloon = of.balloon
    r, z = x[R::PLACES].T, x[Z::PLACES].T.copy()
    z[:, : balloon.neck_edge] = z[:, balloon.neck_edge, None]
    dr, dz = np.diff(r), np.diff(z)
    length = np.hypot(dr, dz)
    return np.stack([-dz / length, dr / length, length / balloon.film.lengths], -1)


def _continued(of: Waving, x: Array, low: float, high: float, halvings: int = HALVINGS) -> Array:
    """Return the equilibrium at a pressure from that at another, if need be in smaller steps."""
    try:
        return _equilibrium(Waves(of, np.full(x.shape[1], high), _normals(of, x)), x)
    except DesignError:
        if not halvings:
            raise
    middle = math.sqrt(low * high)
    x = _continued(of, x, low, middle, halvings - 1)
    return _continued(of, x, middle, high, halvings - 1)


def _equilibrium(problem: Waves, x: Array) -> Array:
    """Return the equilibria downhill. Raises DesignError where there are none."""
    try:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return equilibrium(problem, x)
    except NoEquilibrium:
        of = problem.of
        raise DesignError(
            f"no equilibrium found for a balloon of radius {of.balloon.pocket:g} mm with "
            f"{of.waves} waves round its rim; try another load"
        ) from None
