"""The kerf from what was measured on the calibration piece, with its uncertainty.

An outside comes out smaller by the kerf, a window larger. Uncertainties follow the usual guide to
their expression: scatter and the instrument's resolution in quadrature, Student's t for the
interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean, stdev
from typing import Literal, NamedTuple

from sbafab.errors import DesignError

MOST_DEGREES = 200
"""Degrees of freedom from which on Student's t is taken as if there were no more."""
LARGEST = 1.0
"""mm; a wider kerf is a mistake in the table."""
WORST_SCALE = 0.1
"""Of measured over nominal sizes: no machine is so far off, another unit is."""
LARGEST_SLIP = 0.25
"""mm; more than twice the largest error of laser cutting (paper, Sec. 2) is a slip of the pen."""

Kind = Literal["outer", "window"]
Axis = Literal["x", "y"]


class Measurement(NamedTuple):
    """A size of the piece, mm."""

    kind: Kind
    axis: Axis
    nominal: float
    measured: float

    @property
    def kerf(self) -> float:
        """What this size alone says of the kerf."""
        lost = self.nominal - self.measured
        return lost if self.kind == "outer" else -lost


class Value(NamedTuple):
    """A value, its standard uncertainty and the half width of its 95 % interval."""

    value: float
    uncertainty: float
    half_width: float

    def differs_from(self, other: float) -> bool:
        return abs(self.value - other) > self.half_width


@dataclass(frozen=True)
class Estimate:
    """The kerf in mm from ``count`` sizes.

    ``scale``: measured over nominal size apart from kerf, None where the sizes cannot tell.
    Where it differs from 1, the kerf is the one fitted with it; else the mean.
    """

    kerf: Value
    scale: Value | None
    count: int

    @property
    def is_scaled(self) -> bool:
        return self.scale is not None and self.scale.differs_from(1.0)


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
        return self.difference is not None and self.difference.differs_from(0.0)


def calibrated(measurements: Sequence[Measurement], resolution: float) -> Calibration:
    """The kerf from two sizes or more; ``resolution`` in mm is the instrument's least step.

    Raises DesignError where there are fewer, or where no beam cuts so.
    """
    overall = _estimate(measurements, resolution)
    along = {axis: [m for m in measurements if m.axis == axis] for axis in ("x", "y")}
    if min(map(len, along.values())) < 2:
        return Calibration(overall, None, None, None)
    x, y = (_estimate(along[axis], resolution, f" along {axis}") for axis in ("x", "y"))
    uncertainty = math.hypot(x.kerf.uncertainty, y.kerf.uncertainty)
    degrees = min(x.count, y.count) - 1
    difference = Value(x.kerf.value - y.kerf.value, uncertainty, student_t(degrees) * uncertainty)
    return Calibration(overall, x, y, difference)


def _estimate(measurements: Sequence[Measurement], resolution: float, where: str = "") -> Estimate:
    if len(measurements) < 2:
        raise DesignError(
            f"sizes measured{where}: {len(measurements)}, and a kerf needs 2; fill in more rows"
        )
    scale, fitted = _fitted(measurements, resolution)
    if scale is not None and abs(scale.value - 1) > WORST_SCALE:
        raise DesignError(
            f"the measured sizes{where} are about {scale.value:.3g} times the nominal ones; give "
            "them in millimetres"
        )
    found = Estimate(_mean(measurements, resolution), scale, len(measurements))
    if found.is_scaled and fitted is not None:
        found = Estimate(fitted, scale, len(measurements))
    if not 0 <= found.kerf.value <= LARGEST:
        kind = "negative" if found.kerf.value < 0 else f"over {LARGEST:g} mm"
        raise DesignError(
            f"the kerf{where} comes out as {found.kerf.value:.3f} mm, which is {kind}; check the "
            "measurements, the unit and which rows are outers and windows"
        )
    _refuse_slips(measurements, found)
    return found


def _refuse_slips(measurements: Sequence[Measurement], found: Estimate) -> None:
    """Raises DesignError for a size that lies far from what the others say."""
    scale = found.scale.value if found.is_scaled and found.scale is not None else 1.0
    signs = {"outer": -1, "window": 1}
    gaps = [m.measured - scale * m.nominal - signs[m.kind] * found.kerf.value for m in measurements]
    worst = max(range(len(gaps)), key=lambda n: abs(gaps[n]))
    if abs(gaps[worst]) > LARGEST_SLIP:
        m = measurements[worst]
        raise DesignError(
            f"the {m.kind} along {m.axis}, nominal {m.nominal:g} and measured {m.measured:g} mm, "
            f"is {abs(gaps[worst]):.2f} mm off what the sizes together say; measure it again"
        )


def _mean(measurements: Sequence[Measurement], resolution: float) -> Value:
    """The mean of what the sizes say one by one."""
    kerfs = [m.kerf for m in measurements]
    count = len(kerfs)
    scatter = stdev(kerfs) / math.sqrt(count)
    uncertainty = math.hypot(scatter, resolution / math.sqrt(12))
    return Value(mean(kerfs), uncertainty, student_t(count - 1) * uncertainty)


def _fitted(
    measurements: Sequence[Measurement], resolution: float
) -> tuple[Value, Value] | tuple[None, None]:
    """Scale and kerf by least squares of measured = scale * nominal -/+ kerf."""
    signs = [-1.0 if m.kind == "outer" else 1.0 for m in measurements]
    sizes = [m.nominal for m in measurements]
    count = len(measurements)
    squares = math.fsum(size * size for size in sizes)
    mixed = math.fsum(size * sign for size, sign in zip(sizes, signs, strict=True))
    determinant = squares * count - mixed * mixed
    if count < 3 or determinant < 1e-9 * squares * count:
        return None, None
    to_size = math.fsum(m.nominal * m.measured for m in measurements)
    to_sign = math.fsum(sign * m.measured for sign, m in zip(signs, measurements, strict=True))
    scale = (count * to_size - mixed * to_sign) / determinant
    kerf = (squares * to_sign - mixed * to_size) / determinant
    rest = math.fsum(
        (m.measured - scale * m.nominal - sign * kerf) ** 2
        for sign, m in zip(signs, measurements, strict=True)
    )
    # No reading is better than the instrument, however well a few of them agree.
    noise = max(rest / (count - 2), resolution**2 / 12)
    t = student_t(count - 2)
    errors = math.sqrt(noise * count / determinant), math.sqrt(noise * squares / determinant)
    common = math.hypot(errors[1], resolution / math.sqrt(12))
    return Value(scale, errors[0], t * errors[0]), Value(kerf, common, t * common)


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
