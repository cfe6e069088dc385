"""Film sheets read back: faults on them are told with file and place, other notes tell nothing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import load_design
from sbafab.as_built.check import read_folder
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc
from sbafab.output.checked import FindingEntry
from sbafab.runs.check_folder import check_folder
from sbafab.runs.run import RunRequest, generate
from tests.as_built.doctoring import Doctor
from tests.quick import few

Claims = dict[str, Any]


def told(doctor: Doctor) -> list[str]:
    """What is wrong with the folder, the sheets' claims of areas and lengths left out."""
    return [
        problem.message
        for problem in read_folder(doctor.folder).problems
        if not any(word in problem.message for word in ("parts_area", "cut_length", "contours"))
    ]


def redraw(doctor: Doctor, change: Callable[[list[Region]], list[Region]]) -> None:
    """The first sheet with its pieces changed, without its engraving."""
    sheet = doctor.manifest["sheets"][0]
    path = doctor.folder / sheet["file"]
    found = read_profile(path)
    pieces = change(list(found.region.pieces))
    region = Region(tuple(contour for piece in pieces for contour in piece.contours))
    frame = Surroundings(frame=(sheet["width"], sheet["length"]))
    text = dxf_text(cutting_order(region), found.properties, sheet=frame)
    path.write_text(text, newline="\n")
    doctor.rehash()


def test_the_sheets_of_a_good_folder_tell_nothing(doctor: Doctor) -> None:
    assert told(doctor) == []
    redraw(doctor, lambda pieces: pieces)
    assert told(doctor) == []


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_piece_may_lie_turned_by_quarters(turns: int, doctor: Doctor) -> None:
    def turned(pieces: list[Region]) -> list[Region]:
        piece = pieces[0].turned(90.0 * turns)
        return [piece.moved(142 - piece.bounds[2], 142 - piece.bounds[3]), *pieces[1:]]

    redraw(doctor, turned)
    assert told(doctor) == []


@pytest.mark.parametrize(("off", "is_told"), [(0.0015, False), (0.003, True)])
def test_a_piece_agrees_where_both_are_within_a_micrometre(
    off: float, is_told: bool, lobed: Doctor
) -> None:
    """The bore of one piece moved."""

    def moved(pieces: list[Region]) -> list[Region]:
        drilled = next(piece for piece in pieces if piece.holes)
        first, *others = drilled.holes
        hole = Region((first,)).moved(off, 0.0).contours
        changed = Region((*hole, *others, *drilled.outers))
        return [changed if piece is drilled else piece for piece in pieces]

    redraw(lobed, moved)
    assert any("is no piece of any layer's file" in message for message in told(lobed)) == is_told


def test_a_missing_piece_is_told_with_its_pattern_and_counts(doctor: Doctor) -> None:
    """Three balloons have the base, the cap, and two walls in each balloon but the last."""
    layers = doctor.manifest["layers"]
    counts = [layer["pattern"] for layer in layers if layer["material"] == "TPE"]
    redraw(doctor, lambda pieces: sorted(pieces, key=lambda piece: piece.area)[1:])
    lost = next(message for message in told(doctor) if " take " in message)
    pattern = next(name for name in dict.fromkeys(counts) if f"pieces of 1dof-5mm {name}" in lost)
    count = counts.count(pattern) + 1  # and a spare
    assert f"cut {count - 1} pieces" in lost
    assert lost.endswith(f"copies and spares take {count}")


def test_a_mirrored_piece_is_told_as_turned_over(tmp_path: Path) -> None:
    settings = ["stack.balloons=1", "registration.method=ears", "rules.yield_builds=100"]
    doctor = Doctor(
        generate(RunRequest(load_design("1dof-5mm", settings), tmp_path, ("cut",))).folder
    )

    def mirrored(pieces: list[Region]) -> list[Region]:
        over = pieces[0].mirrored()
        return [over.moved(142 - over.bounds[2], 142 - over.bounds[3]), *pieces[1:]]

    redraw(doctor, mirrored)
    assert any("turned over" in message for message in told(doctor))


def test_a_stranger_is_told_with_its_place(doctor: Doctor) -> None:
    redraw(doctor, lambda pieces: [*pieces, disc((130.0, 130.0), 2.0)])
    problem = next(p for p in read_folder(doctor.folder).problems if "no piece of" in p.message)
    assert (problem.x, problem.y) == pytest.approx((130.0, 130.0))
    assert "sheets/TPE_1.dxf" in problem.message


def test_a_layer_that_is_not_what_the_sheet_cuts_is_told(doctor: Doctor) -> None:
    doctor.redraw(5, lambda region: region.scaled(1.001))
    doctor.rehash()
    assert any("layers, copies and spares take" in message for message in told(doctor))


CLAIMS: list[tuple[str, Callable[[Claims], object], str]] = [
    ("no sheets", lambda m: m.pop("sheets"), "lists no film sheets"),
    ("no sheets of one film", lambda m: m["sheets"].pop(), "the PTFE sheets cut 0 pieces"),
    ("copies", lambda m: m.update(copies=3), "copies is 3 in the manifest and 1"),
    ("number", lambda m: m["sheets"][0].update(number=2), "not numbered from 1"),
    ("name", lambda m: m["sheets"][0].update(file="sheets/a.dxf"), "not sheets/TPE_1.dxf"),
    ("picture", lambda m: m["sheets"][0].update(picture="a.svg"), "not sheets/TPE_1.svg"),
    ("project", lambda m: m["sheets"][0].update(project="a"), "not sheets/TPE_1.lbrn2"),
    ("no hash", lambda m: m["files"].pop("sheets/TPE_1.svg"), "has no hash"),
    ("border", lambda m: m["sheets"][1].update(border=5.0), "border is 5.0 in the manifest"),
    ("pins", lambda m: m["sheets"][1].update(pins=[{"x": 1, "y": 2, "diameter": 3}]), "pins is"),
    ("width", lambda m: m["sheets"][0].update(width=150.0), "width is 150.0 in the manifest"),
    ("length", lambda m: m["sheets"][0].update(length=150.0), "length is 150.0 in the manifest"),
    ("density", lambda m: m["sheets"][0].update(density=0.9), "density is 0.9"),
    ("waste", lambda m: m["films"][0].update(waste=1.0), "films: waste of TPE is 1"),
    (
        "design",
        lambda m: m["sheets"][0]["parts"][0].update(design="other"),
        "no layer is of pattern other P",
    ),
    ("pattern", lambda m: m["sheets"][0]["parts"][0].update(pattern="P99"), "pattern 1dof-5mm P99"),
    ("path", lambda m: m["sheets"][0].update(file="../TPE_1.dxf"), "leads out of the folder"),
]


@pytest.mark.parametrize(("change", "said"), [c[1:] for c in CLAIMS], ids=[c[0] for c in CLAIMS])
def test_wrong_claims_of_sheets_are_told(
    change: Callable[[Claims], object], said: str, doctor: Doctor
) -> None:
    doctor.set_manifest(change)
    assert any(said in message for message in told(doctor)), told(doctor)


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


def test_the_saved_nest_is_no_evidence(doctor: Doctor) -> None:
    (doctor.folder / "sheets" / "nest.json").write_text("{")
    doctor.rehash()
    assert told(doctor) == []


def test_a_sheet_of_an_earlier_run_is_told(doctor: Doctor) -> None:
    """The cut shop must not find a sheet that is none of this run's."""
    sheets = doctor.folder / "sheets"
    shutil.copy(sheets / "TPE_1.dxf", sheets / "TPE_2.dxf")
    assert any("TPE_2.dxf lies in the folder" in message for message in told(doctor))


def test_the_command_tells_sheets_as_findings(doctor: Doctor) -> None:
    redraw(doctor, lambda pieces: [*pieces, disc((130.0, 130.0), 2.0)])
    found = [FindingEntry.of(finding) for finding in check_folder(doctor.folder)]
    stranger = next(f for f in found if "no piece of" in str(f["message"]))
    assert (stranger["rule"], stranger["verdict"]) == ("manifest-claims", "fail")
    assert json.loads(json.dumps(stranger["where"]))["x"] == 130.0


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


def test_a_design_of_a_job_says_that_its_sheets_lie_elsewhere(clean_job: Path) -> None:
    found = [f for f in check_folder(clean_job / "1dof-5mm") if f.rule == "manifest-claims"]
    assert [finding.verdict for finding in found] == ["warn", "pass"]
    assert "above this one" in found[0].message


JOB_FAULTS: list[tuple[str, Callable[[Claims], object]]] = [
    ("copies", lambda m: m["designs"][0].update(copies=1)),
    ("hash of a design", lambda m: m["designs"][1].update(design_sha256="0" * 64)),
    ("hash of all designs", lambda m: m.update(designs_sha256="0" * 64)),
    ("parts", lambda m: m["sheets"][0]["parts"][0].update(design="radial-15mm")),
    ("waste", lambda m: m["films"][1].update(waste=1.0)),
]


@pytest.mark.parametrize(
    "change", few([f[1] for f in JOB_FAULTS], 2), ids=[f[0] for f in JOB_FAULTS]
)
def test_wrong_claims_of_a_job_are_told(
    change: Callable[[Claims], object], clean_job: Path, tmp_path: Path
) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    doctor.set_manifest(change)
    assert rules_failing(doctor.folder) == {"manifest-claims"}


def test_a_design_left_out_of_a_job_is_told(clean_job: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    doctor.set_manifest(lambda m: m["designs"].pop())
    # The sheets hold more than what is left of the job makes.
    assert rules_failing(doctor.folder) == {"manifest-claims", "as-designed"}


def test_a_piece_of_another_design_is_told(clean_job: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(clean_job, tmp_path / "batch")))
    redraw(doctor, lambda pieces: sorted(pieces, key=lambda piece: piece.area)[1:])
    found = [f.message for f in check_folder(doctor.folder) if f.verdict == "fail"]
    assert any("layers, copies and spares take" in message for message in found)
