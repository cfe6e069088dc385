"""Copies side by side in the press."""

from __future__ import annotations

import pytest

from sbafab.pressing.together import press_runs

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
