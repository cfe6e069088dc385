"""``sbafab schema``: JSON schemas of design files and of written files."""

from __future__ import annotations

import click

from sbafab.cli.formats import FORMATS, schema_of
from sbafab.cli.printing import print_json


@click.command()
@click.argument("name", type=click.Choice(FORMATS), default="design", required=False)
def schema(name: str) -> None:
    """Print a JSON schema, by default that of design files.

    Editors use it to complete and check design files; the other schemas describe JSON output.
    """
    print_json(schema_of(name))
