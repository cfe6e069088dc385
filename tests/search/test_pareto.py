"""The front against the definition, tried pair by pair."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from sbafab.search.sweep_report import front

FEW = st.integers(0, 4)


@settings(max_examples=25)
@given(st.lists(st.tuples(FEW, FEW, FEW), max_size=25))
def test_nothing_on_the_front_is_bettered_and_all_else_is(rows: list[tuple[int, int, int]]) -> None:
    kept = front(rows, (True, False, True))

    def betters(a: tuple[int, int, int], b: tuple[int, int, int]) -> bool:
        return a != b and a[0] >= b[0] and a[1] <= b[1] and a[2] >= b[2]

    for number, row in enumerate(rows):
        is_first = row not in rows[:number]
        assert (number in kept) == (is_first and not any(betters(other, row) for other in rows))
