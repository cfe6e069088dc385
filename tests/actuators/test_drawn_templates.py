"""The templates of drawn layers: rules, sources, predictions and meshes of each."""

from __future__ import annotations

import math
import re

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.files import read_toml, template_names, template_text, templates_folder
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.meshes import conforming_meshes
from sbafab.meshing.solid import MASKLESS_GAP, cavity, solid
from sbafab.models.figures import PredictionRequest
from sbafab.models.prediction import predict
from sbafab.rules.deck import run_deck
from tests.designs import FEW
from tests.quick import few

DRAWN = [
    name
    for name in template_names()
    if read_toml(templates_folder() / f"{name}.toml")["family"] == "drawn"
]
SOURCE = re.compile(r"arXiv \d{4}\.\d{4,5}|\(\d{4}\) \d+|US \d{4}/\d{7}|doi 10\.")


@pytest.mark.parametrize("name", DRAWN)
def test_each_names_its_source_and_that_nobody_built_it(name: str) -> None:
    comment = template_text(name).partition("\nname")[0]
    assert "ever built" in comment.partition("\n")[0] + comment
    assert SOURCE.search(comment.replace("\n# ", " "))


@pytest.mark.parametrize("name", DRAWN)
def test_each_passes_its_rules(name: str) -> None:
    design = load_design(name)
    assert design.rules.waive == ()
    findings = run_deck(build(design), FEW)
    assert "fail" not in {finding.verdict for finding in findings}


@pytest.mark.parametrize("name", few(DRAWN, 3))
def test_each_has_a_volume_mesh_with_open_chambers(name: str) -> None:
    laminate = build(load_design(name))
    meshes = conforming_meshes(laminate, MeshSettings(h=1.0))
    films = sum(layer.profile.area * layer.film.thickness for layer in laminate.tpe_layers)
    assert meshes.statistics["volume"]["volume_mm3"] == pytest.approx(films, rel=1e-3)
    faces = meshes.volume.face_sets
    assert all(len(faces[f"cavity_{chamber.name}"]) for chamber in laminate.chambers)


def test_a_chamber_ends_where_a_hole_leads_to_the_next_one_of_its_net() -> None:
    """The mask's area times its thickness; the via's own air, 0.06 mm3, is in neither."""
    laminate = build(load_design("diode"))
    volume = conforming_meshes(laminate, MeshSettings(h=1.0, gaps=True)).volume
    base = laminate.layers[0].profile
    masks = [layer for layer in laminate.layers if layer.is_mask]
    for name, mask in zip(("in", "out"), masks, strict=True):
        expected = (mask.profile & base).area * mask.film.thickness
        assert volume.cavity(name)[0].volume == pytest.approx(expected, rel=2e-3)


def test_a_pouch_without_a_mask_has_a_cavity_that_its_fold_closes() -> None:
    """36 mm between seams x 22.5 mm to half a millimetre from the fold, and the inlet: 2 x 13."""
    laminate = build(load_design("folded"))
    (chamber,) = laminate.chambers
    held = cavity(laminate, chamber).volume
    assert held == pytest.approx(MASKLESS_GAP * (36 * 22.5 + 2 * 13), rel=0.01)
    whole = solid(laminate).volume
    films = 2 * laminate.layers[0].profile.area * 0.1
    void = MASKLESS_GAP * laminate.layers[0].profile.area
    assert whole == pytest.approx(films + void - held, rel=1e-3)


def test_the_finger_bends_by_the_moment_of_its_pouch() -> None:
    """By hand p D L^2 (1/2 + 1 / sqrt 3) / 4, D = 14 and L = 16 mm; 3 hinges of 95.3 deg."""
    prediction = predict(load_design("finger"), PredictionRequest((10.0,)))
    by_hand = 0.01 * 14 * 16**2 * (0.5 + 1 / math.sqrt(3)) / 4
    assert prediction.value("moment", kpa=10, share=0) == pytest.approx(by_hand, rel=1e-4)
    assert prediction.value("free_bend") == pytest.approx(3 * 95.3, abs=0.2)


def test_the_array_is_bounded_by_pressure_times_pocket_and_says_what_was_measured() -> None:
    prediction = predict(load_design("array"), PredictionRequest((230.0,)))
    by_hand = 0.230 * math.pi * 4**2
    assert prediction.value("force_bound", of="row2") == pytest.approx(by_hand, rel=0.05)
    (model,) = {f.model for f in prediction.figures if f.group == "force"}
    assert "2.1 N at 230 kPa" in model.trust


def test_the_vacuum_stack_slips_by_its_friction_and_jams_n_squared_times_as_stiff() -> None:
    """2 mu P b n h / 3 with mu = 0.3, b = 20, n h = 0.4: by hand 0.128 N at -80 kPa."""
    prediction = predict(load_design("vacuum"), PredictionRequest((-80.0,)))
    assert prediction.value("slip_load", kpa=-80) == pytest.approx(0.128)
    assert prediction.value("jamming_ratio") == 64


def test_the_grippers_right_cavity_goes_through_its_via() -> None:
    laminate = build(load_design("gripper"))
    (right,) = [chamber for chamber in laminate.chambers if chamber.name == "right"]
    # Pouch; channel down to its corner, along and at its end; the via through a film of 0.1 mm.
    lower, upper = 16 * 14, 3.4 * (24 - 2.3) + 3.4 * 25 + 3.4 * 3.8
    expected = 0.025 * (lower + upper) + 0.1 * math.pi * 0.52**2
    assert cavity(laminate, right).volume == pytest.approx(expected, rel=1e-4)
