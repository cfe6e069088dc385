"""Shares of long campaigns: a few cases in the suite, all others among the tests marked ``long``.

The suite and the run with ``SBAFAB_LONG=1`` together take every case, each of them once. Of random
campaigns they take a share; ``SBAFAB_LONG=all`` takes all that the suite leaves out.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def few(
    cases: Iterable[Any], count: int, *, long: int | None = None, names: int = 1, setting: str = ""
) -> list[Any]:
    """Return the cases of a parametrisation, all but ``count`` of them marked ``long``; if ``long``
    is given, so many of them, and the rest ``campaign``.

    Those that stay in the suite lie evenly from the first to the last, and are the same in every
    run. A case is a value, a tuple where ``names`` is the number of several arguments, or a
    ``pytest.param``, which keeps its name and its marks. Where ``setting``, a variable of the
    environment that sizes the campaign, is given, all cases stay. A ``count`` below one raises
    ValueError.
    """
    if count < 1:
        raise ValueError(f"count = {count}; a campaign leaves one case or more in the suite")
    listed = list(cases)
    if setting in os.environ:
        return listed
    stay = _spread(range(len(listed)), count)
    rest = [number for number in range(len(listed)) if number not in stay]
    in_long = set(rest) if long is None else _spread(rest, long)
    return [
        case
        if number in stay
        else _marked(case, names, pytest.mark.long if number in in_long else pytest.mark.campaign)
        for number, case in enumerate(listed)
    ]


def _spread(numbers: Sequence[int], count: int) -> set[int]:
    """Return ``count`` of the numbers, evenly from the first to the last."""
    last = len(numbers) - 1
    if last < 0:
        return set()
    return {numbers[round(last * place / max(1, count - 1))] for place in range(count)}


def _marked(case: Any, names: int, mark: pytest.MarkDecorator) -> Any:
    if hasattr(case, "marks"):
        return pytest.param(*case.values, marks=[*case.marks, mark], id=case.id)
    return pytest.param(*(case if names > 1 else (case,)), marks=mark)
