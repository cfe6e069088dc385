"""Smooth surfaces as a picture: lit, with shade in crevices and on the ground, anti-aliased."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.meshing.surface import Surface
from sbafab.reports.depth import AMBIENT, Buffer, View, seen

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from PIL.Image import Image

RGB = tuple[int, int, int]
LAMP = (-0.42, 0.62, 0.66)
"""Direction to the light: right, up, toward the eye."""
ENLARGED = 2
CREVICES = ((0.35, 0.5), (1.2, 0.35))
"""Radius in mm within which nearer surfaces shade a place, and by how much at most."""
EDGE_MM = 0.5
"""Jump in depth that is drawn as an edge."""
EDGE = 0.72
GLOSS, SHARPNESS = 0.22, 14.0
SHADOW, SOFT_MM = 0.34, 0.9
PAPER = (255, 255, 255)


class LitBody(NamedTuple):
    """A surface with unit normals (n, 3) of its points, and its colour on the screen."""

    surface: Surface
    normals: NDArray[np.float64]
    colour: RGB


def rendered(
    bodies: Sequence[LitBody], view: View, width: int, height: int, ground: float
) -> Image:
    """The bodies before white paper, over a plane z = ``ground`` mm that takes their shadow.

    ``view`` is of the picture ``width`` by ``height`` pixels.
    """
    import numpy as np
    from PIL import Image

    x, y = view.centre
    large = View(view.axes, view.scale * ENLARGED, (ENLARGED * x, ENLARGED * y))
    size = width * ENLARGED, height * ENLARGED
    lamp = np.array(LAMP) / np.linalg.norm(LAMP)
    surfaces = [body.surface for body in bodies]
    buffer = seen(surfaces, large, *size, lamp, [body.normals for body in bodies])
    palette = np.array([*(body.colour for body in bodies), PAPER], dtype=float)
    is_paper = buffer.body < 0
    share = (buffer.light - AMBIENT) / (1 - AMBIENT)
    level = 0.62 + 0.42 * share
    level *= 1 - _crevices(buffer, large.scale)
    level[_edges(buffer)] *= EDGE
    rgb = palette[buffer.body] * np.where(is_paper, 1.0, level)[:, :, None]
    gloss = GLOSS * np.clip(share, 0, 1) ** SHARPNESS
    rgb += np.where(is_paper, 0.0, gloss)[:, :, None] * (255 - rgb)
    shadow = _shadow(surfaces, large, size, ground)
    rgb *= np.where(is_paper, 1 - SHADOW * shadow, 1.0)[:, :, None]
    image = Image.fromarray(np.clip(np.rint(rgb), 0, 255).astype(np.uint8), "RGB")
    return image.reduce(ENLARGED)


def _crevices(buffer: Buffer, scale: float) -> NDArray[np.float64]:
    """By what part places are darkened that lie behind what is round them."""
    import numpy as np

    far = float(buffer.depth[buffer.body >= 0].min()) if (buffer.body >= 0).any() else 0.0
    depth = np.where(buffer.body < 0, far, buffer.depth)
    dark = np.zeros_like(depth)
    for radius, most in CREVICES:
        behind = _blurred(depth, radius * scale) - depth
        dark += most * np.clip(behind / radius, 0, 1)
    return np.clip(dark, 0, 0.75)


def _blurred(values: NDArray[np.float64], pixels: float) -> NDArray[np.float64]:
    """Means over squares about so many pixels wide, twice, for a soft edge."""
    import numpy as np

    half = max(1, round(pixels / 2))
    for _ in range(2):
        for axis in (0, 1):
            ends = [(half + 1, half) if i == axis else (0, 0) for i in (0, 1)]
            total = np.cumsum(np.pad(values, ends, mode="edge"), axis=axis)
            width = 2 * half + 1
            upper = np.take(total, range(width, total.shape[axis]), axis=axis)
            lower = np.take(total, range(total.shape[axis] - width), axis=axis)
            values = (upper - lower) / width
    return values


def _edges(buffer: Buffer) -> NDArray[np.bool_]:
    """Pixels at which one body ends against another, or steps back far."""
    import numpy as np

    depth = np.where(buffer.body < 0, -1e9, buffer.depth)
    found = np.zeros(depth.shape, dtype=bool)
    for axis in (0, 1):
        before = tuple(slice(0, -1) if i == axis else slice(None) for i in (0, 1))
        found[before] |= np.abs(np.diff(depth, axis=axis)) > EDGE_MM
    return found & (buffer.body >= 0)


def _shadow(
    surfaces: Sequence[Surface], view: View, size: tuple[int, int], ground: float
) -> NDArray[np.float64]:
    """How much of the light above is kept from the ground, by pixel: 0 to 1."""
    import numpy as np

    points = np.concatenate([surface.points for surface in surfaces])
    # Light comes from above, a little from the left of the picture, wherever the eye is.
    slant = 0.25 * view.axes[0] * np.array([1.0, 1.0, 0.0])
    rise = points[:, 2] - ground
    fallen = points + rise[:, None] * slant
    fallen[:, 2] = ground
    x, y, _ = view.flat(fallen).T
    inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1]) & (rise >= -1e-6)
    cell = max(1, round(view.scale * 0.25))
    shape = size[1] // cell + 1, size[0] // cell + 1
    hit = np.zeros(shape)
    near = np.exp(-rise[inside] / 12.0)
    np.maximum.at(hit, ((y[inside] // cell).astype(int), (x[inside] // cell).astype(int)), near)
    # Points are sparse where triangles are large: the blur closes what lies between.
    soft = _blurred(hit, SOFT_MM * view.scale / cell) * 2.2
    soft = _blurred(np.clip(soft, 0, 1), SOFT_MM * view.scale / cell)
    full = np.repeat(np.repeat(soft, cell, axis=0), cell, axis=1)[: size[1], : size[0]]
    return _blurred(np.clip(full, 0, 1), cell)
