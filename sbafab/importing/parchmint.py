"""Circuits in ParchMint JSON (3DuF, Neptune) as designs of drawn layers, with their nets.

Each layer of a circuit becomes a mask between two films, with its channels and the outlines of its
components. The circuit's ports are holes in the outer films; its connections are nets. In the file
lengths are in um, y points down, and a component's position is its upper left corner.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from sbafab.actuators.drawn import DRAWN
from sbafab.cutting.dxf_write import dxf_text
from sbafab.design.files import shown
from sbafab.design.outline import crossing
from sbafab.errors import DesignError
from sbafab.geometry.edges import Line, Point, box_round
from sbafab.geometry.offset import swept
from sbafab.geometry.region import Region, disc, rectangle, union
from sbafab.importing.records import Imported, file_name, key_name, named, not_json, read_text
from sbafab.laminate.netlist import NO_MASK, VIA, Spot, parchmint_labels, parchmint_nets

MM = 0.001
"""mm per unit of the file."""
MARGIN = 3.0
"""Film margin around everything drawn, mm."""
OVERHANG = 0.5
"""Mask margin around a port's hole, mm, if its disc is that large."""
LEAST_HOLE = 0.2
MOST_BYTES = 20_000_000
FARTHEST = 2_000_000.0
"""Largest coordinate, um."""
UNPLACED = (-1, -1)
PORT = "PORT"
ROUND = {PORT: "portRadius", VIA: "radius", "VALVE3D": "valveRadius"}
"""Components that are discs, with the parameter that gives their radius."""
PLAIN = frozenset({PORT, VIA, "NODE", "VALVE", "VALVE3D", "REACTION CHAMBER"})
"""Components whose outline is all that matters; for others a remark says the inside is not
drawn."""


@dataclass(frozen=True)
class Component:
    """A component: upper left corner, width and height, um; ``radius`` of those that are discs."""

    id: str
    entity: str
    layers: tuple[str, ...]
    corner: Point
    span: Point
    radius: float | None

    @property
    def centre(self) -> Point:
        return self.corner[0] + self.span[0] / 2, self.corner[1] + self.span[1] / 2


@dataclass(frozen=True)
class Connection:
    """A channel on one layer: routes of points and width, um."""

    layer: str
    routes: tuple[tuple[Point, ...], ...]
    width: float


@dataclass(frozen=True)
class Circuit:
    """A placed and routed circuit; ``layers`` go bottom to top, by id."""

    name: str
    layers: tuple[str, ...]
    titles: Mapping[str, str]
    components: Mapping[str, Component]
    connections: tuple[Connection, ...]
    labels: Mapping[Spot, str]
    nets: Mapping[str, tuple[str, ...]]
    remarks: tuple[str, ...]


def import_parchmint(path: Path) -> Imported:
    """Return the design of a placed and routed circuit. Raises DesignError with the place."""
    text = read_text(path, MOST_BYTES)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise not_json(path, error) from None
    try:
        circuit = read_circuit(document, path.stem)
        return _design(circuit)
    except DesignError as error:
        raise DesignError(f"{path}: {error}") from None


# Reading: each value is read together with its place in the file.


class JsonPlace(NamedTuple):
    """A value of the document and its place in it."""

    value: Any
    place: str

    def get(self, key: str) -> JsonPlace | None:
        """Return the value of a key of an object; None if it is missing or null."""
        if not isinstance(self.value, dict):
            raise DesignError(f"{self.place or 'the file'} is no object; export the circuit again")
        value = self.value.get(key)
        return None if value is None else JsonPlace(value, f"{self.place}.{key}".lstrip("."))

    def need(self, key: str) -> JsonPlace:
        """Return the value of a key. Raises DesignError if it is missing."""
        node = self.get(key)
        if node is None:
            raise DesignError(f"{self.place or 'the file'} has no {key}; export the circuit again")
        return node

    def items(self) -> list[JsonPlace]:
        if not isinstance(self.value, list):
            raise DesignError(f"{self.place} is no list; export the circuit again")
        return [JsonPlace(value, f"{self.place}[{i}]") for i, value in enumerate(self.value)]

    @property
    def text(self) -> str:
        if not isinstance(self.value, str):
            raise DesignError(f"{self.place} is {shown(self.value)}, which is no text")
        return self.value

    @property
    def number(self) -> float:
        value = self.value
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise DesignError(f"{self.place} is {shown(value)}, which is no number")
        if not abs(value) <= FARTHEST:
            raise DesignError(
                f"{self.place} is {value:g} um, where at most {FARTHEST:g} is allowed"
            )
        return float(value)

    @property
    def point(self) -> Point:
        """A point as [x, y] or as an object with x and y."""
        if isinstance(self.value, dict):
            return self.need("x").number, self.need("y").number
        pair = self.items()
        if len(pair) != 2:
            raise DesignError(f"{self.place} is no point of two numbers")
        return pair[0].number, pair[1].number


def read_circuit(document: Any, stem: str) -> Circuit:
    """Return the circuit of a document. Raises DesignError with the place in it."""
    root = JsonPlace(document, "")
    remarks: list[str] = []
    rows = [(row, _kind(row)) for row in root.need("layers").items()]
    order = sorted(rows, key=lambda entry: _group(entry[0]))
    titles = {row.need("id").text: _title(row) for row, kind in order if kind != NO_MASK}
    skipped = [f"layer {_title(row)}" for row, kind in rows if kind == NO_MASK]
    remarks += named("holds no channels; it is not imported", skipped)
    if not titles:
        raise DesignError("layers holds no layer with channels; export the circuit again")
    placed, routes = _features(root)
    _refuse_unplaced(root, placed)
    components: dict[str, Component] = {}
    for row in root.need("components").items():
        component = _component(row, titles, placed, remarks)
        if component is not None:
            components[component.id] = component
    connections = [
        _connection(row, titles, components, routes, remarks)
        for row in root.need("connections").items()
    ]
    name = root.get("name")
    return Circuit(
        file_name(name.text if name is not None else stem, file_name(stem)),
        tuple(titles),
        titles,
        components,
        tuple(connections),
        parchmint_labels(document),
        parchmint_nets(document),
        tuple(remarks),
    )


def _refuse_unplaced(root: JsonPlace, placed: Mapping[str, object]) -> None:
    """Raises DesignError for a netlist without placement: all components at one point, or
    nowhere.
    """
    rows = [row for row in root.need("components").items() if row.need("id").text not in placed]
    params = [row.get("params") for row in rows]
    positions = {str(p and (at := p.get("position")) and at.value) for p in params}
    if len(rows) > 1 and len(positions) == 1:
        raise DesignError(
            f"none of the {len(rows)} components has a place of its own (params.position, or a "
            "feature with its location); place and route the circuit first"
        )


def _kind(row: JsonPlace) -> str:
    kind = row.get("type")
    return kind.text.upper() if kind is not None else "FLOW"


def _group(row: JsonPlace) -> int:
    group = row.get("group")
    text = "0" if group is None else str(group.value)
    return int(text) if text.isdecimal() and len(text) < 10 else 0


def _title(row: JsonPlace) -> str:
    name = row.get("name")
    return name.text if name is not None else row.need("id").text


def _features(
    root: JsonPlace,
) -> tuple[dict[str, tuple[Point, Point]], dict[str, list[tuple[Point, Point, float]]]]:
    """Corner and span of components, and straight channels of connections, um, that are features
    of the circuit.
    """
    features = root.get("features")
    placed: dict[str, tuple[Point, Point]] = {}
    routed: dict[str, list[tuple[Point, Point, float]]] = {}
    for row in features.items() if features is not None else ():
        location, connection = row.get("location"), row.get("connection")
        if location is not None:
            span = row.need("x-span").number, row.need("y-span").number
            placed[row.need("id").text] = (location.point, span)
        if connection is not None:
            segment = row.need("source").point, row.need("sink").point, row.need("width").number
            routed.setdefault(connection.text, []).append(segment)
    return placed, routed


def _component(
    row: JsonPlace,
    titles: Mapping[str, str],
    placed: Mapping[str, tuple[Point, Point]],
    remarks: list[str],
) -> Component | None:
    """A component, or None if it lies on no layer with channels."""
    name, entity = row.need("id").text, row.need("entity").text.upper()
    here = f"component {name} ({entity}, {row.place})"
    layers = tuple(layer.text for layer in row.need("layers").items())
    on_masks = tuple(layer for layer in layers if layer in titles)
    if not on_masks:
        remarks.append(f"{here}: lies on no layer with channels; it is not imported")
        return None
    corner, span = _place(row, name, placed, here)
    if min(span) < 0 or (max(span) <= 0 and entity != "NODE"):
        raise DesignError(
            f"{here} has no size (x-span, y-span), for its kind was not known to what wrote the "
            "file; give it one, or leave it out"
        )
    if entity not in PLAIN:
        remarks.append(
            f"{here}: drawn as its box of {span[0]:g} x {span[1]:g} um at x {corner[0]:g}, "
            f"y {corner[1]:g}; what is inside is not drawn"
        )
    return Component(name, entity, on_masks, corner, span, _radius(row, entity))


def _place(
    row: JsonPlace, name: str, placed: Mapping[str, tuple[Point, Point]], here: str
) -> tuple[Point, Point]:
    if name in placed:
        return placed[name]
    params = row.get("params")
    position = params.get("position") if params is not None else None
    if position is None or position.value == list(UNPLACED):
        raise DesignError(
            f"{here} has no place (params.position, or a feature with its location); place and "
            "route the circuit first"
        )
    spans = [row.get(key) for key in ("x-span", "y-span")]
    if None in spans and params is not None:
        spans = [params.get(key) for key in ("width", "length")]
    x, y = (0.0 if span is None else span.number for span in spans)
    return position.point, (x, y)


def _radius(row: JsonPlace, entity: str) -> float | None:
    params = row.get("params")
    radius = params.get(ROUND[entity]) if params is not None and entity in ROUND else None
    return radius.number if radius is not None else None


def _connection(
    row: JsonPlace,
    titles: Mapping[str, str],
    components: Mapping[str, Component],
    routed: Mapping[str, list[tuple[Point, Point, float]]],
    remarks: list[str],
) -> Connection:
    name, layer = row.need("id").text, row.need("layer").text
    here = f"connection {name} ({row.place})"
    if layer not in titles:
        raise DesignError(f"{here} lies on a layer {shown(layer)} that has no channels")
    terminals = [row.need("source"), *row.need("sinks").items()]
    joined = tuple(terminal.need("component").text for terminal in terminals)
    strange = next((component for component in joined if component not in components), None)
    if strange is not None:
        raise DesignError(f"{here} names a component {shown(strange)} that is not there")
    for component in joined:
        if layer not in components[component].layers:
            remarks.append(
                f"{here}: ends at {component}, which is not on layer {titles[layer]}; nothing is "
                "joined there"
            )
    if name in routed:
        segments = routed[name]
        widths = {width for _, _, width in segments}
        if len(widths) > 1:
            raise DesignError(f"{here} has segments of several widths; give it one")
        return Connection(layer, tuple((a, b) for a, b, _ in segments), widths.pop())
    paths = row.get("paths")
    routes = []
    for path in paths.items() if paths is not None else ():
        points = path.get("wayPoints")
        if points is not None and points.items():
            routes.append(tuple(point.point for point in points.items()))
    if not routes:
        raise DesignError(
            f"{here} has no path (paths[].wayPoints, or features); route the circuit first"
        )
    params = row.get("params")
    width = params and (params.get("channelWidth") or params.get("width"))
    if not width or width.number <= 0:
        raise DesignError(f"{here} has no width (params.channelWidth); add it, in um")
    return Connection(layer, tuple(routes), width.number)


# The laminate of a circuit.


class _Frame(NamedTuple):
    """Converts points of the file to mm, y upward, with the middle of the circuit at (0, 0)."""

    middle: Point

    def point(self, p: Point) -> Point:
        x, y = (p[0] - self.middle[0]) * MM, (self.middle[1] - p[1]) * MM
        return round(x, 6) + 0.0, round(y, 6) + 0.0

    def of_file(self, p: Point) -> Point:
        """Return the point of the file, um, for a point in mm."""
        return self.middle[0] + p[0] / MM, self.middle[1] - p[1] / MM


def _design(circuit: Circuit) -> Imported:
    frame = _Frame(_middle(circuit))
    remarks = list(circuit.remarks)
    drawn = {layer: _mask(circuit, layer, frame) for layer in circuit.layers}
    masks = {layer: mask for layer, mask in drawn.items() if not mask.is_empty}
    empty = [f"layer {circuit.titles[layer]}" for layer in drawn if layer not in masks]
    remarks += named("holds nothing; it is not imported", empty)
    for key, mask in masks.items():
        _refuse_touching(mask, circuit.titles[key], frame)
    if not masks:
        raise DesignError("no layer holds anything; there is nothing to import")
    numbers = {layer: 2 * i + 2 for i, layer in enumerate(masks)}
    top = 2 * len(masks) + 1
    low_x, low_y, high_x, high_y = box_round([mask.bounds for mask in masks.values()])
    plain = rectangle((low_x - MARGIN, low_y - MARGIN), (high_x + MARGIN, high_y + MARGIN))
    holes, ports = _ports(circuit, frame, numbers, top, remarks)
    if not any(row.get("kind") == "hole" for row in ports):
        _refuse_without_holes(circuit)
    films = {n: plain - union(holes.get(n, ())) for n in range(1, top + 1, 2)}

    shapes: dict[str, dict[str, Any]] = {}
    drawings: dict[str, bytes] = {}
    names: dict[Region, str] = {}
    layers = []
    for number in range(1, top + 1):
        layer = [*masks][number // 2 - 1] if number % 2 == 0 else None
        region = films[number] if layer is None else masks[layer]
        title = "film" if layer is None else circuit.titles[layer]
        if region not in names:
            names[region] = key_name(title, shapes, "layer-")
            shapes[names[region]] = {"file": f"{names[region]}.dxf"}
            drawings[f"{names[region]}.dxf"] = dxf_text(region.contours, {}).encode()
        role = "chamber-mask" if layer is not None else _film_role(number, top)
        row: dict[str, Any] = {"role": role, "shape": names[region]}
        if len(region.pieces) > 1:
            row["pieces"] = len(region.pieces)
        layers.append(row)
    tables: dict[str, Any] = {
        "name": circuit.name,
        "family": DRAWN,
        "layers": layers,
        "ports": ports,
        "shapes": shapes,
        "nets": {name: [*members] for name, members in circuit.nets.items()},
    }
    tube = _tube(circuit, ports)
    if tube is not None:
        tables["inlet"] = {"tube_outer_diameter": tube}
        remarks.append(
            f"tubes: a ParchMint file names none, so they are {tube:g} mm outside, as wide as its "
            "widest port"
        )
    remarks.append("films: a ParchMint file names none, so layers are of tpe and ptfe as in layup")
    return Imported(tables, drawings, tuple(remarks))


def _tube(circuit: Circuit, ports: Sequence[Mapping[str, Any]]) -> float | None:
    """Outer diameter of a tube as wide as the widest port with a hole, mm; None without such a
    port.
    """
    holes = {row["name"] for row in ports if row.get("kind") == "hole"}
    radii = [
        circuit.components[name].radius
        for (_, name), label in circuit.labels.items()
        if label in holes
    ]
    return max((round(2 * radius * MM, 6) for radius in radii if radius is not None), default=None)


def _film_role(number: int, top: int) -> str:
    return "base" if number == 1 else "cap" if number == top else "wall"


def _middle(circuit: Circuit) -> Point:
    """The middle of the bounding box of all components and routes, um."""
    points = [
        (component.corner[0] + share * component.span[0], component.corner[1] + share * span)
        for component in circuit.components.values()
        for share in (0, 1)
        for span in component.span[1:]
    ]
    points += [p for connection in circuit.connections for r in connection.routes for p in r]
    if not points:
        raise DesignError("components and connections are empty; there is nothing to import")
    (xs, ys) = zip(*points, strict=True)
    return round((min(xs) + max(xs)) / 2), round((min(ys) + max(ys)) / 2)


def _mask(circuit: Circuit, layer: str, frame: _Frame) -> Region:
    """The channels and components of a layer."""
    parts = [
        _outline(component, frame)
        for component in circuit.components.values()
        if layer in component.layers and max(component.span) > 0
    ]
    for connection in circuit.connections:
        if connection.layer == layer:
            parts += [_channel(route, connection, frame) for route in connection.routes]
    return union(part for part in parts if not part.is_empty)


def _refuse_touching(mask: Region, title: str, frame: _Frame) -> None:
    """Raises DesignError if contours touch at a single point: whether they connect is ambiguous."""
    place = crossing(tuple(edge for contour in mask.contours for edge in contour.edges))
    if place is not None:
        x, y = frame.of_file(place)
        raise DesignError(
            f"layer {title}: channels or components touch in a single point at x {x:.6g}, "
            f"y {y:.6g} um; draw them apart, or over each other"
        )


def _outline(component: Component, frame: _Frame) -> Region:
    if component.radius is not None:
        return disc(frame.point(component.centre), component.radius * MM)
    (x, y), (across, down) = component.corner, component.span
    if min(across, down) <= 0:
        return Region()
    return rectangle(frame.point((x, y + down)), frame.point((x + across, y)))


def _channel(route: Sequence[Point], connection: Connection, frame: _Frame) -> Region:
    points = [frame.point(p) for p in route]
    lines = tuple(Line(a, b) for a, b in pairwise(points) if math.dist(a, b) > MM)
    if not lines:
        return disc(points[0], connection.width * MM / 2)
    if math.dist(lines[0].start, lines[-1].end) > MM:
        return swept(lines, connection.width * MM, True)
    return union(swept((line,), connection.width * MM, True) for line in lines)


def _ports(
    circuit: Circuit,
    frame: _Frame,
    numbers: Mapping[str, int],
    top: int,
    remarks: list[str],
) -> tuple[dict[int, list[Region]], list[dict[str, Any]]]:
    """Holes by film number, and the ports: tube holes, and one place per component."""
    holes: dict[int, list[Region]] = {}
    rows = []
    for (layer, name), label in circuit.labels.items():
        component, number = circuit.components[name], numbers[layer]
        at = frame.point(component.centre)
        row: dict[str, Any] = {"name": label, "layers": [number - 1, number + 1], "at": [*at]}
        if component.entity == PORT and component.radius is not None:
            if number + 1 == top or number == 2:
                film = number + 1 if number + 1 == top else 1
                holes.setdefault(film, []).append(disc(at, _hole(component.radius)))
                row["kind"] = "hole"
            else:
                remarks.append(
                    f"port {name} at x {component.centre[0]:g}, y {component.centre[1]:g}: lies "
                    "between inner films, which no tube reaches; it has no hole"
                )
        rows.append(row)
    for component in circuit.components.values():
        between = sorted(numbers[layer] for layer in component.layers if layer in numbers)
        if component.entity == VIA and component.radius is not None and len(between) > 1:
            for number in range(between[0] + 1, between[-1], 2):
                hole = disc(frame.point(component.centre), _hole(component.radius))
                holes.setdefault(number, []).append(hole)
    return holes, rows


def _refuse_without_holes(circuit: Circuit) -> NoReturn:
    """Raises DesignError if no tube can be joined to the circuit."""
    named_ports = [c.id for c in circuit.components.values() if c.entity == PORT]
    if not named_ports:
        raise DesignError("components holds no PORT, so no tube can be joined; add one")
    unsized = [c.id for c in circuit.components.values() if c.entity == PORT and c.radius is None]
    if unsized:
        raise DesignError(
            f"component {unsized[0]} (PORT) has no params.portRadius, and no other port has a hole "
            "for a tube; add it, in um"
        )
    raise DesignError(
        f"component {named_ports[0]} (PORT) and all others lie between inner films, which no tube "
        "reaches; place one on the bottom or the top layer"
    )


def _hole(radius: float) -> float:
    """Hole radius, mm, that leaves one overhang of its mask's disc if there is room."""
    return max(radius * MM - OVERHANG, min(LEAST_HOLE, radius * MM / 2))
