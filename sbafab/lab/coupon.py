"""The kerf coupon, its table of measured sizes, and the kerf with its uncertainty.

An outside dimension is cut smaller by the kerf, a window larger; a constant reading error increases
both, and a scale error changes both in proportion. All three are therefore fitted together, by
least squares of measured = scale * nominal -/+ kerf + offset, as far as the sizes distinguish them.
An instrument that reads outsides too small and windows too large cannot be distinguished from kerf.

Uncertainties follow the Guide to the Expression of Uncertainty in Measurement: scatter and the
residual rounding error in quadrature, with Student's t for the interval.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.cutting.cut_settings import kerf_properties
from sbafab.cutting.dxf_write import Surroundings, contour_runs, drawn, dxf_text
from sbafab.cutting.laser_programs import svg_text
from sbafab.cutting.lettering import Stroke, strokes
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, rectangle, union
from sbafab.laminate.films import PTFE_WARNING
from sbafab.spreadsheet import csv_text, table_rows

MOST_DEGREES = 200  # degrees of freedom from which on Student's t is taken as if there were no more
LARGEST = 1.0  # mm; a wider kerf is a mistake in the table
WORST_SCALE = 0.1
"""Bounds of measured over nominal size: a larger deviation means another unit, not the machine."""
LARGEST_SLIP = 0.25
"""mm; more than twice the largest error of laser cutting (paper, Sec. 2) is a slip of the pen."""
MOST_SUSPECTS = 20
"""Sizes that are tried as the one slip, starting with the farthest from the middle one."""
WIDEST = 0.05
"""mm; half the largest error of laser cutting: a kerf known no better deserves a warning."""


SAME_COLUMN = 1e-6
"""Singular values of columns of length 1, below which the sizes do not tell two causes apart."""
FREE = 4
"""Degrees of freedom that a difference between x and y must leave: Student's t is 2.8 there."""
RESOLUTIONS = {"calliper": 0.01, "scanner": 25.4 / 2400, "microscope": 0.001}
"""mm: the least step of each instrument; a scanner's is for 2400 dots per inch."""
UNNAMED = RESOLUTIONS["calliper"]  # mm: the least step of an unnamed instrument
Kind = Literal["outer", "window"]
Axis = Literal["x", "y"]


@dataclass(frozen=True)
class Measurement:
    """A size of the coupon, mm; ``where`` is its place in the table, for messages."""

    kind: Kind
    axis: Axis
    nominal: float
    measured: float
    where: str = field(default="", compare=False)
    instrument: str = ""

    @property
    def sign(self) -> int:
        """The sign of the kerf in the size: -1 for an outside, 1 for a window."""
        return -1 if self.kind == "outer" else 1

    @property
    def along_x(self) -> int:
        """1 along x, -1 along y."""
        return 1 if self.axis == "x" else -1

    @property
    def kerf(self) -> float:
        """The kerf from this size only, mm."""
        return self.sign * (self.measured - self.nominal)

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        sizes = f"nominal {self.nominal:g} and measured {self.measured:g} mm"
        return f"{place}the {self.kind} along {self.axis}, {sizes},"


@dataclass(frozen=True)
class Value:
    """A value, its standard uncertainty and the half width of its 95 % interval.

    ``value``, ``uncertainty`` and ``half_width`` are mm of a kerf; a scale's are a ratio.
    """

    value: float
    uncertainty: float
    half_width: float

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, in the unit of the value."""
        return self.value - self.half_width, self.value + self.half_width

    def differs_from(self, value: float) -> bool:
        """Return True if the interval does not contain ``other``."""
        return abs(self.value - value) > self.half_width


@dataclass(frozen=True)
class Estimate:
    """The kerf in mm from ``count`` sizes, fitted together with offsets and scale.

    ``offsets`` holds the excess of each instrument's readings, mm, by name; empty if undetermined
    and then assumed 0. ``scale`` is measured over nominal size after kerf and offsets; None if
    undetermined and then assumed 1. Kerf and scale are means of x and y; ``kerf_along_x`` mm and
    ``scale_along_x``, a ratio, are added to them along x and subtracted along y. ``degrees`` is the
    number of degrees of freedom.
    """

    kerf: Value
    scale: Value | None
    offsets: Mapping[str, Value]
    count: int
    degrees: int
    kerf_along_x: float = 0.0
    scale_along_x: float = 0.0

    @property
    def is_scaled(self) -> bool:
        """True if the sizes show a scale other than 1."""
        return self.scale is not None and self.scale.differs_from(1.0)

    @property
    def is_vague(self) -> bool:
        """True if the kerf may be 0, or is too uncertain for compensation."""
        return self.kerf.interval[0] <= 0 or self.kerf.half_width > WIDEST

    def gap(self, size: Measurement) -> float:
        """Return the distance of a size from the fitted kerf and scale, mm."""
        scale = 1.0 if self.scale is None else self.scale.value
        scale += size.along_x * self.scale_along_x
        kerf = self.kerf.value + size.along_x * self.kerf_along_x
        offset = self.offsets[size.instrument].value if self.offsets else 0.0
        return abs(size.measured - scale * size.nominal - size.sign * kerf - offset)


@dataclass(frozen=True)
class Calibration:
    """The kerf from all sizes, and from the sizes along x and along y if both are known.

    ``difference`` is the kerf along x minus the kerf along y.
    """

    overall: Estimate
    x: Estimate | None
    y: Estimate | None
    difference: Value | None

    @property
    def differs(self) -> bool:
        """True if the kerf along x differs from that along y."""
        return self.difference is not None and self.difference.differs_from(0.0)


def calibrated(measurements: Sequence[Measurement], resolution: float | None = None) -> Calibration:
    """Return the kerf from at least two sizes; ``resolution`` in mm is the instrument's smallest
    step.

    By default it comes from RESOLUTIONS, the coarsest if several instruments were used. Raises
    DesignError for fewer sizes, an erroneous size, or an implausible kerf.
    """
    if resolution is None:
        steps = [RESOLUTIONS.get(size.instrument, UNNAMED) for size in measurements]
        resolution = max(steps, default=UNNAMED)
    _refuse_a_slip(measurements, resolution)
    overall = _estimate(measurements, resolution)
    along_x, along_y = ([m for m in measurements if m.axis == axis] for axis in ("x", "y"))
    if min(len(along_x), len(along_y)) < 2:
        return Calibration(overall, None, None, None)
    x = _estimate(along_x, resolution, " along x")
    y = _estimate(along_y, resolution, " along y")
    uncertainty = math.hypot(x.kerf.uncertainty, y.kerf.uncertainty)
    half = student_t(min(x.degrees, y.degrees)) * uncertainty
    return Calibration(overall, x, y, Value(x.kerf.value - y.kerf.value, uncertainty, half))


def _estimate(measurements: Sequence[Measurement], resolution: float, where: str = "") -> Estimate:
    if len(measurements) < 2:
        raise DesignError(
            f"sizes measured{where}: {len(measurements)}; a kerf needs 2; fill in more rows"
        )
    estimate = _fitted(measurements, resolution)
    kerf, scale = estimate.kerf.value, estimate.scale
    if scale is not None and abs(scale.value - 1) > WORST_SCALE:
        raise DesignError(
            f"the measured sizes{where} are about {scale.value:.3g} times the nominal ones; give "
            "them in millimetres"
        )
    if not 0 <= kerf <= LARGEST:
        kind = "negative" if kerf < 0 else f"over {LARGEST:g} mm"
        raise DesignError(
            f"the kerf{where} is {kerf:.3f} mm, which is {kind}; check the measurements, "
            "the unit and which rows are outers and windows"
        )
    worst = max(measurements, key=estimate.gap)
    if estimate.gap(worst) > LARGEST_SLIP:
        raise DesignError(
            f"{worst} is {estimate.gap(worst):.2f} mm off the fit to all sizes; measure it "
            "again, and the others too"
        )
    return estimate


def _refuse_a_slip(measurements: Sequence[Measurement], resolution: float) -> None:
    """Raise DesignError naming the one size without which all others agree, if there is one.

    A recording error shifts the common fit, so that the kerf or unit would be blamed.
    """
    middle = median(m.kerf for m in measurements) if measurements else 0.0
    slips: list[tuple[float, float, Measurement]] = []
    for suspect in sorted(measurements, key=lambda m: -abs(m.kerf - middle))[:MOST_SUSPECTS]:
        rest = [m for m in measurements if m is not suspect]
        if len(rest) < 2 or suspect.instrument not in {size.instrument for size in rest}:
            continue
        off = _fitted(rest, resolution).gap(suspect)
        try:
            estimate = _estimate(rest, resolution)
        except DesignError:
            continue
        if off > LARGEST_SLIP:
            slips.append((max(map(estimate.gap, rest)), off, suspect))
    if slips:
        _, off, slip = min(slips, key=lambda entry: entry[0])
        raise DesignError(
            f"{slip} is {off:.2f} mm off the fit to the other sizes; correct the entry or "
            "measure it again"
        )


def _fitted(measurements: Sequence[Measurement], resolution: float) -> Estimate:
    """Kerf, offsets and scale by least squares, plausible or not, from at least two sizes."""
    instruments = sorted({size.instrument for size in measurements})
    count = len(measurements)
    nominal = np.array([size.nominal for size in measurements])
    departure = np.array([size.measured for size in measurements]) - nominal
    sign = np.array([float(size.sign) for size in measurements])
    along_x = np.array([float(size.along_x) for size in measurements])
    is_read_by = [[size.instrument == name for name in instruments] for size in measurements]
    # The last two are small: with few sizes the fit is better if they are taken as 0.
    blocks = {
        "offsets": (np.array(is_read_by, dtype=float), 1),
        "scale": (nominal, 1),
        "kerf along x": (sign * along_x, FREE),
        "scale along x": (nominal * along_x, FREE),
    }
    columns = sign[:, None]
    # The columns of each cause that the sizes tell from the others.
    places: dict[str, range] = {"kerf": range(1)}
    for cause, (block, free) in blocks.items():
        wider = np.column_stack([columns, block])
        if count - wider.shape[1] >= free and _are_apart(wider):
            places[cause] = range(columns.shape[1], wider.shape[1])
            columns = wider
    values = np.linalg.lstsq(columns, departure, rcond=None)[0]
    degrees = count - columns.shape[1]
    scatter = float(np.sum((departure - columns @ values) ** 2)) / degrees
    spread = np.linalg.inv(columns.T @ columns).diagonal()
    # No reading is better than the instrument, however well a few of them agree.
    errors = np.sqrt(max(scatter, resolution**2 / 12) * spread).tolist()
    errors[0] = math.hypot(errors[0], _left_by_rounding(scatter, resolution))
    t = student_t(degrees)
    fitted = [Value(v, u, t * u) for v, u in zip(values.tolist(), errors, strict=True)]
    causes = {cause: [fitted[k] for k in at] for cause, at in places.items()}
    return Estimate(
        kerf=fitted[0],
        scale=next((replace(s, value=1 + s.value) for s in causes.get("scale", ())), None),
        offsets=dict(zip(instruments, causes.get("offsets", ()), strict=False)),
        count=count,
        degrees=degrees,
        kerf_along_x=sum(each.value for each in causes.get("kerf along x", ())),
        scale_along_x=sum(each.value for each in causes.get("scale along x", ())),
    )


def _are_apart(columns: NDArray[Any]) -> bool:
    """Return True if the sizes distinguish the effects of the columns."""
    unit = columns / np.linalg.norm(columns, axis=0)
    return bool(np.linalg.matrix_rank(unit, tol=SAME_COLUMN) == unit.shape[1])


def _left_by_rounding(scatter: float, resolution: float) -> float:
    """Return the standard uncertainty that remains in a mean of readings rounded to a step.

    A mean of Gaussian readings of deviation s, rounded to steps d, is off by up to d / pi * exp(-2
    (pi s / d)^2) (B. Widrow, I. Kollar, Quantization Noise, 2008): if all readings agree, a full
    step remains uncertain; if they scatter by half a step, nothing does.
    """
    steps = max(scatter - resolution**2 / 12, 0.0) / resolution**2 if resolution else 0.0
    return resolution / math.sqrt(12) * math.exp(-2 * math.pi**2 * steps)


@cache
def student_t(degrees: int) -> float:
    """Return the two-sided 95 % quantile of Student's t, by its series for integer degrees of
    freedom.
    """
    degrees = min(degrees, MOST_DEGREES)
    low, high, odd = 1.0, 20.0, degrees % 2
    while high - low > 1e-12:
        t = (low + high) / 2
        angle = math.atan(t / math.sqrt(degrees))
        term = math.sin(angle) * (math.cos(angle) if odd else 1.0)
        within = 0.0
        for k in range(1 + odd, degrees, 2):
            within += term
            term *= math.cos(angle) ** 2 * k / (k + 1)
        within = 2 / math.pi * (angle + within) if odd else within
        low, high = (t, high) if within < 0.95 else (low, t)
    return (low + high) / 2


# The calibration piece: four frames of film whose sizes tell how wide the beam cuts.
#
# A frame's outside comes out smaller by the kerf, its window larger, and the piece that falls out
# of the window smaller again. Sides along x and y differ, so that a frame that fell out still
# tells which is which. A window and its piece are drawn alike, so that they tell a reading error,
# which makes both larger, from kerf; several sizes tell a scale from both.


SIZE = 60.0  # side in mm of the film that the piece needs
COLUMNS = ("feature", "axis", "nominal_mm", "measured_mm")
HINTS = (
    "# Cut coupon.dxf with kerf offset 0; measure each size in the middle of the side; "
    "leave what you cannot measure empty",
    "# A piece is what fell out of the window of A: keep it",
    "# A scan at 2400 dpi or a microscope touches no edge; a calliper bends thin film",
)
LETTER = 2.4
TITLE = "KERF COUPON"


class CouponFrame(NamedTuple):
    """A frame of film: its name, lower left corner, outside and window along x and y, in mm."""

    name: str
    corner: Point
    outer: Point
    window: Point

    @property
    def region(self) -> Region:
        (x, y), (width, height), (inner_width, inner_height) = self[1:]
        # The window in the middle.
        u, v = x + (width - inner_width) / 2, y + (height - inner_height) / 2
        window = rectangle((u, v), (u + inner_width, v + inner_height))
        return rectangle((x, y), (x + width, y + height)) - window


FRAMES = (
    CouponFrame("A", (4.0, 34.0), (24.0, 20.0), (14.0, 10.0)),
    CouponFrame("B", (32.0, 34.0), (24.0, 20.0), (14.0, 10.0)),
    CouponFrame("C", (8.0, 12.0), (16.0, 12.0), (8.0, 6.0)),
    CouponFrame("D", (36.0, 12.0), (16.0, 12.0), (8.0, 6.0)),
)


def coupon() -> Region:
    """Return the frames, nominal, on a square of film with its lower left corner at the origin."""
    return union(frame.region for frame in FRAMES)


def coupon_csv() -> str:
    """Return the table to fill in: a row for each size along each axis."""
    rows: list[Sequence[str]] = [COLUMNS]
    for frame in FRAMES:
        sizes = {"outer": frame.outer, "window": frame.window, "piece": frame.window}
        rows += [
            (f"{frame.name} {kind}", axis, f"{nominal:g}", "")
            for kind, size in sizes.items()
            for axis, nominal in zip("xy", size, strict=True)
        ]
    return "".join(f"{hint}\n" for hint in HINTS) + csv_text(rows)


def write_coupon(folder: Path, generator: str) -> tuple[Path, ...]:
    """Write ``coupon.dxf``, ``.svg`` and ``.csv``, read back, without overwriting.

    Raises DesignError if one exists, OutputError if the file does not match when read back.
    """
    paths = tuple(folder / f"coupon.{ending}" for ending in ("dxf", "svg", "csv"))
    for path in paths:
        if path.exists():
            raise DesignError(f"{path} exists; choose another folder or remove it first")
    folder.mkdir(parents=True, exist_ok=True)
    region = coupon()
    properties = {
        "PATTERN": "coupon",
        "MATERIAL": "any film",
        "UNITS": "mm",
        # Never compensated, for it measures the kerf.
        **kerf_properties(None),
        "GENERATOR": generator,
        "WARNING": PTFE_WARNING,
    }
    contours = cutting_sequence(region)
    sheet = Surroundings(engraved=_labels(), frame=(SIZE, SIZE))
    drawing, picture, table = paths
    drawing.write_bytes(dxf_text(contours, properties, sheet=sheet).encode())
    verify_file(drawing, region, properties, sheet)
    runs = drawn(contour_runs(contours), sheet)
    picture.write_bytes(svg_text(runs, (SIZE, SIZE), TITLE).encode())
    table.write_bytes(coupon_csv().encode())
    return paths


def _labels() -> tuple[Stroke, ...]:
    """Return names in the waste over each frame, and a title that shows the x direction."""
    names = [strokes(f.name, (f.corner[0], f.corner[1] + f.outer[1] + 1.2), LETTER) for f in FRAMES]
    title = strokes(f"{TITLE} - X", (8.0, 4.0), LETTER)
    x, y = 44.5, 4.0 + LETTER / 2
    tip = (x + 8, y)
    arrow = (((x, y), tip), ((x + 6.5, y + 1), tip, (x + 6.5, y - 1)))
    return (*(stroke for name in names for stroke in name), *title, *arrow)


# The coupon's filled-in table.


LONGEST = 10_000.0  # mm
NUMBERS = ("nominal_mm", "measured_mm")
INSTRUMENT = "instrument"  # an optional column: the instrument of the measurement
KINDS: dict[str, Kind] = {"outer": "outer", "window": "window", "piece": "outer"}
"""Last words of a feature; a piece fell out of a window."""
_NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)", re.ASCII)


def read_measurements(path: Path, instrument: str = "") -> list[Measurement]:
    """Return the filled rows of a table with the coupon's columns; ``#`` starts a comment."""
    rows = table_rows(path, COLUMNS, NUMBERS)
    return [_measurement(row, where, instrument) for where, row in rows if row["measured_mm"]]


def _measurement(row: Mapping[str, str], where: str, instrument: str) -> Measurement:
    kinds = {KINDS[word] for word in row["feature"].lower().split() if word in KINDS}
    if len(kinds) != 1:
        raise DesignError(f"{where}: feature must end in outer, window or piece")
    used = row.get(INSTRUMENT, "").lower() or instrument
    if used and used not in RESOLUTIONS:
        allowed = ", ".join(RESOLUTIONS)
        raise DesignError(f"{where}: instrument is {used[:40]!r}; it must be one of {allowed}")
    axis = row["axis"].lower()
    if axis not in ("x", "y"):
        raise DesignError(f"{where}: axis must be x or y")
    nominal, measured = (_size(row[name], name, where) for name in NUMBERS)
    return Measurement(kinds.pop(), "x" if axis == "x" else "y", nominal, measured, where, used)


def _size(text: str, column: str, where: str) -> float:
    if _NUMBER.fullmatch(text) is None:
        raise DesignError(
            f"{where}: {column} is {text[:40]!r}, not a number; write it in mm, for example 23.9"
        )
    size = float(text.replace(",", "."))
    if not 0 < size <= LONGEST:
        raise DesignError(
            f"{where}: {column} is {text[:40]}; it must be a size in mm, above 0 and at most "
            f"{LONGEST:g}"
        )
    return size
