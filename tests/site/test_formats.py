"""What is written and printed for programs is of the schema that its format is published with."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

import sbafab
from sbafab.cli import main
from sbafab.cli.schema import FORMATS
from sbafab.output.predicting import prediction_json
from sbafab.output.schemas import SCHEMAS, schema_of
from tests.site.formats import hold

ONE = "stack.balloons=1"


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main(arguments)
    return capsys.readouterr().out


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_one_and_has_an_id(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    schema = json.loads(run(["schema", name], capsys))
    assert schema == schema_of(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$id"] == f"urn:{SCHEMAS[name][0].replace('/', ':')}"


def test_the_command_offers_every_schema() -> None:
    assert tuple(SCHEMAS) == FORMATS


def test_files_of_a_folder_are_of_their_schemas(tmp_path: Path) -> None:
    made = sbafab.generate("1dof-5mm", ONE, "order.copies=2", out=tmp_path)
    for name in ("manifest", "checks", "press"):
        hold(name, json.loads((made.folder / f"{name}.json").read_text(encoding="utf-8")))
    told = made.design.model_dump(mode="json", exclude_none=True)
    jsonschema.validate(told, schema_of("design"))


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
        "-o",
        str(tmp_path / "found.toml"),
    ]
    hold("find", json.loads(run(["find", "1dof-5mm", *asked, "--json"], capsys)))
    design = sbafab.load("1dof-5mm", ONE)
    hold("predict", prediction_json(design, sbafab.predict(design, quick=True)))


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
