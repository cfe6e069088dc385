"""``predict.json`` and its plots, in the folder of a design."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Prediction
from sbafab.output.contents import write_text
from sbafab.output.manifest import as_json
from sbafab.output.run import ExtraFiles
from sbafab.output.settings import GENERATOR

SCHEMA = "sbafab/predict@1"
FOLDER = "predict"


def prediction_json(design: Design, prediction: Prediction) -> dict[str, Any]:
    """What ``predict.json`` holds; ``plot`` of a relation is its file in the folder."""
    found = prediction.as_dict()
    for relation in found["relations"]:
        relation["plot"] = f"{FOLDER}/{relation['name']}.svg"
    return {
        "schema": SCHEMA,
        "name": design.name,
        "family": design.family,
        "design_sha256": design_sha256(design),
        "generator": GENERATOR,
        **found,
    }


def with_prediction(design: Design, prediction: Prediction) -> ExtraFiles:
    """Writes ``predict.json`` and ``predict/<relation>.svg`` into the folder of a run."""

    def put(_: Laminate, folder: Path) -> None:
        from sbafab.reports.relation_svg import relation_svg

        write_text(folder / "predict.json", as_json(prediction_json(design, prediction)))
        if prediction.relations:
            (folder / FOLDER).mkdir()
        for relation in prediction.relations:
            plot = relation_svg(design.name, relation)
            write_text(folder / FOLDER / f"{relation.name}.svg", plot)

    return put
