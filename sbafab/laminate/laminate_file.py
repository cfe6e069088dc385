"""``laminate.json``: a laminate with exact edges, to be read by other programs and read back here.

Films and shapes stand once each; layers name them by their place in the lists, from 0.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, Line
from sbafab.geometry.region import Region
from sbafab.laminate.films import Film
from sbafab.laminate.joints import FaceBond, Fold, Net, Port, Seam
from sbafab.laminate.laminate import (
    Bore,
    Chamber,
    Inlet,
    Laminate,
    Layer,
    Pin,
)
from sbafab.laminate.laminate_validator import FIELDS, SCHEMA, completed, faults

FILE = "laminate.json"


def laminate_json(laminate: Laminate) -> str:
    """Return the contents of ``laminate.json``: a row a line."""
    lines = (f"{json.dumps(key)}: {_rows(value)}" for key, value in _document(laminate).items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def read_laminate(path: Path) -> Laminate:
    """Return the laminate of a ``laminate.json``, equal to the one that was written.

    Keys that the format does not know are passed over. Raises DesignError, which names the file and
    the place in it, for what is no such file.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DesignError(f"{path} cannot be read as a laminate: {error}") from error
    fault = next(faults(document), None)
    if fault is not None:
        raise DesignError(f"{path} is not a sound laminate; {fault}")
    return _laminate(completed(document))


# Out.


class _Places:
    """Values that stand once each in a list, and their places in it."""

    def __init__(self) -> None:
        self.values: list[Any] = []
        self._places: dict[str, int] = {}

    def of(self, value: Any) -> int:
        """The place of a value, told apart by its text in the file."""
        text = json.dumps(value)
        if text not in self._places:
            self._places[text] = len(self.values)
            self.values.append(value)
        return self._places[text]


def _document(laminate: Laminate) -> dict[str, Any]:
    films, shapes = _Places(), _Places()
    # Many layers share one profile, which is turned into rows once.
    rows: dict[int, int] = {}

    def shape(region: Region) -> int:
        if id(region) not in rows:
            rows[id(region)] = shapes.of(_shape_rows(region))
        return rows[id(region)]

    layers = [
        {
            "index": layer.index,
            "role": layer.role,
            "film": films.of(asdict(layer.film)),
            "shape": shape(layer.profile),
            "balloon": layer.balloon,
            "z": layer.z,
            "pieces": layer.pieces,
            "pattern": layer.pattern,
            "turned": layer.turned,
        }
        for layer in laminate.layers
    ]
    outline = shape(laminate.outline)
    return {
        "schema": SCHEMA,
        "name": laminate.name,
        "family": laminate.family,
        "registration": laminate.registration,
        "balloons": laminate.balloons,
        "lumen": laminate.lumen,
        "tube": laminate.tube,
        "pins_in_full_bonds": laminate.pins_in_full_bonds,
        "middle_first": laminate.middle_first,
        "notes": laminate.notes,
        "films": films.values,
        "layers": layers,
        "chambers": [asdict(chamber) for chamber in laminate.chambers],
        "bores": [asdict(bore) for bore in laminate.bores],
        "inlets": [asdict(inlet) for inlet in laminate.inlets],
        "pins": [asdict(pin) for pin in laminate.pins],
        "seams": [
            {**asdict(seam), "path": [[*map(_edge_row, chain)] for chain in seam.path]}
            for seam in laminate.seams
        ],
        "folds": [asdict(fold) for fold in laminate.folds],
        "ports": [asdict(port) for port in laminate.ports],
        "nets": [asdict(net) for net in laminate.nets],
        "bonds": [asdict(bond) for bond in laminate.bonds],
        "outline": outline,
        "shapes": shapes.values,
    }


def _shape_rows(region: Region) -> list[list[list[float | bool]]]:
    return [[_edge_row(edge) for edge in contour.edges] for contour in region.contours]


def _edge_row(edge: Edge) -> list[float | bool]:
    # A contour drawn with whole numbers, which compares equal, is written like any other.
    ends = [*map(float, (*edge.start, *edge.end))]
    if isinstance(edge, Line):
        return [*ends]
    return [*ends, *map(float, edge.centre), float(edge.radius), edge.ccw]


def _rows(value: Any) -> str:
    if not isinstance(value, list) or not value:
        return json.dumps(value)
    return "[\n " + ",\n ".join(map(json.dumps, value)) + "\n]"


# In.


def _laminate(document: dict[str, Any]) -> Laminate:
    rows = {
        key: [{name: row[name] for name in fields} for row in document[key]]
        for key, fields in FIELDS.items()
    }
    films = [
        Film(**_with_points({**row, "faces": row["faces"] and tuple(row["faces"])}))
        for row in rows["films"]
    ]
    shapes = [_region(shape) for shape in document["shapes"]]
    layers = []
    for row in rows["layers"]:
        film, profile = films[row.pop("film")], shapes[row.pop("shape")]
        layers.append(Layer(film=film, profile=profile, **row))
    return Laminate(
        name=document["name"],
        family=document["family"],
        layers=tuple(layers),
        chambers=tuple(
            Chamber(row["name"], tuple(map(_point, row["centres"])), tuple(row["balloons"]))
            for row in rows["chambers"]
        ),
        bores=tuple(Bore(**_with_points(row)) for row in rows["bores"]),
        inlets=tuple(Inlet(**_with_points(row)) for row in rows["inlets"]),
        pins=tuple(Pin(**_with_points(row)) for row in rows["pins"]),
        lumen=document["lumen"],
        balloons=document["balloons"],
        registration=document["registration"],
        notes=tuple(document["notes"]),
        outline=shapes[document["outline"]],
        pins_in_full_bonds=document["pins_in_full_bonds"],
        middle_first=document["middle_first"],
        tube=document["tube"],
        seams=tuple(
            Seam(**{**row, "path": tuple(tuple(map(_edge, chain)) for chain in row["path"])})
            for row in rows["seams"]
        ),
        folds=tuple(
            Fold(row["lower"], row["upper"], (_point(row["line"][0]), _point(row["line"][1])))
            for row in rows["folds"]
        ),
        ports=tuple(Port(**_with_points(row)) for row in rows["ports"]),
        nets=tuple(Net(row["name"], tuple(row["ports"])) for row in rows["nets"]),
        bonds=tuple(
            FaceBond(**{**row, "faces": (row["faces"][0], row["faces"][1])})
            for row in rows["bonds"]
        ),
    )


def _region(rows: Iterable[Iterable[list[Any]]]) -> Region:
    return Region(tuple(Contour(tuple(map(_edge, contour))) for contour in rows))


def _edge(row: list[Any]) -> Edge:
    start, end = _point(row[:2]), _point(row[2:4])
    return Line(start, end) if len(row) == 4 else Arc(start, end, _point(row[4:6]), row[6], row[7])


def _point(row: list[float]) -> tuple[float, float]:
    return row[0], row[1]


def _with_points(row: dict[str, Any]) -> dict[str, Any]:
    return {key: _point(value) if isinstance(value, list) else value for key, value in row.items()}
