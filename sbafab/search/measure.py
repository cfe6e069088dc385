"""One design measured: rules with their margins, predicted figures, and what all its keys are."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from sbafab.actuators import records
from sbafab.design.reading import checked as checked_record
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256, keys_of
from sbafab.errors import SbafabError
from sbafab.models.figures import Asked, Figure
from sbafab.models.prediction import predict
from sbafab.output.checking import check, refuse_undoable
from sbafab.output.planned import Checked
from sbafab.search.margins import margins

SweepOutcome = Literal["passes", "fails", "refused", "crashed", "too long"]
"""Every rule holds; a rule failed; no such design can be made; its process died; or took too long.
"""
SweepRow = dict[str, Any]
"""What is known of one design, in values that JSON has. ``outcome`` and ``reason`` are always
there; ``sha256``, ``keys``, ``rules``, ``figures`` where the design could be measured so far."""


def measured(
    tables: Mapping[str, Any], folder: str, values: Mapping[str, Any], pressures: Sequence[float]
) -> SweepRow:
    """The row of the design that ``tables`` say, with ``values`` set; never raises a SbafabError.

    ``folder`` is where relative paths start, ``pressures`` kPa are those of forces and strokes.
    """
    row: SweepRow = {"outcome": "refused", "reason": ""}
    try:
        design = _base(json.dumps(tables), folder).with_(dict(values))
        row["keys"] = {key: value for key, value, _ in keys_of(design)}
        row["sha256"] = design_sha256(design)
        _measure(design, pressures, row)
    except SbafabError as error:
        row["reason"] = " ".join(str(error).split())
    return row


@lru_cache(maxsize=4)
def _base(tables: str, folder: str) -> Design:
    data = json.loads(tables)
    known = records()
    return checked_record(known[data["family"]], data, known).placed(Path(folder))


def _measure(design: Design, pressures: Sequence[float], row: SweepRow) -> None:
    laminate, findings = check(design)
    found = margins(findings)
    row["rules"] = {
        name: [one.verdict, one.margin, one.measured, one.limit, one.unit]
        for name, one in found.items()
    }
    prediction = predict(design, Asked(tuple(pressures)), laminate)
    row["figures"] = named_figures(prediction.figures)
    one = Checked(design, laminate, findings)
    if one.failed:
        failed = [rule for rule in found.values() if rule.verdict == "fail"]
        row["outcome"] = "fails"
        row["reason"] = " | ".join(f"{rule.rule}: {rule.message}" for rule in failed)
        return
    refuse_undoable([one])
    row["outcome"] = "passes"


def named_figures(figures: Sequence[Figure]) -> dict[str, float]:
    """Values by name and unit; the model is in the name where several give the same figure."""
    count = Counter(figure.name for figure in figures)
    return {
        f"{figure.name}{f', {figure.model.name}' if count[figure.name] > 1 else ''} "
        f"[{figure.unit}]": figure.as_dict()["value"]
        for figure in figures
    }
