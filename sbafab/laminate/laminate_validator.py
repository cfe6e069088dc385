"""Does a ``laminate.json`` keep to its format? Standard library only: it imports nothing of sbafab.

Run as a program: ``python laminate_validator.py FILE``. It prints one line a fault, with its place
in the file, and ends with 1 if there are any, 2 if the file cannot be read.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

SCHEMA = "sbafab/laminate@1"
JOINED = 1e-5
"""mm within which an edge begins where the one before it ends, and an arc's ends on its circle."""

_TEXT, _NUMBER, _SIZE, _COUNT, _INDEX = "text", "number", "size", "count", "index"
_YES, _POINT, _POINTS, _TEXTS = "yes or no", "point", "points", "texts"
ROLES = ("base", "wall", "cap", "sheet", "chamber-mask", "separator-mask")

FIELDS: Mapping[str, Mapping[str, str]] = {
    "films": {
        "material": _TEXT,
        "product": _TEXT,
        "thickness": _SIZE,
        "density": "size?",
        "softens_above": "number?",
        "limit": _NUMBER,
        "kind": _TEXT,
        "shade": _INDEX,
        "warning": _TEXT,
        "elastic": "point?",
        "stays_solid": _YES,
    },
    "layers": {
        "index": _COUNT,
        "role": _TEXT,
        "film": _INDEX,
        "shape": _INDEX,
        "balloon": "count?",
        "z": _NUMBER,
        "pieces": _COUNT,
        "pattern": _TEXT,
    },
    "chambers": {"name": _TEXT, "centres": _POINTS},
    "bores": {"chamber": _TEXT, "centre": _POINT, "diameter": _SIZE},
    "inlets": {
        "chamber": _TEXT,
        "mouth": _POINT,
        "direction": _POINT,
        "width": _SIZE,
        "length": _SIZE,
        "tube_diameter": _SIZE,
    },
    "pins": {"name": _TEXT, "centre": _POINT, "diameter": _SIZE, "clearance": _NUMBER},
}
"""Of each list of objects: its keys and what stands there; ``?`` where it may be null."""
HEAD: Mapping[str, str] = {
    "name": _TEXT,
    "family": _TEXT,
    "registration": _TEXT,
    "balloons": _INDEX,
    "lumen": "size?",
    "tube": "size?",
    "pins_in_full_bonds": _YES,
    "notes": _TEXTS,
    "outline": _INDEX,
}
PANEL: Mapping[str, str] = {
    "outline": _INDEX,
    "places": _POINTS,
    "sheets": "indices",
    "second": _INDEX,
    "fiducials": _POINTS,
    "fiducial_diameter": _NUMBER,
    "window": _INDEX,
    "batches": _COUNT,
}


def faults(document: Any) -> Iterator[str]:
    """Yield the faults of a parsed ``laminate.json``, each with its place; none if it is sound.

    Geometry and references are looked at once every key holds what belongs there.
    """
    if not isinstance(document, dict):
        yield "the file: is not an object"
        return
    shape_faults = list(_forms(document))
    yield from shape_faults
    if not shape_faults:
        yield from _shapes(document["shapes"])
        yield from _references(document)


def _forms(document: dict[str, Any]) -> Iterator[str]:
    if document.get("schema") != SCHEMA:
        yield f'schema: is not "{SCHEMA}"'
    yield from _record("", document, HEAD)
    for key, fields in FIELDS.items():
        rows = document.get(key)
        if not isinstance(rows, list):
            yield f"{key}: is not a list"
            continue
        for place, row in enumerate(rows):
            yield from _record(f"{key}[{place}]", row, fields)
    if "panel" not in document:
        yield "panel: is missing"
    elif document["panel"] is not None:
        yield from _record("panel", document["panel"], PANEL)
    yield from _edges(document.get("shapes"))


def _edges(shapes: Any) -> Iterator[str]:
    if not isinstance(shapes, list):
        yield "shapes: is not a list"
        return
    for i, shape in enumerate(shapes):
        if not isinstance(shape, list) or not all(isinstance(c, list) and c for c in shape):
            yield f"shapes[{i}]: is not a list of contours, each a list of edges"
            continue
        for j, contour in enumerate(shape):
            for k, edge in enumerate(contour):
                if not _is_edge(edge):
                    yield (
                        f"shapes[{i}][{j}][{k}]: is neither a line of 4 numbers nor an arc of 7 "
                        "numbers and true or false"
                    )


def _record(place: str, row: Any, fields: Mapping[str, str]) -> Iterator[str]:
    if not isinstance(row, dict):
        yield f"{place}: is not an object"
        return
    for key, kind in fields.items():
        where = f"{place}.{key}" if place else key
        if key not in row:
            yield f"{where}: is missing"
        elif not _is(row[key], kind):
            yield f"{where}: {json.dumps(row[key])[:60]} is not a {kind.rstrip('?')}"


def _is(value: Any, kind: str) -> bool:
    if kind.endswith("?"):
        return value is None or _is(value, kind[:-1])
    return _KINDS[kind](value)


def _is_whole(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _is_list_of(value: Any, kind: str) -> bool:
    return isinstance(value, list) and all(_is(item, kind) for item in value)


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_real and abs(value) < 1e9


_KINDS: Mapping[str, Callable[[Any], bool]] = {
    _TEXT: lambda value: isinstance(value, str),
    _YES: lambda value: isinstance(value, bool),
    _NUMBER: _is_number,
    _SIZE: lambda value: _is_number(value) and value > 0,
    _COUNT: lambda value: _is_whole(value, 1),
    _INDEX: lambda value: _is_whole(value, 0),
    _POINT: lambda value: _is_list_of(value, _NUMBER) and len(value) == 2,
    _POINTS: lambda value: _is_list_of(value, _POINT),
    _TEXTS: lambda value: _is_list_of(value, _TEXT),
    "indices": lambda value: _is_list_of(value, _INDEX),
}


def _is_edge(edge: Any) -> bool:
    if not isinstance(edge, list) or len(edge) not in (4, 8):
        return False
    return all(map(_is_number, edge[:7])) and (len(edge) == 4 or isinstance(edge[7], bool))


def _shapes(shapes: list[list[list[list[Any]]]]) -> Iterator[str]:
    for i, shape in enumerate(shapes):
        for j, contour in enumerate(shape):
            for k, edge in enumerate(contour):
                where = f"shapes[{i}][{j}][{k}]"
                if math.dist(contour[k - 1][2:4], edge[:2]) > JOINED:
                    yield f"{where}: does not begin where the edge before it ends"
                if len(edge) == 8:
                    radius = edge[6]
                    ends = (math.dist(edge[4:6], edge[at : at + 2]) for at in (0, 2))
                    if radius <= 0 or any(abs(end - radius) > JOINED for end in ends):
                        yield f"{where}: the arc's ends do not lie on its circle"


def _references(document: dict[str, Any]) -> Iterator[str]:
    for i, film in enumerate(document["films"]):
        if film["kind"] not in ("structural", "mask"):
            yield f'films[{i}].kind: is neither "structural" nor "mask"'
    yield from _layers(document["layers"], document["films"])
    names = {chamber["name"] for chamber in document["chambers"]}
    for key in ("bores", "inlets"):
        for i, row in enumerate(document[key]):
            if row["chamber"] not in names:
                yield f"{key}[{i}].chamber: there is no chamber {json.dumps(row['chamber'])}"
    panel, layers = document["panel"], document["layers"]
    used = {"outline": document["outline"]}
    used |= {f"layers[{i}].shape": layer["shape"] for i, layer in enumerate(layers)}
    if panel is not None:
        used |= {f"panel.{key}": panel[key] for key in ("outline", "second", "window")}
        used |= {f"panel.sheets[{i}]": shape for i, shape in enumerate(panel["sheets"])}
        if len(panel["sheets"]) != len(layers):
            yield f"panel.sheets: {len(panel['sheets'])} sheets of {len(layers)} layers"
    for where, shape in used.items():
        if shape >= len(document["shapes"]):
            yield f"{where}: there is no shape {shape}"


def _layers(layers: list[dict[str, Any]], films: list[dict[str, Any]]) -> Iterator[str]:
    if not layers:
        yield "layers: is empty"
    z: float | None = 0.0
    for i, layer in enumerate(layers):
        where = f"layers[{i}]"
        if layer["index"] != i + 1:
            yield f"{where}.index: is {layer['index']}; the layers count from 1 at the bottom"
        if layer["role"] not in ROLES:
            yield f"{where}.role: is none of {', '.join(ROLES)}"
        if layer["film"] >= len(films):
            yield f"{where}.film: there is no film {layer['film']}"
            z = None
            continue
        film = films[layer["film"]]
        if layer["role"].endswith("mask") != (film["kind"] == "mask"):
            yield f"{where}.role: a {layer['role']} cannot be of {film['material']}"
        if z is not None and abs(layer["z"] - z) > JOINED:
            yield f"{where}.z: is {layer['z']:g} mm; the films below it are {z:g} mm thick"
        z = layer["z"] + film["thickness"]


def main(arguments: list[str]) -> int:
    """Print the faults of the named file; return 0 if there are none, 1 if any, 2 if unreadable."""
    if len(arguments) != 1:
        print("usage: python laminate_validator.py FILE", file=sys.stderr)
        return 2
    try:
        document = json.loads(Path(arguments[0]).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        print(f"{arguments[0]} cannot be read: {error}", file=sys.stderr)
        return 2
    lines = list(faults(document))
    for line in lines:
        print(line)
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
