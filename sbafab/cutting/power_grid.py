"""The test grid of powers and speeds of a film on a machine, its table, and the recipe from it.

A cell is a square that is cut with one power and one speed. Rows are powers, columns speeds.
LightBurn has 30 layers that cut (C00 to C29) and so as many settings: one for the labels, and 29
cells. Edges are nominal, for the grid also tells the kerf.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from sbafab.cutting.beam_paths import LaserRun, stroke_run
from sbafab.cutting.calibration import SEPARATORS, row_cells, table_text
from sbafab.cutting.dxf_write import layered_text
from sbafab.cutting.lettering import Stroke, strokes, width
from sbafab.cutting.lightburn import LaserLayer, runs_text, verify_runs
from sbafab.cutting.properties import ENGRAVE, coupon_properties
from sbafab.cutting.verify import TOLERANCE
from sbafab.design.files import checked
from sbafab.design.recipes import Operation, Recipe
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import coord
from sbafab.spreadsheet import TEXT_MARK, csv_text

MOST_LAYERS = 30
"""Settings of a LightBurn project that cut, C00 to C29."""
MOST_CELLS = MOST_LAYERS - 1
SQUARE, PITCH = 8.0, 12.0
"""mm: a cell's side, and from cell to cell."""
MARGIN = 6.0
MOST_ROWS = 26
"""Rows have a letter each."""
LONGEST = 4
"""Characters of a power or speed that a label has room for."""
LETTER = 2.4
PALETTE = (
    *("000000", "0000ff", "ff0000", "00e000", "d0d000", "ff8000", "00e0e0", "ff00ff", "b4b4b4"),
    *("0000a0", "a00000", "00a000", "a0a000", "c08000", "00a0ff", "a000a0", "808080", "7d87b9"),
    *("bb7784", "4a6fe3", "d33f6a", "8cd78c", "f0b98d", "f6c4e1", "fa9ed4", "500a78", "b45a00"),
    *("004754", "86fa88", "ffdb66"),
)
"""Colours of LightBurn's layers C00 to C29: a drawing in them comes in on the same layers."""
NAMES = ("testgrid.dxf", "testgrid.lbrn2", "testgrid.svg", "testgrid.csv")
ADVICE = (
    "Power and speed differ from layer to layer: do not edit them, and leave kerf offset 0. Labels "
    "have the least power at the highest speed. Extract the fumes, stay beside the machine, and "
    "stop where a cell burns. Then fill in testgrid.csv"
)


class GridCell(NamedTuple):
    """A cell: its name (row, column), power in %, speed in mm/s, and lower left corner in mm."""

    name: str
    power: float
    speed: float
    corner: Point

    @property
    def outline(self) -> Stroke:
        """The square, closed, from its lower left corner and counter-clockwise."""
        x, y = self.corner
        u, v = x + SQUARE, y + SQUARE
        return (x, y), (u, y), (u, v), (x, v), (x, y)

    @property
    def layer(self) -> str:
        """Its layer in the drawing, such as A2_P30_S20."""
        return f"{self.name}_P{self.power:g}_S{self.speed:g}"


@dataclass(frozen=True)
class PowerGrid:
    """A film on a machine, and what is tried; thickness mm, powers %, speeds mm/s."""

    film: str
    thickness: float
    machine: str
    powers: tuple[float, ...]
    speeds: tuple[float, ...]
    passes: int = 1

    def __post_init__(self) -> None:
        for option, values, most in (("--power", self.powers, 100), ("--speed", self.speeds, 5000)):
            if not values or not all(0 < value <= most for value in values):
                raise DesignError(
                    f"{option} must be numbers above 0 and at most {most}, parted by commas"
                )
            if len(set(values)) != len(values):
                raise DesignError(f"{option} gives a number twice; give each once")
            long = next((f"{value:g}" for value in values if len(f"{value:g}") > LONGEST), None)
            if long is not None:
                raise DesignError(
                    f"{option} {long} is too long for a label; use at most {LONGEST} characters"
                )
        if len(self.powers) > MOST_ROWS:
            raise DesignError(f"--power has {len(self.powers)} numbers; give at most {MOST_ROWS}")
        count = len(self.powers) * len(self.speeds)
        if count > MOST_CELLS:
            raise DesignError(
                f"{len(self.powers)} powers at {len(self.speeds)} speeds are {count} cells; "
                f"LightBurn has layers for {MOST_CELLS} and the labels, so give fewer"
            )

    @cached_property
    def cells(self) -> tuple[GridCell, ...]:
        """All cells, from the least power up and from the highest speed down: lightest first."""
        rows = sorted(self.powers)
        columns = sorted(self.speeds, reverse=True)
        left = self._left
        return tuple(
            GridCell(
                f"{chr(65 + row)}{column + 1}",
                power,
                speed,
                (left + column * PITCH, MARGIN + (len(rows) - 1 - row) * PITCH),
            )
            for row, power in enumerate(rows)
            for column, speed in enumerate(columns)
        )

    @property
    def _left(self) -> float:
        """Where the first column begins: behind the longest label of a row."""
        longest = max(width(self._row_label(row), LETTER) for row in range(len(self.powers)))
        return math.ceil(MARGIN + longest + 2)

    def _row_label(self, row: int) -> str:
        return f"{chr(65 + row)} {sorted(self.powers)[row]:g}"

    @property
    def size(self) -> tuple[float, float]:
        """Film that the grid takes, mm."""
        right = self._left + len(self.speeds) * PITCH
        titles = max(width(line, LETTER) for line in self._titles)
        across = max(right, MARGIN + titles) + MARGIN - (PITCH - SQUARE) / 2
        return math.ceil(across), MARGIN + len(self.powers) * PITCH + 16.0

    @property
    def _titles(self) -> tuple[str, str]:
        passes = f" X{self.passes}" if self.passes > 1 else ""
        return f"{self.film} {self.thickness:g}", f"ROWS POWER PERCENT, COLUMNS MM/S{passes}"

    @cached_property
    def labels(self) -> tuple[Stroke, ...]:
        """Engraved: each row and column, the film, and what rows and columns are."""
        top = MARGIN + len(self.powers) * PITCH
        drawn = [
            stroke
            for line, y in zip(self._titles, (top + 9.0, top + 4.8), strict=True)
            for stroke in strokes(line, (MARGIN, y), LETTER)
        ]
        for cell in self.cells:
            x, y = cell.corner
            if cell.name[1:] == "1":
                label = self._row_label(ord(cell.name[0]) - 65)
                drawn += strokes(label, (MARGIN, y + (SQUARE - LETTER) / 2), LETTER)
            if cell.name[0] == "A":
                drawn += strokes(f"{cell.speed:g}", (x, top - 1.0), LETTER)
        return tuple(drawn)

    @property
    def lines(self) -> list[tuple[str, Stroke]]:
        """Labels and cells in cutting order, each with its layer."""
        labels = [(ENGRAVE, stroke) for stroke in self.labels]
        return [*labels, *((cell.layer, cell.outline) for cell in self.cells)]

    @property
    def runs(self) -> list[LaserRun]:
        """The same as LightBurn's project has them."""
        return [stroke_run(layer, run) for layer, run in self.lines]

    @property
    def layers(self) -> list[LaserLayer]:
        """LightBurn's settings: the labels' first, then one a cell."""
        lightest = self.cells[0]
        label = f"{ENGRAVE}: labels"
        return [
            LaserLayer(ENGRAVE, 0, label, lightest.power, lightest.speed),
            *(
                LaserLayer(
                    cell.layer,
                    number,
                    f"{cell.name}: {cell.power:g} %, {cell.speed:g} mm/s",
                    cell.power,
                    cell.speed,
                    self.passes,
                )
                for number, cell in enumerate(self.cells, start=1)
            ),
        ]


def write_grid(folder: Path, grid: PowerGrid, generator: str) -> tuple[Path, ...]:
    """Writes ``testgrid.dxf``, ``.lbrn2``, ``.svg`` and ``.csv``, read back; never over old ones.

    Raises DesignError where one exists, OutputError where a file does not read back as drawn.
    """
    paths = tuple(folder / name for name in NAMES)
    for path in paths:
        if path.exists():
            raise DesignError(f"{path} exists; choose another folder or remove it first")
    folder.mkdir(parents=True, exist_ok=True)
    drawing, project, picture, table = paths
    properties = {
        **coupon_properties(generator),
        "PATTERN": "test grid",
        "MATERIAL": f"{grid.film}, {grid.thickness:g} mm",
        "MACHINE": grid.machine,
    }
    drawing.write_bytes(_dxf(grid, properties).encode())
    verify_drawing(drawing, grid)
    layers, runs = grid.layers, grid.runs
    project.write_bytes(runs_text(layers, runs, properties, ADVICE).encode())
    verify_runs(project, layers, runs)
    picture.write_bytes(_svg(grid).encode())
    table.write_bytes(grid_csv(grid).encode())
    return paths


def _dxf(grid: PowerGrid, properties: dict[str, str]) -> str:
    """The drawing: a layer a cell, in the colour of its layer in LightBurn."""
    colours = {cell.layer: PALETTE[i] for i, cell in enumerate(grid.cells, start=1)}
    return layered_text(grid.lines, colours, properties, grid.size)


def verify_drawing(path: Path, grid: PowerGrid) -> None:
    """Reads the drawing at ``path`` with ezdxf and compares it with the grid that was meant.

    Every line is on its layer, in its order, within TOLERANCE of its place, and every layer has its
    colour. Raises OutputError with what is not.
    """
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.filemanagement import readfile

    document, expected = readfile(path), grid.lines
    entities = list(document.modelspace())
    if len(entities) != len(expected):
        raise OutputError(f"{path.name} has {len(entities)} lines, not {len(expected)}")
    for entity, (layer, run) in zip(entities, expected, strict=True):
        points = [(x, y) for x, y, *_ in entity] if isinstance(entity, LWPolyline) else []
        if isinstance(entity, LWPolyline) and entity.closed:
            points.append(points[0])
        is_on = entity.dxf.layer == layer and len(points) == len(run)
        if not is_on or any(math.dist(p, q) > TOLERANCE for p, q in zip(points, run, strict=True)):
            x, y = run[0]
            raise OutputError(f"{path.name}: the line at x {x:.3f}, y {y:.3f} is not that drawn")
    for number, cell in enumerate(grid.cells, start=1):
        colour = document.layers.get(cell.layer).dxf.get("true_color")
        if colour != int(PALETTE[number], 16):
            raise OutputError(f"{path.name}: layer {cell.layer} has another colour")


def _svg(grid: PowerGrid) -> str:
    across, up = grid.size

    def path(run: Stroke) -> str:
        return "M" + "L".join(f"{coord(x)} {coord(up - y)}" for x, y in run)

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{coord(across)}mm" '
        f'height="{coord(up)}mm" viewBox="0 0 {coord(across)} {coord(up)}" fill="none" '
        'stroke-width="0.1">',
        f'<g id="{ENGRAVE}" stroke="#000000">',
        *(f'<path d="{path(stroke)}"/>' for stroke in grid.labels),
        "</g>",
        *(
            f'<path id="{cell.name}" stroke="#{PALETTE[number]}" d="{path(cell.outline[:-1])}Z"/>'
            for number, cell in enumerate(grid.cells, start=1)
        ),
        "</svg>\n",
    ]
    return "\n".join(lines)


# The table of a grid: written empty, read filled.


COLUMNS = (
    *("cell", "film", "thickness_mm", "machine", "power_percent", "speed_mm_s", "passes"),
    *("cut_through", "edge_quality", "kerf_mm", "remarks"),
)
HINTS = (
    "# cut_through: yes, partly or no. edge_quality: 1 (burnt or ragged) to 5 (clean)",
    "# kerf_mm: (window - piece) / 2 of a square that fell out; leave empty what is not known",
)
ANSWERS = ("yes", "partly", "no")
BEST_EDGE = 5
_DECIMAL = re.compile(r"\d+,\d+", re.ASCII)


def grid_csv(grid: PowerGrid) -> str:
    """The table to fill in: a row for each cell."""
    rows: list[Sequence[object]] = [COLUMNS]
    rows += [
        (
            *(cell.name, grid.film, f"{grid.thickness:g}", grid.machine),
            *(f"{cell.power:g}", f"{cell.speed:g}", str(grid.passes), "", "", "", ""),
        )
        for cell in grid.cells
    ]
    return "".join(f"{hint}\n" for hint in HINTS) + csv_text(rows)


class GridResult(NamedTuple):
    """A filled row: the answer, the edge's quality (None: not said), and the recipe it makes."""

    cell: str
    cut_through: str
    edge_quality: int | None
    recipe: Recipe

    @property
    def rank(self) -> tuple[int, float, float]:
        """Least for the best: clean edge, narrow kerf, little energy a millimetre."""
        recipe = self.recipe
        kerf = math.inf if recipe.kerf_mm is None else recipe.kerf_mm
        energy = recipe.power_percent * recipe.passes / recipe.speed_mm_s
        return -(self.edge_quality or 0), kerf, energy


def read_grid(
    path: Path, operation: Operation = "cut", source: str | None = None, date: str | None = None
) -> list[GridResult]:
    """Return the rows of a table whose cut_through is filled in. Raises DesignError."""
    said = source or f"test grid {path.name}"
    results = []
    for where, row in _rows(path):
        answer = row["cut_through"].lower()
        if not answer:
            continue
        if answer not in ANSWERS:
            raise DesignError(
                f"{where}: cut_through is {answer[:40]!r}; it must be one of {', '.join(ANSWERS)}"
            )
        quality = row["edge_quality"]
        if quality and quality not in map(str, range(1, BEST_EDGE + 1)):
            raise DesignError(
                f"{where}: edge_quality is {quality[:40]!r}; it must be 1 to {BEST_EDGE} or empty"
            )
        told = f"{said}, cell {row['cell']}"
        values: dict[str, object] = {
            "film": row["film"],
            "machine": row["machine"],
            "operation": operation,
            "source": told,
            **{key: _number(row[key], key, where) for key in NUMBERS},
            **({"kerf_mm": _number(row["kerf_mm"], "kerf_mm", where)} if row["kerf_mm"] else {}),
            **({"date": date} if date else {}),
        }
        values["passes"] = int(_number(row["passes"], "passes", where))
        try:
            recipe = checked(Recipe, values, {})
        except DesignError as error:
            raise DesignError(f"{where}: {error}") from None
        results.append(GridResult(row["cell"], answer, int(quality) if quality else None, recipe))
    if not results:
        raise DesignError(f"{path} has no row with cut_through; cut the grid and fill it in")
    return results


NUMBERS = ("thickness_mm", "power_percent", "speed_mm_s")


def chosen_result(
    results: Sequence[GridResult], operation: Operation, cell: str | None
) -> GridResult:
    """Return the row of a cell, by default the best that cut through. Raises DesignError."""
    if cell is not None:
        match = next((row for row in results if row.cell.upper() == cell.upper()), None)
        if match is None:
            names = ", ".join(row.cell for row in results)
            raise DesignError(
                f"--cell {cell[:20]} is no filled cell of the table; there are {names}"
            )
        wanted = ("yes",) if operation == "cut" else ("no", "partly")
        if match.cut_through not in wanted:
            raise DesignError(
                f"cell {match.cell} has cut_through {match.cut_through}, and a recipe to "
                f"{operation} takes {' or '.join(wanted)}; name another cell"
            )
        return match
    if operation == "engrave":
        raise DesignError("a recipe to engrave needs --cell, the cell whose mark you want")
    through = [row for row in results if row.cut_through == "yes"]
    if not through:
        raise DesignError("no cell cut through; cut a grid of more power, or of lower speed")
    return min(through, key=lambda row: row.rank)


def _rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the place and the cells by column of each row of a filled table."""
    lines = [
        (number, line)
        for number, line in enumerate(table_text(path).splitlines(), start=1)
        if line.strip(' ,;\t"') and not line.lstrip(' "').startswith("#")
    ]
    if not lines:
        raise DesignError(f"{path} is empty; give the filled testgrid.csv")
    separator = max(SEPARATORS, key=lines[0][1].count)
    names = row_cells(lines[0][1], separator, f"{path}, line {lines[0][0]}")
    lacking = [name for name in COLUMNS[:-1] if names.count(name) != 1]
    if lacking:
        raise DesignError(f"{path} must have the column {lacking[0]} once, as testgrid.csv has")
    for number, line in lines[1:]:
        where = f"{path}, line {number}"
        cells = [cell.removeprefix(TEXT_MARK) for cell in row_cells(line, separator, where)]
        if len(cells) != len(names):
            raise DesignError(
                f"{where} has {len(cells)} cells where the header has {len(names)}; write decimal "
                "points, or part the columns by semicolons where commas are decimal"
            )
        yield where, dict(zip(names, cells, strict=True))


def _number(text: str, column: str, where: str) -> float:
    try:
        value = float(text.replace(",", ".") if _DECIMAL.fullmatch(text) else text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or (column == "passes" and value != int(value)):
        kind = "a whole number" if column == "passes" else "a number"
        raise DesignError(f"{where}: {column} is {text[:40]!r}; it must be {kind}")
    return value
