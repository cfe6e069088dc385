"""The spyrrow engine, where it is installed: sheets imitated by a strip."""

from __future__ import annotations

import sys

import pytest
from shapely.geometry import Polygon

from sbafab.errors import DesignError, SbafabError
from sbafab.geometry.region import Region, disc, rectangle, stadium
from sbafab.nesting.check import check_nest
from sbafab.nesting.engines import SAGITTA, _outline
from sbafab.nesting.nest import nest
from sbafab.nesting.records import Nest, NestPart, Stock


def part(region: Region, count: int, pattern: str = "P01") -> NestPart:
    return NestPart("demo", pattern, 1, "TPE", region, count)


def nested(parts: list[NestPart], stock: Stock, seconds: float = 1) -> Nest:
    pytest.importorskip("spyrrow")
    (result,) = nest(parts, {"TPE": stock}, "spyrrow", seconds)
    check_nest(result)
    return result


def test_parts_that_do_not_fit_one_sheet_go_to_the_next() -> None:
    """16 squares of 10 mm take 43 x 43 mm; one more takes a second sheet."""
    stock = Stock(64, 64, 10, 1.0)
    result = nested([part(rectangle((5.0, 5.0), (15.0, 15.0)), 17)], stock)
    assert result.sheets >= 2
    assert len(result.placements) == 17


def test_parts_of_several_shapes_keep_the_spacing() -> None:
    bent = rectangle((0.0, 0.0), (12.0, 3.0)) | stadium((1.5, 6.0), 3.0, 12.0)
    parts = [part(bent, 6), part(disc((3.0, 1.0), 4.0) - disc((3.0, 1.0), 2.0), 6, "P02")]
    result = nested(parts, Stock(60, 152.4, 10, 1.0))
    assert result.sheets == 1


def test_a_part_too_long_to_be_turned_is_not() -> None:
    result = nested([part(rectangle((0.0, 0.0), (100.0, 20.0)), 3)], Stock(152.4, 60, 10, 1.0))
    assert all(place.turn % 2 == 0 for place in result.placements)


def test_forty_lobed_plates_and_39_separators_lie_on_one_sheet(
    lobed_plates: list[NestPart],
) -> None:
    result = nested(lobed_plates, Stock(152.4, 152.4, 10, 0.5), seconds=2)
    assert len(result.placements) == 79
    assert result.sheets == 1


def test_pins_are_refused() -> None:
    stock = Stock(60, 60, 10, 1.0, pins=((30.0, 30.0, 3.0),))
    with pytest.raises(DesignError, match=r"sheets\.tpe\.pins; use .bottom-left."):
        nest([part(disc((0.0, 0.0), 4.0), 1)], {"TPE": stock}, "spyrrow")


def test_a_fit_too_tight_for_single_precision_is_refused() -> None:
    pytest.importorskip("spyrrow")
    with pytest.raises(DesignError, match="too tightly"):
        nest([part(disc((0.0, 0.0), 20.0), 1)], {"TPE": Stock(60, 60, 10, 1.0)}, "spyrrow")


def test_without_spyrrow_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spyrrow", None)
    with pytest.raises(SbafabError, match=r'pip install "sbafab\[nest\]"'):
        nest([part(disc((0.0, 0.0), 4.0), 1)], {"TPE": Stock(60, 60, 10, 1.0)}, "spyrrow")


@pytest.mark.parametrize(
    "region",
    [
        disc((1.0, 2.0), 5.0),
        stadium((0.0, 0.0), 2.0, 9.0),
        rectangle((0.0, 0.0), (9.0, 9.0)) - disc((9.0, 9.0), 4.0),
        disc((0.0, 0.0), 0.02),
    ],
)
def test_the_polygons_handed_over_hold_the_arcs(region: Region) -> None:
    outline = Polygon(_outline(region.outers[0]))
    exact = Polygon(region.polygons(1e-6)[0][0])
    assert exact.difference(outline).area < 1e-5
    assert exact.buffer(SAGITTA + 1e-4).contains(outline)
