"""Which values a key takes, and which designs come of several keys."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pandas as pd
import pytest

import sbafab
from sbafab.design.records import Free
from sbafab.errors import DesignError
from sbafab.search.vary import (
    grid,
    latin_hypercube,
    read_varied,
    refuse_unknown,
    varied_keys,
)

READ: dict[str, tuple[object, ...]] = {
    # A tenth has no exact binary form: steps of it must not drift.
    "a=0.1:0.5:0.1": (0.1, 0.2, 0.3, 0.4, 0.5),
    "a=4:8:2": (4, 6, 8),
    "a=4:7.9:2": (4, 6),
    "a=38 um:0.04:1 um": (0.038, 0.039, 0.04),
    "a=3,6.5": (3.0, 6.5),
    "a=ears,channel-pin": ("ears", "channel-pin"),
    'a="0.5 mm",1': ("0.5 mm", 1),
    "a=[5, 6],[7, 8]": ([5, 6], [7, 8]),
    "a=true,false": (True, False),
    "a=7": (7,),
}
PYTHON: dict[str, Any] = {
    "4:8:0.5": np.linspace(4, 8, 9),
    "3,4,5": np.arange(3, 6),
    "3:5:1": range(3, 6),
    "4,4.5": pd.Series([4.0, 4.5]),
    "3,4.5": [np.int64(3), np.float32(4.5)],
    "[5, 6],[7, 8]": np.array([[5, 6], [7, 8]]),
    "4.5": np.float64(4.5),
    "4:8": "4:8",
    "ears,channel-pin": ["ears", "channel-pin"],
}
REFUSED: list[tuple[Any, str]] = [
    ("a", "KEY=VALUES"),
    ("=3", "KEY=VALUES"),
    ("a=8:4:1", "smaller number first"),
    ("a=1:2:0", "STEP = 0"),
    ("a=1:2:-1", "STEP = -1"),
    ("a=1:x:1", "must be a length"),
    ("a=1:2:3:4", "START:STOP:STEP"),
    ("a=0:1000:0.001", "the limit is 10,000"),
    ("a=3,4,3", "3 twice"),
    ({"a": []}, "vary has no values for a"),
    ({"a": [3, np.int64(3)]}, "lists 3 twice"),
    ({"a": np.arange(10_001)}, "a has 10,001 values; the limit is 10,000"),
    ({"a": "8:4"}, "smaller number first"),
]


@pytest.mark.parametrize("text", READ)
def test_values(text: str) -> None:
    found = read_varied(text).values
    assert found == READ[text]
    assert [type(one) for one in found] == [type(one) for one in READ[text]]


@pytest.mark.parametrize("text", PYTHON)
def test_values_of_python_are_those_of_a_text(text: str) -> None:
    (found,) = varied_keys({"a": PYTHON[text]})
    (written,) = varied_keys([f"a={text}"])
    assert found.values == written.values
    assert [type(one) for one in found.values] == [type(one) for one in written.values]


@pytest.mark.parametrize(("vary", "said"), REFUSED)
def test_what_is_no_range_is_said(vary: Any, said: str) -> None:
    with pytest.raises(DesignError, match=said):
        varied_keys(vary)


def test_unknown_keys_and_keys_without_any_good_value_are_refused() -> None:
    design = sbafab.load("1dof-5mm")
    for text, said in [
        ("chamber.diametre=4,5", "did you mean chamber.diameter"),
        ("lumen.diameter=4,5", "not a key"),
        ("chamber.diameter=-3,-2", "must be at least"),
    ]:
        with pytest.raises(DesignError, match=said):
            refuse_unknown(design, [read_varied(text)])
    with pytest.raises(DesignError, match="given twice"):
        refuse_unknown(design, [read_varied("bond.width=1,2")] * 2)
    # One bad value of several is a row of its own.
    refuse_unknown(design, [read_varied("chamber.diameter=-3,5")])


def test_a_grid_has_every_combination_once() -> None:
    found = [
        tuple(v.values())
        for v in grid([Free.of_choices("a", (1, 2, 3)), Free.of_choices("b", ("x", "y"))])
    ]
    assert found == [(1, "x"), (1, "y"), (2, "x"), (2, "y"), (3, "x"), (3, "y")]
    with pytest.raises(DesignError, match="has no step"):
        grid([read_varied("a=1:2")])
    with pytest.raises(DesignError, match="the limit is 100,000"):
        grid([Free.of_choices(key, range(1000)) for key in "ab"])


def test_a_latin_hypercube_takes_every_part_of_every_range_once() -> None:
    varied = [read_varied("a=2:6"), read_varied("b=1,2,3,4"), read_varied("c=0:1")]
    drawn = list(latin_hypercube(varied, 40, 7))
    for key, low, high in (("a", 2, 6), ("c", 0, 1)):
        parts = [math.floor((row[key] - low) / (high - low) * 40) for row in drawn]
        assert sorted(parts) == list(range(40))
    assert Counter(row["b"] for row in drawn) == {1: 10, 2: 10, 3: 10, 4: 10}
    assert drawn == list(latin_hypercube(varied, 40, 7))
    assert drawn != list(latin_hypercube(varied, 40, 8))
    assert len(list(latin_hypercube([Free.of_choices("b", (1, 2))], 40, 7))) == 2
