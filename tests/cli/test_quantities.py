"""Pressures, volumes and flows on the command line."""

from __future__ import annotations

import click
import pytest

from sbafab.cli.options import FLOW, PRESSURE, VOLUME, OfChamber, Parsed, by_chamber


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
def test_units(quantity: Parsed, written: str, value: float) -> None:
    assert quantity.convert(written, None, None) == pytest.approx(value)


@pytest.mark.parametrize("written", ["", "kPa", "6 kpa", "6 7", "nan", "inf", "1_0", "6 kPa x"])
def test_anything_else_is_refused_with_the_units(written: str) -> None:
    with pytest.raises(click.BadParameter, match="the units are kPa, Pa, MPa, mbar, bar, psi"):
        PRESSURE.convert(written, None, None)


def test_a_chamber_is_named_where_not_all_are_meant() -> None:
    context = click.Context(click.Command("any"))
    option = click.Option(["--volume"], multiple=True)
    one, every = OfChamber(VOLUME), OfChamber(VOLUME, all_chambers=True)
    assert one.convert("chamber1 = 5 ul", option, context) == ("chamber1", 5)
    assert every.convert("5ul", option, context) == ("", 5)
    for written in ("5ul", "=5ul"):
        with pytest.raises(click.BadParameter, match="chamber1=5"):
            one.convert(written, option, context)
    assert by_chamber(context, option, (("a", 1.0), ("b", 2.0))) == {"a": 1.0, "b": 2.0}
    with pytest.raises(click.BadParameter, match="only once"):
        by_chamber(context, option, (("a", 1.0), ("a", 2.0)))
