"""Copies side by side in the press."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.cutting.fixture import fixture
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import (
    design_runs,
    press_runs,
    runs_of,
)
from sbafab.pressing.press_force import footprint
from sbafab.pressing.schedule import schedule

INCH = 25.4


@pytest.mark.parametrize(
    ("copies", "size", "expected"),
    [
        # n of width w with 5 between them take n w + (n - 1) 5.
        (3, (40.0, 40.0), (3, 1)),
        (9, (47.4666, 47.4666), (9, 1)),
        (9, (47.5, 47.5), (4, 3)),
        (5, (100.0, 70.0), (2, 3)),
        (1, (10.0, 10.0), (1, 1)),
        (2, (150.0, 150.0), (1, 2)),
    ],
)
def test_as_many_as_the_heated_area_takes(
    copies: int, size: tuple[float, float], expected: tuple[int, int]
) -> None:
    runs = press_runs(copies, (-3.0, 2.0, size[0] - 3.0, size[1] + 2.0), (6 * INCH, 6 * INCH))
    assert (runs.together, runs.count) == expected


def laminate(*changes: str) -> Laminate:
    return build(load_design("1dof-5mm", changes))


def test_a_batch_fills_the_plate_in_rows_and_ends_in_a_smaller_cycle() -> None:
    # A plate of 6 mm round 4 columns of 20 and 3 rows of 30, 5 apart: 107 x 112.
    runs = press_runs(30, (-10.0, -5.0, 10.0, 25.0), (107.0, 112.0), 6.0)
    assert runs.cycles == (12, 12, 6)
    assert runs.places[:5] == ((0, 0), (25, 0), (50, 0), (75, 0), (0, 35))
    assert press_runs(30, (-10.0, -5.0, 10.0, 25.0), (106.99, 112.0), 6.0).together == 9


def test_one_plate_has_every_hole_of_every_place() -> None:
    column = laminate("stack.balloons=2")
    platen = (152.4, 152.4)
    runs = runs_of(column, 7, platen)
    plate = fixture(column, platen, runs.places)
    assert plate is not None
    holes = {(round(h.circle[0][0], 6), round(h.circle[0][1], 6)) for h in plate.holes if h.circle}
    assert holes == set(runs.places)
    # As large as the platen, and all that lies on it is in its middle, to the 0.1 mm it is cut to.
    x0, y0, x1, y1 = plate.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx(platen)
    low_x, low_y, high_x, high_y = column.bounds
    taken = [low_x, low_y, high_x + max(x for x, _ in runs.places)]
    taken.append(high_y + max(y for _, y in runs.places))
    assert taken[0] - x0 == pytest.approx(x1 - taken[2], abs=0.11)
    assert taken[1] - y0 == pytest.approx(y1 - taken[3], abs=0.11)
    assert min(taken[0] - x0, taken[1] - y0) > 5
    assert fixture(column, platen, ((0.0, 0.0),)) == fixture(column, platen)


def test_all_laminates_of_a_cycle_share_the_force() -> None:
    column = laminate("stack.balloons=6")
    design = load_design("1dof-5mm")
    one, twelve = schedule(column, design), schedule(column, design, (12, 1))
    for single, shared in zip(one.steps, twelve.steps, strict=True):
        assert shared.force_n == single.force_n
        pad = {item.part: item for item in shared.build_up}["press pad"]
        assert pad == {item.part: item for item in single.build_up}["press pad"]
        area = 12 * footprint(column, single.layers).area
        # What the films take and what the plate takes is the whole force.
        total = shared.film_kpa * area + shared.plate_kpa * (152.4**2 - area)
        assert total == pytest.approx(1000 * shared.force_n, rel=1e-3)
        assert shared.film_kpa <= single.film_kpa
    assert twelve.steps[-1].film_kpa < one.steps[-1].film_kpa


def test_a_cycle_takes_what_one_person_makes_in_eight_hours_or_what_is_ordered() -> None:
    # 45 + 7 x 60 = 465 min fit in 480, and 45 + 8 x 60 do not; ten have room on the plate.
    for most, cycles in (
        ("", (7, 7, 6)),
        ("order.at_once=10", (10, 10)),
        ("order.at_once=3", (3,) * 6 + (2,)),
    ):
        changes = [*filter(None, [most]), "stack.balloons=2", "order.copies=20"]
        design = load_design("1dof-5mm", changes)
        assert design_runs(design, build(design)).cycles == cycles
