"""``sbafab new``: a commented design file to start from."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("template")
@click.argument("file", type=click.Path(path_type=Path), required=False)
def new(template: str, file: Path | None) -> None:
    """Write a commented design file to start from (FILE: by default TEMPLATE.toml here)."""
    from sbafab.design.reading import write_new

    written = write_new(template, file)
    click.echo(f"{written} is yours to edit; then: sbafab generate {written}")
