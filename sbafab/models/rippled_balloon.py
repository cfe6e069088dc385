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
START, STEP, RUNGS = 0.0005, 2.0, 9
"""Film strain, p R / (E t), at which ripples are first followed: they appear above 0.001; ratio of
the pressures of two rungs, along which they are continued; number of rungs, of which at the next
one, 0.256, waves would make no difference.
"""
USUAL = 0.013
"""Film strain at which the number of waves is chosen, if none is given."""
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


class FilmStates(NamedTuple):
    """States of a balloon: heights in mm, energies of the films in uJ, volumes in ul."""

    height: Array
    energy: Array
    volume: Array


def resolves_waves(balloon: Balloon) -> bool:
    """Return True if its waves are resolved: a wide pocket, equal films of the usual law."""
    usual = balloon.wrinkles and not balloon.inextensible and balloon.order == 2
    return usual and balloon.mate is None and balloon.pocket >= WIDE * balloon.ring


def free_shapes(balloon: Balloon, pressure: ArrayLike) -> Shapes:
    """Return free balloons at pressures (kPa): with waves in step where the pocket is wide and its
    rim ripples, else by ``inflate``.
    """
    return with_waves(balloon, inflate(balloon, pressure))


def with_waves(balloon: Balloon, shapes: Shapes) -> Shapes:
    """Return ``free_shapes`` at the pressures of free balloons by ``inflate``."""
    rows = np.flatnonzero(shapes.pressure < _rung_pressure(balloon, RUNGS))
    if not resolves_waves(balloon) or not len(rows):
        return shapes
    resolved_balloons = rippled(balloon, shapes.pressure[rows])
    grown = _have_waves(balloon, resolved_balloons.edge, resolved_balloons.outside)
    parts = [part.copy() for part in shapes]
    for part, resolved in zip(parts, resolved_balloons.shapes, strict=True):
        part[rows[grown]] = resolved[grown]
    return Shapes(*parts)


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
    p, h = (np.atleast_1d(np.asarray(each, float)) for each in (pressure, height))
    p, h = np.broadcast_arrays(p, h)
    shapes, waves = inflate(balloon, p, h, tied=tied), wave_states(balloon)
    if not len(waves.height):
        return shapes
    ladder = np.linspace(0, LADDER_TOP, LADDER_STEPS + 1)[1:] ** 2 * waves.height.max()
    pressures, row = np.unique(p, return_inverse=True)
    steps = [part.ravel() for part in np.meshgrid(pressures, ladder, indexing="ij")]
    rungs = inflate(balloon, steps[0], steps[1], tied=True)
    force, volume, energy = (part.copy() for part in (shapes.force, shapes.volume, shapes.energy))
    for number, pressure_of in enumerate(pressures):
        here, part = np.flatnonzero(row == number), np.flatnonzero(steps[0] == pressure_of)
        own = FilmStates(h[here], shapes.energy[here], shapes.volume[here])
        more = FilmStates(ladder, rungs.energy[part], rungs.volume[part])
        states = FilmStates(*map(np.concatenate, zip(own, more, waves, strict=True)))
        potential = states.energy - pressure_of * states.volume
        corners = _envelope(states.height, potential)
        at = np.setdiff1d(np.arange(len(here)), corners)
        after = np.searchsorted(states.height[corners], states.height[at])
        after = np.clip(after, 1, len(corners) - 1)
        low, high, at = corners[after - 1], corners[after], here[at]
        rise = states.height[high] - states.height[low]
        share = np.clip((h[at] - states.height[low]) / rise, 0.0, 1.0)
        force[at] = (potential[low] - potential[high]) / rise
        for total, values in ((volume, states.volume), (energy, states.energy)):
            total[at] = values[low] + share * (values[high] - values[low])
    return shapes._replace(force=force, volume=volume, energy=energy)


def _envelope(height: Array, potential: Array) -> NDArray[np.int_]:
    """Return the numbers of the states on the convex envelope of the potential, by height."""
    hull: list[int] = []
    for k in np.lexsort((potential, height)).tolist():
        x, y = height[k], potential[k]
        if hull and x - height[hull[-1]] < SAME_HEIGHT:
            continue
        while len(hull) > 1:
            a, b = hull[-2:]
            rise = (potential[b] - potential[a]) * (x - height[a])
            if rise < (y - potential[a]) * (height[b] - height[a]):
                break
            hull.pop()
        hull.append(k)
    return np.array(hull)


def least_free_states(balloon: Balloon, smooth: Shapes) -> FilmStates:
    """Return the free balloons of least energy among all known states, at the pressures of
    ``smooth``: the states at which ``compressed_shapes`` carries no force.
    """
    waves, own = wave_states(balloon), (smooth.height, smooth.energy, smooth.volume)
    if not len(waves.height):
        return FilmStates(*own)
    potential = waves.energy - smooth.pressure[:, None] * waves.volume
    gains = potential.min(1) < smooth.energy - smooth.pressure * smooth.volume
    best = potential.argmin(1)
    return FilmStates(
        *(np.where(gains, with_[best], one) for with_, one in zip(waves, own, strict=True))
    )


@lru_cache(maxsize=64)
@one_blas_thread
def wave_states(balloon: Balloon) -> FilmStates:
    """Return free balloons with waves in step with the rim at pressures throughout their range;
    empty without such waves.

    They are interpolated between rungs of one branch, and some are computed where another branch
    begins.
    """
    none = FilmStates(*np.zeros((3, 0)))
    if not resolves_waves(balloon):
        return none
    of, number = _waving(balloon, usual_waves(balloon)), np.arange(RUNGS)
    x = np.stack([_rung(of, k)[0] for k in range(RUNGS)], 1)
    grown = _have_waves(balloon, *_amplitudes(balloon, x))
    if not grown.any():
        return none
    pressures = _rung_pressure(balloon, number)
    _, stored, volume = Waves(of, pressures, x).total(x, number)
    rungs = FilmStates(2 * x[PLACES * balloon.neck_edge + Z], 2 * stored, 2 * volume)
    parts, jumps = [FilmStates(*(each[grown] for each in rungs))], []
    for k in np.flatnonzero(grown[:-1] | grown[1:]).tolist():
        if _are_one_branch(of, x[:, k], x[:, k + 1]):
            parts.append(_interpolated(rungs, pressures, k))
        else:
            jumps.append(k + np.arange(1, JUMP_PARTS) / JUMP_PARTS)
    if jumps:
        # Another branch begins between these rungs.
        shapes = rippled(balloon, _rung_pressure(balloon, np.concatenate(jumps))).shapes
        parts.append(FilmStates(shapes.height, shapes.energy, shapes.volume))
    return FilmStates(*map(np.concatenate, zip(*parts, strict=True)))


def _interpolated(rungs: FilmStates, pressures: Array, k: int) -> FilmStates:
    """Return states between rungs k and k + 1 of one branch: the height and the volume as
    polynomials of the pressure's logarithm, the energy as a cubic with slopes p dV/dp.
    """
    at, ends, nudge = np.arange(1, RUNG_PARTS) / RUNG_PARTS, np.array([0.0, 1.0]), 1e-4
    near = np.arange(max(k - 1, 0), min(k + 3, RUNGS))
    shares = _lagrange(near - k, np.concatenate([at, ends + nudge]))
    volume = shares @ rungs.volume[near]
    slopes = (volume[-2:] - rungs.volume[k : k + 2]) / nudge
    a, b = pressures[k : k + 2] * slopes
    rise = rungs.energy[k + 1] - rungs.energy[k]
    energy = rungs.energy[k] + at * (a + at * (3 * rise - 2 * a - b + at * (a + b - 2 * rise)))
    return FilmStates((shares @ rungs.height[near])[:-2], energy, volume[:-2])


def _lagrange(nodes: NDArray[np.int_], at: Array) -> Array:
    """Return the weights of values at nodes in their polynomial at places: (places, nodes)."""
    weights = np.ones((len(at), len(nodes)))
    for i, node in enumerate(nodes):
        rest = np.delete(nodes, i)
        weights[:, i] = np.prod((at[:, None] - rest) / (node - rest), axis=1)
    return weights


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
    of = _waving(balloon, waves or usual_waves(balloon))
    at = np.maximum(np.log(p / _rung_pressure(balloon, 0)) / math.log(STEP), 0.0)
    starts = [_starts(of, place) for place in at.tolist()]
    x, row = np.concatenate(starts, 1), np.repeat(np.arange(len(p)), [s.shape[1] for s in starts])
    problem = Waves(of, p[row], x)
    try:
        x = _equilibrium(problem, x)
    except DesignError:
        # One by one, and on smaller steps.
        rungs = _rung_pressure(balloon, at.astype(np.int_))
        each = (_continued(of, x[:, [i]], rungs[which], p[which]) for i, which in enumerate(row))
        x = np.concatenate(list(each), 1)
    energy = problem.at(x, np.arange(len(row))).energy
    x = x[:, [min(np.flatnonzero(row == i), key=energy.__getitem__) for i in range(len(p))]]
    _, stored, volume = Waves(of, p, x).total(x, np.arange(len(p)))
    r, z = (np.ascontiguousarray(x[k::PLACES].T) for k in (R, Z))
    z[:, : balloon.neck_edge] = z[:, balloon.neck_edge, None]
    shapes = Shapes(p, 2 * z[:, 0], 2 * volume, np.zeros(len(p)), 2 * stored, r, z)
    return Rippled(shapes, of.waves, *_amplitudes(balloon, x))


@lru_cache(maxsize=256)
def usual_waves(balloon: Balloon) -> int:
    """Return the number of waves of least energy of well-grown ripples, by ``ripples_at``."""
    shape = inflate(balloon, _rung_pressure(balloon, math.log(USUAL / START, STEP)))
    (ripple,) = ripples_at((balloon,), [coordinates(shape.r, shape.z)])
    return int(ripple.waves[0])


def _starts(of: Waving, at: float) -> Array:
    """Return the start between two rungs, interpolated on a common branch, or both rungs:
    (coordinates, starts).
    """
    k = int(at)
    near = {each: _rung(of, each)[0] for each in (k, k + 1)}
    if not _are_one_branch(of, *near.values()):
        return np.stack(list(near.values()), 1)
    for each, beside in ((k - 1, k), (k + 2, k + 1)):
        if 0 <= each < RUNGS and _are_one_branch(of, x := _rung(of, each)[0], near[beside]):
            near[each] = x
    shares = _lagrange(np.array(list(near)), np.array([at]))
    return np.stack(list(near.values()), 1) @ shares.T


def _are_one_branch(of: Waving, first: Array, second: Array) -> bool:
    """Return True if the waves of two equilibria belong to one branch."""
    waves = of.is_free.copy()
    waves[:, :2] = False
    a, b = (each[waves.ravel()] for each in (first, second))
    return bool(a @ b > ALIKE * math.sqrt((a @ a) * (b @ b)))


def _rung_pressure(balloon: Balloon, k: ArrayLike) -> Array:
    """Return the pressure in kPa of rungs."""
    first = START * balloon.membrane_stiffness / balloon.pocket
    return np.asarray(first * STEP ** np.asarray(k, float))


@lru_cache(maxsize=32)
def _waving(balloon: Balloon, waves: int) -> Waving:
    return Waving(balloon, waves)


def _rung(of: Waving, k: int) -> tuple[Array, bool]:
    """Return a balloon's coordinates at the pressure of rung ``k``, and whether its films have
    fallen in step with the rim by then.

    Shapes depend only on pressure over modulus: films of any modulus share those of the paper's.
    """
    return _rung_of_paper(replace(of.balloon, modulus=Balloon.modulus), of.waves, k)


@lru_cache(maxsize=512)
def _rung_of_paper(balloon: Balloon, waves: int, k: int) -> tuple[Array, bool]:
    """Return ``_rung``, continued from the rung below."""
    of, p = _waving(balloon, waves), _rung_pressure(balloon, [k])
    edge = PLACES * balloon.edge
    if k == 0:
        shape = inflate(balloon, p)
        x, in_step = np.zeros((of.is_free.size, 1)), False
        x[R::PLACES], x[Z::PLACES] = shape.r.T, shape.z.T
    else:
        below, in_step = _rung_of_paper(balloon, waves, k - 1)
        x = below[:, None].copy()
    if not 2 / balloon.thickness * abs(x[edge + EDGE, 0]) > LEVEL:
        x[edge + EDGE] = -SEED * balloon.thickness / 2
        x[edge + UP] = SEED * balloon.ring / 3
    if not in_step and START * STEP**k <= LATEST:
        # Also from there with films pushed in step with the rim.
        x = np.repeat(x, 2, axis=1)
        x[UP::PLACES, 1] += math.copysign(KICK, x[edge + UP, 1]) * _film_wave(of)
    x = _continued(of, x, p[0] / STEP, p[0])
    rows = np.arange(x.shape[1])
    energy = Waves(of, np.repeat(p, len(rows)), x).at(x, rows).energy
    # Of equal ones the plain start's: its waves are of the branch below.
    gains = bool(energy[-1] < energy[0] * (1 + CLEARLY))
    return x[:, -1 if gains else 0], in_step or gains


def _film_wave(of: Waving) -> Array:
    """Return a film's wave beside the rim, one arch long, mm for each mm of radius: (nodes,)."""
    balloon = of.balloon
    off = np.clip((balloon.pocket - balloon.nodes) / (0.4 * balloon.pocket), 0.0, 1.0)
    wave = np.where(of.is_free[:, UP], balloon.pocket * np.sin(math.pi * off), 0.0)
    wave[balloon.edge :] = 0.0
    return wave


def _amplitudes(balloon: Balloon, x: Array) -> tuple[Array, Array]:
    """Return the amplitudes in mm of the pocket's edge and of the rim's outside."""
    edge, tilt = (x[PLACES * balloon.edge + place] for place in (UP, EDGE))
    return edge, edge - balloon.ring * 2 / balloon.thickness * tilt


def _have_waves(balloon: Balloon, edge: Array, outside: Array) -> NDArray[np.bool_]:
    """Return True for balloons with waves: at the rim's outside, or in step at the pocket's edge
    with a rim that may stay level.
    """
    return np.asarray(np.maximum(np.abs(edge), np.abs(outside)) > LEVEL * balloon.ring)


def _continued(of: Waving, x: Array, low: float, high: float, halvings: int = HALVINGS) -> Array:
    """Return the equilibrium at a pressure, continued from another, in smaller steps if needed."""
    try:
        return _equilibrium(Waves(of, np.full(x.shape[1], high), x), x)
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
