"""Options shared by commands: quantities with units, shell completion, DESIGN and -o, --set."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from sbafab import plugins
from sbafab.api.files import (
    KILOPASCALS,
    MILLILITRES_PER_MINUTE,
    MILLIMETRES,
    in_first_unit,
    refuse_file_as_folder,
    share_of,
    template_summaries,
)

Command = Callable[..., Any]
Decorator = Callable[[Command], Command]


# Types of values.


class Parsed(click.ParamType):  # type: ignore[type-arg]  # generic in newer clicks only
    """A value that ``read`` makes of a text; its ValueError names the allowed values.

    ``name`` stands for the value in the help.
    """

    def __init__(self, name: str, read: Callable[[str], Any]) -> None:
        self.name, self.read = name, read

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return self.read(str(value))
        except ValueError as error:
            self.fail(f"{value!r} must be {error}", param, ctx)


def quantity(
    metavar: str, noun: str, units: Mapping[str, float], example: str, positive: bool = False
) -> Parsed:
    """Return the type of a number with or without a unit; ``units`` gives the size of each in the
    first unit, which the value is in.
    """

    def read(text: str) -> float:
        number = in_first_unit(text, units)
        if number is None:
            raise ValueError(f"a {noun} such as {example}; the units are {', '.join(units)}")
        if not math.isfinite(number):
            raise ValueError(f"a finite {noun}")
        if positive and number <= 0:
            raise ValueError(f"a {noun} above 0 {next(iter(units))}")
        return number

    return Parsed(metavar, read)


MICROLITRES = {"ul": 1.0, "ml": 1000.0, "mm3": 1.0}
LENGTH = quantity("MM", "length", MILLIMETRES, '0.35 or "350 um"')
POSITIVE_LENGTH = quantity("MM", "length", MILLIMETRES, '0.35 or "350 um"', positive=True)
PRESSURE = quantity("P", "pressure", KILOPASCALS, '6, "6 kPa" or "60 mbar"')
VOLUME = quantity("V", "volume", MICROLITRES, '5, 5ul or "0.005 ml"')
FLOW = quantity("Q", "flow", MILLILITRES_PER_MINUTE, '35, "35 ml/min" or "0.6 ml/s"')


class OfChamber(Parsed):
    """``NAME=QUANTITY``, or with ``all_chambers`` a quantity alone, whose name is ""."""

    def __init__(self, each: Parsed, all_chambers: bool = False) -> None:
        noun, unit = ("PRESSURE", "KPA") if each is PRESSURE else ("VOLUME", "UL")
        super().__init__(f"{unit}|CHAMBER={unit}" if all_chambers else f"NAME={unit}", self.pair)
        self.each, self.noun, self.all_chambers = each, noun, all_chambers

    def pair(self, text: str) -> tuple[str, float]:
        """Return the chamber's name and the quantity."""
        chamber, equals, number = text.rpartition("=")
        if not (chamber.strip() if equals else self.all_chambers):
            raise ValueError(f"NAME={self.noun}, such as chamber1=5")
        return chamber.strip(), self.each.read(number)


def by_chamber(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> dict[str, float]:
    """Return values by chamber: the callback of a repeatable option of type OfChamber."""
    chambers = dict(values)
    if len(chambers) < len(values):
        raise click.BadParameter("give each chamber only once", ctx, param)
    return chambers


def _share(text: str) -> float:
    share = share_of(text)
    if share is None or not 0 < share < 1:
        raise ValueError("a share above 0 and below 1, as 0.95 or 95%")
    return share


def _finite(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError("a finite number")
    return number


PARTIAL_SHARE = Parsed("SHARE", _share)
"""A share such as 0.95 or 95%, neither none nor all."""
FINITE = Parsed("FLOAT", _finite)


class FiniteRange(click.FloatRange):
    """A finite number in a range; ``FloatRange`` accepts nan."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail("must be a finite number", param, ctx)
        return number


def file_path(**settings: bool) -> click.Path:
    """Return the type of a path."""
    return click.Path(path_type=Path, **settings)


# Shell completion: templates and files, keys with their values, rules.


def designs(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, and files or folders."""
    templates = completions(typed, template_summaries().items())
    return [*templates, CompletionItem(typed, type="file")]


def rules(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of rules and checks."""
    # By name: options need no rule; a shell asks for their names.
    explained = plugins.load("sbafab.rules.deck:EXPLAINED")
    return completions(typed, ((name, rule.holds) for name, rule in explained.items()))


def assignments(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete ``KEY=`` and, after it, the values of a key with a choice."""
    # By name: `sbafab new` has options too, and needs no family.
    kinds = plugins.load("sbafab.api.designs:kinds_of_keys")()
    tables = {path.rpartition(".")[0] for path in kinds}
    key, equals, _ = typed.partition("=")
    if not equals:
        return completions(typed, ((f"{name}=", None) for name in sorted(kinds.keys() - tables)))
    kind = kinds.get(key)
    words = get_args(kind) if get_origin(kind) is Literal else ()
    choices = ("true", "false") if kind is bool else words
    return completions(typed, ((f"{key}={value}", None) for value in choices))


def completions(typed: str, candidates: Iterable[tuple[str, str | None]]) -> list[CompletionItem]:
    """Return the candidates (name, help) that begin with ``typed``."""
    return [
        CompletionItem(name, help=summary) for name, summary in candidates if name.startswith(typed)
    ]


# Arguments and options.


def option(flags: str, words: str, kind: Any = None, **settings: Any) -> Decorator:
    """Return an option.

    ``flags`` are its names, then its parameter's name if that differs, then in capitals the
    placeholder of its value, with dots if it is repeatable, such as "--vary varied KEY=VALUES...".
    ``words`` are its help, ``kind`` is bool for a flag, a type, or a tuple of choices.
    """
    names = flags.removesuffix("...").split()
    if names[-1] != names[-1].lower():
        settings["metavar"] = names.pop()
    if flags.endswith("..."):
        settings["multiple"] = True
        text, mark, default = words.partition("  [")
        words = f"{text} Repeatable.{mark}{default}"
    if kind is bool:
        settings["is_flag"] = True
    elif isinstance(kind, OfChamber):
        settings["callback"] = by_chamber
    elif isinstance(kind, tuple):
        kind = click.Choice(kind)
    return click.option(*names, type=kind, help=words, **settings)


def design_argument(name: str = "source", **settings: Any) -> Decorator:
    """Return the argument of a design, with shell completion."""
    return click.argument(name, shell_complete=designs, **{"metavar": "DESIGN", **settings})


set_option = option(
    "--set assignments KEY=VALUE...",
    "Override a key of the design, e.g. --set chamber.diameter=6.",
    shell_complete=assignments,
)
json_option = option("--json as_json", "Print the result as JSON.", bool)


def pressures_option(words: str, default: str) -> Decorator:
    """Return ``--pressure``, repeatable, with a help text that begins with ``words``."""
    words += f", kPa or with a unit. Repeatable.  [default: {default}]"
    return option("--pressure pressures_kpa", words, PRESSURE, multiple=True)


def flow_option(words: str) -> Decorator:
    """Return the option of a flow in ml/min, with a help text that begins with ``words``."""
    return option(
        "--flow flow_ml_min", f"{words}, ml/min or with a unit.", FLOW, default="35 ml/min"
    )


def waive_option(words: str) -> Decorator:
    """Return ``--waive`` with the help text of a command."""
    return option("--waive waivers RULE", words, multiple=True, shell_complete=rules)


WAIVE_HELP = {
    "press": "Write the schedule although this rule fails; it will state it. Repeatable.",
    "mesh": "Write the meshes although this rule fails; the manifest will state it. Repeatable.",
    "predict": "Write the prediction although this rule fails and the actuator may leak or burst. "
    "Repeatable.",
    "sweep": "Accept the failure of this rule in every design; the tables state it. Repeatable.",
    "simulate": "Simulate although this rule fails and the actuator may leak or burst. Repeatable.",
}
WAIVE_CUT = "Write the cut files although this rule fails; they will state it. Repeatable."


def _refuse_file(ctx: click.Context, _: click.Parameter, out: Path) -> Path:
    """Raise BadParameter for the name of a design file, and OutputError for a folder that is a
    file, before any computation.
    """
    refuse_file_as_folder(out)
    if out.suffix.lower() == ".toml":
        has_file = any("--to" in param.opts for param in ctx.command.params)
        mend = f"; write --to {out} for a file" if has_file else ""
        raise click.BadParameter(f"{str(out)!r} is the name of a file, but -o needs a folder{mend}")
    return out


def folder_option(words: str, default: str = ".") -> Decorator:
    """Return ``-o``, the output folder of a command."""
    return option(
        "-o --out OUT",
        words,
        file_path(readable=False),
        default=Path(default),
        show_default="this folder" if default == "." else None,
        callback=_refuse_file,
    )


out_option = folder_option("Folder in which OUT/<name>/ is written.", "out")


def file_option(name: str) -> Decorator:
    """Return ``--to``, the design file to write instead of the one named ``name``."""
    words = f"Write FILE, which ends in .toml, instead of {name}; its stem names the design."
    return option("--to FILE", words, file_path(dir_okay=False))


def design_file(to: Path | None, out: Path, name: str) -> Path:
    """Return the file of ``--to``, else the one named ``name`` in the folder of ``-o``."""
    if to is None:
        return out / name
    refuse_options("names a folder and --to a file; leave one out", "out")
    if to.suffix.lower() != ".toml":
        raise click.BadParameter(f"{to} must end in .toml", param_hint="--to")
    return to


def refuse_options(why: str, *names: str) -> None:
    """Raise UsageError, ending with ``why``, if one of these parameters is on the command line."""
    ctx = click.get_current_context()
    for param in ctx.command.params:
        source = ctx.get_parameter_source(param.name or "")
        if param.name in names and source is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{max(param.opts, key=len)} {why}")


def run_options(load: Callable[..., Any], is_several: bool = False) -> Decorator:
    """Add DESIGN, or any number of them, and the options of a writing command.

    The command receives the design that ``load`` makes from the name, keys and waivers, or a list
    of them, then ``out`` and ``as_json``; ``copies`` of ``cut_options`` is a key of the design.
    """

    def add(command: Command) -> Command:
        @functools.wraps(command)
        def loaded(
            designs: tuple[str, ...] | str,
            assignments: tuple[str, ...],
            waivers: tuple[str, ...],
            **parameters: Any,
        ) -> Any:
            copies = parameters.pop("copies", None)
            keys = () if copies is None else (f"order.copies={copies}",)
            names = (designs,) if isinstance(designs, str) else designs
            sources = [load(name, (*assignments, *keys), waivers) for name in names]
            return command(sources if is_several else sources[0], **parameters)

        metavar, count = ("DESIGN...", -1) if is_several else ("DESIGN", 1)
        argument = design_argument("designs", metavar=metavar, nargs=count, required=True)
        waive = waive_option(WAIVE_HELP.get(command.__name__, WAIVE_CUT))
        decorated: Command = loaded
        for each in (json_option, waive, set_option, out_option, argument):
            decorated = each(decorated)
        return decorated

    return add
