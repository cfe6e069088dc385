"""``sbafab import``: a design of drawn layers from what another program, or a run, wrote."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from sbafab.cli.options import design_file, file_option, folder_option, json_option
from sbafab.cli.printing import print_json, print_note, print_verdict
from sbafab.importing.records import default_file, write_imported
from sbafab.importing.sources import import_source


@click.command("import")
@click.argument("source", type=click.Path(path_type=Path))
@folder_option("Folder in which NAME.toml and a folder of its drawings are written.")
@file_option("NAME.toml")
@json_option
def import_(source: Path, out: Path, to: Path | None, as_json: bool) -> None:
    """Write a design of drawn layers from other files.

    SOURCE is a folder of drawings with a table layers.csv, an output folder, a laminate.json, a
    ParchMint circuit (JSON), or a laminate of foldable_robotics or popupCAD. What is not carried
    over is named.
    """
    name, imported = import_source(source)
    file = design_file(to, out, default_file(imported).name)
    written = write_imported(imported, file, source.name)
    laminate = written.laminate
    if as_json:
        print_json(
            {
                "file": str(written.file),
                "format": name,
                "layers": len(laminate.layers),
                "patterns": len(laminate.patterns),
                "remarks": list(imported.remarks),
            }
        )
        return
    for remark in imported.remarks:
        print_note(remark)
    path = shlex.quote(str(written.file))
    print_verdict(
        f"{written.file} written: {len(laminate.layers)} layers in {len(laminate.patterns)} "
        f"patterns, from {name}. Next: sbafab generate {path}",
        written.file,
    )
