"""The formats of files and of what commands print with ``--json``: a JSON schema and an id each.

``sbafab schema`` prints them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import click
from pydantic import Field

from sbafab import actuators
from sbafab.assemblies.records import Assembly
from sbafab.cli import show
from sbafab.cli.evidence import CalibrateDocument
from sbafab.cli.exit import ErrorKind
from sbafab.cli.explain import ExplainDocument, ExplainedDocument
from sbafab.cli.make import NestedDocument, RunDocument
from sbafab.cli.measure import KerfDocument
from sbafab.cli.start import TemplateEntry
from sbafab.design.laminate_file import SCHEMA as LAMINATE
from sbafab.design.laminate_file import LaminateDocument
from sbafab.documents import Document, json_schema
from sbafab.errors import ERROR_SCHEMA
from sbafab.folders.artefacts import PredictDocument
from sbafab.folders.checks_json import Checks
from sbafab.folders.manifest import AssemblyManifest, JobManifest, Manifest
from sbafab.lab.inspection import InspectionDocument
from sbafab.lab.records import HistoryDocument, RecordsDocument
from sbafab.lab.report import ReportDocument
from sbafab.laminate.joints import PortKind
from sbafab.laminate.netlist import SCHEMA as NETS
from sbafab.models.map_files import MapDocument
from sbafab.models.sensitivities import SensitivityRow
from sbafab.pressing.schedule_files import PressDocument
from sbafab.reports.assembly_prediction import SCHEMA as ASSEMBLY_PREDICTION
from sbafab.reports.assembly_prediction import AssemblyPrediction
from sbafab.search.compare import CompareDocument, YieldEntry
from sbafab.search.find import FindDocument
from sbafab.search.sweep import SweepDocument
from sbafab.simulators.simulator import SimulateDocument
from sbafab.validation.comparison import ComparisonDocument
from sbafab.validation.paper_table import ReproductionDocument

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class YieldRunDocument(RunDocument, schema=RunDocument.SCHEMA):
    """A folder, and the changes of --target-yield; figures as given and as changed."""

    reached: YieldEntry | None = Field(None, alias="yield")


class PrintedPrediction(PredictDocument, schema=PredictDocument.SCHEMA):
    """The contents of ``predict.json`` and further printed figures."""

    failed: tuple[str, ...] = ()
    folder: str = ""
    sensitivity: tuple[SensitivityRow, ...] = ()


PAIR = Field(min_length=2, max_length=2)


class NamedPort(Document):
    """A port of a netlist, with its place if it is none of the design's."""

    name: str
    at: Annotated[Sequence[float], PAIR] = ()
    """x, y, mm"""
    layers: Annotated[Sequence[int], PAIR] = ()
    """structural layers below and above, from 1"""
    kind: PortKind = "place"


class NetsDocument(Document, schema=NETS):
    """A netlist."""

    nets: dict[str, list[str | NamedPort]] = Field(min_length=1)
    """name -> ports and chambers of the design, or ports with their place"""


class ErrorEntry(Document):
    """The end of a command."""

    kind: ErrorKind
    message: str
    exit_code: int


class ErrorDocument(Document, schema=ERROR_SCHEMA):
    """An error that ends a command."""

    error: ErrorEntry


class Format(NamedTuple):
    """A format: the id in its files, what it describes, and its record."""

    identity: str
    about: str
    record: Any


def _of(about: str, document: type[Document]) -> Format:
    return Format(document.SCHEMA, about, document)


FORMATS: Mapping[str, Format] = {
    "design": Format("sbafab/design@1", "design and assembly files (TOML)", Assembly),
    "checks": _of("`checks.json`, and what `check --json` prints", Checks),
    "laminate": Format(
        LAMINATE, "`laminate.json`: layers with exact edges, films, inlets", LaminateDocument
    ),
    "nets": _of("a netlist, for `check --nets`", NetsDocument),
    "manifest": _of("`manifest.json` of a design's folder", Manifest),
    "job": _of("`manifest.json` of several designs cut together by `nest`", JobManifest),
    "assembly": _of("`manifest.json` of an assembly's folder", AssemblyManifest),
    "press": _of("`press.json`, the heat-press schedule", PressDocument),
    "predict": _of(
        "`predict.json`, and what `predict --json` prints of a design", PrintedPrediction
    ),
    "find": _of("what `find --json` prints", FindDocument),
    "compare": _of("what `compare --json` prints", CompareDocument),
    "run": _of("what `generate`, `cut`, `press` and `mesh` print with `--json`", YieldRunDocument),
    "nested": _of("what `nest --json` prints", NestedDocument),
    "records": _of("what `record --json` prints of records", RecordsDocument),
    "history": _of("what `record --export FILE.json` writes", HistoryDocument),
    "report": _of("what `record --report --json` prints", ReportDocument),
    "sweep": _of("what `sweep --json` prints", SweepDocument),
    "simulate": _of(
        "`result.json` of a simulator's folder, and what `simulate --json` prints", SimulateDocument
    ),
    "assembly-predict": Format(
        ASSEMBLY_PREDICTION, "what `predict --json` prints of an assembly", AssemblyPrediction
    ),
    "reproduction": _of(
        "`reproduction.json`, and what `reproduce --json` prints", ReproductionDocument
    ),
    "comparison": _of("what `reproduce SOURCE --json` prints", ComparisonDocument),
    "balloon-map": _of("what `map --to FILE.json` writes", MapDocument),
    "inspection": _of("what `inspect` writes, and prints with `--json`", InspectionDocument),
    "kerf": _of("what `kerf --json` prints", KerfDocument),
    "explain": _of("what `explain NAME --json` prints", ExplainDocument),
    "explained": _of("what `explain --json` prints of all rules", ExplainedDocument),
    "calibrate": _of("what `calibrate --json` prints", CalibrateDocument),
    "templates": Format(
        "sbafab/templates@1", "what `new --json` prints: a list, without id", list[TemplateEntry]
    ),
    "error": _of("what any command prints with `--json` when it ends in an error", ErrorDocument),
}


def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON schema of a format in ``FORMATS``."""
    identity, _, record = FORMATS[name]
    # A design file is an assembly or of any family.
    body = actuators.schema(record) if record is Assembly else json_schema(record, identity)
    head = {"$schema": DIALECT, "$id": f"urn:{identity.replace('/', ':')}"}
    return head | {key: value for key, value in body.items() if key != "$schema"}


@click.command()
@click.argument("name", type=click.Choice(FORMATS), default="design", required=False)
def schema(name: str) -> None:
    """Print a JSON schema, by default of design files.

    Editors use it to complete and check design files; the other schemas describe JSON output.
    """
    show.document(schema_of(name))
