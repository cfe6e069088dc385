"""Wide pockets whose films wave in step with the rim, as in CalculiX."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

from docs.scripts.ripple_sector import Sector, sector_states
from sbafab.models.balloon import inflate
from sbafab.models.film_elements import Balloon
from sbafab.models.rim_correction import compressed_shapes, free_shapes, is_corrected

WIDE = Balloon(5.0)
INNER = Balloon(5.0, neck=1.27, bore=0.52)


def test_wide_pockets_rise_as_in_calculix() -> None:
    """An even ripple of d = 15 with 18 waves: stroke in mm, air in ul (``python -m
    docs.scripts.ripple_sector 15 18 even``).
    """
    pressures = [0.5, 1.0, 2.0]
    wide = Balloon(7.5)
    found = free_shapes(wide, pressures)
    assert found.height == pytest.approx([4.379, 5.286, 6.081], rel=0.03)
    assert found.volume == pytest.approx([382.45, 444.93, 496.81], rel=0.03)
    assert (inflate(wide, pressures).height < 0.96 * found.height).all()


def test_narrow_pockets_unlike_films_and_other_laws_are_as_before() -> None:
    for one in (
        Balloon(2.5),
        replace(WIDE, order=6),
        replace(WIDE, wrinkles=False),
        replace(WIDE, mate=Balloon(5.0, thickness=0.05)),
    ):
        assert not is_corrected(one)
        assert free_shapes(one, 1.0).height == inflate(one, 1.0).height
    # Far beyond their strains waves are pulled straight.
    assert free_shapes(WIDE, 100.0).height == pytest.approx(inflate(WIDE, 100.0).height, rel=2e-3)


def test_between_plates_force_and_volume_are_slopes_of_one_energy() -> None:
    """Of W(p, h), beside a smaller share of what wrinkles themselves keep (see ``balloon_map``)."""
    p, h, step = np.array([0.4, 1.5, 6.0]), np.array([1.0, 2.0, 3.0]), 1e-4
    found = compressed_shapes(INNER, p, h, tied=True)

    def potential(dp: float, dh: float) -> np.ndarray:
        one = compressed_shapes(INNER, p + dp, h + dh, tied=True)
        return np.asarray(one.energy - (p + dp) * one.volume)

    force = -(potential(0, step) - potential(0, -step)) / (2 * step)
    volume = -(potential(step, 0) - potential(-step, 0)) / (2 * step)
    assert found.force == pytest.approx(force, rel=0.03)
    assert found.volume == pytest.approx(volume, rel=0.03)


@pytest.mark.parametrize("pocket", [4.0, 6.0, 9.0])
def test_a_balloon_carries_nothing_at_its_free_height_and_all_pressed_flat(pocket: float) -> None:
    wide, p = Balloon(pocket, neck=1.27, bore=0.52), np.geomspace(0.05, 20.0, 12)
    free, area = free_shapes(wide, p), np.pi * pocket**2
    at = compressed_shapes(wide, p, free.height, tied=True)
    assert (np.abs(at.force) < 0.01 * p * area).all()
    assert at.volume == pytest.approx(free.volume, rel=0.02)
    flat = compressed_shapes(wide, p, 0.02, tied=True)
    assert flat.force == pytest.approx(inflate(wide, p, 0.02, tied=True).force, rel=1e-4)


def test_between_plates_volumes_rise_with_pressure_where_waves_begin() -> None:
    wide = Balloon(9.0, neck=1.27, bore=0.52)
    p, h = np.geomspace(0.05, 2.0, 12), np.array([0.8, 2.5, 4.0, 6.0])
    grid = [each.ravel() for each in np.meshgrid(p, h, indexing="ij")]
    found = compressed_shapes(wide, *grid, tied=True)
    assert (np.diff(found.volume.reshape(12, 4), axis=0) > -1e-9).all()


@pytest.mark.long
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_a_wide_pocket_that_ripples_in_calculix() -> None:
    pressures = [0.5, 1.0, 2.0]
    own = free_shapes(Balloon(3.5), pressures)
    found = sector_states(Sector(7.0, 9, round=5, even=True), pressures)
    assert own.height == pytest.approx([state.stroke for state in found], rel=0.03)
    assert own.volume == pytest.approx([state.air for state in found], rel=0.03)
