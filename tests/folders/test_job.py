"""Several designs cut from the same film sheets."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.cutting.dxf_read import read_profile
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.folders.manifest import file_hashes
from sbafab.folders.run import Run, RunRequest, generate
from tests.site.formats import hold


def designs(*assignments: str) -> list[Design]:
    return [
        load_design("1dof-5mm", ["stack.balloons=2", *assignments]),
        load_design("3dof-15mm", ["stack.balloons=1", *assignments]),
    ]


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Run:
    made = designs("order.copies=2", "order.spares=0", "order.spare_share=0")
    return generate(RunRequest(made, tmp_path_factory.mktemp("job"), name="batch"))


def test_every_design_has_its_folder_and_the_sheets_are_shared(job: Run) -> None:
    assert not job.failed
    assert {path.name for path in job.folder.iterdir()} == {
        "1dof-5mm",
        "3dof-15mm",
        "manifest.json",
        "sheets",
    }
    for name in ("1dof-5mm", "3dof-15mm"):
        made = {path.name for path in (job.folder / name).iterdir()}
        assert {"layers", "press.json", "traveller.html", "mesh", "manifest.json"} <= made
        page = (job.folder / name / "traveller.html").read_text(encoding="utf-8")
        assert "../sheets/TPE_1.dxf" in page


def test_the_sheets_hold_every_layer_of_every_design_as_often_as_ordered(job: Run) -> None:
    for material in ("TPE", "PTFE"):
        layers = [
            read_profile(path).region.area
            for name in ("1dof-5mm", "3dof-15mm")
            for path in (job.folder / name / "layers").glob(f"*_{material}_*.dxf")
        ]
        sheets = [
            read_profile(path).region.area
            for path in (job.folder / "sheets").glob(f"{material}_*.dxf")
        ]
        assert sum(sheets) == pytest.approx(2 * sum(layers), abs=1e-3)


def test_the_manifest_lists_designs_sheets_and_files(job: Run) -> None:
    told = json.loads((job.folder / "manifest.json").read_text(encoding="utf-8"))
    hold("job", told)
    assert [(one["name"], one["copies"]) for one in told["designs"]] == [
        ("1dof-5mm", 2),
        ("3dof-15mm", 2),
    ]
    found = file_hashes(job.folder)
    found.pop("manifest.json")
    assert told["files"] == found
    parts = [part for sheet in told["sheets"] for part in sheet["parts"]]
    assert {part["design"] for part in parts} == {"1dof-5mm", "3dof-15mm"}


def test_the_same_job_gives_the_same_bytes(job: Run, tmp_path: Path) -> None:
    again = generate(
        RunRequest(
            designs("order.copies=2", "order.spares=0", "order.spare_share=0"),
            tmp_path,
            name="batch",
        )
    )
    assert file_hashes(again.folder) == file_hashes(job.folder)


def test_a_failing_design_stops_the_whole_job(tmp_path: Path) -> None:
    bad = load_design("1dof-10mm", ["bond.width=0.4"])
    stopped = generate(RunRequest([*designs(), bad], tmp_path, name="batch"))
    assert stopped.failed
    assert [one.failed for one in stopped.builds] == [False, False, True]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("own", "name", "said"),
    [
        ("sheets", "batch", "a design is named sheets, like the job's folder of film sheets"),
        ("SHEETS", "batch", "a design is named SHEETS, like the job's folder of film sheets"),
        ("manifest.json", "batch", "a design is named manifest.json, like the job's index"),
        (
            "1DOF-5mm",
            "batch",
            "two designs are named 1dof-5mm and 1DOF-5mm, which is one folder",
        ),
        (
            "other",
            "OTHER",
            "the job and one of its folders are both named OTHER; choose another --name",
        ),
        ("other", "Sheets", "the job and one of its folders are both named Sheets"),
        ("1dof-5mm", "batch", "two designs are named 1dof-5mm"),
        ("other", "../up", "--name"),
    ],
)
def test_a_name_that_the_job_needs_is_refused(
    own: str, name: str, said: str, tmp_path: Path
) -> None:
    both = [load_design("1dof-5mm"), load_design("1dof-10mm", [f"name={own}"])]
    with pytest.raises(DesignError, match=said):
        generate(RunRequest(both, tmp_path, name=name))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("key", ["sheets.tpe.width=300", "laser.kerf_tpe=0.1"])
def test_designs_of_other_films_or_machines_are_not_cut_together(key: str, tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=key.partition(".")[0]):
        generate(
            RunRequest(
                [load_design("1dof-5mm"), load_design("1dof-10mm", [key])], tmp_path, name="batch"
            )
        )
