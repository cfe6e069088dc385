"""References for a picture's scale: the scanner's resolution, a bar, or the sheet's pins.

The fit maps the cut file to the film, so a millimetre of the file is one of the film. An
independent length gives the true length of that millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sbafab.errors import DesignError
from sbafab.geometry.region import Region, disc, polygon
from sbafab.lab.cut_sheet import DrawnSheet
from sbafab.lab.edges import EdgeFit, crossings, samples_of
from sbafab.lab.picture import PictureOutline, ScanPicture, moments
from sbafab.lab.registration import CORNER_STEPS, PointArray

MILLIMETRES = 25.4
"""An inch, mm."""
NEAR_LENGTH = 0.05
"""Largest relative error of a bar's length before it is measured."""
BAR_FILL = 0.9
"""Least share of its box that a bar fills."""
LEAST_PINS = 2
SEARCH = 0.45
"""Search range around a drawn edge, mm."""


@dataclass(frozen=True)
class Scale:
    """True over drawn lengths along x and y, and the reference."""

    x: float
    y: float
    reference: str


@dataclass(frozen=True)
class Reference:
    """``dpi`` along the picture's rows and columns; a ``bar`` of this length, mm; the ``pins``.

    The first of bar, pins and dpi that is given is used; without any, the scale is 1.
    """

    dpi: tuple[float, float] | None = None
    bar: float | None = None
    pins: bool = False

    @property
    def pixels_per_mm(self) -> float | None:
        return None if self.dpi is None else math.sqrt(self.dpi[0] * self.dpi[1]) / MILLIMETRES


def scale_of(
    picture: ScanPicture,
    sheet: DrawnSheet,
    fit: EdgeFit,
    measured: Sequence[PictureOutline],
    reference: Reference,
) -> Scale:
    """Return the film's scale by the reference. Raises DesignError if that is not visible."""
    if reference.bar is not None:
        scale = _by_bar(picture, sheet, fit, measured, reference.bar)
        return Scale(scale, scale, f"the bar of {reference.bar:g} mm")
    if reference.pins:
        scale = _by_pins(picture, sheet, fit)
        return Scale(scale, scale, f"{len(sheet.pins)} pins")
    if reference.dpi is None:
        return Scale(1.0, 1.0, "none: taken from the cut file")
    step = fit.warp(np.array(fit.warp.centre) + CORNER_STEPS)
    along = (step[1:] - step[0]) * 1e3 / np.array(reference.dpi) * MILLIMETRES
    x, y = np.hypot(along[:, 0], along[:, 1])
    dpi = f"{reference.dpi[0]:.0f}"
    if round(reference.dpi[0]) != round(reference.dpi[1]):
        dpi += f" x {reference.dpi[1]:.0f}"
    return Scale(float(x), float(y), f"{dpi} dpi")


def _by_bar(
    picture: ScanPicture,
    sheet: DrawnSheet,
    fit: EdgeFit,
    measured: Sequence[PictureOutline],
    length: float,
) -> float:
    low_x, low_y, high_x, high_y = sheet.bounds
    for outline in measured:
        points = fit.warp.inverse(outline.points)
        area, middle = moments(points)
        arms = points - middle
        _, axes = np.linalg.eigh(arms.T @ arms)
        across, along = arms @ axes[:, 0], arms @ axes[:, 1]
        long, wide = float(np.ptp(along)), float(np.ptp(across))
        is_outside = not (low_x < middle[0] < high_x and low_y < middle[1] < high_y)
        if (
            is_outside
            and abs(long / length - 1) < NEAR_LENGTH
            and abs(area) > BAR_FILL * long * wide
        ):
            return length / _length(picture, fit, middle, axes, (long, wide))
    raise DesignError(
        f"--bar is {length:g} mm, and no bar about that long lies beside the parts; lay a straight "
        "bar with square ends on the paper, clear of the film and the picture's border"
    )


def _length(
    picture: ScanPicture,
    fit: EdgeFit,
    middle: PointArray,
    axes: PointArray,
    size: tuple[float, float],
) -> float:
    """Return the length of a bar between its ends, mm of the cut file."""
    half = np.array([size[1] / 2, size[0] / 2])
    corners = [middle + axes @ (half * sign) for sign in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    bar = polygon([(float(x), float(y)) for x, y in corners])
    samples = samples_of([bar], False)
    outside = crossings(picture, fit.warp, samples, SEARCH).outside
    along = (samples.points - middle) @ axes[:, 1]
    towards = samples.normals @ axes[:, 1]
    ends = [
        along[at] + towards[at] * outside[at]
        for sign in (1, -1)
        for at in [(sign * towards > 0.9) & np.isfinite(outside)]
    ]
    if min(map(len, ends)) == 0:
        raise DesignError("--bar: its ends are not seen; lay it on the paper with square ends")
    return float(np.median(ends[0]) - np.median(ends[1]))


def _by_pins(picture: ScanPicture, sheet: DrawnSheet, fit: EdgeFit) -> float:
    if len(sheet.pins) < LEAST_PINS:
        raise DesignError(
            f"--pins needs {LEAST_PINS} pins of {sheet.name} or more, and it has "
            f"{len(sheet.pins)}; give --dpi or --bar"
        )
    drawn = np.array([(x, y) for x, y, _ in sheet.pins])
    measured = np.array([_pin(picture, fit, pin) for pin in sheet.pins])
    a, b = drawn - drawn.mean(axis=0), measured - measured.mean(axis=0)
    return math.sqrt(float((a**2).sum() / (b**2).sum()))


def _pin(picture: ScanPicture, fit: EdgeFit, pin: tuple[float, float, float]) -> PointArray:
    """Return the middle of a pin, mm of the cut file."""
    x, y, diameter = pin
    region: Region = disc((x, y), diameter / 2)
    samples = samples_of([region], False)
    for _ in range(3):
        outside = crossings(picture, fit.warp, samples, SEARCH).outside
        known = np.isfinite(outside)
        if known.mean() < 0.8:
            raise DesignError(
                f"the pin at x {x:g}, y {y:g} mm is not seen; give --dpi or --bar, or a picture "
                "with all pins"
            )
        columns = np.column_stack([samples.normals[known], np.ones(known.sum())])
        shift = np.linalg.lstsq(columns, outside[known], rcond=None)[0][:2]
        samples = replace(samples, points=samples.points + shift)
    return np.asarray(samples.points.mean(axis=0))
