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
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from sbafab.design.files import shown
from sbafab.design.outline import crossing
from sbafab.errors import DesignError
from sbafab.geometry.edges import Line, Point, meeting_points
from sbafab.geometry.offset import grow, swept
from sbafab.geometry.region import Region, disc, polygon, union
from sbafab.importing.records import LAYERS, MOST_NAMED, loaded, read_text, yaml_of

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
AREAS = frozenset({"GenericPoly", "GenericCircle", "GenericTwoPointRect"})
LINES = frozenset({"GenericLine", "GenericPolyline"})


# Reading: objects as records.


@dataclass(frozen=True, eq=False)
class CadRecord:
    """An object of the file: the last word of its class name, and its attributes or items."""

    kind: str
    values: dict[Any, Any] = field(default_factory=dict)
    items: list[Any] = field(default_factory=list)

    def need(self, key: str, place: str, kind: type | tuple[type, ...] = object) -> Any:
        """Return an attribute of this type. Raises DesignError with the place."""
        value = self.values.get(key)
        if key not in self.values or not isinstance(value, kind):
            raise DesignError(f"{place} has no {key} that can be read; save the design again")
        return value

    def links(self, group: str, key: str, place: str) -> list[Any]:
        """Return the links of an operation under a key of a group; empty if it has none."""
        row = self.need(group, place, dict).get(key) or ()
        if not isinstance(row, list | tuple):
            raise DesignError(f"{place} has no list of {key} in {group}; save the design again")
        return [*row]


def _records(path: Path, text: str) -> Any:
    """The document, as plain values and records only. Raises DesignError."""
    yaml = yaml_of(path)
    loader: Any = type("Loader", (getattr(yaml, "CSafeLoader", yaml.SafeLoader),), {})

    def record(made: Any, suffix: str, node: Any) -> Iterator[CadRecord]:
        entry = CadRecord(suffix.rsplit(".", 1)[-1])
        yield entry
        if isinstance(node, yaml.MappingNode):
            entry.values.update(made.construct_mapping(node))
        elif isinstance(node, yaml.SequenceNode):
            entry.items.extend(made.construct_sequence(node))

    def items(made: Any, node: Any) -> tuple[Any, ...]:
        return tuple(made.construct_sequence(node, deep=True))

    loader.add_multi_constructor(PYTHON, record)
    loader.add_constructor(f"{PYTHON}tuple", items)
    loader.add_constructor(f"{PYTHON}unicode", lambda made, node: made.construct_scalar(node))
    loader.add_constructor(f"{PYTHON}long", lambda made, node: made.construct_yaml_int(node))
    for vertex in VERTICES:
        for form in ("", "_1"):
            loader.add_constructor(
                f"!{vertex}{form}", lambda made, node, kind=vertex + form: record(made, kind, node)
            )
    return loaded(path, text, loader, "popupCAD")


# Geometry of a layer: areas, and lines and points that offsets widen into areas.


class Flat(NamedTuple):
    """Geometry of a layer; lines and points have no area until an offset widens them."""

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


def _combined(function: str, a: Flat, b: Flat, place: str) -> Flat:
    """Combine two layers with a boolean function. Lines are cut at the other layer's edges."""
    if function == "union":
        return _joined([a, b])
    if any(meeting_points(line, other) for line in a.lines for other in b.lines):
        raise DesignError(
            f"{place} takes the {function} of lines that meet, which is not read; widen them first"
        )
    if function == "intersection":
        lines = (*_cut(a.lines, b.region, True), *_cut(b.lines, a.region, True))
        points = (*_sifted(a.points, b.region, True), *_sifted(b.points, a.region, True))
        return Flat(a.region & b.region, lines, points)
    rest = Flat(
        a.region - b.region,
        _cut(a.lines, b.region, False),
        _sifted(a.points, b.region, False),
    )
    if function == "difference":
        return rest
    if function == "symmetric_difference":
        return _joined([rest, _combined("difference", b, a, place)])
    raise DesignError(f"{place}: its function {shown(function)} is not known")


def _cut(lines: Iterable[Line], region: Region, inside: bool) -> tuple[Line, ...]:
    """The parts of lines inside a region, or outside it."""
    kept = []
    for line in lines:
        stops = {p for edge in region.edges for p in meeting_points(line, edge)}
        ends = sorted({line.start, line.end, *stops}, key=line.parameter)
        for start, end in pairwise(ends):
            middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
            if math.dist(start, end) > SAME and region.contains(middle) == inside:
                kept.append(Line(start, end))
    return tuple(kept)


def _sifted(points: Iterable[Point], region: Region, inside: bool) -> tuple[Point, ...]:
    return tuple(point for point in points if region.contains(point) == inside)


def _offset(flat: Flat, distance: float) -> Flat:
    """Offset a layer outward, or inward if negative; lines have no inside."""
    grown = [grow(flat.region, distance)]
    if distance > 0:
        grown += [swept((line,), 2 * distance, True) for line in flat.lines]
        grown += [disc(point, distance) for point in flat.points]
    return Flat(union(grown))


# Shapes of sketches.


def _number(value: Any, place: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise DesignError(f"{place} has {shown(value)} for a number; save the design again")
    if not abs(value) <= FARTHEST:
        raise DesignError(f"{place} has {value:g} mm, where at most {FARTHEST:g} is allowed")
    return float(value)


def _vertex(vertex: Any, place: str) -> Point:
    """The position of a vertex, in any of the forms that popupCAD has saved."""
    kind = vertex.kind if isinstance(vertex, CadRecord) else ""
    unit, pair = 1.0, None
    if kind.removesuffix("_1") in VERTICES and vertex.items:
        unit, pair = 1.0 if kind.endswith("_1") else OLD_UNIT, vertex.items[1:3]
    elif kind in VERTICES or kind == "BaseVertex":
        old = next((key for key in OLD_PLACES if vertex.values.get(key) is not None), None)
        unit = 1.0 if old is None else OLD_UNIT
        pair = vertex.values.get("_position" if old is None else old)
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise DesignError(f"{place} has a vertex that cannot be read; save the design again")
    return _number(pair[0], place) / unit, _number(pair[1], place) / unit


def _points(vertices: Any, place: str) -> list[Point]:
    """The positions of vertices, without consecutive repeats."""
    if not isinstance(vertices, list | tuple):
        raise DesignError(f"{place} has no list of vertices; save the design again")
    points: list[Point] = []
    for vertex in vertices:
        point = _vertex(vertex, place)
        if not points or math.dist(points[-1], point) > SAME:
            points.append(point)
    return points


def _is_construction(shape: Any) -> bool:
    if not isinstance(shape, CadRecord):
        return False
    if shape.kind.startswith("DrawnPoint") and len(shape.items) > 3:
        return bool(shape.items[3])
    return bool(shape.values.get("construction", False))


def _shape(shape: Any, place: str) -> Flat:
    """A shape of a sketch. Raises DesignError if it is not supported or crosses itself."""
    kind = shape.kind if isinstance(shape, CadRecord) else str(type(shape).__name__)
    if kind.startswith("DrawnPoint"):
        return Flat(points=(_vertex(shape, place),))
    if kind not in AREAS | LINES:
        raise DesignError(f"{place} is a {kind}, which is not read; draw its outline")
    points = _points(shape.need("exterior", place), place)
    if len(points) < 2:
        raise DesignError(f"{place} is a {kind} of {len(points)} points; remove it")
    if kind in LINES:
        return Flat(lines=tuple(Line(a, b) for a, b in pairwise(points)))
    if kind == "GenericCircle":
        return Flat(disc(points[0], math.dist(*points[:2])))
    if kind == "GenericTwoPointRect":
        (x, y), (u, v), *_ = points
        if min(abs(x - u), abs(y - v)) <= SAME:
            raise DesignError(f"{place} is a rectangle without area; remove it")
        return Flat(polygon([(x, y), (x, v), (u, v), (u, y)]))
    holes = shape.values.get("interiors") or []
    if not isinstance(holes, list | tuple):
        raise DesignError(f"{place} has no list of interiors; save the design again")
    return Flat(_polygon(points, [_points(hole, place) for hole in holes], place))


def _polygon(outer: Sequence[Point], holes: Sequence[Sequence[Point]], place: str) -> Region:
    import shapely

    rings = [_open(outer), *map(_open, holes)]
    if min(map(len, rings)) < 3:
        raise DesignError(f"{place} is a polygon of fewer than three points; remove it")
    drawn = shapely.Polygon(rings[0], rings[1:])
    if not drawn.is_valid:
        reason = shapely.is_valid_reason(drawn)
        raise DesignError(f"{place} is a polygon with {reason}; draw it without that")
    return polygon(rings[0]) - union(map(polygon, rings[1:]))


def _open(ring: Sequence[Point]) -> Sequence[Point]:
    is_closed = len(ring) > 1 and math.dist(ring[0], ring[-1]) <= SAME
    return ring[:-1] if is_closed else ring


# The design, with its operations in order.


@dataclass(frozen=True)
class CadLayer:
    """A layer of a design: its material's name, and thickness in mm (None if not stated)."""

    material: str
    thickness: float | None


@dataclass(frozen=True, eq=False)
class CadDesign:
    """A design: layers bottom to top, sketches and other designs by id, operations in order.

    ``stacks`` are the results of operations, by index; ``remarks`` name what was interpreted.
    """

    place: str
    layers: tuple[CadLayer, ...]
    layer_numbers: Mapping[Any, int]
    sketches: Mapping[Any, Any]
    operations: Sequence[CadRecord]
    subdesigns: Mapping[Any, Any]
    depth: int = 0
    stacks: dict[int, CadLayers] = field(default_factory=dict)
    remarks: dict[str, None] = field(default_factory=dict)
    placed: dict[Any, CadDesign] = field(default_factory=dict)

    def named(self, index: int) -> str:
        """Return an operation's place: its number, and its name or class."""
        operation = self.operations[index]
        name = operation.values.get("customname") or operation.kind
        return f"{self.place}, operation {index + 1} ({name})"

    def index_of(self, reference: Any, place: str) -> int:
        """Return the index of the operation that a link names. Raises DesignError."""
        pair = reference if isinstance(reference, list | tuple) else (reference, 0)
        ids = [operation.values.get("id") for operation in self.operations]
        if len(pair) != 2 or pair[0] not in ids:
            raise DesignError(f"{place} takes an operation that is not there; save it again")
        index = ids.index(pair[0])
        if pair[1] != 0 and self.operations[index].kind in OPERATIONS:
            raise DesignError(f"{place} takes output {pair[1]} of operation {index + 1}: it has 0")
        return index

    def layer_indices(self, operation: CadRecord, key: str, place: str) -> list[int]:
        """Return the indices of the layers that an operation links. Raises DesignError."""
        links = operation.need(key, place, (list, tuple))
        if not all(_is_id(link) and link in self.layer_numbers for link in links):
            raise DesignError(f"{place} names a layer that is not there; save the design again")
        return [self.layer_numbers[link] for link in links]

    def linked_sketch(self, operation: CadRecord, key: str, place: str) -> list[tuple[str, Any]]:
        """Return the shapes of the first sketch linked by an operation under a key."""
        return self.sketch(_first(operation.links("sketch_links", key, place)), place)

    def sketch(self, identity: Any, place: str) -> list[tuple[str, Any]]:
        """Return the shapes of a sketch without construction lines, each with its place."""
        sketch = self.sketches.get(identity) if _is_id(identity) else None
        if not isinstance(sketch, CadRecord):
            raise DesignError(f"{place} takes a sketch that is not there; save the design again")
        shapes = sketch.need("operationgeometry", f"{place}, its sketch", list)
        named = f"{place}, sketch {sketch.values.get('_basename', identity)}"
        return [
            (f"{named}, shape {number}", shape)
            for number, shape in enumerate(shapes, 1)
            if not _is_construction(shape)
        ]

    def stack(self, index: int) -> CadLayers:
        """Return the result of an operation. Raises DesignError at the first unsupported one."""
        for number in sorted(self.needed(index) - self.stacks.keys()):
            operation, place = self.operations[number], self.named(number)
            if operation.kind not in OPERATIONS:
                raise DesignError(
                    f"{place}: operations of class {operation.kind} are not read; take one before "
                    "it, or save the laminate as DXF in popupCAD"
                )
            self.stacks[number] = OPERATIONS[operation.kind](self, operation, place)
        return self.stacks[index]

    def needed(self, index: int) -> set[int]:
        """Return the indices of an operation and its dependencies. Raises DesignError."""
        needed = {index}
        for number in range(index, -1, -1):
            if number in needed:
                needed |= self._parents(number)
        return needed

    def _parents(self, index: int) -> set[int]:
        """The operations whose layers this one uses; all must come before it."""
        place = self.named(index)
        links = self.operations[index].values.get("operation_links")
        rows = links.values() if isinstance(links, dict) else ()
        references = [ref for row in rows if isinstance(row, list | tuple) for ref in row]
        parents = {self.index_of(reference, place) for reference in references}
        later = next((parent for parent in parents if parent >= index), None)
        if later is not None:
            raise DesignError(f"{place} takes operation {later + 1}, which is not before it")
        return parents

    def parents(self, operation: CadRecord, key: str, place: str) -> list[CadLayers]:
        """Return the results of the operations of a link."""
        links = operation.links("operation_links", key, place)
        return [self.stacks[self.index_of(ref, place)] for ref in links]

    def parent(self, operation: CadRecord, place: str, key: str = "parent") -> CadLayers:
        """Return the result of the operation that this one changes. Raises DesignError."""
        stacks = self.parents(operation, key, place)
        if not stacks:
            raise DesignError(f"{place} takes no operation; save the design again")
        return stacks[0]

    def spread(self, flats: Mapping[int, Flat]) -> CadLayers:
        """Return a stack with these layers, all empty."""
        return tuple(flats.get(index, Flat()) for index in range(len(self.layers)))


def _is_id(value: Any) -> bool:
    return isinstance(value, int | str)


def _first(links: Sequence[Any]) -> Any:
    return links[0] if links else None


def _sketched(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    shapes = design.linked_sketch(operation, "sketch", place)
    flat = _joined(_shape(shape, where) for where, shape in shapes)
    return design.spread(dict.fromkeys(design.layer_indices(operation, "layer_links", place), flat))


def _laminates(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    function = operation.need("function", place, str)
    nothing = design.spread({})
    first = design.parents(operation, "unary", place) or [nothing]
    second = design.parents(operation, "binary", place) or [nothing]
    if function in ("union", "intersection"):
        return reduce(lambda a, b: _by_layer(function, a, b, place), first)
    a, b = (tuple(map(_joined, zip(*row, strict=True))) for row in (first, second))
    return _by_layer(function, a, b, place)


def _by_layer(function: str, a: CadLayers, b: CadLayers, place: str) -> CadLayers:
    return tuple(_combined(function, one, two, place) for one, two in zip(a, b, strict=True))


def _layers(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    function = operation.need("function", place, str)
    stack = design.parent(operation, place)
    rows = [
        [stack[index] for index in design.layer_indices(operation, key, place)]
        for key in ("unary_layer_links", "pair_layer_links")
    ]
    output = design.layer_indices(operation, "output_layer_links", place)
    if function in ("union", "intersection"):
        rows = rows[:1]
    if not all(rows):
        raise DesignError(f"{place} takes no layer; save the design again")
    if len(rows) == 1:
        flat = reduce(lambda a, b: _combined(function, a, b, place), rows[0])
    else:
        flat = _combined(function, _joined(rows[0]), _joined(rows[1]), place)
    return design.spread(dict.fromkeys(output, flat))


def _values(operation: CadRecord, place: str) -> tuple[float, int]:
    """A distance in mm, and popupCAD's number of chords per quarter circle."""
    values = [_number(v, place) for v in operation.need("values", place, (list, tuple))]
    if len(values) != 2:
        raise DesignError(f"{place} has {len(values)} values and not two; save the design again")
    return values[0], max(1, int(values[1]))


def _widened(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    distance, chords = _values(operation, place)
    sagitta = abs(distance) * (1 - math.cos(math.pi / 4 / chords))
    design.remarks[
        f"{place}: true arcs, where popupCAD lays {chords} chords in a quarter of a circle, up to "
        f"{sagitta:.2g} mm inside them"
    ] = None
    return tuple(_offset(flat, distance) for flat in design.parent(operation, place))


def _cleaned(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    distance, _ = _values(operation, place)
    stack = design.parent(operation, place)
    for step in (-distance, 2 * distance, -distance):
        stack = tuple(_offset(flat, step) for flat in stack)
    return stack


def _shifted(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    stack = design.parent(operation, place)
    if operation.values.get("flip"):
        stack = stack[::-1]
    shift = operation.need("shift", place, int)
    if operation.values.get("rotate"):
        # Rotate a list by ``shift``; a shift beyond its length changes nothing.
        order = [*range(len(stack))]
        return design.spread(dict(zip(order[shift:] + order[:shift], stack, strict=False)))
    return _moved(design, stack, shift)


def _moved(design: CadDesign, stack: CadLayers, shift: int) -> CadLayers:
    """Move a stack up or down by a number of layers; layers that end up outside are dropped."""
    return design.spread({number + shift: flat for number, flat in enumerate(stack)})


def _transformed(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    stack = design.parent(operation, place, "from")
    source = design.linked_sketch(operation, "sketch_from", place)
    return _placed(design, operation, place, stack, source)


def _placed_design(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    identity = _first(operation.links("design_links", "subdesign", place))
    part = design.subdesigns.get(identity) if _is_id(identity) else None
    if not isinstance(part, CadRecord) or design.depth >= DEEPEST:
        raise DesignError(f"{place} takes a design that is not there; save the design again")
    if identity not in design.placed:
        name = part.values.get("_basename", identity)
        design.placed[identity] = _design(part, f"{place}, design {name}", design.depth + 1)
    part_design = design.placed[identity]
    index = part_design.index_of(operation.need("subopref", place), place)
    stack = part_design.stack(index)
    design.remarks.update(part_design.remarks)
    source = part_design.sketch(operation.values.get("sub_sketch_id"), place)
    return _placed(design, operation, place, stack, source)


def _placed(
    design: CadDesign,
    operation: CadRecord,
    place: str,
    stack: CadLayers,
    source: Sequence[tuple[str, Any]],
) -> CadLayers:
    """Copy a stack from the first shape of a sketch to each shape of another one."""
    targets = design.linked_sketch(operation, "sketch_to", place)
    if not source:
        raise DesignError(f"{place} is laid from a sketch without a line; save the design again")
    first = _two_points(*source[0])
    copies = []
    for where, shape in targets:
        if isinstance(shape, CadRecord) and shape.kind.startswith("DrawnPoint"):
            design.remarks[f"{where}: a point has no direction; nothing is laid there"] = None
            continue
        copies.append(_similar(operation, first, _two_points(where, shape), place, stack))
    laid = tuple(_joined(flats) for flats in zip(*copies, strict=True)) or design.spread({})
    shift = operation.need("shift", place, int)
    return _moved(design, laid[::-1] if operation.values.get("flip") else laid, shift)


def _two_points(place: str, shape: Any) -> tuple[Point, Point]:
    points = _points(shape.need("exterior", place), place) if isinstance(shape, CadRecord) else []
    if len(points) < 2:
        raise DesignError(f"{place} is no line to lay a design by; draw one")
    return points[0], points[1]


def _similar(
    operation: CadRecord,
    first: tuple[Point, Point],
    second: tuple[Point, Point],
    place: str,
    stack: CadLayers,
) -> CadLayers:
    """Move, rotate and scale a stack so that one line maps to another."""
    ratio = math.dist(*second) / math.dist(*first)
    along, across = (
        _number(operation.values.get(f"scale{axis}"), place)
        if operation.values.get(f"transformtype_{axis}") == "custom"
        else ratio
        for axis in "xy"
    )
    is_even = math.isclose(abs(along), abs(across), rel_tol=1e-9)
    if not along * across or (not is_even and any(map(_has_arcs, stack))):
        raise DesignError(
            f"{place} scales arcs by {along:g} along its line and {across:g} across it, and "
            "ellipses are not read; give both the same scale"
        )
    start, end = complex(*first[0]), complex(*second[0])
    ours, theirs = (complex(b[0] - a[0], b[1] - a[1]) for a, b in (first, second))

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


def _has_arcs(flat: Flat) -> bool:
    return not all(isinstance(edge, Line) for edge in flat.region.edges)


def _stretched(region: Region, point: Callable[[Point], Point]) -> Region:
    """A region of straight edges under an affine map, given by its effect on points."""
    rings = [polygon([point(edge.start) for edge in c.edges]) for c in region.outers]
    holes = [polygon([point(edge.start) for edge in c.edges]) for c in region.holes]
    return union(rings) - union(holes)


def _frozen(design: CadDesign, operation: CadRecord, place: str) -> CadLayers:
    """The saved result of a frozen operation."""
    generic = operation.values.get("generic")
    geoms = generic.values.get("geoms") if isinstance(generic, CadRecord) else generic
    if not isinstance(geoms, dict):
        raise DesignError(f"{place} holds no layers; freeze it again")
    flats = {}
    for material, shapes in geoms.items():
        identity = material.values.get("id") if isinstance(material, CadRecord) else None
        if identity not in design.layer_numbers or not isinstance(shapes, list):
            raise DesignError(f"{place} has a layer that is not there; freeze it again")
        number = design.layer_numbers[identity]
        where = f"{place}, layer {number + 1}, shape"
        flats[number] = _joined(_shape(s, f"{where} {n}") for n, s in enumerate(shapes, 1))
    return design.spread(flats)


OPERATIONS: Mapping[str, Callable[[CadDesign, CadRecord, str], CadLayers]] = {
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


def _design(root: Any, place: str, depth: int = 0) -> CadDesign:
    if not isinstance(root, CadRecord) or root.kind != "Design":
        raise DesignError(f"{place} holds no design of popupCAD; save it again")
    definition = root.values.get("_layerdef") or root.values.get("_Design__layerdef")
    rows = definition.values.get("layers") if isinstance(definition, CadRecord) else None
    if not isinstance(rows, list) or not all(isinstance(row, CadRecord) for row in rows):
        raise DesignError(f"{place} has no list of layers; save it again")
    operations = root.need("operations", place, list)
    if not all(isinstance(operation, CadRecord) for operation in operations):
        raise DesignError(f"{place} has an operation that is no object; save it again")
    subdesigns = root.values.get("subdesigns")
    return CadDesign(
        place,
        tuple(_layer(row) for row in rows),
        {row.need("id", place, (int, str)): index for index, row in enumerate(rows)},
        root.need("sketches", place, dict),
        operations,
        subdesigns if isinstance(subdesigns, dict) else {},
        depth,
    )


def _layer(row: CadRecord) -> CadLayer:
    thickness = row.values.get("thickness")
    is_number = isinstance(thickness, int | float) and not isinstance(thickness, bool)
    return CadLayer(str(row.values.get("name") or row.kind), thickness if is_number else None)


# A layer of an operation, as a table row names it.


@lru_cache(maxsize=4)
def _read(path: Path, text: str) -> CadDesign:
    return _design(_records(path, text), path.name)


def cad_design(path: Path) -> CadDesign:
    """Return the design of a file; its operations are not run yet. Raises DesignError."""
    return _read(path, read_text(path, MOST_BYTES))


def cad_layer(path: Path, layer: str) -> tuple[Region, list[str]]:
    """Return a layer's profile, mm, and remarks on it.

    ``layer`` is "OPERATION/NUMBER": an operation by its number or its name, and a layer of it from
    1 at the bottom. Raises DesignError with the place in the file.
    """
    design = cad_design(path)
    name, _, number = layer.rpartition("/")
    index = _operation(design, name, layer)
    count = len(design.layers)
    if not number.isdecimal() or not 1 <= int(number) <= count:
        raise DesignError(
            f"{path.name} has no layer {shown(number)}; its layers are 1 to {count}, bottom to top"
        )
    flat, there = design.stack(index)[int(number) - 1], design.layers[int(number) - 1]
    where = f"{design.named(index)}, layer {number}"
    remarks = [*design.remarks]
    loose = len(_cut(flat.lines, flat.region, False)), len(_sifted(flat.points, flat.region, False))
    if any(loose):
        remarks.append(f"{where}: {loose[0]} lines and {loose[1]} points have no area, and no cut")
    if flat.region.is_empty:
        raise DesignError(f"{where} holds no area; leave its row out")
    touch = crossing(flat.region.edges)
    if touch is not None:
        x, y = touch
        raise DesignError(
            f"{where} has contours that touch at x {x:.4f}, y {y:.4f}; draw them apart there, or "
            "join them"
        )
    thickness = "" if there.thickness is None else f", {there.thickness:g} mm"
    remarks.append(
        f"{where}: {there.material}{thickness} there; the table and the kit say its film"
    )
    return flat.region, remarks


def _operation(design: CadDesign, name: str, layer: str) -> int:
    names = [operation.values.get("customname") for operation in design.operations]
    if name.isdecimal() and 1 <= int(name) <= len(names):
        return int(name) - 1
    if not name or names.count(name) != 1:
        raise DesignError(
            f"layer {shown(layer)} of {design.place} is no OPERATION/NUMBER; the operation is one "
            f"of 1 to {len(names)}, or a name that only one of them has"
        )
    return names.index(name)


def refuse_alone(path: Path) -> NoReturn:
    """Refuse a design that is imported without a table of its layers."""
    design = cad_design(path)
    unread = [
        f"{index + 1} ({operation.kind})"
        for index, operation in enumerate(design.operations)
        if operation.kind not in OPERATIONS
    ]
    last = next((n for n in range(len(design.operations), 0, -1) if _is_read(design, n - 1)), None)
    which = "OPERATION" if last is None else f"{last}"
    of = "" if last is None else f" for operation {last}, the last that rests on what is read"
    more = "" if len(unread) <= MOST_NAMED else f" and {len(unread) - MOST_NAMED} more"
    strange = f"; operations that are not read: {', '.join(unread[:MOST_NAMED])}{more}"
    raise DesignError(
        f"{path} holds {len(design.layers)} layers and not what they are for; write {LAYERS} "
        f'beside it, with a row "{path.name},ROLE,{which}/NUMBER" a layer under '
        f'"file,role,layer"{of}, and import the folder{strange if unread else ""}'
    )


def _is_read(design: CadDesign, index: int) -> bool:
    try:
        needed = design.needed(index)
    except DesignError:
        return False
    return all(design.operations[number].kind in OPERATIONS for number in needed)
