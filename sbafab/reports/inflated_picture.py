"""Pictures of an inflated or flat actuator: PNG, animated GIF or WebP, and GLB for viewers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from sbafab.assemblies.shapes import linear
from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import Node, write_glb, write_scene
from sbafab.meshing.solid import solid
from sbafab.meshing.surface import Surface
from sbafab.models.paper import counterparts_of_pose
from sbafab.reports.canvas import (
    AMBIENT,
    ENLARGED,
    PAPER,
    RGB,
    Buffer,
    Floats,
    View,
    edges,
    framed,
    image_of,
    inscribe,
    png,
    rasterize,
    view_of,
)
from sbafab.reports.inflated import COARSE, InflatedPart, inflated, pressed
from sbafab.reports.solid_png import solid_png

if TYPE_CHECKING:
    from PIL.Image import Image

    from sbafab.models.stack import Pose, Stack

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
MARGIN, FOOT = 0.06, 0.1
GROUND = -0.06


@dataclass(frozen=True)
class PictureRequest:
    """The request for a picture.

    ``pressures_kpa`` or ``volumes_ul`` of the chambers by name, 0 by default; the name "" means
    all. ``elevation`` and ``azimuth`` of the eye are in degrees, ``width`` and ``height`` in
    pixels. An animation goes from flat to this pose and back (``inflate``), or moves the pressure
    around the chambers (``circle``).
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
    """The pose of a request. Raises DesignError for an unknown chamber."""
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
                f"{error}; a chamber not named counts as empty: name {shown}"
            ) from None
    return stack.pose(_by_chamber(laminate, request.pressures_kpa))


def _by_chamber(laminate: Laminate, values: Mapping[str, float]) -> tuple[float, ...]:
    names = [chamber.name for chamber in laminate.chambers]
    unknown = [name for name in values if name and name not in names]
    if unknown:
        raise DesignError(f"chamber {unknown[0]} is not there; the chambers are {', '.join(names)}")
    return tuple(float(values.get(name, values.get("", 0.0))) for name in names)


def write_picture(
    laminate: Laminate,
    stack: Stack,
    request: PictureRequest,
    path: Path,
    progress: Callable[[int, int], None] | None = None,
) -> Pose:
    """Writes ``path`` in the format of its suffix, and returns the pose shown.

    Raises DesignError for a suffix not in ENDINGS and for impossible poses.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise _wrong_ending(path)
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


def _wrong_ending(path: Path) -> DesignError:
    return DesignError(f"{path.name} must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")


def pictures_at_one_scale(
    shown: Sequence[tuple[Laminate, Stack, Pose]], request: PictureRequest
) -> list[bytes]:
    """Return a picture of each actuator with a caption as PNG, all seen from one place."""
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
    """Poses one after the other, in an endless loop, as GIF or WebP."""
    from PIL import Image

    every = [inflated(laminate, stack, pose, COARSE) for pose in poses]
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
    """Poses of an animation, which ends where it began."""
    turns = [number / request.frames * math.tau for number in range(request.frames)]
    steps = [[p * ((1 - math.cos(turn)) / 2) ** 1.5 for p in last.pressures] for turn in turns]
    if request.motion == "circle":
        if stack.chambers < 3:
            raise DesignError("pressure goes round three chambers or more; use motion inflate")
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
    """The view of a picture before it is reduced."""
    box = framed(ENLARGED * request.width, ENLARGED * request.height, MARGIN, FOOT)
    return view_of(surfaces, request.elevation, request.azimuth, box)


def _image(
    pose: Pose,
    parts: Sequence[InflatedPart],
    view: View,
    request: PictureRequest,
    caption: Sequence[str],
    most: float | None = None,
) -> Image:
    """One pose in colours up to the pressure ``most``, by default its highest, with a caption, on a
    white background with its shadow on the ground.
    """
    most = max(pose.pressures) if most is None else most
    size = request.width * ENLARGED, request.height * ENLARGED
    lamp = np.array(LAMP) / np.linalg.norm(LAMP)
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
    image = image_of(rgb * np.where(is_paper, 1 - SHADOW * shadow, 1.0)[:, :, None])
    letters = max(11, round(request.height / 40))
    inscribe(image, caption, letters, pixels_per_mm=view.scale / ENLARGED)
    return image


def _colour(part: InflatedPart, pose: Pose, most: float) -> RGB:
    """The web's colour, or a chamber's by its share of the highest pressure."""
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
    """Return True if masks lie in the pockets and none is round about the middle of its pocket."""
    masks = [layers[0] for layers in laminate.patterns.values() if layers[0].role == "chamber-mask"]
    centres = [centre for chamber in laminate.chambers for centre in chamber.centres]
    edges = [edge for mask in masks for outer in mask.profile.outers for edge in outer.edges]
    arcs = [edge for edge in edges if isinstance(edge, Arc)]
    is_round = any(math.dist(arc.centre, centre) < 1e-6 for arc in arcs for centre in centres)
    return bool(masks) and not is_round


def _caption(laminate: Laminate, pose: Pose, calibration: str) -> list[str]:
    """Return the caption, below the paper's measured bend or height beside the model's."""
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
    """Writes ``path`` in the format of its suffix: the solid before inflation, so labelled in a
    PNG.

    Raises DesignError for the suffix of an animation, and for one not in ENDINGS.
    """
    ending = path.suffix.lower()
    if ending in MOVING:
        raise DesignError(
            f"{path.name} would show {laminate.name} move, but {WHY}: a .png or .glb shows it "
            "flat, and sbafab simulate inflates it"
        )
    if ending not in ENDINGS:
        raise _wrong_ending(path)
    if ending == ".png":
        path.write_bytes(solid_png(replace(laminate, notes=(WHY,)), width, height))
    else:
        write_glb(solid(laminate), path, laminate.bonded_materials)


# Smooth surfaces as a picture: lit, with shade in crevices and on the ground, anti-aliased.


LAMP = (-0.42, 0.62, 0.66)  # direction to the light: right, up, toward the eye
CREVICES = ((0.35, 0.5), (1.2, 0.35))
"""Radius in mm within which nearer surfaces shade a place, and the most by which they do."""
EDGE_MM = 0.5  # jump in depth that is drawn as an edge
EDGE = 0.72
GLOSS, SHARPNESS = 0.22, 14.0
SHADOW, SOFT_MM = 0.34, 0.9


def _crevices(buffer: Buffer, scale: float) -> Floats:
    """Darkening of pixels that lie behind their surroundings, as a share."""
    far = float(buffer.depth[buffer.body >= 0].min()) if (buffer.body >= 0).any() else 0.0
    depth = np.where(buffer.body < 0, far, buffer.depth)
    dark = np.zeros_like(depth)
    for radius, most in CREVICES:
        behind = _blurred(depth, radius * scale) - depth
        dark += most * np.clip(behind / radius, 0, 1)
    return np.clip(dark, 0, 0.75)


def _blurred(values: Floats, pixels: float) -> Floats:
    """Box means over squares about this many pixels wide, twice, for a soft edge."""
    half = max(1, round(pixels / 2))
    width = 2 * half + 1
    for _ in range(4):
        # Down the rows, which are the columns of the next round.
        total = np.cumsum(np.pad(values, ((half + 1, half), (0, 0)), mode="edge"), axis=0)
        values = ((total[width:] - total[:-width]) / width).T
    return values


def _shadow(surfaces: Sequence[Surface], view: View, size: tuple[int, int]) -> Floats:
    """Return the share of the light above that does not reach the ground, by pixel: 0 to 1."""
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
