"""Design files and command lines that ask for the absurd: refused at once, in one sentence."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from sbafab.actuators import load_design
from sbafab.errors import GeometryError, SbafabError
from sbafab.folders import build as builds
from sbafab.geometry.edges import Line
from tests.hardship.starting import WITHOUT_PRIVILEGES, assert_refused
from tests.hunt.oracle import laid_over

pytestmark = pytest.mark.long

if TYPE_CHECKING:
    from conftest import Output, Runs

SMALL = "import resource; resource.setrlimit(resource.RLIMIT_CPU, (8, 8))\n"
"""A run that works on what it should refuse is killed."""
TOML = 'family = "1dof"\n[stack]\nballoons = 2\n'


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("stack.balloons=1000000000", "must be at most 1000"),
        ("stack.balloons=1e9", "must be a whole number"),
        ("stack.balloons=0x" + "f" * 5000, "must be at most 1000"),
        ("family=0x" + "f" * 5000, "must be one of"),
        ("chamber.diameter=1e400", "must be a finite length"),
        ("chamber.diameter=0x" + "f" * 5000, "must be a finite length"),
        ("chamber.diameter=" + "[" * 5000, "must be a length"),
        ("chamber.diameter=[" + "5," * 20000 + "]", "lists 20000 balloons"),
        (f"chamber.diameter={list(range(5, 46))}", "41 different diameters"),
        ("bond.width=" + "{a=" * 200 + "1" + "}" * 200, "must be a length"),
        ("a." * 5000 + "a=1", "has 5001 parts; a design's keys have three"),
        ("chamber.outline=/dev/zero", "does not exist as a file"),
        ("press.temperature_c=nan", "must be a finite number"),
        ('"a\\nb"=1', "is not a key"),
        ("k" * 50000 + "=1", "is not a key"),
    ],
)
def test_absurd_values(assignment: str, says: str, runs: Runs, output: Output) -> None:
    arguments = [*output.arguments("0.75"), "--set", "stack.balloons=41", "--set", assignment]
    ended = runs.run(arguments, output.folder, SMALL)
    assert_refused(ended, says)
    assert len(ended.err) < 600
    assert output.held() == "0.8"


def of_bytes(content: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content) and None


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(50_000_000)


def unreadable(path: Path) -> None:
    path.write_text(TOML)
    path.chmod(0)


FILES: dict[str, tuple[Callable[[Path], object], str]] = {
    "50 MB": (sparse, "50,000,000 bytes"),
    "pipe": (os.mkfifo, "neither a template nor a design file"),
    "device": (lambda path: path.symlink_to("/dev/zero"), "neither a template nor a design file"),
    "link to itself": (lambda path: path.symlink_to(path), "neither a template nor a design file"),
    "folder": (Path.mkdir, "is a folder"),
    "unreadable": (unreadable, "ermission denied"),
    "UTF-16": (of_bytes(TOML.encode("utf-16")), "save it as UTF-8"),
    "a key of 400,000 parts": (of_bytes(b"a." * 400_000 + b"a = 1"), "a key of 8 or more parts"),
    "quoted parts": (of_bytes(b"x = 1\n" + b'"a" . ' * 9 + b"a = 1"), "parts in line 2"),
    "one long word": (of_bytes(b"a" * 900_000), "is not valid TOML"),
    "deep lists": (of_bytes(b"a = " + b"[" * 900_000), "is not valid TOML"),
    "deep tables": (of_bytes(b"a = " + b"{a=" * 300_000), "is not valid TOML"),
    "100,000 keys": (of_bytes(b"".join(b"k%d=1\n" % i for i in range(90_000))), "family"),
    "zeros": (of_bytes(b"\0" * 900_000), "is not valid TOML"),
}


@pytest.mark.parametrize("name", FILES)
def test_hard_design_files(name: str, runs: Runs, output: Output) -> None:
    make, says = FILES[name]
    path = output.folder.parent / "1dof-5mm.toml"
    make(path)
    before = SMALL + (WITHOUT_PRIVILEGES if name == "unreadable" else "")
    ended = runs.run(["generate", str(path), "-o", str(output.folder)], output.folder, before)
    assert_refused(ended, says)
    assert output.held() == "0.8"


@pytest.mark.parametrize(
    "content",
    [TOML.replace("\n", "\r\n").encode(), TOML.encode("utf-8-sig"), (TOML + "# a.b.c.d").encode()],
    ids=["CRLF", "BOM", "dots"],
)
def test_other_line_ends_and_marks_are_read(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "design.toml"
    path.write_bytes(content)
    assert load_design(path).stack.balloons == 2


def test_what_the_geometry_cannot_resolve_names_the_design(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(GeometryError, match=r"x 1\.000000, y 2\.000000 .*change a dim"):
        laid_over([Line((1.0, 2.0), (3.0, 4.0))])

    def unresolved(*_: object) -> object:
        return laid_over([Line((1.0, 2.0), (3.0, 4.0))])

    monkeypatch.setattr(builds, "build", unresolved)
    with pytest.raises(SbafabError, match=r"design 1dof-5mm cannot be resolved: .*change a dim"):
        builds.make_build(load_design("1dof-5mm"))


@pytest.mark.parametrize("before", ["", "import sys; sys.stdout.reconfigure(encoding='ascii')\n"])
def test_a_result_that_is_not_read_is_written_all_the_same(
    before: str, runs: Runs, output: Output
) -> None:
    closed = "import os; r, w = os.pipe(); os.dup2(w, 1); os.close(r); os.close(w)\n"
    ended = runs.run(output.arguments("0.75"), output.folder, before + closed)
    assert (ended.code, ended.err) == (141, "")
    assert output.held() == "0.75"


def test_no_standard_output_at_all(runs: Runs, output: Output) -> None:
    closed = "import os, sys; os.close(1); sys.stdout = None\n"
    ended = runs.run(output.arguments("0.75"), output.folder, closed)
    assert (ended.code, ended.err) == (0, "")
    assert output.held() == "0.75"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_standard_output_is_one_sentence(runs: Runs, output: Output) -> None:
    ended = runs.run(output.arguments("0.75"), output.folder, out="/dev/full")
    assert_refused(ended, "standard output", "no space left on device")
    assert output.held() == "0.75"


def test_a_folder_whose_name_is_no_text(runs: Runs, output: Output) -> None:
    strange = output.folder / "caf\udce9\u2603"
    ended = runs.run(["press", "1dof-5mm", "-o", str(strange)], output.folder)
    assert (ended.code, ended.err) == (0, "")
    assert (strange / "1dof-5mm" / "press.json").is_file()
