"""Read layers of polygons saved by foldable_robotics.

A laminate of foldable_robotics is an object with ``layers``, bottom to top, each with ``geoms`` in
well-known text (WKT), as JSON or YAML. Films, roles and units come from a separate table.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.design.files import shown
from sbafab.errors import DesignError
from sbafab.geometry.region import Region, polygon, union
from sbafab.importing.records import not_json, read_text, yaml_of

if TYPE_CHECKING:
    import shapely

SUFFIXES = (".json", ".yaml", ".yml")
MOST_BYTES = 20_000_000
LAMINATE_TAGS = ("!Laminate", "!Layer")
"""YAML tags of foldable_robotics' objects; they are read as plain objects."""


def polygon_layer(path: Path, layer: str) -> Region:
    """Return the polygons of a layer, counted from 1 at the bottom, with 1 mm per unit.

    Raises DesignError with the file, the layer and the unreadable geometry.
    """
    layers = polygon_layers(path)
    if not layer.isdecimal() or not 1 <= int(layer) <= len(layers):
        raise DesignError(
            f"{path} has no layer {shown(layer)}; its layers are 1 to {len(layers)}, bottom to top"
        )
    geoms = layers[int(layer) - 1]
    parts = [part for i, geom in enumerate(geoms, 1) for part in _parts(path, layer, i, geom)]
    region = union(parts)
    if region.is_empty:
        raise DesignError(f"{path}, layer {layer} holds no polygon; leave its row out")
    return region


def polygon_layers(path: Path) -> list[list[str]]:
    """Return the geometries of every layer, as text. Raises DesignError."""
    return _layers(path, read_text(path, MOST_BYTES))


def refuse_without_table(path: Path, table: str) -> DesignError:
    """Return the error for a laminate of polygons imported without a table of its layers."""
    count = len(polygon_layers(path))
    return DesignError(
        f"{path} holds {count} layers of polygons and not what they are for; write {table} beside "
        f'it, with a row "{path.name},ROLE,NUMBER" a layer under "file,role,layer", and import the '
        "folder"
    )


@lru_cache(maxsize=4)
def _layers(path: Path, text: str) -> list[list[str]]:
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
        try:
            return json.loads(text)
        except (ValueError, RecursionError) as error:
            raise not_json(path, error) from None
    yaml = yaml_of(path)
    # Objects of foldable_robotics are read as plain ones; no others are created.
    loader: Any = type("Loader", (yaml.SafeLoader,), {})
    for tag in LAMINATE_TAGS:
        loader.add_constructor(tag, lambda made, node: made.construct_mapping(node, deep=True))
    try:
        return yaml.load(text, loader)
    except (yaml.YAMLError, RecursionError) as error:
        line = " ".join(str(error).split())
        raise DesignError(f"{path} is no YAML of plain values: {line}; save it again") from None


def _parts(path: Path, layer: str, number: int, text: str) -> Iterator[Region]:
    import shapely
    from shapely.errors import ShapelyError

    where = f"{path}, layer {layer}, geometry {number}"
    try:
        geometry = shapely.from_wkt(text)
    except ShapelyError:
        raise DesignError(f"{where} is {shown(text)}, which is no WKT") from None
    if not shapely.is_valid(geometry):
        reason = shapely.is_valid_reason(geometry)
        raise DesignError(f"{where}: {reason}; repair it, for instance with buffer(0)")
    for piece in getattr(geometry, "geoms", [geometry]):
        if piece.geom_type != "Polygon":
            x, y, *_ = piece.bounds if not piece.is_empty else (0.0, 0.0)
            raise DesignError(
                f"{where} holds a {piece.geom_type} at x {x:g}, y {y:g}, and a layer is cut from "
                "polygons; make it one, or leave it out"
            )
        if not piece.is_empty:
            yield _ring(piece.exterior) - union(map(_ring, piece.interiors))


def _ring(ring: shapely.LinearRing) -> Region:
    return polygon([(float(x), float(y)) for x, y, *_ in ring.coords[:-1]])
