"""Free balloons with wide pockets, whose films wrinkle in step with the rim's ripples.

``balloon`` holds the pocket's edge while its rim ripples, and averages the films' wrinkles. Where
a pocket is wide beside its ring, CalculiX shows films whose waves fall in step with the rim's, and
an edge that moves with them. ``rippled`` resolves those waves (``rim_correction``): nothing is
averaged, nothing fitted. Rims stay level as a whole. Lengths mm, pressures kPa, volumes ul.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes, coordinates, inflate, ripples_at
from sbafab.models.film_elements import Array
from sbafab.models.least_energy import NoEquilibrium, equilibrium
from sbafab.models.rim_correction import EDGE, PLACES, UP, R, Waves, Waving, Z
from sbafab.runtime import one_blas_thread

WIDE = 4.0
"""Pocket radius in ring widths above which films fall in step with the rim: strokes of narrower
pockets agree within 0.5 % between both models.
"""
START = 0.0005
"""Film strain, p R / (E t), at which ripples are first followed: they appear above 0.001."""
USUAL = 0.013
"""Film strain at which the number of waves is chosen, if none is given."""
END = 0.256
"""Film strain above which waves make no difference."""
STEP = 2.0
"""Ratio of the pressures of two rungs, along which ripples are continued."""
SEED = 0.02
"""Initial tilt in rad of a level rim."""
LEVEL = 0.001
"""Tilt in rad below which a rim does not ripple."""
KICK = 0.02
"""Share of the radius by which films are pushed in step with the rim, as a trial."""
CLEARLY = 1e-5
"""Relative gain of energy above which a balloon counts as in step."""
LATEST = 0.02
"""Largest film strain at which films fall in step."""
ALIKE = 0.9
"""Cosine of the angle between waves that belong to one branch."""
JUMP_PARTS = 3
"""Subdivisions between rungs of different branches at which balloons with waves are computed."""
RUNG_PARTS = 32
"""Subdivisions from rung to rung at which balloons with waves are interpolated."""
LADDER_STEPS, LADDER_TOP = 16, 1.25
"""Heights at which smooth balloons are compared with those with waves; the square root of the
highest, over the highest free balloon.
"""
SAME_HEIGHT = 1e-9
"""Tolerance of equal heights in mm."""
HALVINGS = 3
"""Times that a step between rungs is halved if it finds no equilibrium."""


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
    return with_waves(balloon, inflate(balloon, pressure))


def with_waves(balloon: Balloon, shapes: Shapes) -> Shapes:
    """Return ``free_shapes`` at the pressures of free balloons by ``inflate``."""
    rows = np.flatnonzero(shapes.pressure < _first_pressure(balloon) * END / START)
    if not resolves_waves(balloon) or not len(rows):
        return shapes
    resolved_balloons = rippled(balloon, shapes.pressure[rows])
    grown = _grown(balloon, resolved_balloons.edge, resolved_balloons.outside)
    parts = [part.copy() for part in shapes]
    for part, resolved_part in zip(parts, resolved_balloons.shapes, strict=True):
        part[rows[grown]] = resolved_part[grown]
    return Shapes(*parts)


def _grown(balloon: Balloon, edge: Array, outside: Array) -> NDArray[np.bool_]:
    """Return True for balloons with waves: at the rim's outside, or in step at the pocket's edge
    with a rim that may stay level.
    """
    waves: NDArray[np.bool_] = np.maximum(np.abs(edge), np.abs(outside)) > LEVEL * balloon.ring
    return waves


def compressed_shapes(
    balloon: Balloon, pressure: ArrayLike, height: ArrayLike, tied: bool = False
) -> Shapes:
    """Return balloons between plates at heights (mm), by ``inflate``; where waves are in step with
    the rim, by the least energy of all states known.

    The least energy is bounded by every known state: states by ``inflate`` at all heights, and
    free ones with waves at all pressures, each with the work of its air. The potential W(p, h) is
    concave in p, as the least of functions E - p V, and convex in h if it is stable. The convex
    envelope of these states in h therefore represents it: it has the free heights and volumes of
    balloons with waves, and volumes that rise with pressure. Waves between plates are not computed.
    Shapes r and z come from ``inflate``.
    """
    p, h = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(height, float))
    p, h = np.atleast_1d(p), np.atleast_1d(h)
    shapes = inflate(balloon, p, h, tied=tied)
    waves = wave_states(balloon)
    if not len(waves.height):
        return shapes
    ladder = np.linspace(0, LADDER_TOP, LADDER_STEPS + 1)[1:] ** 2 * waves.height.max()
    pressures, row = np.unique(p, return_inverse=True)
    grid = [part.ravel() for part in np.meshgrid(pressures, ladder, indexing="ij")]
    rungs = inflate(balloon, grid[0], grid[1], tied=True)
    force, volume, energy = (part.copy() for part in (shapes.force, shapes.volume, shapes.energy))
    for number, pressure_of in enumerate(pressures):
        here = np.flatnonzero(row == number)
        part = slice(number * len(ladder), (number + 1) * len(ladder))
        smooth = FilmStates(h[here], shapes.energy[here], shapes.volume[here])
        more = FilmStates(ladder, rungs.energy[part], rungs.volume[part])
        states = FilmStates(
            *(np.concatenate(each) for each in zip(smooth, more, waves, strict=True))
        )
        low, high, share = _between(states, float(pressure_of), len(here))
        mixed = np.flatnonzero(low != high)
        low, high, share = low[mixed], high[mixed], share[mixed]
        potential = states.energy - pressure_of * states.volume
        rise = states.height[high] - states.height[low]
        at = here[mixed]
        force[at] = -(potential[high] - potential[low]) / rise
        volume[at] = states.volume[low] + share * (states.volume[high] - states.volume[low])
        energy[at] = states.energy[low] + share * (states.energy[high] - states.energy[low])
    return shapes._replace(force=force, volume=volume, energy=energy)


def least_free_states(balloon: Balloon, smooth: Shapes) -> FilmStates:
    """Return the free balloons of least energy among all known states, at the pressures of
    ``smooth``: the states at which ``compressed_shapes`` carries no force.
    """
    waves = wave_states(balloon)
    states = FilmStates(smooth.height.copy(), smooth.energy.copy(), smooth.volume.copy())
    if not len(waves.height):
        return states
    for number, p in enumerate(smooth.pressure):
        potential = waves.energy - p * waves.volume
        best = int(potential.argmin())
        if potential[best] < states.energy[number] - p * states.volume[number]:
            for part, values in zip(states, waves, strict=True):
                part[number] = values[best]
    return states


class FilmStates(NamedTuple):
    """States of a balloon: heights in mm, energies of the films in uJ, volumes in ul."""

    height: Array
    energy: Array
    volume: Array


def _between(
    states: FilmStates, pressure: float, count: int
) -> tuple[NDArray[np.int_], NDArray[np.int_], Array]:
    """Return the neighbours on the convex envelope of E - p V on either side of each of the first
    ``count`` states, and its fraction between them; both are the state itself if it is on the
    envelope.
    """
    potential = states.energy - pressure * states.volume
    order = np.lexsort((potential, states.height))
    hull: list[int] = []
    for k in order.tolist():
        x, y = states.height[k], potential[k]
        if hull and x - states.height[hull[-1]] < SAME_HEIGHT:
            continue
        while len(hull) > 1:
            a, b = hull[-2:]
            rise = (potential[b] - potential[a]) * (x - states.height[a])
            if rise < (y - potential[a]) * (states.height[b] - states.height[a]):
                break
            hull.pop()
        hull.append(k)
    corners = np.array(hull)
    places = states.height[corners]
    after = np.clip(np.searchsorted(places, states.height[:count]), 1, len(corners) - 1)
    low, high = corners[after - 1], corners[after]
    share = (states.height[:count] - places[after - 1]) / (places[after] - places[after - 1])
    alone = np.isin(np.arange(count), corners)
    low, high = (np.where(alone, np.arange(count), each) for each in (low, high))
    return low, high, np.clip(np.where(alone, 0.0, share), 0.0, 1.0)


@lru_cache(maxsize=64)
@one_blas_thread
def wave_states(balloon: Balloon) -> FilmStates:
    """Return free balloons with waves in step with the rim at pressures throughout their range;
    empty without such waves.

    They are interpolated between rungs of one branch, and some are computed where another branch
    begins.
    """
    none = FilmStates(np.zeros(0), np.zeros(0), np.zeros(0))
    if not resolves_waves(balloon):
        return none
    waves, first = usual_waves(balloon), _first_pressure(balloon)
    count = round(math.log(END / START) / math.log(STEP))
    x = np.stack([_rung(balloon, waves, k).x for k in range(count)], 1)
    edge = x[PLACES * balloon.edge + UP]
    grown = _grown(balloon, edge, edge + balloon.ring * _tilt(balloon, x))
    if not grown.any():
        return none
    of, at = _waving(balloon, waves), np.arange(float(count))
    total = Waves(of, first * STEP**at, _normals(of, x)).total(x, np.arange(count))
    rungs = FilmStates(2 * x[PLACES * balloon.neck_edge + Z], 2 * total.stored, 2 * total.volume)
    ends = np.flatnonzero(grown[:-1] | grown[1:])
    is_one = np.array([_are_one_branch(of, x[:, k], x[:, k + 1]) for k in ends])
    parts = [FilmStates(*(each[grown] for each in rungs))]
    between = np.arange(1, RUNG_PARTS) / RUNG_PARTS
    for k in ends[is_one].tolist():
        parts.append(_interpolated(rungs, first * STEP**at, k, between))
    jumps = ends[~is_one]
    if len(jumps):
        # Another branch begins between these rungs.
        places = (jumps[:, None] + np.arange(1, JUMP_PARTS) / JUMP_PARTS).ravel()
        shapes = rippled(balloon, first * STEP**places).shapes
        parts.append(FilmStates(shapes.height, shapes.energy, shapes.volume))
    return FilmStates(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _interpolated(rungs: FilmStates, pressures: Array, k: int, shares: Array) -> FilmStates:
    """Return states between rungs k and k + 1 of one branch: the height and the volume as
    polynomials of the pressure's logarithm, the energy as a cubic with slopes p dV/dp.
    """
    near = slice(max(k - 1, 0), k + 3)
    x, at = np.log(pressures[near] / pressures[k]) / math.log(STEP), shares
    height = _polynomial(x, rungs.height[near], at)
    volume = _polynomial(x, rungs.volume[near], at)
    ends = np.array([0.0, 1.0])
    nudge = 1e-4
    slopes = (_polynomial(x, rungs.volume[near], ends + nudge) - rungs.volume[k : k + 2]) / nudge
    a, b = pressures[k : k + 2] * slopes
    rise = rungs.energy[k + 1] - rungs.energy[k]
    energy = rungs.energy[k] + at * (a + at * (3 * rise - 2 * a - b + at * (a + b - 2 * rise)))
    return FilmStates(height, energy, volume)


def _polynomial(x: Array, values: Array, at: Array) -> Array:
    """Return the polynomial through values at ``x`` at other places (Lagrange)."""
    total = np.zeros_like(at)
    for i, value in enumerate(values):
        rest = np.delete(x, i)
        total += value * np.prod((at[:, None] - rest) / (x[i] - rest), axis=1)
    return total


def resolves_waves(balloon: Balloon) -> bool:
    """Return True if its waves are resolved: a wide pocket, equal films of the usual law."""
    usual = balloon.wrinkles and not balloon.inextensible and balloon.order == 2
    return usual and balloon.mate is None and balloon.pocket >= WIDE * balloon.ring


@one_blas_thread
def rippled(balloon: Balloon, pressure: ArrayLike, waves: int | None = None) -> Rippled:
    """Return free balloons at pressures in kPa, all with this number of ``waves`` round the rim; by
    default the number of least energy for well-grown ripples.

    The air in the bore pulls on a balloon. Raises DesignError for pressures that are not above 0,
    or if Newton's method finds no equilibrium.
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
    (ripple,) = ripples_at((balloon,), [coordinates(shape.r, shape.z)])
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


def _rung(balloon: Balloon, waves: int, k: int) -> Rung:
    """Return a balloon at the pressure of rung ``k``. Shapes depend only on pressure over modulus,
    so films of any modulus share the rungs of the paper's film.
    """
    return _rung_of_paper(replace(balloon, modulus=Balloon.modulus), waves, k)


@lru_cache(maxsize=512)
def _rung_of_paper(balloon: Balloon, waves: int, k: int) -> Rung:
    """Return a balloon at the pressure of rung ``k``, continued from the rung below."""
    of, p = _waving(balloon, waves), np.array([_first_pressure(balloon) * STEP**k])
    if k == 0:
        shape = inflate(balloon, p)
        x, in_step = np.zeros((of.is_free.size, 1)), False
        x[R::PLACES], x[Z::PLACES] = shape.r.T, shape.z.T
    else:
        below = _rung_of_paper(balloon, waves, k - 1)
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
    # Of equal ones the plain start's: its waves are of the branch below.
    gains = bool(energy[-1] < energy[0] * (1 + CLEARLY))
    return Rung(x[:, -1 if gains else 0], in_step or gains)


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
    """Return the equilibrium at a pressure, continued from another, in smaller steps if needed."""
    try:
        return _equilibrium(Waves(of, np.full(x.shape[1], high), _normals(of, x)), x)
    except DesignError:
        if not halvings:
            raise
    middle = math.sqrt(low * high)
    x = _continued(of, x, low, middle, halvings - 1)
    return _continued(of, x, middle, high, halvings - 1)


def _equilibrium(problem: Waves, x: Array) -> Array:
    """Return the equilibria downhill. Raises DesignError if none are found."""
    try:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return equilibrium(problem, x)
    except NoEquilibrium:
        of = problem.of
        raise DesignError(
            f"no equilibrium found for a balloon of radius {of.balloon.pocket:g} mm with "
            f"{of.waves} waves round its rim; try another load"
        ) from None
