"""The paper's figures compared with the predictions: each row of ``paper_table.csv`` with the
model's value, the values that the calibration covers, and both as a page with charts.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sbafab.actuators import build, load_design
from sbafab.documents import Document, PlainNumber, Short, attribute
from sbafab.errors import OutputError
from sbafab.markup import environment
from sbafab.models import paper
from sbafab.models.balloons import balloons_of
from sbafab.models.calibration import PAPER, UNKNOWNS, HeldOut, ModelCalibration, load_calibration
from sbafab.models.closed_forms import eq_4, eqs_1_to_3, modulus
from sbafab.models.elastic import air_time, pose_bent_by, time_to_fill
from sbafab.models.figures import Factors, Prediction, PredictionRequest
from sbafab.models.pneumatics import AIR, Line, seconds
from sbafab.models.prediction import predict
from sbafab.models.quantity import FigureKey
from sbafab.models.rim_correction import free_shapes
from sbafab.models.stack import Stack, stack
from sbafab.pressing.schedule import schedule
from sbafab.reports.charts import relation_svg
from sbafab.validation.comparison import (
    ComparedCurve,
    compare,
)
from sbafab.validation.evidence import AXES, QUANTITIES, load_evidence

TITLE = "Calibrated on the paper"
COLUMNS = ("figure", "paper", "", "predicted", "residual", "model", "why they part")
CALIBRATED_COLUMNS = (
    *("figure", "paper", "where", "calibrated", "90 % interval", "inside", "left open"),
)
FOLDER = Path(__file__).parent
LENGTHS = (50.0, 100.0, 150.0)
"""Lengths of tube in mm for which the water's time is shown."""
CHARTS = {
    "figure-7a-stroke-d10": ("1dof-10mm", "stroke"),
    "figure-7b-stroke-d5": ("1dof-5mm", "stroke"),
    "figure-8a-force-1dof": ("1dof-5mm", "force"),
    "figure-8a-force-3dof": ("3dof-15mm", "force"),
    "figure-9a-bending": ("3dof-15mm", "bending"),
    "figure-9-bend-by-pressure": ("3dof-15mm", "bend"),
    "figure-9b-workspace": ("3dof-15mm", "workspace"),
}
"""Template and relation by the name of a chart's file."""


class Row(Document):
    """A figure of the paper with its prediction."""

    section: str
    figure: str
    unit: str
    where: str
    paper: PlainNumber | None
    error: PlainNumber | None
    predicted: Short | None
    model: str
    why: str

    @property
    def measured_text(self) -> str:
        """The paper's value with error and unit; empty for a word."""
        if self.paper is None:
            return ""
        return str(paper.Measured(self.paper, self.error or 0.0, self.unit, self.where))

    @property
    def predicted_text(self) -> str:
        """The prediction with its unit; empty without one."""
        return "" if self.predicted is None else f"{self.predicted:.4g} {self.unit}"

    @property
    def residual_text(self) -> str:
        """Prediction minus paper, absolute, relative, and in the paper's errors."""
        if self.predicted is None or self.paper is None:
            return ""
        apart = self.predicted - self.paper
        share = f"{apart:+.3g}, {apart / self.paper:+.1%}"
        return share + (f" ({abs(apart) / self.error:.1f} errors)" if self.error else "")

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of the page's table, by COLUMNS."""
        predicted, residual = self.predicted_text or "not", self.residual_text
        texts = self.figure, self.measured_text, self.where, predicted, residual
        return *texts, self.model, self.why


def predicted(
    template: str, factors: Factors | None = None, pressures: tuple[float, ...] = (10.0, 100.0)
) -> Prediction:
    """Return the prediction of a template, by default without a calibration."""
    request = PredictionRequest(pressures, calibration=factors or Factors())
    return predict(load_design(template), request)


@dataclass(frozen=True)
class PaperTable:
    """The paper's figures beside the models, computed on demand."""

    @cached_property
    def predictions(self) -> Mapping[str, Prediction]:
        """The predictions without a calibration, by template."""
        templates = ("1dof-5mm", "3dof-15mm", "radial-15mm")
        large = predicted("1dof-10mm", pressures=(1.0, 10.0))
        return {"1dof-10mm": large, **{template: predicted(template) for template in templates}}

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All rows, in order."""
        values = _computed(self.predictions)
        with (FOLDER / "paper_table.csv").open(encoding="utf-8", newline="") as opened:
            return tuple(self._row(cells, values) for cells in csv.DictReader(opened))

    def _row(self, cells: Mapping[str, str], values: Mapping[str, float]) -> Row:
        template, _, key = cells["source"].partition(" ")
        figure = values[template] if template and not key else None
        if key:
            at = FigureKey.read(key)
            prediction = self.predictions[template]
            figure = prediction.value(at.quantity.key, at.model, **at.at.as_dict())
        return Row(
            **{name: cells[name] for name in ("section", "figure", "unit", "where", "model")},
            # A figure without a unit is a word.
            paper=float(cells["value"]) if cells["unit"] else None,
            error=float(cells["error"]) if cells["error"] else None,
            predicted=figure,
            why=cells["why"].format_map(values),
        )

    @property
    def sections(self) -> dict[str, list[Row]]:
        """The rows by section."""
        sections: dict[str, list[Row]] = {}
        for row in self.rows:
            sections.setdefault(row.section, []).append(row)
        return sections

    @cached_property
    def calibration(self) -> ModelCalibration:
        """The bundled calibration."""
        calibration = load_calibration(PAPER)
        assert calibration is not None, "it ships"
        return calibration

    @cached_property
    def curves(self) -> tuple[ComparedCurve, ...]:
        """The paper's comparable curves that the calibration covers, compared with the models
        calibrated on them.
        """
        return tuple(
            compared
            for compared in compare(load_evidence(PAPER), self.calibration)
            if compared.comparable and any(point.interval for point in compared.points)
        )

    @property
    def summary(self) -> str:
        """The number of values inside their intervals."""
        within = [p.within for curve in self.curves for p in curve.points if p.interval]
        return f"{sum(map(bool, within))} of {len(within)} in the 90 % intervals of the calibration"

    def page(self) -> str:
        """Return the text of the page."""
        template = (
            environment(FOLDER).overlay(autoescape=False).get_template("paper_table.md.jinja")
        )
        sections = {name: [row.cells for row in rows] for name, rows in self.sections.items()}
        return template.render(
            title=TITLE,
            calibration=self.calibration,
            unknowns=UNKNOWNS,
            calibrated_columns=CALIBRATED_COLUMNS,
            calibrated_rows=[*_calibrated_rows(self.curves)],
            columns=COLUMNS,
            sections=sections,
            table=_markdown,
        )

    def write(self, folder: Path) -> None:
        """Write ``reproduction.md``, ``reproduction.json`` and charts into a folder.

        Raises OutputError if it cannot be written.
        """
        files = {
            "reproduction.md": self.page(),
            "reproduction.json": json.dumps(as_json(self), indent=1) + "\n",
        }
        for name, (template, relation) in CHARTS.items():
            chart = self.predictions[template].relation(relation)
            files[f"{name}.svg"] = relation_svg(name, chart)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for file, text in files.items():
                (folder / file).write_text(text, encoding="utf-8", newline="\n")
        except OSError as error:
            raise OutputError(f"{folder} cannot be written: {error.strerror}") from None


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = "|" + "---|" * len(columns)
    lines = ("| " + " | ".join(cells) + " |" for cells in rows)
    return "\n".join(["| " + " | ".join(columns).replace("|  |", "| |") + " |", rule, *lines])


def _calibrated_rows(curves: Sequence[ComparedCurve]) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each value of the paper, by CALIBRATED_COLUMNS."""
    for curve in curves:
        title, axis = QUANTITIES[curve.quantity].title, AXES[curve.x_name]
        x_name = curve.x_name.removesuffix(f"_{axis.lower()}").replace("_", " ")
        for point in curve.points:
            at = "" if point.x is None else f", {x_name} {point.x:g} {axis}".rstrip()
            measured, model, _, interval, inside = point.texts(curve.unit)
            figure, open_set_ups = f"{title} ({curve.curve}){at}", "; ".join(curve.assumptions)
            yield figure, measured, curve.place, model, interval, inside, open_set_ups


# Values that are no figures of a prediction.


def _computed(predictions: Mapping[str, Prediction]) -> dict[str, float]:
    """Return the values of rows, and reasons, that are not figures of a prediction, by name."""
    three, ten = predictions["3dof-15mm"], predictions["1dof-10mm"]
    design = load_design("3dof-15mm")
    plan = schedule(build(design), design.completed())
    assert plan.estimated_build_minutes is not None, "the paper states minutes for its film"
    half, wide = eqs_1_to_3(2.5), paper.VALID_RADIUS
    pressed = predicted("3dof-15mm", Factors(press_factor()))
    values = {
        "build_hours": plan.estimated_build_minutes / 60,
        "press_minutes": float(plan.total_press_minutes or 0),
        "pressed_diameter": pressed.value("folded_diameter"),
        "half_height": half.largest_stroke / 2,
        "balloon_height": half.largest_stroke,
        "halves_height": paper.BALLOONS * half.largest_stroke / 2,
        "balloon_volume": half.largest_volume,
        "watts": three.value("power_density", kpa=100),
        "air_squeezed": float(seconds(three.value("total_volume"), paper.AIR_FLOW, paper.FULL_KPA)),
    }
    large = load_design("1dof-10mm")
    (balloon,) = set(balloons_of(large, build(large), Factors()))
    shapes = free_shapes(balloon, np.geomspace(0.01, 20.0, 60))
    for _, volume, _ in paper.VALID:
        values |= {
            f"eq_4_{volume:g}": float(eq_4(wide).stroke(volume)),
            f"eqs_{volume:g}": float(eqs_1_to_3(wide).stroke(volume)),
            f"stroke_{volume:g}": float(np.interp(volume, shapes.volume, shapes.height)),
        }
    for kpa in (1, 10):
        values[f"held_{kpa}"] = ten.value("balloon_volume", kpa=kpa)
    for template in ("1dof-5mm", "3dof-15mm"):
        prediction, name = predictions[template], template.partition("-")[0]
        tip, height = (
            prediction.value("shut_stiffness", kpa=10),
            prediction.value("free_height", kpa=10),
        )
        values[f"modulus_{name}"] = modulus(tip, 1.0, height, prediction.value("second_moment"))
    return values | dict(_of_stack(stack(design)))


def _of_stack(whole: Stack) -> Iterator[tuple[str, float]]:
    """Yield heights and times of the elastic stack of the paper's 3-DoF."""
    for length in LENGTHS:
        time, pose = time_to_fill(whole, paper.WATER_FLOW, paper.FULL_KPA, length)
        yield f"water_{length:g}", time
        yield f"chambers_{length:g}", pose.pressures[0]
    yield "air_stack", air_time(whole, paper.AIR_FLOW, paper.FULL_KPA, Line(AIR))

    def height(kpa: float) -> float:
        return whole.pose((kpa,) * whole.chambers).height

    yield "full_height", height(paper.FULL_KPA)
    low, high = 0.0, whole.most_pressure
    for _ in range(40):
        middle = (low + high) / 2
        is_low = height(middle) < paper.FULL_HEIGHT.value
        low, high = (middle, high) if is_low else (low, middle)
    yield "kpa_at_height", high
    empty = whole.pose((0.0,) * whole.chambers).volumes[0]
    for _, angle in paper.BENDING:
        pose_at = pose_bent_by(whole, 1, angle.value)
        assert pose_at is not None
        put_in = float(pose_at.volumes[0] - empty)
        yield f"bend_{angle.value:g}", put_in / (paper.WATER_FLOW * 1000 / 60)


def press_factor() -> float:
    """Return pressed over nominal film thickness of the 3-DoF, assuming that masks keep theirs."""
    folded = Factors().folded(build(load_design("3dof-15mm")))
    return (paper.FLAT_HEIGHT.value - folded.solid) / folded.molten


# The documents.


class CalibratedDocument(Document):
    """The section of calibrated models for programs."""

    calibration: str = attribute("calibration.name")
    held_out: HeldOut = attribute("calibration.held_out")
    discrepancy: dict[str, float] = attribute("calibration.discrepancy")
    """relative standard deviation that the models miss, by group"""
    curves: list[ComparedCurve]


class ReproductionDocument(Document, schema="sbafab/reproduction@1"):
    """The contents of ``reproduction.json``."""

    rows: list[Row]
    calibrated: CalibratedDocument
    folder: str = ""


def as_json(table: PaperTable, **more: str) -> dict[str, Any]:
    """Return the contents of ``reproduction.json``, with ``more``."""
    return ReproductionDocument.of(None, rows=table.rows, calibrated=table, **more)
