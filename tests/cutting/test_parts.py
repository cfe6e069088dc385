"""The parts of a laminate: every piece, counted over layers and copies."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.cutting.placements import parts_of


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


@pytest.mark.parametrize(
    ("copies", "wall", "base"),
    # Two films a balloon of six, less base, cap and the wall with the tab: 9 walls. A twentieth of
    # 9 is 0.45, of 54 is 2.7, of 180 is 9; of 1, 6 and 20 bases it is 0.05, 0.3 and 1.
    [(1, 1, 1), (6, 3, 1), (20, 9, 1)],
)
def test_every_pattern_has_a_twentieth_of_its_number_as_spares(
    copies: int, wall: int, base: int
) -> None:
    design = load_design("1dof-5mm", [f"order.copies={copies}"])
    laminate = build(design)
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    plain = parts_of(laminate, paths, copies)
    spared = parts_of(laminate, paths, copies, design.order.spare_parts)
    more = {}
    for few, many in zip(plain, spared, strict=True):
        layers = laminate.patterns[few.pattern]
        pieces = few.count / (copies * len(layers))
        more[layers[0].role, len(layers)] = (many.count - few.count) / pieces
    assert min(more.values()) >= 1
    assert more["wall", 9] == wall
    assert more["base", 1] == base
