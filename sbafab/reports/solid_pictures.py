"""Pictures of solids: the flat actuator cut open, an assembly, and inflated actuators.

A laminate is a stack of prisms seen from above, so painting from the bottom up gives correct
occlusion; within a prism the walls are painted from far to near, then its top face. Assemblies and
inflated actuators are rasterized; they can also be animated (GIF, WebP) or exported for viewers
(GLB).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.shapes import colours, linear, placed_surface
from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import Region, polygon
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import Node, write_glb, write_scene
from sbafab.meshing.solid import body_bond, parted, solid
from sbafab.meshing.surface import Floats, Surface
from sbafab.models.paper import counterparts_of_pose
from sbafab.reports.canvas import (
    AMBIENT,
    COLOURS,
    ENLARGED,
    KEY,
    PAPER,
    RGB,
    Buffer,
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
from sbafab.reports.inflated import COARSE as COARSE_FACETS
from sbafab.reports.inflated import InflatedPart, inflated, pressed

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw as Draw

    from sbafab.models.stack import Pose, Stack

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
    """A region from ``z`` up by ``thickness`` (true mm); its top is in shadow where ``covered``."""

    name: str
    region: Region
    covered: Region
    z: float
    thickness: float
    bond: bool


class Shape(NamedTuple):
    """A prism seen at z = 0, in pixels: the visible facets of its side, each with its colour, far
    to near; tops and their shadows; outlines of tops.
    """

    walls: list[tuple[Point, Point, RGB]]
    tops: list[list[Point]]
    shades: list[list[Point]]
    rings: list[list[list[Point]]]


def solid_png(laminate: Laminate, width: int = 1600, height: int = 1200) -> bytes:
    """Return the TPE solid, cut open at one chamber, as PNG; the caption states the height
    exaggeration.
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
    """Draw white paper with the soft shadow of the footprint."""
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
    """Return films and the bonds in the gaps between them, bottom to top."""
    above = {interface.below.index: interface for interface in laminate.interfaces}
    for layer in laminate.tpe_layers:
        interface = above.get(layer.index)
        thickness = layer.film.thickness
        if interface is None or not interface.gap:
            yield Prism(layer.pattern, layer.profile, Region(), layer.z, thickness, False)
            continue
        name, bond = " ".join(interface.pattern), body_bond(interface)
        void = interface.contact - bond if interface.folds else interface.unbonded
        yield Prism(name, layer.profile, void, layer.z, thickness, False)
        yield Prism(f"bond {name}", bond, Region(), interface.z, interface.gap, True)


def _shape(prism: Prism, cut: RemovedSector, view: View) -> Shape:
    region = prism.region - cut.removed
    sagitta = SAGITTA_PX / view.scale
    rings, shades = (
        [[_flat(view, ring) for ring in piece] for piece in shown.polygons(sagitta)]
        for shown in (region, prism.covered - cut.removed)
    )
    outlines = [np.array(contour.polygon(sagitta)) for contour in region.contours]
    walls = [wall for outline in outlines for wall in _walls(outline, prism.bond, cut, view)]
    walls.sort(key=lambda wall: wall[0][1] + wall[1][1])
    return Shape(walls, list(map(keyhole, rings)), list(map(keyhole, shades)), rings)


def _flat(view: View, points: Sequence[Point] | Floats) -> list[Point]:
    """Return points of the press plate in pixels."""
    pixels = view.flat(np.column_stack([points, np.zeros(len(points))]))
    return list(map(tuple, pixels[:, :2].tolist()))


def _walls(
    points: Floats, bond: bool, cut: RemovedSector, view: View
) -> Iterator[tuple[Point, Point, RGB]]:
    """Return the visible facets; material lies on the left of each, so the right is outward."""
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
    if prism.bond:
        return
    for faces, tone in ((shape.tops, "film"), (shape.shades, "shade")):
        for ring in faces:
            draw.polygon([(x, y - high) for x, y in ring], COLOURS[tone])
    for pieces in shape.rings:
        for ring in pieces:
            closed = [(x, y - high) for x, y in (*ring, ring[0])]
            draw.line(closed, COLOURS["line"], width=ENLARGED)


def keyhole(rings: Sequence[Sequence[Point]]) -> list[Point]:
    """One closed ring for a piece with holes: a slit joins each hole to its right contour."""
    merged = list(rings[0])
    for hole in sorted(rings[1:], key=lambda ring: -max(ring)[0]):
        first = max(range(len(hole)), key=lambda i: hole[i])
        x, y = hole[first]
        after, landing = _first_right_of(merged, x, y)
        merged[after:after] = [landing, *hole[first:], *hole[:first], (x, y), landing]
    return merged


def _first_right_of(ring: Sequence[Point], x: float, y: float) -> tuple[int, Point]:
    """Return the first intersection of a ray to the right with the ring, and the next vertex."""
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
    """A sector with its apex at ``apex``, counter-clockwise from angle ``first`` to ``last``."""

    chamber: str
    apex: Point
    first: float
    last: float
    removed: Region

    def on_faces(self, points: Floats) -> NDArray[np.bool_]:
        """Return, for each of the two faces of the cut, which points (n, 2) lie on it."""
        rays = np.array([[math.sin(a), -math.cos(a)] for a in (self.first, self.last)])
        return np.asarray(np.abs(rays @ (points - self.apex).T) < 1e-5)


def cutaway(laminate: Laminate) -> RemovedSector:
    """Return the sector beside one chamber: one face runs through its middle and along its inlet.

    With a lumen the apex is on the actuator's axis and the other face runs between two lobes;
    otherwise the apex is the chamber's middle and the sector a quarter. Without chambers a port is
    used.
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


def assembly_pngs(
    assembled: Assembled, note: str = "", width: int = 1040, height: int = 780
) -> tuple[bytes, bytes]:
    """Return the assembly before inflation as PNG, seen from the front above, and a picture without
    caption and legend.

    ``note`` ends the caption. Inlet tubes and enclosed spaces are not shown.
    """
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
    """Draw one line per colour: the parts with it, and their kinds."""
    lines: dict[tuple[RGB, str], list[str]] = {}
    for placed in assembled.parts:
        kind = placed.part.kind if placed.made is None else placed.made.design.name
        lines.setdefault((paints[placed.name], kind), []).append(placed.name)
    return [
        (colour, ", ".join(names) if [kind] == names else f"{', '.join(names)} ({kind})")
        for (colour, kind), names in lines.items()
    ]


# Inflated actuators: a picture, an animation or a scene.


Movement = Literal["inflate", "circle"]
ENDINGS = (".png", ".gif", ".webp", ".glb")
MOVING = (".gif", ".webp")
FRAMES = 30
FRAME_MS = 70
SHADES = 96  # colours of a GIF
WEB: RGB = (205, 222, 232)
EMPTY: RGB = (172, 205, 229)
FULL: RGB = (244, 156, 62)
"""Films of the web, of a chamber without pressure, and of the fullest one."""
PALEST = 0.4
"""Share of its colour that a chamber shows at a tenth of the highest pressure, to be visible."""
FRAME = 0.06, 0.1  # margin and foot of a picture, shares of it
GROUND = -0.06


@dataclass(frozen=True)
class PictureRequest:
    """The request for a picture.

    ``pressures_kpa`` or ``volumes_ul`` hold values by chamber name, 0 by default; "" means all.
    ``elevation`` and ``azimuth`` of the eye are in degrees, ``width`` and ``height`` in pixels. An
    animation goes from flat to this pose and back (``inflate``), or moves the pressure around the
    chambers (``circle``).
    """

    pressures_kpa: Mapping[str, float]
    volumes_ul: Mapping[str, float] | None = None
    elevation: float = 18.0
    azimuth: float = -60.0
    width: int = 1000
    height: int = 800
    motion: Movement = "inflate"
    frames: int = FRAMES


def pose_of(laminate: Laminate, stack: Stack, request: PictureRequest) -> Pose:
    """Return the pose of a request. Raises DesignError for an unknown chamber."""
    if request.volumes_ul is not None:
        volumes = _by_chamber(laminate, request.volumes_ul)
        empty = [c.name for c in laminate.chambers if not {"", c.name} & set(request.volumes_ul)]
        try:
            return pressed(stack, volumes)
        except DesignError as error:
            if not empty:
                raise
            shown = " and ".join(empty)
            raise DesignError(
                f"{error}; an unnamed chamber counts as empty: name {shown}"
            ) from None
    return stack.pose(_by_chamber(laminate, request.pressures_kpa))


def _by_chamber(laminate: Laminate, values: Mapping[str, float]) -> tuple[float, ...]:
    names = [chamber.name for chamber in laminate.chambers]
    unknown = [name for name in values if name and name not in names]
    if unknown:
        raise DesignError(
            f"chamber {unknown[0]} does not exist; the chambers are {', '.join(names)}"
        )
    return tuple(float(values.get(name, values.get("", 0.0))) for name in names)


def write_picture(
    laminate: Laminate,
    stack: Stack,
    request: PictureRequest,
    path: Path,
    progress: Callable[[int, int], None] | None = None,
) -> Pose:
    """Write ``path`` in the format of its suffix, and return the pose shown.

    Raises DesignError for a suffix not in ENDINGS and for impossible poses.
    """
    ending = path.suffix.lower()
    _refuse_ending(path)
    pose = pose_of(laminate, stack, request)
    if ending == ".glb":
        nodes = [
            Node(part.name, part.surface, "TPE", linear(_colour(part, pose, max(pose.pressures))))
            for part in inflated(laminate, stack, pose)
        ]
        write_scene(nodes, path)
    elif ending == ".png":
        path.write_bytes(pictures_at_one_scale([(laminate, stack, pose)], request)[0])
    else:
        poses = _poses(stack, pose, request)
        path.write_bytes(_animation(laminate, stack, poses, request, ending, progress))
    return pose


def _refuse_ending(path: Path) -> None:
    if path.suffix.lower() not in ENDINGS:
        raise DesignError(f"{path.name} must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")


def pictures_at_one_scale(
    shown: Sequence[tuple[Laminate, Stack, Pose]], request: PictureRequest
) -> list[bytes]:
    """Return a picture of each actuator with a caption as PNG, all from one viewpoint."""
    every = [inflated(laminate, stack, pose) for laminate, stack, pose in shown]
    if not every:
        return []
    view = _view([part.surface for parts in every for part in parts], request)
    return [
        png(_image(pose, parts, view, request, _caption(laminate, pose, stack.calibration)))
        for (laminate, stack, pose), parts in zip(shown, every, strict=True)
    ]


def _animation(
    laminate: Laminate,
    stack: Stack,
    poses: Sequence[Pose],
    request: PictureRequest,
    ending: str,
    progress: Callable[[int, int], None] | None,
) -> bytes:
    """Write poses in sequence as an endless loop, as GIF or WebP."""
    from PIL import Image

    every = [inflated(laminate, stack, pose, COARSE_FACETS) for pose in poses]
    view = _view([part.surface for parts in every for part in parts], request)
    most = max(max(pose.pressures) for pose in poses)
    caption = [f"{laminate.name}, {_model(laminate, stack.calibration)}"]
    images = []
    for pose, parts in zip(poses, every, strict=True):
        images.append(_image(pose, parts, view, request, caption, most))
        if progress is not None:
            progress(len(images), len(poses))
    out = BytesIO()
    moving: dict[str, Any] = {"save_all": True, "duration": FRAME_MS, "loop": 0}
    if ending == ".webp":
        images[0].save(out, "WEBP", append_images=images[1:], quality=82, method=4, **moving)
        return out.getvalue()
    # One palette for all: from the first, the middle and the last third frame side by side.
    third, (width, height) = len(images) // 3, images[0].size
    sample = Image.new("RGB", (width, 3 * height))
    for place in range(3):
        sample.paste(images[place * third], (0, place * height))
    plain = Image.Dither.NONE
    palette = sample.quantize(SHADES, method=Image.Quantize.MAXCOVERAGE, dither=plain)
    first, *rest = (image.quantize(palette=palette, dither=plain) for image in images)
    first.save(out, "GIF", append_images=rest, optimize=False, disposal=1, **moving)
    return out.getvalue()


def _poses(stack: Stack, last: Pose, request: PictureRequest) -> list[Pose]:
    """Return the poses of an animation, which ends where it began."""
    turns = [number / request.frames * math.tau for number in range(request.frames)]
    steps = [[p * ((1 - math.cos(turn)) / 2) ** 1.5 for p in last.pressures] for turn in turns]
    if request.motion == "circle":
        if stack.chambers < 3:
            raise DesignError(
                "pressure can circle around three or more chambers only; use motion inflate"
            )
        most = max(last.pressures)
        at = [math.atan2(float(y), float(x)) for x, y in stack.axes]
        # Full at a chamber's own angle, none from 120 degrees on.
        steps = [
            [most * max(0.0, (math.cos(turn - angle) + 0.5) / 1.5) ** 1.5 for angle in at]
            for turn in turns
        ]
    poses: list[Pose] = []
    for step in steps:
        poses.append(stack.pose(tuple(step), near=poses[-1] if poses else None))
    return poses


def _view(surfaces: Sequence[Surface], request: PictureRequest) -> View:
    """Return the view of a picture before its reduction."""
    box = framed(ENLARGED * request.width, ENLARGED * request.height, *FRAME)
    return view_of(surfaces, request.elevation, request.azimuth, box)


def _image(
    pose: Pose,
    parts: Sequence[InflatedPart],
    view: View,
    request: PictureRequest,
    caption: Sequence[str],
    most: float | None = None,
) -> Image:
    """Return one pose in colours up to the pressure ``most``, by default its highest, with a
    caption. The background is white, with a shadow on the ground.
    """
    most = max(pose.pressures) if most is None else most
    size = request.width * ENLARGED, request.height * ENLARGED
    lamp = np.array(LIGHT_AT) / np.linalg.norm(LIGHT_AT)
    surfaces = [part.surface for part in parts]
    buffer = rasterize(surfaces, view, *size, lamp, [part.normals for part in parts])
    palette = np.array([*(_colour(part, pose, most) for part in parts), PAPER], dtype=float)
    is_paper = buffer.body < 0
    share = (buffer.light - AMBIENT) / (1 - AMBIENT)
    level = (0.62 + 0.42 * share) * (1 - _crevices(buffer, view.scale))
    level[edges(buffer, EDGE_MM) & ~is_paper] *= EDGE
    rgb = palette[buffer.body] * np.where(is_paper, 1.0, level)[:, :, None]
    gloss = GLOSS * np.clip(share, 0, 1) ** SHARPNESS
    rgb += np.where(is_paper, 0.0, gloss)[:, :, None] * (255 - rgb)
    shadow = _shadow(surfaces, view, size)
    image = image_of(rgb * np.where(is_paper, 1 - DARKEST * shadow, 1.0)[:, :, None])
    letters = max(11, round(request.height / 40))
    inscribe(image, caption, letters, pixels_per_mm=view.scale / ENLARGED)
    return image


def _colour(part: InflatedPart, pose: Pose, most: float) -> RGB:
    """Return the web's colour, or a chamber's according to its fraction of the highest pressure."""
    if part.chamber is None:
        return WEB
    share = pose.pressures[part.chamber] / most if most > 0 else 0.0
    share = min(1.0, share / 0.1) * PALEST + (1 - PALEST) * share
    r, g, b = (round(e + (f - e) * share) for e, f in zip(EMPTY, FULL, strict=True))
    return r, g, b


def _model(laminate: Laminate, calibration: str) -> str:
    model = "elastic stack" + (f", calibration {calibration}" if calibration else "")
    model += ", ears snipped off" if laminate.registration == "ears" else ""
    return model + (", drawn pockets as discs" if _has_drawn_pockets(laminate) else "")


def _has_drawn_pockets(laminate: Laminate) -> bool:
    """Return True if pockets have masks and none is round about its pocket's middle."""
    masks = [layers[0] for layers in laminate.patterns.values() if layers[0].role == "chamber-mask"]
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    edges = [edge for mask in masks for outer in mask.profile.outers for edge in outer.edges]
    arcs = [edge for edge in edges if isinstance(edge, Arc)]
    is_round = any(math.dist(arc.centre, centre) < 1e-6 for arc in arcs for centre in centres)
    return bool(masks) and not is_round


def _caption(laminate: Laminate, pose: Pose, calibration: str) -> list[str]:
    """Return the caption, with the paper's measured bend or height beside the model's."""
    pressures = ", ".join(f"{p:.3g}" for p in pose.pressures)
    figure = "bend" if pose.bend > 0.5 else "height"
    bent = f", bent {pose.bend:.0f} degrees" if figure == "bend" else f", {pose.height:.1f} mm high"
    model = _model(laminate, calibration)
    caption = f"{laminate.name} at {pressures} kPa{bent} ({model})"
    beside = counterparts_of_pose(len(pose.pressures), calibration).get(figure)
    return [beside.short, caption] if beside else [caption]


# Pictures of an actuator without a model for inflation: flat, as PNG and as GLB for viewers.


WHY = "no model inflates pockets that are not nearly round, or stand round a tube"


def write_flat_picture(laminate: Laminate, path: Path, width: int, height: int) -> None:
    """Write ``path`` in the format of its suffix: the solid before inflation, so labelled in a PNG.

    Raises DesignError for the suffix of an animation, and for one not in ENDINGS.
    """
    ending = path.suffix.lower()
    if ending in MOVING:
        raise DesignError(
            f"{path.name} would animate {laminate.name}, but {WHY}: write a .png or .glb of the "
            "flat solid, or inflate it with sbafab simulate"
        )
    _refuse_ending(path)
    if ending == ".png":
        path.write_bytes(solid_png(replace(laminate, notes=(WHY,)), width, height))
    else:
        write_glb(solid(laminate), path, laminate.bonded_materials)


# Smooth surfaces as a picture: lit, with shade in crevices and on the ground, anti-aliased.


LIGHT_AT = (-0.42, 0.62, 0.66)  # direction to the light: right, up, toward the eye
CREVICES = ((0.35, 0.5), (1.2, 0.35))
"""Radius in mm within which nearer surfaces shade a place, and the most by which they do."""
EDGE_MM = 0.5  # jump in depth that is drawn as an edge
EDGE = 0.72
GLOSS, SHARPNESS = 0.22, 14.0
DARKEST, SOFT_MM = 0.34, 0.9  # of the shadow on the ground: a share, and its softness


def _crevices(buffer: Buffer, scale: float) -> Floats:
    """Return the darkening of pixels behind their surroundings, as a fraction."""
    far = float(buffer.depth[buffer.body >= 0].min()) if (buffer.body >= 0).any() else 0.0
    depth = np.where(buffer.body < 0, far, buffer.depth)
    dark = np.zeros_like(depth)
    for radius, most in CREVICES:
        behind = _blurred(depth, radius * scale) - depth
        dark += most * np.clip(behind / radius, 0, 1)
    return np.clip(dark, 0, 0.75)


def _blurred(values: Floats, pixels: float) -> Floats:
    """Return box means over squares about this many pixels wide, twice, for a soft edge."""
    half = max(1, round(pixels / 2))
    width = 2 * half + 1
    for _ in range(4):
        # Down the rows, which are the columns of the next round.
        total = np.cumsum(np.pad(values, ((half + 1, half), (0, 0)), mode="edge"), axis=0)
        values = ((total[width:] - total[:-width]) / width).T
    return values


def _shadow(surfaces: Sequence[Surface], view: View, size: tuple[int, int]) -> Floats:
    """Return the fraction of overhead light that does not reach the ground, by pixel."""
    points = np.concatenate([surface.points for surface in surfaces])
    # Light comes from above, a little from the left of the picture, wherever the eye is.
    slant = 0.25 * view.axes[0] * np.array([1.0, 1.0, 0.0])
    rise = points[:, 2] - GROUND
    fallen = points + rise[:, None] * slant
    fallen[:, 2] = GROUND
    x, y, _ = view.flat(fallen).T
    inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1]) & (rise >= -1e-6)
    cell = max(1, round(view.scale * 0.25))
    hit = np.zeros((size[1] // cell + 1, size[0] // cell + 1))
    row, column = ((values[inside] // cell).astype(int) for values in (y, x))
    np.maximum.at(hit, (row, column), np.exp(-rise[inside] / 12.0))
    # Points are sparse where triangles are large: the blur closes the gaps.
    soft = _blurred(hit, SOFT_MM * view.scale / cell) * 2.2
    soft = _blurred(np.clip(soft, 0, 1), SOFT_MM * view.scale / cell)
    full = np.repeat(np.repeat(soft, cell, axis=0), cell, axis=1)[: size[1], : size[0]]
    return _blurred(np.clip(full, 0, 1), cell)
