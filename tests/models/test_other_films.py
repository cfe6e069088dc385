"""A film that the paper did not measure is not predicted with the paper's."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import film_mass
from sbafab.models.figures import Prediction, PredictionRequest
from sbafab.models.prediction import predict
from sbafab.models.stack import stack
from sbafab.simulators.calculix.deck import deck_settings
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
    with pytest.raises(DesignError, match=r"add films.tpe.modulus, in MPa, and poisson"):
        stack(load_design("1dof-5mm", TPU))
