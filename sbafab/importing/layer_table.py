"""Import a folder of drawings with a table of layers and a table of chambers.

``layers.csv`` has one row per layer, bottom to top; ``chambers.csv`` one row per pocket centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

from pydantic import Field

from sbafab.actuators.drawn import DRAWN
from sbafab.actuators.shapes import Coordinate
from sbafab.cutting.dxf_write import dxf_text
from sbafab.design.files import checked, name_of, read_text, shown
from sbafab.design.outline import read_drawing
from sbafab.design.records import without_none
from sbafab.design.toml_table import Section
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, union
from sbafab.importing.popupcad import SUFFIX, cad_layer
from sbafab.importing.records import (
    LAYERS,
    UNNAMED,
    Imported,
    json_of,
    key_name,
    layer_index,
    read_yaml,
    refuse_without_table,
    region_of,
)
from sbafab.laminate.laminate import Role
from sbafab.spreadsheet import table_rows

CHAMBERS, KIT = "chambers.csv", "kit.toml"
MOUTH = ("mouth_x", "mouth_y", "angle", "width")
"""Columns of a chamber's first row."""
DRAWINGS = (".dxf", ".svg")
MOST_ROWS = 1000
Pieces = Annotated[int, Field(ge=1, strict=False)]
MouthAngle = Annotated[float, Field(strict=False)]
AnyRow = TypeVar("AnyRow", bound=Section)


class LayerEntry(Section):
    """A row of ``layers.csv``: one layer of the laminate."""

    file: str
    role: Role
    film: str | None = None
    layer: str | None = None
    pieces: Pieces | None = None


class ChamberEntry(Section):
    """A row of ``chambers.csv``: the centre of one pocket."""

    name: str
    x: Coordinate
    y: Coordinate
    mouth_x: Coordinate | None = None
    mouth_y: Coordinate | None = None
    angle: MouthAngle | None = None
    width: Length | None = None


def import_table(folder: Path) -> Imported:
    """Return the design for a folder of DXF or SVG files and its tables. Raises DesignError.

    A drawing may also be a layer of foldable_robotics polygons, by its number, or of a popupCAD
    design, by "OPERATION/NUMBER". A ``kit.toml`` beside the tables gives films, press, laser and
    limits.
    """
    shapes: dict[str, dict[str, Any]] = {}
    names: dict[tuple[str, str | None], str] = {}
    drawings: dict[str, bytes] = {}
    layers, remarks = [], []
    for place, row in read_table(folder / LAYERS, LayerEntry):
        drawing = row.file, row.layer
        if drawing not in names:
            names[drawing] = key_name(drawing[1] or Path(drawing[0]).stem, shapes, "layer-")
            name, content, read_as = _drawing(folder, row, place)
            remarks += read_as
            if drawings.setdefault(name, content) != content:
                raise DesignError(f"{place}: two files are named {name}; rename one of them")
            is_part = drawing[1] is not None and name == Path(drawing[0]).name
            layer = {"layer": drawing[1]} if is_part else {}
            shapes[names[drawing]] = {"file": name, **layer}
        film = row.film and row.film.lower()
        table = {"role": row.role, "shape": names[drawing], "film": film, "pieces": row.pieces}
        layers.append(without_none(table))
    if not (folder / CHAMBERS).is_file():
        columns = ", ".join(ChamberEntry.model_fields)
        raise DesignError(f"{folder} has no {CHAMBERS} (columns {columns}); add it")
    tables: dict[str, Any] = {
        "name": name_of(folder.resolve().name) or UNNAMED,
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


def read_table(path: Path, record: type[AnyRow]) -> Iterator[tuple[str, AnyRow]]:
    """Yield place and record of every row of a CSV file. Raises DesignError with line and column.

    An empty cell has no meaning, unless its column is unknown.
    """
    rows = [*table_rows(path)]
    if not 0 < len(rows) <= MOST_ROWS:
        raise DesignError(f"{path} has {len(rows)} rows below its header; give 1 to {MOST_ROWS}")
    for where, row in rows:
        place = where.replace(str(path), path.name)
        filled = {key: cell for key, cell in row.items() if cell or key not in record.model_fields}
        yield place, checked(record, filled, {}, f"{place}: ", "table")


def _drawing(folder: Path, row: LayerEntry, place: str) -> tuple[str, bytes, list[str]]:
    """Return the name and content of a row's only drawing, and remarks about it."""
    path, layer = folder / row.file, row.layer or ""
    suffix = path.suffix.lower()
    if suffix not in (*DRAWINGS, *SUFFIXES, SUFFIX):
        raise DesignError(
            f"{place}: file = {shown(row.file)} is not a DXF or SVG file, a JSON or YAML file of "
            "polygons, or a popupCAD design"
        )
    try:
        if suffix in DRAWINGS:
            read_drawing(path, row.layer)
            return path.name, path.read_bytes(), []
        is_cad = suffix == SUFFIX
        region, remarks = cad_layer(path, layer) if is_cad else (polygon_layer(path, layer), [])
    except DesignError as error:
        raise DesignError(f"{place}: {error}") from None
    name = f"{path.stem}-{name_of(layer)}.dxf"
    return name, dxf_text(region.contours, {}).encode(), remarks


def _chambers(path: Path) -> list[dict[str, Any]]:
    """Return the chambers of a table; rows with the same name add centres to one chamber."""
    chambers: dict[str, dict[str, Any]] = {}
    for place, row in read_table(path, ChamberEntry):
        if row.name in chambers:
            second = next((key for key in MOUTH if getattr(row, key) is not None), None)
            if second is not None:
                raise DesignError(
                    f"{place}: {second} of {row.name} is given in an earlier row; leave it empty"
                )
            chambers[row.name]["centres"].append([row.x, row.y])
            continue
        missing = next((key for key in MOUTH[:3] if getattr(row, key) is None), None)
        if missing is not None:
            raise DesignError(
                f"{place} is the first row of {row.name} but has no {missing}; add it"
            )
        table = {"name": row.name, "centres": [[row.x, row.y]], "mouth": [row.mouth_x, row.mouth_y]}
        chambers[row.name] = without_none({**table, "angle": row.angle, "width": row.width})
    return list(chambers.values())


# Layers of polygons saved by foldable_robotics.
#
# A laminate of foldable_robotics is an object with ``layers``, bottom to top, each with ``geoms``
# in well-known text (WKT), as JSON or YAML. Films, roles and units come from the tables.


SUFFIXES = (".json", ".yaml", ".yml")
MOST_OF_POLYGONS = 20_000_000
LAMINATE_TAGS = ("!Laminate", "!Layer")
"""YAML tags of foldable_robotics' objects; they are read as plain objects."""


def polygon_layer(path: Path, layer: str) -> Region:
    """Return the polygons of a layer, counted from 1 at the bottom, with 1 mm per unit.

    Raises DesignError with the file, the layer and the unreadable geometry.
    """
    layers = _geometries(path, read_text(path, MOST_OF_POLYGONS))
    geoms = layers[layer_index(path, layer, len(layers))]
    region = union(p for i, geom in enumerate(geoms, 1) for p in _parts(path, layer, i, geom))
    if region.is_empty:
        raise DesignError(f"{path}, layer {layer} has no polygon; omit its row")
    return region


def refuse_polygons(path: Path) -> NoReturn:
    """Refuse a laminate of polygons that is imported without a table of its layers."""
    count = len(_geometries(path, read_text(path, MOST_OF_POLYGONS)))
    refuse_without_table(path, f"{count} layers of polygons", "NUMBER")


@lru_cache(maxsize=4)
def _geometries(path: Path, text: str) -> list[list[str]]:
    """Return the geometries of every layer, as text. Raises DesignError."""
    document = _document(path, text)
    rows = document.get("layers") if isinstance(document, dict) else None
    if not isinstance(rows, list) or not rows:
        raise DesignError(f"{path} has no list of layers; export the laminate again")
    layers = []
    for number, row in enumerate(rows, 1):
        geoms = row.get("geoms") if isinstance(row, dict) else None
        if not isinstance(geoms, list) or not all(isinstance(geom, str) for geom in geoms):
            raise DesignError(f"{path}, layer {number} has no list of geoms as text (WKT)")
        layers.append(geoms)
    return layers


def _document(path: Path, text: str) -> Any:
    if path.suffix.lower() == ".json":
        return json_of(path, text)
    return read_yaml(path, text, "plain values", _plain_loader)


def _plain_loader(yaml: Any) -> Any:
    """A loader that reads objects of foldable_robotics as plain ones and creates no others."""
    loader: Any = type("Loader", (yaml.SafeLoader,), {})
    for tag in LAMINATE_TAGS:
        loader.add_constructor(tag, lambda made, node: made.construct_mapping(node, deep=True))
    return loader


def _parts(path: Path, layer: str, number: int, text: str) -> Iterator[Region]:
    import shapely
    from shapely.errors import ShapelyError

    where = f"{path}, layer {layer}, geometry {number}"
    try:
        geometry = shapely.from_wkt(text)
    except ShapelyError:
        raise DesignError(f"{where} is {shown(text)}, which is not valid WKT") from None
    if not shapely.is_valid(geometry):
        reason = shapely.is_valid_reason(geometry)
        raise DesignError(f"{where}: {reason}; repair it, for instance with buffer(0)")
    for piece in getattr(geometry, "geoms", [geometry]):
        if piece.geom_type != "Polygon":
            x, y, *_ = piece.bounds if not piece.is_empty else (0.0, 0.0)
            raise DesignError(
                f"{where} has a {piece.geom_type} at x {x:g}, y {y:g}, but a layer needs "
                "polygons; convert or omit it"
            )
        if not piece.is_empty:
            yield region_of(piece)
