"""``sbafab simulate``: a run of an installed simulator, and its results."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from sbafab.actuators import load_design
from sbafab.api import runs as api
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.cli.exit import print_error
from sbafab.folders.checks_json import checks
from sbafab.folders.run import result_json
from sbafab.simulators.simulator import CHOICES, NAMES, Result, SimulationRequest

MOST_MINUTES = 10_000


@click.command()
@opt.run_options()
@opt.option("--with simulator", "Simulator.", NAMES, required=True)
@opt.option(
    "--pressure P",
    'Gauge pressure in all chambers, kPa or with a unit ("60 mbar"); a vacuum is negative and '
    "for calculix.  [default: calculix 6, others 5; of a design that works under a vacuum -6]",
    opt.PRESSURE,
)
@opt.option(
    "--chamber chambers NAME=P...",
    "Pressure in one chamber; the others have --pressure if given, else none.",
    opt.OfChamber(opt.PRESSURE),
)
@opt.option(
    "--minutes",
    "Time limit, minutes; results up to then are kept.",
    opt.FiniteRange(0, MOST_MINUTES, min_open=True),
    default=SimulationRequest.minutes,
)
@opt.option("--export", "Write the input files of the simulator without running it.", bool)
@opt.option("--h MM", "calculix: mesh size.  [default: 0.35]", opt.LENGTH)
@opt.option(
    "--symmetry",
    "calculix: part that is computed; only the full one wrinkles and bends freely."
    "  [default: full]",
    CHOICES["symmetry"],
)
@opt.option(
    "--procedure",
    "calculix: static is faster but stops when films wrinkle.  [default: dynamic]",
    CHOICES["procedure"],
)
@opt.option("--scene", "sofa: scene that is run.  [default: shell]", CHOICES["scene"])
@opt.option(
    "--seconds S",
    "sofa, mujoco: simulated time, s; for mujoco at least 2.  [default: sofa 8, mujoco 5]",
    float,
)
@opt.option(
    "--volume volumes NAME=UL...",
    "sofa, scene volume: volume added to a chamber.",
    opt.OfChamber(opt.VOLUME),
)
def simulate(request: opt.Request, simulator: str, **settings: Any) -> None:
    """Inflate a design in an installed simulator.

    OUT/<name>/calculix/ receives stroke, air volume and wall stress over pressure as table and
    plot, and the deformed shape as VTU and picture; OUT/<name>/sofa/ or mujoco/ the input files of
    the run. result.json holds height, tip, tilt and volumes over time. If a run stops early, its
    results are kept and the exit code is 1. A result that cannot be, such as air below 0, is void:
    the reason is printed, nothing is written, and the exit code is 1.
    """
    design = load_design(*request.source)
    with show.progress(request.as_json) as progress, _printed_warnings():
        simulation = api.simulate(
            design, simulator=simulator, out=request.out, progress=progress, **settings
        )
    if simulation.folder is None:
        if request.as_json:
            show.document(checks(simulation.findings, "design", design.name))
        else:
            show.findings({design.name: simulation.findings})
            show.failed(design.name, simulation.findings, "It was not simulated", "design")
        show.end_failed()
    result = simulation.result
    if request.as_json:
        show.document({**result_json(result), "folder": str(simulation.folder)})
    else:
        _print(design.name, result, simulation.folder)
    if simulation.beside:
        print_error(f"{simulation.beside}; the results were put into {simulation.folder}")
    if result is not None and result.stopped is not None:
        print_error(result.stopped)
        show.end_failed()


@contextmanager
def _printed_warnings() -> Iterator[None]:
    """Print warnings as sentences on standard error at once: a run may take hours after them."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: print_error(f"warning: {message}")
        yield


def _print(name: str, result: Result | None, folder: Path) -> None:
    if result is None:
        show.verdict(f"{name} exported. Written to {folder}", folder)
        return
    width = max(len(label) for label, _, _ in result.rows)
    for label, value, unit in result.rows:
        click.echo(f"{label:{width}} {value:10.3f} {unit}".rstrip())
    outcome = "simulated" if result.stopped is None else "failed: the simulation stopped early"
    show.verdict(f"{name} {outcome}. Written to {folder}", folder)
