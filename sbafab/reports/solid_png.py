"""preview/solid.png: the flat actuator in shaded 3D, cut open at one chamber.

A laminate is a stack of prisms seen from above, so painting it from the bottom up gives correct
occlusion; within one prism the walls go far to near, then its top face.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region, polygon
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.solid import body_bond, parted
from sbafab.reports.canvas import Canvas, Tone, keyhole

ELEVATION = math.radians(36.0)
TURN = math.radians(62.0)
"""Angle of the eye from the face of the cut that runs through the inlet."""
LIGHT = math.radians(-50.0)
FACTORS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30)
HEIGHT_SHARE = 0.6
SUPERSAMPLE = 2
MARGIN, FOOT = 0.05, 0.09
SAGITTA_PX = 0.4


class Prism(NamedTuple):
    """A region from ``z`` up by ``thickness`` (true mm); its top is in shade where ``covered``."""

    name: str
    region: Region
    covered: Region
    z: float
    thickness: float
    bond: bool


class Camera(NamedTuple):
    """A parallel projection: plan and true height in mm to pixels, x right and y down."""

    right: Point
    toward: Point
    scale: float
    rise: float
    centre: Point

    def flat(self, p: Point) -> Point:
        """A point of the press plate."""
        along = p[0] * self.toward[0] + p[1] * self.toward[1]
        across = p[0] * self.right[0] + p[1] * self.right[1]
        return (
            self.centre[0] + self.scale * across,
            self.centre[1] + self.scale * along * math.sin(ELEVATION),
        )

    def lift(self, z: float) -> float:
        """Pixels upward for a true height."""
        return z * self.rise


class Wall(NamedTuple):
    """One facet of a prism's side that faces the eye, on the press plate, in pixels."""

    start: Point
    end: Point
    tone: Tone
    level: float


class Shape(NamedTuple):
    """A prism's region seen by the camera at z = 0: walls far to near, and pieces with holes."""

    walls: list[Wall]
    faces: list[list[list[Point]]]
    shade: list[list[list[Point]]]


def solid_png(laminate: Laminate, width: int = 1600, height: int = 1200) -> bytes:
    """The TPE solid, cut open at one chamber, as PNG; with the height exaggerated as stated in its
    caption.
    """
    laminate = parted(laminate)
    cut = cutaway(laminate)
    factor = _factor(laminate)
    camera = _camera(laminate, cut, factor, width * SUPERSAMPLE, height * SUPERSAMPLE)
    canvas = Canvas(width, height, SUPERSAMPLE)
    shapes: dict[str, Shape] = {}
    for prism in _prisms(laminate):
        if prism.name not in shapes:
            shapes[prism.name] = _shape(prism, cut, camera)
        _paint(prism, shapes[prism.name], camera, canvas)
    base = next(iter(shapes.values()))
    content = f"{laminate.balloons} balloons" if laminate.balloons > 1 else "one balloon"
    caption = (
        f"{laminate.name}: {laminate.bonded_materials} solid of {content} before inflation, cut "
        f"open at {cut.chamber}; height exaggerated {factor} times"
        + "".join(f"; {note}" for note in laminate.notes)
    )
    return canvas.png([rings[0] for rings in base.faces], caption, laminate.bonded_materials)


def _factor(laminate: Laminate) -> int:
    """A round factor of exaggeration that gives a pleasing height."""
    breadth = math.sqrt(laminate.layers[-1].profile.area)
    most = HEIGHT_SHARE * breadth / laminate.thickness
    return max(step for step in FACTORS if step <= max(most, 1.0))


def _camera(laminate: Laminate, cut: RemovedSector, factor: int, width: int, height: int) -> Camera:
    """The camera that looks into the cut and fills the picture."""
    angle = cut.last - TURN
    toward = math.cos(angle), math.sin(angle)
    right = -toward[1], toward[0]
    plain = Camera(right, toward, 1.0, factor * math.cos(ELEVATION), (0.0, 0.0))
    points = [
        plain.flat(p)
        for layers in laminate.patterns.values()
        if not layers[0].is_mask
        for contour in layers[0].profile.outers
        for p in contour.polygon(0.05)
    ]
    low_x, high_x = min(p[0] for p in points), max(p[0] for p in points)
    low_y, high_y = min(p[1] for p in points), max(p[1] for p in points)
    low_y -= plain.lift(laminate.thickness)
    room_x, room_y = width * (1 - 2 * MARGIN), height * (1 - 2 * MARGIN - FOOT)
    scale = min(room_x / (high_x - low_x), room_y / (high_y - low_y))
    centre = (
        width / 2 - scale * (low_x + high_x) / 2,
        height * (1 - FOOT) / 2 - scale * (low_y + high_y) / 2,
    )
    return Camera(right, toward, scale, plain.rise * scale, centre)


def _prisms(laminate: Laminate) -> Iterator[Prism]:
    """Films and the bonds in the gaps between them, bottom to top."""
    above = {interface.below.index: interface for interface in laminate.interfaces}
    for layer in laminate.tpe_layers:
        interface = above.get(layer.index)
        thickness = layer.film.thickness
        if interface is None or not interface.gap:
            yield Prism(layer.pattern, layer.profile, Region(), layer.z, thickness, False)
            continue
        name, bond = " ".join(interface.pattern), body_bond(laminate, interface)
        void = interface.unbonded if bond is interface.bond else interface.contact - bond
        yield Prism(name, layer.profile, void, layer.z, thickness, False)
        yield Prism(f"bond {name}", bond, Region(), interface.z, interface.gap, True)


def _shape(prism: Prism, cut: RemovedSector, camera: Camera) -> Shape:
    region = prism.region - cut.removed
    sagitta = SAGITTA_PX / camera.scale
    walls = sorted(_walls(region, prism.bond, cut, camera, sagitta), key=_depth)
    return Shape(
        walls,
        [] if prism.bond else _on_page(region, camera, sagitta),
        _on_page(prism.covered - cut.removed, camera, sagitta),
    )


def _depth(wall: Wall) -> float:
    return wall.start[1] + wall.end[1]


def _walls(
    region: Region, bond: bool, cut: RemovedSector, camera: Camera, sagitta: float
) -> Iterator[Wall]:
    """The facets that face the eye; material lies on the left of each, so right is outward."""
    light = cut.last - TURN + LIGHT
    for contour in region.contours:
        points = contour.polygon(sagitta)
        for start, end in zip(points, points[1:] + points[:1], strict=True):
            nx, ny = end[1] - start[1], start[0] - end[0]
            length = math.hypot(nx, ny)
            if nx * camera.toward[0] + ny * camera.toward[1] <= 1e-6 * length:
                continue
            on_cut = cut.on_face(Line(start, end))
            tone: Tone = "bond" if bond else "film"
            if on_cut:
                tone = "cut bond" if bond else "cut film"
            lit = (nx * math.cos(light) + ny * math.sin(light)) / length
            level = 0.92 + 0.08 * lit if on_cut else 0.74 + 0.22 * lit
            yield Wall(camera.flat(start), camera.flat(end), tone, level)


def _on_page(region: Region, camera: Camera, sagitta: float) -> list[list[list[Point]]]:
    return [
        [[camera.flat(p) for p in ring] for ring in piece] for piece in region.polygons(sagitta)
    ]


def _paint(prism: Prism, shape: Shape, camera: Camera, canvas: Canvas) -> None:
    low, high = camera.lift(prism.z), camera.lift(prism.z + prism.thickness)
    for (x0, y0), (x1, y1), tone, level in shape.walls:
        quad = [(x0, y0 - low), (x1, y1 - low), (x1, y1 - high), (x0, y0 - high)]
        canvas.fill(quad, tone, level)
    for rings in shape.faces:
        canvas.fill(_raised(keyhole(rings), high), "film", 1.0)
    for rings in shape.shade:
        canvas.fill(_raised(keyhole(rings), high), "shade", 1.0)
    for rings in shape.faces:
        for ring in rings:
            canvas.outline(_raised(ring, high))


def _raised(points: list[Point], lift: float) -> list[Point]:
    return [(x, y - lift) for x, y in points]


# The sector that the picture cuts away, so that pockets, bores and neck rings show.


LEAST_SECTOR = math.radians(44.0)


@dataclass(frozen=True)
class RemovedSector:
    """A sector with its tip at ``apex``, counter-clockwise from angle ``first`` to ``last``."""

    chamber: str
    apex: Point
    first: float
    last: float
    removed: Region

    def on_face(self, edge: Edge) -> bool:
        """Return True if an edge lies on one of the two faces of the cut."""
        if not isinstance(edge, Line):
            return False
        return any(
            all(_off_ray(self.apex, angle, p) < 1e-5 for p in (edge.start, edge.end))
            for angle in (self.first, self.last)
        )


def cutaway(laminate: Laminate) -> RemovedSector:
    """The sector beside one chamber: a face runs through its middle and along its inlet.

    Round a lumen the tip is on the actuator's axis and the other face runs between two lobes;
    else the tip is the chamber's middle and the sector a quarter. Without chambers it is a port.
    """
    inlet = next(iter(laminate.inlets), None)
    u, v = inlet.direction if inlet else (1.0, 0.0)
    last = math.atan2(v, u)
    count = len(laminate.chambers)
    if laminate.lumen and count > 1:
        sector = math.pi / count
        while sector < LEAST_SECTOR:
            sector += math.tau / count
        return _sector(laminate, laminate.chambers[0].name, (0.0, 0.0), last - sector, last)
    # The chamber at the sector's open side: the quarter then cuts no other.
    places = [(p, chamber.name) for chamber in laminate.chambers for p in chamber.centres]
    places = places or [(port.at, port.name) for port in laminate.ports]
    apex, name = max(places, key=lambda place: place[0][0] * v - place[0][1] * u)
    return _sector(laminate, name, apex, last - math.pi / 2, last)


def _sector(
    laminate: Laminate, chamber: str, apex: Point, first: float, last: float
) -> RemovedSector:
    low_x, low_y, high_x, high_y = laminate.bounds
    reach = 4.0 * math.hypot(high_x - low_x, high_y - low_y)
    x, y = apex
    rays = [first, (first + last) / 2, last]
    tips = [(x + reach * math.cos(a), y + reach * math.sin(a)) for a in rays]
    return RemovedSector(chamber, apex, first, last, polygon([apex, *tips]))


def _off_ray(apex: Point, angle: float, p: Point) -> float:
    return abs((p[0] - apex[0]) * math.sin(angle) - (p[1] - apex[1]) * math.cos(angle))
