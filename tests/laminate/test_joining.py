"""The order of presses, seams and folds, and the conflicts that leave none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, rectangle
from sbafab.laminate.films import Film
from sbafab.laminate.folding import flat_part, fold_roots, halves, toward
from sbafab.laminate.joining import joinings
from sbafab.laminate.joints import FaceBond, Fold, Seam, balloon_numbers, chamber_gaps
from sbafab.laminate.laminate import Chamber, Laminate, Layer
from sbafab.pressing.schedule import schedule
from tests.designs import drawn, failing, tables

COATED = Film("COAT", "coated nylon", 0.1, None, 160.0, 250.0, faces=("pu", "nylon"))
MASK = Film("PTFE", "PTFE film", 0.025, 2200.0, 260.0, 260.0, "mask")
SOLID = Film("PET", "PET", 0.05, None, None, 400.0, stays_solid=True)
PLATE = rectangle((-10.0, -10.0), (10.0, 10.0))
WELD = FaceBond("weld", ("pu", "pu"), "hot-tip", 180.0)
SPOT = FaceBond("spot", ("nylon", "nylon"), "laser")
PRESSED = FaceBond("pressed", ("nylon", "nylon"), "press", 120.0)


def laminate(*films: Film, turned: tuple[int, ...] = (), profile: Region = PLATE) -> Laminate:
    roles = ["chamber-mask" if film.is_mask else "wall" for film in films]
    layers = tuple(
        Layer(i, role, film, profile, balloon, 0.1 * i, 1, film.material, i in turned)
        for i, (role, film, balloon) in enumerate(
            zip(roles, films, balloon_numbers(roles, chamber_gaps(roles, ())), strict=True), start=1
        )
    )
    chamber = Chamber("a", ((0.0, 0.0),))
    return Laminate("t", "t", layers, (chamber,), (), (), (), None, 1, "channel-pin")


def seam(name: str, below: int, above: int, half: float, order: int, **keys: str) -> Seam:
    """A square seam round the middle, 1 mm wide."""
    path = (rectangle((-half, -half), (half, half)).contours[0].edges,)
    return Seam(name, below, above, path, 1.0, keys.get("tool", "hot-tip"), "lap", order)  # type: ignore[arg-type]


def crossing(below: Seam, above: Seam) -> tuple[Seam, Seam]:
    """The two seams as rims that each go across the pocket of the other."""
    tall, wide = rectangle((-4.0, -9.0), (4.0, 9.0)), rectangle((-9.0, -4.0), (9.0, 4.0))
    return (
        replace(below, path=(tall.contours[0].edges,)),
        replace(above, path=(wide.contours[0].edges,)),
    )


def order(stack: Laminate) -> list[str]:
    return [step.seam.name if step.seam else step.process for step in joinings(stack)]


def test_seams_are_made_as_listed_where_nothing_bars_it() -> None:
    stack = laminate(COATED, COATED, turned=(2,))
    stack = replace(stack, seams=(seam("b", 1, 2, 5, 2), seam("a", 1, 2, 8, 1)), bonds=(WELD,))
    assert order(stack) == ["a", "b"]


def test_a_seam_that_would_weld_a_third_film_is_made_before_it_is_laid() -> None:
    stack = laminate(COATED, COATED, COATED, COATED, turned=(2, 4))
    seams = (
        seam("low", 1, 2, 8, 1),
        seam("neck", 2, 3, 2, 2, tool="laser"),
        seam("top", 3, 4, 6, 3),
    )
    stack = replace(stack, seams=seams, bonds=(WELD, SPOT))
    # The neck is covered from both sides once both pouches are closed; the smaller rim of the upper
    # pouch lies over the lower one's pocket, and not the other way.
    assert order(stack) == ["neck", "top", "low"]
    # Layer 3 lies over the seam of layers 1 and 2, and melts; over the other two lies nothing.
    assert [step.from_below for step in joinings(stack)] == [False, False, True]
    reasons = [step.reason for step in joinings(stack)]
    assert "melt under the tool" in reasons[0]
    assert "weld layers 1 and 2 too" in reasons[1]


def test_no_order_is_named_by_its_conflict() -> None:
    stack = laminate(COATED, COATED, COATED, COATED, turned=(2, 4))
    seams = (
        seam("low", 1, 2, 8, 1),
        seam("neck", 2, 3, 2, 2, tool="laser"),
        seam("top", 3, 4, 6, 3),
    )
    low, top = crossing(seams[0], seams[2])
    stack = replace(stack, seams=(low, seams[1], top), bonds=(WELD, SPOT))
    with pytest.raises(
        DesignError, match=r"seam top of .* would weld layers 1 and 2 too, over .* mm2"
    ):
        joinings(stack)


def test_faces_that_nothing_bonds_are_named() -> None:
    stack = replace(laminate(COATED, COATED), bonds=(WELD,))
    with pytest.raises(
        DesignError, match="layers 1 and 2 face each other with pu and nylon, which"
    ):
        joinings(stack)
    with pytest.raises(
        DesignError, match="seam a: layers 1 and 2 face each other with pu and nylon"
    ):
        joinings(replace(stack, seams=(seam("a", 1, 2, 5, 1),)))


def test_presses_come_first_unless_a_bond_says_otherwise() -> None:
    stack = laminate(COATED, COATED, COATED, turned=(2,))
    seams = (seam("a", 1, 2, 8, 1),)
    stack = replace(stack, seams=seams, bonds=(WELD, PRESSED))
    # Layer 3 lies with its nylon on the nylon of layer 2.
    assert order(replace(stack, bonds=(WELD, PRESSED))) == ["press", "a"]
    late = (WELD, replace(PRESSED, after="weld"))
    assert order(replace(stack, bonds=late)) == ["a", "press"]


def test_a_press_that_melts_the_open_faces_of_a_seam_is_refused() -> None:
    stack = laminate(COATED, COATED, COATED, turned=(2,))
    cool = (replace(WELD, temperature_c=130.0), replace(PRESSED, after="weld"))
    cold = replace(COATED, softens_above=110.0)
    layers = tuple(replace(layer, film=cold) for layer in stack.layers)
    stack = replace(stack, layers=layers, seams=(seam("a", 1, 2, 8, 1),), bonds=cool)
    with pytest.raises(
        DesignError, match="135 would weld the whole area of layers 1 and 2, which seam a"
    ):
        schedule(stack, load_design("1dof-5mm"))
    hot = replace(stack, bonds=(replace(WELD, temperature_c=180.0), cool[1]))
    assert [step.step for step in schedule(hot, load_design("1dof-5mm")).seams] == [1]


def test_films_that_bond_in_the_press_cannot_lie_in_it_beside_a_seam() -> None:
    plain = replace(COATED, faces=None)
    stack = laminate(plain, plain, MASK, plain)
    stack = replace(stack, seams=(seam("a", 1, 2, 8, 1),))
    # The press comes first, with layers 2 to 4 alone; then the mask shields the pocket above.
    assert order(stack) == ["press", "a"]


def test_a_cover_that_stays_solid_lets_the_heat_through() -> None:
    stack = laminate(SOLID, COATED, COATED, SOLID, turned=(3,))
    seams = (
        seam("one", 1, 2, 9, 1, tool="laser"),
        seam("two", 3, 4, 9, 2, tool="laser"),
        seam("rim", 2, 3, 6, 3),
    )
    bonds = (
        WELD,
        FaceBond("low", ("pet", "nylon"), "laser"),
        SPOT,
    )
    assert order(replace(stack, seams=seams, bonds=bonds)) == ["one", "two", "rim"]
    steps = joinings(replace(stack, seams=seams, bonds=bonds))
    assert not any(step.from_below for step in steps)


def test_a_fold_comes_before_what_is_bonded_in_it() -> None:
    stack = laminate(COATED, COATED, turned=(2,))
    fold = Fold(1, 2, ((10.0, -10.0), (10.0, 10.0)))
    stack = replace(stack, seams=(seam("a", 1, 2, 8, 1),), folds=(fold,), bonds=(WELD,))
    assert order(stack) == ["fold", "a"]


# Folded films: cut flat as one part, tight at the fold, read back as their halves.


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
