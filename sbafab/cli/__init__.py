"""The command line: the table of commands and the group that runs them."""

from __future__ import annotations

import sys
from collections import UserDict
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import click
from click.shell_completion import CompletionItem

from sbafab import __version__
from sbafab.cli.exit import BAD_INPUT, exit_plainly, prepared_streams, print_error
from sbafab.runtime import prepare

GROUPS = {
    "Design": {
        "new": "Write a commented design file to start from, or list the templates.",
        "import": "Write a design of drawn layers from other files.",
        "studio": "Edit a design in the browser.",
        "schema": "Print a JSON schema, by default that of design files.",
    },
    "Check": {
        "check": "Run the rules on a design or on an output folder.",
        "explain": "Explain a rule, a key of design files, a quantity, or a flag of figures.",
        "compare": "Compare two designs: their differences and figures.",
    },
    "Make": {
        "generate": "Write everything: cut files, schedule, traveller, meshes.",
        "cut": "Write the cut files: a DXF for each layer, and film sheets.",
        "press": "Write the heat-press schedule.",
        "mesh": "Write meshes: solid, cavities, volume and shell.",
        "nest": "Cut several designs from the same film sheets.",
    },
    "Predict": {
        "predict": "Predict size, stroke, force, time and bending.",
        "map": "Map force and volume of the balloons.",
        "picture": "Draw the inflated actuator as picture, animation or scene.",
        "simulate": "Inflate a design in an installed simulator.",
    },
    "Search": {
        "find": "Find the best design that meets requirements.",
        "sweep": "Check and predict variants of a design.",
    },
    "Measure": {
        "kerf": "Compute the kerf from a filled coupon.csv.",
        "inspect": "Compare a scan or photograph of a cut sheet with its cut file.",
        "record": "Record the results of builds, and report on them.",
        "reproduce": "Compare predictions with measurements.",
        "calibrate": "Fit the models to measurements.",
    },
}
"""The commands in the order a newcomer needs them, in groups, with the first line of their help.

A module has the name of its command, unless HOMES names another. The summaries stand here so that
``sbafab --help`` and the completion of a command's name load no command.
"""
SUMMARIES = {name: summary for group in GROUPS.values() for name, summary in group.items()}
BUILTIN = {"map": "map_", "import": "import_"}
"""Functions that cannot have the name of their command."""
HOMES = {
    name: module
    for module, names in {
        "start": "new import studio",
        "make": "generate cut press mesh nest simulate",
        "inflate": "map picture",
        "search": "find sweep compare",
        "measure": "kerf inspect",
        "evidence": "reproduce calibrate",
        "formats": "schema",
    }.items()
    for name in names.split()
}
"""Modules with another name than their command."""


class CommandTable(UserDict[str, Any]):
    """Commands by name; a command's module is imported at its first look-up."""

    def __getitem__(self, name: str) -> click.Command:
        command: click.Command | None = self.data[name]
        if command is None:
            # Its module loads what commands print, and so the rules.
            from sbafab.cli.show import add_verbosity

            module = import_module(f"sbafab.cli.{HOMES.get(name, name)}")
            command = self.data[name] = getattr(module, BUILTIN.get(name, name))
            add_verbosity(command)
        return command


COMMANDS = CommandTable(dict.fromkeys(SUMMARIES))
EXTRAS = {
    "calibrate": ("emcee", "sbafab calibrate"),
    "control": ("gymnasium", "an environment of Gymnasium, from Python"),
    "dask": ("distributed", "sweep --dask"),
    "mesh": ("netgen", "sbafab mesh, simulate --with calculix"),
    "mujoco": ("mujoco", "simulate --with mujoco"),
    "python": ("pandas", "tables as DataFrames of pandas"),
    "scan": ("skimage", "sbafab inspect"),
    "studio": ("starlette", "sbafab studio"),
    "yaml": ("yaml", "import of YAML, as foldable_robotics writes it"),
}
"""Extra -> a module that it installs, and the feature that needs it."""


class CommandGroup(click.Group):
    """A group that lists its commands in GROUPS and suggests the nearest name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(len(name) for name in SUMMARIES)
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), text) for name, text in group.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        names = [
            CompletionItem(name, help=summary)
            for name, summary in SUMMARIES.items()
            if name.startswith(incomplete)
        ]
        return [*names, *click.Command.shell_complete(self, ctx, incomplete)]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        missing = [
            f'{feature}: pip install "sbafab[{extra}]"'
            for extra, (module, feature) in EXTRAS.items()
            if find_spec(module) is None
        ]
        if missing:
            with formatter.section("Not installed"):
                formatter.write("".join(f"  {line}\n" for line in missing))

    def invoke(self, ctx: click.Context) -> Any:
        # Click hands over the rest of the line, the command first.
        with exit_plainly("--json" in ctx.args):
            return super().invoke(ctx)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in self.commands and not name.startswith("-"):
            near = " or ".join(similar_commands(name))
            hint = f"; did you mean {near}?" if near else ""
            raise click.UsageError(f"{name!r} is not a command{hint}", ctx)
        return super().resolve_command(ctx, args)


def similar_commands(name: str) -> list[str]:
    """The commands that begin with ``name``; if there are none, the most similar one, if any."""
    typed = name.lower()
    beginning = [command for command in SUMMARIES if typed and command.startswith(typed)]
    if beginning:
        return beginning
    from difflib import get_close_matches

    return get_close_matches(typed, SUMMARIES, 1)


@click.group(
    cls=CommandGroup,
    commands=COMMANDS,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 100,
        "show_default": True,
    },
)
@click.version_option(__version__, prog_name="sbafab")
def app() -> None:
    """Fabrication CAD for soft Stacked Balloon Actuators.

    DESIGN is a template's name or a TOML file. Start with: sbafab generate 3dof-15mm

    Exit codes: 0 done, 1 a rule failed, a part is too large for its film, or a simulation stopped
    early, 2 bad input or usage, 130 stopped by Ctrl-C.
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; bad input ends in one sentence and exit code 2."""
    if arguments is None:
        # The process runs only this command, however it was started.
        prepare()
    prepared_streams()
    if any("\0" in argument for argument in arguments or ()):
        print_error("an argument contains a NUL character; remove it")
        sys.exit(BAD_INPUT)
    app(arguments, prog_name="sbafab")
