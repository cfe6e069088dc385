"""Repeatability and reproducibility of a measurement: crossed analysis of variance.

Parts, operators and their interaction are random effects (AIAG, Measurement Systems Analysis; NIST
e-Handbook 2.4). An interaction with p above 0.25 is pooled with the repeatability.
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.cutting.calibration import table_text
from sbafab.errors import DesignError
from sbafab.results.control_charts import statistics

COLUMNS = ("part", "operator", "trial", "reading")
POOLED = 0.25
"""p above which an interaction is pooled."""
CATEGORIES = math.sqrt(2)
"""Times the parts' over the gauge's deviation: categories that the gauge tells apart."""


class GaugeReading(NamedTuple):
    part: str
    operator: str
    reading: float


class VarianceRow(NamedTuple):
    """A line of the analysis of variance; the error has no F and no p."""

    source: str
    degrees: int
    sum_of_squares: float
    mean_square: float
    f: float | None
    p: float | None


@dataclass(frozen=True)
class GaugeStudy:
    """The analysis of variance and what comes of it: standard deviations in the reading's unit.

    ``gauge`` is repeatability and reproducibility together, ``share`` of the total deviation, and
    ``of_tolerance`` six of its deviations over the width of the limits. Below 10 % a gauge is
    good, above 30 % it is not (AIAG).
    """

    rows: tuple[VarianceRow, ...]
    is_pooled: bool
    repeatability: float
    operators: float
    interaction: float
    gauge: float
    parts: float
    total: float
    of_tolerance: float | None

    @property
    def share(self) -> float:
        return self.gauge / self.total if self.total else 0.0

    @property
    def categories(self) -> int:
        """Classes of parts that the gauge tells apart."""
        return int(CATEGORIES * self.parts / self.gauge) if self.gauge else 0

    @property
    def verdict(self) -> str:
        worst = max(self.share, self.of_tolerance or 0.0)
        return "good" if worst < 0.1 else "marginal" if worst <= 0.3 else "not good enough"

    def as_dict(self) -> dict[str, Any]:
        names = ("repeatability", "operators", "interaction", "gauge", "parts", "total", "share")
        return {
            "anova": [row._asdict() for row in self.rows],
            "pooled": self.is_pooled,
            **{name: getattr(self, name) for name in names},
            "of_tolerance": self.of_tolerance,
            "categories": self.categories,
            "verdict": self.verdict,
        }


def read_readings(path: Path) -> list[GaugeReading]:
    """Return the readings of a CSV with the columns of COLUMNS. Raises DesignError."""
    lines = table_text(path).splitlines()
    separator = max(",;\t", key=lines[0].count) if lines else ","
    rows = list(csv.DictReader(lines, delimiter=separator))
    names = {name.strip().lower(): name for name in (rows[0] if rows else {}) if name}
    if not set(COLUMNS) <= set(names):
        raise DesignError(f"{path} needs the columns {', '.join(COLUMNS)}, a reading a row")
    readings = []
    for number, row in enumerate(rows, start=2):
        part, operator, _, text = ((row[names[name]] or "").strip() for name in COLUMNS)
        try:
            value = float(text.replace(",", "."))
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not part or not operator:
            raise DesignError(
                f"{path}, line {number}: part {part[:20]!r}, operator {operator[:20]!r}, reading "
                f"{text[:20]!r}; fill in all three, the reading as a number"
            )
        readings.append(GaugeReading(part, operator, value))
    return readings


def gauge_study(readings: Sequence[GaugeReading], width: float | None = None) -> GaugeStudy:
    """Return the study of readings, as many of each part by each operator, in the same unit.

    ``width`` between the limits is in that unit. Raises DesignError.
    """
    import numpy as np

    cells: dict[tuple[str, str], list[float]] = defaultdict(list)
    for reading in readings:
        cells[reading.part, reading.operator].append(reading.reading)
    parts = list(dict.fromkeys(reading.part for reading in readings))
    operators = list(dict.fromkeys(reading.operator for reading in readings))
    trials = _trials(cells, parts, operators)
    table = np.array([[cells[part, operator] for operator in operators] for part in parts])
    p, o = len(parts), len(operators)
    mean = table.mean()
    by_cell = table.mean(axis=2)
    squares = {
        "parts": o * trials * ((table.mean(axis=(1, 2)) - mean) ** 2).sum(),
        "operators": p * trials * ((table.mean(axis=(0, 2)) - mean) ** 2).sum(),
        "error": ((table - by_cell[:, :, None]) ** 2).sum(),
    }
    within_cells = trials * ((by_cell - mean) ** 2).sum()
    squares["interaction"] = max(0.0, within_cells - squares["parts"] - squares["operators"])
    degrees = {
        "parts": p - 1,
        "operators": o - 1,
        "interaction": (p - 1) * (o - 1),
        "error": p * o * (trials - 1),
    }
    return _study(_Sums(squares, degrees), (p, o, trials), width)


def _trials(
    cells: Mapping[tuple[str, str], Sequence[float]],
    parts: Sequence[str],
    operators: Sequence[str],
) -> int:
    """Return how often each operator read each part. Raises DesignError for another number."""
    if len(parts) < 2 or len(operators) < 2:
        raise DesignError("a gauge study needs two parts and two operators or more")
    trials = len(cells[parts[0], operators[0]])
    for part in parts:
        for operator in operators:
            count = len(cells.get((part, operator), ()))
            if count != trials or count < 2:
                raise DesignError(
                    f"part {part} has {count} readings by {operator}; each operator reads each "
                    f"part {max(trials, 2)} times"
                )
    return trials


class _Sums(NamedTuple):
    squares: Mapping[str, float]
    degrees: Mapping[str, int]

    def mean(self, source: str) -> float:
        return float(self.squares[source]) / self.degrees[source]

    def row(self, source: str, against: str) -> VarianceRow:
        mean = self.mean(source)
        f = p = None
        if source != against and self.mean(against) > 0:
            f = mean / self.mean(against)
            ways = self.degrees[source], self.degrees[against]
            p = float(statistics().f.sf(f, *ways))
        return VarianceRow(source, self.degrees[source], float(self.squares[source]), mean, f, p)


def _study(sums: _Sums, sizes: tuple[int, int, int], width: float | None) -> GaugeStudy:
    parts, operators, trials = sizes
    interaction = sums.row("interaction", "error")
    is_pooled = interaction.p is not None and interaction.p > POOLED
    error = sums.mean("error")
    between = sums.mean("interaction")
    if is_pooled:
        names = ("interaction", "error")
        error = between = sum(sums.squares[n] for n in names) / sum(sums.degrees[n] for n in names)
    crossed = max(0.0, (between - error) / trials)
    by_operator = max(0.0, (sums.mean("operators") - between) / (parts * trials))
    by_part = max(0.0, (sums.mean("parts") - between) / (operators * trials))
    gauge = error + crossed + by_operator
    return GaugeStudy(
        (
            sums.row("parts", "interaction"),
            sums.row("operators", "interaction"),
            interaction,
            sums.row("error", "error"),
        ),
        is_pooled,
        repeatability=math.sqrt(error),
        operators=math.sqrt(by_operator),
        interaction=math.sqrt(crossed),
        gauge=math.sqrt(gauge),
        parts=math.sqrt(by_part),
        total=math.sqrt(gauge + by_part),
        of_tolerance=None if width is None else 6 * math.sqrt(gauge) / width,
    )
