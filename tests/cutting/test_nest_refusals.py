"""What cannot be nested is refused in one sentence that names the field."""

from __future__ import annotations

import pytest

from sbafab.cutting.nesting import nest
from sbafab.cutting.placements import NestPart, Stock
from sbafab.errors import DesignError
from sbafab.geometry.region import disc, rectangle

PLATE = NestPart("demo", "P02", 1, "TPE", rectangle((0.0, 0.0), (92.0, 40.0)), 1)
COINS, MANY = (
    NestPart("demo", "P03", 1, "PTFE", disc((0.0, 0.0), 5.0), n) for n in (30, 1_000_000)
)


def test_a_part_that_fits_in_another_turn_only_is_no_error() -> None:
    (result,) = nest([PLATE], {"TPE": Stock(width=62, length=120)})
    assert result.sheets == 1


@pytest.mark.parametrize(
    ("part", "stock", "says"),
    [
        (
            PLATE,
            Stock(width=72.4, length=72.4),
            r"P02 of demo \(92.0 x 40.0 mm\) .* usable 52.4 x 52.4 mm of sheets.tpe",
        ),
        (
            PLATE,
            Stock(width=80, length=60, border=30.0),
            "sheets.tpe.border of 30 mm .* below 30 mm",
        ),
        (
            PLATE,
            Stock(spacing=40.0, pins=((76.2, 76.2, 3.0),)),
            "no place 40 mm clear of the 1 sheets.tpe.pins",
        ),
        # Nine coins a sheet of 32 usable mm: 30 take four sheets.
        (
            COINS,
            Stock(width=52, length=52, most=3),
            "30 parts of PTFE need 4 sheets of 52 x 52 mm, sheets.ptfe.most allows 3",
        ),
        (MANY, Stock(), "need at least 4481 sheets"),
    ],
)
def test_what_does_not_fit_is_refused(part: NestPart, stock: Stock, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        nest([part], {"TPE": stock, "PTFE": stock})
