"""Pressures, volumes and flows on the command line."""

from __future__ import annotations

import click
import pytest

from sbafab.cli.options import FLOW, PRESSURE, VOLUME, MeasuredQuantity


@pytest.mark.parametrize(
    ("quantity", "written", "value"),
    [
        (PRESSURE, "6", 6),
        (PRESSURE, " 60 mbar ", 6),
        (PRESSURE, "1psi", 6.894757),
        (PRESSURE, ".5 bar", 50),
        (VOLUME, "5ul", 5),
        (VOLUME, "5e-3 ml", 5),
        (FLOW, "35", 35),
        (FLOW, "0.5 ml/s", 30),
        (FLOW, "0.035 l/min", 35),
    ],
)
def test_units(quantity: MeasuredQuantity, written: str, value: float) -> None:
    assert quantity.convert(written, None, None) == pytest.approx(value)


@pytest.mark.parametrize("written", ["", "kPa", "6 kpa", "6 7", "nan", "inf", "1_0", "6 kPa x"])
def test_anything_else_is_refused_with_the_units(written: str) -> None:
    with pytest.raises(click.BadParameter, match="the units are kPa, Pa, MPa, mbar, bar, psi"):
        PRESSURE.convert(written, None, None)
