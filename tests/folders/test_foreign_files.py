"""Files of other designs in a folder, listed with the right hash: the design makes no such file."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.folders.check import check_folder
from sbafab.folders.manifest import file_hash
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor
from tests.quick import few

FEW = ("stack.balloons=2", "rules.yield_builds=100")
DESIGNS = (
    ("1dof-5mm", ()),
    ("3dof-15mm", ("laser.kerf_tpe=0.12",)),
    ("1dof-5mm", ("name=eared", 'registration.method="ears"')),
)
OPENED = (
    *(".lbrn", ".lbrn2", ".svg", ".dwg", ".dxf", ".DXF", ".pdf", ".ai", ".eps", ".ps", ".cdr"),
    *(".plt", ".hpgl", ".gcode", ".nc", ".rd", ".png", ""),
)
"""What laser programs and CAD open."""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    root = tmp_path_factory.mktemp("sound")
    designs = (load_design(template, [*FEW, *settings]) for template, settings in DESIGNS)
    return [generate(RunRequest(design, root, ("cut",))).folder for design in designs]


def failing(folder: Path) -> list[Finding]:
    return [finding for finding in check_folder(folder) if finding.verdict == "fail"]


def put(folder: Path, name: str, donor: Path, is_listed: bool = True) -> None:
    """A copy of ``donor`` in a folder under a name, listed with its hash or not at all."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(donor, path)
    if is_listed:
        Doctor(folder).set_manifest(lambda m: m["files"].update({name: file_hash(path)}))


@pytest.mark.parametrize(
    "name",
    [
        "layers/010_TPE_wall.dxf",
        "layers/old/spare",
        "sheets/TPE_2.dxf",
        "sheets/TPE_2.lbrn2",
        "preview/spare.dxf",
    ],
)
def test_a_file_of_another_design_is_named_with_its_hash_in_line(
    name: str, folders: list[Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(folders[0], tmp_path / "doctored"))
    put(folder, name, next((folders[1] / "layers").glob("*TPE*")))
    found, *_ = failing(folder)
    assert found.rule == "as-designed"
    assert found.message.startswith(f"{name} is listed, but is not a file of this design")


@pytest.mark.parametrize("ending", few(OPENED, 6))
def test_what_a_laser_program_opens_fails_among_the_cut_files(
    ending: str, folders: list[Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(folders[0], tmp_path / "doctored"))
    put(folder, f"sheets/order{ending}", folders[1] / "sheets" / "TPE_1_kerf0.12.svg", False)
    (found,) = failing(folder)
    assert f"sheets/order{ending} lies in the folder" in found.message


def test_what_is_neither_file_nor_folder_fails_among_the_cut_files(
    folders: list[Path], tmp_path: Path
) -> None:
    """A link to a folder has contents that no hash holds."""
    folder = Path(shutil.copytree(folders[0], tmp_path / "doctored"))
    (folder / "layers" / "more").symlink_to(folders[1] / "layers")
    (folder / "sheets" / "gone.dxf").symlink_to(tmp_path / "nothing")
    os.mkfifo(folder / "sheets" / "pipe")
    assert [finding.message.partition(" ")[0] for finding in failing(folder)] == [
        "layers/more",
        "sheets/gone.dxf",
        "sheets/pipe",
    ]


def test_notes_and_what_file_managers_leave_are_warnings(
    folders: list[Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(folders[0], tmp_path / "doctored"))
    for name in ("note.txt", "order.pdf", "sheets/.DS_Store", "layers/Thumbs.db"):
        (folder / name).write_text("bench 3")
    found = check_folder(folder)
    assert not [finding.message for finding in found if finding.verdict == "fail"]
    warned = [finding.message for finding in found if finding.rule == "manifest-claims"]
    assert sum("lies in the folder" in message for message in warned) == 4
    # The next run does not refuse them either.
    design = load_design("1dof-5mm", FEW)
    again = Path(shutil.copytree(folder, tmp_path / "out" / "1dof-5mm"))
    assert generate(RunRequest(design, again.parent, ("cut",))).folder == again
    assert (again / "sheets" / ".DS_Store").exists()


@pytest.mark.parametrize("name", ["sheets/TPE_2.dxf", "layers/012_TPE_wall.dxf", "fixture.dxf"])
def test_running_the_design_again_removes_a_foreign_file(
    name: str, folders: list[Path], tmp_path: Path
) -> None:
    """The message asks for that, so it must help."""
    folder = Path(shutil.copytree(folders[0], tmp_path / "1dof-5mm"))
    put(folder, name, next((folders[1] / "layers").glob("*TPE*")))
    run = generate(RunRequest(load_design("1dof-5mm", FEW), tmp_path, ("cut",)))
    assert run.dropped == (name,)
    assert not failing(folder)


def test_files_of_other_commands_belong_to_the_folder(tmp_path: Path) -> None:
    """Cut files first, meshes and a schedule in runs of their own; nothing of them is foreign."""
    design = load_design("1dof-5mm", (*FEW, "order.copies=2"))
    for part in ("cut", "mesh", "press"):
        folder = generate(RunRequest(design, tmp_path, (part,))).folder
    assert not failing(folder)
    (folder / "mujoco").mkdir()
    put(folder, "mujoco/model.xml", folder / "press.csv")
    put(folder, "mesh/volume.msh", folder / "press.csv")
    assert not failing(folder)
    put(folder, "mesh/volume.dxf", folder / "sheets" / "TPE_1.dxf")
    assert [finding.rule for finding in failing(folder)] == ["as-designed"]


def test_a_foreign_file_of_a_job_is_named(folders: list[Path], tmp_path: Path) -> None:
    """Listed in the index of the job, and in that of the design that it lies with."""
    designs = [load_design(name, FEW) for name in ("1dof-5mm", "3dof-15mm")]
    folder = generate(RunRequest(designs, tmp_path, name="batch")).folder
    assert not failing(folder)
    donor = folders[2] / "sheets" / "fixture.dxf"
    put(folder, "sheets/TPE_9.dxf", donor)
    put(folder / "1dof-5mm", "layers/012_TPE_wall.dxf", donor)
    own = folder / "1dof-5mm" / "manifest.json"
    files = {"1dof-5mm/layers/012_TPE_wall.dxf": donor, "1dof-5mm/manifest.json": own}
    Doctor(folder).set_manifest(
        lambda m: m["files"].update({name: file_hash(path) for name, path in files.items()})
    )
    assert [finding.message.partition(" ")[0] for finding in failing(folder)] == [
        "sheets/TPE_9.dxf",
        "1dof-5mm/layers/012_TPE_wall.dxf",
    ]
