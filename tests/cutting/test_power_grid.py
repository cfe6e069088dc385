"""The test grid: a layer a cell, read by other programs; its table; and the recipe from it."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import pytest
import shapely

from sbafab.cutting.lightburn import read_project, verify_runs
from sbafab.cutting.power_grid import (
    COLUMNS,
    PowerGrid,
    chosen_result,
    grid_csv,
    read_grid,
    verify_drawing,
    write_grid,
)
from sbafab.errors import DesignError, OutputError

GRID = PowerGrid("TPU 85A", 0.05, "K40", (20.0, 5.0, 12.5), (10.0, 40.0), 2)
SPEEDS = {"1": "40", "2": "10"}
POWERS = {"A": "5", "B": "12.5", "C": "20"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    written = tmp_path_factory.mktemp("grid") / "grid"
    write_grid(written, GRID, "sbafab 0")
    return written


def settings_of(project: Path) -> dict[str, dict[str, str]]:
    root = ElementTree.parse(project).getroot()
    tables = [
        {child.tag: child.get("Value", "") for child in item} for item in root.iter("CutSetting")
    ]
    return {table["name"].partition(":")[0]: table for table in tables}


def test_every_cell_is_a_square_with_its_power_and_speed(folder: Path) -> None:
    """Rows are powers from the least, columns speeds from the highest."""
    settings = settings_of(folder / "testgrid.lbrn2")
    assert list(settings) == ["ENGRAVE", "A1", "A2", "B1", "B2", "C1", "C2"]
    assert [table["index"] for table in settings.values()] == list("0123456")
    for name, table in settings.items():
        row, column = ("A", "1") if name == "ENGRAVE" else name
        assert {table[key] for key in ("minPower", "maxPower", "maxPower2")} == {POWERS[row]}
        assert table["speed"] == SPEEDS[column]
        assert table["numPasses"] == ("1" if name == "ENGRAVE" else "2")
        assert (table["kerf"], table["doOutput"]) == ("0", "1")


def test_another_program_reads_the_cells_where_the_project_has_them(folder: Path) -> None:
    model = ezdxf.readfile(folder / "testgrid.dxf")
    assert not model.audit().errors
    lines = model.modelspace().query("LWPOLYLINE")
    squares = {
        line.dxf.layer.partition("_")[0]: shapely.Polygon([p[:2] for p in line.get_points()])
        for line in lines
        if line.dxf.layer != "ENGRAVE"
    }
    assert {cell: (box.area, box.length) for cell, box in squares.items()} == dict.fromkeys(
        squares, pytest.approx((64.0, 32.0))
    )
    assert len(squares) == 6
    # Rows lie under each other and columns side by side, 12 mm apart, so that squares stay apart.
    for cell, box in squares.items():
        x, y = squares["A1"].bounds[:2]
        place = x + 12 * (int(cell[1]) - 1), y - 12 * (ord(cell[0]) - ord("A"))
        assert box.bounds[:2] == pytest.approx(place)
    layers = {layer.dxf.name: layer.dxf for layer in model.layers if "_P" in layer.dxf.name}
    assert set(layers) == {
        f"{row}{column}_P{power}_S{speed}"
        for row, power in POWERS.items()
        for column, speed in SPEEDS.items()
    }
    colours = [layers[name].true_color for name in sorted(layers)]
    # LightBurn's C01 to C06.
    assert colours == [0x0000FF, 0xFF0000, 0x00E000, 0xD0D000, 0xFF8000, 0x00E0E0]
    assert len({layer.color for layer in layers.values()}) == len(layers)
    # The project has the same squares.
    shapes = [shape for shape in read_project(folder / "testgrid.lbrn2").shapes if shape.index]
    for shape, box in zip(shapes, squares.values(), strict=True):
        drawn = shapely.Polygon([curve.start for curve in shape.curves])
        assert drawn.symmetric_difference(box).area < 1e-9
    # Labels are engraved outside all squares.
    for line in lines:
        if line.dxf.layer == "ENGRAVE":
            stroke = shapely.LineString([p[:2] for p in line.get_points()])
            assert not any(stroke.intersects(box) for box in squares.values())


def test_the_picture_has_a_square_a_cell(folder: Path) -> None:
    root = ElementTree.parse(folder / "testgrid.svg").getroot()
    assert {item.get("id") for item in root.iter() if item.get("id")} == {
        *("ENGRAVE", "A1", "A2", "B1", "B2", "C1", "C2")
    }


def test_nothing_is_overwritten(folder: Path) -> None:
    with pytest.raises(DesignError, match=r"testgrid\.dxf exists"):
        write_grid(folder, GRID, "sbafab 0")


@pytest.mark.parametrize(
    ("powers", "speeds", "says"),
    [
        ((10.0,) * 2, (10.0,), "--power gives a number twice"),
        ((101.0,), (10.0,), "--power must be numbers above 0 and at most 100"),
        ((10.0,), (0.0,), "--speed must be numbers above 0"),
        ((), (10.0,), "--power must be numbers"),
        ((10.0,), (12.345,), "--speed 12.345 is too long"),
        (tuple(map(float, range(1, 28))), (10.0,), "--power has 27 numbers; give at most 26"),
        (
            tuple(map(float, range(1, 7))),
            tuple(map(float, range(1, 6))),
            "30 cells; LightBurn has layers for 29",
        ),
    ],
)
def test_a_grid_that_cannot_be_is_refused(
    powers: tuple[float, ...], speeds: tuple[float, ...], says: str
) -> None:
    with pytest.raises(DesignError, match=says):
        PowerGrid("TPU", 0.05, "K40", powers, speeds)


def once(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        changed, count = re.subn(old, new, text, count=1, flags=re.DOTALL)
        assert count
        return changed

    return change


@pytest.mark.parametrize(
    ("file", "change", "says"),
    [
        ("dxf", once(r"(A1_P5_S40\n100.*? 10\n\d+\.\d)", r"\g<1>5"), "is not that drawn"),
        ("dxf", once("  8\nA1_P5_S40", "  8\nA2_P5_S10"), "is not that drawn"),
        ("dxf", once("420\n255\n", "420\n256\n"), "layer A1_P5_S40 has another colour"),
        ("lbrn2", once('speed Value="10"', 'speed Value="100"'), "speed of layer A2_P5_S10 is 100"),
        ("lbrn2", once('maxPower Value="20"', 'maxPower Value="90"'), "maxPower of layer C1"),
        ("lbrn2", once('numPasses Value="2"', 'numPasses Value="9"'), "numPasses of layer A1"),
        ("lbrn2", once('CutIndex="3"', 'CutIndex="4"'), "is not one of B1"),
    ],
)
def test_a_grid_that_was_changed_is_told(
    file: str, change: Callable[[str], str], says: str, folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / f"testgrid.{file}"
    path.write_text(change((folder / path.name).read_text()))
    with pytest.raises(OutputError, match=says):
        if file == "dxf":
            verify_drawing(path, GRID)
        else:
            verify_runs(path, GRID.layers, GRID.runs)


# The filled table.


def filled(tmp_path: Path, answers: dict[str, str], separator: str = ",") -> Path:
    """The grid's table with answers by cell: cut_through, edge_quality, kerf_mm, remarks."""
    lines = []
    for line in grid_csv(GRID).splitlines():
        cells = next(csv.reader([line]))
        lines.append(
            separator.join([*cells[:7], answers[cells[0]]]) if cells[0] in answers else line
        )
    text = "\n".join(lines)
    if separator != ",":
        text = text.replace(",".join(COLUMNS), separator.join(COLUMNS))
        text = "\n".join(row for row in text.splitlines() if separator in row)
    path = tmp_path / "filled.csv"
    path.write_text(text)
    return path


def test_the_cleanest_cell_that_cut_through_is_taken(tmp_path: Path) -> None:
    """Of equal edges the narrowest kerf, then the least power a millimetre."""
    table = filled(
        tmp_path,
        {
            "A1": "no,5,0.01,",
            "B1": "yes,4,0.12,",
            "B2": "yes,4,0.1,",
            "C1": "yes,4,0.1,less energy than B2: 20 / 40 a mm and not 12.5 / 10",
            "C2": "yes,3,0.05,",
        },
    )
    result = chosen_result(read_grid(table, date="2026-05-12"), "cut", None)
    recipe = result.recipe
    assert result.cell == "C1"
    assert (recipe.film, recipe.thickness_mm, recipe.machine) == ("TPU 85A", 0.05, "K40")
    assert (recipe.power_percent, recipe.speed_mm_s, recipe.passes) == (20.0, 40.0, 2)
    assert (recipe.kerf_mm, recipe.date) == (0.1, "2026-05-12")
    assert recipe.source == "test grid filled.csv, cell C1"
    assert chosen_result(read_grid(table), "cut", "b2").recipe.power_percent == 12.5
    mark = chosen_result(read_grid(table, "engrave"), "engrave", "A1").recipe
    assert (mark.operation, mark.power_percent, mark.speed_mm_s) == ("engrave", 5.0, 40.0)


def test_decimal_commas_are_read_between_semicolons(tmp_path: Path) -> None:
    table = filled(tmp_path, {"B1": "yes;4;0,12;"}, ";")
    [result] = read_grid(table)
    assert (result.recipe.kerf_mm, result.recipe.power_percent) == (0.12, 12.5)


@pytest.mark.parametrize(
    ("answers", "cell", "operation", "says"),
    [
        ({}, None, "cut", "no row with cut_through"),
        ({"A1": "no,,,"}, None, "cut", "no cell cut through"),
        ({"A1": "maybe,,,"}, None, "cut", "line 4: cut_through is 'maybe'"),
        ({"A1": "yes,6,,"}, None, "cut", "edge_quality is '6'; it must be 1 to 5"),
        ({"A1": "yes,,x,"}, None, "cut", "kerf_mm is 'x'; it must be a number"),
        ({"A1": "yes,,2,"}, None, "cut", "line 4: kerf_mm"),
        ({"A1": "yes,,0,12,"}, None, "cut", "12 cells where the header has 11"),
        ({"A1": "yes,,,"}, "Z9", "cut", "--cell Z9 is no filled cell of the table; there are A1"),
        ({"A1": "no,,,"}, "A1", "cut", "has cut_through no, and a recipe to cut takes yes"),
        ({"A1": "yes,,,"}, "A1", "engrave", "a recipe to engrave takes no or partly"),
        ({"A1": "no,,,"}, None, "engrave", "needs --cell"),
    ],
)
def test_a_table_that_says_nothing_sure_is_refused(
    answers: dict[str, str], cell: str | None, operation: str, says: str, tmp_path: Path
) -> None:
    kind = "engrave" if operation == "engrave" else "cut"
    with pytest.raises(DesignError, match=says):
        chosen_result(read_grid(filled(tmp_path, answers), kind), kind, cell)
