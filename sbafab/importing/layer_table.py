"""Import a folder of drawings with a table of layers and a table of chambers.

``layers.csv`` has one row per layer, bottom to top; ``chambers.csv`` one row per pocket centre.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_args

from sbafab.actuators.drawn import DRAWN
from sbafab.cutting.dxf_write import dxf_text
from sbafab.design.drawing import read_drawing
from sbafab.design.files import listed, shown
from sbafab.design.units import millimetres
from sbafab.errors import DesignError
from sbafab.importing.polygons import SUFFIXES, polygon_layer
from sbafab.importing.popupcad import SUFFIX, cad_layer
from sbafab.importing.records import Imported, file_name, key_name
from sbafab.laminate.laminate import Role

LAYERS, CHAMBERS, KIT = "layers.csv", "chambers.csv", "kit.toml"
LAYER_COLUMNS = {"file": True, "role": True, "film": False, "layer": False, "pieces": False}
"""Columns of ``layers.csv``: True if every row must fill it."""
CHAMBER_COLUMNS = {
    "name": True,
    "x": True,
    "y": True,
    "mouth_x": False,
    "mouth_y": False,
    "angle": False,
    "width": False,
}
MOUTH = ("mouth_x", "mouth_y", "angle")
DRAWINGS = (".dxf", ".svg")
MOST_ROWS = 1000
MOST_BYTES = 1_000_000


class CsvRow(NamedTuple):
    """A table row: its line in the file, and its non-empty cells by column."""

    place: str
    cells: Mapping[str, str]

    def number(self, column: str) -> float:
        """Return a cell as a length in mm. Raises DesignError."""
        try:
            return millimetres(self.cells[column])
        except ValueError as error:
            raise DesignError(
                f"{self.place}: {column} = {shown(self.cells[column])} {error}"
            ) from None


def import_table(folder: Path) -> Imported:
    """Return the design for a folder of DXF or SVG files and its tables. Raises DesignError.

    A drawing may also be a layer of foldable_robotics polygons, by its number, or of a popupCAD
    design, by "OPERATION/NUMBER". A ``kit.toml`` beside the tables gives films, press, laser and
    limits.
    """
    rows = read_table(folder / LAYERS, LAYER_COLUMNS)
    shapes: dict[str, dict[str, Any]] = {}
    names: dict[tuple[str, str | None], str] = {}
    drawings: dict[str, bytes] = {}
    layers, remarks = [], []
    for row in rows:
        drawing = row.cells["file"], row.cells.get("layer")
        if drawing not in names:
            names[drawing] = key_name(drawing[1] or Path(drawing[0]).stem, shapes, "layer-")
            name, content, read_as = _drawing(folder, row)
            remarks += read_as
            if drawings.setdefault(name, content) != content:
                raise DesignError(f"{row.place}: two files are named {name}; rename one of them")
            is_part = drawing[1] is not None and name == Path(drawing[0]).name
            layer = {"layer": drawing[1]} if is_part else {}
            shapes[names[drawing]] = {"file": name, **layer}
        layers.append(_layer(row, names[drawing]))
    if not (folder / CHAMBERS).is_file():
        columns = ", ".join(CHAMBER_COLUMNS)
        raise DesignError(f"{folder} has no {CHAMBERS} (columns {columns}); add it")
    tables: dict[str, Any] = {
        "name": file_name(folder.resolve().name),
        "family": DRAWN,
        "layers": layers,
        "chambers": _chambers(folder / CHAMBERS),
        "shapes": shapes,
    }
    if (folder / KIT).is_file():
        tables["kit"] = KIT
        drawings[KIT] = (folder / KIT).read_bytes()
    unused = sorted(
        path.name
        for path in folder.iterdir()
        if path.suffix.lower() in DRAWINGS and path.name not in drawings
    )
    remarks += [f"{name}: {LAYERS} does not name it, so it is not imported" for name in unused]
    return Imported(tables, drawings, tuple(dict.fromkeys(remarks)))


def read_table(path: Path, columns: Mapping[str, bool]) -> list[CsvRow]:
    """Return the rows of a CSV file; its columns are a subset of these.

    Separators are commas, semicolons or tabs. Raises DesignError with file, line and column.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DesignError(
                f"{path} has more than {MOST_BYTES:,} bytes; it is no table of layers"
            )
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise DesignError(f"{path} cannot be read: {reason}; save it as CSV in UTF-8") from None
    lines = text.splitlines()
    head = next((line for line in lines if line.strip()), "")
    separator = max(",;\t", key=head.count)
    try:
        cells = list(csv.reader(lines, delimiter=separator, strict=True))
    except csv.Error as error:
        raise DesignError(f"{path} is damaged ({error}); save it again as CSV") from None
    numbered = [(n, row) for n, row in enumerate(cells, start=1) if any(map(str.strip, row))]
    if len(numbered) < 2 or len(numbered) > MOST_ROWS:
        raise DesignError(f"{path} has {max(0, len(numbered) - 1)} rows under its head; add some")
    (_, first), *rest = numbered
    names = [name.strip().lower() for name in first]
    _check_columns(path, names, columns)
    return [_row(path, number, names, row, columns) for number, row in rest]


def _check_columns(path: Path, names: Sequence[str], columns: Mapping[str, bool]) -> None:
    known = f"columns are {', '.join(columns)}"
    strange = next((name for name in names if name not in columns), None)
    if strange is not None:
        raise DesignError(f"{path} has a column {shown(strange)} that is not known; {known}")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DesignError(f"{path} has the column {twice} twice; remove one")
    missing = next((name for name, needed in columns.items() if needed and name not in names), None)
    if missing is not None:
        raise DesignError(f"{path} has no column {missing}; {known}")


def _row(
    path: Path, number: int, names: Sequence[str], row: Sequence[str], columns: Mapping[str, bool]
) -> CsvRow:
    place = f"{path.name}, line {number}"
    if len(row) > len(names):
        raise DesignError(f"{place} has {len(row)} cells for {len(names)} columns; remove some")
    cells = {name: cell.strip() for name, cell in zip(names, row, strict=False) if cell.strip()}
    missing = next((name for name, needed in columns.items() if needed and name not in cells), None)
    if missing is not None:
        raise DesignError(f"{place} has no {missing}; fill it in")
    return CsvRow(place, cells)


def _drawing(folder: Path, row: CsvRow) -> tuple[str, bytes, list[str]]:
    """The name and content of a row's only drawing, and remarks on it."""
    path, layer = folder / row.cells["file"], row.cells.get("layer", "")
    suffix = path.suffix.lower()
    if suffix not in (*DRAWINGS, *SUFFIXES, SUFFIX):
        raise DesignError(
            f"{row.place}: file = {shown(row.cells['file'])} is no DXF or SVG, no JSON or YAML of "
            "polygons, and no popupCAD design"
        )
    try:
        if suffix in (*SUFFIXES, SUFFIX):
            is_cad = suffix == SUFFIX
            region, remarks = cad_layer(path, layer) if is_cad else (polygon_layer(path, layer), [])
            name = f"{path.stem}-{file_name(layer)}.dxf"
            return name, dxf_text(region.contours, {}).encode(), remarks
        read_drawing(path, row.cells.get("layer"))
        return path.name, path.read_bytes(), []
    except DesignError as error:
        raise DesignError(f"{row.place}: {error}") from None


def _layer(row: CsvRow, shape: str) -> dict[str, Any]:
    cells = row.cells
    roles = get_args(Role)
    if cells["role"] not in roles:
        raise DesignError(
            f"{row.place}: role = {shown(cells['role'])} must be one of {listed(roles)}"
        )
    layer: dict[str, Any] = {"role": cells["role"], "shape": shape}
    if "film" in cells:
        layer["film"] = cells["film"].lower()
    if "pieces" in cells:
        if not cells["pieces"].isdecimal():
            raise DesignError(
                f"{row.place}: pieces = {shown(cells['pieces'])} is no count; write 1, 2, 3 ..."
            )
        layer["pieces"] = int(cells["pieces"])
    return layer


def _chambers(path: Path) -> list[dict[str, Any]]:
    """The chambers of a table; rows with the same name add centres to one chamber."""
    chambers: dict[str, dict[str, Any]] = {}
    for row in read_table(path, CHAMBER_COLUMNS):
        name, cells = row.cells["name"], row.cells
        centre = [row.number("x"), row.number("y")]
        if name in chambers:
            _refuse_second(row, [*MOUTH, "width"])
            chambers[name]["centres"].append(centre)
            continue
        missing = next((column for column in MOUTH if column not in cells), None)
        if missing is not None:
            raise DesignError(f"{row.place} has no {missing}, of the first row of {name}; add it")
        chambers[name] = {
            "name": name,
            "centres": [centre],
            "mouth": [row.number("mouth_x"), row.number("mouth_y")],
            "angle": row.number("angle"),
            **({"width": row.number("width")} if "width" in cells else {}),
        }
    return list(chambers.values())


def _refuse_second(row: CsvRow, columns: Iterable[str]) -> None:
    second = next((column for column in columns if column in row.cells), None)
    if second is not None:
        raise DesignError(
            f"{row.place}: {second} of {row.cells['name']} stands in an earlier row; leave it empty"
        )
