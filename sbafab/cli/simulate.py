"""``sbafab simulate``: a run of an installed simulator, and its results."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.cli.exit import RULE_FAILED, print_error
from sbafab.cli.options import (
    LENGTH,
    PRESSURE,
    VOLUME,
    FiniteRange,
    OfChamber,
    Request,
    by_chamber,
    run_options,
)
from sbafab.cli.printing import (
    FindingGroup,
    print_failed,
    print_findings,
    print_json,
    print_verdict,
)
from sbafab.cli.progress import shown_progress
from sbafab.folders.checks import checks
from sbafab.folders.run import result_json
from sbafab.folders.run import simulate as run
from sbafab.simulators.simulator import CHOICES, NAMES, Name, Result, SimulationRequest

MOST_MINUTES = 10_000


@click.command()
@run_options()
@click.option("--with", "simulator", type=click.Choice(NAMES), required=True, help="Simulator.")
@click.option(
    "--pressure",
    type=PRESSURE.read,
    metavar="P",
    help='Gauge pressure in all chambers, kPa or with a unit ("60 mbar"); a vacuum is negative and '
    "for calculix.  [default: calculix 6, others 5; of a design that works under a vacuum -6]",
)
@click.option(
    "--chamber",
    "chambers",
    type=OfChamber(PRESSURE).read,
    callback=by_chamber,
    multiple=True,
    metavar="NAME=P",
    help="Pressure in one chamber; the others have --pressure if given, else none. Repeatable.",
)
@click.option(
    "--minutes",
    type=FiniteRange(0, MOST_MINUTES, min_open=True),
    default=120,
    help="Time limit, minutes; results up to then are kept.",
)
@click.option(
    "--export", is_flag=True, help="Write the input files of the simulator without running it."
)
@click.option("--h", type=LENGTH.read, metavar="MM", help="calculix: mesh size.  [default: 0.35]")
@click.option(
    "--symmetry",
    type=click.Choice(CHOICES["symmetry"]),
    help="calculix: part that is computed; only the full one wrinkles and bends freely."
    "  [default: full]",
)
@click.option(
    "--procedure",
    type=click.Choice(CHOICES["procedure"]),
    help="calculix: static is faster but stops when films wrinkle.  [default: dynamic]",
)
@click.option(
    "--scene",
    type=click.Choice(CHOICES["scene"]),
    help="sofa: scene that is run.  [default: shell]",
)
@click.option(
    "--seconds",
    type=float,
    metavar="S",
    help="sofa, mujoco: simulated time, s; for mujoco at least 2.  [default: sofa 8, mujoco 5]",
)
@click.option(
    "--volume",
    "volumes",
    type=OfChamber(VOLUME).read,
    callback=by_chamber,
    multiple=True,
    metavar="NAME=UL",
    help="sofa, scene volume: volume added to a chamber. Repeatable.",
)
def simulate(request: Request, simulator: Name, export: bool, **settings: Any) -> None:
    """Inflate a design in an installed simulator.

    OUT/<name>/calculix/ receives stroke, air volume and wall stress over pressure as table and
    plot, and the deformed shape as VTU and picture; OUT/<name>/sofa/ or mujoco/ the input files of
    the run. result.json holds height, tip, tilt and volumes over time. If a run stops early, its
    results are kept and the exit code is 1. A result that cannot be, such as air below 0, is void:
    the reason is printed, nothing is written, and the exit code is 1.
    """
    wanted = SimulationRequest(**settings)
    design = load_design(request.design, request.assignments, request.waivers)
    with shown_progress(request.as_json) as progress, _printed_warnings():
        simulation = run(design, simulator, wanted, request.out, progress, export)
    if simulation.folder is None:
        if request.as_json:
            print_json(checks(simulation.findings, "design", design.name))
        else:
            print_findings([FindingGroup(design.name, simulation.findings)])
            print_failed(design.name, simulation.findings, "It was not simulated", "design")
        click.get_current_context().exit(RULE_FAILED)
    result = simulation.result
    if request.as_json:
        print_json({**result_json(result), "folder": str(simulation.folder)})
    else:
        _print(design.name, result, simulation.folder)
    if simulation.beside:
        print_error(f"{simulation.beside}; the results were put into {simulation.folder}")
    if result is not None and result.stopped is not None:
        print_error(result.stopped)
        click.get_current_context().exit(RULE_FAILED)


@contextmanager
def _printed_warnings() -> Iterator[None]:
    """Print warnings as sentences on standard error at once: a run may take hours after them."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: print_error(f"warning: {message}")
        yield


def _print(name: str, result: Result | None, folder: Path) -> None:
    if result is None:
        print_verdict(f"{name} exported. Written to {folder}", folder)
        return
    width = max(len(label) for label, _, _ in result.rows)
    for label, value, unit in result.rows:
        click.echo(f"{label:{width}} {value:10.3f} {unit}".rstrip())
    outcome = "simulated" if result.stopped is None else "failed: the simulation stopped early"
    print_verdict(f"{name} {outcome}. Written to {folder}", folder)
