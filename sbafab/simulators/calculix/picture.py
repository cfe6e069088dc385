"""A picture of the deformed actuator, coloured by its stress (Pillow)."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.cavities import flat_triangles
from sbafab.meshing.conforming.elements import CORNERS, FACES
from sbafab.meshing.conforming.model import Mesh
from sbafab.reports.length_bar import draw_length_bar
from sbafab.simulators.calculix.frd import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.ImageDraw import ImageDraw as Draw

SIZE = 1100, 900
MARGIN, FOOT = 60, 110
ENLARGED = 2
INK = (34, 34, 34)
SCALE = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
"""Of even lightness steps (viridis): read by the colour blind, and in grey."""
LIGHT = np.array([0.3, -0.4, 0.866])
AZIMUTH, ELEVATION = np.radians(-55.0), np.radians(28.0)


def deformed_png(mesh: Mesh, frame: Frame, caption: str) -> bytes:
    """The deformed surface in oblique parallel view with a scale of von Mises stress."""
    from PIL import Image, ImageDraw

    faces = _skin(mesh)
    points = mesh.points + frame.displacement
    seen, depth = _projected(points)
    size = np.array(SIZE) * ENLARGED
    free = size - np.array([2 * MARGIN, 2 * MARGIN + FOOT]) * ENLARGED
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = float((free / np.maximum(high - low, 1e-9)).min())
    places = (seen - (low + high) / 2) * [scale, -scale]
    places += [size[0] / 2, (size[1] - FOOT * ENLARGED) / 2]
    stress = frame.von_mises
    most = float(stress.max()) or 1.0
    image = Image.new("RGB", tuple(size.tolist()), (255, 255, 255))
    draw = ImageDraw.Draw(image)
    shades = _shades(points[faces])
    tones = stress[faces].mean(axis=1) / most
    for number in np.argsort(depth[faces].mean(axis=1), kind="stable").tolist():
        colour = _colour(float(tones[number]), float(shades[number]))
        draw.polygon([tuple(place) for place in places[faces[number]].tolist()], fill=colour)
    picture = image.reduce(ENLARGED)
    _write_key(ImageDraw.Draw(picture), caption, most, scale / ENLARGED)
    out = BytesIO()
    picture.save(out, "PNG", compress_level=6)
    return out.getvalue()


def _skin(mesh: Mesh) -> NDArray[np.int64]:
    """Triangles (k, 3) of every element face that no other element has."""
    count = len(mesh.cells)
    faces, keys = [], []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = np.full((count, 4), -1)
        chosen = [node for node in local if node < CORNERS[mesh.kind]]
        corners[:, : len(chosen)] = mesh.cells[:, chosen]
        keys.append(np.sort(corners, axis=1))
        faces.append(np.column_stack([np.arange(count), np.full(count, number)]))
    _, which, times = np.unique(
        np.concatenate(keys), axis=0, return_inverse=True, return_counts=True
    )
    return flat_triangles(mesh.kind, mesh.cells, np.concatenate(faces)[times[which.ravel()] == 1])


def _projected(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places (n, 2) on the picture's plane, and how near (n,) each is to who looks."""
    x = points[:, 0] * np.cos(AZIMUTH) - points[:, 1] * np.sin(AZIMUTH)
    y = points[:, 0] * np.sin(AZIMUTH) + points[:, 1] * np.cos(AZIMUTH)
    up = points[:, 2] * np.cos(ELEVATION) + y * np.sin(ELEVATION)
    return np.column_stack([x, up]), points[:, 2] * np.sin(ELEVATION) - y * np.cos(ELEVATION)


def _shades(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """A little darker where a face is steep: it shows wrinkles and leaves the colour readable."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    found: NDArray[np.float64] = 0.78 + 0.22 * np.abs(normals @ LIGHT) / lengths
    return found


def _colour(part: float, shade: float = 1.0) -> tuple[int, int, int]:
    at = min(max(part, 0.0), 1.0) * (len(SCALE) - 1)
    first = min(int(at), len(SCALE) - 2)
    mixed = SCALE[first] + (at - first) * (SCALE[first + 1] - SCALE[first])
    r, g, b = (mixed * shade).round().astype(int).tolist()
    return r, g, b


def _write_key(draw: Draw, caption: str, most: float, pixels_per_mm: float) -> None:
    from PIL import ImageFont

    font = ImageFont.load_default(20)
    width, height = SIZE
    draw_length_bar(draw, width - MARGIN, height - 40, width / 4, pixels_per_mm, font)
    draw.text((MARGIN, height - 100), caption, fill=INK, font=font)
    left, right, top = MARGIN, MARGIN + 400, height - 64
    for x in range(left, right):
        draw.line((x, top, x, top + 18), fill=_colour((x - left) / (right - left)))
    for part in (0.0, 0.5, 1.0):
        at = left + part * (right - left)
        draw.text((at, top + 24), f"{part * most:.3g}", fill=INK, font=font, anchor="ma")
    draw.text((right + 20, top - 3), "von Mises stress, MPa", fill=INK, font=font)
