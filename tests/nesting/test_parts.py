"""The parts of a laminate: every piece, counted over layers and copies."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.nesting.parts import parts_of


@pytest.mark.parametrize(("copies", "template"), [(1, "3dof-15mm"), (4, "radial-15mm")])
def test_the_parts_hold_all_film_of_the_laminate(copies: int, template: str) -> None:
    laminate = build(load_design(template))
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    parts = parts_of(laminate, paths, copies)
    for material in ("TPE", "PTFE"):
        layers = [layer for layer in laminate.layers if layer.film.material == material]
        chosen = [part for part in parts if part.material == material]
        area = copies * sum(layer.profile.area for layer in layers)
        assert sum(part.count * part.region.area for part in chosen) == pytest.approx(area)
        pieces = copies * sum(len(layer.profile.pieces) for layer in layers)
        assert sum(part.count for part in chosen) == pieces
    assert {part.design for part in parts} == {laminate.name}


def test_masks_of_three_equal_discs_are_one_part() -> None:
    """15 balloons of three chambers: 14 masks without strips fall in three discs each."""
    laminate = build(load_design("3dof-15mm"))
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    (discs,) = (part for part in parts_of(laminate, paths, 2) if part.count == 2 * 14 * 3)
    assert discs.piece == 1
    assert laminate.patterns[discs.pattern][0].role == "chamber-mask"


def test_spares_are_cut_of_every_mask_and_of_no_film() -> None:
    laminate = build(load_design("3dof-15mm"))
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    plain, spared = parts_of(laminate, paths, 2), parts_of(laminate, paths, 2, 3)
    for part, more in zip(plain, spared, strict=True):
        masks = 2 * len(laminate.patterns[part.pattern])
        sets = 3 if part.material == "PTFE" else 0
        assert more.count - part.count == sets * part.count / masks
