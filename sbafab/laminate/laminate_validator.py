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
_COUNTS, _PAIR, _PATH = "counts", "pair of texts", "path"
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
        "faces": "pair of texts?",
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
        "turned": _YES,
    },
    "chambers": {"name": _TEXT, "centres": _POINTS, "balloons": _COUNTS},
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
    "seams": {
        "name": _TEXT,
        "below": _COUNT,
        "above": _COUNT,
        "path": _PATH,
        "width": _SIZE,
        "tool": _TEXT,
        "kind": _TEXT,
        "order": _COUNT,
    },
    "folds": {"lower": _COUNT, "upper": _COUNT, "line": _POINTS},
    "ports": {
        "name": _TEXT,
        "below": _COUNT,
        "above": _COUNT,
        "at": _POINT,
        "kind": _TEXT,
        "tube_diameter": "size?",
    },
    "nets": {"name": _TEXT, "ports": _TEXTS},
    "bonds": {
        "name": _TEXT,
        "faces": _PAIR,
        "by": _TEXT,
        "temperature_c": "number?",
        "after": "text?",
    },
}
"""Of each list of objects: its keys and what stands there; ``?`` where it may be null."""
LATER: Mapping[str, Mapping[str, Any]] = {
    "": {
        "seams": [],
        "folds": [],
        "ports": [],
        "nets": [],
        "bonds": [],
        "middle_first": False,
    },
    "films": {"faces": None},
    "layers": {"turned": False},
    "chambers": {"balloons": []},
    "ports": {"kind": "place", "tube_diameter": None},
}
"""Keys that files of earlier versions lack, and what holds there."""
TOOLS = ("laser", "hot-tip", "ultrasonic", "roller")
SEAM_KINDS = ("lap", "fin")
HEAD: Mapping[str, str] = {
    "name": _TEXT,
    "family": _TEXT,
    "registration": _TEXT,
    "balloons": _INDEX,
    "lumen": "size?",
    "tube": "size?",
    "pins_in_full_bonds": _YES,
    "middle_first": _YES,
    "notes": _TEXTS,
    "outline": _INDEX,
}


def completed(document: dict[str, Any]) -> dict[str, Any]:
    """Return the document with the keys that files of earlier versions lack."""
    whole = {**LATER[""], **document}
    for key, values in LATER.items():
        rows = whole.get(key)
        if isinstance(rows, list):
            whole[key] = [{**values, **row} if isinstance(row, dict) else row for row in rows]
    return whole


def faults(document: Any) -> Iterator[str]:
    """Yield the faults of a parsed ``laminate.json``, each with its place; none if it is sound.

    Geometry and references are looked at once every key holds what belongs there.
    """
    if not isinstance(document, dict):
        yield "the file: is not an object"
        return
    document = completed(document)
    shape_faults = list(_forms(document))
    yield from shape_faults
    if not shape_faults:
        yield from _shapes(document["shapes"])
        yield from _references(document)
        yield from _joints(document)


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
    _COUNTS: lambda value: _is_list_of(value, _COUNT),
    _PAIR: lambda value: _is_list_of(value, _TEXT) and len(value) == 2,
    _PATH: lambda value: (
        isinstance(value, list)
        and all(isinstance(c, list) and c and all(map(_is_edge, c)) for c in value)
    ),
}


def _is_edge(edge: Any) -> bool:
    if not isinstance(edge, list) or len(edge) not in (4, 8):
        return False
    return all(map(_is_number, edge[:7])) and (len(edge) == 4 or isinstance(edge[7], bool))


def _shapes(shapes: list[list[list[list[Any]]]]) -> Iterator[str]:
    for i, shape in enumerate(shapes):
        for j, contour in enumerate(shape):
            yield from _chain(f"shapes[{i}][{j}]", contour, is_closed=True)
        edges = [
            (f"[{j}][{k}]", edge)
            for j, contour in enumerate(shape)
            for k, edge in enumerate(contour)
        ]
        crossing = _crossing(edges)
        if crossing is not None:
            (a, b), (x, y) = crossing
            yield f"shapes[{i}]{a}: crosses {b} at x {x:.4f}, y {y:.4f}"


def _chain(where: str, edges: list[list[Any]], is_closed: bool) -> Iterator[str]:
    for k, edge in enumerate(edges):
        if (k or is_closed) and math.dist(edges[k - 1][2:4], edge[:2]) > JOINED:
            yield f"{where}[{k}]: does not begin where the edge before it ends"
        if len(edge) == 8:
            radius = edge[6]
            ends = (math.dist(edge[4:6], edge[at : at + 2]) for at in (0, 2))
            if radius <= 0 or any(abs(end - radius) > JOINED for end in ends):
                yield f"{where}[{k}]: the arc's ends do not lie on its circle"


# Edges that cross, in a sweep along x. Edges that only touch, or share an end, do not cross.


_Place = tuple[float, float]


def _crossing(edges: list[tuple[str, list[Any]]]) -> tuple[tuple[str, str], _Place] | None:
    """Return the names of two edges that cross, and where; None if no two do."""
    rows = sorted((_box(edge), name, edge) for name, edge in edges)
    open_rows: list[tuple[tuple[float, ...], str, list[Any]]] = []
    for box, name, edge in rows:
        open_rows = [row for row in open_rows if row[0][1] > box[0]]
        for other, other_name, other_edge in open_rows:
            if other[2] < box[3] and box[2] < other[3]:
                for p in _common(edge, other_edge):
                    if _is_crossed(edge, other_edge, p):
                        return (other_name, name), p
        open_rows.append((box, name, edge))
    return None


def _box(edge: list[Any]) -> tuple[float, float, float, float]:
    """Least and largest x, least and largest y."""
    places = [tuple(edge[:2]), tuple(edge[2:4])]
    if len(edge) == 8:
        x, y, r = edge[4:7]
        ways = ((x + r, y), (x, y + r), (x - r, y), (x, y - r))
        places += [p for p in ways if _is_on(edge, p)]
    xs, ys = zip(*places, strict=True)
    return min(xs), max(xs), min(ys), max(ys)


def _is_on(edge: list[Any], p: _Place) -> bool:
    """Return True if a point of the edge's line or circle lies between its ends."""
    (x0, y0), (x1, y1) = edge[:2], edge[2:4]
    if len(edge) == 4:
        along = (p[0] - x0) * (x1 - x0) + (p[1] - y0) * (y1 - y0)
        return bool(0 <= along <= (x1 - x0) ** 2 + (y1 - y0) ** 2)
    x, y, _, ccw = edge[4:]
    start, end, here = (math.atan2(q[1] - y, q[0] - x) for q in ((x0, y0), (x1, y1), p))
    if not ccw:
        start, end = end, start
    return (here - start) % math.tau <= ((end - start) % math.tau or math.tau)


def _common(a: list[Any], b: list[Any]) -> Iterator[_Place]:
    """Yield the points that the lines or circles of two edges share."""
    if len(a) == 4 and len(b) == 8:
        a, b = b, a
    if len(a) == 4:
        (x, y), (u, v) = a[:2], (a[2] - a[0], a[3] - a[1])
        (p, q), (r, s) = b[:2], (b[2] - b[0], b[3] - b[1])
        cross = u * s - v * r
        if cross:
            t = ((p - x) * s - (q - y) * r) / cross
            yield x + t * u, y + t * v
        return
    x, y, radius = a[4:7]
    if len(b) == 4:
        length = math.dist(b[:2], b[2:4])
        if not length:
            return
        u, v = (b[2] - b[0]) / length, (b[3] - b[1]) / length
        along = (x - b[0]) * u + (y - b[1]) * v
        foot = b[0] + along * u, b[1] + along * v
    else:
        gap = math.dist(b[4:6], (x, y))
        if not gap:
            return
        u, v = -(b[5] - y) / gap, (b[4] - x) / gap
        along = (gap * gap + radius * radius - b[6] * b[6]) / (2 * gap)
        foot = x + v * along, y - u * along
    rest = radius * radius - math.dist(foot, (x, y)) ** 2
    if rest > 0:
        half = math.sqrt(rest)
        yield foot[0] + half * u, foot[1] + half * v
        yield foot[0] - half * u, foot[1] - half * v


def _is_crossed(a: list[Any], b: list[Any], p: _Place) -> bool:
    """Return True if both edges pass through a point, at an angle and away from their ends."""
    ways = []
    for edge in (a, b):
        is_at_end = any(math.dist(p, edge[at : at + 2]) < JOINED for at in (0, 2))
        if is_at_end or not _is_on(edge, p):
            return False
        way = (edge[2] - edge[0], edge[3] - edge[1])
        if len(edge) == 8:
            way = (edge[5] - p[1], p[0] - edge[4])
        ways.append((way[0] / math.hypot(*way), way[1] / math.hypot(*way)))
    (u, v), (r, s) = ways
    return bool(abs(u * s - v * r) > 1e-3)


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
    used = {"outline": document["outline"]}
    used |= {f"layers[{i}].shape": row["shape"] for i, row in enumerate(document["layers"])}
    for where, shape in used.items():
        if shape >= len(document["shapes"]):
            yield f"{where}: there is no shape {shape}"


def _joints(document: dict[str, Any]) -> Iterator[str]:
    """Yield the faults of seams, folds, ports, nets and bonds."""
    count = len(document["layers"])
    for key, ends in (("seams", ("below", "above")), ("folds", ("lower", "upper"))):
        for i, row in enumerate(document[key]):
            yield from _pair(f"{key}[{i}]", [row[end] for end in ends], count)
    for i, row in enumerate(document["ports"]):
        yield from _pair(f"ports[{i}]", [row["below"], row["above"]], count)
    yield from _seams(document["seams"])
    for i, row in enumerate(document["folds"]):
        if len(row["line"]) != 2 or row["line"][0] == row["line"][1]:
            yield f"folds[{i}].line: is not two points apart from each other"
    for i, row in enumerate(document["bonds"]):
        if row["by"] not in ("press", *TOOLS):
            yield f"bonds[{i}].by: is none of press, {', '.join(TOOLS)}"
    ports = {row["name"] for key in ("ports", "chambers") for row in document[key]}
    for i, row in enumerate(document["nets"]):
        for name in row["ports"]:
            if name not in ports:
                yield f"nets[{i}].ports: there is no port or chamber {json.dumps(name)}"


def _seams(rows: list[dict[str, Any]]) -> Iterator[str]:
    for i, row in enumerate(rows):
        for key, known in (("tool", TOOLS), ("kind", SEAM_KINDS)):
            if row[key] not in known:
                yield f"seams[{i}].{key}: is none of {', '.join(known)}"
        for j, chain in enumerate(row["path"]):
            yield from _chain(f"seams[{i}].path[{j}]", chain, is_closed=False)


def _pair(where: str, layers: list[int], count: int) -> Iterator[str]:
    if not 1 <= layers[0] < layers[1] <= count:
        yield f"{where}: lies between layers {layers[0]} and {layers[1]} of {count}"


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
