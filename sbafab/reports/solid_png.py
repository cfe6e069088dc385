"""preview/solid.png: the flat actuator in shaded 3D, cut open at one chamber; and
preview/assembled.png: an assembly at true proportions, one colour per part, with a length bar.

A laminate is a stack of prisms seen from above, so painting it from the bottom up gives correct
occlusion; within one prism the walls go far to near, then its top face.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.shapes import colours, placed_surface
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, polygon
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.solid import body_bond, parted
from sbafab.meshing.surface import Surface
from sbafab.reports.canvas import (
    COLOURS,
    ENLARGED,
    KEY,
    PAPER,
    RGB,
    Floats,
    View,
    draw_length_bar,
    edges,
    framed,
    image_of,
    inscribe,
    png,
    rasterize,
    view_of,
)

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw as Draw

ELEVATION = 36.0
TURN = math.radians(62.0)  # of the eye from the face of the cut that runs through the inlet
LIGHT = math.radians(-50.0)
FACTORS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30)
HEIGHT_SHARE = 0.6
MARGIN, FOOT = 0.05, 0.09
SAGITTA_PX = 0.4
SHADOW, BLUR, COARSE = 70, 8, 8
"""Depth of the shadow of 255, its softness, and the pixels across which it is drawn as one."""


class Prism(NamedTuple):
    """A region from ``z`` up by ``thickness`` (true mm); its top is in shade where ``covered``."""

    name: str
    region: Region
    covered: Region
    z: float
    thickness: float
    bond: bool


class Shape(NamedTuple):
    """A prism seen at z = 0, in pixels: the facets of its side that face the eye, each with its
    colour, far to near; tops and their shaded places; outlines of tops.
    """

    walls: list[tuple[Point, Point, RGB]]
    tops: list[list[Point]]
    shades: list[list[Point]]
    rings: list[list[list[Point]]]


def solid_png(laminate: Laminate, width: int = 1600, height: int = 1200) -> bytes:
    """The TPE solid, cut open at one chamber, as PNG; with the height exaggerated as stated in its
    caption.
    """
    from PIL import ImageDraw

    laminate = parted(laminate)
    cut = cutaway(laminate)
    breadth = math.sqrt(laminate.layers[-1].profile.area)
    most = HEIGHT_SHARE * breadth / laminate.thickness
    factor = max(step for step in FACTORS if step <= max(most, 1.0))
    size = width * ENLARGED, height * ENLARGED
    top = factor * laminate.thickness
    films = [layers[0] for layers in laminate.patterns.values() if not layers[0].is_mask]
    outlines = [contour.polygon(0.05) for film in films for contour in film.profile.outers]
    corners = [(*p, z) for outline in outlines for p in outline for z in (0.0, top)]
    outline = Surface(np.array(corners), np.empty((0, 3), dtype=np.int64))
    box = framed(*size, MARGIN, FOOT)
    view = view_of([outline], ELEVATION, math.degrees(cut.last - TURN), box)
    prisms = list(_prisms(laminate))
    distinct = {prism.name: prism for prism in reversed(prisms)}
    shapes = {name: _shape(prism, cut, view) for name, prism in distinct.items()}
    picture = _backdrop([rings[0] for rings in shapes[prisms[0].name].rings], size)
    draw = ImageDraw.Draw(picture)
    for prism in prisms:
        _paint(prism, shapes[prism.name], factor * view.axes[1, 2] * view.scale, draw)
    picture = picture.reduce(ENLARGED)
    material = laminate.bonded_materials
    content = f"{laminate.balloons} balloons" if laminate.balloons > 1 else "one balloon"
    caption = (
        f"{laminate.name}: {material} solid of {content} before inflation, cut "
        f"open at {cut.chamber}; height exaggerated {factor} times"
        + "".join(f"; {note}" for note in laminate.notes)
    )
    legend = [(COLOURS[tone], material if tone == "film" else words) for tone, words in KEY]
    inscribe(picture, [caption], max(15, round(height / 52)), legend)
    return png(picture)


def _backdrop(footprint: Sequence[Sequence[Point]], size: tuple[int, int]) -> Image:
    """White paper with the soft shadow of the footprint."""
    from PIL import Image, ImageDraw, ImageFilter

    small = Image.new("L", (size[0] // COARSE, size[1] // COARSE), PAPER[0])
    draw = ImageDraw.Draw(small)
    for ring in footprint:
        draw.polygon([(x / COARSE + 2, y / COARSE + 4) for x, y in ring], fill=PAPER[0] - SHADOW)
    return (
        small.filter(ImageFilter.GaussianBlur(BLUR))
        .resize(size, Image.Resampling.BILINEAR)
        .convert("RGB")
    )


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


def _shape(prism: Prism, cut: RemovedSector, view: View) -> Shape:
    region = prism.region - cut.removed
    sagitta = SAGITTA_PX / view.scale
    rings, shades = (
        [[_flat(view, ring) for ring in piece] for piece in shown.polygons(sagitta)]
        for shown in (region, prism.covered - cut.removed)
    )
    walls = [
        wall
        for contour in region.contours
        for wall in _walls(np.array(contour.polygon(sagitta)), prism.bond, cut, view)
    ]
    return Shape(
        sorted(walls, key=lambda wall: wall[0][1] + wall[1][1]),
        [] if prism.bond else [keyhole(piece) for piece in rings],
        [keyhole(piece) for piece in shades],
        rings,
    )


def _flat(view: View, points: Sequence[Point] | Floats) -> list[Point]:
    """Points of the press plate in pixels."""
    pixels = view.flat(np.column_stack([points, np.zeros(len(points))]))
    return list(map(tuple, pixels[:, :2].tolist()))


def _walls(
    points: Floats, bond: bool, cut: RemovedSector, view: View
) -> Iterator[tuple[Point, Point, RGB]]:
    """The facets that face the eye; material lies on the left of each, so right is outward."""
    along = np.roll(points, -1, axis=0) - points
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = cut.last - TURN + LIGHT
    lit = normals @ (math.cos(light), math.sin(light))
    near_cut = cut.on_faces(points)
    on_cut = np.any(near_cut & np.roll(near_cut, -1, axis=1), axis=0)
    levels = np.where(on_cut, 0.92 + 0.08 * lit, 0.74 + 0.22 * lit)
    kind = "bond" if bond else "film"
    pixels = _flat(view, points)
    toward = view.axes[2, :2] / np.linalg.norm(view.axes[2, :2])
    for i in np.flatnonzero(normals @ toward > 1e-6):
        tone = COLOURS[f"cut {kind}" if on_cut[i] else kind]
        r, g, b = (min(255, round(part * levels[i])) for part in tone)
        yield pixels[i], pixels[(i + 1) % len(pixels)], (r, g, b)


def _paint(prism: Prism, shape: Shape, rise: float, draw: Draw) -> None:
    """Paint a prism; ``rise`` is pixels upward per mm of true height."""
    low, high = rise * prism.z, rise * (prism.z + prism.thickness)
    for (x0, y0), (x1, y1), colour in shape.walls:
        draw.polygon([(x0, y0 - low), (x1, y1 - low), (x1, y1 - high), (x0, y0 - high)], colour)
    for faces, tone in ((shape.tops, "film"), (shape.shades, "shade")):
        for ring in faces:
            draw.polygon([(x, y - high) for x, y in ring], COLOURS[tone])
    for pieces in () if prism.bond else shape.rings:
        for ring in pieces:
            closed = [(x, y - high) for x, y in (*ring, ring[0])]
            draw.line(closed, COLOURS["line"], width=ENLARGED)


def keyhole(rings: Sequence[Sequence[Point]]) -> list[Point]:
    """One closed ring for a piece with holes: a slit joins each hole to the contour right of it."""
    merged = list(rings[0])
    for hole in sorted(rings[1:], key=lambda ring: -max(ring)[0]):
        first = max(range(len(hole)), key=lambda i: hole[i])
        x, y = hole[first]
        after, landing = _first_right_of(merged, x, y)
        merged[after:after] = [landing, *hole[first:], *hole[:first], (x, y), landing]
    return merged


def _first_right_of(ring: Sequence[Point], x: float, y: float) -> tuple[int, Point]:
    """Return first point at which a ray to the right meets the ring, and the vertex after it."""
    meets = (
        (x1 - (x1 - x0) * (y1 - y) / (y1 - y0), i)
        for i, ((x0, y0), (x1, y1)) in enumerate(zip((ring[-1], *ring), ring, strict=False))
        if (y0 <= y) != (y1 <= y)
    )
    across, after = min(meet for meet in meets if meet[0] >= x)
    return after, (across, y)


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

    def on_faces(self, points: Floats) -> NDArray[np.bool_]:
        """Return for each of the two faces of the cut which points (n, 2) lie on it."""
        rays = np.array([[math.sin(a), -math.cos(a)] for a in (self.first, self.last)])
        return np.asarray(np.abs(rays @ (points - self.apex).T) < 1e-5)


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
        apex, name, first = (0.0, 0.0), laminate.chambers[0].name, last - sector
    else:
        # The chamber at the sector's open side: the quarter then cuts no other.
        places = [(p, chamber.name) for chamber in laminate.chambers for p in chamber.centres]
        places = places or [(port.at, port.name) for port in laminate.ports]
        apex, name = max(places, key=lambda place: place[0][0] * v - place[0][1] * u)
        first = last - math.pi / 2
    low_x, low_y, high_x, high_y = laminate.bounds
    reach = 4.0 * math.hypot(high_x - low_x, high_y - low_y)
    rays = [first, (first + last) / 2, last]
    tips = [(apex[0] + reach * math.cos(a), apex[1] + reach * math.sin(a)) for a in rays]
    return RemovedSector(name, apex, first, last, polygon([apex, *tips]))


# An assembly before inflation.


SEEN_FROM = 22.0, -58.0  # elevation over the bench, and azimuth from x, degrees
LAMP = (-0.35, 0.55, 0.76)
RIM, LEGEND = 0.06, 0.17
STEP_MM = 0.25  # jump in depth that is drawn as an edge


def assembly_png(
    assembled: Assembled, note: str = "", width: int = 1040, height: int = 780
) -> bytes:
    """The assembly before inflation, seen from the front above, as PNG; ``note`` ends its caption.

    Inlet tubes and what the films enclose are not shown.
    """
    return assembly_pngs(assembled, note, width, height)[0]


def assembly_pngs(
    assembled: Assembled, note: str = "", width: int = 1040, height: int = 780
) -> tuple[bytes, bytes]:
    """Return that picture, and one without caption and legend for pages with their own."""
    from PIL import ImageDraw, ImageFont

    surfaces = [placed_surface(placed, filled=True) for placed in assembled.parts]
    size = width * ENLARGED, height * ENLARGED
    view = view_of(surfaces, *SEEN_FROM, framed(*size, RIM, LEGEND))
    length = math.hypot(*LAMP)
    buffer = rasterize(surfaces, view, *size, [part / length for part in LAMP])
    paints = colours(assembled)
    # The content of a tube does not show through: no part is transparent.
    palette = np.array([*(paints[placed.name] for placed in assembled.parts), PAPER], dtype=float)
    rgb = palette[buffer.body] * np.where(buffer.body < 0, 1.0, buffer.light)[:, :, None]
    # Darker where one body or one step ends against another.
    rgb[edges(buffer, STEP_MM, borders=True)] *= 0.45
    picture = image_of(rgb)
    bare = picture.crop((0, 0, width, round((1 - LEGEND / 2) * height)))
    # Alone, the bar has letters that stay legible when the picture is printed small.
    font, scale = ImageFont.load_default(round(width / 32)), view.scale / ENLARGED
    right, low = 0.97 * width, 0.96 * bare.height
    draw_length_bar(ImageDraw.Draw(bare), right, low, width / 4, scale, font)
    caption = f"{assembled.assembly.name}, before inflation, nominal films, true proportions{note}"
    legend = _legend(assembled, paints)
    inscribe(picture, [caption], max(10, round(height / 46)), legend, scale)
    return png(picture), png(bare)


def _legend(assembled: Assembled, paints: Mapping[str, RGB]) -> list[tuple[RGB, str]]:
    """One line per colour: the parts that have it, and what they are."""
    lines: dict[tuple[RGB, str], list[str]] = {}
    for placed in assembled.parts:
        kind = placed.part.kind if placed.made is None else placed.made.design.name
        lines.setdefault((paints[placed.name], kind), []).append(placed.name)
    return [
        (colour, ", ".join(names) if [kind] == names else f"{', '.join(names)} ({kind})")
        for (colour, kind), names in lines.items()
    ]
