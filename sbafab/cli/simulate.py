"""``sbafab simulate``: a real simulator run on the design, its results beside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sbafab.cli.exit import RULE_FAILED
from sbafab.cli.options import (
    LENGTH,
    PRESSURE,
    VOLUME,
    OfChamber,
    Request,
    by_chamber,
    finite,
    run_options,
)

if TYPE_CHECKING:
    from sbafab.simulators.simulator import Name, Result, Wish

SIMULATORS = ("calculix", "sofa", "mujoco")
"""As in ``sbafab.simulators.simulator``, whose imports would slow ``--help`` down."""
MOST_MINUTES = 10_000


@click.command()
@run_options
@click.option(
    "--with", "simulator", type=click.Choice(SIMULATORS), required=True, help="The simulator."
)
@click.option(
    "--pressure",
    type=PRESSURE.read,
    metavar="P",
    help='In every chamber, kPa or with a unit ("60 mbar").  [default: calculix 6, others 5]',
)
@click.option(
    "--chamber",
    "chambers",
    type=OfChamber(PRESSURE).read,
    callback=by_chamber,
    multiple=True,
    metavar="NAME=P",
    help="Pressure in one chamber; without --pressure the others have none. Repeatable.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0, MOST_MINUTES, min_open=True),
    callback=finite,
    default=120,
    show_default=True,
    help="Stop then, and keep what has been reached.",
)
@click.option("--export", is_flag=True, help="Write what the simulator reads, and run nothing.")
@click.option("--h", type=LENGTH.read, metavar="MM", help="calculix: mesh size.  [default: 0.35]")
@click.option(
    "--symmetry",
    type=click.Choice(["full", "half", "quarter", "sector"]),
    help="calculix: the part that is computed; only all of it wrinkles and bends as it likes."
    "  [default: full]",
)
@click.option(
    "--procedure",
    type=click.Choice(["dynamic", "static"]),
    help="calculix: static is faster, but ends where films wrinkle.  [default: dynamic]",
)
@click.option(
    "--scene",
    type=click.Choice(["shell", "frames", "volume", "beam"]),
    help="sofa: which of the scenes is run.  [default: shell]",
)
@click.option(
    "--seconds",
    type=float,
    metavar="S",
    help="sofa, mujoco: simulated time, for mujoco 2 at least.  [default: 8; 5]",
)
@click.option(
    "--volume",
    "volumes",
    type=OfChamber(VOLUME).read,
    callback=by_chamber,
    multiple=True,
    metavar="NAME=UL",
    help="sofa, scene volume: what a chamber is given above its start. Repeatable.",
)
def simulate(request: Request, simulator: Name, export: bool, **asked: Any) -> None:
    """Inflate a design in a simulator that is installed.

    Into OUT/<name>/calculix/ come stroke, air and wall stress against pressure as table and plot,
    the deformed shape as VTU and picture; into OUT/<name>/sofa/ or mujoco/ what it has read.
    result.json holds what each found over time. Exit code 1 if a run stopped early: what it
    reached is kept.
    """
    from sbafab.actuators import load_design
    from sbafab.cli.printing import Group, print_findings, print_json, shown_progress
    from sbafab.models.paper import BURST
    from sbafab.output.checked import checks
    from sbafab.runs.run import result_json
    from sbafab.runs.run import simulate as run
    from sbafab.simulators.simulator import Wish

    wish = Wish(**asked)
    _refuse_unused(simulator, wish)
    design = load_design(request.designs[0], request.assignments, request.waivers)
    with shown_progress(request.as_json) as tell:
        made = run(design, simulator, wish, request.out, tell, export)
    if made.folder is None:
        if request.as_json:
            print_json(checks(made.findings, "design", design.name))
        else:
            print_findings([Group(design.name, made.findings)])
        click.get_current_context().exit(RULE_FAILED)
    found = made.result
    if request.as_json:
        print_json({**result_json(found), "folder": str(made.folder)})
    else:
        _print(found, made.folder)
    most = max(wish.pressure or 0.0, *wish.chambers.values(), 0.0)
    if most > BURST.value:
        click.echo(
            f"sbafab: the paper's actuators burst at {BURST.value:g} kPa; no film tears or yields "
            f"in a simulation, so at {most:g} kPa it shows what will not be",
            err=True,
        )
    if found.stopped is not None:
        click.echo(f"sbafab: {found.stopped}", err=True)
        click.get_current_context().exit(RULE_FAILED)


def _refuse_unused(simulator: Name, wish: Wish) -> None:
    from sbafab.simulators.simulator import simulator as find
    from sbafab.simulators.simulator import users

    for name in wish.given:
        if name not in find(simulator).USES:
            option = "volume" if name == "volumes" else name
            raise click.UsageError(
                f"--{option} is for {' and '.join(users(name))}; leave it out with {simulator}"
            )


def _print(found: Result, target: Path) -> None:
    width = max((len(label) for label, _, _ in found.rows), default=0)
    for label, value, unit in found.rows:
        click.echo(f"{label:{width}} {value:10.3f} {unit}")
    click.echo(f"written to {target}")
