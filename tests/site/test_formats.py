"""What is written and printed for programs is of the schema that its format is published with."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import jsonschema
import pytest

import sbafab
from sbafab.cli import formats, main
from sbafab.cli.formats import schema_of
from sbafab.folders.artefacts import prediction_json
from sbafab.folders.run import RunRequest, generate
from tests.site.formats import hold

ONE = "stack.balloons=1"


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main(arguments)
    return capsys.readouterr().out


@pytest.mark.parametrize("name", formats.FORMATS)
def test_a_schema_is_one_and_has_an_id(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    schema = json.loads(run(["schema", name], capsys))
    assert schema == schema_of(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$id"] == f"urn:{formats.FORMATS[name].identity.replace('/', ':')}"


def test_files_of_a_folder_are_of_their_schemas(tmp_path: Path) -> None:
    design = sbafab.load("1dof-5mm", ONE, "order.copies=2")
    folder = generate(RunRequest(design, tmp_path, ("cut", "press", "mesh"))).folder
    for name in ("manifest", "checks", "press", "laminate"):
        hold(name, json.loads((folder / f"{name}.json").read_text(encoding="utf-8")))
    told = design.model_dump(mode="json", exclude_none=True)
    # That the schema is one is tested above, and takes as long as all else here.
    jsonschema.Draft202012Validator(schema_of("design")).validate(told)


def test_what_is_printed_is_of_its_schema(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    hold("checks", json.loads(run(["check", "1dof-5mm", "--set", ONE, "--json"], capsys)))
    hold("error", json.loads(run(["check", "nosuch", "--json"], capsys)))
    asked = [
        "--max",
        "mass=1",
        "--best",
        "mass",
        "--tries",
        "4",
        "--to",
        str(tmp_path / "found.toml"),
    ]
    hold("find", json.loads(run(["find", "1dof-5mm", *asked, "--json"], capsys)))
    design = sbafab.load("1dof-5mm", ONE)
    hold("predict", prediction_json(design, sbafab.predict(design, quick=True)))


def test_what_is_printed_of_rules_and_templates_is_of_its_schema(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("bond-width", "chamber.diameter", "chamber", "force"):
        hold("explain", json.loads(run(["explain", name, "--json"], capsys)))
    hold("explained", json.loads(run(["explain", "--json"], capsys)))
    jsonschema.validate(json.loads(run(["new", "--json"], capsys)), schema_of("templates"))


def test_what_is_printed_of_a_measured_coupon_is_of_its_schema(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    sizes = [(4.9, 5.1), (9.9, 10.1), (19.9, 20.1)]
    rows = [
        f"{nominal} {kind},{axis},{nominal},{measured}"
        for nominal, pair in zip((5, 10, 20), sizes, strict=True)
        for kind, measured in zip(("outer", "window"), pair, strict=True)
        for axis in "xy"
    ]
    table = tmp_path / "coupon.csv"
    table.write_text("\n".join(["feature,axis,nominal_mm,measured_mm", *rows]))
    found = json.loads(run(["kerf", str(table), "--json"], capsys))
    hold("kerf", found)
    assert found["all"]["kerf"]["value"] == pytest.approx(0.1)


def test_what_is_predicted_of_an_assembly_is_of_its_schema() -> None:
    from sbafab.reports.assembly_prediction import (
        SCHEMA,
        AssemblyFigure,
        AssemblyPrediction,
        BentTouch,
        Touch,
    )

    figure = AssemblyFigure("arm", "height, flat", 1.14, "mm", "elastic stack")
    touch, bent = Touch("arm", "cup", 0.1), BentTouch("arm", "cup", "chamber1", 0.1, 5.0, 80.0)
    found = AssemblyPrediction("one", 10.0, 1.2, (figure,), (touch,), ("x: why",), (bent,), ())
    document = json.loads(json.dumps({"schema": SCHEMA, **asdict(found)}))
    hold("assembly-predict", document)


def test_the_reproduction_is_of_its_schema() -> None:
    from sbafab.validation.comparison import ComparedCurve, ComparedPoint
    from sbafab.validation.evidence import load_evidence
    from sbafab.validation.paper_table import PaperTable, Row, as_json

    row = Row(
        section="one", figure="x", unit="mm", where="Sec. 2", paper=1.0, error=0.1, predicted=1.1,
        model="m", why="w",
    )  # fmt: skip
    table = PaperTable()
    table.__dict__["rows"] = [row, row.model_copy(update={"predicted": None})]
    curve = ComparedCurve.read(
        load_evidence("paper").curves[0],
        source="paper",
        compared=[ComparedPoint.at(1.0, 0.5, 0.1, (0.4, 0.6), (0.3, 0.7))],
        model="m",
        assumptions=["a"],
        no_model="",
    )
    table.__dict__["curves"] = (curve,)
    hold("reproduction", as_json(table))


def test_what_runs_print_is_of_its_schema(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = ["--set", ONE, "-o", str(tmp_path), "--json"]
    hold("run", json.loads(run(["press", "1dof-5mm", *out], capsys)))
    failing = ["press", "1dof-5mm", "--set", "mask.overhang=0.3", "--set", "name=bad", *out]
    hold("run", json.loads(run(failing, capsys)))
    hold("nested", json.loads(run(["nest", "1dof-5mm", *out], capsys)))


def test_a_format_that_says_another_thing_is_told() -> None:
    found = prediction_json(
        design := sbafab.load("1dof-5mm", ONE), sbafab.predict(design, quick=True)
    )
    for change in ({"figures": [{"name": "x"}]}, {"schema": "sbafab/predict@2"}, {"more": 1}):
        with pytest.raises(jsonschema.ValidationError):
            hold("predict", {**found, **change})
