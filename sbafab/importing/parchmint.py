"""Circuits in ParchMint JSON (3DuF, Neptune) as designs of drawn layers, with their nets.

Each layer of a circuit becomes a mask between two films, with its channels and the outlines of its
components. The circuit's ports are holes in the outer films; its connections are nets. In the file
lengths are in um, y points down, and a component's position is its upper left corner.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from sbafab.actuators.drawn import DRAWN
from sbafab.cutting.dxf_write import dxf_text
from sbafab.design.files import checked, name_of, read_text, shown
from sbafab.design.outline import crossing
from sbafab.errors import DesignError
from sbafab.geometry.edges import Line, Point, box_round
from sbafab.geometry.offset import swept
from sbafab.geometry.region import Region, disc, rectangle, union
from sbafab.importing.records import UNNAMED, Imported, json_of, key_name, named
from sbafab.laminate.netlist import NO_MASK, VIA, parchmint_labels, parchmint_nets

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
PORT = "PORT"
ROUND = {PORT: "portRadius", VIA: "radius", "VALVE3D": "valveRadius"}
"""Components that are discs, with the parameter that gives their radius."""
PLAIN = frozenset({PORT, VIA, "NODE", "VALVE", "VALVE3D", "REACTION CHAMBER"})
"""Components that are their outline; for others a remark says that the inside is not drawn."""


# The keys of the file that are read; others are ignored.


def _pair(value: object) -> object:
    """Return a point as [x, y] or as an object with x and y."""
    return [value.get("x"), value.get("y")] if isinstance(value, Mapping) else value


Um = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
UmPoint = Annotated[tuple[Um, Um], Field(strict=False), BeforeValidator(_pair)]


class JsonRow(BaseModel):
    """An object of the file."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class Params(JsonRow):
    """Parameters of a component or a connection."""

    position: UmPoint | None = None
    width: Um | None = None
    length: Um | None = None
    channelWidth: Um | None = None  # noqa: N815
    radius: Um | None = None
    portRadius: Um | None = None  # noqa: N815
    valveRadius: Um | None = None  # noqa: N815


class CircuitLayer(JsonRow):
    """A layer; layers of one group are below the next group's."""

    id: str
    name: str | None = None
    type: str | None = None
    group: Any = None

    @property
    def is_mask(self) -> bool:
        return (self.type or "").upper() != NO_MASK

    @property
    def group_number(self) -> int:
        text = str(self.group)
        return int(text) if text.isdecimal() and len(text) < 10 else 0


class ComponentRow(JsonRow):
    """A component on one or more layers."""

    id: str
    entity: str
    layers: list[str]
    params: Params | None = None
    x_span: Um | None = Field(default=None, alias="x-span")
    y_span: Um | None = Field(default=None, alias="y-span")


class End(JsonRow):
    """An end of a connection."""

    component: str


class PathRow(JsonRow):
    """A routed path of a connection."""

    wayPoints: list[UmPoint] | None = None  # noqa: N815


class ConnectionRow(JsonRow):
    """A connection of components on one layer."""

    id: str
    layer: str
    source: End
    sinks: list[End]
    params: Params | None = None
    paths: list[PathRow] | None = None


class FeatureRow(JsonRow):
    """The place of a component, or a straight channel of a connection."""

    id: str | None = None
    location: UmPoint | None = None
    x_span: Um = Field(default=0.0, alias="x-span")
    y_span: Um = Field(default=0.0, alias="y-span")
    connection: str | None = None
    source: UmPoint | None = None
    sink: UmPoint | None = None
    width: Um = 0.0


class CircuitFile(JsonRow):
    """A circuit."""

    name: str | None = None
    layers: list[CircuitLayer]
    components: list[ComponentRow]
    connections: list[ConnectionRow]
    features: list[FeatureRow] | None = None


def import_parchmint(path: Path) -> Imported:
    """Return the design of a placed and routed circuit. Raises DesignError with the place."""
    document = json_of(path, read_text(path, MOST_BYTES))
    try:
        return Circuit(document, path.stem).design()
    except DesignError as error:
        raise DesignError(f"{path}: {error}") from None


# The circuit: its components and channels with their places.


class Component(NamedTuple):
    """A component: upper left corner, width and height, um; ``radius`` if it is a disc."""

    id: str
    entity: str
    layers: list[str]
    corner: Point
    span: Point
    radius: float | None

    @property
    def centre(self) -> Point:
        return self.corner[0] + self.span[0] / 2, self.corner[1] + self.span[1] / 2

    @property
    def corners(self) -> tuple[Point, Point]:
        (x, y), (across, down) = self.corner, self.span
        return (x, y), (x + across, y + down)


class Circuit:
    """A placed and routed circuit.

    ``titles`` of layers by id, bottom to top; ``channels`` as layer, points and width, um;
    ``remarks`` about items that are not imported as drawn.
    """

    def __init__(self, document: Mapping[str, Any], stem: str) -> None:
        """Read a circuit. Raises DesignError with the place in the file."""
        file = checked(CircuitFile, document, {}, file="circuit")
        self.name = name_of(file.name or stem) or name_of(stem) or UNNAMED
        self.nets, self.labels = parchmint_nets(document), parchmint_labels(document)
        rows = sorted(file.layers, key=lambda row: row.group_number)
        self.titles = {row.id: row.name or row.id for row in rows if row.is_mask}
        if not self.titles:
            raise DesignError("layers has no layer with channels; export the circuit again")
        skipped = [f"layer {row.name or row.id}" for row in file.layers if not row.is_mask]
        self.remarks = named("holds no channels; it is not imported", skipped)
        self.components: dict[str, Component] = {}
        self.channels: list[tuple[str, Sequence[Point], float]] = []
        features = file.features or ()
        placed = {row.id: row for row in features if row.location is not None}
        _refuse_unplaced(file.components, placed)
        for number, row in enumerate(file.components):
            self._add_component(row, placed.get(row.id), number)
        for number, connection in enumerate(file.connections):
            segments = [row for row in features if row.connection == connection.id]
            self._add_channels(connection, segments, number)
        points = [point for part in self.components.values() for point in part.corners]
        points += [point for _, route, _ in self.channels for point in route]
        if not points:
            raise DesignError("components and connections are empty; there is nothing to import")
        (xs, ys) = zip(*points, strict=True)
        self.middle = round((min(xs) + max(xs)) / 2), round((min(ys) + max(ys)) / 2)

    def _add_component(self, row: ComponentRow, feature: FeatureRow | None, number: int) -> None:
        entity, params = row.entity.upper(), row.params or Params()
        here = f"component {row.id} ({entity}, components[{number}])"
        if not self.titles.keys() & row.layers:
            self.remarks.append(f"{here}: lies on no layer with channels; it is not imported")
            return
        if feature is not None:
            corner, span = feature.location, (feature.x_span, feature.y_span)
        else:
            corner, span = params.position, (row.x_span or 0.0, row.y_span or 0.0)
            if row.x_span is None or row.y_span is None:
                span = params.width or 0.0, params.length or 0.0
        if corner is None or (feature is None and corner == (-1, -1)):
            raise DesignError(
                f"{here} has no place (params.position, or a feature with its location); place "
                "and route the circuit first"
            )
        if min(span) < 0 or (max(span) <= 0 and entity != "NODE"):
            raise DesignError(
                f"{here} has no size (x-span, y-span), because the writing program does not know "
                "its kind; add a size, or omit it"
            )
        if entity not in PLAIN:
            self.remarks.append(
                f"{here}: drawn as its box of {span[0]:g} x {span[1]:g} um at x {corner[0]:g}, "
                f"y {corner[1]:g}; what is inside is not drawn"
            )
        radius = getattr(params, ROUND[entity]) if entity in ROUND else None
        layers = [layer for layer in row.layers if layer in self.titles]
        self.components[row.id] = Component(row.id, entity, layers, corner, span, radius)

    def _add_channels(
        self, row: ConnectionRow, segments: Sequence[FeatureRow], number: int
    ) -> None:
        here = f"connection {row.id} (connections[{number}])"
        if row.layer not in self.titles:
            raise DesignError(f"{here} lies on a layer {shown(row.layer)} that has no channels")
        for end in (row.source, *row.sinks):
            if end.component not in self.components:
                raise DesignError(f"{here} names a missing component {shown(end.component)}")
            if row.layer not in self.components[end.component].layers:
                self.remarks.append(
                    f"{here}: ends at {end.component}, which is not on layer "
                    f"{self.titles[row.layer]}; nothing is joined there"
                )
        params = row.params or Params()
        routes: list[Sequence[Point]] = [
            path.wayPoints for path in row.paths or () if path.wayPoints
        ]
        widths = {params.channelWidth or params.width or 0.0}
        if segments:
            routes = [(s.source, s.sink) for s in segments if s.source and s.sink]
            widths = {segment.width for segment in segments}
        if not routes:
            raise DesignError(
                f"{here} has no path (paths[].wayPoints, or features); route the circuit first"
            )
        if len(widths) > 1:
            raise DesignError(f"{here} has segments of several widths; give it one")
        if min(widths) <= 0:
            raise DesignError(f"{here} has no width (params.channelWidth); add it, in um")
        self.channels += [(row.layer, route, min(widths)) for route in routes]

    def point(self, p: Point) -> Point:
        """Return a point of the file in mm, y upward, with the circuit's middle at (0, 0)."""
        x, y = (p[0] - self.middle[0]) * MM, (self.middle[1] - p[1]) * MM
        return round(x, 6) + 0.0, round(y, 6) + 0.0

    def mask(self, layer: str) -> Region:
        """Return the channels and components of a layer.

        Raises DesignError if contours touch at a single point, since it is ambiguous whether they
        connect.
        """
        parts = [self._outline(c) for c in self.components.values() if layer in c.layers]
        parts += [self._channel(r, width) for on, r, width in self.channels if on == layer]
        mask = union(part for part in parts if not part.is_empty)
        place = crossing(mask.edges)
        if place is not None:
            x, y = self.middle[0] + place[0] / MM, self.middle[1] - place[1] / MM
            raise DesignError(
                f"layer {self.titles[layer]}: channels or components touch in a single point at "
                f"x {x:.6g}, y {y:.6g} um; separate or overlap them"
            )
        return mask

    def _outline(self, component: Component) -> Region:
        if max(component.span) > 0 and component.radius is not None:
            return disc(self.point(component.centre), component.radius * MM)
        if min(component.span) <= 0:
            return Region()
        (left, top), (right, bottom) = component.corners
        return rectangle(self.point((left, bottom)), self.point((right, top)))

    def _channel(self, route: Sequence[Point], width: float) -> Region:
        points = [self.point(p) for p in route]
        lines = tuple(Line(a, b) for a, b in pairwise(points) if math.dist(a, b) > MM)
        if not lines:
            return disc(points[0], width * MM / 2)
        if math.dist(lines[0].start, lines[-1].end) > MM:
            return swept(lines, width * MM, True)
        return union(swept((line,), width * MM, True) for line in lines)

    # The laminate: a film under each mask, and one on top; numbers count from 1 at the bottom.

    def design(self) -> Imported:
        """Return the design of drawn layers. Raises DesignError."""
        drawn = {layer: self.mask(layer) for layer in self.titles}
        masks = {layer: mask for layer, mask in drawn.items() if not mask.is_empty}
        empty = [f"layer {self.titles[layer]}" for layer in drawn if layer not in masks]
        self.remarks += named("holds nothing; it is not imported", empty)
        if not masks:
            raise DesignError("all layers are empty; there is nothing to import")
        top = 2 * len(masks) + 1
        numbers = {layer: number for number, layer in zip(range(2, top, 2), masks, strict=True)}
        low_x, low_y, high_x, high_y = box_round([mask.bounds for mask in masks.values()])
        plain = rectangle((low_x - MARGIN, low_y - MARGIN), (high_x + MARGIN, high_y + MARGIN))
        holes: dict[int, list[Region]] = {}
        ports = self._ports(holes, numbers, top)
        if not any(row.get("kind") == "hole" for row in ports):
            raise DesignError(
                "components has no PORT with params.portRadius, um, on the bottom or top layer, "
                "where tubes connect; add one"
            )
        layers = {numbers[layer]: (self.titles[layer], mask) for layer, mask in masks.items()}
        films = range(1, top + 1, 2)
        layers |= {number: ("film", plain - union(holes.get(number, ()))) for number in films}
        shapes, drawings, layer_rows = _drawn_layers([layers[number] for number in sorted(layers)])
        tables: dict[str, Any] = {
            "name": self.name,
            "family": DRAWN,
            "layers": layer_rows,
            "ports": ports,
            "shapes": shapes,
            "nets": {name: [*members] for name, members in self.nets.items()},
        }
        tube = self._tube(ports)
        if tube is not None:
            tables["inlet"] = {"tube_outer_diameter": tube}
            self.remarks.append(
                f"tubes: a ParchMint file names none, so they are {tube:g} mm outside, as wide as "
                "its widest port"
            )
        self.remarks.append(
            "films: a ParchMint file names none, so layers are of tpe and ptfe as in layup"
        )
        return Imported(tables, drawings, tuple(self.remarks))

    def _tube(self, ports: Sequence[Mapping[str, Any]]) -> float | None:
        """Outer diameter of a tube as wide as the widest port with a hole, mm, if there is one."""
        holes = {row["name"] for row in ports if row.get("kind") == "hole"}
        named_holes = (name for (_, name), label in self.labels.items() if label in holes)
        radii = [self.components[name].radius for name in named_holes]
        return max((round(2 * radius * MM, 6) for radius in radii if radius), default=None)

    def _ports(
        self, holes: dict[int, list[Region]], numbers: Mapping[str, int], top: int
    ) -> list[dict[str, Any]]:
        """Return the ports: tube holes, and one place per component. Add ``holes`` by film."""
        rows = []
        for (layer, name), label in self.labels.items():
            component, number = self.components[name], numbers[layer]
            at = self.point(component.centre)
            row: dict[str, Any] = {"name": label, "layers": [number - 1, number + 1], "at": [*at]}
            if component.entity == PORT and component.radius is not None:
                if number + 1 == top or number == 2:
                    film = number + 1 if number + 1 == top else 1
                    holes.setdefault(film, []).append(disc(at, _hole(component.radius)))
                    row["kind"] = "hole"
                else:
                    self.remarks.append(
                        f"port {name} at x {component.centre[0]:g}, y {component.centre[1]:g}: "
                        "lies between inner films, which no tube reaches; it has no hole"
                    )
            rows.append(row)
        for component in self.components.values():
            between = sorted(numbers[layer] for layer in component.layers if layer in numbers)
            if component.entity == VIA and component.radius is not None and between:
                hole = disc(self.point(component.centre), _hole(component.radius))
                for number in range(between[0] + 1, between[-1], 2):
                    holes.setdefault(number, []).append(hole)
        return rows


def _refuse_unplaced(rows: Sequence[ComponentRow], placed: Mapping[Any, object]) -> None:
    """Raise DesignError for a netlist without placement: all components at one point or none."""
    positions = [row.params and row.params.position for row in rows if row.id not in placed]
    if len(positions) > 1 and len(set(positions)) == 1:
        raise DesignError(
            f"none of the {len(positions)} components has a distinct position (params.position, or "
            "a feature with its location); place and route the circuit first"
        )


def _drawn_layers(
    layers: Sequence[tuple[str, Region]],
) -> tuple[dict[str, dict[str, str]], dict[str, bytes], list[dict[str, Any]]]:
    """Return shapes, drawings and rows of films and masks in turn, given as title and profile."""
    shapes: dict[str, dict[str, str]] = {}
    drawings: dict[str, bytes] = {}
    names: dict[Region, str] = {}
    rows = []
    ends = {1: "base", len(layers): "cap"}
    for number, (title, region) in enumerate(layers, start=1):
        if region not in names:
            names[region] = name = key_name(title, shapes, "layer-")
            shapes[name] = {"file": f"{name}.dxf"}
            drawings[f"{name}.dxf"] = dxf_text(region.contours, {}).encode()
        role = ends.get(number, "wall") if number % 2 else "chamber-mask"
        pieces = {"pieces": len(region.pieces)} if len(region.pieces) > 1 else {}
        rows.append({"role": role, "shape": names[region], **pieces})
    return shapes, drawings, rows


def _hole(radius: float) -> float:
    """Return the hole radius, mm, that leaves one overhang of its mask's disc if there is room."""
    return max(radius * MM - OVERHANG, min(LEAST_HOLE, radius * MM / 2))
