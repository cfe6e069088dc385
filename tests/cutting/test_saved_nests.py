"""Saved placements come back for the same parts, and for nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from sbafab.cutting.nesting import as_dict, from_dict, nest
from sbafab.cutting.placements import NestPart, Stock
from sbafab.geometry.region import disc, rectangle

PARTS = (
    NestPart("demo", "P01", 1, "TPE", rectangle((0.1, 0.2), (9.3, 7.7)), 7),
    NestPart("demo", "P02", 1, "PTFE", disc((0.0, 0.0), 3.3), 5),
    NestPart("demo", "P03", 1, "TPE", disc((1.0, 0.0), 4.1), 3),
)
STOCKS = {
    "TPE": Stock(width=40, length=40, border=5),
    "PTFE": Stock(width=50, length=40, border=5, spacing=0.7),
}


@pytest.fixture
def saved() -> Any:
    return json.loads(json.dumps(as_dict(nest(PARTS, STOCKS))))


def test_the_same_nests_come_back(saved: Any) -> None:
    assert from_dict(saved, PARTS, STOCKS) == nest(PARTS, STOCKS)


@pytest.mark.parametrize(
    "parts",
    [
        PARTS[:2],
        (replace(PARTS[0], count=8), *PARTS[1:]),
        (replace(PARTS[0], region=rectangle((0.1, 0.2), (9.3, 7.70001))), *PARTS[1:]),
        (replace(PARTS[0], design="other"), *PARTS[1:]),
    ],
)
def test_other_parts_are_nested_anew(saved: Any, parts: tuple[NestPart, ...]) -> None:
    assert from_dict(saved, parts, STOCKS) is None


@pytest.mark.parametrize("data", [None, [], "x", 3, {}, {"key": 1}])
def test_what_is_no_saved_nest_is_ignored(data: object) -> None:
    assert from_dict(data, PARTS, STOCKS) is None


@pytest.mark.parametrize(
    "row",
    [
        [0, 0, 0, 1.0],
        [9, 0, 0, 1.0, 2.0],
        [0, -1, 0, 1.0, 2.0],
        [0, 0, 5, 1.0, 2.0],
        [0, 0, 0, float("nan"), 2.0],
        [0, 0, 0, "1", 2.0],
        [1, 0, 0, 1.0, 2.0],
        None,
    ],
)
def test_a_spoilt_row_is_ignored(saved: Any, row: object) -> None:
    saved["nests"]["TPE"][0] = row
    assert from_dict(saved, PARTS, STOCKS) is None


def test_another_stock_and_a_missing_row_or_material_are_nested_anew(saved: Any) -> None:
    stocks = {**STOCKS, "PTFE": STOCKS["PTFE"].model_copy(update={"spacing": 0.8})}
    assert from_dict(saved, PARTS, stocks) is None
    del saved["nests"]["TPE"][0]
    assert from_dict(saved, PARTS, STOCKS) is None
    del saved["nests"]["TPE"]
    assert from_dict(saved, PARTS, STOCKS) is None
