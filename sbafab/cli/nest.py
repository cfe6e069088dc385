"""``sbafab nest``: several designs cut together, from the same film sheets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.cli.options import Request, dxf_options, several_run_options, sheet_options
from sbafab.cli.printing import (
    console,
    facts_table,
    groups_of,
    notes_of,
    print_failed,
    print_line,
    print_open,
    print_passed,
)
from sbafab.cli.progress import shown_progress
from sbafab.cli.run import add_batch, finish
from sbafab.cutting.properties import Curves
from sbafab.documents import Document, attribute
from sbafab.output.checked import FindingEntry
from sbafab.runs.run import Run, RunRequest, generate


@click.command()
@several_run_options
@click.option("--name", default="job", show_default=True, help="Name of the folder OUT/<name>/.")
@dxf_options
@sheet_options
def nest(request: Request, name: str, curves: Curves) -> None:
    """Cut several designs from the same film sheets.

    OUT/<name>/ receives a folder for each DESIGN, and sheets/ with the parts of all. Overrides
    apply to every design. Copies: --copies of every design, else each design's order.copies.
    """
    designs = [
        load_design(design, request.assignments, request.waivers) for design in request.designs
    ]
    with shown_progress(request.as_json) as progress:
        job = generate(RunRequest(designs, request.out, curves=curves, name=name), progress)
    finish(job, request, job_json, print_job)


def print_job(job: Run) -> None:
    """Print the table of a job, the findings of designs that failed, and the verdict."""
    table = facts_table()
    add_batch(table, job)
    console().print(table)
    print_line("")
    for checked in job.builds:
        if checked.failed:
            print_line(checked.design.name, "bold red")
            print_open(checked.findings)
    if job.failed:
        findings = [finding for checked in job.builds for finding in checked.findings]
        consequence = f"Nothing was written; {job.folder} is unchanged"
        print_failed(job.folder.name, findings, consequence, "designs")
    else:
        print_passed(job.folder.name, groups_of(job.builds), written=job.folder)


class NestedDesign(Document):
    """One of the designs."""

    name: str = attribute("design.name")
    failed: bool
    findings: list[FindingEntry]
    notes: list[str]


class NestedDocument(Document, schema="sbafab/nested@1"):
    """What ``nest --json`` prints."""

    folder: Path
    failed: bool
    designs: list[NestedDesign]
    files: list[str]
    """what lies in the folder"""


def job_json(job: Run) -> dict[str, Any]:
    """Return a job as JSON."""
    designs = [NestedDesign.read(each, notes=notes_of([each])) for each in job.builds]
    return NestedDocument.of(job, designs=designs, files=sorted(job.manifest.get("files", ())))
