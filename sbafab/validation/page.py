"""The page of all rows, and the charts with the paper's error bars."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sbafab.documents import Document, PlainNumber, Short, attribute
from sbafab.errors import OutputError
from sbafab.models.figures import Prediction, Relation
from sbafab.reports.charts import relation_svg
from sbafab.validation import paper_calibrated, rows
from sbafab.validation.paper_calibrated import CalibratedDocument, CalibratedPaper
from sbafab.validation.rows import Row, predicted, table

HEAD = """# The paper's figures beside the predictions

Written by `sbafab reproduce`. But for the section "Calibrated on the paper" no constant of a model
is fitted: films are as drawn and bought, as with `--set models.calibration=none`. Where a number is
itself a measurement of the paper (handling time, full height), the row says so. The residual is
prediction minus paper; in parentheses, how many of the paper's own errors that is, where it gives
one. A reason that we have not tested says "likely". Models and their ranges are in
[prediction.md](prediction.md), the paper's inputs (films, widths, temperatures, errors of cutting
and pins) in [paper.md](paper.md).

Forces of Eqs. 1-4 count their stroke from nothing, as the paper does; those of the elastic stack
count it from the flat height, so that flat and full height mean the same for force and bending.
"""

FACTORS = """## What single factors would take

What the paper's own figures would make of one factor on a model without a calibration: on the
force it is another one at every height and for every actuator.

| factor | from | value |
|---|---|---|
"""


def tables(single: Prediction, three: Prediction) -> dict[str, list[Row]]:
    """All rows of the models without a calibration, by section."""
    return {
        "Making": list(rows.process()),
        "Sizes": list(rows.sizes(three)),
        "Stroke and volume": [*rows.strokes(), *rows.fuller()],
        "Energy": list(rows.energy()),
        "Force": list(rows.forces(single, three)),
        "Time and bending": list(rows.motion(three)),
        "Stiffness and power": list(rows.stiffness(single, three)),
        "Figures of the paper's own simulations": list(rows.simulators()),
    }


def page() -> str:
    """The text of the page."""
    single, three = predicted("1dof-5mm"), predicted("3dof-15mm")
    return page_of(tables(single, three), paper_calibrated.calibrated_paper(), single, three)


def page_of(
    sections: dict[str, list[Row]],
    by_calibration: CalibratedPaper,
    single: Prediction,
    three: Prediction,
) -> str:
    """Return the page of rows that are computed already."""
    parts = [HEAD, *paper_calibrated.lines(by_calibration)]
    for title, lines in sections.items():
        parts += table(title, lines)
    return "\n".join([*parts, FACTORS + "\n".join(rows.factors(single, three)), ""])


def charts(single: Prediction, three: Prediction) -> list[tuple[str, Relation]]:
    """Return the charts of the paper's figures: name of the file, and relation."""
    ten = predicted("1dof-10mm")
    figures = (
        ("figure-7a-stroke-d10", ten, "stroke"),
        ("figure-7b-stroke-d5", single, "stroke"),
        ("figure-8a-force-1dof", single, "force"),
        ("figure-8a-force-3dof", three, "force"),
        ("figure-9a-bending", three, "bending"),
        ("figure-9-bend-by-pressure", three, "bend"),
        ("figure-9b-workspace", three, "workspace"),
    )
    return [
        (file, relation)
        for file, prediction, name in figures
        for relation in prediction.relations
        if relation.name == name
    ]


# The reproduction as files: page, table for programs, charts.


def reproduce(folder: Path) -> tuple[dict[str, list[Row]], CalibratedPaper]:
    """All rows, as ``reproduction.md`` and ``reproduction.json`` with charts in a folder, and the
    values beside the calibrated models.

    Raises OutputError if the folder cannot be written.
    """
    single, three = predicted("1dof-5mm"), predicted("3dof-15mm")
    sections, by_calibration = tables(single, three), paper_calibrated.calibrated_paper()
    files = {
        "reproduction.md": page_of(sections, by_calibration, single, three),
        "reproduction.json": json.dumps(as_json(sections, by_calibration), indent=1) + "\n",
    }
    for name, relation in charts(single, three):
        files[f"{name}.svg"] = relation_svg(name, relation)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}") from None
    return sections, by_calibration


class RowDocument(Document):
    """A figure of the paper beside the prediction."""

    section: str
    figure: str
    unit: str = attribute("measured.unit")
    where: str = attribute("measured.where")
    paper: PlainNumber | None
    error: PlainNumber | None
    predicted: Short | None
    model: str
    why: str


class ReproductionDocument(Document, schema="sbafab/reproduction@1"):
    """The contents of ``reproduction.json``."""

    rows: list[RowDocument]
    calibrated: CalibratedDocument
    folder: str = ""


def as_json(sections: dict[str, list[Row]], by_calibration: CalibratedPaper) -> dict[str, Any]:
    """Return the contents of ``reproduction.json``."""
    rows = [RowDocument.read(row, section=name) for name, rows in sections.items() for row in rows]
    return ReproductionDocument.of(None, rows=rows, calibrated=by_calibration)
