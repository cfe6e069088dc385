"""Machine files read back from the disk: lead-ins, overcuts and tabs as asked, and nothing else."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing

from sbafab.actuators import load_design
from sbafab.cutting.dxf_read import read_profile
from sbafab.folders.check import check_folder, read_folder
from sbafab.folders.run import RunRequest, generate
from tests.folders.doctoring import Doctor

ASKED = [
    *("stack.balloons=2", "rules.yield_builds=100", "sheets.tpe.lead_in=0.4"),
    *("sheets.tpe.overcut=0.3", "sheets.tpe.tab_width=0.5", "sheets.ptfe.tab_width=0.4"),
]
PROJECT = "sheets/TPE_1.lbrn2"
_SHAPE = r'<Shape Type="Path" CutIndex="{index}".*?</Shape>\n'


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cut files of a 1-DoF actuator of two balloons, with tabs, and lead-ins in the TPE."""
    out = tmp_path_factory.mktemp("held")
    return generate(RunRequest(load_design("1dof-5mm", ASKED), out, ("cut",))).folder


@pytest.fixture
def folder(held: Path, tmp_path: Path) -> Doctor:
    return Doctor(Path(shutil.copytree(held, tmp_path / "1dof-5mm")))


def test_a_good_folder_says_what_was_asked(folder: Doctor) -> None:
    assert not read_folder(folder.folder).problems
    text = (folder.folder / PROJECT).read_text()
    assert "LEAD_IN: 0.4 mm" in text
    assert "OVERCUT: 0.3 mm" in text
    assert "TABS: 3 an outline, 0.5 mm wide, 0.5 mm uncut" in text
    # The sheet's drawing and the layer files are the design, as they are without all this.
    plain = [word for word in ASKED if not word.startswith("sheets")]
    other = generate(
        RunRequest(load_design("1dof-5mm", plain), folder.folder.parent / "plain", ("cut",))
    ).folder
    for path in [*other.glob("layers/*.dxf"), *other.glob("sheets/*.dxf")]:
        ours = folder.folder / path.relative_to(other)
        assert read_profile(ours).region.contours == read_profile(path).region.contours


def once(pattern: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        changed, count = re.subn(pattern, new, text, count=1, flags=re.DOTALL)
        assert count
        return changed

    return change


def all_but_first(pattern: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        kept = re.search(pattern, text, re.DOTALL)
        assert kept
        return text[: kept.end()] + re.sub(pattern, "", text[kept.end() :], flags=re.DOTALL)

    return change


@pytest.mark.parametrize(
    "change",
    [
        once(_SHAPE.format(index=1), ""),
        once(_SHAPE.format(index=2), ""),
        all_but_first(_SHAPE.format(index=2)),
        # The beam comes in where the first line of a hole begins.
        once(r'(CutIndex="1".*?<XForm>1 0 0 1 )(\S+)', r"\g<1>9\2"),
        once(r'(CutIndex="1".*?<VertList>V)0 0', r"\g<1>0.05 0.05"),
        once(r'CutIndex="1"', 'CutIndex="2"'),
        once(r"<Shape ", "<Shap "),
    ],
)
def test_a_machine_file_that_cuts_otherwise_is_told(
    change: Callable[[str], str], folder: Doctor
) -> None:
    path = folder.folder / PROJECT
    path.write_text(change(path.read_text()))
    folder.rehash()
    told = [f for f in check_folder(folder.folder) if f.verdict == "fail"]
    assert [f.rule for f in told] == ["as-designed"]
    assert told[0].message.startswith(PROJECT)


# The files of other laser programs.


@pytest.fixture(scope="module", params=["rdworks", "epilog"])
def program_folder(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    """Cut files with those of a laser program, named ``request.param``."""
    out = tmp_path_factory.mktemp(request.param)
    asked = [*ASKED, f"sheets.program={request.param}"]
    return generate(RunRequest(load_design("1dof-5mm", asked), out, ("cut",))).folder


def test_a_program_s_file_is_listed_and_measured(program_folder: Path, tmp_path: Path) -> None:
    doctor = Doctor(Path(shutil.copytree(program_folder, tmp_path / "1dof-5mm")))
    assert not [f for f in check_folder(doctor.folder) if f.verdict == "fail"]
    sheet = doctor.manifest["sheets"][0]
    assert sheet["machine_file"] in doctor.manifest["files"]
    path = doctor.folder / sheet["machine_file"]
    text = path.read_text()
    # A line of the holes becomes one of the outlines.
    pattern, new = {
        ".dxf": (r"(CUT_INNER\n 62\n)5(\n 66)", r"\g<1>1\2"),
        ".svg": (r'(id="CUT_INNER".*?)#0000ff', r"\1#ff0000"),
    }[path.suffix]
    changed, count = re.subn(pattern, new, text, count=1, flags=re.DOTALL)
    assert count
    path.write_text(changed)
    doctor.rehash()
    told = [f.message for f in check_folder(doctor.folder) if f.rule == "as-designed"]
    assert told[0].startswith(sheet["machine_file"])
    path.write_text(text)
    doctor.rehash()
    doctor.set_manifest(lambda manifest: manifest["sheets"][0].pop("machine_file"))
    told = [f.message for f in check_folder(doctor.folder) if f.rule == "manifest-claims"]
    assert "sheets.1.machine_file is missing" in told[0]


def of_later_dxf(document: Drawing) -> Drawing:
    """The same lines in today's entities, coloured by their layers, as other programs save them."""
    later = ezdxf.new("R2018")
    later.header["$INSUNITS"] = 4
    for layer in document.layers:
        if layer.dxf.name not in later.layers:
            later.layers.add(layer.dxf.name, color=layer.dxf.color)
    for entity in document.modelspace():
        like = {"layer": entity.dxf.layer}
        if entity.dxftype() == "CIRCLE":
            later.modelspace().add_circle(entity.dxf.center, entity.dxf.radius, like)
            continue
        rows = [(*v.dxf.location.vec2, v.dxf.get("bulge", 0)) for v in entity.vertices]
        later.modelspace().add_lwpolyline(rows, "xyb", close=entity.is_closed, dxfattribs=like)
    return later


def in_inches(document: Drawing) -> Drawing:
    document.header["$INSUNITS"] = 1
    return document


@pytest.mark.parametrize(
    ("save", "says"),
    [
        (lambda document: document, None),
        (of_later_dxf, None),
        (lambda document: in_inches(of_later_dxf(document)), "not in millimetres: $INSUNITS is 1"),
    ],
)
def test_a_file_saved_anew_by_another_program_is_judged_by_what_it_cuts(
    save: Callable[[Drawing], Drawing], says: str | None, tmp_path: Path
) -> None:
    """Tabs leave lines open, leads begin beside them."""
    design = load_design("1dof-5mm", [*ASKED, "sheets.program=rdworks"])
    doctor = Doctor(generate(RunRequest(design, tmp_path, ("cut",))).folder)
    for path in doctor.folder.glob("sheets/*_rdworks.dxf"):
        before = path.read_bytes()
        save(ezdxf.readfile(path)).saveas(path)
        assert path.read_bytes() != before
    doctor.rehash()
    found = [f.message for f in check_folder(doctor.folder) if f.verdict == "fail"]
    assert all(says is not None and says in message for message in found)
    assert bool(found) == (says is not None)


def test_comments_are_no_difference(held: Path, tmp_path: Path) -> None:
    """In pictures of sheets, in projects and in design.toml; a shape in one is missing, though."""
    doctor = Doctor(Path(shutil.copytree(held, tmp_path / "1dof-5mm")))
    pictures = [*doctor.folder.glob("sheets/*.svg"), *doctor.folder.glob("sheets/*.lbrn2")]
    assert len(pictures) >= 4
    for path in pictures:
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r"(<svg.*?>|<LightBurn.*?>)", r"\1<!-- Ann: 3 mm < 4 -->", text))
    design = doctor.folder / "design.toml"
    design.write_text(f"# cut by Ann\n{design.read_text(encoding='utf-8')}", encoding="utf-8")
    doctor.rehash()
    assert not [f for f in check_folder(doctor.folder) if f.verdict == "fail"]
    text = pictures[0].read_text(encoding="utf-8")
    pictures[0].write_text(re.sub(r"(<(path|circle) [^>]*/>)", r"<!-- \1 -->", text, count=1))
    doctor.rehash()
    (found,) = [f for f in check_folder(doctor.folder) if f.verdict == "fail"]
    assert (found.rule, pictures[0].name in found.message) == ("as-designed", True)
