"""Values that are worked out once, and those that arcs keep."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sbafab.geometry.edges import Arc
from sbafab.geometry.once import once


@dataclass(frozen=True)
class Asked:
    times: list[int]

    @once
    def value(self) -> float:
        """A value."""
        self.times.append(1)
        return 2.5


def test_a_value_is_worked_out_once_for_each_record() -> None:
    one, other = Asked([]), Asked([])
    assert [one.value, one.value, other.value] == [2.5, 2.5, 2.5]
    assert one.times == other.times == [1]
    assert Asked.value.__doc__ == "A value."


def test_an_arc_with_another_radius_keeps_nothing_of_the_first() -> None:
    arc = Arc((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0, True)
    assert math.isclose(arc.length, math.pi / 2)
    assert math.isclose(arc._replace(radius=2.0).length, math.pi)
    assert math.isclose(arc.reversed().sweep, -math.pi / 2)
    assert arc == Arc((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0, True)
