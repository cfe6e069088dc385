"""``sbafab schema``: JSON schema of a design file."""

from __future__ import annotations

import click


@click.command()
def schema() -> None:
    """Print the JSON schema of design and assembly files, for editors to complete and check."""
    from sbafab.actuators import schema as design_schema
    from sbafab.assemblies.records import Assembly
    from sbafab.cli.printing import print_json

    print_json(design_schema(Assembly))
