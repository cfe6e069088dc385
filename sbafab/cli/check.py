"""``sbafab check``: the rule deck on a design; nothing is written."""

from __future__ import annotations

import click

from sbafab.cli.options import design_argument, json_option, set_option, waive_option
from sbafab.cli.working import RULE_FAILED


@click.command()
@design_argument
@set_option
@waive_option
@json_option
def check(
    design: str, assignments: tuple[str, ...], waivers: tuple[str, ...], as_json: bool
) -> None:
    """Run the rule deck on a design; write nothing."""
    from sbafab.actuators import load_design
    from sbafab.cli.printing import console, findings_table, print_json
    from sbafab.output.manifest import checks
    from sbafab.output.run import check as run_check
    from sbafab.rules.deck import has_failed

    record = load_design(design, assignments, waivers)
    _, findings = run_check(record)
    if as_json:
        print_json(checks(findings, "design"))
    else:
        console().print(findings_table(findings))
    if has_failed(findings):
        click.get_current_context().exit(RULE_FAILED)
