"""A picture of film on paper with its outlines, and the cut file for comparison.

Pieces of the cut file have the names of their patterns.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.placements import TURNS
from sbafab.errors import DesignError, OutputError
from sbafab.folders.as_cut import path_in_folder
from sbafab.folders.manifest import JobManifest, Manifest, read_design_index, read_index
from sbafab.geometry.edges import Bounds
from sbafab.geometry.region import Region

Pixels = NDArray[np.float32]
"""Grey levels, 0 to 255: rows downward, columns to the right."""

MOST_BYTES = 2_000_000_000
MOST_PIXELS = 400_000_000
LEAST_SIDE = 100
COARSE = 1600  # longer side of the reduced picture, pixels
SPARSE = 4  # step at which the local light is sampled, reduced pixels
ROUNDS = 3  # iterations in which the threshold follows uneven light
LEAST_CONTRAST = 12.0  # least difference in grey levels between film and paper
FLATBED_DPI = range(150, 9601)  # credible resolutions of a scan: cameras write 72 or 96


@dataclass(frozen=True)
class ScanPicture:
    """The ``pixels`` of a file with its hash; ``dpi`` along x and y as the file states, or None."""

    path: Path
    pixels: Pixels
    sha256: str
    dpi: tuple[float, float] | None


def read_picture(path: Path) -> ScanPicture:
    """Return the picture of a file that Pillow reads. Raises DesignError for other files."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    if not path.is_file():
        raise DesignError(f"{path} is not a file; give the picture of the cut sheet")
    if path.stat().st_size > MOST_BYTES:
        raise DesignError(f"{path} is larger than {MOST_BYTES:,} bytes; scan in greyscale")
    try:
        with Image.open(path) as image:
            columns, rows = image.size
            if columns * rows > MOST_PIXELS:
                raise DesignError(
                    f"{path} has {columns * rows:,} pixels; crop it to the sheet, or scan at a "
                    f"resolution that leaves at most {MOST_PIXELS:,}"
                )
            stated = image.info.get("dpi")
            grey = _grey(ImageOps.exif_transpose(image))
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except (UnidentifiedImageError, SyntaxError, ValueError, OSError) as error:
        if isinstance(error, DesignError):
            raise
        raise DesignError(
            f"{path} is not a picture that can be read; give a PNG, TIFF or JPEG file"
        ) from None
    if min(grey.shape) < LEAST_SIDE:
        raise DesignError(
            f"{path} is {columns} x {rows} pixels, too small to measure; scan at 600 dpi or more"
        )
    return ScanPicture(path, grey, digest, _resolution(stated))


def _grey(image: Any) -> Pixels:
    """Return grey levels from 0 to 255, also for a 16-bit picture."""
    if image.mode.startswith(("I", "F")):
        levels = np.asarray(image, dtype=np.float32)
        return levels / max(float(levels.max()), 1.0) * 255
    return np.asarray(image.convert("L"), dtype=np.float32)


def _resolution(stated: Any) -> tuple[float, float] | None:
    try:
        x, y = float(stated[0]), float(stated[1])
    except (TypeError, ValueError, IndexError, ZeroDivisionError):
        return None
    # JPEG and PNG store whole dots per centimetre or metre.
    return (x, y) if round(x) in FLATBED_DPI and round(y) in FLATBED_DPI else None


class PictureOutline(NamedTuple):
    """A closed outline, x and y in pixels, and whether its inside is lighter than the outside."""

    polygon: shapely.Polygon
    is_light: bool


def outlines(picture: ScanPicture) -> list[PictureOutline]:
    """Return regions that are lighter or darker than their surroundings, largest first.

    They are detected in the picture reduced to COARSE pixels, to within one pixel. Raises
    DesignError if there is no such region.
    """
    from skimage import measure

    factor = max(1, -(-max(picture.pixels.shape) // COARSE))
    reduced = _reduced(picture.pixels, factor)
    level = _level(reduced, picture.path)
    find_contours: Any = measure.find_contours
    results = []
    for contour in find_contours(reduced - level, 0.0):
        if len(contour) >= 8 and np.array_equal(contour[0], contour[-1]):
            # A reduced pixel's centre is the middle of its block.
            polygon = shapely.Polygon(contour[:, ::-1] * factor + (factor - 1) / 2)
            if polygon.area > 12 * factor**2:
                results.append(PictureOutline(polygon, polygon.exterior.is_ccw))
    return sorted(results, key=lambda outline: -outline.polygon.area)


def _reduced(pixels: Pixels, factor: int) -> Pixels:
    """Return the means of blocks of ``factor`` by ``factor`` pixels."""
    rows, columns = (side // factor * factor for side in pixels.shape)
    blocks = pixels[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)


def _level(reduced: Pixels, path: Path) -> Pixels:
    """Return the threshold midway between film and paper, adapted to uneven light."""
    from scipy.ndimage import gaussian_filter, map_coordinates
    from skimage import filters

    # Light changes slowly: a sample every few pixels suffices.
    sparse = gaussian_filter(reduced, 1.0)[::SPARSE, ::SPARSE]
    threshold_otsu: Any = filters.threshold_otsu
    level: Any = threshold_otsu(sparse)
    for _ in range(ROUNDS):
        is_light = sparse > level
        is_plain = is_light.all() or not is_light.any()
        contrast = 0.0 if is_plain else np.median(sparse[is_light]) - np.median(sparse[~is_light])
        if contrast < LEAST_CONTRAST:
            raise DesignError(
                f"{path}: film and paper differ by {contrast:.0f} of 255 grey levels, but "
                f"{LEAST_CONTRAST:.0f} are needed; lay the film on black paper and scan again"
            )
        level = (_local_mean(sparse, is_light) + _local_mean(sparse, ~is_light)) / 2
    places = np.meshgrid(*(np.arange(side) / SPARSE for side in reduced.shape), indexing="ij")
    return np.asarray(map_coordinates(level, places, order=1, mode="nearest"), dtype=np.float32)


def _local_mean(values: Pixels, mask: NDArray[np.bool_]) -> Pixels:
    """Return the mean of the values in a mask, weighted by distance; far away, the overall mean."""
    from scipy.ndimage import binary_erosion, gaussian_filter

    width = max(values.shape) / 12
    inner = binary_erosion(mask)
    weights = (inner if inner.any() else mask).astype(np.float32)
    mean = float(values[weights > 0].mean())
    total = gaussian_filter(values * weights, width) + 1e-3 * mean
    return np.asarray(total / (gaussian_filter(weights, width) + 1e-3))


# The cut file.


SPACING = 1.0  # default distance between cuts, for a file without one, mm
SAME_SIZE, SAME_EDGE = 1e-4, 2e-3
"""Largest difference of congruent pieces in area, mm2, and of their edges, mm."""


@dataclass(frozen=True)
class SheetShape:
    """A piece of a pattern: ``name`` is the pattern, such as P05."""

    name: str
    region: Region


@dataclass(frozen=True)
class DrawnSheet:
    """Contours of a cut file along the beam's path, mm.

    ``places``: the pieces at their cut positions, named by their patterns. ``shapes``: every piece
    of the folder, since any may lie in a place. ``pins``: x, y and diameter of the pins of a sheet.
    ``kerf`` is the file's kerf compensation.
    """

    name: str
    places: tuple[SheetShape, ...]
    shapes: tuple[SheetShape, ...]
    pins: tuple[tuple[float, float, float], ...]
    spacing: float
    kerf: str
    film: str

    @property
    def bounds(self) -> Bounds:
        return Region(tuple(c for place in self.places for c in place.region.contours)).bounds


def read_cut_sheet(source: Path, name: str | None) -> DrawnSheet:
    """Return the sheet or layer ``name`` of an output folder, or a cut file at a path.

    Raises DesignError if the folder has no such file, OutputError if a file is corrupt.
    """
    if source.suffix.lower() == ".dxf":
        return _sheet(source.stem, source)
    claims = read_index(source)
    sheets = {Path(sheet.file).stem: sheet for sheet in claims.sheets}
    layers = dict(_layers(source, claims))
    name = _chosen(name, [*sheets, *layers])
    shapes = tuple(_shapes(layers))
    if name not in sheets:
        return _sheet(name, layers[name][1], shapes)
    sheet = sheets[name]
    path = path_in_folder(source, sheet.file)
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in sheet.pins)
    return _sheet(name, path, shapes, sheet.spacing, pins)


def _chosen(name: str | None, names: Sequence[str]) -> str:
    listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    if name is None:
        if len(names) == 1:
            return names[0]
        raise DesignError(f"--sheet is missing; name the cut file in the picture: {listed}")
    stem = Path(name).name.removesuffix(".dxf")
    if stem not in names:
        raise DesignError(f"--sheet {name[:60]!r} is not in the folder; use {listed}")
    return stem


def _layers(folder: Path, claims: Manifest | JobManifest) -> Iterator[tuple[str, tuple[str, Path]]]:
    """Yield the name of each layer's cut file with its pattern and path."""
    if isinstance(claims, JobManifest):
        for design in claims.designs:
            inner = path_in_folder(folder, design.folder)
            for name, (pattern, path) in _layers(inner, read_design_index(inner)):
                yield f"{design.name}/{name}", (f"{design.name} {pattern}", path)
        return
    for layer in claims.layers:
        if layer.file is not None:
            path = path_in_folder(folder, layer.file)
            yield path.stem, (layer.pattern, path)


def _shapes(layers: dict[str, tuple[str, Path]]) -> Iterator[SheetShape]:
    """Yield the pieces of every pattern once."""
    patterns = dict(reversed(layers.values()))
    for pattern, path in sorted(patterns.items()):
        pieces = {piece.key: piece for piece in read_profile(path).region.pieces}
        yield from (SheetShape(pattern, piece) for piece in pieces.values())


def _sheet(
    name: str,
    path: Path,
    shapes: tuple[SheetShape, ...] = (),
    spacing: float = SPACING,
    pins: tuple[tuple[float, float, float], ...] = (),
) -> DrawnSheet:
    drawing = read_profile(path)
    if not drawing.region.contours:
        raise OutputError(f"{path.name} contains no parts; give a sheet or layer with parts")
    named: list[SheetShape] = []
    unnamed: list[SheetShape] = []
    for piece in drawing.region.pieces:
        names = [shape.name for shape in shapes if _is_congruent(piece, shape.region)]
        if not names:
            names = [f"part {len(unnamed) + 1}"]
            unnamed.append(SheetShape(names[0], piece))
        named.append(SheetShape(", ".join(dict.fromkeys(names)), piece))
    kerf, film = (drawing.properties.get(key, "") for key in ("KERF_WIDTH", "MATERIAL"))
    every = (*shapes, *unnamed)
    return DrawnSheet(name, tuple(named), every, pins, spacing, kerf or "none", film)


def _is_congruent(piece: Region, shape: Region) -> bool:
    """Return True if a piece is a shape shifted and rotated by quarter turns."""
    if len(piece.contours) != len(shape.contours) or abs(piece.area - shape.area) > SAME_SIZE:
        return False
    lying = _centred(piece)
    turned = (_centred(shape.turned(90.0 * turn)) for turn in TURNS)
    return any(lying.hausdorff_distance(each) < SAME_EDGE for each in turned)


def _centred(region: Region) -> shapely.MultiPolygon:
    """Return a region with the centre of its box at the origin."""
    low_x, low_y, high_x, high_y = region.bounds
    return region.moved(-(low_x + high_x) / 2, -(low_y + high_y) / 2).shapely()


# Both together.


MILLIMETRES = 25.4  # an inch, mm


@dataclass(frozen=True)
class Reference:
    """A scale reference: ``dpi`` along rows and columns, a ``bar`` of this length (mm), or the
    ``pins``.

    The first of bar, pins and dpi that is given is used; without any, the scale is 1.
    """

    dpi: tuple[float, float] | None = None
    bar: float | None = None
    pins: bool = False

    @property
    def pixels_per_mm(self) -> float | None:
        return None if self.dpi is None else math.sqrt(self.dpi[0] * self.dpi[1]) / MILLIMETRES


@dataclass(frozen=True)
class Scan:
    """A picture of a sheet and the way it was taken.

    ``is_camera``: with perspective. ``is_light``: film is lighter than its background.
    """

    picture: ScanPicture
    sheet: DrawnSheet
    reference: Reference
    is_camera: bool = False
    is_light: bool = True

    @cached_property
    def outlines(self) -> list[PictureOutline]:
        """The outlines in the picture, largest first."""
        return outlines(self.picture)
