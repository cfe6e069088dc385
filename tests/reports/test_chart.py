"""Charts: the numbers lie where the axes say, the same bytes every time, nothing global changed."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

import sbafab
from sbafab.reports.charts import COLOURS, ChartCurve, ChartPoints, Panel, chart_svg, relation_svg

SVG = "{http://www.w3.org/2000/svg}"


def texts(svg: str) -> list[str]:
    return ["".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text")]


def group(svg: str, name: str) -> ET.Element:
    (found,) = (g for g in ET.fromstring(svg).iter(f"{SVG}g") if g.get("id") == name)
    return found


def ends(element: ET.Element) -> list[tuple[float, float]]:
    path = element.find(f"{SVG}path")
    assert path is not None
    numbers = [float(part) for part in path.attrib["d"].split() if part not in "MLz"]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def tick_places(svg: str, axis: str) -> dict[float, float]:
    """Where each tick of the first panel stands, by the number at it."""
    found = {}
    for g in ET.fromstring(svg).iter(f"{SVG}g"):
        if g.get("id", "").startswith(f"{axis}tick"):
            text, use = next(g.iter(f"{SVG}text")), next(g.iter(f"{SVG}use"))
            found[float(text.text or "")] = float(use.attrib[axis])
    return found


def test_curve_lies_where_the_ticks_say() -> None:
    svg = chart_svg("t", [Panel("p", "x, mm", "y, N", [ChartCurve("", [0.0, 4.0], [1.0, 3.0])])])
    (x0, y0), (x1, y1) = ends(group(svg, "curve1.1"))
    across, up = tick_places(svg, "x"), tick_places(svg, "y")
    assert (x0, y0) == pytest.approx((across[0.0], up[1.0]), abs=1e-3)
    assert (x1, y1) == pytest.approx((across[4.0], up[3.0]), abs=1e-3)


def test_axes_begin_at_zero_unless_something_is_negative() -> None:
    positive = chart_svg("t", [Panel("", "x", "y", [ChartCurve("", [1.0, 4.0], [1.0, 3.0])])])
    assert min(tick_places(positive, "y")) == 0
    below = Panel("", "x", "y", [ChartCurve("", [1.0, 4.0], [-1.0, 3.0])])
    # Matplotlib writes a minus sign, not a hyphen.
    assert any(text.startswith("\N{MINUS SIGN}") for text in texts(chart_svg("t", [below])))


def test_title_labels_and_key_are_text_as_given() -> None:
    curves = [
        ChartCurve("a & <b>", [0.0, 1.0], [0.0, 1.0]),
        ChartCurve("$5 \\alpha$", [0.0, 1.0], [1.0, 2.0]),
    ]
    svg = chart_svg("t < u", [Panel("panel", "x, mm", "y, N", curves)])
    assert {"t < u", "panel", "x, mm", "y, N", "a & <b>", "$5 \\alpha$"} <= set(texts(svg))


def test_curves_differ_in_colour_and_in_dashes() -> None:
    curves = [ChartCurve(str(n), [0.0, 1.0], [0.0, float(n)]) for n in range(6)]
    svg = chart_svg("t", [Panel("p", "x", "y", curves)])
    styles = []
    for n in range(1, 7):
        path = group(svg, f"curve1.{n}").find(f"{SVG}path")
        assert path is not None
        styles.append(dict(part.split(": ") for part in path.attrib["style"].split("; ")))
    assert [style["stroke"] for style in styles] == list(COLOURS[:6])
    assert len({style.get("stroke-dasharray") for style in styles}) == 6


def test_error_bars_are_as_long_as_the_errors() -> None:
    panel = Panel("p", "x", "y", [], [ChartPoints("m", [1.0, 2.0], [5.0, 10.0], [1.0, 2.0])])
    svg = chart_svg("t", [panel])
    up = tick_places(svg, "y")
    scale = (up[0.0] - up[10.0]) / 10
    bars = next(
        g for g in ET.fromstring(svg).iter(f"{SVG}g") if "LineCollection" in g.get("id", "")
    )
    lengths = []
    for path in bars.iter(f"{SVG}path"):
        numbers = [float(part) for part in path.attrib["d"].split() if part not in "ML"]
        lengths.append(abs(numbers[1] - numbers[3]) / scale)
    assert lengths == pytest.approx([2.0, 4.0], rel=1e-4)


def test_same_bytes_no_date_no_version_and_no_setting_left_behind() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    relation = sbafab.predict("1dof-5mm").relations[0]
    first = relation_svg("1dof-5mm", relation)
    assert relation_svg("1dof-5mm", relation) == first
    assert dict(matplotlib.rcParams) == before
    assert "Matplotlib" not in first
    assert "<dc:date>" not in first
    assert matplotlib.__version__ not in first


def test_paper_s_points_are_drawn_where_it_measured() -> None:
    def key(*design: str) -> set[str]:
        prediction = sbafab.predict(*design, "models.calibration=none")
        (force,) = (r for r in prediction.relations if r.name == "force")
        return {text for text in texts(relation_svg("d", force)) if text.startswith("paper")}

    assert key("1dof-5mm") == {"paper: 1-DoF, 100 kPa"}
    assert key("3dof-15mm") == {"paper: 3-DoF, 100 kPa"}
    assert key("3dof-15mm", "chamber.count=4") == set()
    assert key("1dof-10mm") == set()
