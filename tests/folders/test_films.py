"""A design of five films: two thicknesses of structural film, one that does not stretch, two masks.

Numbers are those of the kit below and closed formulas.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.identity import kit_of
from sbafab.design.kits import write_kit
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.folders.check import check_folder
from sbafab.folders.run import Run, RunRequest, generate
from sbafab.pressing.schedule import schedule
from sbafab.rules.deck import has_failed
from sbafab.simulators.calculix import deck_settings
from sbafab.simulators.mujoco import model_text
from sbafab.simulators.shell_model import coarse_shell, round_stack, why_not_round
from sbafab.simulators.sofa import why_not

FILMS = """
[films.tpu50]
kind = "structural"
product = "TPU 85A"
thickness = { value = 0.05, source = "data sheet" }
density = { value = 1200, source = "data sheet" }
melting_point = { value = 115, source = "data sheet" }
modulus = { value = 20, source = "data sheet" }
poisson = { value = 0.3, source = "data sheet" }
kerf = { value = 0.1, source = "coupon" }

[films.pet]
kind = "structural"
product = "PET that does not stretch"
thickness = { value = 0.012, source = "data sheet" }
density = { value = 1390, source = "data sheet" }
temperature_limit = { value = 220, source = "data sheet" }

[films.ptfe50]
kind = "mask"
product = "thicker PTFE"
thickness = { value = 0.05, source = "data sheet" }
density = { value = 2200, source = "handbook" }
temperature_limit = { value = 250, source = "data sheet" }
warning = "Knife only."
"""
LAYUP = ("layup.wall=tpu50", "layup.cap=pet", "layup.separator_mask=ptfe50")


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Design:
    path = write_kit(tmp_path_factory.mktemp("lab") / "lab.toml")
    path.write_text(path.read_text() + FILMS)
    few = ("stack.balloons=2", "rules.yield_builds=100")
    return load_design("1dof-5mm", [f"kit={path}", *LAYUP, *few])


@pytest.fixture(scope="module")
def run(design: Design, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return generate(
        RunRequest(design, tmp_path_factory.mktemp("films"), ("cut", "press", "preview"))
    )


def test_every_film_has_its_files_sheets_and_rows(run: Run) -> None:
    names = [layer["name"] for layer in run.manifest["layers"]]
    assert names == [
        "001_TPE_base",
        "002_PTFE_chamber-mask",
        "003_TPU50_wall",
        "004_PTFE50_separator-mask",
        "005_TPU50_wall",
        "006_PTFE_chamber-mask",
        "007_PET_cap",
    ]
    assert (run.folder / "layers" / "003_TPU50_wall_kerf0.1.dxf").is_file()
    assert [sheet["material"] for sheet in run.manifest["sheets"]] == [
        "TPE",
        "PTFE",
        "PET",
        "PTFE50",
        "TPU50",
    ]
    assert {"Knife only."} < set(run.manifest["warnings"])
    page = (run.folder / "traveller.html").read_text()
    for said in ("TPU50 film", "PET that does not stretch", "Knife only.", "kit lab, version 3"):
        assert said in page


def test_heights_are_the_sums_of_the_films(run: Run) -> None:
    films = (0.038, 0.025, 0.05, 0.05, 0.05, 0.025)
    heights = [layer["z"] for layer in run.manifest["layers"]]
    assert heights == pytest.approx([sum(films[:n]) for n in range(7)])
    assert run.manifest["sizes"]["thickness"] == pytest.approx(sum(films) + 0.012)


def test_films_are_told_apart_by_colour_and_masks_by_their_hatch(run: Run) -> None:
    picture = (run.folder / "preview" / "layers.svg").read_text()
    for sign in ("url(#PTFE)", "url(#mask2)", '<pattern id="mask2"', "#a9cfea", "#8fd0b5"):
        assert sign in picture


def test_what_was_written_holds_as_built(run: Run) -> None:
    findings = check_folder(run.folder)
    assert not has_failed(findings)
    assert any(f.rule == "as-designed" and f.verdict == "pass" for f in findings)


def test_the_folder_holds_the_kit_that_it_cites(run: Run, design: Design) -> None:
    assert (run.folder / "kit.toml").read_bytes() == kit_of(design).text
    assert load_design(run.folder / "design.toml").kit == "kit.toml"
    checks = json.loads((run.folder / "checks.json").read_text())
    assert checks["kits"] == [{"design": design.name, **run.manifest["kit"]}]


def test_what_the_press_cannot_do_is_not_predicted(design: Design, tmp_path: Path) -> None:
    cold = design.with_("press.temperature_c=118")
    with pytest.raises(DesignError, match="does not bond Stretchlon 200, which melts at 120 C"):
        generate(RunRequest(cold, tmp_path, ("predict",)))
    assert list(tmp_path.iterdir()) == []


def test_the_press_knows_what_melts(design: Design) -> None:
    def press(*changes: str) -> None:
        changed = design.with_(*changes)
        schedule(build(changed), changed)

    press()
    with pytest.raises(DesignError, match="does not bond Stretchlon 200, which melts at 120 C"):
        press("press.temperature_c=118")
    with pytest.raises(DesignError, match="reaches the limit of PET, 220 C"):
        press("press.temperature_c=230")
    with pytest.raises(
        DesignError, match=r"layers 3 and 5 are of PET and PET, .* give the wall another film"
    ):
        press("layup.wall=pet")


def test_a_film_that_is_not_there_or_cannot_do_the_work_is_named(design: Design) -> None:
    with pytest.raises(DesignError, match=r'layup.cap = .tpu. is not a film; use "tpe", "'):
        build(design.with_("layup.cap=tpu"))
    with pytest.raises(DesignError, match="is a mask film, but a cap needs a structural film"):
        build(design.with_("layup.cap=ptfe50"))


def test_calculix_takes_each_film_and_the_coarse_shell_one_that_is_known(
    design: Design,
) -> None:
    laminate = build(design)
    assert "of one film" in (why_not_round(laminate) or "")
    assert "films of PET, TPE, TPU50" in (why_not_round(laminate) or "")
    tpu, tpe, pet = (
        build(design.with_(*(f"layup.{role}={name}" for role in ("base", "wall", "cap"))))
        for name in ("tpu50", "tpe", "pet")
    )
    stack = round_stack(tpu)
    shells = [coarse_shell(stack), coarse_shell(round_stack(tpe))]
    model = model_text(stack, shells[0], {"chamber1": 5.0})
    assert 'young="200000"' in model
    assert 'poisson="0.3"' in model
    # Two bonded films of 0.05 mm, and the mass of TPU at 1200 kg/m3 instead of TPE's.
    assert 'thickness="0.01"' in model
    assert stack.bending(1) == pytest.approx(20e3 * 0.05**3 / 12 / (1 - 0.09))
    assert shells[0].mass / shells[1].mass == pytest.approx(0.05 * 1200 / (0.038 * 1122))
    assert "add films.pet.modulus, in MPa" in (why_not_round(pet) or "")
    assert why_not(tpu) is None
    with pytest.raises(DesignError, match=r"add films.pet.modulus, in MPa"):
        deck_settings(laminate)
    stiff = build(design.with_("films.pet.modulus=3000", "films.pet.poisson=0.3"))
    films = {"TPU50": (20, 0.3, 1.2e-9), "PET": (3000, 0.3, 1.39e-9)}
    assert {name: of for name, of in deck_settings(stiff).films.items() if name != "TPE"} == films


def test_meshes_hold_area_times_thickness_of_each_film(design: Design) -> None:
    from sbafab.meshing.conforming.layup import MeshSettings
    from sbafab.meshing.conforming.meshes import conforming_meshes

    flat = build(
        design.with_("stack.balloons=1", "fillet.radius=0", "inlet.width=1.6", "layup.base=tpu50")
    )
    volume = conforming_meshes(flat, MeshSettings(h=0.7)).volume
    # A disc of 6.5 and a tab 3.1 wide that ends 5 mm past it, less what lies under the disc.
    side = math.sqrt(3.25**2 - 1.55**2)
    disc = math.pi * 3.25**2
    segment = 3.25**2 * math.asin(1.55 / 3.25) - 1.55 * side
    tab = 3.1 * (8.25 - side) - segment
    assert flat.layer(1).profile.area == pytest.approx(disc + tab, rel=1e-9)
    points, cells, owner = volume.linear()
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    import numpy as np

    sizes = np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)) / 6
    for name, material in volume.materials.items():
        if not name.startswith("film"):
            continue
        own = sizes[np.isin(owner, volume.cell_sets[name])].sum()
        thickness = {"TPU50": 0.05, "PET": 0.012}[material]
        assert own == pytest.approx((disc + tab) * thickness, rel=0.02)
    assert set(volume.materials.values()) == {"TPU50", "PET"}
