"""What the commands that write a folder do alike: load, run, print, choose the exit code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import Request

if TYPE_CHECKING:
    from sbafab.cutting.dxf_write import Curves
    from sbafab.design.records import Design
    from sbafab.output.planned import RunPart
    from sbafab.output.run import Extras

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
    from sbafab.cli.printing import print_json, print_run, run_json, shown_progress
    from sbafab.cutting.dxf_write import TRUE_ARCS
    from sbafab.output.run import NO_EXTRAS, generate

    with shown_progress(request.as_json) as progress:
        run = generate(
            design, request.out, parts, progress, curves or TRUE_ARCS, extras or NO_EXTRAS
        )
    if request.as_json:
        print_json(run_json(run))
    else:
        print_run(run)
    if run.failed:
        click.get_current_context().exit(RULE_FAILED)
