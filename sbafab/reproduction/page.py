"""The page of all rows, and the charts with the paper's error bars."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sbafab.errors import OutputError
from sbafab.models.figures import Prediction, Relation
from sbafab.output.schema_ids import REPRODUCTION_SCHEMA
from sbafab.reports.charts import relation_svg
from sbafab.reproduction import rows
from sbafab.reproduction.rows import Row, predicted, table

HEAD = """# The paper's figures beside the predictions

Written by `sbafab reproduce`. But for the section "Calibrated on the 1-DoF" no constant of a model
is fitted. Where a number is itself a measurement of the paper (handling time, full height), the row
says so. The residual is prediction minus paper; in parentheses, how many of the paper's own errors
that is, where it gives one. A reason that we have not tested says "likely". Models and their
ranges are in
[prediction.md](prediction.md), the paper's inputs (films, widths, temperatures, errors of cutting
and pins) in [paper.md](paper.md).

Forces of Eqs. 1-4 count their stroke from nothing, as the paper does; those of the elastic stack
count it from the flat height, so that flat and full height mean the same for force and bending.
"""

CALIBRATED = """The models are given two numbers. The pocket's radius is taken {loss:g} mm smaller
than drawn, which makes the force of the flat 1-DoF actuator right: that row is *fitted*, all
others are *held out*. And the laminate is as thick as the paper measured it when flat, {press:g}
of its films (the row of the deflated 3-DoF above): 0.95 mm, from which strokes and the height
count. The modulus stays the paper's 10 MPa. Flat is the state to fit: neither the film's modulus
nor a column that buckles has a part in it. Molten TPE that creeps under the mask is the likely
cause of the loss. `sbafab predict 3dof-15mm --pocket-loss {loss:g} --press-factor {press:g}` gives
the same forces and bends.

Of the held-out rows 10 % in force, 5 % in height, 6 degrees in bend and 0.08 s in the water's time
were aimed at.

* **Met:** {met}.
* **Missed:** {missed}.

The time has no tubes in it, where the rows above need 150 mm of them: pockets as drawn with such
tubes, and smaller pockets with the sensor at the actuator, both give the measured time. The forces
speak for the smaller ones.
"""

FACTORS = """## What a calibration would take

`sbafab predict` has factors, all off unless given. The table says what the paper's own figures
would make of them. None is a default: the factor on the force is another one at every height and
for every actuator, so that one number would only move the residuals about.

| factor | from | value |
|---|---|---|
"""


def tables(single: Prediction, three: Prediction) -> dict[str, list[Row]]:
    """All rows, by section."""
    return {
        "Making": list(rows.process()),
        "Sizes": list(rows.sizes(three)),
        "Stroke and volume": [*rows.strokes(), *rows.fuller()],
        "Energy": list(rows.energy()),
        "Force": list(rows.forces(single, three)),
        "Time and bending": list(rows.motion(three)),
        "Stiffness and power": list(rows.stiffness(single, three)),
        "Calibrated on the 1-DoF": list(rows.calibrated()),
        "Figures of the paper's own simulations": list(rows.simulators()),
    }


def page() -> str:
    """The text of the page."""
    single, three = predicted("1dof-5mm"), predicted("3dof-15mm")
    return page_of(tables(single, three), single, three)


def page_of(sections: dict[str, list[Row]], single: Prediction, three: Prediction) -> str:
    """Return the page of rows that are computed already."""
    parts = [HEAD]
    for title, lines in sections.items():
        first, *lines_below = table(title, lines)
        parts.append(first)
        if title.startswith("Calibrated"):
            parts.append(calibrated_said(lines))
        parts += lines_below
    return "\n".join([*parts, FACTORS + "\n".join(rows.factors(single, three)), ""])


def calibrated_said(lines: Sequence[Row]) -> str:
    """Return the fitted values, and which of the held-out rows are as near as aimed at."""
    factors = rows.FITTED
    names: dict[bool, list[str]] = {True: [], False: []}
    for row in lines:
        name, _, role = row.figure.rpartition(" (")
        if rows.HELD_OUT in role and row.predicted is not None:
            assumed = row.model.split(" in ")[-1] if row.measured.unit == "deg" else ""
            miss = abs(row.predicted - row.measured.value)
            is_met = miss <= rows.aim(row.measured)
            names[is_met].append(f"{name} ({assumed})" if assumed else name)
    met, missed = ("; ".join(names[kind]) or "none" for kind in (True, False))
    return CALIBRATED.format(
        loss=factors.pocket_loss, press=factors.press_factor, met=met, missed=missed
    )


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


def reproduce(folder: Path) -> dict[str, list[Row]]:
    """All rows, as ``reproduction.md`` and ``reproduction.json`` with charts in a folder.

    Raises OutputError where the folder cannot be written.
    """
    single, three = predicted("1dof-5mm"), predicted("3dof-15mm")
    sections = tables(single, three)
    files = {
        "reproduction.md": page_of(sections, single, three),
        "reproduction.json": json.dumps(as_json(sections), indent=1) + "\n",
    }
    for name, relation in charts(single, three):
        files[f"{name}.svg"] = relation_svg(name, relation)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}") from None
    return sections


def as_json(sections: dict[str, list[Row]]) -> dict[str, Any]:
    """Return the contents of ``reproduction.json``."""
    return {
        "schema": REPRODUCTION_SCHEMA,
        "rows": [
            {
                "section": section,
                "figure": row.figure,
                "unit": row.measured.unit,
                "where": row.measured.where,
                "paper": row.measured.value if row.measured.unit else None,
                "error": row.measured.error or None,
                "predicted": None if row.predicted is None else float(f"{row.predicted:.7g}"),
                "model": row.model,
                "why": row.why,
            }
            for section, rows in sections.items()
            for row in rows
        ],
    }
