"""Kits: a lab's numbers with their sources, and what a design takes from them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import sbafab
from sbafab.actuators import build, load_design
from sbafab.design.files import read_toml, templates_folder
from sbafab.design.films import Films
from sbafab.design.identity import OTHER_TUBE, citation, cure_hours, design_sha256, tube_name
from sbafab.design.kits import read_kit, write_kit
from sbafab.design.records import Design, design_toml, dotted
from sbafab.design.sections import Acceptance, Laser, Press, Registration, Rules, Sheets
from sbafab.errors import DesignError
from sbafab.pressing.schedule import schedule

SECTIONS = {
    "films": Films(),
    "registration": Registration(),
    "press": Press(),
    "acceptance": Acceptance(),
    "laser": Laser(),
    "sheets": Sheets(),
    "rules": Rules(),
}


def numbers(table: dict[str, Any]) -> dict[str, object]:
    rows = dotted(table)
    return {k: v for k, v in rows if isinstance(v, int | float) and not isinstance(v, bool)}


def at(table: Any, key: str) -> Any:
    for part in key.split("."):
        table = table[part]
    return table


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """Another lab's kit: a cooler press, a larger platen, a film, a mask and a tube of its own."""
    path = write_kit(tmp_path / "lab.toml")
    text = path.read_text()
    for old, new in (
        ("value = 135.0", "value = 128.0"),
        ("platen_width = { value = 152.4", 'platen_width = { value = "12 in"'),
        (
            '[tubes."Braintree',
            '[films.tpu50]\nkind = "structural"\nproduct = "TPU 85A"\n'
            'thickness = { value = "50 um", source = "data sheet" }\n'
            'density = { value = 1200, source = "data sheet" }\n'
            'melting_point = { value = 115, source = "data sheet" }\n\n'
            '[tubes."Fine tube"]\nouter_diameter = { value = 0.8, source = "measured" }\n\n'
            '[tubes."Braintree',
        ),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


def test_the_papers_kit_says_every_number_that_a_design_has_by_default() -> None:
    path = templates_folder() / "kits" / "paper.toml"
    kit, written = read_kit(path), read_toml(path)
    usual = {section: record.model_dump(mode="json") for section, record in SECTIONS.items()}
    for key, value in numbers(usual).items():
        assert at(kit.tables, key) == value, key
        assert at(written, f"{key}.source").strip()
    tube = Design.model_fields["inlet"].default
    assert kit.record.tubes[tube.tube].outer_diameter == tube.tube_outer_diameter
    assert tube.adhesive in kit.record.adhesives


def test_a_kit_gives_what_the_design_leaves_out(lab: Path, tmp_path: Path) -> None:
    design = tmp_path / "one.toml"
    design.write_text('family = "1dof"\nkit = "lab.toml"\n[press]\nplaten_width = 200\n')
    found = load_design(design)
    assert (found.press.temperature_c, found.press.platen_width) == (128.0, 200.0)
    assert found.films.stock["tpu50"].thickness == pytest.approx(0.05)
    assert (found.inlet.tube, found.inlet.tube_outer_diameter) == ("Fine tube", 0.8)
    said = citation(found)
    assert (said["name"], said["version"]) == ("lab", "3")
    assert said["departures"] == ["press.platen_width"]


def test_a_tube_of_another_size_does_not_keep_the_name_of_the_kits(lab: Path) -> None:
    for changes, name in (
        (["inlet.tube_outer_diameter=2"], "tubing of your choice"),
        (["inlet.tube_outer_diameter=1.016"], "Braintree RPT040"),
        (["inlet.tube_outer_diameter=2", "inlet.tube=My hose"], "My hose"),
        ([f"kit={lab}"], "Braintree RPT040"),
        ([f"kit={lab}", "inlet.tube=Fine tube", "inlet.tube_outer_diameter=0.8"], "Fine tube"),
        ([f"kit={lab}", "inlet.tube=Fine tube", "inlet.tube_outer_diameter=1"], OTHER_TUBE),
    ):
        assert tube_name(load_design("1dof-5mm", changes)) == name


def test_the_kits_sources_count_in_the_hash(lab: Path) -> None:
    first = design_sha256(load_design("1dof-5mm", [f"kit={lab}"]))
    lab.write_text("# a remark\n" + lab.read_text())
    assert design_sha256(load_design("1dof-5mm", [f"kit={lab}"])) == first
    lab.write_text(lab.read_text().replace('"measured"', '"guessed"'))
    assert design_sha256(load_design("1dof-5mm", [f"kit={lab}"])) != first


BAD = {
    "modulus in another unit": (
        "value = 10.0",
        'value = "1450 psi"',
        r"modulus = '1450 psi' must be a number, in MPa, or a text with its unit \(or kPa, GPa\)",
    ),
    "value out of range": (
        "value = 0.038",
        "value = 38",
        r"films.tpe.thickness = 38 must be at most 1 mm",
    ),
    "number without a source": (
        'thickness = { value = 0.038, source = "paper, Sec. 2" }',
        "thickness = 0.038",
        r"films.tpe.thickness = 0.038 has no source; write films.tpe.thickness = \{ value",
    ),
    "misspelt value": (
        "modulus = { value",
        "modulus = { valu",
        r"films.tpe.modulus must be \{ value = ..., source = .* and nothing else",
    ),
    "film without its kind": (
        "[rules]",
        '[films.tpu]\nproduct = "TPU"\n[rules]',
        r'films.tpu.kind is missing; add it to the kit, as one of "structural", "mask"',
    ),
    "unknown key": (
        "cutting_error =",
        "cuting_error =",
        r"registration.cuting_error is not a key of a kit; did you mean .*cutting_error\?",
    ),
    "waiver": ("[rules]", '[rules]\nwaive = ["sealing"]', r"rules.waive belongs in a design"),
}


def test_moduli_temperatures_and_densities_take_units(tmp_path: Path) -> None:
    path = write_kit(tmp_path / "lab.toml")
    text = path.read_text()
    for old, new in (
        ("10.0", '"0.01 GPa"'),
        ("120.0", '"120 \u00b0C"'),
        ("1122.0", '"1.122 g/cm3"'),
    ):
        assert f"value = {old}" in text
        text = text.replace(f"value = {old}", f"value = {new}", 1)
    text = text.replace("value = 135.0", 'value = "135C"')
    path.write_text(text, encoding="utf-8")
    usual, design = sbafab.load("1dof-5mm"), sbafab.load("1dof-5mm", kit=str(path))
    assert design.films == usual.films
    assert design.press == usual.press
    assert sbafab.load("1dof-5mm", "films.tpe.modulus=500 kPa").films.tpe.modulus == 0.5


def test_minutes_of_another_film_are_the_kits_alone(tmp_path: Path) -> None:
    path = write_kit(tmp_path / "lab.toml")
    text = re.sub("(?m)^(minutes_for|bond_all_minutes) .*\n", "", path.read_text())
    changes = ("films.tpe.product=TPU", "films.tpe.thickness=0.05", f"kit={path}")
    for named, minutes in (
        ("TPU, 0.05 mm", [3, 12, 10, None]),
        ("Stretchlon 200, 0.038 mm", [None] * 4),
    ):
        path.write_text(text.replace("[press]", f'[press]\nminutes_for = ["{named}"]'))
        design = load_design("1dof-5mm", changes)
        plan = schedule(build(design), design)
        assert [step.minutes for step in plan.steps] == minutes
        assert plan.total_press_minutes is plan.estimated_build_minutes is None
        assert [each for each in plan.warnings if "blank" in each]
    (said,) = (f.remedy for f in sbafab.check(design) if f.id == "press-fit.unstated")
    assert "name TPU, 0.05 mm in press.minutes_for, which names Stretchlon 200, 0.038 mm" in said
    path.write_text(text.replace("[press]", '[press]\nminutes_for = ["TPU, 0.05 mm"]'))
    (said,) = (f.remedy for f in sbafab.check("1dof-5mm", *changes) if f.id == "press-fit.left-out")
    assert said == "try the bond on a sample, and state press.bond_all_minutes in the kit"
    path.write_text(path.read_text().replace("temperature_c = ", "cool_minutes = "))
    with pytest.raises(
        DesignError, match=r"minutes_for names TPU, but press.temperature_c is miss"
    ):
        load_design("1dof-5mm", changes)
    # The paper's own film keeps the paper's.
    path.write_text(text)
    papers = load_design("1dof-5mm", [f"kit={path}"])
    assert [step.minutes for step in schedule(build(papers), papers).steps] == [3, 12, 10, 20]


@pytest.mark.parametrize("case", BAD)
def test_a_bad_kit_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    old, new, said = BAD[case]
    path = write_kit(tmp_path / "lab.toml")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DesignError, match=said) as raised:
        load_design("1dof-5mm", [f"kit={path}"])
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_another_product_shares_no_property_of_the_papers_film(tmp_path: Path) -> None:
    """A kit or a design that names another film brings its own numbers, or they are not known."""
    path = write_kit(tmp_path / "tpu.toml")
    text = path.read_text()
    for line in ("density", "melting_point", "modulus", "poisson"):
        text = re.sub(rf"(?m)^{line} = .*\n", "", text, count=1)
    text = text.replace('"Stretchlon 200"', '"TPU 85A"', 1)
    text = text.replace("thickness = { value = 0.038", "thickness = { value = 0.05", 1)
    path.write_text(text)
    unknown = (None, None, None)
    for design in (
        load_design("1dof-5mm", [f"kit={path}"]),
        load_design("1dof-5mm").with_(f"kit={path}"),
        load_design("1dof-5mm", ["films.tpe.product=TPU 85A", "films.tpe.thickness=0.05"]),
        load_design("1dof-5mm").with_({"films.tpe": {"product": "TPU 85A", "thickness": 0.05}}),
    ):
        film = design.films.stock["tpe"]
        assert (film.product, film.thickness) == ("TPU 85A", 0.05)
        assert (film.density, film.softens_above, film.elastic) == unknown
    back = load_design("1dof-5mm", [f"kit={path}", "films.tpe.product=Stretchlon 200"])
    film = back.films.stock["tpe"]
    assert (film.thickness, film.density, film.softens_above) == (0.038, 1122, 120)
    assert film.elastic == (10, 0.2)


def test_a_film_keeps_its_numbers_when_read_back(tmp_path: Path) -> None:
    """What is not known stays so in design.toml, and what is known is written."""
    changes = ["films.tpe.product=TPU", "films.tpe.thickness=0.05", "films.tpe.modulus=25"]
    design = load_design("1dof-5mm", changes)
    path = tmp_path / "design.toml"
    path.write_text(design_toml(design))
    assert load_design(path).films == design.films
    assert design_sha256(load_design(path)) == design_sha256(design)
    plain = load_design("1dof-5mm", [*changes[:2], "films.tpe.modulus=26"])
    assert design_sha256(plain) != design_sha256(design)


def test_a_kit_is_never_written_over(tmp_path: Path) -> None:
    path = write_kit(tmp_path / "our-lab.toml")
    assert read_kit(path).record.name == "our-lab"
    with pytest.raises(DesignError, match="exists"):
        write_kit(path)


def test_the_time_of_curing_is_that_of_the_kits_adhesive(lab: Path) -> None:
    hours = 'cure_hours = { value = 6, source = "its package" }'
    lab.write_text(lab.read_text().replace('use = "a small drop', f'{hours}\nuse = "a small drop'))
    for changes, cure in (
        ([], None),
        ([f"kit={lab}"], 6),
        ([f"kit={lab}", "order.cure_hours=2"], 2),
    ):
        design = load_design("1dof-5mm", changes)
        assert cure_hours(design) == cure
