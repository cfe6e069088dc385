"""Which of many designs no other one betters in everything."""

from __future__ import annotations

from collections.abc import Sequence


def front(rows: Sequence[Sequence[float]], more: Sequence[bool]) -> list[int]:
    """Numbers of the rows that none betters, in their order; of equal ones the first.

    ``more`` says of each value whether more of it is better.
    """
    signed = [
        tuple(-value if up else value for value, up in zip(row, more, strict=True)) for row in rows
    ]
    order = sorted(range(len(signed)), key=lambda number: (signed[number], number))
    kept: list[int] = []
    # Whatever betters a row comes before it in this order.
    for number in order:
        if not any(_betters(signed[other], signed[number]) for other in kept):
            kept.append(number)
    return sorted(kept)


def _betters(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether it is nowhere worse; equal rows come in their order."""
    return all(a <= b for a, b in zip(one, other, strict=True))
