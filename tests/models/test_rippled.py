"""Films that wave in step with the rim: their energy's own slopes, its symmetries, its limits."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from docs.scripts.ripple_sector import Sector, sector_states
from sbafab.errors import DesignError
from sbafab.models import least_energy
from sbafab.models.balloon import Balloon, inflate
from sbafab.models.balloon_map import balloon_map
from sbafab.models.film_elements import Elements, air_volume, bending, membrane
from sbafab.models.rim_correction import EDGE, OVERTONES, PLACES, UP, R, Waves, Waving, Z, first_of
from sbafab.models.rippled_balloon import (
    compressed_shapes,
    free_shapes,
    least_free_states,
    resolves_waves,
    rippled,
)

WIDE = Balloon(5.0)
INNER = Balloon(5.0, neck=1.27, bore=0.52)


def at(one: Balloon, pressure: float, waves: int) -> tuple[Waves, np.ndarray]:
    """The energy of a balloon, and its coordinates as ``inflate`` has it: without waves."""
    of, shape = Waving(one, waves), inflate(one, pressure)
    x = np.zeros((of.is_free.size, 1))
    x[R::PLACES], x[Z::PLACES] = shape.r.T, shape.z.T
    return Waves(of, np.array([pressure]), x), x


def waved(problem: Waves, x: np.ndarray, size: float, seed: int = 3) -> np.ndarray:
    draw = np.random.default_rng(seed).standard_normal(x.shape)
    return x + size * draw * problem.of.is_free.ravel()[:, None]


@pytest.mark.parametrize("one", [WIDE, INNER, Balloon(2.5, thickness=0.1)])
def test_slopes_are_those_of_the_energy(one: Balloon) -> None:
    problem, x = at(one, 1.5, 9)
    x, row, step = waved(problem, x, 0.003), np.array([0]), 1e-6
    ahead = waved(problem, np.zeros_like(x), 1.0, seed=4)
    found = problem.at(x, row)
    more, less = (problem.at(x + sign * step * ahead, row) for sign in (1, -1))
    slope = (more.energy - less.energy) / (2 * step)
    assert (found.gradient * ahead).sum() == pytest.approx(slope[0], rel=1e-6)
    free = problem.of.freedoms
    turned = ((more.gradient - less.gradient) / (2 * step))[free, 0]
    own = least_energy.dense(found.matrix)[0] @ ahead[free, 0]
    assert own == pytest.approx(turned, abs=1e-6 * np.abs(turned).max())


def test_without_waves_it_is_the_smooth_balloon() -> None:
    """A membrane of revolution that may not wrinkle, on a rim that stays flat."""
    for one in (WIDE, INNER):
        problem, x = at(one, 2.0, 12)
        found, own, air = problem.total(x, np.array([0]))
        lie = Elements.of(x[R::PLACES], x[Z::PLACES])
        never = np.full((len(one.nodes) - 1, 1), math.inf)
        stored = membrane(one.film, lie, never).energy
        bent, _ = bending(one.film, one.bending_stiffness, slice(one.neck_edge, one.edge), lie)
        assert own == pytest.approx(stored + bent.energy, rel=1e-9)
        assert air == pytest.approx(air_volume(one.film, one.edge, lie).energy, rel=1e-3)
        assert np.abs(found.gradient.reshape(-1, PLACES)[:, 2:]).max() < 1e-9


def test_half_a_wave_further_on_it_is_the_same() -> None:
    problem, x = at(INNER, 1.0, 11)
    x, row = waved(problem, x, 0.003), np.array([0])
    other = x.copy()
    for k in range(1, OVERTONES + 1, 2):
        for place in range(first_of(k), first_of(k) + 3):
            other[place::PLACES] *= -1
    assert problem.at(other, row).energy == pytest.approx(problem.at(x, row).energy)


def test_a_rim_bends_as_a_plate_ring_does() -> None:
    """Tilted as a whole by cos(n turn) about the edge, small enough that nothing stretches.

    Timoshenko and Woinowsky-Krieger, energy of a plate in polar coordinates, of which the films
    have half: 1/2 int D ((w'/r - n2 w/r2)^2 + 2 (1 - nu) n2 (w'/r - w/r2)^2) cos2 dA.
    """
    one, n, tilt = WIDE, 14, 1e-6
    problem, _ = at(one, 1.0, n)
    of = problem.of
    x = np.zeros((of.is_free.size, 1))
    x[R::PLACES, 0] = one.nodes
    _, flat, _ = problem.total(x, np.array([0]))
    x[PLACES * one.edge + EDGE] = -tilt * one.thickness / 2
    x[PLACES * one.edge + UP] = 0.0
    plate = of.plate[one.edge :]
    low, high = (one.nodes[one.edge + k : len(one.nodes) - 1 + k] - one.pocket for k in (0, 1))
    w = np.stack([np.full(len(low), tilt), tilt * (low + high) / 2], -1)
    told = np.einsum("ei,eij,ej->", w, plate, w) / 2
    s = np.linspace(0, one.ring, 20001)
    r, rise = one.pocket + s, tilt * s
    rigid = one.modulus * (2 * one.thickness) ** 3 / 12 / (1 - one.poisson**2)
    bent = tilt / r - n**2 * rise / r**2
    wrung = n * (tilt / r - rise / r**2)
    density = bent**2 + 2 * (1 - one.poisson) * wrung**2
    closed = math.pi * rigid / 2 / 2 * np.trapezoid(density * r, s)
    assert told == pytest.approx(closed, rel=0.03)
    # What the whole energy has more than that is the film's, which the edge turns and pulls.
    assert problem.total(x, np.array([0]))[1] - flat > told


def test_wide_pockets_rise_as_in_calculix() -> None:
    """An even ripple of d = 15 with 18 waves, a size that the model was not made with: stroke in
    mm, air in ul, and from crest to trough of the rim's outside in mm (``python -m
    docs.scripts.ripple_sector 15 18 even``).
    """
    pressures = [0.5, 1.0, 2.0]
    wide = Balloon(7.5)
    found = rippled(wide, pressures, 18)
    assert found.shapes.height == pytest.approx([4.379, 5.286, 6.081], rel=0.03)
    assert found.shapes.volume == pytest.approx([382.45, 444.93, 496.81], rel=0.03)
    assert 2 * np.abs(found.outside) == pytest.approx([0.486, 0.586, 0.655], rel=0.1)
    # The edge goes with the rim, to the same side.
    assert (found.edge / found.outside > 0.1).all()
    assert (inflate(wide, pressures).height < 0.96 * found.shapes.height).all()


def test_the_way_to_a_pressure_does_not_matter() -> None:
    together = rippled(INNER, [0.3, 1.1, 5.0]).shapes
    for row, pressure in enumerate((0.3, 1.1, 5.0)):
        alone = rippled(INNER, pressure).shapes
        assert alone.height[0] == pytest.approx(together.height[row], rel=1e-5)


def test_narrow_pockets_unlike_films_and_other_laws_are_as_before() -> None:
    for one in (
        Balloon(2.5),
        replace(WIDE, order=0),
        replace(WIDE, wrinkles=False),
        replace(WIDE, mate=Balloon(5.0, thickness=0.05)),
    ):
        assert not resolves_waves(one)
        assert free_shapes(one, 1.0).height == inflate(one, 1.0).height
    assert free_shapes(WIDE, 30.0).height == inflate(WIDE, 30.0).height
    with pytest.raises(DesignError, match="above 0 kPa"):
        rippled(WIDE, [1.0, 0.0])


@pytest.mark.long
def test_between_plates_force_and_volume_are_slopes_of_one_energy() -> None:
    """Of W(p, h), beside a smaller share of what waves themselves keep (see ``balloon_map``)."""
    p, h, step = np.array([0.4, 1.5, 6.0]), np.array([1.0, 2.0, 3.0]), 1e-4
    found = compressed_shapes(WIDE, p, h)

    def potential(dp: float, dh: float) -> np.ndarray:
        one = compressed_shapes(WIDE, p + dp, h + dh)
        return np.asarray(one.energy - (p + dp) * one.volume)

    force = -(potential(0, step) - potential(0, -step)) / (2 * step)
    volume = -(potential(step, 0) - potential(-step, 0)) / (2 * step)
    assert found.force == pytest.approx(force, rel=0.03)
    assert found.volume == pytest.approx(volume, rel=0.03)


@pytest.mark.long
def test_free_heights_of_the_map_are_those_with_waves() -> None:
    p = np.array([0.5, 1.0, 3.0, 8.0])
    assert (free_shapes(INNER, p).height > 1.005 * inflate(INNER, p).height).all()
    found = balloon_map(INNER, 50.0).free_height(p)
    # At the first waves begin: all at once, which a smooth map rounds off.
    assert found[0] == pytest.approx(free_shapes(INNER, p[0]).height[0], rel=0.035)
    assert found[1:] == pytest.approx(free_shapes(INNER, p[1:]).height, rel=0.015)


def test_between_plates_volumes_rise_with_pressure_where_waves_begin() -> None:
    """All films' states obey it; waves begin at 0.5 kPa here, and heights rise at once."""
    wide = Balloon(9.0, neck=1.27, bore=0.52)
    p, h = np.geomspace(0.05, 2.0, 12), np.array([0.8, 2.5, 4.0, 6.0])
    grid = [each.ravel() for each in np.meshgrid(p, h, indexing="ij")]
    found = compressed_shapes(wide, *grid, tied=True)
    assert (np.diff(found.volume.reshape(12, 4), axis=0) > -1e-9).all()
    # And at its free height it carries nothing, up to the steps between states.
    free = least_free_states(wide, inflate(wide, p))
    force = compressed_shapes(wide, p, free.height, tied=True).force
    assert (np.abs(force) < 0.06 * p * np.pi * wide.pocket**2).all()


@pytest.mark.long
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_a_wide_pocket_that_ripples_in_calculix() -> None:
    pressures = [0.5, 1.0, 2.0]
    own = rippled(Balloon(3.5), pressures, 9)
    found = sector_states(Sector(7.0, 9, round=5, even=True), pressures)
    assert own.shapes.height == pytest.approx([state.stroke for state in found], rel=0.03)
    assert own.shapes.volume == pytest.approx([state.air for state in found], rel=0.03)
