"""Values that are worked out once, and those that arcs keep."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass

from sbafab.geometry.cache import cached_attribute
from sbafab.geometry.edges import Arc, Line


@dataclass(frozen=True)
class Asked:
    times: list[int]

    @cached_attribute
    def value(self) -> float:
        """A value."""
        self.times.append(1)
        return 2.5


def test_a_value_is_worked_out_once_for_each_record() -> None:
    one, other = Asked([]), Asked([])
    assert [one.value, one.value, other.value] == [2.5, 2.5, 2.5]
    assert one.times == other.times == [1]
    assert Asked.value.__doc__ == "A value."


def test_what_was_asked_of_an_edge_changes_nothing_of_it() -> None:
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
