"""The command line: one command a file; nothing but arguments, progress and printing."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import Any

import click

from sbafab import __version__
from sbafab.cli.exit import BAD_INPUT, ended_plainly, prepared_streams, say
from sbafab.cli.fetching import Fetched
from sbafab.process import prepare

COMMANDS = Fetched()


EXTRAS = {
    "control": ("gymnasium", "an environment of Gymnasium, from Python"),
    "dask": ("distributed", "sweep --dask"),
    "mesh": ("netgen", "sbafab mesh, simulate --with calculix"),
    "mujoco": ("mujoco", "simulate --with mujoco"),
    "nest": ("spyrrow", "--nest spyrrow"),
    "optuna": ("optuna", "find --optuna"),
    "parquet": ("pyarrow", "tables of sweeps as Parquet"),
    "python": ("trimesh", "meshes for trimesh, meshio and PyVista"),
    "studio": ("starlette", "sbafab studio"),
}
"""What each extra brings: a module to look for, and what needs it."""


class InOrder(click.Group):
    """A group that lists its commands in the order a newcomer needs them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        missing = [
            f'{what}: pip install "sbafab[{extra}]"'
            for extra, (module, what) in EXTRAS.items()
            if find_spec(module) is None
        ]
        if missing:
            with formatter.section("Not installed"):
                formatter.write("".join(f"  {line}\n" for line in missing))

    def invoke(self, ctx: click.Context) -> Any:
        # Click hands a command what is left of the line here; it is read before a command is.
        with ended_plainly("--json" in ctx.args):
            return super().invoke(ctx)


@click.group(
    cls=InOrder,
    commands=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="sbafab")
def app() -> None:
    """Fabrication CAD for soft Stacked Balloon Actuators.

    DESIGN is a template's name or a TOML file. Start with: sbafab generate 3dof-15mm

    Exit codes: 0 done, 1 a rule failed, a part is too large for its film, or a simulation stopped
    early, 2 bad input or usage, 130 stopped by Ctrl-C.
    """


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; bad input ends in one sentence and exit code 2."""
    if arguments is None:
        # The command is all that the process does, by whatever door it came.
        prepare()
    prepared_streams()
    if any("\0" in argument for argument in arguments or ()):
        say("an argument holds a NUL character; no path or value can")
        sys.exit(BAD_INPUT)
    app(arguments, prog_name="sbafab")
