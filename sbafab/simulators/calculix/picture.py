"""A picture of the deformed actuator, coloured by its stress (Pillow)."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.cavities import flat_triangles
from sbafab.meshing.conforming.elements import CORNERS, FACES
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.surface import Surface
from sbafab.reports.depth import AMBIENT, seen, view_of
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
LAMP = (-0.35, 0.55, 0.76)
"""Direction to the light, in the view."""
DARKEST = 0.22
ELEVATION, AZIMUTH = 28.0, -35.0
"""Degrees of the eye over the bench, and round it from x."""


def deformed_png(mesh: Mesh, frame: Frame, caption: str) -> bytes:
    """The deformed surface in oblique parallel view with a scale of von Mises stress."""
    from PIL import Image, ImageDraw

    surface = Surface(mesh.points + frame.displacement, _skin(mesh))
    width, height = (side * ENLARGED for side in SIZE)
    edge, foot = MARGIN * ENLARGED, FOOT * ENLARGED
    view = view_of([surface], ELEVATION, AZIMUTH, (edge, edge, width - edge, height - edge - foot))
    buffer = seen([surface], view, width, height, LAMP)
    stress = frame.von_mises
    most = float(stress.max()) or 1.0
    colours = _coloured(stress[surface.faces].mean(axis=1) / most)
    # A little darker where a face is steep: it shows wrinkles and leaves the colour readable.
    shade = 1 - DARKEST * (1 - buffer.light) / (1 - AMBIENT)
    rgb = np.where((buffer.body < 0)[..., None], 255, colours[buffer.face] * shade[..., None])
    picture = Image.fromarray(rgb.round().astype(np.uint8), "RGB").reduce(ENLARGED)
    _write_key(ImageDraw.Draw(picture), caption, most, view.scale / ENLARGED)
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


def _coloured(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """The scale's red, green and blue (n, 3) for shares of the largest stress."""
    steps = np.linspace(0, 1, len(SCALE))
    return np.column_stack([np.interp(share, steps, channel) for channel in SCALE.T])


def _write_key(draw: Draw, caption: str, most: float, pixels_per_mm: float) -> None:
    from PIL import ImageFont

    font = ImageFont.load_default(20)
    width, height = SIZE
    draw_length_bar(draw, width - MARGIN, height - 40, width / 4, pixels_per_mm, font)
    draw.text((MARGIN, height - 100), caption, fill=INK, font=font)
    left, right, top = MARGIN, MARGIN + 400, height - 64
    for x, colour in enumerate(_coloured(np.linspace(0, 1, right - left)).round().astype(int)):
        draw.line((left + x, top, left + x, top + 18), fill=tuple(colour.tolist()))
    for part in (0.0, 0.5, 1.0):
        at = left + part * (right - left)
        draw.text((at, top + 24), f"{part * most:.3g}", fill=INK, font=font, anchor="ma")
    draw.text((right + 20, top - 3), "von Mises stress, MPa", fill=INK, font=font)
