"""Layers and lists in words."""

from __future__ import annotations

from collections.abc import Sequence


def listed(words: Sequence[str]) -> str:
    """One, two and three."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def named(layers: Sequence[int]) -> str:
    """Layer indices in words; never 2-3, which a spreadsheet takes for a date."""
    runs: list[list[int]] = []
    for index in layers:
        if runs and index == runs[-1][1] + 1:
            runs[-1][1] = index
        else:
            runs.append([index, index])
    if not runs:
        return "none"
    words = [
        word
        for first, last in runs
        for word in (
            [f"{first} to {last}"] if last > first + 1 else map(str, range(first, last + 1))
        )
    ]
    return f"layer{'s' if len(layers) > 1 else ''} {listed(words)}"
