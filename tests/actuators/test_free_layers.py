"""Drawn layers in any order, and films bonded by seams: regions and findings by closed formulas."""

from __future__ import annotations

import math
import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from sbafab.actuators import build, load_design
from sbafab.design.files import template_text
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import press_steps
from sbafab.rules.deck import run_deck
from tests.designs import PAPER

FEW = PAPER.with_("rules.yield_builds=100")
SIDE, WIDTH, TAB = 40.0, 1.0, 4.0
WELDED: dict[str, Any] = {
    "name": "welded",
    "family": "drawn",
    "layers": [{"role": "base", "shape": "film"}, {"role": "cap", "shape": "film"}],
    "shapes": {
        "square": {"polygon": [[-23, -23], [23, -23], [23, 23], [-23, 23]]},
        "tab": {"slot": [[0, 0], [0, 30]], "width": 8},
        "film": {"union": ["square", "tab"]},
    },
    "seams": [
        {
            "name": "rim",
            "layers": [1, 2],
            "path": [
                [-2, 30],
                [-2, 20],
                [-20, 20],
                [-20, -20],
                [20, -20],
                [20, 20],
                [2, 20],
                [2, 30],
            ],
            "width": WIDTH,
            "tool": "hot-tip",
        }
    ],
    "chambers": [{"name": "pouch", "centres": [[0, 0]], "mouth": [0, 30], "angle": 90, "width": 3}],
}


def drawn(folder: Path, data: dict[str, Any]) -> Laminate:
    path = folder / "drawn.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return build(load_design(path))


def failing(laminate: Laminate) -> set[str]:
    return {finding.rule for finding in run_deck(laminate, FEW) if finding.verdict == "fail"}


def pouch() -> dict[str, Any]:
    return tomllib.loads(template_text("pouch"))


def test_a_seam_bonds_half_its_width_on_both_sides_of_its_path(tmp_path: Path) -> None:
    (gap,) = drawn(tmp_path, WELDED).interfaces
    length = 4 * SIDE - TAB + 2 * 10
    # Four corners outside the square bend one way, two at the tab the other; ends stand in the air.
    corner = WIDTH**2 / 4 * (1 - math.pi / 4)
    assert gap.bond.area == pytest.approx(length * WIDTH - 6 * corner)
    assert gap.kind == "chamber"
    assert not gap.pressed
    assert gap.unbonded.area == pytest.approx(gap.contact.area - gap.bond.area)


def test_a_welded_pouch_passes_and_a_gap_in_its_seam_leaks(tmp_path: Path) -> None:
    assert failing(drawn(tmp_path, WELDED)) == set()
    data = deepcopy(WELDED)
    data["seams"][0]["path"] = data["seams"][0]["path"][:-2]
    findings = {finding.rule: finding for finding in run_deck(drawn(tmp_path, data), FEW)}
    assert findings["sealing"].verdict == "fail"
    assert "close the path of the seam there, make it wider" in findings["sealing"].message
    assert "mask" not in findings["sealing"].message + findings["tube-fit"].message


def test_a_roller_ends_square_and_a_hot_tip_round(tmp_path: Path) -> None:
    data = deepcopy(WELDED)
    line = {"name": "line", "layers": [1, 2], "path": [[-5, 0], [5, 0]], "width": 2}
    for tool, area in (("roller", 20.0), ("hot-tip", 20.0 + math.pi)):
        data["seams"] = [{**line, "tool": tool}]
        (gap,) = drawn(tmp_path, data).interfaces
        assert gap.bond.area == pytest.approx(area)


def test_sheets_masks_and_films_stack_in_any_order(tmp_path: Path) -> None:
    data = pouch()
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


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        {"layers": [1, 3]},
        r"seam rim: layers \[1, 3\] are not two films that lie next to each other",
    ),
    ({"path": [[0, 0], [0, 0]]}, "has one corner of its path twice in a row"),
    ({"shape": "film"}, "has either a shape or a path; give one of the two"),
    ({"tool": "glue"}, "seams.0.tool = 'glue' must be"),
    ({"width": 0}, "seams.0.width = 0 must be"),
    ({"whidth": 1}, "seams.0.whidth is not a key of a design file; did you mean seams.0.width"),
]


@pytest.mark.parametrize(("change", "sentence"), REFUSED)
def test_a_bad_seam_is_refused_in_a_sentence(
    change: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    data = deepcopy(WELDED)
    data["seams"][0] |= change
    with pytest.raises(DesignError, match=sentence):
        drawn(tmp_path, data)


def test_masks_must_lie_between_films_and_have_one_role(tmp_path: Path) -> None:
    data = pouch()
    rows = data["layers"]
    data["layers"] = [*rows, rows[1]]
    with pytest.raises(DesignError, match="layer 4 is a chamber-mask with no film"):
        drawn(tmp_path, data)
    data["layers"] = [rows[0], rows[1], {**rows[1], "role": "separator-mask"}, rows[2]]
    with pytest.raises(DesignError, match="layer 3 is a separator-mask on a chamber-mask"):
        drawn(tmp_path, data)
