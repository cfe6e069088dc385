"""``sbafab templates``: the list of templates."""

from __future__ import annotations

import click

from sbafab.cli.options import json_option
from sbafab.cli.printing import print_json
from sbafab.design.files import template_summaries


@click.command()
@json_option
def templates(as_json: bool) -> None:
    """List the templates, a line each."""
    summaries = template_summaries()
    if as_json:
        print_json([{"name": name, "summary": summary} for name, summary in summaries.items()])
        return
    width = max(map(len, summaries))
    for name, summary in summaries.items():
        click.echo(f"{name:<{width}}  {summary}")
