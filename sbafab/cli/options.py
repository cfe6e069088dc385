"""Arguments and options that several commands share."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli import completing
from sbafab.cli.quantities import LENGTH, MODULUS

if TYPE_CHECKING:
    from sbafab.cutting.dxf_write import DxfProfile

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
        shell_complete=completing.assignments,
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
        shell_complete=completing.rules,
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
    one = click.argument("designs", metavar="DESIGN", nargs=1, shell_complete=completing.designs)
    return _requested(command, one)


def several_run_options(command: Command) -> Command:
    """The same with any number of designs."""
    several = click.argument(
        "designs",
        metavar="DESIGN...",
        nargs=-1,
        required=True,
        shell_complete=completing.designs,
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
        from sbafab.cutting.dxf_write import Curves

        curves = Curves(dxf_profile)
        if chord_error is not None:
            curves = curves._replace(chord_error=chord_error)
        return command(curves=curves, **others)

    return profile(chord(said))
