"""The paper's values beside the calibrated models, with their 90 % intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from sbafab.documents import Document, attribute
from sbafab.models.calibrated import ModelCalibration, load_calibration
from sbafab.models.unknowns import UNKNOWNS
from sbafab.validation.comparison import (
    ComparedCurve,
    ComparedPoint,
    CurveDocument,
    compare_calibrated,
    span,
)
from sbafab.validation.files import load_evidence
from sbafab.validation.records import MeasuredCurve

PAPER = "paper"
"""Name of the calibration, and of the evidence, whose values stand side by side."""
TITLE = "Calibrated on the paper"
COLUMNS = ("figure", "paper", "where", "calibrated", "90 % interval", "inside", "left open")
NOT_ADOPTED = (
    "Tried and not adopted, for they do not explain the misses (docs/measured/candidates.csv): a "
    "film that stiffens with stretch, a column that buckles or slides under its load, and a loss "
    "of flow in the supply. Pockets of each actuator's own would: two actuators are too few to fit "
    "their scatter."
)


class CalibratedPaper(NamedTuple):
    """The shipped calibration, and the paper's curves that it covers."""

    calibration: ModelCalibration
    curves: tuple[ComparedCurve, ...]

    @property
    def points(self) -> list[ComparedPoint]:
        """The points that have an interval."""
        return [
            point for curve in self.curves for point in curve.points if point.is_within is not None
        ]

    @property
    def summary(self) -> str:
        """The number of values that lie in their intervals."""
        inside = sum(point.is_within is True for point in self.points)
        return f"{inside} of {len(self.points)} in the 90 % intervals of the calibration"


def calibrated_paper() -> CalibratedPaper:
    """Return the paper's comparable curves beside the models calibrated on them."""
    calibration = load_calibration(PAPER)
    assert calibration is not None, "it ships"
    curves = compare_calibrated(load_evidence(PAPER), calibration)
    return CalibratedPaper(
        calibration,
        tuple(
            compared
            for compared in curves
            if compared.curve.comparable
            and any(point.interval is not None for point in compared.points)
        ),
    )


def rows(paper: CalibratedPaper) -> Iterator[list[str]]:
    """Yield the cells of a value of the paper, by COLUMNS."""
    for compared in paper.curves:
        for point in compared.points:
            unit = compared.curve.y_unit
            yield [
                _figure(compared.curve, point),
                f"{_number(point)} {unit}".rstrip(),
                compared.curve.place,
                f"{span(point.model)} {unit}".rstrip(),
                span(point.interval, digits=3),
                {True: "yes", False: "no", None: "-"}[point.is_within],
                "; ".join(compared.assumptions),
            ]


def _figure(curve: MeasuredCurve, point: ComparedPoint) -> str:
    name = f"{curve.y_name} ({curve.id})"
    if point.x is None:
        return name
    axis = curve.x_name.removesuffix(f"_{curve.x_unit.lower()}").replace("_", " ")
    return f"{name}, {axis} {point.x:g} {curve.x_unit}".rstrip()


def _number(point: ComparedPoint) -> str:
    return f"{point.measured:g}" + (f" +- {point.error:.2g}" if point.error else "")


def lines(paper: CalibratedPaper) -> Iterator[str]:
    """Yield the section of the page: the fit and how well it holds, then the table."""
    yield f"## {TITLE}\n"
    yield from sentences(paper)
    yield ""
    yield "| " + " | ".join(COLUMNS) + " |"
    yield "|" + "---|" * len(COLUMNS)
    for cells in rows(paper):
        yield "| " + " | ".join(cells) + " |"
    yield ""


def sentences(paper: CalibratedPaper) -> Iterator[str]:
    """Yield sentences on a calibration: its data, its values, and the uncertainty that remains."""
    calibration = paper.calibration
    yield (
        f"The calibration `{calibration.name}`, the default of predictions, is fitted to the "
        "values of this table by\n`sbafab calibrate paper`, so that the table is no test of it. "
        "The test: with one experiment left out\nafter the other, "
        f"{calibration.inside} of {calibration.points} values lay in the 90 % intervals "
        "that the others gave.\nModel and interval span what the paper leaves open; an interval "
        "counts the uncertainty of the\ncalibration, what the models miss, and the error of the "
        "measurement.\n"
    )
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        yield (
            f"* {unknown.title}: {unknown.shown(calibration.values[unknown.field])} "
            f"({low:.3g} to {high:.3g}); prior about {unknown.shown(unknown.middle)}: "
            f"{unknown.source}"
        )
    missed = ", ".join(
        f"{group} {100 * spread:.0f} %" for group, spread in calibration.discrepancy.items()
    )
    apart = "; ".join(calibration.sentences) or "nothing"
    yield f"\nThe evidence cannot tell apart: {apart}."
    yield f"What the models miss beyond that, one standard deviation: {missed}."
    yield NOT_ADOPTED


class HeldOut(Document):
    """Measured values that the calibration was not fitted to, and how many lay in its intervals."""

    points: int
    inside: int


class CalibratedDocument(Document):
    """The section for programs."""

    calibration: str = attribute("calibration.name")
    held_out: HeldOut = attribute("calibration")
    discrepancy: dict[str, float] = attribute("calibration.discrepancy")
    """relative standard deviation that the models miss, by group"""
    curves: list[CurveDocument]
