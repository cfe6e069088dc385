"""What cannot be nested is refused in one sentence that names the field."""

from __future__ import annotations

import pytest

from sbafab.cutting.nest import NestPart, Stock
from sbafab.cutting.nesting import nest
from sbafab.errors import DesignError
from sbafab.geometry.region import disc, rectangle

PLATE = NestPart("demo", "P02", 1, "TPE", rectangle((0.0, 0.0), (92.0, 40.0)), 1)
COIN = NestPart("demo", "P03", 1, "PTFE", disc((0.0, 0.0), 5.0), 30)
LARGE = Stock()


def refusal(part: NestPart, stock: Stock) -> str:
    with pytest.raises(DesignError) as caught:
        nest([part], {"TPE": stock, "PTFE": stock})
    message = str(caught.value)
    assert message.endswith(".")
    assert "\n" not in message
    return message


def test_a_part_larger_than_the_sheet() -> None:
    message = refusal(PLATE, Stock(width=72.4, length=72.4))
    assert "pattern P02 of demo (92.0 x 40.0 mm)" in message
    assert "usable 52.4 x 52.4 mm of sheets.tpe" in message


def test_a_part_that_fits_in_another_turn_only_is_no_error() -> None:
    (result,) = nest([PLATE], {"TPE": Stock(width=62, length=120)})
    assert result.sheets == 1


@pytest.mark.parametrize("border", [30.0, 31.0])
def test_a_border_that_leaves_nothing(border: float) -> None:
    message = refusal(PLATE, Stock(width=80, length=60, border=border))
    assert f"sheets.tpe.border of {border:g} mm" in message
    assert "below 30 mm" in message


def test_spacing_to_the_pins_that_cannot_be_met() -> None:
    pins = ((76.2, 76.2, 3.0),)
    message = refusal(PLATE, Stock(spacing=40.0, pins=pins))
    assert "no place 40 mm clear of the 1 sheets.tpe.pins" in message


def test_more_sheets_than_allowed() -> None:
    """Nine coins a sheet of 32 usable mm: 30 take four sheets."""
    stock = Stock(width=52, length=52, most=3)
    message = refusal(COIN, stock)
    assert "30 parts of PTFE need 4 sheets of 52 x 52 mm" in message
    assert "sheets.ptfe.most allows 3" in message


def test_far_more_sheets_than_allowed_are_told_without_a_search() -> None:
    many = NestPart("demo", "P03", 1, "PTFE", disc((0.0, 0.0), 5.0), 1_000_000)
    assert "need at least 4481 sheets" in refusal(many, LARGE)
