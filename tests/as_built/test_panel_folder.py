"""A folder of registered sheets: written whole, read back, and doctored."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.as_built.check import read_folder
from sbafab.as_built.expected import drawn_settings
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.lightburn import Project, read_project
from sbafab.cutting.properties import Curves
from sbafab.cutting.second_cut import PATH, laser_path, properties_of, severed, stack_kerf
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.region import strip
from sbafab.rules import bridges
from sbafab.rules.measures import Measures
from sbafab.runs.check_folder import check_folder
from sbafab.runs.run import RunRequest, generate
from tests.as_built.doctoring import Doctor

KERF = 0.12


def design(*changes: str) -> Design:
    few = ("stack.balloons=2", "order.copies=2", "rules.yield_builds=100")
    return load_design(
        "1dof-5mm",
        ['registration.method="sheet"', "registration.experimental=true", *few, *changes],
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kerf = (f"laser.kerf_tpe={KERF}", f"laser.kerf_ptfe={KERF}")
    return generate(
        RunRequest(design(*kerf), tmp_path_factory.mktemp("panel"), ("cut", "press", "preview"))
    ).folder


def failing(folder: Path) -> dict[str, str]:
    return {f.rule: f.message for f in check_folder(folder) if f.verdict == "fail"}


def test_a_written_folder_passes_and_is_read_back_as_the_design(whole: Path) -> None:
    assert failing(whole) == {}
    built = read_folder(whole)
    assert built.is_expected
    assert built.laminate is not None
    assert built.laminate.panel is not None
    panel = json.loads((whole / "manifest.json").read_text())["panel"]
    assert (len(panel["places"]), panel["batches"], panel["second_cut"]) == (2, 1, PATH)
    assert not list(whole.glob("sheets/TPE*"))


def test_first_and_second_cut_are_laser_projects_on_one_place(whole: Path) -> None:
    told = json.loads((whole / "manifest.json").read_text())
    found = sorted(path.relative_to(whole).as_posix() for path in whole.glob("sheets/*.lbrn2"))
    patterns = {layer["pattern"]: layer for layer in told["layers"]}
    assert sorted(told["panel"]["projects"]) == found
    assert len(found) == len(patterns) + 1
    width, length = told["panel"]["size"]
    for pattern, layer in patterns.items():
        [path] = whole.glob(f"sheets/{pattern}_*.lbrn2")
        project = read_project(path)
        profile = read_profile(whole / layer["file"]).region
        assert len(project.shapes) == len(profile.contours)
        low, high = corners(project)
        # The beam runs half a kerf outside the sheet, whose lower left corner is the origin.
        assert low == pytest.approx((-KERF / 2, -KERF / 2), abs=1e-6)
        assert high == pytest.approx((width + KERF / 2, length + KERF / 2), abs=1e-6)
        side = "left" if layer["material"] == "PTFE" else "right"
        assert f"cut corner must be at the upper {side}" in path.read_text()
    second = read_project(whole / "sheets/second_cut.lbrn2")
    assert {index: told["doOutput"] for index, told in second.settings.items()} == {2: "1", 8: "0"}
    # The sheet's edge on REFERENCE has the same corner as the sheets of the first cut.
    assert corners(second)[0] == pytest.approx((0, 0), abs=1e-6)
    assert corners(second)[1] == pytest.approx((width, length), abs=1e-6)
    panel = told["panel"]
    middles = [
        tuple((a + b) / 2 for a, b in zip(shape.curves[0].start, shape.curves[-1].end, strict=True))
        for shape in second.shapes
        if shape.index == 8
    ]
    (x0, y0), *rest = middles[-2 * len(panel["fiducials"]) - 2 :: 2]
    for (x, y), fiducial in zip(rest, panel["fiducials"], strict=True):
        assert (x - x0, y - y0) == pytest.approx((fiducial["x"], fiducial["y"]), abs=2e-6)


def corners(project: Project) -> tuple[tuple[float, float], tuple[float, float]]:
    ends = [curve.at(t) for shape in project.shapes for curve in shape.curves for t in (0, 0.5, 1)]
    xs, ys = zip(*ends, strict=True)
    return (min(xs), min(ys)), (max(xs), max(ys))


def test_a_doctored_project_is_found(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(whole, folder)
    path = folder / "sheets/second_cut.lbrn2"
    path.write_text(path.read_text().replace('maxPower Value="0"', 'maxPower Value="80"', 1))
    Doctor(folder).rehash()
    assert "second_cut.lbrn2" in failing(folder)["as-designed"]


def test_the_second_cut_takes_the_widest_kerf_of_the_films_it_severs() -> None:
    films = ("TPE", "TPU50")
    assert stack_kerf({"TPE": 0.1, "TPU50": (0.14, 0.08)}, films) == (0.14, 0.1)
    assert stack_kerf({"TPE": 0.1, "PTFE": 0.3}, ("TPE",)) == 0.1
    # One that nobody measured leaves the cut nominal, and the file says so.
    assert stack_kerf({"TPE": 0.1, "TPU50": None}, films) is None
    tpu = (
        'films.tpu50={kind="structural", product="TPU", thickness=0.05, density=1200, '
        "melting_point=115, kerf=0.2}",
        "layup.wall=tpu50",
        f"laser.kerf_tpe={KERF}",
    )
    two = design(*tpu)
    laminate = build(two)
    assert severed(laminate) == ("TPE", "TPU50")
    said = properties_of(laminate, drawn_settings(two, (), None))
    assert (said["MATERIAL"], said["KERF_WIDTH"]) == ("TPE, TPU50", "0.2")
    path = laser_path(laminate, drawn_settings(two, (), None))
    assert [piece.area for piece in path.pieces] == pytest.approx([1.4 * 0.4] * 6)


def test_kerf_leaves_parts_of_nominal_size(whole: Path) -> None:
    """Slots are cut inside their edges by half a kerf, sheets likewise outside theirs."""
    slots = read_profile(whole / PATH).region
    # 1.6 by 0.6, less a kerf on every side.
    assert [piece.area for piece in slots.pieces] == pytest.approx([1.48 * 0.48] * 6)
    (file,) = whole.glob("layers/001_TPE_base_kerf*.dxf")
    found = read_profile(file).region.bounds
    laminate = read_folder(whole).laminate
    assert laminate is not None
    assert laminate.panel is not None
    outline = laminate.panel.outline.bounds
    assert found[2] - found[0] == pytest.approx(outline[2] - outline[0] + KERF)


def test_a_copy_that_is_cut_otherwise_stands_for_its_layer(whole: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(whole, tmp_path / "faulty")))
    clean = read_folder(whole).laminate
    assert clean is not None
    assert clean.panel is not None
    x, y = clean.panel.places[1]
    # The second copy's cap, which ends 3.25 from its axis, is cut short: the beam takes half of
    # the kerf besides, on three sides of the notch.
    doctor.redraw(7, lambda sheet: sheet - strip((x, y + 2.9), (x, y + 3.6), 1.0))
    built = read_folder(doctor.folder)
    assert not built.is_expected
    assert built.laminate is not None
    cap = built.laminate.layer(7).profile
    assert clean.layer(7).profile.area - cap.area == pytest.approx(
        1.12 * (3.25 - 2.84) - 0.04, abs=0.03
    )
    (found,) = bridges.check(Measures(built.laminate, built.limits))
    assert found.verdict == "fail"


def test_a_folder_without_second_cut_fails(whole: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(whole, tmp_path / "faulty")))
    (doctor.folder / PATH).unlink()
    assert "file-integrity" in {problem.rule for problem in read_folder(doctor.folder).problems}


@pytest.mark.parametrize(
    ("refused", "said"),
    [
        (
            lambda out: generate(RunRequest(design(), out, curves=Curves("chords"))),
            "are not drawn in chords",
        ),
        (
            lambda out: generate(RunRequest([design(), design("name=other")], out, name="job")),
            "made in registered sheets",
        ),
    ],
)
def test_what_sheets_do_not_go_with_is_refused(
    refused: Callable[[Path], object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(DesignError, match=said):
        refused(tmp_path)


def test_the_page_says_what_to_do_with_sheets(whole: Path) -> None:
    page = (whole / "traveller.html").read_text()
    for words in ("Registered sheets", "No bench has tried", "Weed", "face down", "fiducials"):
        assert words in page
    plan = json.loads((whole / "press.json").read_text())
    assert [(step["bond"], len(step["pins"])) for step in plan["steps"]] == [
        ("flash", 4),
        ("full", 4),
    ]
    assert "no bench has tried" in plan["warnings"][0]
