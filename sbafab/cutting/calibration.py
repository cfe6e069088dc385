"""The kerf from what was measured on the calibration piece, with its uncertainty.

An outside comes out smaller by the kerf, a window larger. Uncertainties follow the usual guide to
their expression: scatter and the instrument's resolution in quadrature, Student's t for the
interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean, median, stdev
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
MOST_SUSPECTS = 20
"""Sizes that are tried as the one slip, those farthest from the middle one first."""
WIDEST = 0.05
"""mm; half the largest error of laser cutting: a kerf known no better deserves a warning."""

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

    @property
    def kerf(self) -> float:
        """What this size alone says of the kerf."""
        lost = self.nominal - self.measured
        return lost if self.kind == "outer" else -lost

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
    """The kerf in mm from ``count`` sizes.

    ``scale``: measured over nominal size apart from kerf, None where the sizes cannot tell.
    Where it differs from 1, the kerf is the one fitted with it; else the mean.
    """

    kerf: Value
    scale: Value | None
    count: int

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
        scale = self.scale.value if self.is_scaled and self.scale is not None else 1.0
        sign = -1 if size.kind == "outer" else 1
        return abs(size.measured - scale * size.nominal - sign * self.kerf.value)


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


def calibrated(measurements: Sequence[Measurement], resolution: float) -> Calibration:
    """The kerf from two sizes or more; ``resolution`` in mm is the instrument's least step.

    Raises DesignError where there are fewer, where one of them is a slip, or where no beam cuts so.
    """
    _refuse_a_slip(measurements, resolution)
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
    found = _found(measurements, resolution)
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


def _found(measurements: Sequence[Measurement], resolution: float) -> Estimate:
    """Kerf and scale as they come, likely or not."""
    scale, fitted = _fitted(measurements, resolution)
    found = Estimate(_mean(measurements, resolution), scale, len(measurements))
    if found.is_scaled and fitted is not None:
        return Estimate(fitted, scale, len(measurements))
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
        found = _found(others, resolution)
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
