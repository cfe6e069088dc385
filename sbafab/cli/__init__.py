"""The command line: one command a file; nothing but arguments, progress and printing."""

from __future__ import annotations

import sys

import click

from sbafab import __version__
from sbafab.cli.check import check
from sbafab.cli.cut import cut
from sbafab.cli.generate import generate
from sbafab.cli.mesh import mesh
from sbafab.cli.new import new
from sbafab.cli.press import press
from sbafab.cli.schema import schema
from sbafab.cli.templates import templates
from sbafab.errors import SbafabError

BAD_INPUT = 2
COMMANDS = (templates, new, generate, check, cut, press, mesh, schema)


class InOrder(click.Group):
    """A group that lists its commands in the order a newcomer needs them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(
    cls=InOrder,
    commands=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="sbafab")
def app() -> None:
    """Fabrication CAD for soft Stacked Balloon Actuators.

    DESIGN is a template's name or a TOML file. Start with: sbafab generate 3dof-15mm

    Exit codes: 0 done, 1 a rule failed, 2 bad input or usage.
    """


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; bad input ends in one sentence and exit code 2."""
    try:
        app(arguments, prog_name="sbafab")
    except SbafabError as error:
        sentence = " ".join(str(error).split())
        click.echo(f"sbafab: {sentence}", err=True)
        sys.exit(BAD_INPUT)
