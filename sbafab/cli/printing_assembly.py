"""What ``sbafab generate`` prints of an assembly."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.cli.printing import (
    LEFT_AS_IT_WAS,
    console,
    facts_table,
    film_said,
    findings_table,
    notes_of,
    print_failed,
    replaced,
)

if TYPE_CHECKING:
    from rich.table import Table

    from sbafab.output.assembly import AssemblyRun


def print_assembly(run: AssemblyRun) -> None:
    """What was made of an assembly, what the rules found, and the checks between its parts."""
    from rich.text import Text

    out = console()
    if not run.kept:
        out.print(_made(run))
        out.print()
    for one in run.checked.designs:
        if one.failed:
            out.print(Text(one.design.name, style="bold red"))
            out.print(findings_table(one.findings))
    out.print(findings_table(run.checked.between))
    if run.failed:
        print_failed(run.findings, "No cut files were written", "assembly")
        if run.kept:
            out.print(Text(f"{run.folder} {LEFT_AS_IT_WAS}"), soft_wrap=True)


def _made(run: AssemblyRun) -> Table:
    from rich.text import Text

    made = facts_table()
    index = run.manifest
    parts = (f"{p['name']} ({p['design'] or p['kind']})" for p in index["parts"])
    made.add_row("assembly", Text(f"{index['name']}, {index['design_sha256'][:12]}"))
    made.add_row("parts", Text(", ".join(parts)))
    for one in run.checked.designs:
        warned = sorted({f.rule for f in one.findings if f.verdict == "warn"})
        said = f"; warns: {', '.join(warned)}" if warned else ""
        waived = f"; waived: {', '.join(one.waived)}" if one.waived else ""
        verdict = "a rule failed" if one.failed else "every rule holds"
        copies = one.design.order.copies
        made.add_row(one.design.name, Text(f"{copies} x, {verdict}{waived}{said}"))
    for note in notes_of(run.checked.designs):
        made.add_row("note", Text(note))
    for film in index["films"]:
        made.add_row(f"{film['material']} film", Text(film_said(film, index["sheets"], 1)))
    for mesh in index["meshes"]:
        made.add_row("solid", Text(f"{mesh['file']}, a node a part"))
    for label, text in replaced(run.dropped):
        made.add_row(label, Text(text))
    made.add_row("folder", Text(str(run.folder)))
    return made


def assembly_json(run: AssemblyRun) -> dict[str, object]:
    """The result of an assembly's run for programs."""
    return {
        "folder": str(run.folder),
        "failed": run.failed,
        "findings": [finding.as_dict() for finding in run.findings],
        "notes": notes_of(run.checked.designs),
        "files": [] if run.kept else sorted(run.manifest["files"]),
    }
