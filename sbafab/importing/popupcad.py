"""Read layers of a popupCAD design (``.cad``) by running its operations on exact profiles.

The file is YAML with tags of Python objects, lengths in mm: layers with material and thickness,
sketches, operations that place sketches on layers and combine earlier results, and placed
subdesigns. Every object is read as a plain record; no object is created and no code is run. Circles
stay circles, and offsets have true arcs where popupCAD uses chords. An operation that is not in
``OPERATIONS`` is refused by its number and name, and so is every operation that depends on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from sbafab.design.files import read_text, shown
from sbafab.design.outline import crossing
from sbafab.errors import DesignError
from sbafab.geometry.edges import Line, Point, meeting_points
from sbafab.geometry.offset import grow, swept
from sbafab.geometry.region import Region, disc, polygon, union
from sbafab.importing.records import (
    MOST_NAMED,
    layer_index,
    read_yaml,
    refuse_without_table,
    region_of,
)

SUFFIX = ".cad"
MOST_BYTES = 20_000_000
FARTHEST = 100_000.0
"""Largest coordinate, mm."""
SAME = 1e-8
"""popupCAD merges two points of a shape within this distance, mm."""
DEEPEST = 10
"""Deepest nesting of designs within designs."""
PYTHON = "tag:yaml.org,2002:python/"
VERTICES = ("ShapeVertex", "DrawnPoint")
OLD_UNIT = 1000.0
"""Units per mm in the first form of vertices."""
OLD_PLACES = ("_pos", "__pos", "_Vertex__pos")


# Reading: objects as records.


@dataclass(frozen=True, eq=False)
class CadRecord:
    """An object of the file: the last part of its class name, and its attributes or items."""

    kind: str
    values: dict[Any, Any] = field(default_factory=dict)
    items: list[Any] = field(default_factory=list)

    def __getitem__(self, key: str) -> Any:
        """Return an attribute. Raises DesignError if it is missing."""
        if key not in self.values:
            raise DesignError(f"has no {key}; save the design again")
        return self.values[key]

    def get(self, key: str) -> Any:
        return self.values.get(key)


def _record_loader(yaml: Any) -> Any:
    """Return a loader of plain values and records only."""
    loader: Any = type("Loader", (getattr(yaml, "CSafeLoader", yaml.SafeLoader),), {})

    def record(made: Any, suffix: str, node: Any) -> Iterator[CadRecord]:
        entry = CadRecord(suffix.rsplit(".", 1)[-1])
        yield entry
        if isinstance(node, yaml.MappingNode):
            entry.values.update(made.construct_mapping(node))
        elif isinstance(node, yaml.SequenceNode):
            entry.items.extend(made.construct_sequence(node))

    def of_kind(kind: str) -> Callable[[Any, Any], Any]:
        return lambda made, node: record(made, kind, node)

    loader.add_multi_constructor(PYTHON, record)
    constructors: dict[str, Callable[[Any, Any], Any]] = {
        f"{PYTHON}tuple": lambda made, node: tuple(made.construct_sequence(node, deep=True)),
        f"{PYTHON}unicode": lambda made, node: made.construct_scalar(node),
        f"{PYTHON}long": lambda made, node: made.construct_yaml_int(node),
    }
    for kind in (vertex + form for vertex in VERTICES for form in ("", "_1")):
        constructors[f"!{kind}"] = of_kind(kind)
    for tag, constructor in constructors.items():
        loader.add_constructor(tag, constructor)
    return loader


@contextmanager
def _at(place: str) -> Iterator[None]:
    """Add the place to an error, and convert exceptions from a damaged object.

    A message that begins with a comma or colon continues the place.
    """
    try:
        yield
    except DesignError as error:
        text = str(error)
        raise DesignError(place + text if text[0] in ",:" else f"{place} {text}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        raise DesignError(f"{place} is damaged; save the design again") from None


# Geometry of a layer: areas, and lines and points that offsets widen into areas.


class Flat(NamedTuple):
    """The geometry of a layer; lines and points have no area until an offset widens them."""

    region: Region = Region()
    lines: tuple[Line, ...] = ()
    points: tuple[Point, ...] = ()


CadLayers = tuple[Flat, ...]
"""The result of an operation: its layers, from the bottom."""


def _joined(flats: Iterable[Flat]) -> Flat:
    flats = list(flats)
    lines = tuple(line for flat in flats for line in flat.lines)
    points = tuple(point for flat in flats for point in flat.points)
    return Flat(union([flat.region for flat in flats]), lines, points)


def _within(flat: Flat, region: Region, inside: bool = True) -> Flat:
    """Return the lines, cut, and points inside a region, or outside it."""
    pieces = []
    for line in flat.lines:
        stops = {p for edge in region.edges for p in meeting_points(line, edge)}
        ends = sorted({line.start, line.end, *stops}, key=line.parameter)
        for piece in (Line(start, end) for start, end in pairwise(ends)):
            if piece.length > SAME and region.contains(piece.at(0.5)) == inside:
                pieces.append(piece)
    points = tuple(point for point in flat.points if region.contains(point) == inside)
    return Flat(Region(), tuple(pieces), points)


def _combined(function: str, a: Flat, b: Flat) -> Flat:
    """Combine two layers with a boolean function. Lines are cut at the other layer's edges."""
    if function == "union":
        return _joined([a, b])
    if any(meeting_points(line, other) for line in a.lines for other in b.lines):
        raise DesignError(
            f"takes the {function} of lines that meet, which is not supported; widen them first"
        )
    if function == "intersection":
        return _joined([Flat(a.region & b.region), _within(a, b.region), _within(b, a.region)])
    rest = _within(a, b.region, False)._replace(region=a.region - b.region)
    if function == "symmetric_difference":
        return _joined([rest, _combined("difference", b, a)])
    if function != "difference":
        raise DesignError(f"has an unknown function {shown(function)}")
    return rest


def _offset(flat: Flat, distance: float) -> Flat:
    """Offset a layer outward, or inward if negative; lines have no inside."""
    grown = [grow(flat.region, distance)]
    if distance > 0:
        grown += [swept((line,), 2 * distance, True) for line in flat.lines]
        grown += [disc(point, distance) for point in flat.points]
    return Flat(union(grown))


# Shapes of sketches.


def _number(value: Any) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise DesignError(f"has {shown(value)} where a number is expected; save the design again")
    if not abs(value) <= FARTHEST:
        raise DesignError(f"has {value:g} mm; the limit is {FARTHEST:g} mm")
    return float(value)


def _vertex(vertex: CadRecord) -> Point:
    """Return the position of a vertex, in any format saved by popupCAD."""
    if vertex.items:
        unit, (x, y) = 1.0 if vertex.kind.endswith("_1") else OLD_UNIT, vertex.items[1:3]
    else:
        old = next((key for key in OLD_PLACES if vertex.get(key) is not None), None)
        unit, (x, y) = (1.0, vertex["_position"]) if old is None else (OLD_UNIT, vertex[old])
    return _number(x) / unit, _number(y) / unit


def _points(vertices: Iterable[CadRecord]) -> list[Point]:
    """Return the positions of vertices, without consecutive repeats."""
    points: list[Point] = []
    for point in map(_vertex, vertices):
        if not points or math.dist(points[-1], point) > SAME:
            points.append(point)
    return points


def _is_point(shape: CadRecord) -> bool:
    return shape.kind.startswith("DrawnPoint")


def _is_construction(shape: CadRecord) -> bool:
    return bool(shape.items[3] if _is_point(shape) and shape.items else shape.get("construction"))


SHAPES = ["GenericLine", "GenericPolyline", "GenericCircle", "GenericTwoPointRect", "GenericPoly"]
"""The supported shapes of several points, by class name."""


def _shape(shape: CadRecord) -> Flat:
    """Return a shape of a sketch. Raises DesignError if it is not supported or crosses itself."""
    if _is_point(shape):
        return Flat(points=(_vertex(shape),))
    if shape.kind not in SHAPES:
        raise DesignError(f"is a {shape.kind}, which is not supported; draw its outline")
    points = _points(shape["exterior"])
    if len(points) < 2:
        raise DesignError(f"is a {shape.kind} of {len(points)} points; remove it")
    if shape.kind == "GenericCircle":
        return Flat(disc(points[0], math.dist(*points[:2])))
    if shape.kind == "GenericTwoPointRect":
        (x, y), (u, v), *_ = points
        if min(abs(x - u), abs(y - v)) <= SAME:
            raise DesignError("is a rectangle without area; remove it")
        return Flat(polygon([(x, y), (x, v), (u, v), (u, y)]))
    if shape.kind == "GenericPoly":
        return Flat(_polygon(points, [_points(hole) for hole in shape.get("interiors") or ()]))
    return Flat(lines=tuple(Line(a, b) for a, b in pairwise(points)))


def _polygon(points: Sequence[Point], holes: Sequence[Sequence[Point]]) -> Region:
    import shapely

    drawn = shapely.Polygon(points, holes)
    if not drawn.is_valid:
        reason = shapely.is_valid_reason(drawn)
        raise DesignError(f"is a polygon with {reason}; draw it without that")
    return region_of(drawn)


# The design, with its operations in order.


Sketch = list[tuple[str, CadRecord]]
"""Shapes, each with its place within its operation."""


class CadDesign:
    """A design: layers bottom to top with their material, operations in order with their places.

    ``remarks`` list interpretations.
    """

    def __init__(self, root: CadRecord, place: str, depth: int = 0) -> None:
        if getattr(root, "kind", "") != "Design":
            raise DesignError(f"{place} is not a popupCAD design; save it again")
        self.place, self.root, self.depth = place, root, depth
        self.remarks: dict[str, None] = {}
        self._here = place
        self._stacks: dict[int, CadLayers] = {}
        with _at(place):
            definition = root.get("_layerdef") or root["_Design__layerdef"]
            self.layers: list[CadRecord] = [*definition["layers"]]
            self.numbers = {row["id"]: number for number, row in enumerate(self.layers)}
            self.operations: list[CadRecord] = [*root["operations"]]
            self.ids = [operation.get("id") for operation in self.operations]
            self.places = [
                f"{place}, operation {number} ({operation.get('customname') or operation.kind})"
                for number, operation in enumerate(self.operations, 1)
            ]

    def remark(self, text: str) -> None:
        """Add a remark about the current operation."""
        self.remarks[self._here + text] = None

    def index_of(self, reference: Any) -> int:
        """Return the index of the operation that a link names. Raises DesignError."""
        identity, output = reference if isinstance(reference, list | tuple) else (reference, 0)
        if identity not in self.ids:
            raise DesignError("refers to a missing operation; save it again")
        index = self.ids.index(identity)
        if output != 0 and self.operations[index].kind in OPERATIONS:
            raise DesignError(
                f"takes output {output} of operation {index + 1}, which has only output 0"
            )
        return index

    def stack(self, index: int) -> CadLayers:
        """Return the result of an operation. Raises DesignError at the first unsupported one."""
        for number in sorted(self.needed(index) - self._stacks.keys()):
            operation, self._here = self.operations[number], self.places[number]
            with _at(self._here):
                if operation.kind not in OPERATIONS:
                    raise DesignError(
                        f": operations of class {operation.kind} are not supported; use an "
                        "earlier one, or save the laminate as DXF in popupCAD"
                    )
                self._stacks[number] = OPERATIONS[operation.kind](self, operation)
        return self._stacks[index]

    def needed(self, index: int) -> set[int]:
        """Return the indices of an operation and its dependencies. Raises DesignError."""
        needed = {index}
        for number in range(index, -1, -1):
            if number in needed:
                with _at(self.places[number]):
                    links = (self.operations[number].get("operation_links") or {}).values()
                    parents = {self.index_of(reference) for row in links for reference in row}
                    if parents and max(parents) >= number:
                        raise DesignError(
                            f"refers to operation {max(parents) + 1}, which does not precede it"
                        )
                needed |= parents
        return needed

    def parents(self, operation: CadRecord, key: str) -> list[CadLayers]:
        """Return the results of the operations of a link."""
        links = operation["operation_links"].get(key) or ()
        return [self._stacks[self.index_of(reference)] for reference in links]

    def parent(self, operation: CadRecord, key: str = "parent") -> CadLayers:
        """Return the result of the operation that this one changes."""
        return self.parents(operation, key)[0]

    def spread(self, flats: Mapping[int, Flat]) -> CadLayers:
        """Return a stack with these layers by index; layers outside are dropped, others empty."""
        return tuple(flats.get(index, Flat()) for index in range(len(self.layers)))

    def on_layers(self, flat: Flat, operation: CadRecord, key: str) -> CadLayers:
        """Return a stack with one geometry on the layers that an operation links."""
        return self.spread({self.numbers[link]: flat for link in operation[key]})

    def linked_sketch(self, operation: CadRecord, key: str) -> Sketch:
        """Return the first sketch linked by an operation under a key."""
        return self.sketch(next(iter(operation["sketch_links"].get(key) or ()), None))

    def sketch(self, identity: Any) -> Sketch:
        """Return the shapes of a sketch without construction lines."""
        sketch = self.root["sketches"].get(identity)
        if sketch is None:
            raise DesignError("refers to a missing sketch; save the design again")
        return [
            (f", sketch {sketch.get('_basename') or identity}, shape {number}", shape)
            for number, shape in enumerate(sketch["operationgeometry"], 1)
            if not _is_construction(shape)
        ]


def _drawn(shapes: Sketch) -> Flat:
    flats = []
    for place, shape in shapes:
        with _at(place):
            flats.append(_shape(shape))
    return _joined(flats)


def _sketched(design: CadDesign, operation: CadRecord) -> CadLayers:
    flat = _drawn(design.linked_sketch(operation, "sketch"))
    return design.on_layers(flat, operation, "layer_links")


def _laminates(design: CadDesign, operation: CadRecord) -> CadLayers:
    nothing = [design.spread({})]
    first = design.parents(operation, "unary") or nothing
    second = design.parents(operation, "binary") or nothing
    function = operation["function"]
    by_layer = zip(zip(*first, strict=True), zip(*second, strict=True), strict=True)
    return tuple(_of_rows(function, ours, theirs) for ours, theirs in by_layer)


def _of_rows(function: str, first: Sequence[Flat], second: Sequence[Flat]) -> Flat:
    """Combine all of the first row; for a difference, its union and the second row's."""
    if function in ("union", "intersection"):
        return reduce(lambda a, b: _combined(function, a, b), first)
    return _combined(function, _joined(first), _joined(second))


def _layers(design: CadDesign, operation: CadRecord) -> CadLayers:
    stack = design.parent(operation)
    first, second = (
        [stack[design.numbers[link]] for link in operation.get(key) or ()]
        for key in ("unary_layer_links", "pair_layer_links")
    )
    flat = _of_rows(operation["function"], first, second)
    return design.on_layers(flat, operation, "output_layer_links")


def _widened(design: CadDesign, operation: CadRecord) -> CadLayers:
    distance, chords = map(_number, operation["values"])
    chords = max(1, int(chords))
    sagitta = abs(distance) * (1 - math.cos(math.pi / 4 / chords))
    design.remark(
        f": true arcs, where popupCAD lays {chords} chords in a quarter of a circle, up to "
        f"{sagitta:.2g} mm inside them"
    )
    return tuple(_offset(flat, distance) for flat in design.parent(operation))


def _cleaned(design: CadDesign, operation: CadRecord) -> CadLayers:
    distance, _ = map(_number, operation["values"])
    stack = design.parent(operation)
    for step in (-distance, 2 * distance, -distance):
        stack = tuple(_offset(flat, step) for flat in stack)
    return stack


def _shifted(design: CadDesign, operation: CadRecord) -> CadLayers:
    stack = design.parent(operation)
    if not operation.get("rotate"):
        return _moved(design, operation, stack)
    # Rotate a list by ``shift``; a shift beyond its length changes nothing.
    order, shift = [*range(len(stack))], int(operation["shift"])
    flipped = stack[::-1] if operation.get("flip") else stack
    return design.spread(dict(zip(order[shift:] + order[:shift], flipped, strict=False)))


def _moved(design: CadDesign, operation: CadRecord, stack: CadLayers) -> CadLayers:
    """Turn a stack over and move it up or down by layers, as the operation requires."""
    shift = int(operation["shift"])
    flipped = stack[::-1] if operation.get("flip") else stack
    return design.spread({number + shift: flat for number, flat in enumerate(flipped)})


def _transformed(design: CadDesign, operation: CadRecord) -> CadLayers:
    source = design.linked_sketch(operation, "sketch_from")
    return _placed(design, operation, design.parent(operation, "from"), source)


def _placed_design(design: CadDesign, operation: CadRecord) -> CadLayers:
    identity = operation["design_links"]["subdesign"][0]
    root = (design.root.get("subdesigns") or {}).get(identity)
    if root is None or design.depth >= DEEPEST:
        raise DesignError("refers to a missing design; save the design again")
    part = CadDesign(root, f", design {root.get('_basename') or identity}", design.depth + 1)
    stack = part.stack(part.index_of(operation["subopref"]))
    for remark in part.remarks:
        design.remark(remark)
    return _placed(design, operation, stack, part.sketch(operation["sub_sketch_id"]))


def _placed(design: CadDesign, operation: CadRecord, stack: CadLayers, source: Sketch) -> CadLayers:
    """Copy a stack from the first shape of a sketch to each shape of another one."""
    first = _two_points(*source[0])
    copies = []
    for place, shape in design.linked_sketch(operation, "sketch_to"):
        if _is_point(shape):
            design.remark(f"{place}: a point has no direction; nothing is laid there")
        else:
            copies.append(_similar(operation, first, _two_points(place, shape), stack))
    laid = tuple(_joined(flats) for flats in zip(*copies, strict=True)) or design.spread({})
    return _moved(design, operation, laid)


def _two_points(place: str, shape: CadRecord) -> Sequence[Point]:
    with _at(place):
        points = _points(shape["exterior"])
        if len(points) < 2:
            raise DesignError("cannot place a design, because it is not a line; draw a line")
    return points[:2]


def _similar(
    operation: CadRecord, first: Sequence[Point], second: Sequence[Point], stack: CadLayers
) -> CadLayers:
    """Move, rotate and scale a stack so that one line maps to another."""
    ratio = math.dist(*second) / math.dist(*first)
    along, across = (
        _number(operation[f"scale{axis}"])
        if operation.get(f"transformtype_{axis}") == "custom"
        else ratio
        for axis in "xy"
    )
    is_even = math.isclose(abs(along), abs(across), rel_tol=1e-9)
    has_arcs = any(not isinstance(edge, Line) for flat in stack for edge in flat.region.edges)
    if not along * across or (has_arcs and not is_even):
        raise DesignError(
            f"scales arcs by {along:g} along its line and {across:g} across it, but ellipses are "
            "not supported; give both the same scale"
        )
    start, end = complex(*first[0]), complex(*second[0])
    ours, theirs = complex(*first[1]) - start, complex(*second[1]) - end

    def point(p: Point) -> Point:
        step = (complex(*p) - start) * abs(ours) / ours
        step = complex(along * step.real, across * step.imag) * theirs / abs(theirs)
        return (end + step).real, (end + step).imag

    return tuple(
        Flat(
            flat.region.mapped(point, abs(along), along * across < 0)
            if is_even
            else _stretched(flat.region, point),
            tuple(Line(point(line.start), point(line.end)) for line in flat.lines),
            tuple(map(point, flat.points)),
        )
        for flat in stack
    )


def _stretched(region: Region, point: Callable[[Point], Point]) -> Region:
    """Return a region of straight edges under an affine map, given as a function of points."""
    outers, holes = (
        union([polygon([point(edge.start) for edge in contour.edges]) for contour in contours])
        for contours in (region.outers, region.holes)
    )
    return outers - holes


def _frozen(design: CadDesign, operation: CadRecord) -> CadLayers:
    """Return the saved result of a frozen operation."""
    geometry = operation["generic"]
    flats = {}
    for material, shapes in getattr(geometry, "values", {}).get("geoms", geometry).items():
        number = design.numbers[material["id"]]
        places = (f", layer {number + 1}, shape {n}" for n in range(1, len(shapes) + 1))
        flats[number] = _drawn([*zip(places, shapes, strict=True)])
    return design.spread(flats)


OPERATIONS: Mapping[str, Callable[[CadDesign, CadRecord], CadLayers]] = {
    "SimpleSketchOp": _sketched,
    "LaminateOperation2": _laminates,
    "LayerOp2": _layers,
    "BufferOperation3": _widened,
    "Cleanup2": _cleaned,
    "ShiftFlip3": _shifted,
    "TransformInternal": _transformed,
    "TransformExternal": _placed_design,
    "Freeze": _frozen,
}
"""The supported operations, by class name."""


# A layer of an operation, as a table row names it.


@lru_cache(maxsize=4)
def _read(path: Path, text: str) -> CadDesign:
    return CadDesign(read_yaml(path, text, "popupCAD", _record_loader), path.name)


def cad_design(path: Path) -> CadDesign:
    """Return the design in a file; its operations have not run yet. Raises DesignError."""
    return _read(path, read_text(path, MOST_BYTES))


def cad_layer(path: Path, layer: str) -> tuple[Region, list[str]]:
    """Return a layer's profile, mm, and remarks about it."""
    design = cad_design(path)
    name, _, number = layer.rpartition("/")
    index = _operation(design, name, layer)
    place = layer_index(path.name, number, len(design.layers))
    flat, film = design.stack(index)[place], design.layers[place]
    where = f"{design.places[index]}, layer {number}"
    remarks = [*design.remarks]
    loose = _within(flat, flat.region, False)
    if loose.lines or loose.points:
        counts = f"{len(loose.lines)} lines and {len(loose.points)} points"
        remarks.append(f"{where}: {counts} have no area, and no cut")
    if flat.region.is_empty:
        raise DesignError(f"{where} has no area; omit its row")
    touch = crossing(flat.region.edges)
    if touch is not None:
        raise DesignError(
            f"{where} has contours that touch at x {touch[0]:.4f}, y {touch[1]:.4f}; separate them "
            "there, or join them"
        )
    thickness = film.get("thickness")
    thick = f", {thickness:g} mm" if isinstance(thickness, int | float) else ""
    material = film.get("name") or film.kind
    remarks.append(f"{where}: {material}{thick} there; the table and the kit say its film")
    return flat.region, remarks


def _operation(design: CadDesign, name: str, layer: str) -> int:
    names = [operation.get("customname") for operation in design.operations]
    if name.isdecimal() and 1 <= int(name) <= len(names):
        return int(name) - 1
    if not name or names.count(name) != 1:
        raise DesignError(
            f"layer {shown(layer)} of {design.place} is not OPERATION/NUMBER; the operation is a "
            f"number from 1 to {len(names)}, or a unique name"
        )
    return names.index(name)


def refuse_alone(path: Path) -> NoReturn:
    """Refuse a design that is imported without a table of its layers."""
    design = cad_design(path)
    unread = [
        f"{number} ({operation.kind})"
        for number, operation in enumerate(design.operations, 1)
        if operation.kind not in OPERATIONS
    ]
    more = "" if len(unread) <= MOST_NAMED else f" and {len(unread) - MOST_NAMED} more"
    strange = f"; operations that are not read: {', '.join(unread[:MOST_NAMED])}{more}"
    layers = f"{len(design.layers)} layers"
    refuse_without_table(path, layers, "OPERATION/NUMBER", strange if unread else "")
