"""The kerf from what was measured on the calibration piece, with its uncertainty.

An outside comes out smaller by the kerf, a window larger; a constant reading error makes both
larger, and a scale both in proportion. So all three are fitted together, by least squares of
measured = scale * nominal -/+ kerf + offset, as far as the sizes tell them apart. What no size
tells from kerf is an instrument that reads outsides too small and windows too large.

Uncertainties follow the usual guide to their expression: scatter and what rounding leaves in
quadrature, Student's t for the interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from statistics import median
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from sbafab.errors import DesignError

MOST_DEGREES = 200
"""Degrees of freedom from which on Student's t is taken as if there were no more."""
LARGEST = 1.0
"""mm; a wider kerf is a mistake in the table."""
WORST_SCALE = 0.1
"""Of measured over nominal sizes: no machine is so far off, another unit is."""
LARGEST_SLIP = 0.25
"""mm; more than twice the largest error of laser cutting (paper, Sec. 2) is a slip of the pen."""
MOST_SUSPECTS = 20
"""Sizes that are tried as the one slip, those farthest from the middle one first."""
WIDEST = 0.05
"""mm; half the largest error of laser cutting: a kerf known no better deserves a warning."""

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAME_COLUMN = 1e-6
"""Singular values of columns of length 1, below which the sizes do not tell two causes apart."""
FREE = 4
"""Degrees of freedom that a difference between x and y must leave: Student's t is 2.8 there."""
RESOLUTIONS = {"calliper": 0.01, "scanner": 25.4 / 2400, "microscope": 0.001}
"""mm: the least step of an instrument, of a scanner that of 2400 dots an inch."""
UNNAMED = RESOLUTIONS["calliper"]
"""mm, of an instrument that nobody named."""
Kind = Literal["outer", "window"]
Axis = Literal["x", "y"]


@dataclass(frozen=True)
class Measurement:
    """A size of the piece, mm; ``where`` it stands in the table, for messages."""

    kind: Kind
    axis: Axis
    nominal: float
    measured: float
    where: str = field(default="", compare=False)
    instrument: str = ""

    @property
    def sign(self) -> int:
        """By which the kerf counts in the size: -1 of an outside, 1 of a window."""
        return -1 if self.kind == "outer" else 1

    @property
    def along_x(self) -> int:
        """1 along x, -1 along y."""
        return 1 if self.axis == "x" else -1

    @property
    def kerf(self) -> float:
        """What this size alone says of the kerf."""
        return self.sign * (self.measured - self.nominal)

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        sizes = f"nominal {self.nominal:g} and measured {self.measured:g} mm"
        return f"{place}the {self.kind} along {self.axis}, {sizes},"


class Value(NamedTuple):
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

    def differs_from(self, other: float) -> bool:
        """Whether the interval leaves ``other`` out."""
        return abs(self.value - other) > self.half_width


@dataclass(frozen=True)
class Estimate:
    """The kerf in mm from ``count`` sizes, fitted together with what else they tell.

    ``offsets``: what each instrument reads too much, mm, by its name; empty where the sizes cannot
    tell, which takes it as 0. ``scale``: measured over nominal size apart from both; None where the
    sizes cannot tell, which takes it as 1. Both are means of x and y; ``kerf_along_x`` mm and
    ``scale_along_x``, a ratio, are what they are more along x, and less along y. ``degrees`` of
    freedom are left.
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
        """Whether the sizes show a scale other than 1."""
        return self.scale is not None and self.scale.differs_from(1.0)

    @property
    def is_vague(self) -> bool:
        """Whether the kerf may as well be none, or is known too badly to compensate with."""
        return self.kerf.interval[0] <= 0 or self.kerf.half_width > WIDEST

    def gap(self, size: Measurement) -> float:
        """How far a size lies from what kerf and scale say it should be."""
        scale = 1.0 if self.scale is None else self.scale.value
        scale += size.along_x * self.scale_along_x
        kerf = self.kerf.value + size.along_x * self.kerf_along_x
        offset = self.offsets[size.instrument].value if self.offsets else 0.0
        return abs(size.measured - scale * size.nominal - size.sign * kerf - offset)


@dataclass(frozen=True)
class Calibration:
    """The kerf from all sizes, and from those along x and along y where both are known.

    ``difference``: kerf along x less that along y.
    """

    overall: Estimate
    x: Estimate | None
    y: Estimate | None
    difference: Value | None

    @property
    def differs(self) -> bool:
        """Whether the kerf along x is another one than along y."""
        return self.difference is not None and self.difference.differs_from(0.0)


def calibrated(measurements: Sequence[Measurement], resolution: float | None = None) -> Calibration:
    """The kerf from two sizes or more; ``resolution`` in mm is the instrument's least step.

    By default it is that of RESOLUTIONS, the coarsest where several were used. Raises DesignError
    where there are fewer sizes, where one of them is a slip, or where no beam cuts so.
    """
    if resolution is None:
        steps = [RESOLUTIONS.get(size.instrument, UNNAMED) for size in measurements]
        resolution = max(steps, default=UNNAMED)
    _refuse_a_slip(measurements, resolution)
    overall = _estimate(measurements, resolution)
    along = {axis: [m for m in measurements if m.axis == axis] for axis in ("x", "y")}
    if min(map(len, along.values())) < 2:
        return Calibration(overall, None, None, None)
    x, y = (_estimate(along[axis], resolution, f" along {axis}") for axis in ("x", "y"))
    uncertainty = math.hypot(x.kerf.uncertainty, y.kerf.uncertainty)
    degrees = min(x.degrees, y.degrees)
    difference = Value(x.kerf.value - y.kerf.value, uncertainty, student_t(degrees) * uncertainty)
    return Calibration(overall, x, y, difference)


def _estimate(measurements: Sequence[Measurement], resolution: float, where: str = "") -> Estimate:
    if len(measurements) < 2:
        raise DesignError(
            f"sizes measured{where}: {len(measurements)}, and a kerf needs 2; fill in more rows"
        )
    found = _fitted(measurements, resolution)
    if _is_other_unit(found):
        assert found.scale is not None
        raise DesignError(
            f"the measured sizes{where} are about {found.scale.value:.3g} times the nominal ones; "
            "give them in millimetres"
        )
    if not 0 <= found.kerf.value <= LARGEST:
        kind = "negative" if found.kerf.value < 0 else f"over {LARGEST:g} mm"
        raise DesignError(
            f"the kerf{where} comes out as {found.kerf.value:.3f} mm, which is {kind}; check the "
            "measurements, the unit and which rows are outers and windows"
        )
    worst = max(measurements, key=found.gap)
    if found.gap(worst) > LARGEST_SLIP:
        raise DesignError(
            f"{worst} is {found.gap(worst):.2f} mm off what the sizes together say; measure it "
            "again, and the others too"
        )
    return found


def _is_other_unit(found: Estimate) -> bool:
    return found.scale is not None and abs(found.scale.value - 1) > WORST_SCALE


def _refuse_a_slip(measurements: Sequence[Measurement], resolution: float) -> None:
    """Raises DesignError naming the one size without which all others agree, if there is one.

    A slip of the pen draws the common fit with it, so that kerf or unit would be blamed.
    """
    if len(measurements) < 3:
        return
    middle = median(m.kerf for m in measurements)
    by_distance = sorted(measurements, key=lambda m: -abs(m.kerf - middle))
    told: list[tuple[float, float, Measurement]] = []
    for suspect in by_distance[:MOST_SUSPECTS]:
        others = [m for m in measurements if m is not suspect]
        if suspect.instrument not in {size.instrument for size in others}:
            continue
        found = _fitted(others, resolution)
        spread = max(map(found.gap, others))
        is_sound = 0 <= found.kerf.value <= LARGEST and not _is_other_unit(found)
        if is_sound and spread <= LARGEST_SLIP < found.gap(suspect):
            told.append((spread, found.gap(suspect), suspect))
    if told:
        _, off, slip = min(told, key=lambda entry: entry[0])
        raise DesignError(
            f"{slip} is {off:.2f} mm off what the other sizes say; mend the entry or measure it "
            "again"
        )


def _fitted(measurements: Sequence[Measurement], resolution: float) -> Estimate:
    """Kerf, offsets and scale by least squares, likely or not; from two sizes or more."""
    import numpy as np

    instruments = sorted({size.instrument for size in measurements})
    count = len(measurements)
    nominal = np.array([size.nominal for size in measurements])
    departure = np.array([size.measured for size in measurements]) - nominal
    columns = np.array([[size.sign] for size in measurements], dtype=float)
    along_x = np.array([size.along_x for size in measurements], dtype=float)[:, None]
    is_read_by = [[size.instrument == name for name in instruments] for size in measurements]
    # The last two are small: a few sizes tell more where they are taken to be none.
    blocks = {
        "offsets": (np.array(is_read_by, dtype=float), 1),
        "scale": (nominal[:, None], 1),
        "kerf along x": (columns * along_x, FREE),
        "scale along x": (nominal[:, None] * along_x, FREE),
    }
    # Where each cause that can be told stands among the columns.
    places: dict[str, int] = {}
    for cause, (block, free) in blocks.items():
        wider = np.hstack([columns, block])
        if count - wider.shape[1] >= free and _are_apart(wider):
            places[cause] = columns.shape[1]
            columns = wider
    values = np.linalg.lstsq(columns, departure, rcond=None)[0]
    degrees = count - columns.shape[1]
    scatter = float(np.sum((departure - columns @ values) ** 2)) / degrees
    spread = np.linalg.inv(columns.T @ columns).diagonal()
    # No reading is better than the instrument, however well a few of them agree.
    noise = max(scatter, resolution**2 / 12)
    errors = np.sqrt(noise * spread).tolist()
    errors[0] = math.hypot(errors[0], _left_by_rounding(scatter, resolution))
    t = student_t(degrees)
    fitted = [Value(v, u, t * u) for v, u in zip(values.tolist(), errors, strict=True)]
    kerf_along_x, scale_along_x = (
        fitted[places[cause]].value if cause in places else 0.0
        for cause in ("kerf along x", "scale along x")
    )
    scale = fitted[places["scale"]] if "scale" in places else None
    return Estimate(
        kerf=fitted[0],
        scale=None if scale is None else scale._replace(value=1 + scale.value),
        offsets=dict(zip(instruments, fitted[1:], strict=False)) if "offsets" in places else {},
        count=count,
        degrees=degrees,
        kerf_along_x=kerf_along_x,
        scale_along_x=scale_along_x,
    )


def _are_apart(columns: NDArray[Any]) -> bool:
    """Whether the sizes tell what the columns stand for from each other."""
    import numpy as np

    unit = columns / np.linalg.norm(columns, axis=0)
    return bool(np.linalg.matrix_rank(unit, tol=SAME_COLUMN) == unit.shape[1])


def _left_by_rounding(scatter: float, resolution: float) -> float:
    """The standard uncertainty that rounding to a step leaves in a mean of readings.

    A mean of Gaussian readings of deviation s, rounded to steps d, is off by up to d / pi *
    exp(-2 (pi s / d)^2) (B. Widrow, I. Kollar, Quantization Noise, 2008): of readings that all
    agree, a step's whole width remains in doubt, and of those that scatter by half a step nothing.
    """
    if resolution == 0:
        return 0.0
    own = max(scatter - resolution**2 / 12, 0.0)
    return resolution / math.sqrt(12) * math.exp(-2 * math.pi**2 * own / resolution**2)


@cache
def student_t(degrees: int) -> float:
    """The t that 95 % of Student's distribution stay within, by its series for whole degrees."""
    degrees = min(degrees, MOST_DEGREES)
    low, high = 1.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _within(middle, degrees) < 0.95 else (low, middle)
    return (low + high) / 2


def _within(t: float, degrees: int) -> float:
    """The share of Student's distribution between -t and t."""
    angle = math.atan(t / math.sqrt(degrees))
    cosine, odd = math.cos(angle), degrees % 2
    term = math.sin(angle) * (cosine if odd else 1.0)
    total = 0.0
    for k in range(1 + odd, degrees, 2):
        total += term
        term *= cosine**2 * k / (k + 1)
    return 2 / math.pi * (angle + total) if odd else total
