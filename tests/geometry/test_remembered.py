"""Answers are kept for the same numbers alone, and not more of them than are said."""

from __future__ import annotations

from sbafab.geometry.cache import MOST, cached
from sbafab.geometry.region import Region, difference, disc, rectangle


def test_what_differs_by_a_hair_is_asked_for_again_and_few_answers_are_kept() -> None:
    asked: list[Region] = []

    @cached
    def area(region: Region, times: float = 1.0) -> float:
        asked.append(region)
        return times * region.area

    one, hair = disc((0.0, 0.0), 2.0), disc((0.0, 0.0), 2.0 + 1e-9)
    assert one == hair, "regions are equal within SAME"
    assert area(one) == area(disc((0.0, 0.0), 2.0)) != area(hair)
    assert area(one, 2.0) == 2 * area(one)
    assert len(asked) == 3
    for k in range(MOST + 1):
        area(disc((0.0, 0.0), 3.0 + k))
    area(one)
    assert len(asked) == 3 + MOST + 1 + 1


def test_a_boolean_of_the_same_regions_is_worked_out_once() -> None:
    def cut() -> Region:
        return difference(rectangle((0.0, 0.0), (7.0, 3.0)), disc((0.0, 0.0), 2.25))

    assert cut() is cut()
