"""Caches: values of records and edges, and results of functions by exact numbers."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass

from sbafab.geometry.cache import MOST, cached, cached_attribute
from sbafab.geometry.edges import Arc, Line
from sbafab.geometry.region import Region, difference, disc, rectangle


@dataclass(frozen=True)
class Record:
    times: list[int]

    @cached_attribute
    def value(self) -> float:
        """A value."""
        self.times.append(1)
        return 2.5


def test_a_value_is_worked_out_once_for_each_record() -> None:
    first, second = Record([]), Record([])
    assert [first.value, first.value, second.value] == [2.5, 2.5, 2.5]
    assert first.times == second.times == [1]
    assert Record.value.__doc__ == "A value."


def test_values_of_an_edge_do_not_change_it() -> None:
    arc, line = Arc((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0, True), Line((1.0, 0.0), (0.0, 2.0))
    fresh = Arc((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0, True)
    assert math.isclose(arc.length, math.pi / 2)
    assert arc.bounds == (0.0, 0.0, 1.0, 1.0)
    assert math.isclose(arc.reversed().sweep, -math.pi / 2)
    assert arc == fresh
    assert hash(arc) == hash(fresh)
    assert arc != arc.reversed()
    assert len({arc, fresh, line, line.reversed()}) == 3
    assert pickle.loads(pickle.dumps([arc, line])) == [fresh, line]
    assert repr(line) == "Line(start=(1.0, 0.0), end=(0.0, 2.0))"


def test_a_hair_makes_another_key_and_few_results_are_kept() -> None:
    calls: list[Region] = []

    @cached
    def area(region: Region, times: float = 1.0) -> float:
        calls.append(region)
        return times * region.area

    exact, hair = disc((0.0, 0.0), 2.0), disc((0.0, 0.0), 2.0 + 1e-9)
    assert exact == hair, "regions are equal within SAME"
    assert area(exact) == area(disc((0.0, 0.0), 2.0)) != area(hair)
    assert area(exact, 2.0) == 2 * area(exact)
    assert len(calls) == 3
    for k in range(MOST + 1):
        area(disc((0.0, 0.0), 3.0 + k))
    area(exact)
    assert len(calls) == 3 + MOST + 1 + 1


def test_a_boolean_of_the_same_regions_is_worked_out_once() -> None:
    def cut() -> Region:
        return difference(rectangle((0.0, 0.0), (7.0, 3.0)), disc((0.0, 0.0), 2.25))

    assert cut() is cut()
