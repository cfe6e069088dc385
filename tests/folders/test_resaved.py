"""Folders whose files other programs saved anew: the check says what it said before.

Coordinates jittered and rounded by less than 1 um, other DXF versions, by ezdxf.
"""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any

import ezdxf
import pytest
from ezdxf.addons import r12export
from ezdxf.document import Drawing

from sbafab.actuators import load_design
from sbafab.cutting.cut_settings import Curves, DxfProfile
from sbafab.design.files import rule_names
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor
from tests.quick import few

Move = Callable[[float], float]
FOLDERS: list[tuple[str, tuple[str, ...], DxfProfile]] = [
    ("1dof-5mm", ("stack.balloons=2",), "bulges"),
    ("1dof-5mm", ("stack.balloons=1", "laser.kerf_tpe=0.2"), "chords"),
    ("3dof-15mm", ("stack.balloons=1",), "arcs"),
]


def _param(template: str, settings: tuple[str, ...], profile: DxfProfile) -> Any:
    marks = [pytest.mark.long] if profile == "chords" else []
    return pytest.param((template, settings, profile), marks=marks, id=f"{template}-{profile}")


@pytest.fixture(scope="module", params=[_param(*one) for one in FOLDERS])
def good(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    template, settings, profile = request.param
    design = load_design(template, [*settings, "rules.yield_builds=100"])
    out = tmp_path_factory.mktemp("good")
    return generate(RunRequest(design, out, ("cut",), Curves(profile))).folder


@pytest.fixture
def doctor(good: Path, tmp_path: Path) -> Doctor:
    return Doctor(Path(shutil.copytree(good, tmp_path / good.name)))


def moved(drawing: Drawing, move: Move) -> None:
    """Every coordinate and radius of a drawing moved."""
    for entity in drawing.modelspace():
        if entity.dxftype() == "LWPOLYLINE":
            rows = [(move(x), move(y), b) for x, y, b in entity.get_points("xyb")]
            entity.set_points(rows, format="xyb")
            continue
        for name in ("start", "end", "center"):
            if entity.dxf.is_supported(name) and entity.dxf.hasattr(name):
                x, y, _ = entity.dxf.get(name)
                entity.dxf.set(name, (move(x), move(y), 0.0))
        if entity.dxf.hasattr("radius"):
            entity.dxf.radius = move(entity.dxf.radius)


def resave(folder: Path, change: Callable[[Drawing], object], old: str = "") -> None:
    for path in sorted(folder.rglob("*.dxf")):
        drawing = ezdxf.readfile(path)
        change(drawing)
        if old == "R12":
            r12export.saveas(drawing, path)
            continue
        drawing.dxfversion = old or drawing.dxfversion
        drawing.saveas(path)


checked = cache(check_folder)


def verdicts(found: Iterable[Finding]) -> Counter[tuple[str, str]]:
    return Counter((f.rule, f.verdict) for f in found if f.rule in rule_names())


def others(found: Iterable[Finding]) -> list[Finding]:
    return [f for f in found if f.rule not in rule_names() and f.verdict != "pass"]


def jittered(most: float) -> Callable[[Drawing], object]:
    draw = random.Random(12)
    return partial(moved, move=lambda value: value + draw.uniform(-most, most))


@pytest.mark.parametrize(
    "change",
    few(
        [
            jittered(3e-4),
            partial(moved, move=lambda value: round(value, 4)),
        ],
        1,
    ),
    ids=["0.3 um", "4 decimals"],
)
def test_coordinates_off_by_less_than_a_micrometre_change_no_verdict(
    change: Callable[[Drawing], object], good: Path, doctor: Doctor
) -> None:
    resave(doctor.folder, change)
    doctor.rehash()
    found = check_folder(doctor.folder)
    assert verdicts(found) == verdicts(checked(good))
    assert others(found) == []


@pytest.mark.parametrize("version", few(["R12", "R2000"], 1))
def test_other_versions_change_no_verdict_and_what_they_drop_is_told_once(
    version: str, good: Path, doctor: Doctor
) -> None:
    resave(doctor.folder, lambda drawing: None, version)
    doctor.rehash()
    found = check_folder(doctor.folder)
    assert verdicts(found) == verdicts(checked(good))
    told = others(found)
    assert {f.verdict for f in told} <= {"warn"}
    # One warning of the layers, one of the sheets.
    assert len(told) == 2
    assert all("no custom properties" in f.message for f in told)
    assert ("and no units" in told[0].message) == (version == "R12")


@pytest.mark.parametrize("good", [FOLDERS[0]], indirect=True, ids=["two balloons"])
def test_a_fault_of_three_micrometres_is_told_among_jitter(doctor: Doctor) -> None:
    """The hole of one wall alone; the jitter is a tenth of it."""
    resave(doctor.folder, jittered(3e-4))
    path = doctor.path(5)
    drawing = ezdxf.readfile(path)
    drawn = [entity for entity in drawing.modelspace() if entity.dxf.layer == "CUT_INNER"]
    drawn[0].translate(0.003, 0.0, 0.0)
    drawing.saveas(path)
    doctor.rehash()
    assert "registration-nominal" in {
        f.rule for f in check_folder(doctor.folder) if f.verdict == "fail"
    }


def test_properties_half_gone_are_a_fault(doctor: Doctor) -> None:
    """Programs drop all or none: who takes one away changes what a file says."""
    path = doctor.path(1)
    drawing = ezdxf.readfile(path)
    drawing.header.custom_vars.remove("DESIGN_SHA256")
    drawing.saveas(path)
    doctor.rehash()
    assert any(
        "DESIGN_SHA256" in f.message and f.verdict == "fail"
        for f in others(check_folder(doctor.folder))
    )
