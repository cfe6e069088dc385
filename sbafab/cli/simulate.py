"""``sbafab simulate``: the exported deck run in a real simulator, its results beside it."""

from __future__ import annotations

import math
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import click

from sbafab.cli.options import Request, run_options
from sbafab.cli.working import RULE_FAILED

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Laminate
    from sbafab.output.run import Run
    from sbafab.output.shop import Progress

KILOPASCALS = {"Pa": 0.001, "kPa": 1.0, "MPa": 1000.0, "mbar": 0.1, "bar": 100.0, "psi": 6.894757}
MOST_MINUTES = 10_000


def _kilopascals(value: str) -> float:
    """A pressure from a number (kPa) or a text with a unit."""
    written = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([A-Za-z]*)\s*", value)
    try:
        if written is not None and math.isfinite(number := float(written[1])):
            return number * KILOPASCALS[written[2] or "kPa"]
    except (KeyError, ValueError):
        pass
    raise click.BadParameter(f'{value!r} must be a pressure such as 6, "6 kPa" or "60 mbar"')


def _pressure(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    return None if value is None else _kilopascals(value)


def _chambers(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, float]:
    found = {}
    for value in values:
        chamber, equals, pressure = value.partition("=")
        if not equals:
            raise click.BadParameter(f"{value!r} must be NAME=PRESSURE, such as chamber1=6")
        found[chamber.strip()] = _kilopascals(pressure)
    return found


class Wish(NamedTuple):
    """What a simulator is asked for: pressures in kPa, h in mm, time in minutes."""

    pressure: float | None
    chambers: Mapping[str, float]
    h: float
    symmetry: str
    procedure: str
    minutes: float


class Result(NamedTuple):
    """What a simulator found: lines to print, the same for programs, why it stopped early."""

    lines: tuple[str, ...]
    figures: dict[str, Any]
    stopped: str | None


def _calculix(laminate: Laminate, wish: Wish, folder: Path, tell: Progress) -> Result:
    from sbafab.meshing.conforming.settings import MeshSettings, Symmetry
    from sbafab.simulators.calculix.job import simulate as inflate
    from sbafab.simulators.calculix.settings import Procedure, deck_settings

    procedure = cast("Procedure", wish.procedure)
    settings = deck_settings(laminate, wish.pressure, wish.chambers, procedure)
    mesh = MeshSettings(h=wish.h, symmetry=cast("Symmetry", wish.symmetry))
    found = inflate(laminate, mesh, settings, folder, 60 * wish.minutes, tell)
    last = found.states[-1]
    lines = [f"{name:14} {value:8.3f} kPa" for name, value in last.pressures.items()]
    lines += [f"{'stroke':14} {last.stroke:8.3f} mm"]
    lines += [f"{'tilt':14} {last.tilt:8.2f} deg"] if last.tilt is not None else []
    lines += [f"{f'air {name}':14} {value:8.2f} ul" for name, value in last.volumes.items()]
    lines += [f"{'von Mises':14} {last.stress:8.3f} MPa at most"]
    states = [state.as_dict() for state in found.states]
    return Result(tuple(lines), {"states": states}, found.stopped)


SIMULATORS: dict[str, Callable[[Laminate, Wish, Path, Progress], Result]] = {"calculix": _calculix}
"""Each writes into the folder it is given, which becomes ``OUT/<name>/<simulator>/``."""


@click.command()
@run_options
@click.option(
    "--with", "simulator", type=click.Choice(list(SIMULATORS)), required=True, help="The simulator."
)
@click.option(
    "--pressure",
    callback=_pressure,
    metavar="P",
    help='Pressure in every chamber, kPa or with a unit ("60 mbar") [default: 6 kPa].',
)
@click.option(
    "--chamber",
    "chambers",
    callback=_chambers,
    multiple=True,
    metavar="NAME=P",
    help="Pressure in one chamber; without --pressure the others have none. Repeatable.",
)
@click.option("--h", type=float, default=0.35, show_default=True, metavar="MM", help="Mesh size.")
@click.option(
    "--symmetry",
    type=click.Choice(["full", "half", "quarter", "sector"]),
    default="full",
    show_default=True,
    help="The part that is computed; the whole is what can wrinkle and bend as it likes.",
)
@click.option(
    "--procedure",
    type=click.Choice(["dynamic", "static"]),
    default="dynamic",
    show_default=True,
    help="Static is faster, but ends where films wrinkle.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0, MOST_MINUTES, min_open=True),
    default=120,
    show_default=True,
    help="Stop then, and keep what has been reached.",
)
def simulate(request: Request, simulator: str, **asked: Any) -> None:
    """Inflate a design in a simulator that is installed, and read back what it says.

    calculix: stroke, air and wall stress against pressure as table and plot, deformed shape as VTU
    and picture, in OUT/<name>/calculix/. Exit code 1 if the run stopped before the full pressure.
    """
    from sbafab.actuators import load_design
    from sbafab.cli.printing import console, findings_table, print_json, shown_progress
    from sbafab.output.manifest import checks
    from sbafab.output.run import check, generate
    from sbafab.rules.deck import has_failed

    design = load_design(request.designs[0], request.assignments, request.waivers)
    wish = Wish(**asked)
    with shown_progress(request.as_json) as tell, tempfile.TemporaryDirectory() as place:
        laminate, findings = check(design, tell)
        if has_failed(findings):
            if request.as_json:
                print_json(checks(findings, "design"))
            else:
                console().print(findings_table(findings))
            click.get_current_context().exit(RULE_FAILED)
        found = SIMULATORS[simulator](laminate, wish, Path(place), tell)
        run = generate(design, request.out, (), tell)
        _put_in(run, Path(place), simulator)
    if request.as_json:
        folder = str(run.folder / simulator)
        print_json({"folder": folder, **found.figures, "stopped": found.stopped})
    else:
        click.echo("\n".join([*found.lines, f"written to {run.folder / simulator}"]))
    if found.stopped is not None:
        click.echo(f"sbafab: {found.stopped}", err=True)
        click.get_current_context().exit(RULE_FAILED)


def _put_in(run: Run, results: Path, name: str) -> None:
    """Puts a folder of results into a run's, in place of an older one, and into its manifest."""
    from sbafab.output.contents import close_folder
    from sbafab.output.swap import replaced_folder

    with replaced_folder(run.folder) as fresh:
        old = shutil.ignore_patterns("manifest.json")
        shutil.copytree(run.folder, fresh, ignore=old, dirs_exist_ok=True)
        shutil.rmtree(fresh / name, ignore_errors=True)
        shutil.copytree(results, fresh / name)
        close_folder(fresh, dict(run.manifest))
