"""What the families build, against areas and distances by closed formulas."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design
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


@pytest.mark.parametrize("name", TEMPLATES)
@pytest.mark.parametrize("balloons", [1, 3])
def test_every_layer_has_the_pieces_its_role_asks_for(name: str, balloons: int) -> None:
    for layer in laminate(name, f"stack.balloons={balloons}").layers:
        assert len(layer.profile.pieces) == layer.pieces, layer.name


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
