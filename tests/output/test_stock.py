"""The stock file: the smallest piece that serves, rests, and the file's faults."""

from __future__ import annotations

import random
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from filelock import FileLock
from shapely import unary_union
from shapely.geometry import box

from sbafab.actuators import load_design
from sbafab.as_built.check import read_back
from sbafab.cli import main
from sbafab.cutting.dxf_read import read_profile
from sbafab.design.files import template_text
from sbafab.errors import DesignError, OutputError
from sbafab.runs.run import RunRequest, generate
from sbafab.runs.stock import bill_against, largest_rectangle, read_stock, rests, take

TPE = {"film": "Stretchlon 200", "thickness": 0.038}
PTFE = {"film": "PTFE film", "thickness": 0.025}


def piece(name: str, film: dict[str, Any], width: float, length: float, count: int = 1) -> Any:
    return {"id": name, **film, "width": width, "length": length, "count": count}


PIECES = [
    piece("full", TPE, 152.4, 152.4, 3),
    piece("thick", {**TPE, "thickness": 0.05}, 90.0, 90.0),
    piece("small", TPE, 100.0, 80.0),
    piece("tiny", TPE, 30.0, 31.0),
    piece("masks", PTFE, 152.4, 152.4, 2),
]


@pytest.fixture
def shelf(tmp_path: Path) -> Path:
    path = tmp_path / "stock.toml"
    path.write_text(tomli_w.dumps({"piece": PIECES}))
    return path


def cut(shelf: Path, *changes: str) -> Path:
    """Return the folder of the 5 mm actuator's cut files from the pieces on a shelf."""
    source = shelf.with_name("little.toml")
    text = template_text("1dof-5mm")
    source.write_text(text, encoding="utf-8")
    design = load_design(source, (f"sheets.stock={shelf.name}", *changes))
    return generate(RunRequest(design, shelf.parent / "out", ("cut",))).folder


def is_sound(folder: Path) -> bool:
    read = read_back(folder)
    return all(finding.verdict != "fail" for finding in read.against_design(read.problems))


def test_the_smallest_piece_that_holds_the_parts_is_cut(shelf: Path) -> None:
    before = shelf.read_bytes()
    folder = cut(shelf)
    design = load_design(folder / "design.toml")
    sheet = design.sheets.tpe
    assert (sheet.piece, sheet.width, sheet.length) == ("small", 100.0, 80.0)
    assert design.sheets.ptfe.piece == "masks"
    for path in folder.glob("sheets/TPE*.dxf"):
        low_x, low_y, high_x, high_y = read_profile(path).region.bounds
        assert min(low_x, low_y) >= 10 - 1e-6
        assert high_x <= 90 + 1e-6
        assert high_y <= 70 + 1e-6
    assert is_sound(folder)
    assert shelf.read_bytes() == before


def test_a_cut_file_that_reaches_past_its_piece_is_caught(shelf: Path) -> None:
    folder = cut(shelf)
    text = (folder / "design.toml").read_text(encoding="utf-8")
    (folder / "design.toml").write_text(text.replace("width = 100.0", "width = 99.0", 1))
    assert not is_sound(folder)


def test_a_taken_run_is_booked_once(shelf: Path) -> None:
    folder = cut(shelf)
    expected = {piece: rest for _, piece, rest in rests(folder)}
    take(folder, shelf)
    after = {piece.id: piece for piece in read_stock(shelf).piece}
    assert "small" not in after
    assert after["masks"].count == 1
    assert after["full"].count == 3
    kept = [piece for piece in after.values() if piece.rest]
    assert [(p.width, p.length) for p in kept] == [
        (rest.width, rest.length) for rest in expected.values() if rest is not None
    ]
    booked = shelf.read_bytes()
    with pytest.raises(OutputError, match=r"was taken from .* before"):
        take(folder, shelf)
    assert shelf.read_bytes() == booked
    # The next run takes other pieces.
    assert load_design(cut(shelf) / "design.toml").sheets.tpe.piece != "small"


def test_a_rest_keeps_clear_of_every_cut(shelf: Path) -> None:
    folder = cut(shelf, "order.copies=2")
    for sheet, _, rest in rests(folder):
        assert rest is not None
        area = box(rest.x, rest.y, rest.x + rest.width, rest.y + rest.length)
        assert box(0, 0, sheet.width, sheet.length).contains(area)
        parts = read_profile(folder / sheet.file).region.pieces
        cuts = unary_union([box(*part.bounds) for part in parts])
        assert cuts.distance(area) >= sheet.spacing - 1e-6


def test_the_largest_rectangle_is_the_largest_by_exhaustion() -> None:
    draw = random.Random(3)
    for _ in range(20):
        boxes = []
        for _ in range(4):
            x, y = draw.randrange(9), draw.randrange(9)
            boxes.append((x, y, x + draw.randrange(1, 4), y + draw.randrange(1, 4)))
        best = max(
            (x1 - x0) * (y1 - y0)
            for x0 in range(10)
            for y0 in range(8)
            for x1 in range(x0, 11)
            for y1 in range(y0, 9)
            if not any(x0 < d and c < x1 and y0 < f and e < y1 for c, e, d, f in boxes)
        )
        x0, y0, x1, y1 = largest_rectangle((10.0, 8.0), boxes)
        assert (x1 - x0) * (y1 - y0) == best


@pytest.mark.parametrize(
    ("pieces", "changes", "says"),
    [
        ([PIECES[1], PIECES[4]], (), "has no piece of film 'Stretchlon 200', 0.038 mm thick"),
        ([PIECES[3], PIECES[4]], (), "no piece of film 'Stretchlon 200' .* holds the TPE parts"),
        ([PIECES[0], PIECES[0]], (), "two pieces with id 'full'"),
        (PIECES, ("sheets.tpe.roll=true",), r"sheets\.tpe\.roll does not go with sheets\.stock"),
        ([{**PIECES[0], "width": -1}], (), "width"),
        ([{**PIECES[0], "colour": "red"}], (), "colour is not a key of a stock file; known here"),
        ([{**PIECES[0], "lenght": 9}], (), "did you mean piece.0.length?"),
    ],
)
def test_faults_of_a_stock_file_are_a_sentence(
    shelf: Path, pieces: list[Any], changes: tuple[str, ...], says: str
) -> None:
    shelf.write_text(tomli_w.dumps({"piece": pieces}))
    with pytest.raises(DesignError, match=says):
        cut(shelf, *changes)
    assert not (shelf.parent / "out" / "little").exists()


def test_a_missing_or_broken_stock_file_is_a_sentence(shelf: Path) -> None:
    shelf.write_text("[[piece")
    with pytest.raises(DesignError, match="is not valid TOML"):
        cut(shelf)
    shelf.unlink()
    with pytest.raises(DesignError, match=r"there is no stock file .*; write one"):
        cut(shelf)


def test_a_stock_file_in_use_or_without_the_piece_stays(shelf: Path) -> None:
    folder = cut(shelf)
    before = shelf.read_bytes()
    with FileLock(shelf.parent / ".stock.toml.lock"), pytest.raises(OutputError, match="writing"):
        take(folder, shelf)
    assert shelf.read_bytes() == before
    gone = tomllib.loads(shelf.read_text())
    shelf.write_text(tomli_w.dumps({"piece": gone["piece"][:2]}))
    with pytest.raises(OutputError, match="no piece 'small' left"):
        take(folder, shelf)


def test_the_command_says_what_is_taken_and_left(
    shelf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = cut(shelf)
    with pytest.raises(SystemExit) as ended:
        main(["stock", str(folder), str(shelf), "--take"])
    assert ended.value.code == 0
    assert "TPE_1: of piece small; leaves" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["stock", str(folder), str(shelf), "--take"])
    assert ended.value.code == 2


def batch(tmp_path: Path, items: list[dict[str, Any]]) -> tuple[Path, Path]:
    """Return the folder of 20 copies, and a stock file with these items."""
    shelf = tmp_path / "stock.toml"
    pieces = [piece("full", TPE, 152.4, 152.4, 3), piece("masks", PTFE, 152.4, 152.4, 2)]
    shelf.write_text(tomli_w.dumps({"piece": pieces, "item": items}))
    source = tmp_path / "little.toml"
    source.write_text(template_text("1dof-5mm"), encoding="utf-8")
    design = load_design(source, (f"sheets.stock={shelf.name}", "order.copies=20"))
    return generate(RunRequest(design, tmp_path / "out", ("cut", "press", "preview"))).folder, shelf


def test_a_bill_says_what_the_stock_lacks(tmp_path: Path) -> None:
    """20 actuators of one chamber take 20 tubes and a spare one; pins are told apart by length."""
    items = [
        {"item": "tube", "specification": "RPT040", "count": 12},
        {"item": "Tube", "specification": "another tube", "count": 99},
        {"item": "Dowel pins", "specification": "4 mm long", "count": 1000},
        {"item": "Adhesive", "count": 21},
        {"item": "Base plate", "count": 1, "reusable": True},
    ]
    folder, shelf = batch(tmp_path, items)
    needs = bill_against(folder, read_stock(shelf))
    counts = {need.item: (need.needed, need.in_stock, need.lacking) for need in needs}
    assert counts["Tube"] == (21, 12, 9)
    assert counts["Adhesive"] == (20, 21, 0)
    assert counts["TPE film"] == (1, 3, 0)
    pins = {need.specification[-40:]: need for need in needs if need.item == "Dowel pins"}
    assert [need.lacking > 0 for need in pins.values()] == [True, False]
    left = {(item.item, item.specification): item.count for item in take(folder, shelf).item}
    assert left["tube", "RPT040"] == 0
    assert left["Tube", "another tube"] == 99
    assert left["Adhesive", ""] == 1
    assert left["Base plate", ""] == 1


def test_one_item_serves_two_rows_once(tmp_path: Path) -> None:
    folder, shelf = batch(tmp_path, [{"item": "Dowel pins", "count": 5}])
    first, second = (
        need for need in bill_against(folder, read_stock(shelf)) if need.item == "Dowel pins"
    )
    assert first.in_stock == 5
    assert second.in_stock == 0


def test_a_changed_bill_is_refused(tmp_path: Path) -> None:
    folder, shelf = batch(tmp_path, [])
    bill = folder / "bill.csv"
    bill.write_text(bill.read_text(encoding="utf-8").replace("Tube", "Hose"), encoding="utf-8")
    with pytest.raises(OutputError, match=r"bill.csv was changed since it was written"):
        bill_against(folder, read_stock(shelf))


def test_the_command_writes_the_bill(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, shelf = batch(tmp_path, [])
    out = tmp_path / "needs.csv"
    with pytest.raises(SystemExit) as ended:
        main(["stock", str(folder), str(shelf), "--bill", str(out)])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert (
        "Tube, Braintree RPT040, outer diameter 1.016 mm: 21 needed, 0 in stock, 21 lacking" in said
    )
    assert "items lacking" in said
    assert out.read_text(encoding="utf-8").startswith("item,specification,needed,in_stock,lacking")
    with pytest.raises(SystemExit) as ended:
        main(["stock", str(folder), str(tmp_path / "none.toml")])
    assert ended.value.code == 2
    assert "there is no stock file" in capsys.readouterr().err
