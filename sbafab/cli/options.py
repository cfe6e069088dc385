"""Options that commands share: quantities with units, shell completion, DESIGN and -o, --set."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from sbafab.cutting.properties import Curves, DxfProfile
from sbafab.design.files import key_paths, template_summaries
from sbafab.design.units import KILOPASCALS, MILLILITRES_PER_MINUTE, in_first_unit, share_of


@dataclass(frozen=True)
class MeasuredQuantity:
    """A number with or without a unit; ``units`` gives the size of each in the first unit."""

    name: str
    units: dict[str, float]
    example: str

    def read(self, written: str) -> float:
        """Return a quantity in the first unit; raises BadParameter for other text."""
        number = in_first_unit(written, self.units)
        if number is None:
            allowed = f"a {self.name} such as {self.example}; the units are {', '.join(self.units)}"
            raise click.BadParameter(f"{written!r} must be {allowed}")
        if not math.isfinite(number):
            raise click.BadParameter(f"{written!r} must be a finite {self.name}")
        return number


LENGTH = MeasuredQuantity(
    "length", {"mm": 1.0, "um": 0.001, "cm": 10.0, "in": 25.4}, '0.35 or "350 um"'
)
PRESSURE = MeasuredQuantity("pressure", KILOPASCALS, '6, "6 kPa" or "60 mbar"')
MODULUS = MeasuredQuantity("modulus", {"MPa": 1.0, "kPa": 0.001, "GPa": 1000.0}, '10 or "10 MPa"')
VOLUME = MeasuredQuantity("volume", {"ul": 1.0, "ml": 1000.0, "mm3": 1.0}, '5, 5ul or "0.005 ml"')
FLOW = MeasuredQuantity("flow", MILLILITRES_PER_MINUTE, '35, "35 ml/min" or "0.6 ml/s"')


@dataclass(frozen=True)
class OfChamber:
    """``NAME=QUANTITY``, or with ``all_chambers`` a quantity alone, whose name is ""."""

    quantity: MeasuredQuantity
    all_chambers: bool = False

    def read(self, written: str) -> tuple[str, float]:
        chamber, equals, text = written.rpartition("=")
        if not (chamber.strip() if equals else self.all_chambers):
            short = self.quantity.example.split(",")[0]
            pattern = f"NAME={self.quantity.name.upper()}"
            raise click.BadParameter(f"{written!r} must be {pattern}, such as chamber1={short}")
        return chamber.strip(), self.quantity.read(text)


def by_chamber(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, float], ...]
) -> dict[str, float]:
    """Return values by chamber: the callback of a repeatable option of type OfChamber."""
    chambers = dict(values)
    if len(chambers) < len(values):
        raise click.BadParameter("each chamber may be given once", ctx, param)
    return chambers


class _Finite(click.ParamType):  # type: ignore[type-arg]  # generic in newer clicks only
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail("must be a finite number", param, ctx)
        return number


class FiniteFloat(_Finite, click.types.FloatParamType):
    """A finite number."""


class FiniteRange(_Finite, click.FloatRange):
    """A finite number in a range; ``FloatRange`` accepts nan."""


# Shell completion: templates and files, keys with their values, rules.


def designs(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of templates, and files or folders."""
    templates = completions(typed, template_summaries().items())
    return [*templates, CompletionItem(typed, type="file")]


def rules(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete the names of rules and checks."""
    # Options need no rule; a shell asks for their names.
    from sbafab.rules.deck import EXPLAINED

    return completions(typed, ((name, rule.holds) for name, rule in EXPLAINED.items()))


def assignments(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Complete ``KEY=``, and after it the values of a key that has a choice."""
    key, equals, _ = typed.partition("=")
    ends = _choices(_keys().get(key)) if equals else ()
    names = (f"{key}={value}" for value in ends) if equals else (f"{name}=" for name in _keys())
    return completions(typed, ((name, None) for name in names))


def completions(typed: str, candidates: Iterable[tuple[str, str | None]]) -> list[CompletionItem]:
    """Return the candidates (name, help) that begin with ``typed``."""
    return [
        CompletionItem(name, help=summary) for name, summary in candidates if name.startswith(typed)
    ]


def _keys() -> dict[str, object]:
    """Return the keys of all families that hold a value, with their annotations."""
    # `sbafab new` has options too, and needs no family.
    from sbafab.actuators import records

    keys = {key: kind for record in records().values() for key, kind in key_paths(record).items()}
    tables = {path.rpartition(".")[0] for path in keys}
    return {path: keys[path] for path in sorted(keys) if path not in tables}


def _choices(annotation: Any) -> tuple[str, ...]:
    """Return the values of a ``Literal`` or a boolean."""
    if annotation is bool:
        return "true", "false"
    return tuple(map(str, get_args(annotation))) if get_origin(annotation) is Literal else ()


# Arguments and options.


Command = Callable[..., Any]

_GIVEN = click.core.ParameterSource.COMMANDLINE


set_option = click.option(
    "--set",
    "assignments",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=assignments,
    help="Override a key of the design, e.g. --set chamber.diameter=6. Repeatable.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


def pressures_option(words: str, default: str) -> Callable[[Command], Command]:
    """Return ``--pressure``, repeatable, whose help begins with ``words``."""
    return click.option(
        "--pressure",
        "pressures",
        type=PRESSURE.read,
        multiple=True,
        metavar="P",
        help=f"{words}, kPa or with a unit. Repeatable.  [default: {default}]",
    )


def calibration_options(command: Command) -> Command:
    """Add the calibration options of the elastic models (``models.figures.Factors``)."""
    lost = click.option(
        "--pocket-loss",
        type=LENGTH.read,
        metavar="L",
        help="Measured loss of pocket radius against the drawing, mm or with a unit; for elastic "
        "models.  [default: the calibration's]",
    )
    modulus = click.option(
        "--modulus",
        "modulus_mpa",
        type=MODULUS.read,
        metavar="E",
        help="Measured Young's modulus of the pressed film, MPa or with a unit.  [default: the "
        "film's times the calibration's ratio]",
    )
    return lost(modulus(command))


def flow_option(words: str) -> Callable[[Command], Command]:
    """Return the option of a flow in ml/min, whose help begins with ``words``."""
    return click.option(
        "--flow",
        "flow_ml_min",
        type=FLOW.read,
        default="35 ml/min",
        metavar="Q",
        help=f"{words}, ml/min or with a unit.",
    )


def waive_option(words: str) -> Callable[[Command], Command]:
    """Add ``--waive`` with the help text of a command."""
    return click.option(
        "--waive",
        "waivers",
        metavar="RULE",
        multiple=True,
        shell_complete=rules,
        help=words,
    )


def _target(_: click.Context, __: click.Parameter, text: str | None) -> float | None:
    """Return a share from 0.95 or 95%; raises BadParameter for none, all and other text."""
    if text is None:
        return None
    target = share_of(text)
    if target is None or not 0 < target < 1:
        raise click.BadParameter(f"{text!r} must be a share above 0 and below 1, as 0.95 or 95%")
    return target


def target_yield_option(words: str) -> Callable[[Command], Command]:
    """Return ``--target-yield`` with the help text of a command."""
    return click.option(
        "--target-yield", "target_yield", callback=_target, metavar="SHARE", help=words
    )


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
    """Raises BadParameter for the name of a design file, and OutputError for a folder that is a
    file, before anything is computed.
    """
    # Help and completion do without it.
    from sbafab.folders.swap import refuse_file_as_folder

    refuse_file_as_folder(out)
    if out.suffix.lower() == ".toml":
        has_file = any("--to" in param.opts for param in ctx.command.params)
        mend = f"; write --to {out} for a file" if has_file else ""
        raise click.BadParameter(f"{str(out)!r} is a file's name, and -o takes a folder{mend}")
    return out


def folder_option(words: str, default: str = ".") -> Callable[[Command], Command]:
    """Return ``-o``, the folder that a command writes into."""
    return click.option(
        "-o",
        "--out",
        type=click.Path(path_type=Path, readable=False),
        default=Path(default),
        show_default="this folder" if default == "." else None,
        callback=_refuse_file,
        metavar="OUT",
        help=words,
    )


out_option = folder_option("Folder in which OUT/<name>/ is written.", "out")


def file_option(name: str) -> Callable[[Command], Command]:
    """Return ``--to``, the design file to write instead of the one called ``name``."""
    return click.option(
        "--to",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help=f"Write FILE, which ends in .toml, instead of {name}; its stem names the design.",
    )


def design_file(to: Path | None, out: Path, name: str) -> Path:
    """Return the file of ``--to``, else the one called ``name`` in the folder of ``-o``."""
    if to is None:
        return out / name
    refuse_options("names a folder and --to a file; leave one out", "out")
    if to.suffix.lower() != ".toml":
        raise click.BadParameter(f"{to} must end in .toml", param_hint="--to")
    return to


@dataclass(frozen=True)
class Request:
    """Arguments and options of a command that writes a folder."""

    designs: tuple[str, ...]
    out: Path
    assignments: tuple[str, ...]
    waivers: tuple[str, ...]
    as_json: bool

    @property
    def design(self) -> str:
        """The design, the first one of several."""
        return self.designs[0]


def run_options(is_several: bool = False) -> Callable[[Command], Command]:
    """Add DESIGN, or any number of them, and the options of a writing command, passed to it as a
    Request.
    """

    def add(command: Command) -> Command:
        @functools.wraps(command)
        def gathered(**parameters: Any) -> Any:
            request = Request(
                **{field.name: parameters.pop(field.name) for field in fields(Request)}
            )
            return command(request=request, **parameters)

        argument = click.argument(
            "designs",
            metavar="DESIGN..." if is_several else "DESIGN",
            nargs=-1 if is_several else 1,
            callback=lambda _, __, value: (value,) if isinstance(value, str) else value,
            required=True,
            shell_complete=designs,
        )
        waive = waive_option(WAIVE_HELP.get(command.__name__, WAIVE_CUT))
        decorated: Command = gathered
        for option in (json_option, waive, set_option, out_option, argument):
            decorated = option(decorated)
        return decorated

    return add


def sheet_options(command: Command) -> Command:
    """Add ``--copies``, which sets a key of the design."""

    @functools.wraps(command)
    def assigned(request: Request, copies: int | None, **parameters: Any) -> Any:
        keys = () if copies is None else (f"order.copies={copies}",)
        request = replace(request, assignments=(*request.assignments, *keys))
        return command(request=request, **parameters)

    count = click.option(
        "--copies",
        type=int,
        metavar="K",
        help="Cut K copies of each actuator.  [default: the design's order.copies, 1]",
    )
    return count(assigned)


def refuse_options(why: str, *names: str) -> None:
    """Raise UsageError, ending with ``why``, if one of these parameters is on the command line."""
    ctx = click.get_current_context()
    for param in ctx.command.params:
        if param.name in names and ctx.get_parameter_source(param.name) is _GIVEN:
            raise click.UsageError(f"{max(param.opts, key=len)} {why}")


def dxf_options(command: Command) -> Command:
    """Add ``--dxf-profile`` and ``--chord-error``, for readers that cannot read bulges."""
    chord = click.option(
        "--chord-error",
        type=FiniteRange(0.0001, 0.1),
        metavar="MM",
        help="Largest distance of a chord from its arc, with --dxf-profile chords.  "
        "[default: 0.005]",
    )
    profile = click.option(
        "--dxf-profile",
        type=click.Choice(get_args(DxfProfile)),
        default="bulges",
        help="Write arcs as polyline bulges, ARC entities or chords.",
    )

    @functools.wraps(command)
    def with_curves(dxf_profile: DxfProfile, chord_error: float | None, **parameters: Any) -> Any:
        if chord_error is not None and dxf_profile != "chords":
            raise click.UsageError("--chord-error goes with --dxf-profile chords; add it")
        curves = Curves(dxf_profile, chord_error or Curves().chord_error)
        return command(curves=curves, **parameters)

    return profile(chord(with_curves))
