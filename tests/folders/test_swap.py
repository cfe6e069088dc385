"""A folder is replaced whole or not at all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

from sbafab.errors import OutputError
from sbafab.folders import swap
from sbafab.folders.swap import SCHEMA, replaced_folder


def write_run(folder: Path, text: str) -> None:
    (folder / "manifest.json").write_text(json.dumps({"schema": SCHEMA, "text": text}))


def text_in(folder: Path) -> object:
    return json.loads((folder / "manifest.json").read_text())["text"]


def leftovers(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name.endswith(".part")]


@pytest.mark.parametrize("exchanges", [True, False])
def test_a_new_folder_takes_the_place_of_the_old(
    exchanges: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not exchanges:
        monkeypatch.setattr(swap, "_exchange", lambda a, b: False)
    target = tmp_path / "a" / "run"
    for text in ("one", "two"):
        with replaced_folder(target) as folder:
            write_run(folder, text)
        assert text_in(target) == text
    assert leftovers(target.parent) == []


def test_the_old_folder_stays_when_the_run_fails(tmp_path: Path) -> None:
    target = tmp_path / "run"
    with replaced_folder(target) as folder:
        write_run(folder, "one")
    with pytest.raises(RuntimeError), replaced_folder(target) as folder:
        write_run(folder, "half")
        raise RuntimeError
    assert text_in(target) == "one"
    assert leftovers(tmp_path) == []


def test_files_of_others_are_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "run"
    target.mkdir()
    (target / "thesis.txt").write_text("mine")
    with pytest.raises(OutputError, match="did not write"), replaced_folder(target):
        pass
    assert (target / "thesis.txt").read_text() == "mine"


def test_files_that_others_put_into_a_run_stay(tmp_path: Path) -> None:
    target = tmp_path / "run"
    for ours in ("one.txt", "two.txt"):
        with replaced_folder(target) as folder:
            (folder / ours).write_text("ours")
            listed = {"schema": SCHEMA, "text": ours, "files": {ours: "hash"}}
            (folder / "manifest.json").write_text(json.dumps(listed))
        (target / "photos").mkdir(exist_ok=True)
        (target / "photos" / "leak test.jpg").write_text("mine")
        (target / "two.txt").write_text("mine as well, but of a name that is ours")
        (target / "link").unlink(missing_ok=True)
        (target / "link").symlink_to(tmp_path)
    found = {path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file()}
    assert found == {"manifest.json", "two.txt", "photos/leak test.jpg"}
    assert (target / "link").is_symlink()
    with replaced_folder(target) as folder:
        (folder / "two.txt").write_text("ours")
        write_run(folder, "three")
    assert (target / "two.txt").read_text() == "ours"


@pytest.mark.parametrize("place", ["layers/mine.dxf", "sheets/mine.dxf", "arm/sheets/mine.dxf"])
def test_a_file_of_others_among_the_cut_files_is_refused(tmp_path: Path, place: str) -> None:
    target = tmp_path / "run"
    with replaced_folder(target) as folder:
        listed = {"schema": SCHEMA, "text": "one", "files": {"one.txt": "hash"}}
        (folder / "manifest.json").write_text(json.dumps(listed))
    (target / place).parent.mkdir(parents=True)
    (target / place).write_text("mine")
    refused = pytest.raises(OutputError, match=r"mine\.dxf .* among the cut files")
    with refused, replaced_folder(target):
        pass
    assert text_in(target) == "one"


def test_links_files_and_running_twice_are_refused(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(OutputError, match="is a link"), replaced_folder(tmp_path / "link"):
        pass
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file"), replaced_folder(tmp_path / "file"):
        pass
    with (
        pytest.raises(OutputError, match="file is a file, not a folder"),
        replaced_folder(tmp_path / "file" / "run"),
    ):
        pass
    with (
        FileLock(tmp_path / ".run.lock"),
        pytest.raises(OutputError, match="another run"),
        replaced_folder(tmp_path / "run"),
    ):
        pass


def test_an_error_of_the_program_is_none_of_the_disk(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a defect"), replaced_folder(tmp_path / "run"):
        raise ValueError("a defect")
    with replaced_folder(tmp_path / "run"):
        pass


KILLED = """
import os, sys; from pathlib import Path
from sbafab.folders.swap import replaced_folder
with replaced_folder(Path(sys.argv[1])) as folder:
    (folder / "manifest.json").write_text("half")
    os.kill(os.getpid(), 9)
"""


def test_a_killed_run_leaves_the_old_folder_whole(tmp_path: Path) -> None:
    target = tmp_path / "run"
    with replaced_folder(target) as folder:
        write_run(folder, "one")
    killed = subprocess.run([sys.executable, "-c", KILLED, str(target)], check=False)
    assert killed.returncode == -9
    assert text_in(target) == "one"
    assert len(leftovers(tmp_path)) == 1
    with replaced_folder(target) as folder:
        write_run(folder, "two")
    assert text_in(target) == "two"
    assert leftovers(tmp_path) == []
