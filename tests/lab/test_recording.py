"""Recording from Python, and of whole assemblies."""

from __future__ import annotations

from pathlib import Path

import pytest

import sbafab
from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import assembly_sha256, assembly_toml, load
from sbafab.assemblies.records import Assembly
from sbafab.design.records import design_toml
from sbafab.lab.builds import promised
from sbafab.lab.recording import matching
from sbafab.lab.store import Lab
from sbafab.reports.traveller.page import record_text

SMALL = {"stack": {"balloons": 2}, "rules": {"yield_builds": 100}}


def test_python_records_what_the_command_does(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    design = sbafab.load("1dof-5mm", **SMALL)
    [first] = sbafab.record(
        design, lab=lab, serial="A1", leak="pass", stroke_mm=2.2, offset_mm=(0.03, 0.05)
    )
    [second] = sbafab.record("1dof-5mm", lab=lab, serial="A1", burst_kpa=350, cut_mm=0.1, **SMALL)
    assert (first.id, second.id) == (1, 2)
    assert first.design_sha256 == second.design_sha256
    assert first.kit == "paper"
    assert first.errors["offset_mm"] == (0.03, 0.05)
    table = tmp_path / "batch.csv"
    table.write_text("serial;leak\nB1;pass\nB2;fail\n")
    assert [one.serial for one in sbafab.record(design, lab=lab, table=table)] == ["B1", "B2"]
    told = sbafab.report(lab)
    assert (told.records, told.items) == (4, 3)
    assert Lab(lab).contents().records[0] == first


def test_an_assembly_is_recorded_as_a_whole(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    [made] = sbafab.record("standing", lab=lab, serial="S1", leak="pass", mass_g=12.5)
    whole = load("standing")
    assert isinstance(whole, Assembly)
    put = assemble(whole)
    assert made.design_sha256 == assembly_sha256(put)
    # The folder that it was built from is the same assembly.
    folder = tmp_path / "standing"
    folder.mkdir()
    (folder / "design.toml").write_text(assembly_toml(put))
    for own in put.designs:
        (folder / own.design.name).mkdir()
        (folder / own.design.name / "design.toml").write_text(design_toml(own.design))
    [again] = sbafab.record(folder, lab=lab, serial="S1", note="dropped")
    assert again.design_sha256 == made.design_sha256
    records, _, builds = Lab(lab).contents()
    build = builds[made.design_sha256]
    assert (build.name, build.family, build.predicted) == ("standing", "assembly", {})
    assert made.kit == "paper"
    # Three actuators of one design: the whole holds where all three do.
    sbafab.record("3dof-15mm", lab=lab, serial="P1", leak="pass")
    part = next(b for b in Lab(lab).contents().builds.values() if b.name == "3dof-15mm")
    assert build.promise == pytest.approx(part.promise**3, abs=1e-4)
    scanned = record_text("standing", made.design_sha256)
    assert matching(scanned, "", records, builds) == [made, again]


def test_a_proof_test_is_recorded_and_the_burst_is_scaled(tmp_path: Path) -> None:
    """367 kPa of pockets of 5 mm (paper, Sec. 4) is less for wider ones by as much."""
    lab = tmp_path / "lab.sqlite"
    [found] = sbafab.record("1dof-5mm", lab=lab, serial="A1", leak="pass", proof_kpa=150, **SMALL)
    assert found.numbers == {"proof_kpa": 150.0}
    small = sbafab.load("1dof-5mm", **SMALL)
    wide = small.with_({"chamber.diameter": 6.0})
    burst = [promised(design).predicted["burst_kpa"][0] for design in (small, wide)]
    assert burst == pytest.approx([367, 367 * 5 / 6])
    other = small.with_({"films.tpe": {"product": "TPU", "thickness": 0.038}})
    assert "burst_kpa" not in promised(other).predicted
