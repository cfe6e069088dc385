"""Places that cannot be written: one sentence, exit code 2, the old output whole, nothing left."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.hardship.starting import WITHOUT_PRIVILEGES, assert_refused
from tests.quick import few

if TYPE_CHECKING:
    from conftest import Output, Runs

# From the moment the file is opened that the test names, no file may grow past 500 bytes.
FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
def hook(event, values):
    if event == "open" and ".part/" in str(values[0]) and str(values[0]).endswith("{suffix}"):
        resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
sys.addaudithook(hook)
"""


@pytest.mark.parametrize(
    "suffix",
    few(
        [
            *("001_TPE_base.dxf", "press.json", "press.csv", "solid.stl", "solid.3mf", "solid.glb"),
            *("cavity_chamber1.stl", "layers.svg", "stack.svg", "solid.png", "checks.json"),
            *("design.toml", "manifest.json"),
        ],
        5,
    ),
)
def test_a_full_disk_whatever_is_being_written(suffix: str, runs: Runs, output: Output) -> None:
    ended = runs.run(output.arguments("0.75"), output.folder, FULL.format(suffix=suffix))
    assert_refused(ended, "cannot be written", "file too large", "unchanged")
    assert output.held() == "0.8"
    assert output.leftovers() == set()


@pytest.mark.parametrize("kilobytes", [40, 600])
def test_a_small_full_file_system(kilobytes: int, runs: Runs, output: Output) -> None:
    if shutil.which("mount") is None:
        pytest.skip("mount is not installed")
    small = output.folder.parent / "small"
    small.mkdir()
    options = f"size={kilobytes}k"
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(small)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode != 0:
        pytest.skip("file systems cannot be mounted here")
    try:
        ended = runs.run(["generate", "3dof-15mm", "-o", str(small)], output.folder)
        assert_refused(ended, "no space left on device")
        assert set(os.listdir(small)) <= {".3dof-15mm.lock"}
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_a_read_only_parent(runs: Runs, output: Output) -> None:
    output.folder.chmod(0o555)
    ended = runs.run(output.arguments("0.75"), output.folder, WITHOUT_PRIVILEGES)
    assert_refused(ended, "cannot be written", "ermission denied")
    assert output.held() == "0.8"


def test_a_read_only_output(runs: Runs, output: Output) -> None:
    output.run_folder.chmod(0o555)
    ended = runs.run(output.arguments("0.75"), output.folder, WITHOUT_PRIVILEGES)
    assert_refused(ended, "is read-only; choose another folder")
    assert output.held() == "0.8"
    assert output.leftovers() == set()


def fifo(place: Path) -> None:
    os.mkfifo(place)


def dangling_link(place: Path) -> None:
    place.symlink_to("nowhere")


def link_to_a_folder(place: Path) -> None:
    (place.parent / "real").mkdir()
    place.symlink_to("real")


def link_to_itself(place: Path) -> None:
    place.symlink_to(place)


def file(place: Path) -> None:
    place.write_text("mine")


def folder_of_others(place: Path) -> None:
    place.mkdir()
    (place / "thesis.txt").write_text("mine")


def folder_with_a_pipe_for_manifest(place: Path) -> None:
    place.mkdir()
    os.mkfifo(place / "manifest.json")


def folder_with_a_deep_manifest(place: Path) -> None:
    place.mkdir()
    (place / "manifest.json").write_text("[" * 100_000)


PLACES = [
    (fifo, "is a file"),
    (dangling_link, "is a link"),
    (link_to_a_folder, "is a link"),
    (link_to_itself, "is a link"),
    (file, "is a file"),
    (folder_of_others, "did not write"),
    (folder_with_a_pipe_for_manifest, "did not write"),
    (folder_with_a_deep_manifest, "did not write"),
]


@pytest.mark.parametrize(("make", "says"), PLACES, ids=[make.__name__ for make, _ in PLACES])
def test_something_else_in_the_folders_place(
    make: object, says: str, runs: Runs, tmp_path: Path
) -> None:
    place = tmp_path / "1dof-5mm"
    make(place)  # type: ignore[operator]
    before = os.lstat(place)
    ended = runs.run(["generate", "1dof-5mm", "-o", str(tmp_path)], tmp_path)
    assert_refused(ended, says)
    after = os.lstat(place)
    assert (after.st_ino, after.st_mode, after.st_mtime) == (
        before.st_ino,
        before.st_mode,
        before.st_mtime,
    )
    assert {"1dof-5mm", "real"} >= set(os.listdir(tmp_path)) - {".1dof-5mm.lock"}


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("file/out", "file is a file, not a folder"),
        ("file", "file is a file, not a folder"),
        ("x" * 300, "file name too long"),
        ("x/" * 3000, "file name too long"),
        ("a\0b", "NUL"),
        ("/proc/nowhere", "cannot be written"),
        ("link/out", "cannot be written"),
    ],
)
def test_a_path_that_leads_nowhere(out: str, says: str, runs: Runs, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "link").symlink_to("link")
    ended = runs.run(["generate", "1dof-5mm", "-o", out], tmp_path)
    assert_refused(ended, says)
    assert len(ended.err) < 500
    assert set(os.listdir(tmp_path)) == {"file", "link"}
    assert (tmp_path / "file").read_text() == "mine"


def test_of_two_runs_at_once_one_is_told_to_wait(runs: Runs, output: Output) -> None:
    go = output.folder.parent / "go"
    begun = output.folder.parent / "begun"
    holds = (
        "import sys, time; from pathlib import Path\n"
        "def hook(event, values):\n"
        "    if event == 'open' and '.part/press.json' in str(values[0]):\n"
        f"        Path({str(begun)!r}).touch()\n"
        f"        while not Path({str(go)!r}).exists(): time.sleep(0.01)\n"
        "sys.addaudithook(hook)\n"
    )
    first = runs.start(output.arguments("0.75"), output.folder, holds)
    while not begun.exists():
        os.sched_yield()
    second = runs.run(output.arguments("0.8"), output.folder)
    assert_refused(second, "another run is writing", "or choose another folder")
    assert output.held() == "0.8"
    go.touch()
    assert runs.wait(first).code == 0
    assert output.held() == "0.75"
    assert output.leftovers() == set()


def test_runs_that_race_leave_one_whole_run(runs: Runs, output: Output) -> None:
    started = [
        runs.start(output.arguments(width), output.folder) for width in ("0.75", "0.8", "0.75")
    ]
    ended = [runs.wait(pid) for pid in started]
    assert {run.code for run in ended} <= {0, 2}
    assert 0 in {run.code for run in ended}
    for run in ended:
        if run.code == 2:
            assert_refused(run, "another run is writing")
    assert output.held() is not None
    assert output.leftovers() == set()
