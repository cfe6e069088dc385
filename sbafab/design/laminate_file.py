"""``laminate.json``: a laminate with exact edges, for other programs and for reading back.

Films and shapes are listed once each; layers refer to them by index, from 0. ``LaminateDocument``
is the format: its JSON schema is published, and files are read with it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from sbafab.design.files import sentence
from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Edge, Line, Point, meeting_points
from sbafab.geometry.region import Region
from sbafab.geometry.spatial_index import close_pairs
from sbafab.laminate.films import Film
from sbafab.laminate.joints import FaceBond, Fold, Net, Port, Seam, SeamKind, SeamTool
from sbafab.laminate.laminate import Bore, Chamber, Inlet, Laminate, Layer, Pin, Role

FILE = "laminate.json"
SCHEMA = "sbafab/laminate@1"
JOINED = 1e-5
"""Tolerance for the continuity of edges, and for an arc's ends on its circle, mm."""
PARALLEL = 1e-3
"""Sine of the angle below which two edges touch instead of crossing."""


# The format.


Index = Annotated[int, Field(ge=0)]
FromOne = Annotated[int, Field(ge=1)]
PositiveLength = Annotated[float, Field(gt=0)]
EdgeNumber = Annotated[float, Field(gt=-1e9, lt=1e9)]
LineRow = Annotated[
    tuple[EdgeNumber, EdgeNumber, EdgeNumber, EdgeNumber],
    Field(description="start x, y, end x, y"),
]
ArcRow = Annotated[
    tuple[EdgeNumber, EdgeNumber, EdgeNumber, EdgeNumber, EdgeNumber, EdgeNumber, EdgeNumber, bool],
    Field(description="start x, y, end x, y, centre x, y, radius; true: counter-clockwise"),
]


EdgeRow = Annotated[
    Annotated[LineRow, Tag("line")] | Annotated[ArcRow, Tag("arc")],
    Discriminator(lambda row: "line" if isinstance(row, list | tuple) and len(row) == 4 else "arc"),
]
EdgeRows = Annotated[tuple[EdgeRow, ...], Field(min_length=1)]
ShapeIndex = Annotated[Index, Field(description="place in shapes, from 0")]


class _Row(BaseModel):
    model_config = ConfigDict(
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        defer_build=True,
        json_schema_serialization_defaults_required=True,
    )


class LayerRow(_Row):
    """A layer of a ``laminate.json``; its film and shape by index."""

    index: FromOne
    role: Role
    film: Annotated[Index, Field(description="place in films, from 0")]
    shape: ShapeIndex
    balloon: FromOne | None
    z: float
    pieces: FromOne
    pattern: str
    turned: bool = False


class SeamRow(_Row):
    """A seam of a ``laminate.json``."""

    name: str
    below: FromOne
    above: FromOne
    path: Annotated[tuple[EdgeRows, ...], Field(description="chains, open or closed")]
    width: PositiveLength
    tool: SeamTool
    kind: SeamKind
    order: FromOne


class LaminateDocument(_Row):
    """A ``laminate.json``. Files of earlier versions lack keys that have defaults here."""

    schema_id: Annotated[Literal["sbafab/laminate@1"], Field(alias="schema")]
    name: str
    family: str
    registration: str
    balloons: Index
    lumen: PositiveLength | None
    tube: PositiveLength | None
    pins_in_full_bonds: bool
    middle_first: bool = False
    notes: tuple[str, ...]
    films: tuple[Film, ...]
    layers: Annotated[tuple[LayerRow, ...], Field(min_length=1, description="bottom to top")]
    chambers: Annotated[tuple[Chamber, ...], Field(description="void nets, each with one inlet")]
    bores: tuple[Bore, ...]
    inlets: tuple[Inlet, ...]
    pins: tuple[Pin, ...]
    seams: tuple[SeamRow, ...] = ()
    folds: tuple[Fold, ...] = ()
    ports: tuple[Port, ...] = ()
    nets: tuple[Net, ...] = ()
    bonds: tuple[FaceBond, ...] = ()
    outline: ShapeIndex
    shapes: Annotated[
        tuple[tuple[EdgeRows, ...], ...],
        Field(description="mm, the actuator's axis at 0, 0; closed contours, holes run clockwise"),
    ]


# Out.


def laminate_json(laminate: Laminate) -> str:
    """Return the contents of ``laminate.json``, one row per line."""
    lines = (f"{json.dumps(key)}: {_rows(value)}" for key, value in _document(laminate).items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _document(laminate: Laminate) -> dict[str, Any]:
    # Values that are equal in the file are listed once, by their text.
    films: dict[str, Any] = {}
    shapes: dict[str, Any] = {}
    # Many layers share one profile, which is converted to rows once.
    rows: dict[int, int] = {}

    def place(values: dict[str, Any], value: Any) -> int:
        text = json.dumps(value)
        values.setdefault(text, value)
        return [*values].index(text)

    def shape(region: Region) -> int:
        if id(region) not in rows:
            contours = [[_edge_row(edge) for edge in c.edges] for c in region.contours]
            rows[id(region)] = place(shapes, contours)
        return rows[id(region)]

    layers = [
        {name: getattr(layer, name, None) for name in LayerRow.model_fields}
        | {"film": place(films, asdict(layer.film)), "shape": shape(layer.profile)}
        for layer in laminate.layers
    ]
    outline = shape(laminate.outline)
    converted = {
        "schema_id": SCHEMA,
        "films": [*films.values()],
        "layers": layers,
        "seams": [
            {**asdict(seam), "path": [[*map(_edge_row, chain)] for chain in seam.path]}
            for seam in laminate.seams
        ],
        "outline": outline,
        "shapes": [*shapes.values()],
    }
    return {
        info.alias or name: converted[name]
        if name in converted
        else _plain(getattr(laminate, name))
        for name, info in LaminateDocument.model_fields.items()
    }


def _plain(value: Any) -> Any:
    """Return records as tables of their values."""
    is_rows = isinstance(value, tuple) and all(map(is_dataclass, value))
    return [asdict(row) for row in value] if is_rows else value


def _edge_row(edge: Edge) -> list[float | bool]:
    # An equal contour drawn with whole numbers is written like any other.
    ends = [*map(float, (*edge.start, *edge.end))]
    if isinstance(edge, Line):
        return [*ends]
    return [*ends, *map(float, edge.centre), float(edge.radius), edge.ccw]


def _rows(value: Any) -> str:
    if not isinstance(value, list) or not value:
        return json.dumps(value)
    return "[\n " + ",\n ".join(map(json.dumps, value)) + "\n]"


# In.


def read_laminate(path: str | Path) -> Laminate:
    """Return the laminate of a ``laminate.json``, equal to the written one.

    Unknown keys are ignored. Raises DesignError with the file and the place in it for invalid
    files.
    """
    try:
        document = LaminateDocument.model_validate_json(Path(path).read_bytes())
    except OSError as error:
        raise DesignError(f"{path} cannot be read as a laminate: {error}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if first["type"] == "json_invalid":
            reason = first["ctx"]["error"]
            raise DesignError(f"{path} cannot be read as a laminate: {reason}") from None
        is_object = bool(first["loc"])
        words = (
            sentence(error, LaminateDocument, {}, "", FILE) if is_object else "it is not an object"
        )
        raise DesignError(f"{path} is not a valid laminate; {words}") from None
    fault = next(_faults(document), None)
    if fault is not None:
        raise DesignError(f"{path} is not a valid laminate; {fault}")
    return _laminate(document)


def _laminate(document: LaminateDocument) -> Laminate:
    shapes = [
        Region(tuple(Contour(_edges(contour)) for contour in shape)) for shape in document.shapes
    ]
    converted: dict[str, Any] = {
        "layers": tuple(
            Layer(
                film=document.films[row.film],
                profile=shapes[row.shape],
                **row.model_dump(exclude={"film", "shape"}),
            )
            for row in document.layers
        ),
        "outline": shapes[document.outline],
        "seams": tuple(
            Seam(path=tuple(map(_edges, row.path)), **row.model_dump(exclude={"path"}))
            for row in document.seams
        ),
    }
    plain = LaminateDocument.model_fields.keys() - {"schema_id", "films", "shapes", *converted}
    return Laminate(**{name: getattr(document, name) for name in plain}, **converted)


def _edges(rows: Iterable[Sequence[Any]]) -> tuple[Edge, ...]:
    return tuple(map(_edge, rows))


def _edge(row: Sequence[Any]) -> Edge:
    start, end = (row[0], row[1]), (row[2], row[3])
    return Line(start, end) if len(row) == 4 else Arc(start, end, (row[4], row[5]), row[6], row[7])


# Faults that no schema detects: sizes, references, heights and geometry.


SIZES = {
    "films": ("thickness",),
    "bores": ("diameter",),
    "inlets": ("width", "length", "tube_diameter"),
    "pins": ("diameter",),
}
"""Values that must be above 0, by list."""


def _faults(document: LaminateDocument) -> Iterator[str]:
    """Yield the faults of a document that matches the schema, each with its place."""
    for key, names in SIZES.items():
        for i, row in enumerate(getattr(document, key)):
            for name in names:
                if getattr(row, name) <= 0:
                    yield f"{key}[{i}].{name}: is not above 0"
    for i, shape in enumerate(document.shapes):
        for j, contour in enumerate(shape):
            yield from _chain_faults(f"shapes[{i}][{j}]", contour, is_closed=True)
        p = _crossing([edge for contour in shape for edge in _edges(contour)])
        if p is not None:
            yield f"shapes[{i}]: its edges cross at x {p[0]:.4f}, y {p[1]:.4f}"
    for i, seam in enumerate(document.seams):
        for j, chain in enumerate(seam.path):
            yield from _chain_faults(f"seams[{i}].path[{j}]", chain, is_closed=False)
    for where, name, noun, known in _references(document):
        if name not in known:
            yield f"{where}: there is no {noun} {json.dumps(name)}"
    yield from _layer_faults(document)


def _chain_faults(where: str, rows: Sequence[Any], is_closed: bool) -> Iterator[str]:
    for k, row in enumerate(rows):
        if (k or is_closed) and math.dist(rows[k - 1][2:4], row[:2]) > JOINED:
            yield f"{where}[{k}]: does not begin where the edge before it ends"
        if len(row) == 8:
            radius = row[6]
            ends = (math.dist(row[4:6], row[at : at + 2]) for at in (0, 2))
            if radius <= 0 or any(abs(end - radius) > JOINED for end in ends):
                yield f"{where}[{k}]: the arc's ends do not lie on its circle"


def _crossing(edges: Sequence[Edge]) -> Point | None:
    """Return the point where two edges cross, away from their ends; None if there is none."""
    for i, j in close_pairs([edge.bounds for edge in edges], 0.0):
        a, b = edges[i], edges[j]
        for p in meeting_points(a, b):
            is_end = min(math.dist(p, q) for q in (a.start, a.end, b.start, b.end)) < JOINED
            (u, v), (r, s) = a.direction(p), b.direction(p)
            if not is_end and abs(u * s - v * r) > PARALLEL:
                return p
    return None


def _references(document: LaminateDocument) -> Iterator[tuple[str, Any, str, Collection[Any]]]:
    """Yield the place of each name or index, itself, what it names, and all there are of that."""
    chambers = [chamber.name for chamber in document.chambers]
    ports = [*chambers, *(port.name for port in document.ports)]
    films, shapes = range(len(document.films)), range(len(document.shapes))
    for key in ("bores", "inlets"):
        for i, row in enumerate(getattr(document, key)):
            yield f"{key}[{i}].chamber", row.chamber, "chamber", chambers
    yield "outline", document.outline, "shape", shapes
    for i, layer in enumerate(document.layers):
        yield f"layers[{i}].film", layer.film, "film", films
        yield f"layers[{i}].shape", layer.shape, "shape", shapes
    for i, net in enumerate(document.nets):
        yield from ((f"nets[{i}].ports", name, "port or chamber", ports) for name in net.ports)


def _layer_faults(document: LaminateDocument) -> Iterator[str]:
    """Yield layers out of order, of another film than their role's or at another height, and joints
    that are not between two of them.
    """
    z = 0.0
    for i, layer in enumerate(document.layers):
        where, film = f"layers[{i}]", document.films[layer.film]
        if layer.index != i + 1:
            yield f"{where}.index: is {layer.index}; the layers count from 1 at the bottom"
        if layer.role.endswith("mask") != film.is_mask:
            yield f"{where}.role: a {layer.role} cannot be of {film.material}"
        if abs(layer.z - z) > JOINED:
            yield f"{where}.z: is {layer.z:g} mm; the films below it are {z:g} mm thick"
        z = layer.z + film.thickness
    count = len(document.layers)
    for key, lower, upper in (
        ("seams", "below", "above"),
        ("folds", "lower", "upper"),
        ("ports", "below", "above"),
    ):
        for i, row in enumerate(getattr(document, key)):
            below, above = getattr(row, lower), getattr(row, upper)
            if not 1 <= below < above <= count:
                yield f"{key}[{i}]: lies between layers {below} and {above} of {count}"
    for i, fold in enumerate(document.folds):
        if fold.line[0] == fold.line[1]:
            yield f"folds[{i}].line: is not two points apart from each other"
