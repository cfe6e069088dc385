"""Folded films: cut flat as one part, tight at the fold, read back as their halves."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from sbafab.actuators import build, load_design
from sbafab.design.files import template_text
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.folding import flat_part, fold_roots, halves, toward
from sbafab.laminate.joints import Fold
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck
from tests.designs import PAPER

FEW = PAPER.with_("rules.yield_builds=100")
LINE = ((-20.0, -15.0), (-20.0, 15.0))


def folded(**changes: Any) -> dict[str, Any]:
    """A pouch of one film, 41 x 32 mm a half, folded at the left edge of its pocket."""
    data = tomllib.loads(template_text("pouch"))
    data["shapes"] |= {
        "body": {"polygon": [[-20, -16], [21, -16], [21, 16], [-20, 16]]},
        "film": {"union": ["body", "tab"]},
    }
    data["folds"] = [{"layers": [1, 3], "line": [*LINE]}]
    data.pop("mechanism", None)
    return {**data, **changes}


def drawn(folder: Path, data: dict[str, Any]) -> Laminate:
    path = folder / "drawn.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return build(load_design(path))


def failing(laminate: Laminate) -> set[str]:
    return {finding.rule for finding in run_deck(laminate, FEW) if finding.verdict == "fail"}


def test_a_folded_pouch_is_tight_at_its_fold_and_two_films_are_not(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, folded())
    assert failing(laminate) == set()
    apart = replace(laminate, folds=())
    assert {"sealing", "mask-overhang"} <= failing(apart)


def test_the_flat_part_is_both_halves_side_by_side(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, folded())
    lower, _, upper = laminate.layers
    flat = laminate.as_cut(lower)
    tab = 4 * (24 - 16)
    assert flat.area == pytest.approx(2 * (41 * 32 + tab))
    assert len(flat.pieces) == 1
    assert flat.bounds == pytest.approx((-61, -16, 21, 24))
    assert laminate.as_cut(upper) == flat
    assert (lower.turned, upper.turned) == (False, True)
    assert laminate.cut_with(upper) == 1


@pytest.mark.parametrize("degrees", [0.0, 17.0, 90.0, 213.0])
def test_an_accordion_of_three_is_read_back_from_its_flat_part(degrees: float) -> None:
    # Widths 7, 7 and 5 mm, folded at x = 7 and back at x = 0, and each with a hole of its own.
    plans = [(7.0, 1.0), (7.0, 1.5), (5.0, 0.7)]
    profiles = [
        (rectangle((0.0, 0.0), (width, 10.0)) - disc((3.0, 3.0 + radius), radius)).turned(degrees)
        for width, radius in plans
    ]
    right = rectangle((7.0, 0.0), (8.0, 10.0)).turned(degrees)
    left = rectangle((-1.0, 0.0), (0.0, 10.0)).turned(degrees)
    lines = [shared_edge(profiles[0], right), shared_edge(profiles[1], left)]
    folds = [
        Fold(1, 2, toward(lines[0], profiles[0])),
        Fold(2, 3, toward(lines[1], profiles[1])),
    ]
    flat = flat_part(1, folds, profiles)
    assert len(flat.pieces) == 1
    assert flat.area == pytest.approx(sum(profile.area for profile in profiles))
    assert fold_roots(folds) == {2: 1, 3: 1}
    back = halves(1, folds, flat)
    assert sorted(back) == [1, 2, 3]
    for index, profile in enumerate(profiles, start=1):
        assert (back[index] - profile).area == pytest.approx(0, abs=1e-6)
        assert (profile - back[index]).area == pytest.approx(0, abs=1e-6)


def shared_edge(a: Region, b: Region) -> tuple[tuple[float, float], tuple[float, float]]:
    def key(p: tuple[float, float]) -> tuple[float, float]:
        return round(p[0], 6), round(p[1], 6)

    ends = {frozenset(map(key, (edge.start, edge.end))) for edge in b.edges}
    (edge,) = (e for e in a.edges if frozenset(map(key, (e.start, e.end))) in ends)
    return edge.start, edge.end


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        {"folds": [{"layers": [1, 2], "line": [*LINE]}]},
        "are not two films that lie next to each other",
    ),
    (
        {"folds": [{"layers": [1, 3], "line": [[-19, -15], [-19, 15]]}]},
        "layer 1 has no edge on the line from x -19, y -15 to x -19, y 15",
    ),
    ({"folds": [{"layers": [1, 3], "line": [[1, 1], [1, 1]]}]}, "whose ends are one point"),
    ({"folds": [{"layers": [1, 3], "line": [*LINE]}] * 2}, "layer 3 is folded over twice"),
]


@pytest.mark.parametrize(("change", "sentence"), REFUSED)
def test_a_fold_that_no_film_can_make_is_refused_in_a_sentence(
    change: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(DesignError, match=sentence):
        drawn(tmp_path, folded(**change))


def with_layers(rows: Sequence[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    return {**folded(), "layers": [*rows], **changes}


def test_halves_of_two_films_or_over_each_other_are_refused(tmp_path: Path) -> None:
    base, mask, cap = folded()["layers"]
    films = {"thin": {"kind": "structural", "product": "thin", "thickness": 0.02}}
    rows = [base, mask, {**cap, "film": "thin"}]
    with pytest.raises(DesignError, match="they are of TPE and THIN, and halves of one film"):
        drawn(tmp_path, with_layers(rows, films=films))
    with pytest.raises(DesignError, match="layer 3 has turned = false, and folding turns it"):
        drawn(tmp_path, with_layers([base, mask, {**cap, "turned": False}]))
    data = folded()
    data["shapes"] |= {"flap": {"slot": [[-25, 0], [0, 0]], "width": 4}}
    data["shapes"]["wide"] = {"union": ["film", "flap"]}
    data["layers"] = [{**base, "shape": "wide"}, mask, cap]
    with pytest.raises(DesignError, match=r"the halves lie over each other on 20\.000 mm2"):
        drawn(tmp_path, data)


def test_halves_that_do_not_meet_on_the_line_are_refused(tmp_path: Path) -> None:
    data = folded()
    data["shapes"] |= {
        "low": {"polygon": [[-20, -16], [0, -16], [0, -2], [-20, -2]]},
        "high": {"polygon": [[-20, 2], [0, 2], [0, 16], [-20, 16]]},
        "small": {"polygon": [[-18, -5], [-10, -5], [-10, 5], [-18, 5]]},
    }
    data["layers"] = [
        {"role": "base", "shape": "low"},
        {"role": "chamber-mask", "shape": "small"},
        {"role": "cap", "shape": "high"},
    ]
    with pytest.raises(DesignError, match="laid flat its halves fall into 2 parts"):
        drawn(tmp_path, data)
