"""Scans rendered from cut files by another route: ezdxf reads, shapely cuts the kerf, Agg fills.

No code of the program is used, so that what it measures on them is judged by others' geometry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import ezdxf
import ezdxf.path
import numpy as np
import shapely
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path as Outline
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

Polygon = Any
Change = Callable[[list[Polygon]], list[Polygon]]


@dataclass(frozen=True)
class Camera:
    """How a sheet is seen: what a scanner or a camera does to it.

    ``kerf`` mm; ``dpi`` of the picture, of which the true scale is ``scale`` times along x and y;
    ``tilt`` degrees; ``keystone``: how much more the far side is reduced, a share; ``blur`` and
    ``noise``: pixels and grey levels (of 255); ``light``: how much darker the far corner is;
    ``specks``: bright and dark dust of up to 0.25 mm.
    """

    kerf: float = 0.12
    dpi: float = 600.0
    scale: tuple[float, float] = (1.0, 1.0)
    tilt: float = 0.0
    keystone: float = 0.0
    barrel: float = 0.0
    blur: float = 1.0
    noise: float = 3.0
    light: float = 0.1
    specks: int = 0
    film: float = 190.0
    paper: float = 45.0
    seen_from_below: bool = False
    skeleton: bool = False
    margin: float = 6.0
    seed: int = 1
    moved: float = 0.0
    frame: tuple[float, float] = field(default=(0.0, 0.0))


def pieces_of(path: Path) -> list[Polygon]:
    """The pieces of a cut file, each an outline with its holes, as ezdxf reads it."""
    outlines, holes = [], []
    for entity in ezdxf.readfile(path).modelspace():
        if entity.dxf.layer in ("CUT_OUTER", "CUT_INNER"):
            points = [(p.x, p.y) for p in ezdxf.path.make_path(entity).flattening(0.0005)]
            (outlines if entity.dxf.layer == "CUT_OUTER" else holes).append(points)
    pieces = []
    for outline in outlines:
        whole = shapely.Polygon(outline)
        inside = [hole for hole in holes if whole.contains(shapely.Point(hole[0]))]
        pieces.append(shapely.Polygon(outline, inside))
    return pieces


def render(path: Path, camera: Camera, change: Change | None = None) -> NDArray[np.uint8]:
    """The picture of a sheet as the camera sees it; ``change`` puts other pieces in it."""
    random = np.random.default_rng(camera.seed)
    pieces = pieces_of(path)
    low_x, low_y, high_x, high_y = shapely.MultiPolygon(pieces).bounds
    if change is not None:
        pieces = change(pieces)
    if camera.moved:
        pieces = [_nudged(piece, camera.moved, random) for piece in pieces]
    if camera.skeleton:
        # The film round the windows, of which the pieces fell out.
        sheet = shapely.box(low_x - 4, low_y - 4, high_x + 4, high_y + 4)
        windows = shapely.union_all([shapely.Polygon(piece.exterior) for piece in pieces])
        pieces = [sheet - windows.buffer(camera.kerf / 2, quad_segs=64)]
    else:
        pieces = [piece.buffer(-camera.kerf / 2, quad_segs=64) for piece in pieces]
    middle = np.array([(low_x + high_x) / 2, (low_y + high_y) / 2])
    half = np.hypot(high_x - low_x, high_y - low_y) / 2
    per_mm = camera.dpi / 25.4
    turned = np.deg2rad(camera.tilt)
    spin = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])

    def pixels(points: NDArray[Any]) -> NDArray[Any]:
        at = (points - middle) * camera.scale
        if camera.seen_from_below:
            at = at * (-1, 1)
        at = at @ spin.T
        at = at / (1 + camera.keystone * (at[:, 1:] * 0.8 + at[:, :1] * 0.6) / half)
        at = at * (1 + camera.barrel * np.sum(at**2, axis=1, keepdims=True) / half**2)
        return np.column_stack([at[:, 0], -at[:, 1]]) * per_mm

    ring = np.array(shapely.box(low_x, low_y, high_x, high_y).segmentize(1.0).exterior.coords)
    corners = pixels(ring)
    origin = corners.min(axis=0) - camera.margin * per_mm
    origin += random.uniform(0, 1, 2)
    width, height = np.ceil(corners.max(axis=0) + camera.margin * per_mm - origin).astype(int)
    rings = [
        [pixels(np.array(ring.coords)) - origin for ring in (part.exterior, *part.interiors)]
        for piece in pieces
        for part in getattr(shapely.orient_polygons(piece), "geoms", [piece])
    ]
    cover = _coverage((width, height), rings)
    picture = camera.paper + (camera.film - camera.paper) * cover
    _dust(picture, camera, per_mm, random)
    down, across = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j].astype(np.float32)
    picture *= 1 + camera.light * (0.5 - 0.7 * down - 0.3 * across**2)
    picture = ndimage.gaussian_filter(picture, camera.blur)
    picture += random.normal(0, camera.noise, picture.shape).astype(np.float32)
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def _nudged(piece: Polygon, most: float, random: np.random.Generator) -> Polygon:
    dx, dy, turn = random.uniform(-most, most, 3)
    turned = shapely.affinity.rotate(piece, turn * 3, "centroid")
    return shapely.affinity.translate(turned, dx, dy)


def _coverage(size: tuple[int, int], polygons: list[list[NDArray[Any]]]) -> NDArray[np.float32]:
    """The share of each pixel in the polygons, by Agg; pixel centres are whole numbers."""
    width, height = size
    agg = RendererAgg(width, height, 72)
    pen = agg.new_gc()
    pen.set_linewidth(0)
    pen.set_snap(False)
    for rings in polygons:
        corners = np.vstack([(ring + 0.5) * (1, -1) + (0, height) for ring in rings])
        codes = [
            [Outline.MOVETO, *[Outline.LINETO] * (len(ring) - 2), Outline.CLOSEPOLY]
            for ring in rings
        ]
        path = Outline(corners, np.concatenate(codes))
        path.should_simplify = False
        agg.draw_path(pen, path, IdentityTransform(), (1, 1, 1, 1))
    return np.asarray(agg.buffer_rgba())[:, :, 3].astype(np.float32) / 255


def _dust(
    picture: NDArray[Any], camera: Camera, per_mm: float, random: np.random.Generator
) -> None:
    for _ in range(camera.specks):
        radius = max(random.uniform(0.03, 0.125) * per_mm, 0.7)
        x, y = random.uniform(0, picture.shape[1]), random.uniform(0, picture.shape[0])
        rows = slice(max(int(y - radius), 0), int(y + radius) + 2)
        columns = slice(max(int(x - radius), 0), int(x + radius) + 2)
        down, across = np.mgrid[rows, columns]
        block = picture[rows, columns]
        inside = np.hypot(across - x, down - y)[: block.shape[0], : block.shape[1]] < radius
        block[inside] = random.choice([20.0, 235.0])


def save(picture: NDArray[np.uint8], path: Path, dpi: float | None) -> Path:
    image = Image.fromarray(picture)
    # Hardly compressed: writing took longer than drawing.
    image.save(path, compress_level=1, **({} if dpi is None else {"dpi": (dpi, dpi)}))
    return path


__all__ = ["Camera", "pieces_of", "render", "replace", "save"]
