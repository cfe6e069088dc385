"""A picture of film on paper: its grey levels, and the outlines visible in it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sbafab.errors import DesignError

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
    """``pixels`` of a file with its hash; ``dpi`` along x and y as stated in the file, or None."""

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
        raise DesignError(f"{path} is larger than {MOST_BYTES:,} bytes; scan in grey")
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
    """Return grey levels of 0 to 255, also for a picture of 16 bits."""
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
    """A closed outline, x and y in pixels; its inside is lighter than its surroundings, or not."""

    polygon: shapely.Polygon
    is_light: bool


def outlines(picture: ScanPicture) -> list[PictureOutline]:
    """Return regions that are lighter or darker than their surroundings, largest first.

    They are found in the picture reduced to COARSE pixels, within a pixel of that. Raises
    DesignError if nothing stands out.
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
    """Return the threshold midway between film and paper, following uneven light."""
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
                f"{path}: film and paper differ by {contrast:.0f} of 255 grey levels, and "
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
