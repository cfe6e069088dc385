"""Charts: the numbers lie where the axes say, and the key beside them."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

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


def texts(svg: str) -> list[str]:
    return ["".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text")]


def group(svg: str, name: str) -> ET.Element:
    (found,) = (g for g in ET.fromstring(svg).iter(f"{SVG}g") if g.get("id") == name)
    return found


def ends(element: ET.Element) -> list[tuple[float, float]]:
    """The points of the first path in it."""
    path = element.find(f".//{SVG}path")
    assert path is not None
    return [(float(x), float(y)) for x, y in re.findall(r"[ML](\S+?) ([^ML]+)", path.attrib["d"])]


def tick_places(svg: str, axis: str) -> dict[float, float]:
    """Where the grid's line of each number of the first panel stands."""
    found = {}
    for g in ET.fromstring(svg).iter(f"{SVG}g"):
        if g.get("id", "").startswith(f"{axis}tick1."):
            number = next(g.iter(f"{SVG}text")).text or ""
            found[float(number.replace("\N{MINUS SIGN}", "-"))] = ends(g)[0]["xy".index(axis)]
    return found


def test_curves_lie_where_the_ticks_say_and_axes_begin_at_zero() -> None:
    svg = chart_svg("t", [Panel("p", "x, mm", "y, N", [ChartCurve("", [0.0, 4.0], [1.0, 3.0])])])
    (x0, y0), (x1, y1) = ends(group(svg, "curve1.1"))
    across, up = tick_places(svg, "x"), tick_places(svg, "y")
    assert (x0, y0) == pytest.approx((across[0.0], up[1.0]), abs=1e-3)
    assert (x1, y1) == pytest.approx((across[4.0], up[3.0]), abs=1e-3)
    assert min(up) == 0
    below = chart_svg("t", [Panel("", "x", "y", [ChartCurve("", [1.0, 4.0], [-1.0, 3.0])])])
    assert min(tick_places(below, "y")) == -1


def test_words_are_as_given_and_the_key_has_room_below_the_axes() -> None:
    labels = ["elastic stack, one chamber to 10 kPa, " * 3, "a & <b>"]
    curves = [ChartCurve(label, [0.0, 1.0], [0.0, n]) for n, label in enumerate(labels)]
    svg = chart_svg("t < u", [Panel("panel", "x, mm", "y, N", curves)])
    assert {"t < u", "panel", "x, mm", "y, N", *labels} <= set(texts(svg))
    page = ET.fromstring(svg)
    wide, high = (float(size) for size in page.attrib["viewBox"].split()[2:])
    key = [text for text in page.iter(f"{SVG}text") if text.text in labels]
    assert all(max(tick_places(svg, "y").values()) < float(t.attrib["y"]) < high for t in key)
    assert float(key[0].attrib["x"]) + text_width(labels[0], SMALL) < wide


def test_curves_differ_in_colour_and_in_dashes() -> None:
    curves = [ChartCurve(str(n), [0.0, 1.0], [0.0, float(n)]) for n in range(6)]
    svg = chart_svg("t", [Panel("p", "x", "y", curves)])
    styles = []
    for n in range(1, 7):
        path = group(svg, f"curve1.{n}").find(f"{SVG}path")
        assert path is not None
        styles.append(path.attrib)
    assert [style["stroke"] for style in styles] == list(COLOURS[:6])
    assert len({style.get("stroke-dasharray") for style in styles}) == 6


def test_error_bars_are_as_long_as_the_errors() -> None:
    panel = Panel("p", "x", "y", [], [ChartPoints("m", [1.0, 2.0], [5.0, 10.0], [1.0, 2.0])])
    svg = chart_svg("t", [panel])
    up = tick_places(svg, "y")
    scale = (up[0.0] - up[10.0]) / 10
    bars = group(svg, "points1.1").find(f"{SVG}g")
    assert bars is not None
    lengths = []
    for path in bars.iter(f"{SVG}path"):
        (_, low), (_, high) = (map(float, end.split()) for end in path.attrib["d"][1:].split("L"))
        lengths.append(abs(high - low) / scale)
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
    svg = chart_svg("t", [Panel("p", "x", "y", [ChartCurve("", [0.0, 1.0], [low, high])])])
    assert sorted(tick_places(svg, "y")) == pytest.approx(numbers)


def test_curve_of_equal_values_and_one_with_a_gap_are_drawn() -> None:
    curves = [
        ChartCurve("", [5.0, 5.0], [7.0, 7.0]),
        ChartCurve("", [1.0, 2.0, 3.0, 4.0], [1.0, float("nan"), 3.0, 4.0]),
    ]
    svg = chart_svg("t", [Panel("p", "x", "y", curves)])
    assert len(ends(group(svg, "curve1.1"))) == 2
    path = group(svg, "curve1.2").find(f"{SVG}path")
    assert path is not None
    assert path.attrib["d"].count("M") == 2
    assert "nan" not in svg


def test_paper_s_points_are_drawn_where_it_measured() -> None:
    def key(*design: str) -> set[str]:
        prediction = sbafab.predict(*design, "models.calibration=none")
        (force,) = (r for r in prediction.relations if r.name == "force")
        return {text for text in texts(relation_svg("d", force)) if text.startswith("paper")}

    assert key("1dof-5mm") == {"paper: 1-DoF, 100 kPa"}
    assert key("3dof-15mm") == {"paper: 3-DoF, 100 kPa"}
    assert key("3dof-15mm", "chamber.count=4") == set()
    assert key("1dof-10mm") == set()


def test_bars_stand_on_each_other_above_their_names() -> None:
    bars = [ChartBars("a", [2, 0, 1], "#111111"), ChartBars("b", [3, 4, 0], "#222222")]
    svg = chart_svg("t", [Panel("p", "x", "n", [], bars=bars, names=["4", "4.5", "long"])])
    up = tick_places(svg, "y")
    assert all(number == int(number) for number in up)
    boxes = [
        [tuple(float(box.attrib[k]) for k in ("x", "y", "height")) for box in group(svg, name)]
        for name in ("bars1.1", "bars1.2")
    ]
    scale = (up[0] - up[4]) / 4
    assert [height / scale for *_, height in boxes[0]] == pytest.approx([2, 1])
    assert [height / scale for *_, height in boxes[1]] == pytest.approx([3, 4])
    (_, top, _), (x, low, height) = boxes[0][0], boxes[1][0]
    assert (x, low + height) == pytest.approx((boxes[0][0][0], top))
    assert {"4", "4.5", "long", "a", "b"} <= set(texts(svg))


def test_specks_lie_where_the_ticks_say_and_equal_ones_are_drawn_once() -> None:
    specks = ChartSpecks("many", [1.0, 1.0, 4.0] * 1000, [2.0, 2.0, 3.0] * 1000, "#111111", 1)
    svg = chart_svg("t", [Panel("p", "x", "y", [], specks=[specks])])
    (path,) = group(svg, "specks1.1")
    places = [(float(x), float(y)) for x, y in re.findall(r"M(\S+) ([\d.]+)", path.attrib["d"])]
    across, up = tick_places(svg, "x"), tick_places(svg, "y")
    # To a quarter of a millimetre.
    assert len(places) == 2
    for found, expected in zip(places, [(across[1], up[2]), (across[4], up[3])], strict=True):
        assert found == pytest.approx(expected, abs=0.13)


def test_panels_stand_in_rows_below_each_other() -> None:
    panels = [Panel(name, "x", "y", [ChartCurve("", [0.0, 1.0], [0.0, 1.0])]) for name in "abcd"]
    sizes = [
        [
            float(size)
            for size in ET.fromstring(chart_svg("t", panels, count)).attrib["viewBox"].split()[2:]
        ]
        for count in (4, 2)
    ]
    (wide, low), (narrow, high) = sizes
    assert (narrow, high) == pytest.approx((wide / 2, 2 * low))
