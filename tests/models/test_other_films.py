"""A film that the paper did not measure is not predicted with the paper's."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import film_mass
from sbafab.models.figures import EXTRAPOLATION, Prediction, PredictionRequest
from sbafab.models.prediction import predict
from sbafab.models.quantity import Quantity
from sbafab.models.stack import stack
from sbafab.simulators.calculix import deck_settings
from sbafab.simulators.shell_model import coarse_shell, round_stack

TPU = ("films.tpe.product=TPU 85A", "films.tpe.thickness=0.05")
KNOWN = (*TPU, "films.tpe.modulus=20", "films.tpe.poisson=0.45")
UNCALIBRATED = "models.calibration=none"
"""Without intervals, each of which takes balloons of its own."""


def _design(*changes: str) -> Design:
    return load_design("3dof-15mm", ("stack.balloons=4", *changes))


def predicted(*changes: str) -> Prediction:
    return predict(_design(*changes))


def left_out(found: Prediction) -> dict[str, str]:
    return {item.name: item.reason for item in found.left_out}


def test_the_papers_film_leaves_nothing_out_for_its_film() -> None:
    why = left_out(predicted(UNCALIBRATED)).values()
    assert not any("films.tpe" in reason or "own film" in reason for reason in why)


def test_what_needs_a_number_that_is_not_known_is_left_out_by_name() -> None:
    found = predicted(*TPU)
    why = left_out(found)
    assert "films.tpe.density" in why["mass"]
    assert "films.tpe.density" in why["power density"]
    assert "films.tpe.modulus" in why["elastic stack"]
    assert "films.tpe.modulus" in why["free stroke, elastic balloon"]
    names = {figure.name for figure in found.figures}
    assert not names & {
        "mass",
        "reference stroke",
        "reference height",
        "lateral tip stiffness, inflated",
    }
    assert not any("reference stroke" in name or "power density" in name for name in names)
    assert not any("elastic" in figure.model.name for figure in found.figures)
    # Geometry needs no film.
    assert "blocked force at 100 kPa, flat" in names


def test_what_the_paper_measured_of_its_film_holds_for_no_other() -> None:
    """17.5 mm of full height and the moduli of 35 and 60 kPa are those of Stretchlon 200."""
    found = predicted(*KNOWN, "films.tpe.density=1200", UNCALIBRATED)
    assert {name for name, why in left_out(found).items() if "own film" in why} == {
        "reference stroke and height, and what is predicted at them",
        "bend and tip displacement at the reference stroke, constant curvature",
        "lateral tip stiffness, inflated",
    }
    drawn = [line.label for curve in found.relations for line in (*curve.lines, *curve.points)]
    assert not any("paper" in label for label in drawn)
    thicker = left_out(predict(_design("films.tpe.thickness=0.05"), quick=True))
    assert "own film" in thicker["reference stroke and height, and what is predicted at them"]


def test_a_force_that_nobody_measured_of_such_a_film_is_an_extrapolation() -> None:
    """With a modulus and without, with a calibration and without: a film 2.6 times as thick."""
    thick = (TPU[0], "films.tpe.thickness=0.1")
    for more in ((), (UNCALIBRATED,)):
        found = predict(load_design("1dof-5mm", (*thick, *more)), quick=True)
        forces = [each for each in found.figures if each.quantity is Quantity.BLOCKED_FORCE]
        assert forces
        assert all(each.flags == (EXTRAPOLATION,) for each in forces)
    papers = predict(load_design("1dof-5mm"), quick=True)
    assert not papers.figure("blocked_force", "work-on-eq-4", kpa=100, share=0).flags


def test_why_there_is_not_one_figure() -> None:
    found = predict(load_design("1dof-5mm", TPU), quick=True)
    with pytest.raises(
        DesignError, match=r"^reference_stroke is not one figure: the paper measured"
    ):
        found.value("reference_stroke")
    with pytest.raises(DesignError, match=r"predict it with pressures_kpa=\[50\]$"):
        found.value("blocked_force", kpa=50, share=0)


def test_the_elastic_balloon_takes_the_films_own_numbers() -> None:
    """Shapes hang on p / E and on t alone: twice the modulus and the pressure, the same stroke."""
    same = ("films.tpe.product=A", "films.tpe.thickness=0.038", "films.tpe.poisson=0.2")
    papers = predict(
        load_design("1dof-5mm", (UNCALIBRATED,)), PredictionRequest(pressures_kpa=(3.0,))
    )
    alike = predict(
        load_design("1dof-5mm", (*same, UNCALIBRATED, "films.tpe.modulus=10")),
        PredictionRequest(pressures_kpa=(3.0,)),
    )
    twice = predict(
        load_design("1dof-5mm", (*same, UNCALIBRATED, "films.tpe.modulus=20")),
        PredictionRequest(pressures_kpa=(6.0,)),
    )
    stroke = papers.value("free_stroke", kpa=3)
    assert alike.value("free_stroke", kpa=3) == pytest.approx(stroke, rel=1e-9)
    assert twice.value("free_stroke", kpa=6) == pytest.approx(stroke, rel=1e-3)


def test_masses_and_weights_need_a_density() -> None:
    design = load_design("1dof-5mm", KNOWN)
    with pytest.raises(DesignError, match=r"the mass needs the density of TPE, TPU 85A; add films"):
        film_mass(build(design))
    column = stack(design)
    assert column.pose((1.0,)).height > 0
    with pytest.raises(DesignError, match=r"gravity needs the density of every film"):
        column.pose((1.0,), gravity=True)
    with pytest.raises(DesignError, match=r"CalculiX needs the density of TPE"):
        deck_settings(build(design))
    with pytest.raises(DesignError, match=r"a simulation needs the density of TPE"):
        assert coarse_shell(round_stack(build(design))).mass
    heavy = build(load_design("1dof-5mm", (*KNOWN, "films.tpe.density=2244")))
    paper = build(load_design("1dof-5mm", ("films.tpe.thickness=0.05",)))
    tpe = sum(layer.profile.area * 0.05 * 1122e-6 for layer in paper.tpe_layers)
    assert film_mass(heavy) - film_mass(paper) == pytest.approx(tpe)


def test_simulators_need_modulus_and_poisson() -> None:
    flat = build(load_design("1dof-5mm", (*TPU, "films.tpe.density=1200", "films.tpe.modulus=20")))
    with pytest.raises(DesignError, match=r"add films.tpe.modulus, in MPa, and poisson"):
        deck_settings(flat)
    with pytest.raises(DesignError, match=r"^modulus or Poisson's ratio of TPU 85A is not known"):
        stack(load_design("1dof-5mm", TPU))


def _named(name: str, *tables: str) -> tuple[str, ...]:
    """Changes that cut all films that bond from ``films.NAME`` with these numbers."""
    roles = (f"layup.{role}={name}" for role in ("base", "wall", "cap"))
    return (f"films.{name}.kind=structural", *(f"films.{name}.{each}" for each in tables), *roles)


def test_a_film_is_that_of_the_layers_wherever_the_design_names_it() -> None:
    """The calibration asks which film is cut, not what ``films.tpe`` says."""
    numbers = ("product=TPU 85A", "thickness=0.05", "modulus=20", "poisson=0.45")
    as_tpe = predict(_design(*KNOWN), quick=True)
    as_own = predict(_design(*_named("own", *numbers)), quick=True)
    stroke = as_tpe.figure("free_stroke", kpa=10)
    assert as_own.figure("free_stroke", kpa=10).value == pytest.approx(stroke.value)
    assert as_own.figure("free_stroke", kpa=10).interval == pytest.approx(stroke.interval)
    assert as_own.asked.factors.modulus_ratio == 1.0
    papers = ("product=Stretchlon 200", "thickness=0.038", "modulus=10", "poisson=0.2")
    renamed = predict(_design(*_named("st", *papers), *TPU), quick=True)
    plain = predict(_design(), quick=True).value("free_stroke", kpa=10)
    assert renamed.value("free_stroke", kpa=10) == pytest.approx(plain)


def test_a_folded_height_whose_flow_is_unknown_is_no_certain_figure() -> None:
    """Films that melt in the press keep from all of their thickness down to what the prior leaves:
    its median of 0.32, less 1.64 standard deviations of 0.7 of the logarithm.
    """
    design = _design(*KNOWN, "films.tpe.melting_point=120")
    folded = predict(design, quick=True).figure("folded_height")
    masks, films = 7 * 0.025, 8 * 0.05
    assert folded.value == pytest.approx(masks + films)
    assert folded.interval == pytest.approx(
        (masks + films * 0.32 * math.exp(-1.6448536 * 0.7), masks + films)
    )
    assert "extrapolation" in folded.flags


def test_a_figure_that_has_no_interval_is_flagged_too() -> None:
    """An actuator of a stiffer film may not bend so far, so that there is no interval."""
    found = predict(load_design("3dof-15mm", (*KNOWN, "films.tpe.thickness=0.1")))
    bent = [figure for figure in found.figures if figure.quantity is Quantity.BENT_FORCE]
    assert bent
    assert all("extrapolation" in figure.flags for figure in bent)
