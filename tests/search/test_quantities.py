"""What requirements are about: read, refused, and worth what geometry and other models say."""

from __future__ import annotations

import math
from typing import Any

import pytest

import sbafab
from sbafab.errors import DesignError
from sbafab.search.quantities import RequestedQuantity, Subject, read_all, read_limit, read_quantity
from tests.quick import few

UNCALIBRATED = {"calibration": "none"}
"""Films as drawn and bought, whose figures are closed forms."""


def _value(text: str, name: str = "1dof-5mm", **tables: Any) -> float:
    design = sbafab.load(name, **tables)
    return Subject(design, sbafab.build(design)).value(read_quantity(text), 0.875)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("mass", RequestedQuantity("mass", "g")),
        ("overall-diameter", RequestedQuantity("overall_diameter", "mm")),
        ("stroke@0.5bar", RequestedQuantity("stroke", "mm", 50.0)),
        ("Stroke", RequestedQuantity("stroke", "mm", 10.0)),
        ("reference-stroke", RequestedQuantity("reference_stroke", "mm")),
        ("bend", RequestedQuantity("bend", "deg", 10.0)),
        ("stroke@50KPA", RequestedQuantity("stroke", "mm", 50.0)),
        ("stroke@0.1MPa", RequestedQuantity("stroke", "mm", 100.0)),
        ("force@12.5mm@50kPa", RequestedQuantity("force", "N", 50.0, 12.5)),
        ("force@50 kPa@0.5 in", RequestedQuantity("force", "N", 50.0, 12.7)),
        ("force@50%", RequestedQuantity("force", "N", 10.0, share=0.5)),
        ("force@ 12.5 % @50kPa", RequestedQuantity("force", "N", 50.0, share=0.125)),
        ("bend@2chambers@5kPa", RequestedQuantity("bend", "deg", 5.0, chambers=2)),
        ("lateral-stiffness@5kPa", RequestedQuantity("lateral_stiffness", "N/mm", 5.0)),
        ("time", RequestedQuantity("time", "s", flow=35.0)),
        ("time@0.5ml/s", RequestedQuantity("time", "s", flow=30.0)),
        ("chamber.diameter", RequestedQuantity("chamber.diameter", "")),
    ],
)
def test_a_quantity_is_read(text: str, found: RequestedQuantity) -> None:
    assert read_quantity(text) == found
    assert read_quantity(found.label) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("masses", "did you mean mass"),
        ("weight_of_it", "is not a quantity; there are"),
        ("stroke@5mPa", "neither a pressure nor a length"),
        ("force@12.5@50kPa", "12.5kPa or 12.5mm"),
        ("mass@50kPa", "only stroke, bend, force, lateral_stiffness, pull"),
        ("bend@0chambers", "neither a pressure nor a length"),
        ("force@2chambers@1mm", "neither a pressure nor a length"),
        ("time@5kPa", "a time takes one flow, such as time@35ml/min"),
        ("time@0ml/min", "must be from"),
        ("bend@5mm", "only a force takes one"),
        ("force@50%@5mm", "needs one stroke"),
        ("force@150%", "must be a share from 0 to 1"),
        ("stroke@50%", "only a force takes one"),
        ("force@50kPa", "a force needs one stroke"),
        ("stroke@5mm@50kPa", "only a force takes one"),
        ("stroke@50 apples", "neither a pressure nor a length"),
        ("stroke@1001kPa", "give 0 to 1000 kPa"),
        ("stroke@-5kPa", "a vacuum does nothing"),
        ("slip@50kPa", "a vacuum is negative: write -50"),
    ],
)
def test_what_is_no_quantity_is_said(text: str, said: str) -> None:
    with pytest.raises(DesignError, match=said):
        read_quantity(text)


def test_a_bend_without_a_pressure_is_at_the_highest_named() -> None:
    requirements, goal = read_all(["stroke=25", "force@12.5mm@50kPa=3"], ["mass=1"], "bend")
    assert goal.quantity.kpa == 50
    assert requirements[0].quantity.kpa == 50
    assert goal.more
    stroke, force, mass = requirements
    assert stroke.margin(26.0) == pytest.approx(0.04)
    assert mass.margin(1.1) == pytest.approx(-0.1)
    assert force.holds(3.0)
    assert not force.holds(2.99)
    for text in ("stroke", "stroke=", "stroke=much"):
        with pytest.raises(DesignError, match="--min"):
            read_all([text], [], "mass")


@pytest.mark.parametrize(
    ("name", "text", "limit"),
    [
        ("mass", "50 mg", 0.05),
        ("mass", "0.5", 0.5),
        ("force@1mm@5kPa", "500mN", 0.5),
        ("yield", "95%", 0.95),
        ("stroke", "1in", 25.4),
        ("time", "500ms", 0.5),
        ("lateral_stiffness@5kPa", "12 N/m", 0.012),
        ("chamber.diameter", "5 mm", 5.0),
    ],
)
def test_limits_take_units(name: str, text: str, limit: float) -> None:
    assert read_limit(read_quantity(name), text) == pytest.approx(limit)


def test_sizes_are_those_of_the_geometry() -> None:
    # d + 2 bonds; 2 x (1 + 2 bonds + d) round the lumen, the paper's 15.
    assert _value("outline_diameter") == pytest.approx(6.5)
    assert _value("outline_diameter", "3dof-15mm") == pytest.approx(15.0)
    assert _value("lumen", "3dof-15mm") == 2.0
    assert _value("deflated_diameter", "radial-15mm", models=UNCALIBRATED) == pytest.approx(15.328)
    assert _value("height", models=UNCALIBRATED) == pytest.approx(12 * 0.038 + 11 * 0.025)
    assert _value("chamber.diameter") == 5.0
    assert _value("yield") == 0.875
    with pytest.raises(DesignError, match="has no lumen"):
        _value("lumen")


@pytest.mark.parametrize("name", ["inflated_diameter", "reached_diameter"])
def test_what_must_reach_counts_the_lens_and_what_must_not_touch_the_cylinder(name: str) -> None:
    """Pockets 8 wide: cylinders of 2 x 8 / pi, which no air makes of them."""
    (reach, clear), _ = read_all([f"{name}=25"], [f"{name}=25"], "mass")
    chamber = {"width": 9.5, "length": 9.5}
    design = sbafab.load("radial-15mm", chamber=chamber, models=UNCALIBRATED)
    subject = Subject(design, sbafab.build(design))
    reached, widest = (subject.value(one.quantity) for one in (reach, clear))
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


@pytest.mark.parametrize("diameter", few([5.0, 7.0], 1))
def test_each_figure_is_the_one_of_predict(diameter: float) -> None:
    """Wide pockets too, whose films wave: the same function, to the last digit that is shown."""
    chamber = {"diameter": diameter}
    said = sbafab.predict("3dof-15mm", chamber=chamber, pressures_kpa=[8.0])

    def value(text: str) -> float:
        return _value(text, "3dof-15mm", chamber=chamber)

    full = said.value("reference_stroke")
    assert value("reference_stroke") == full
    assert value("stroke@8kPa") == pytest.approx(said.value("free_stroke", kpa=8), rel=1e-7)
    bend = said.value("bend", kpa=8, chambers=1)
    assert value("bend@8kPa") == pytest.approx(bend, rel=1e-7)
    # From flat: a quarter of the way from the films to the reference height.
    height = 0.25 * (full - said.value("folded_height"))
    force = said.value("blocked_force", "elastic-stack", kpa=8, share=0.25)
    assert value(f"force@{height!r}mm@8kPa") == pytest.approx(force, rel=1e-7)
    assert value("force@25%@8kPa") == pytest.approx(force, rel=1e-7)
    assert value("height") == said.value("folded_height")


def test_each_interval_is_the_one_of_predict() -> None:
    """Also of what only the stack at other factors gives, and with the delay of the water."""
    design = sbafab.load("3dof-15mm", stack={"balloons": 6})
    said = sbafab.predict(design, pressures_kpa=[8.0], flow_ml_min=20.0)
    subject = Subject(design, sbafab.build(design))
    names = {
        "stroke@8kPa": "free stroke at 8 kPa",
        "height": "folded height",
        "bend@2chambers@8kPa": "bend at 8 kPa in 2 chambers, the others empty",
        "lateral_stiffness@8kPa": "lateral tip stiffness at 8 kPa, chambers shut",
        "force@75%@8kPa": "blocked force at 8 kPa, at 75 % of the reference stroke",
        "time@20ml/min": "time to 10 kPa at the pump, water at 20 ml/min in all",
    }
    for text, name in names.items():
        (figure,) = (one for one in said.figures if one.name == name and one.interval)
        quantity = read_quantity(text)
        assert subject.value(quantity) == pytest.approx(figure.value, rel=1e-9), text
        assert subject.interval(quantity) == pytest.approx(figure.interval, rel=1e-9), text
        assert (subject.counterpart(quantity) is None) == (figure.measured is None), text
    for exact in ("mass", "lumen", "reference_stroke"):
        assert subject.interval(read_quantity(exact)) is None
    uncalibrated = design.with_({"models.calibration": "none"})
    assert Subject(uncalibrated, subject.laminate).interval(read_quantity("height")) is None


def test_a_bend_leaves_a_chamber_empty() -> None:
    with pytest.raises(DesignError, match="a bend is of at most 2 of them"):
        _value("bend@3chambers@5kPa", "3dof-15mm")


def test_diameters_round_a_tube_are_those_of_predict() -> None:
    said = sbafab.predict("radial-15mm")
    for name in ("deflated_diameter", "reached_diameter", "inflated_diameter"):
        found = said.value(name)
        assert _value(name, "radial-15mm") == pytest.approx(found, rel=1e-12)


def test_a_force_at_a_share_of_the_stroke_is_that_of_predict_round_a_tube_too() -> None:
    said = sbafab.predict("radial-15mm", pressures_kpa=20)
    (force, *_) = (
        f for f in said.figures if f.name.endswith("20 kPa, at 25 % of the reference stroke")
    )
    assert _value("force@25%@20kPa", "radial-15mm") == pytest.approx(force.value, rel=1e-12)
    film = {"product": "TPU", "thickness": 0.1, "modulus": 20, "poisson": 0.45}
    with pytest.raises(DesignError, match="reference stroke: "):
        _value("force@25%@20kPa", films={"tpe": film})
    assert _value("force@0%@20kPa", films={"tpe": film}) > 0


def test_a_lone_chamber_does_not_bend() -> None:
    with pytest.raises(DesignError, match="does not bend"):
        _value("bend@5kPa")


def test_the_force_of_a_taper_is_that_of_predict() -> None:
    taper = {"chamber": {"diameter": [6.0, 5.0]}, "stack": {"balloons": 2}}
    said = sbafab.predict("1dof-5mm", pressures_kpa=[5.0], **taper)
    flat = said.value("blocked_force", "elastic-stack", kpa=5, share=0)
    assert _value("force@0mm@5kPa", **taper) == pytest.approx(flat, rel=1e-7)


def test_stroke_and_force_are_those_of_a_flat_balloon() -> None:
    said = sbafab.predict("1dof-5mm", pressures_kpa=[5.0]).value("free_stroke", kpa=5)
    # Hardly raised, the film lies flat on the plates all over its pocket.
    flat = 10e-3 * math.pi * 2.5**2
    assert flat * 0.9 < _value("force@0.05mm@10kPa", models=UNCALIBRATED) <= flat
    # It gets no higher than its free stroke, and pushes the less the nearer it is to it.
    near = [_value(f"force@{stroke}mm@5kPa") for stroke in (2, 4, 6)]
    assert near == sorted(near, reverse=True)
    assert _value(f"force@{1.05 * said}mm@5kPa") < 0


def test_a_mechanism_is_the_figure_of_predict() -> None:
    names = {
        "pouch": {
            "contraction": "free contraction",
            "pull@0.5kPa": "pull at 0.5 kPa, 10 % shorter",
        },
        "finger": {
            "free_bend": "free bend, 3 hinges",
            "moment@20kPa": "moment at 20 kPa, straight",
        },
        "vacuum": {"slip@-50kPa": "load that slips at -50 kPa"},
    }
    for template, figures in names.items():
        design = sbafab.load(template)
        subject = Subject(design, sbafab.build(design))
        for text, name in figures.items():
            quantity = read_quantity(text)
            said = sbafab.predict(design, pressures_kpa=[quantity.kpa or 10.0])
            (figure,) = (item for item in said.figures if item.name == name)
            assert subject.value(quantity) == figure.value, text
            assert quantity.unit == figure.unit
            assert subject.interval(quantity) is None


def test_a_pull_is_that_of_two_arcs() -> None:
    # Niiyama et al.: p D L cos t / t with sin t / t = 0.9, of a pouch of 40 x 30 mm.
    angle = 0.786683
    assert math.sin(angle) / angle == pytest.approx(0.9, rel=1e-5)
    pull = 0.5e-3 * 30 * 40 * math.cos(angle) / angle
    assert _value("pull@0.5kPa", "pouch") == pytest.approx(pull, rel=1e-4)


def test_a_mechanism_that_is_another_or_does_not_hold_is_named() -> None:
    with pytest.raises(DesignError, match="pull is of a pouch-motor, and the design has a mecha"):
        _value("pull@1kPa", "finger")
    with pytest.raises(DesignError, match="push is of a push, and the design has no mechanism"):
        _value("push@1kPa")
    with pytest.raises(DesignError, match="the film would stretch by more than 5 %"):
        _value("pull@10kPa", "pouch")
