"""Tools that are mounted beside their machine's head: only the files of their paths are shifted."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import ezdxf
import pytest
import tomli_w
from ezdxf.document import Drawing

from sbafab.actuators import build, load_design
from sbafab.api import check_folder, generate
from sbafab.errors import DesignError
from sbafab.folders.check import read_folder
from sbafab.importing.laminates import import_folder
from sbafab.importing.records import write_imported
from tests.designs import tables

X, Y = 12.0, -3.5
"""Where the hot tip is from the head of its machine, mm."""
SEAM_FILE = "layers/seam_001_rim.dxf"
CORNER = [-20, -18, math.tan(math.pi / 8)]
"""A quarter of a circle of 2 mm to the next corner of the path."""
MOUNTED = {"seam_tools": {"hot_tip": {"offset": [X, Y]}}}


def welded(**more: Any) -> dict[str, Any]:
    """A pouch that a hot tip welds, with a small arc at one corner of its path."""
    data = tables("welded")
    data["seams"][0]["path"][3:4] = [CORNER, [-18, -20]]
    return {**data, "rules": {"yield_builds": 100}, **more}


def made(data: dict[str, Any], folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    design = folder / "welded.toml"
    design.write_text(tomli_w.dumps(data), encoding="utf-8")
    return generate(design, out=folder / "out").folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same design, its tool in the place of the head, and beside it."""
    top = tmp_path_factory.mktemp("offset")
    return made(welded(), top / "plain"), made(welded(**MOUNTED), top / "beside")


def path_of(folder: Path) -> list[tuple[float, ...]]:
    """The corners of the path as ezdxf reads them: x, y, bulge."""
    document: Drawing = ezdxf.readfile(folder / SEAM_FILE)  # type: ignore[attr-defined]
    (run,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
    return [tuple(map(float, corner)) for corner in run.get_points("xyb")]


def test_the_head_is_led_so_that_the_tool_is_on_the_path(folders: tuple[Path, Path]) -> None:
    corners = [(x, y, *(rest or [0.0])) for x, y, *rest in welded()["seams"][0]["path"]]
    plain, beside = map(path_of, folders)
    for (x, y, bulge), head, centred in zip(corners, beside, plain, strict=True):
        # The tool is at the head and its offset.
        assert (head[0] + X, head[1] + Y) == pytest.approx((x, y), abs=1e-9)
        assert centred[:2] == pytest.approx((x, y), abs=1e-9)
        assert head[2] == pytest.approx(bulge, abs=1e-9)


def test_the_file_says_its_offset_and_keeps_its_datum(folders: tuple[Path, Path]) -> None:
    for folder, stated in zip(folders, (None, "12, -3.5"), strict=True):
        document: Drawing = ezdxf.readfile(folder / SEAM_FILE)  # type: ignore[attr-defined]
        said = dict(document.header.custom_vars.properties)
        assert said.get("TOOL_OFFSET") == stated
        cross = document.modelspace().query('LINE[layer=="REFERENCE"]')
        middles = {
            ((a + b) / 2).xy.isclose((0, 0)) for a, b in ((e.dxf.start, e.dxf.end) for e in cross)
        }
        assert middles == {True}


def test_pages_say_that_files_are_shifted_and_prints_are_not(folders: tuple[Path, Path]) -> None:
    plain, beside = folders
    sentence = (
        "The files of the hot-tip are shifted by -12.00, 3.50 mm: the tool is 12.00, -3.50 mm from"
    )
    assert sentence in (beside / "traveller.html").read_text(encoding="utf-8").replace("&#39;", "'")
    assert "are shifted by" not in (plain / "traveller.html").read_text(encoding="utf-8")
    prints = [(top / "seams.pdf").read_bytes() for top in folders]
    assert b"As made: the files of the hot-tip are shifted by -12.00, 3.50 mm." in prints[1]
    assert b"shifted" not in prints[0]
    for page in prints:
        # The path is drawn in the laminate's coordinates, as the film is.
        origins = [
            re.search(rb"^q 1 0 0 1 (\S+ \S+) cm %b m" % start, page, re.MULTILINE)
            for start in (b"-2 30", b"-23 -23")
        ]
        assert None not in origins
        assert len({found.group(1) for found in origins if found}) == 1


def turned_round(document: Drawing) -> None:
    """The path shifted by plus the offset, the wrong way."""
    (run,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
    run.translate(2 * X, 2 * Y, 0)


def as_centred(document: Drawing) -> None:
    (run,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
    run.translate(X, Y, 0)


@pytest.mark.parametrize(
    ("fault", "off"),
    # The wrong way round it is off by twice the offset, not shifted by the offset.
    [(turned_round, 2 * math.hypot(X, Y)), (as_centred, math.hypot(X, Y))],
)
def test_a_path_shifted_the_wrong_way_is_found(
    fault: Any, off: float, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    folder = copied(folders[1], tmp_path)
    document = ezdxf.readfile(folder / SEAM_FILE)  # type: ignore[attr-defined]
    fault(document)
    document.saveas(folder / SEAM_FILE)
    failed = {f.rule: f for f in check_folder(folder) if f.verdict == "fail"}
    assert "seam rim is not what design.toml makes" in failed["as-designed"].message
    assert f"its path is {off:.3f} mm off" in failed["as-designed"].message
    # Rules measure the seam where the tool would make it.
    built = read_folder(folder)
    assert built.laminate is not None
    start = built.laminate.seams[0].path[0][0].start
    x, y, *_ = welded()["seams"][0]["path"][0]
    assert math.dist(start, (x, y)) == pytest.approx(off)


def copied(folder: Path, to: Path) -> Path:
    for path in folder.rglob("*"):
        if path.is_file():
            target = to / "welded" / path.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
    return to / "welded"


def test_an_imported_folder_keeps_offset_and_path(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    _, beside = folders
    written = write_imported(import_folder(beside), tmp_path / "again.toml", "welded")
    assert written.design.seam_offsets == {"hot-tip": (X, Y)}
    assert written.laminate.seams == build(load_design(beside / "design.toml")).seams
    again = generate(written.file, out=tmp_path / "out").folder
    hashes = [
        json.loads((top / "manifest.json").read_text())["design_sha256"] for top in (beside, again)
    ]
    text = (again / SEAM_FILE).read_text(encoding="utf-8").replace(hashes[1], hashes[0])
    assert text == (beside / SEAM_FILE).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("tools", "sentence"),
    [
        ({"hot_tip": {"offset": [12]}}, "seam_tools.hot_tip.offset"),
        ({"hot_tip": {"offset": [12, 900]}}, "must be at most 500 mm"),
        ({"hot_tip": {"offset": ["far", 0]}}, "seam_tools.hot_tip.offset.0 = 'far'"),
        ({"hot_tip": {}}, "seam_tools.hot_tip.offset is missing"),
        ({"hot-tip": {"offset": [1, 2]}}, "did you mean seam_tools.hot_tip?"),
    ],
)
def test_a_bad_offset_takes_one_sentence(
    tools: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "welded.toml"
    path.write_text(tomli_w.dumps(welded(seam_tools=tools)))
    with pytest.raises(DesignError) as error:
        load_design(path)
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)
