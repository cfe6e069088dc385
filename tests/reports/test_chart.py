"""Charts: the numbers lie where the axes say, and the key beside them."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import pytest

import sbafab
from sbafab.reports.charts import (
    COLOURS,
    ChartBars,
    ChartCurve,
    ChartPoints,
    ChartSpecks,
    Panel,
    chart_svg,
    relation_svg,
)
from sbafab.reports.drawing import SMALL, text_width

SVG = "{http://www.w3.org/2000/svg}"
Points = list[tuple[float, float]]


def texts(svg: str) -> list[str]:
    return ["".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text")]


def panel(curves: Sequence[ChartCurve] = (), **items: object) -> str:
    return chart_svg("t", [Panel("p", "x", "y", curves, **items)])  # type: ignore[arg-type]


def curve(*y: float) -> ChartCurve:
    return ChartCurve("", [1.0, 4.0, 5.0, 6.0][: len(y)], y)


def group(svg: str, name: str) -> ET.Element:
    (found,) = (g for g in ET.fromstring(svg).iter(f"{SVG}g") if g.get("id") == name)
    return found


def paths(element: ET.Element) -> list[Points]:
    """The points of the paths in it."""
    drawn = [path.attrib["d"] for path in element.iter(f"{SVG}path")]
    points = [re.findall(r"[ML]([-.\d]+) ([-.\d]+)", data) for data in drawn]
    return [[(float(x), float(y)) for x, y in pairs] for pairs in points]


def ticks(svg: str, axis: str) -> dict[float, float]:
    """The places of the grid's lines, by the numbers of the first panel's axis."""
    found = {}
    for g in ET.fromstring(svg).iter(f"{SVG}g"):
        if g.get("id", "").startswith(f"{axis}tick1."):
            number = next(g.iter(f"{SVG}text")).text or ""
            found[float(number.replace("\N{MINUS SIGN}", "-"))] = paths(g)[0][0]["xy".index(axis)]
    return found


def test_curves_lie_where_the_ticks_say_and_have_gaps() -> None:
    svg = panel([curve(1.0, 3.0), curve(1.0, math.nan, 3.0, 2.0), curve(2.0, 2.0)])
    across, up = ticks(svg, "x"), ticks(svg, "y")
    (line,) = paths(group(svg, "curve1.1"))
    assert line[0] == pytest.approx((across[1.0], up[1.0]), abs=1e-3)
    assert line[1] == pytest.approx((across[4.0], up[3.0]), abs=1e-3)
    assert min(up) == 0
    assert min(ticks(panel([curve(-1.0, 3.0)]), "y")) == -1
    path = group(svg, "curve1.2").find(f"{SVG}path")
    assert path is not None
    assert path.attrib["d"].count("M") == 2
    assert "nan" not in svg


def test_words_are_as_given_and_the_key_has_room_below_the_axes() -> None:
    labels = ["elastic stack, one chamber to 10 kPa, " * 3, "a & <b>"]
    curves = [ChartCurve(label, [0.0, 1.0], [0.0, n]) for n, label in enumerate(labels)]
    svg = chart_svg("t < u", [Panel("panel", "x, mm", "y, N", curves)])
    assert {"t < u", "panel", "x, mm", "y, N", *labels} <= set(texts(svg))
    page = ET.fromstring(svg)
    wide, high = (float(size) for size in page.attrib["viewBox"].split()[2:])
    key = [text for text in page.iter(f"{SVG}text") if text.text in labels]
    assert all(max(ticks(svg, "y").values()) < float(text.attrib["y"]) < high for text in key)
    assert float(key[0].attrib["x"]) + text_width(labels[0], SMALL) < wide


def test_error_bars_are_as_long_as_the_errors() -> None:
    svg = panel(points=[ChartPoints("m", [1.0, 2.0], [5.0, 10.0], [1.0, 2.0])])
    up = ticks(svg, "y")
    bars = paths(group(svg, "points1.1")[0])
    lengths = [abs(high - low) / (up[0.0] - up[10.0]) * 10 for (_, low), (_, high) in bars]
    assert lengths == pytest.approx([2.0, 4.0], rel=1e-4)


@pytest.mark.parametrize(
    ("low", "high", "numbers"),
    [
        # By hand: 1, 2, 2.5 or 5 times a power of ten, in at most 8 steps of the axis.
        (0.0, 5.0, [0, 1, 2, 3, 4, 5]),
        (0.0, 17.5, [0, 2.5, 5, 7.5, 10, 12.5, 15, 17.5]),
        (-0.001, 0.002, [-0.001, -0.0005, 0, 0.0005, 0.001, 0.0015, 0.002]),
        (0.0, 1.5e5, [0, 2e4, 4e4, 6e4, 8e4, 1e5, 1.2e5, 1.4e5]),
    ],
)
def test_numbers_at_an_axis_are_round(low: float, high: float, numbers: list[float]) -> None:
    assert sorted(ticks(panel([curve(low, high)]), "y")) == pytest.approx(numbers)


def test_measured_points_stand_only_beside_the_papers_own_actuators() -> None:
    def key(*design: str) -> set[str]:
        prediction = sbafab.predict(*design, "models.calibration=none")
        (force,) = (r for r in prediction.relations if r.name == "force")
        return {text for text in texts(relation_svg("d", force)) if text.startswith("paper")}

    assert key("1dof-5mm") == {"paper: 1-DoF, 100 kPa"}
    assert key("3dof-15mm", "chamber.count=4") == key("1dof-10mm") == set()


def test_bars_stand_on_each_other_above_their_names() -> None:
    bars = [ChartBars("a", [2, 0, 1], "#111111"), ChartBars("b", [3, 4, 0], "#222222")]
    svg = panel(bars=bars, names=["4", "4.5", "long"])
    up = ticks(svg, "y")
    lower, upper = (
        [tuple(float(box.attrib[k]) for k in ("x", "y", "height")) for box in group(svg, name)]
        for name in ("bars1.1", "bars1.2")
    )
    heights = [height / (up[0] - up[4]) * 4 for *_, height in (*lower, *upper)]
    assert heights == pytest.approx([2, 1, 3, 4])
    x, low, height = upper[0]
    assert (x, low + height) == pytest.approx(lower[0][:2])
    assert {"4", "4.5", "long", "a", "b"} <= set(texts(svg))


def test_curves_differ_in_colour_and_in_dashes() -> None:
    svg = panel([curve(0.0, float(n)) for n in range(6)])
    styles = [next(group(svg, f"curve1.{n}").iter(f"{SVG}path")).attrib for n in range(1, 7)]
    assert [style["stroke"] for style in styles] == list(COLOURS[:6])
    assert len({style.get("stroke-dasharray") for style in styles}) == 6


def test_specks_lie_where_the_ticks_say_and_equal_ones_are_drawn_once() -> None:
    specks = ChartSpecks("many", [1.0, 1.0, 4.0] * 1000, [2.0, 2.0, 3.0] * 1000, "#111111", 1)
    svg = panel(specks=[specks])
    (places,) = paths(group(svg, "specks1.1"))
    across, up = ticks(svg, "x"), ticks(svg, "y")
    # To a quarter of a millimetre.
    for found, expected in zip(places, [(across[1], up[2]), (across[4], up[3])], strict=True):
        assert found == pytest.approx(expected, abs=0.13)


def test_panels_stand_in_rows_below_each_other() -> None:
    panels = [Panel(name, "x", "y", [curve(0.0, 1.0)]) for name in "abcd"]
    (wide, low), (narrow, high) = (
        map(float, ET.fromstring(chart_svg("t", panels, count)).attrib["viewBox"].split()[2:])
        for count in (4, 2)
    )
    assert (narrow, high) == pytest.approx((wide / 2, 2 * low))
