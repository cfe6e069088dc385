"""The rim that ripples against closed forms of plate buckling, and against its own energy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sbafab.models import balloon
from sbafab.models.balloon import coordinates, inflate, ripples_at
from sbafab.models.film_elements import Balloon

WIDE = Balloon(pocket=60.0)
"""So wide that its rim is nearly a straight strip."""


def onset(one: Balloon, tension: float) -> tuple[float, float]:
    """Hoop force (N/m of the rim's width) from which a rim ripples, and the number of waves."""
    low, high = 0.0, 0.2
    shape = (len(one.nodes) - 1 - one.edge, 1)
    for _ in range(60):
        middle = (low + high) / 2
        (found,) = balloon.rim_ripples((one,), np.full(shape, -middle), [np.array([tension])])
        ripples = (found.cost - middle * found.pull.sum(0) < 0).all()
        low, high = (low, middle) if ripples else (middle, high)
    (found,) = balloon.rim_ripples((one,), np.full(shape, -high), [np.array([tension])])
    return 2 * one.membrane_stiffness * high, float(found.waves[0])


@pytest.mark.parametrize("tension", [0.5, 4.0])
def test_a_straight_rim_ripples_as_a_strip_hinged_at_one_edge_does(tension: float) -> None:
    """The flange of Timoshenko and Gere (Theory of Elastic Stability, 9.4): a strip of width b that
    turns about one edge, the other one free, buckles at N = D (k^2 + 6 (1 - nu) / b^2), which for
    nu = 0.25 is their pi^2 D / b^2 (0.456 + (b k / pi)^2). A spring c against the turning adds
    3 c / (k^2 b^3); at the films' roots it is sqrt(B T) each.
    """
    b, nu = WIDE.ring, WIDE.poisson
    plate = WIDE.modulus * (2 * WIDE.thickness) ** 3 / (12 * (1 - nu**2))
    spring = 2 * math.sqrt(WIDE.bending_stiffness * tension)
    k = (3 * spring / (plate * b**3)) ** 0.25
    wanted = plate * (6 * (1 - nu) / b**2 + k**2) + 3 * spring / (k**2 * b**3)
    force, waves = onset(WIDE, tension)
    assert force == pytest.approx(wanted, rel=0.02)
    assert waves == pytest.approx(k * WIDE.pocket, rel=0.03)


def test_what_ripples_take_off_has_the_slopes_that_it_says() -> None:
    lone = Balloon()
    found = inflate(lone, 6.0)
    (ripple,) = ripples_at((lone,), [coordinates(found.r, found.z)])
    for order in (2, 6):
        flat = replace(lone, order=order)
        energy, slopes, curves = balloon.ripple_energy(flat, ripple, found.r.T)
        assert energy[0] < 0
        for node in (lone.edge, lone.edge + 2, len(lone.nodes) - 1):
            step = np.zeros_like(found.r.T)
            step[node] = 1e-5
            up, down = (
                balloon.ripple_energy(flat, ripple, found.r.T + sign * step) for sign in (1, -1)
            )
            own = node - lone.edge
            assert slopes[own] == pytest.approx((up[0] - down[0]) / 2e-5, rel=1e-5)
            change = (up[1] - down[1]) / 2e-5
            assert curves[own] == pytest.approx(change, rel=1e-5, abs=1e-6)


def test_the_amplitude_is_the_one_of_least_energy_and_the_waves_too() -> None:
    """Summed over a fine mesh, stretching and bending of a tilted rim are least where it says."""
    lone = Balloon()
    found = inflate(lone, 6.0)
    (ripple,) = ripples_at((lone,), [coordinates(found.r, found.z)])
    hoop = ((found.r[0, 1:] + found.r[0, :-1]) / (lone.nodes[1:] + lone.nodes[:-1])) ** 2 / 2 - 0.5
    tension = lone.membrane_stiffness * (
        (np.hypot(np.diff(found.r[0]), np.diff(found.z[0])) / np.diff(lone.nodes)) ** 2 / 2 - 0.5
    )
    edges = np.linspace(0, 1, 2001)
    s = lone.ring * (edges[1:] + edges[:-1]) / 2
    r, ds = lone.pocket + s, lone.ring / 2000
    strain = np.interp(r, (lone.nodes[1:] + lone.nodes[:-1]) / 2, hoop)
    plate = lone.modulus * (2 * lone.thickness) ** 3 / 12
    turned = math.pi * lone.pocket * 2 * math.sqrt(lone.bending_stiffness * tension[lone.edge - 1])

    def energy(tilt: float, n: int) -> float:
        around = (1 / r - n**2 * s / r**2) ** 2
        bent = plate / (1 - lone.poisson**2) * around
        bent = bent + 2 * plate / (1 + lone.poisson) * n**2 * (1 / r - s / r**2) ** 2
        relief = tilt**2 * (n**2 * s**2 / r**2 - s / r) / 4
        stretched = 2 * lone.membrane_stiffness * (strain + relief) ** 2 * math.tau * r / 2
        return float(((math.pi * r * bent * tilt**2 / 2 + stretched) * ds).sum()) + (
            turned * tilt**2 / 2
        )

    tilts = np.linspace(0, 0.6, 601)
    best = min((energy(tilt, n), tilt, n) for tilt in tilts for n in range(2, 20))
    least = balloon.ripple_energy(lone, ripple, found.r.T)[0][0]
    told = (-2 * least / ripple.stiff[0]) ** 0.25
    assert ripple.waves[0] == pytest.approx(best[2], abs=1)
    assert told == pytest.approx(
        min((energy(tilt, int(ripple.waves[0])), tilt) for tilt in tilts)[1], rel=0.05
    )


def test_force_is_still_what_the_air_gains() -> None:
    """The work of the air is that of the plates and what films and rim store (virtual work)."""
    ring = replace(Balloon(), neck=1.25, bore=0.5)
    found = inflate(ring, 8.0, [1.1, 1.104])
    gained = 8.0 * np.diff(found.volume) - np.diff(found.energy)
    assert gained == pytest.approx(found.force.mean() * np.diff(found.height), rel=0.03)
