"""``sbafab generate --target-yield``: what a yield needs to change, what it costs, and the run."""

from __future__ import annotations

from dataclasses import replace

from sbafab.cli.compare import print_figures, print_table
from sbafab.cli.exit import RULE_FAILED, Exit, end
from sbafab.cli.options import Request
from sbafab.cli.printing import print_line, print_wrapped
from sbafab.cli.progress import shown_progress
from sbafab.cli.run import print_run, run_json, run_request
from sbafab.design.files import changed_keys
from sbafab.design.records import Design
from sbafab.output.advice import reach_yield, value_of
from sbafab.runs.run import Run, RunRequest
from sbafab.search.compare import compare, value_text

DESIGNS = "as given", "changed"


def generate_for_yield(design: Design, target: float, wanted: RunRequest, request: Request) -> None:
    """Write the folder of a design changed for a yield; exits with 1 if none reaches it."""
    fixed = frozenset(changed_keys(request.assignments))
    with shown_progress(request.as_json) as progress:
        found = reach_yield(design, target, fixed, progress)
        if found.design is None:
            end(Exit("yield", found.sentence, RULE_FAILED), request.as_json)
        changed = found.design
        comparison = compare(design, changed, DESIGNS, progress=progress) if found.changes else None

    def show(run: Run) -> None:
        if comparison is not None:
            rows = [
                (key, value_text(value_of(design, key)), value_text(value))
                for key, value in found.changes.items()
            ]
            print_table("Changed for the yield", DESIGNS, rows)
            print_figures(comparison, DESIGNS)
        print_wrapped(found.sentence)
        print_line("")
        print_run(run)

    def as_json(run: Run) -> dict[str, object]:
        figures = comparison.as_dict()["figures"] if comparison is not None else []
        main = [figure for figure in figures if figure["main"]]
        return {**run_json(run), "yield": {**found.as_dict(), "figures": main}}

    run_request(replace(wanted, source=changed), request, show, as_json)
