"""Cut files and meshes that ezdxf, trimesh and ElementTree saved anew, hashes left as they were.

The same geometry is a warning that names the file; a micrometre more, or another order, fails.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import pytest
import trimesh
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity

from sbafab.actuators import load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.finding import Finding

LAYER, SHEET, PLATE = "layers/001_TPE_base.dxf", "sheets/TPE_1.dxf", "sheets/fixture.dxf"
RDWORKS = "sheets/TPE_1_rdworks.dxf"
MOVED = 0.002
"""mm: twice what another program may round."""


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    settings = ("stack.balloons=2", "rules.yield_builds=100", "sheets.program=rdworks")
    design = load_design("1dof-5mm", settings)
    parts = ("cut", "press", "mesh", "preview")
    return generate(RunRequest(design, tmp_path_factory.mktemp("good"), parts)).folder


@pytest.fixture
def folder(good: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(good, tmp_path / good.name))


def drawn(path: Path, change: Callable[[Drawing], object] = lambda _: None) -> None:
    document = ezdxf.readfile(path)
    change(document)
    document.saveas(path)


def first_cut(document: Drawing) -> DXFEntity:
    return next(e for e in document.modelspace() if e.dxf.layer.startswith("CUT_"))


def first_moved(document: Drawing) -> None:
    first_cut(document).translate(MOVED, 0.0, 0.0)


def first_last(document: Drawing) -> None:
    """The first cut of a layer becomes the last one."""
    model, entity = document.modelspace(), first_cut(document)
    last = [e for e in model if e.dxf.layer == entity.dxf.layer][-1]
    order = [e for e in model if e is not entity]
    order.insert(order.index(last) + 1, entity)
    model.entity_space.entities[:] = order


def meshed(path: Path, by: float = 0.0) -> None:
    scene = trimesh.load_scene(path)
    for mesh in scene.geometry.values():
        mesh.apply_translation((by, 0.0, 0.0))
    is_stl = path.suffix == ".stl"
    data = (
        scene.to_mesh().export(file_type="stl_ascii") if is_stl else scene.export(file_type="glb")
    )
    path.write_bytes(data if isinstance(data, bytes) else data.encode())


def marked_up(path: Path, change: Callable[[str], str] = str) -> None:
    """With a comment, and other prefixes, spaces and declarations."""
    tree = ElementTree.parse(path)
    tree.getroot().append(ElementTree.Comment("Ann: 3 mm < 4"))
    tree.write(path)
    path.write_text(change(path.read_text()))


def nudged(text: str) -> str:
    """The first number of the first circle or shape, 2 um more."""
    begin = text.index(' cx="') + len(' cx="')
    end = text.index('"', begin)
    return f"{text[:begin]}{float(text[begin:end]) + MOVED:.6f}{text[end:]}"


def told(folder: Path, name: str) -> list[Finding]:
    return [f for f in check_folder(folder) if name in f.message]


@pytest.mark.parametrize(
    ("name", "save", "sameness"),
    [
        *((name, drawn, "same cuts to 1 um") for name in (LAYER, SHEET, PLATE, RDWORKS)),
        ("sheets/TPE_1.svg", marked_up, "same elements and values"),
        ("sheets/TPE_1.lbrn2", marked_up, "same elements and values"),
        ("mesh/solid.stl", meshed, "same surfaces to 1 um"),
        ("mesh/solid.glb", meshed, "same surfaces to 1 um"),
    ],
)
def test_the_same_geometry_is_a_warning(
    name: str, save: Callable[[Path], None], sameness: str, folder: Path
) -> None:
    before = (folder / name).read_bytes()
    save(folder / name)
    assert (folder / name).read_bytes() != before
    findings = check_folder(folder)
    assert [f.message for f in findings if f.verdict == "fail"] == []
    [warning] = [f for f in findings if f.rule == "manifest-claims" and f.verdict == "warn"]
    assert warning.message == f"saved anew by another program, {sameness}: {name}"
    assert warning.where.layers == ((1,) if name == LAYER else ())


@pytest.mark.parametrize(
    ("name", "save"),
    [
        *((name, lambda path: drawn(path, first_moved)) for name in (LAYER, SHEET, PLATE, RDWORKS)),
        *((name, lambda path: drawn(path, first_last)) for name in (SHEET, RDWORKS)),
        ("sheets/TPE_1.svg", lambda path: marked_up(path, nudged)),
        (
            "sheets/TPE_1.lbrn2",
            lambda path: marked_up(path, lambda t: t.replace("0 0 1 ", "0 0 1 9", 1)),
        ),
        ("mesh/solid.stl", lambda path: meshed(path, MOVED)),
        ("mesh/solid.glb", lambda path: meshed(path, MOVED)),
        *(
            (name, lambda path: path.write_text(path.read_text() + "\n"))
            for name in (
                "design.toml",
                "press.csv",
                "press.json",
                "traveller.html",
                "sheets/nest.json",
                "preview/stack.svg",
            )
        ),
    ],
)
def test_two_micrometres_another_order_or_another_kind_of_file_fail(
    name: str, save: Callable[[Path], object], folder: Path
) -> None:
    save(folder / name)
    failures = [f for f in told(folder, name) if f.verdict == "fail"]
    assert any(f.message.startswith(f"{name} was changed") for f in failures)
    assert not any("saved anew" in f.message for f in check_folder(folder))


def test_in_a_job_the_file_is_named_for_the_job_and_its_design(tmp_path: Path) -> None:
    designs = [
        load_design(name, ["stack.balloons=1", "rules.yield_builds=100"])
        for name in ("1dof-5mm", "3dof-15mm")
    ]
    job = generate(RunRequest(designs, tmp_path, name="batch")).folder
    drawn(job / "1dof-5mm" / LAYER)
    assert not [f for f in check_folder(job) if f.verdict == "fail"]
    assert [(f.design, f.message.rpartition(" ")[2]) for f in told(job, "saved anew")] == [
        ("1dof-5mm", LAYER),
        ("", f"1dof-5mm/{LAYER}"),
    ]
    drawn(job / "1dof-5mm" / LAYER, first_moved)
    assert [f.design for f in told(job, "was changed")] == ["1dof-5mm", ""]
    shutil.copyfile(job / "1dof-5mm" / LAYER, job / "1dof-5mm" / "layers" / "spare.dxf")
    assert told(job, "spare.dxf")
