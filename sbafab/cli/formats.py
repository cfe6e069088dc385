"""The formats of files and of ``--json`` output: a JSON schema and an id each.

``sbafab schema`` prints them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import click
from pydantic import Field

from sbafab import plugins
from sbafab.api.designs import schema as design_schema
from sbafab.api.runs import RunDocument
from sbafab.api.search import YieldEntry
from sbafab.cli import show
from sbafab.cli.exit import ErrorKind
from sbafab.documents import Document, json_schema
from sbafab.errors import ERROR_SCHEMA

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class YieldRunDocument(RunDocument, schema=RunDocument.SCHEMA):
    """A folder, and the changes of --target-yield; figures before and after the changes."""

    reached: YieldEntry | None = Field(None, alias="yield")


class ErrorEntry(Document):
    """The end of a command."""

    kind: ErrorKind
    message: str
    exit_code: int


class ErrorDocument(Document, schema=ERROR_SCHEMA):
    """An error that ends a command."""

    error: ErrorEntry


class Format(NamedTuple):
    """A format: the entry of its record, its description, and an id if its record has none."""

    entry: str
    about: str
    other_id: str = ""

    @property
    def record(self) -> Any:
        """The record, loaded on demand."""
        return plugins.load(f"sbafab.{self.entry}")

    @property
    def identity(self) -> str:
        """The id in its files."""
        return self.other_id or str(self.record.SCHEMA)


FORMATS: Mapping[str, Format] = {
    "design": Format(
        "assemblies.records:Assembly", "design and assembly files (TOML)", "sbafab/design@1"
    ),
    "checks": Format("folders.checks_json:Checks", "`checks.json`, and what `check --json` prints"),
    "laminate": Format(
        "design.laminate_file:LaminateDocument",
        "`laminate.json`: layers with exact edges, films, inlets",
        "sbafab/laminate@1",
    ),
    "nets": Format("api.checks:NetsDocument", "a netlist, for `check --nets`"),
    "manifest": Format("folders.manifest:Manifest", "`manifest.json` of a design's folder"),
    "job": Format(
        "folders.manifest:JobManifest", "`manifest.json` of several designs cut together by `nest`"
    ),
    "assembly": Format(
        "folders.manifest:AssemblyManifest", "`manifest.json` of an assembly's folder"
    ),
    "press": Format(
        "pressing.schedule_files:PressDocument", "`press.json`, the heat-press schedule"
    ),
    "predict": Format(
        "api.predictions:PrintedPrediction",
        "`predict.json`, and what `predict --json` prints of a design",
    ),
    "find": Format("search.find:FindDocument", "what `find --json` prints"),
    "compare": Format("search.compare:CompareDocument", "what `compare --json` prints"),
    "run": Format(
        "cli.formats:YieldRunDocument",
        "what `generate`, `cut`, `press` and `mesh` print with `--json`",
    ),
    "nested": Format("api.runs:NestedDocument", "what `nest --json` prints"),
    "records": Format("lab.records:RecordsDocument", "what `record --json` prints of records"),
    "history": Format("lab.records:HistoryDocument", "what `record --export FILE.json` writes"),
    "report": Format("lab.report:ReportDocument", "what `record --report --json` prints"),
    "sweep": Format("search.sweep:SweepDocument", "what `sweep --json` prints"),
    "simulate": Format(
        "simulators.simulator:Result",
        "`result.json` of a simulator's folder, and what `simulate --json` prints",
    ),
    "assembly-predict": Format(
        "reports.assembly_prediction:AssemblyPrediction",
        "what `predict --json` prints of an assembly",
        "sbafab/assembly-predict@1",
    ),
    "reproduction": Format(
        "validation.paper_table:ReproductionDocument",
        "`reproduction.json`, and what `reproduce --json` prints",
    ),
    "comparison": Format(
        "validation.comparison:ComparisonDocument", "what `reproduce SOURCE --json` prints"
    ),
    "inspection": Format(
        "lab.inspection:InspectionDocument", "what `inspect` writes, and prints with `--json`"
    ),
    "kerf": Format("cli.measure:KerfDocument", "what `kerf --json` prints"),
    "explain": Format("api.explained:ExplainDocument", "what `explain NAME --json` prints"),
    "explained": Format(
        "api.explained:ExplainedDocument", "what `explain --json` prints of all rules"
    ),
    "calibrate": Format("cli.evidence:CalibrateDocument", "what `calibrate --json` prints"),
    "templates": Format(
        "cli.start:TEMPLATES", "what `new --json` prints: a list, without id", "sbafab/templates@1"
    ),
    "error": Format(
        "cli.formats:ErrorDocument",
        "what any command prints with `--json` when it ends in an error",
    ),
}


def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON schema of a format in ``FORMATS``."""
    record, identity = FORMATS[name].record, FORMATS[name].identity
    # A design file is an assembly or of any family.
    body = design_schema() if name == "design" else json_schema(record, identity)
    head = {"$schema": DIALECT, "$id": f"urn:{identity.replace('/', ':')}"}
    return head | {key: value for key, value in body.items() if key != "$schema"}


@click.command()
@click.argument("name", type=click.Choice(FORMATS), default="design", required=False)
def schema(name: str) -> None:
    """Print a JSON schema, by default that of design files.

    Editors use it to complete and check design files; the other schemas describe JSON output.
    """
    show.document(schema_of(name))
