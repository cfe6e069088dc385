"""Drawn layers in any order, and films bonded by seams: regions and findings by closed formulas."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sbafab.laminate.lay_up import press_steps
from sbafab.rules.deck import run_deck
from tests.designs import FEW, drawn, failing, tables

SIDE, WIDTH, TAB = 40.0, 1.0, 4.0


def test_a_seam_bonds_half_its_width_on_both_sides_of_its_path(tmp_path: Path) -> None:
    (gap,) = drawn(tmp_path, tables("welded")).interfaces
    length = 4 * SIDE - TAB + 2 * 10
    # Four corners outside the square bend one way, two at the tab the other; ends stand in the air.
    corner = WIDTH**2 / 4 * (1 - math.pi / 4)
    assert gap.bond.area == pytest.approx(length * WIDTH - 6 * corner)
    assert gap.kind == "chamber"
    assert not gap.pressed
    assert gap.unbonded.area == pytest.approx(gap.contact.area - gap.bond.area)


def test_a_welded_pouch_passes_and_a_gap_in_its_seam_leaks(tmp_path: Path) -> None:
    assert failing(drawn(tmp_path, tables("welded"))) == set()
    data = tables("welded")
    data["seams"][0]["path"] = data["seams"][0]["path"][:-2]
    findings = {finding.rule: finding for finding in run_deck(drawn(tmp_path, data), FEW)}
    assert findings["sealing"].verdict == "fail"
    assert "close the path of the seam there, make it wider" in findings["sealing"].message
    assert "mask" not in findings["sealing"].message + findings["tube-fit"].message


def test_a_roller_ends_square_and_a_hot_tip_round(tmp_path: Path) -> None:
    data = tables("welded")
    line = {"name": "line", "layers": [1, 2], "path": [[-5, 0], [5, 0]], "width": 2}
    for tool, area in (("roller", 20.0), ("hot-tip", 20.0 + math.pi)):
        data["seams"] = [{**line, "tool": tool}]
        (gap,) = drawn(tmp_path, data).interfaces
        assert gap.bond.area == pytest.approx(area)


def test_sheets_masks_and_films_stack_in_any_order(tmp_path: Path) -> None:
    data = tables("pouch")
    film, mask = {"shape": "film"}, {"role": "chamber-mask", "shape": "mask"}
    data["layers"] = [
        {"role": "sheet", **film},
        {"role": "base", **film},
        mask,
        mask,
        {"role": "wall", **film},
        {"role": "cap", **film},
    ]
    laminate = drawn(tmp_path, data)
    assert [gap.kind for gap in laminate.interfaces] == ["bond", "chamber", "bond"]
    assert [layer.balloon for layer in laminate.layers] == [None, 1, 1, 1, 1, 1]
    assert failing(laminate) == set()
    assert laminate.interfaces[1].gap == pytest.approx(2 * laminate.layers[2].film.thickness)
    steps = press_steps(laminate)
    added = sorted(index for step in steps for index in step.adds)
    assert added == [layer.index for layer in laminate.layers]
