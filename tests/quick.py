"""Shares of long campaigns: a few cases in the suite, all others among the tests marked ``long``.

The suite and the run with ``SBAFAB_LONG=1`` together take every case, each of them once.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], count: int, *, names: int = 1, setting: str = "") -> list[Any]:
    """Return the cases of a parametrisation, all but ``count`` of them marked ``long``.

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
    last = len(listed) - 1
    stay = {round(last * place / max(1, count - 1)) for place in range(count)}
    return [case if number in stay else _long(case, names) for number, case in enumerate(listed)]


def _long(case: Any, names: int) -> Any:
    if hasattr(case, "marks"):
        return pytest.param(*case.values, marks=[*case.marks, pytest.mark.long], id=case.id)
    return pytest.param(*(case if names > 1 else (case,)), marks=pytest.mark.long)
