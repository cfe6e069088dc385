"""Chambers solved from what the actuator must fit, against the geometry in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import sbafab
from sbafab.design.identity import design_sha256
from sbafab.design.records import design_toml
from sbafab.errors import DesignError

BOND, OVERHANG, TAB = 0.75, 0.5, 5.0


def _down(value: float) -> float:
    """To whole hundredths of a mm."""
    return math.floor(value * 100 + 1e-6) / 100


@pytest.mark.parametrize("asked", [16.0, 20.0, 33.3])
def test_a_stack_within_a_circle_tab_and_its_mask_counted(asked: float) -> None:
    design = sbafab.load("1dof-5mm", {"fits.diameter": asked})
    # The farthest corners: of the tab, one bond wider than its strip, and of the strip past it.
    half = design.strip_width / 2
    tab = math.sqrt(asked**2 / 4 - (half + BOND) ** 2) - BOND - TAB
    strip = math.sqrt(asked**2 / 4 - half**2) - BOND - TAB - OVERHANG
    assert design.chamber.diameter == pytest.approx(_down(2 * min(tab, strip)), abs=1e-9)


@pytest.mark.parametrize(("count", "lumen"), [(3, 3.0), (4, 3.0)])
def test_lobes_within_a_circle_tabs_not_counted(count: int, lumen: float) -> None:
    design = sbafab.load(
        "3dof-15mm", {"fits.outline": 20, "chamber.count": count, "lumen.diameter": lumen}
    )
    # Chambers touch bonds with the lumen's or with each other's, whichever is farther out.
    sine = math.sin(math.pi / count)
    by_lumen = 10 - lumen / 2 - 2 * BOND
    by_neighbour = 2 * (10 - BOND - BOND / (2 * sine)) / (1 + 1 / sine)
    assert design.chamber.diameter == pytest.approx(_down(min(by_lumen, by_neighbour)), abs=1e-9)


def test_what_is_solved_is_solved_again_and_what_is_given_is_held_to(tmp_path: Path) -> None:
    design = sbafab.load("3dof-15mm", "fits.outline=20")
    assert design.chamber.diameter == 7.5
    assert design.with_("bond.width=1").chamber.diameter == 7.0
    assert design.with_("fits.outline=15").chamber.diameter == 5.0
    given = design.with_("chamber.diameter=6")
    assert given.chamber.diameter == 6
    assert given.with_("bond.width=1").chamber.diameter == 6
    with pytest.raises(DesignError, match=r"fits.outline at least 21\.000"):
        sbafab.build(design.with_("chamber.diameter=8"))
    # A folder's design.toml names the chamber: it is the same design, and says the same.
    path = tmp_path / f"{design.name}.toml"
    path.write_text(design_toml(design))
    again = sbafab.load(path)
    assert design_sha256(again) == design_sha256(design)
    assert sbafab.build(again).notes == sbafab.build(design).notes
    assert "20.000 mm across without 3 inlet tabs" in sbafab.build(again).notes[0]


def test_both_limits_count_and_ears_are_named() -> None:
    both = {"fits.outline": 8, "fits.diameter": 20}
    found = sbafab.load("1dof-5mm", both).chamber.diameter
    assert found == 8 - 2 * BOND < sbafab.load("1dof-5mm", "fits.diameter=20").chamber.diameter
    eared = sbafab.build("1dof-5mm", "fits.diameter=30", registration={"method": "ears"})
    assert "1 inlet tab and the ears" in eared.notes[0]


def test_where_nothing_fits_the_smallest_is_said() -> None:
    with pytest.raises(DesignError, match=r"chamber.diameter = 2\.55, is .* mm too wide"):
        sbafab.load("1dof-5mm", "fits.diameter=14")
    # Chambers of 2.55: 2 x (1 + 2 bonds + 2.55) without tabs, which no shorter tab makes less.
    with pytest.raises(DesignError, match=r"make fits\.outline at least 10\.100$"):
        sbafab.load("3dof-15mm", "fits.outline=5")
    assert sbafab.load("3dof-15mm", "fits.outline=10.1").chamber.diameter == 2.55
    with pytest.raises(DesignError, match=r"make fits\.diameter at least .*inlet\.tab_length\)$"):
        sbafab.load("3dof-15mm", {"fits.diameter": 14, "fits.outline": 12})
    with pytest.raises(DesignError, match='belongs to "1dof", "lobed"'):
        sbafab.load("radial-15mm", "fits.diameter=20")
