"""Film sheets and saved places that were tampered with: searched again, or told, never hung."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytestmark = pytest.mark.long

if TYPE_CHECKING:
    from conftest import Output, Runs

SMALL = "import resource; resource.setrlimit(resource.RLIMIT_CPU, (8, 8))\n"
"""A run that works on what it should refuse is killed."""
BOUNDED = SMALL + "resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))\n"
Change = Callable[[Path], object]


def of_text(text: str) -> Change:
    return lambda path: path.write_text(text)


def replaced(make: Change) -> Change:
    """Something else where the file was."""

    def put(path: Path) -> None:
        path.unlink()
        make(path)

    return put


def placed(change: Callable[[list[list[Any]]], object]) -> Change:
    """The TPE places changed, under the key that they were saved with."""

    def put(path: Path) -> None:
        saved = json.loads(path.read_text())
        change(saved["nests"]["TPE"])
        path.write_text(json.dumps(saved))

    return put


def put_at(**fields: object) -> Change:
    """The first place with another part, sheet, turn, x or y."""
    names = ("part", "sheet", "turn", "x", "y")

    def change(rows: list[list[Any]]) -> None:
        for name, value in fields.items():
            rows[0][names.index(name)] = value

    return placed(change)


def heaped(rows: list[list[Any]]) -> None:
    """All parts on the first."""
    for row in rows:
        row[1:] = rows[0][1:]


# What JSON may hold in their place, tests/cutting/test_nesting.py has.
PLACES: dict[str, Change] = {
    "empty": of_text(""),
    "truncated": lambda path: path.write_text(path.read_text()[:200]),
    "deep": of_text("[" * 1_000_000),
    "bytes": lambda path: path.write_bytes(b"\xff\xfe\0"),
    "pipe": replaced(os.mkfifo),
    "device": replaced(lambda path: path.symlink_to("/dev/zero")),
    "folder": replaced(Path.mkdir),
    "60 MB": replaced(lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 60_000_000)),
    "overlapping": placed(heaped),
    "over the border": put_at(x=0.0),
    "a billion sheets": put_at(sheet=1_000_000_000),
    "a gap in the sheets": put_at(sheet=7),
    "far away": put_at(x=1e308, y=-1e308),
    "beyond all numbers": put_at(x=10**400),
}


@pytest.mark.parametrize("name", PLACES)
def test_bad_saved_places_are_searched_anew(name: str, runs: Runs, output: Output) -> None:
    PLACES[name](output.run_folder / "sheets" / "nest.json")
    ended = runs.run(output.arguments("0.8", "cut"), output.folder, BOUNDED)
    assert (ended.code, ended.err) == (0, "")
    assert output.held() == "0.8"


def drawing(entity: str) -> Change:
    """The sheet's file filled up with an entity, to 10 MB."""

    def put(path: Path) -> None:
        head, marker, tail = path.read_text().partition("  2\nENTITIES\n")
        path.write_text(head + marker + entity * (10_000_000 // len(entity)) + tail)

    return put


CIRCLE = "  0\nCIRCLE\n  8\nCUT_OUTER\n 10\n50.0\n 20\n50.0\n 40\n1.0\n"
FILES: dict[str, tuple[Change, str]] = {
    "large": (lambda path: os.truncate(path, 30_000_000), "larger than"),
    "zeros": (replaced(lambda path: path.write_bytes(b"\0" * 1_000_000)), "not an ASCII DXF"),
    "circles": (drawing(CIRCLE), "entities and points; the limit is"),
    "lines": (drawing("  0\nLINE\n"), "entities and points; the limit is"),
    "pipe": (replaced(os.mkfifo), "not a regular file"),
    "device": (replaced(lambda path: path.symlink_to("/dev/zero")), "not a regular file"),
    "link to itself": (replaced(lambda path: path.symlink_to(path)), "not a regular file"),
    "folder": (replaced(Path.mkdir), "not a regular file"),
}


@pytest.mark.parametrize("name", FILES)
def test_bad_sheets_are_told_in_time(name: str, runs: Runs, output: Output) -> None:
    change, says = FILES[name]
    change(output.run_folder / "sheets" / "TPE_1.dxf")
    ended = runs.run(["check", str(output.run_folder), "--json"], output.folder, BOUNDED)
    assert (ended.code, ended.err) == (1, "")
    told = [f for f in json.loads(ended.out)["findings"] if f["rule"] == "file-integrity"]
    assert [finding["verdict"] for finding in told] == ["fail"]
    assert "sheets/TPE_1.dxf" in told[0]["message"]
    assert says in told[0]["message"]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (os.mkfifo, "not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
        (lambda path: path.symlink_to(path), "cannot be read"),
    ],
    ids=["pipe", "device", "link to itself"],
)
def test_a_manifest_that_is_no_file_is_one_sentence(
    make: Change, says: str, runs: Runs, output: Output
) -> None:
    replaced(make)(output.run_folder / "manifest.json")
    ended = runs.run(["check", str(output.run_folder)], output.folder, BOUNDED)
    assert ended.code == 2
    assert ended.err.startswith("sbafab: ")
    assert ended.err.count("\n") == 1
    assert says in ended.err
