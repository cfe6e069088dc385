"""Folded films: cut flat as one part, tight at the fold, read back as their halves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.folding import flat_part, fold_roots, halves, toward
from sbafab.laminate.joints import Fold
from tests.designs import drawn, failing, tables


def test_a_folded_pouch_is_tight_at_its_fold_and_two_films_are_not(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, tables("folded"))
    assert failing(laminate) == set()
    apart = replace(laminate, folds=())
    assert {"sealing", "mask-overhang"} <= failing(apart)


def test_the_flat_part_is_both_halves_side_by_side(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, tables("folded"))
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
