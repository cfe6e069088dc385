"""``sbafab schema``: JSON schemas of design files and of what the program writes."""

from __future__ import annotations

import click

FORMATS = (
    *("design", "checks", "manifest", "job", "assembly"),
    *("press", "predict", "find", "run", "nested", "records", "report"),
    *("sweep", "simulate", "assembly-predict", "reproduction"),
    *("balloon-map", "kerf", "explain", "explained", "templates", "error"),
)
"""As in ``sbafab.cli.formats``, whose imports would slow ``--help`` down."""


@click.command()
@click.argument("name", type=click.Choice(FORMATS), default="design", required=False)
def schema(name: str) -> None:
    """Print a JSON schema, by default that of design files.

    Editors complete and check design files from it; the other formats are what programs read.
    """
    from sbafab.cli.formats import schema_of
    from sbafab.cli.printing import print_json

    print_json(schema_of(name))
