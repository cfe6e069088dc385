"""What requirements are about: read, refused, and worth what geometry and other models say."""

from __future__ import annotations

import math
from typing import Any

import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.models.quantity import Conditions
from sbafab.search.quantities import (
    RequestedQuantity,
    measured,
    read_all,
    read_limit,
    read_quantity,
)

UNCALIBRATED = {"calibration": "none"}
"""Films as drawn and bought, whose figures are closed forms."""


def _value(text: str, name: str = "1dof-5mm", **tables: Any) -> float:
    design = sbafab.load(name, **tables)
    return measured(read_quantity(text), design, sbafab.build(design), 0.875)[0]


READ = {
    "mass": RequestedQuantity("mass"),
    "overall-diameter": RequestedQuantity("overall_diameter"),
    "Stroke": RequestedQuantity("stroke", Conditions(kpa=10.0)),
    "stroke@0.5bar": RequestedQuantity("stroke", Conditions(kpa=50.0)),
    "stroke@50KPA": RequestedQuantity("stroke", Conditions(kpa=50.0)),
    "stroke@0.1MPa": RequestedQuantity("stroke", Conditions(kpa=100.0)),
    "bend": RequestedQuantity("bend", Conditions(kpa=10.0)),
    "bend@2chambers@5kPa": RequestedQuantity("bend", Conditions(kpa=5.0, chambers=2)),
    "force@50 kPa@0.5 in": RequestedQuantity("force", Conditions(kpa=50.0, rise=12.7)),
    "force@50%": RequestedQuantity("force", Conditions(kpa=10.0, share=0.5)),
    "force@ 12.5 % @50kPa": RequestedQuantity("force", Conditions(kpa=50.0, share=0.125)),
    "lateral-stiffness@5kPa": RequestedQuantity("lateral_stiffness", Conditions(kpa=5.0)),
    "time": RequestedQuantity("time", Conditions(flow=35.0)),
    "time@0.5ml/s": RequestedQuantity("time", Conditions(flow=30.0)),
    "chamber.diameter": RequestedQuantity("chamber.diameter"),
}


@pytest.mark.parametrize("text", READ)
def test_a_quantity_is_read(text: str) -> None:
    assert read_quantity(text) == read_quantity(READ[text].label) == READ[text]


REFUSED = """
masses | did you mean mass
weight_of_it | is not a quantity; there are
stroke@5mPa | neither a pressure nor a length
stroke@50 apples | neither a pressure nor a length
bend@0chambers | neither a pressure nor a length
force@2chambers@1mm | neither a pressure nor a length
force@12.5@50kPa | 12.5kPa or 12.5mm
mass@50kPa | only stroke, bend, force, lateral_stiffness, pull
time@5kPa | a time has one flow, such as time@35ml/min
time@0ml/min | must be from
bend@5mm | other quantities have none
stroke@50% | other quantities have none
force@50%@5mm | needs exactly one stroke
force@50kPa | a force needs exactly one stroke
force@150% | must be a fraction from 0 to 1
stroke@1001kPa | give more than 0, at most 1000 kPa
stroke@-5kPa | a vacuum does nothing
slip@50kPa | a vacuum is negative: write -50
"""


@pytest.mark.parametrize("row", REFUSED.strip().splitlines())
def test_what_is_no_quantity_is_said(row: str) -> None:
    text, said = row.split(" | ")
    with pytest.raises(DesignError, match=said):
        read_quantity(text)


def test_a_bend_without_a_pressure_is_at_the_highest_named() -> None:
    requirements, goal = read_all(["stroke=25", "force@12.5mm@50kPa=3"], ["mass=1"], "bend")
    stroke, force, mass = requirements
    assert goal.quantity.kpa == stroke.quantity.kpa == 50
    assert goal.more
    assert stroke.margin(26.0) == pytest.approx(0.04)
    assert mass.margin(1.1) == pytest.approx(-0.1)
    assert force.holds(3.0)
    assert not force.holds(2.99)
    for text in ("stroke", "stroke=", "stroke=much"):
        with pytest.raises(DesignError, match="--min"):
            read_all([text], [], "mass")


def test_limits_take_units() -> None:
    limits = {
        ("mass", "50 mg"): 0.05,
        ("mass", "0.5"): 0.5,
        ("force@1mm@5kPa", "500mN"): 0.5,
        ("yield", "95%"): 0.95,
        ("stroke", "1in"): 25.4,
        ("time", "500ms"): 0.5,
        ("lateral_stiffness@5kPa", "12 N/m"): 0.012,
        ("chamber.diameter", "5 mm"): 5.0,
    }
    found = {(name, text): read_limit(read_quantity(name), text) for name, text in limits}
    assert found == pytest.approx(limits)


def test_sizes_are_those_of_the_geometry() -> None:
    # d + 2 bonds; 2 x (1 + 2 bonds + d) round the lumen, the paper's 15.
    assert _value("outline_diameter") == pytest.approx(6.5)
    assert _value("outline_diameter", "3dof-15mm") == pytest.approx(15.0)
    assert _value("lumen", "3dof-15mm") == 2.0
    assert _value("deflated_diameter", "radial-15mm", models=UNCALIBRATED) == pytest.approx(15.328)
    assert _value("height", models=UNCALIBRATED) == pytest.approx(12 * 0.038 + 11 * 0.025)
    assert _value("chamber.diameter") == 5.0
    assert _value("yield") == 0.875


@pytest.mark.parametrize("name", ["inflated_diameter", "reached_diameter"])
def test_what_must_reach_counts_the_lens_and_what_must_not_touch_the_cylinder(name: str) -> None:
    """Pockets 8 wide: cylinders of 2 x 8 / pi, which no air makes of them."""
    (reach, clear), _ = read_all([f"{name}=25"], [f"{name}=25"], "mass")
    chamber = {"width": 9.5, "length": 9.5}
    design = sbafab.load("radial-15mm", chamber=chamber, models=UNCALIBRATED)
    laminate = sbafab.build(design)
    reached, widest = (measured(one.quantity, design, laminate)[0] for one in (reach, clear))
    assert widest == pytest.approx(15.328 + 4 * 8 / math.pi)
    stroke = sbafab.predict(design).value("reference_stroke")
    assert reached == pytest.approx(15.328 + 2 * stroke)
    assert not reach.holds(reached)
    assert not clear.holds(widest)


def test_balloons_in_series_rise_more_and_push_as_hard() -> None:
    six, twelve = {"balloons": 6}, {"balloons": 12}
    one = _value("force@3mm@30kPa", stack=six)
    assert _value("force@6mm@30kPa", stack=twelve) == pytest.approx(one, rel=1e-9)
    assert _value("stroke@10kPa", stack=twelve) == pytest.approx(
        2 * _value("stroke@10kPa", stack=six), rel=1e-9
    )
    # Three chambers push on one plate.
    assert _value("force@3mm@30kPa", "3dof-15mm", stack=six) == pytest.approx(3 * one, rel=1e-9)


TAPER = {"chamber": {"diameter": [6.0, 5.0]}, "stack": {"balloons": 2}}
WIDE = {"chamber": {"diameter": 7.0}, "stack": {"balloons": 6}}
FIGURES: dict[tuple[str, float], tuple[dict[str, Any], dict[str, str]]] = {
    # Wide pockets, whose films wave; what only the stack at other factors gives; the water's delay.
    ("3dof-15mm", 8.0): (
        WIDE,
        {
            "stroke@8kPa": "free stroke at 8 kPa",
            "height": "folded height",
            "reference_stroke": "reference stroke",
            "mass": "mass",
            "bend@8kPa": "bend at 8 kPa in one chamber, the others empty",
            "bend@2chambers@8kPa": "bend at 8 kPa in 2 chambers, the others empty",
            "lateral_stiffness@8kPa": "lateral tip stiffness at 8 kPa, chambers shut",
            "force@25%@8kPa": "blocked force at 8 kPa, at 25 % of the reference stroke",
            "time@20ml/min": "time to 10 kPa at the pump, water at 20 ml/min in all",
        },
    ),
    ("1dof-5mm", 5.0): (TAPER, {"force@0mm@5kPa": "blocked force at 5 kPa, flat"}),
    ("radial-15mm", 20.0): (
        {},
        {
            "deflated_diameter": "deflated diameter",
            "reached_diameter": "reached diameter",
            "inflated_diameter": "inflated diameter",
            "force@25%@20kPa": (
                "blocked force of one SBA at 20 kPa, at 25 % of the reference stroke"
            ),
        },
    ),
    ("pouch", 0.5): (
        {},
        {"contraction": "free contraction", "pull@0.5kPa": "pull at 0.5 kPa, 10 % shorter"},
    ),
    ("finger", 20.0): (
        {},
        {"free_bend": "free bend, 3 hinges", "moment@20kPa": "moment at 20 kPa, straight"},
    ),
    ("vacuum", -50.0): ({}, {"slip@-50kPa": "load that slips at -50 kPa"}),
}
"""Text of a quantity to the name of its figure in ``predict``, by template and pressure, kPa."""


@pytest.mark.parametrize(("template", "kpa"), FIGURES)
def test_each_figure_with_its_interval_is_the_one_of_predict(template: str, kpa: float) -> None:
    changes, names = FIGURES[template, kpa]
    design = sbafab.load(template, changes)
    said = sbafab.predict(design, pressures_kpa=[kpa], flow_ml_min=20.0)
    laminate = sbafab.build(design)
    for text, name in names.items():
        figure = max(
            (one for one in said.figures if one.name == name),
            key=lambda one: (one.interval is not None, not one.other),
        )
        quantity = read_quantity(text)
        assert quantity.unit == figure.unit, text
        value, mine = measured(quantity, design, laminate, probability=0.9)
        assert mine is not None
        assert value == mine.value == pytest.approx(figure.value, rel=1e-7), text
        assert measured(quantity, design, laminate)[0] == pytest.approx(value, rel=1e-12)
        expected = figure.interval and pytest.approx(figure.interval, rel=1e-7)
        assert mine.interval == expected, text
        assert (mine.measured, mine.flags) == (figure.measured, figure.flags), text


def test_a_force_at_a_length_is_that_at_its_share_of_the_stroke() -> None:
    """From flat: a quarter of the way from the films to the reference height."""
    said = sbafab.predict("3dof-15mm", quick=True)
    height = 0.25 * (said.value("reference_stroke") - said.value("folded_height"))
    at_share = _value("force@25%@8kPa", "3dof-15mm")
    assert _value(f"force@{height!r}mm@8kPa", "3dof-15mm") == pytest.approx(at_share, rel=1e-7)


def test_without_a_calibration_nothing_has_an_interval() -> None:
    design = sbafab.load("3dof-15mm", models=UNCALIBRATED)
    _, height = measured(read_quantity("height"), design, sbafab.build(design), probability=0.9)
    assert height is not None
    assert height.interval is None


def test_stroke_and_force_are_those_of_a_flat_balloon() -> None:
    said = sbafab.predict("1dof-5mm", pressures_kpa=[5.0]).value("free_stroke", kpa=5)
    # Hardly raised, the film lies flat on the plates all over its pocket.
    flat = 10e-3 * math.pi * 2.5**2
    assert flat * 0.9 < _value("force@0.05mm@10kPa", models=UNCALIBRATED) <= flat
    # It gets no higher than its free stroke, and pushes the less the nearer it is to it.
    near = [_value(f"force@{stroke}mm@5kPa") for stroke in (2, 4, 6)]
    assert near == sorted(near, reverse=True)
    assert _value(f"force@{1.05 * said}mm@5kPa") < 0


def test_a_pull_is_that_of_two_arcs() -> None:
    # Niiyama et al.: p D L cos t / t with sin t / t = 0.9, of a pouch of 40 x 30 mm.
    angle = 0.786683
    assert math.sin(angle) / angle == pytest.approx(0.9, rel=1e-5)
    pull = 0.5e-3 * 30 * 40 * math.cos(angle) / angle
    assert _value("pull@0.5kPa", "pouch") == pytest.approx(pull, rel=1e-4)


def test_a_share_of_no_stroke_needs_no_reference() -> None:
    film = {"product": "TPU", "thickness": 0.1, "modulus": 20, "poisson": 0.45}
    with pytest.raises(DesignError, match="reference stroke: "):
        _value("force@25%@20kPa", films={"tpe": film})
    assert _value("force@0%@20kPa", films={"tpe": film}) > 0


@pytest.mark.parametrize(
    ("text", "template", "said"),
    [
        ("lumen", "1dof-5mm", "has no lumen"),
        ("bend@5kPa", "1dof-5mm", "does not bend"),
        ("bend@3chambers@5kPa", "3dof-15mm", "a bend needs at most 2 filled"),
        ("pull@1kPa", "finger", "pull needs a pouch-motor, but the design has a mecha"),
        ("push@1kPa", "1dof-5mm", "push needs a push, but the design has no mechanism"),
        ("pull@10kPa", "pouch", "the film would stretch by more than 5 %"),
    ],
)
def test_what_a_design_does_not_have_is_said(text: str, template: str, said: str) -> None:
    with pytest.raises(DesignError, match=said):
        _value(text, template)
