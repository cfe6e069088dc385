"""What the commands that write a folder do alike: load, run, print, choose the exit code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import Request

if TYPE_CHECKING:
    from sbafab.cutting.dxf_write import Curves
    from sbafab.design.records import Design
    from sbafab.output.planned import RunPart
    from sbafab.output.run import Extras, Run

RULE_FAILED = 1


def run_parts(
    request: Request,
    parts: Sequence[RunPart],
    curves: Curves | None = None,
    extras: Extras | None = None,
) -> None:
    """Generates the parts of a design and exits with 1 if a rule failed."""
    from sbafab.actuators import load_design

    design = load_design(request.designs[0], request.assignments, request.waivers)
    run_design(design, request, parts, curves, extras)


def run_design(
    design: Design,
    request: Request,
    parts: Sequence[RunPart],
    curves: Curves | None,
    extras: Extras | None,
) -> None:
    """The same with a design that is loaded."""
    from sbafab.cli.printing import print_run, run_json, shown_progress
    from sbafab.cutting.dxf_write import TRUE_ARCS
    from sbafab.output.run import NO_EXTRAS, generate

    with shown_progress(request.as_json) as progress:
        run = generate(
            design, request.out, parts, progress, curves or TRUE_ARCS, extras or NO_EXTRAS
        )
    tell(run, request, run_json, print_run)


def tell(
    run: Run,
    request: Request,
    as_json: Callable[[Run], object],
    show: Callable[[Run], None],
) -> None:
    """Prints what a run made, for programs or people, and exits with 1 if a rule failed."""
    from sbafab.cli.printing import print_json

    if request.as_json:
        print_json(as_json(run))
    else:
        show(run)
    if run.failed:
        click.get_current_context().exit(RULE_FAILED)
