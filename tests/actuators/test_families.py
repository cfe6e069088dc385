"""What the families build, against areas and distances by closed formulas."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import sbafab
from sbafab.actuators import build, load_design
from sbafab.design.identity import design_sha256
from sbafab.design.records import design_toml
from sbafab.errors import DesignError
from sbafab.geometry.edges import distance_to
from sbafab.laminate.laminate import Laminate

TEMPLATES = ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"]


def laminate(name: str, *assignments: str) -> Laminate:
    return build(load_design(name, assignments))


@pytest.mark.parametrize("name", TEMPLATES)
@pytest.mark.parametrize("balloons", [1, 2, 3, 7])
def test_n_balloons_are_2n_tpe_n_chamber_masks_and_n_minus_1_separators(
    name: str, balloons: int
) -> None:
    lam = laminate(name, f"stack.balloons={balloons}")
    stack = [layer for layer in lam.layers if layer.balloon is not None]
    roles = [layer.role for layer in stack]
    assert len([layer for layer in stack if not layer.is_mask]) == 2 * balloons
    assert roles.count("chamber-mask") == balloons
    assert roles.count("separator-mask") == balloons - 1
    assert (roles[0], roles[-1]) == ("base", "cap")
    assert [layer.index for layer in lam.layers] == list(range(1, len(lam.layers) + 1))


@pytest.mark.parametrize("count", range(2, 9))
def test_lobes_keep_one_bond_from_lumen_and_from_each_other(count: int) -> None:
    lam = laminate("3dof-15mm", f"chamber.count={count}", "stack.balloons=2")
    mask = lam.layer(6).profile
    assert len(mask.pieces) == count
    from_lumen = min(distance_to(edge, (0.0, 0.0)) for edge in mask.edges) - 1.0
    centres = [chamber.centres[0] for chamber in lam.chambers]
    between = min(math.dist(a, b) for a in centres for b in centres if a != b) - 5.0
    assert min(from_lumen, between) == pytest.approx(0.75)
    assert from_lumen >= 0.75 - 1e-9
    assert between >= 0.75 - 1e-9
    # The axes leave 4.25 once neighbouring pockets would come nearer than one bond: N >= 5.
    raised = (2.5 + 0.375) / math.sin(math.pi / count) > 4.25
    assert bool(lam.notes) is raised


@pytest.mark.parametrize(
    ("sizes", "reaches"),
    [
        # Half the smaller neighbour's pocket, its bond and one overhang.
        ([10, 6, 5], [4.25, 3.75]),
        ([5, 5, 4], [3.75, 3.25]),
        # The third balloon faces the first past the second, and is masked all over.
        ([10, 5, 6], [3.75, 4.25]),
    ],
)
def test_masks_of_a_tapered_stack_reach_as_far_as_films_face_each_other(
    sizes: list[int], reaches: list[float]
) -> None:
    lam = laminate("1dof-5mm", "stack.balloons=3", f"chamber.diameter={sizes}")
    separators = [layer.profile for layer in lam.layers if layer.role == "separator-mask"]
    assert [round(profile.bounds[2], 6) for profile in separators] == reaches
    caps = [layer.profile for layer in lam.layers if layer.role == "cap"]
    assert caps[0].bounds[0] == pytest.approx(-(sizes[-1] / 2 + 0.75))


def test_manifold_joins_the_bottom_pockets_and_has_one_inlet() -> None:
    lam = laminate("radial-15mm", "inlet.manifold=true", "stack.balloons=2")
    assert len(lam.inlets) == 1
    assert len(lam.chambers) == 1
    bottom, top = [layer.profile for layer in lam.layers if layer.role == "chamber-mask"]
    assert len(bottom.pieces) == 1
    assert len(top.pieces) == 3


# Chambers solved from what the actuator must fit, against the geometry in closed form.


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
    with pytest.raises(DesignError, match=r"fits.outline to at least 21\.000"):
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
