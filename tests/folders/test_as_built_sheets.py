"""Film sheets read back: faults on them are told with file and place, other notes tell nothing."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import load_design
from sbafab.cutting.cut_settings import ENGRAVE
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import OutputError
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import Region
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor
from tests.quick import few

Claims = dict[str, Any]


def told(doctor: Doctor) -> list[Finding]:
    return [finding for finding in check_folder(doctor.folder) if finding.verdict == "fail"]


def redraw(doctor: Doctor, change: Callable[[list[Region]], list[Region]]) -> None:
    """The first sheet with its pieces changed."""
    sheet = doctor.manifest["sheets"][0]
    path = doctor.folder / sheet["file"]
    found = read_profile(path)
    pieces = change(list(found.region.pieces))
    region = Region(tuple(contour for piece in pieces for contour in piece.contours))
    engraved = [
        (edges[0].start, *(edge.end for edge in edges))
        for layer, edges in found.strokes
        if layer == ENGRAVE
    ]
    around = Surroundings(engraved, frame=(sheet["width"], sheet["length"]))
    text = dxf_text(cutting_sequence(region), found.properties, sheet=around)
    path.write_text(text, newline="\n")
    doctor.rehash()


def test_a_sheet_drawn_again_tells_nothing(doctor: Doctor) -> None:
    redraw(doctor, lambda pieces: pieces)
    assert told(doctor) == []


@pytest.mark.parametrize(("off", "is_told"), [(0.0008, False), (0.003, True)])
def test_a_piece_agrees_within_a_micrometre(off: float, is_told: bool, lobed: Doctor) -> None:
    """The bore of one piece moved."""

    def moved(pieces: list[Region]) -> list[Region]:
        drilled = next(piece for piece in pieces if piece.holes)
        first, *others = drilled.holes
        hole = Region((first,)).moved(off, 0.0).contours
        changed = Region((*hole, *others, *drilled.outers))
        return [changed if piece is drilled else piece for piece in pieces]

    redraw(lobed, moved)
    assert bool(told(lobed)) == is_told


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 1e300},
        {"length": -1.0},
        {"number": 10**30},
        {"contours": -1},
        {"parts_area": "much"},
        {"border": 10**400},
        {"parts": [{"design": "a", "pattern": "P01", "count": 10**12}]},
        {"pins": [{"x": 0.0, "y": 0.0, "diameter": 1.0}] * 101},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_absurd_claims_of_sheets_are_one_sentence(wrong: Claims, doctor: Doctor) -> None:
    doctor.set_manifest(lambda m: m["sheets"][0].update(wrong))
    with pytest.raises(OutputError, match=r"sheets\.0\.") as refused:
        check_folder(doctor.folder)
    assert "\n" not in str(refused.value)


@pytest.fixture(scope="module")
def clean_job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    few = ["rules.yield_builds=100"]
    designs = [
        load_design("1dof-5mm", ["stack.balloons=2", "order.copies=2", *few]),
        load_design("radial-15mm", ["stack.balloons=1", *few]),
    ]
    return generate(RunRequest(designs, tmp_path_factory.mktemp("job"), name="batch")).folder


def rules_failing(folder: Path) -> set[str]:
    return {finding.rule for finding in check_folder(folder) if finding.verdict == "fail"}


def test_a_job_is_proved_with_the_sheets_that_its_designs_share(clean_job: Path) -> None:
    found = check_folder(clean_job)
    assert "fail" not in {finding.verdict for finding in found}
    own = [finding for finding in found if finding.rule in ("file-integrity", "manifest-claims")]
    assert [finding.verdict for finding in own] == ["pass"] * 6
    assert own[-2].message.startswith("2 sheets")


def test_a_design_of_a_job_is_checked_with_the_job(clean_job: Path) -> None:
    with pytest.raises(OutputError, match="check the folder above it"):
        check_folder(clean_job / "1dof-5mm")


Change = Callable[[Claims], object]
JOB_FAULTS: list[tuple[str, Change]] = [
    ("copies", lambda m: m["designs"][0].update(copies=1)),
    ("hash of a design", lambda m: m["designs"][1].update(design_sha256="0" * 64)),
    ("hash of all designs", lambda m: m.update(designs_sha256="0" * 64)),
    ("parts", lambda m: m["sheets"][0]["parts"][0].update(design="radial-15mm")),
    ("waste", lambda m: m["films"][1].update(waste=1.0)),
]


@pytest.mark.parametrize(
    "change", few([f[1] for f in JOB_FAULTS], 2), ids=[f[0] for f in JOB_FAULTS]
)
def test_wrong_claims_of_a_job_are_told(change: Change, clean_job: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    doctor.set_manifest(change)
    assert rules_failing(doctor.folder) == {"manifest-claims"}


def test_a_design_left_out_of_a_job_is_told(clean_job: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    doctor.set_manifest(lambda m: m["designs"].pop())
    # The sheets hold more than what is left of the job makes.
    assert rules_failing(doctor.folder) == {"manifest-claims", "as-designed"}


def test_a_piece_missing_on_a_jobs_sheet_is_told(clean_job: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    redraw(doctor, lambda pieces: sorted(pieces, key=lambda piece: piece.area)[1:])
    (found,) = told(doctor)
    assert (found.rule, found.message.partition(" ")[0]) == ("as-designed", "sheets/TPE_1.dxf")
