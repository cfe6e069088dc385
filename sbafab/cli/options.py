"""Pressures, volumes and flows as people write them: ``6``, ``"60 mbar"``, ``5ul``.

What reads them is an option's ``type``.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from sbafab.design.pressure_units import KILOPASCALS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from sbafab.cutting.properties import DxfProfile

_WRITTEN = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


@dataclass(frozen=True)
class MeasuredQuantity:
    """A number with or without one of ``units``, whose sizes are in the first one's."""

    name: str
    units: dict[str, float]
    example: str

    def read(self, written: str) -> float:
        found = _WRITTEN.fullmatch(written)
        unit = found and (found[2] or next(iter(self.units)))
        if found is None or unit not in self.units:
            allowed = f"a {self.name} such as {self.example}; the units are {', '.join(self.units)}"
            raise click.BadParameter(f"{written!r} must be {allowed}")
        number = float(found[1]) * self.units[unit]
        if not math.isfinite(number):
            raise click.BadParameter(f"{written!r} must be a finite {self.name}")
        return number


LENGTH = MeasuredQuantity(
    "length", {"mm": 1.0, "um": 0.001, "cm": 10.0, "in": 25.4}, '0.35 or "350 um"'
)
PRESSURE = MeasuredQuantity("pressure", KILOPASCALS, '6, "6 kPa" or "60 mbar"')
MODULUS = MeasuredQuantity("modulus", {"MPa": 1.0, "kPa": 0.001, "GPa": 1000.0}, '10 or "10 MPa"')
VOLUME = MeasuredQuantity("volume", {"ul": 1.0, "ml": 1000.0, "mm3": 1.0}, '5, 5ul or "0.005 ml"')
FLOW = MeasuredQuantity(
    "flow",
    {"ml/min": 1.0, "ul/min": 0.001, "ml/s": 60.0, "l/min": 1000.0},
    '35, "35 ml/min" or "0.6 ml/s"',
)


@dataclass(frozen=True)
class OfChamber:
    """``NAME=QUANTITY``; where ``all_chambers``, also a quantity alone, with "" for the name."""

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
    """What was given by chamber: the callback of an option of several OfChamber."""
    found = dict(values)
    if len(found) < len(values):
        raise click.BadParameter("gives a chamber more than once", ctx, param)
    return found


# What a shell completes: templates and files, keys with their choices, rules.


def designs(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Templates by name, and files."""
    from sbafab.design.files import template_summaries

    found = [
        CompletionItem(name, help=said)
        for name, said in template_summaries().items()
        if name.startswith(typed)
    ]
    return [*found, CompletionItem(typed, type="file")]


designs_or_folders = designs
"""Files of a shell's own completion include folders."""


def templates(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """What ``sbafab new`` writes."""
    from sbafab.cli.new import COUPON, KIT
    from sbafab.design.files import template_summaries

    others = {COUPON: "the kerf's calibration piece", KIT: "films, tubes, press, laser, limits"}
    return _beginning(typed, (template_summaries() | others).items())


def rules(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """Rules and checks by name, with what they ask."""
    from sbafab.rules.explained import EXPLAINED

    return _beginning(typed, ((name, one.holds) for name, one in EXPLAINED.items()))


def assignments(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    """``KEY=`` for every key of a design; after it the values of a key that has a choice."""
    key, equals, _ = typed.partition("=")
    if not equals:
        return _beginning(typed, ((f"{name}=", None) for name in _keys()))
    return _beginning(typed, ((f"{key}={value}", None) for value in _choices(_keys().get(key))))


def _beginning(typed: str, known: Iterable[tuple[str, str | None]]) -> list[CompletionItem]:
    return [CompletionItem(name, help=said) for name, said in known if name.startswith(typed)]


def _keys() -> dict[str, object]:
    """Every key that holds a value, of any family, with its annotation."""
    from sbafab.actuators import records
    from sbafab.design.files import key_paths

    found: dict[str, object] = {}
    for record in records().values():
        found |= key_paths(record)
    tables = {path.rpartition(".")[0] for path in found}
    return {path: found[path] for path in sorted(found) if path not in tables}


def _choices(annotation: Any) -> Iterator[str]:
    """The values of a ``Literal``, and of a switch."""
    from typing import Literal, get_args, get_origin

    if annotation is bool:
        yield from ("true", "false")
    elif get_origin(annotation) is Literal:
        yield from map(str, get_args(annotation))


# Arguments and options that several commands share.


Command = Callable[..., Any]

_GIVEN = click.core.ParameterSource.COMMANDLINE

EXPERIMENTAL = "registration.experimental=true"


def set_option(command: Command) -> Command:
    """``--set`` and ``--experimental``, which sets a key too."""

    @functools.wraps(command)
    def assigned(assignments: tuple[str, ...], experimental: bool, **others: Any) -> Any:
        more = (EXPERIMENTAL,) if experimental else ()
        return command(assignments=(*assignments, *more), **others)

    keys = click.option(
        "--set",
        "assignments",
        metavar="KEY=VALUE",
        multiple=True,
        shell_complete=assignments,
        help="Override a key of the design, e.g. --set chamber.diameter=6. Repeatable.",
    )
    proposals = click.option(
        "--experimental",
        is_flag=True,
        help="Allow what no bench has tried: registered sheets. Sets registration.experimental.",
    )
    return keys(proposals(assigned))


def calibration_options(command: Command) -> Command:
    """What was measured of a built actuator, for the elastic models: ``models.figures.Factors``."""
    lost = click.option(
        "--pocket-loss",
        type=LENGTH.read,
        default="0 mm",
        metavar="L",
        help="By how much pockets come out smaller in radius than drawn, mm or with a unit, if "
        "measured; for the elastic models.  [default: 0]",
    )
    modulus = click.option(
        "--modulus",
        "modulus_mpa",
        type=MODULUS.read,
        metavar="E",
        help="Young's modulus of the film, MPa or with a unit, if measured.  [default: the film's]",
    )
    return lost(modulus(command))


def waive_option(words: str) -> Callable[[Command], Command]:
    """``--waive``, told in the words of the command that it stands in."""
    return click.option(
        "--waive",
        "waivers",
        metavar="RULE",
        multiple=True,
        shell_complete=rules,
        help=words,
    )


WAIVES = {
    "press": "Let the schedule be written although this rule fails; it will say so. Repeatable.",
    "mesh": "Let the meshes be written although this rule fails; the manifest will say so. "
    "Repeatable.",
    "predict": "Let the prediction be written although this rule fails, for an actuator that may "
    "not hold. Repeatable.",
    "sweep": "Take this rule's failure as accepted in every design; the tables say waived. "
    "Repeatable.",
    "simulate": "Simulate although this rule fails, an actuator that may not hold. Repeatable.",
}
CUT_ALL_THE_SAME = (
    "Let cut files be written although this rule fails; they will say so. Repeatable."
)

out_option = click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, readable=False),
    default=Path("out"),
    show_default=True,
    metavar="OUT",
    help="Folder that receives OUT/<name>/.",
)

json_option = click.option("--json", "as_json", is_flag=True, help="Print results for programs.")


@dataclass(frozen=True)
class Request:
    """What every command that writes a folder is asked for."""

    designs: tuple[str, ...]
    out: Path
    assignments: tuple[str, ...]
    waivers: tuple[str, ...]
    as_json: bool


def run_options(command: Command) -> Command:
    """DESIGN and the options of a writing command, handed over as one Request."""
    one = click.argument("designs", metavar="DESIGN", nargs=1, shell_complete=designs)
    return _requested(command, one)


def several_run_options(command: Command) -> Command:
    """The same with any number of designs."""
    several = click.argument(
        "designs",
        metavar="DESIGN...",
        nargs=-1,
        required=True,
        shell_complete=designs,
    )
    return _requested(command, several)


def _requested(command: Command, argument: Callable[[Command], Command]) -> Command:
    @functools.wraps(command)
    def gathered(
        designs: str | tuple[str, ...],
        out: Path,
        assignments: tuple[str, ...],
        waivers: tuple[str, ...],
        as_json: bool,
        **others: Any,
    ) -> Any:
        named = (designs,) if isinstance(designs, str) else designs
        return command(request=Request(named, out, assignments, waivers, as_json), **others)

    decorated: Command = gathered
    waive = waive_option(WAIVES.get(command.__name__, CUT_ALL_THE_SAME))
    for option in (json_option, waive, set_option, out_option, argument):
        decorated = option(decorated)
    return decorated


def sheet_options(command: Command) -> Command:
    """How many are cut, and what looks for places on film sheets; both are keys of a design."""

    @functools.wraps(command)
    def assigned(request: Request, copies: int | None, nest: str | None, **others: Any) -> Any:
        said = [] if copies is None else [f"order.copies={copies}"]
        said += [] if nest is None else [f"sheets.engine={nest}"]
        request = replace(request, assignments=(*request.assignments, *said))
        return command(request=request, **others)

    engine = click.option(
        "--nest",
        type=click.Choice(["bottom-left", "spyrrow"]),
        help="What looks for places on the film sheets [default: the design's sheets.engine].",
    )
    count = click.option(
        "--copies",
        type=int,
        metavar="K",
        help="Cut K of each actuator [default: the design's order.copies, 1].",
    )
    return count(engine(assigned))


def refuse_given(why: str, *names: str) -> None:
    """Raises UsageError, which ends with ``why``, for the first of these parameters on the line."""
    ctx = click.get_current_context()
    for param in ctx.command.params:
        if param.name in names and ctx.get_parameter_source(param.name) is _GIVEN:
            raise click.UsageError(f"{max(param.opts, key=len)} {why}")


def finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """A callback; a range lets nan through, which is neither below nor above."""
    if value is not None and not math.isfinite(value):
        raise click.BadParameter("must be a finite number", ctx, param)
    return value


def dxf_options(command: Command) -> Command:
    """How arcs are written, for readers that do not know bulges."""
    chord = click.option(
        "--chord-error",
        type=click.FloatRange(0.0001, 0.1),
        callback=finite,
        metavar="MM",
        help="Farthest a chord may leave its arc, with --dxf-profile chords.  [default: 0.005]",
    )
    profile = click.option(
        "--dxf-profile",
        type=click.Choice(["bulges", "arcs", "chords"]),
        default="bulges",
        show_default=True,
        help="Arcs as polyline bulges, as ARC entities, or as chords.",
    )

    @functools.wraps(command)
    def said(dxf_profile: DxfProfile, chord_error: float | None, **others: Any) -> Any:
        if chord_error is not None and dxf_profile != "chords":
            raise click.UsageError("--chord-error goes with --dxf-profile chords; add it")
        from sbafab.cutting.properties import Curves

        curves = Curves(dxf_profile)
        if chord_error is not None:
            curves = curves._replace(chord_error=chord_error)
        return command(curves=curves, **others)

    return profile(chord(said))
