"""``sbafab schema``: JSON schemas of design files and of written files."""

from __future__ import annotations

import click

from sbafab.cli.printing import print_json

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

    Editors use it to complete and check design files; the other schemas describe JSON output.
    """
    from sbafab.cli.formats import schema_of

    print_json(schema_of(name))
