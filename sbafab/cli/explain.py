"""``sbafab explain``: a rule's criterion, its reason and its remedy."""

from __future__ import annotations

import click

from sbafab.cli.options import json_option
from sbafab.cli.options import rules as rule_names
from sbafab.cli.printing import print_facts, print_json
from sbafab.output.schema_ids import EXPLAIN_SCHEMA, EXPLAINED_SCHEMA
from sbafab.rules.explained import EXPLAINED


@click.command()
@click.argument("rule", required=False, shell_complete=rule_names)
@json_option
def explain(rule: str | None, as_json: bool) -> None:
    """Explain a rule: criterion, reason, remedy.

    Without RULE: list all rules and checks, a line each.
    """
    if rule is None:
        if as_json:
            rules = {name: explanation._asdict() for name, explanation in EXPLAINED.items()}
            print_json({"schema": EXPLAINED_SCHEMA, "rules": rules})
            return
        width = max(map(len, EXPLAINED))
        for name, explanation in EXPLAINED.items():
            click.echo(f"{name:<{width}}  {explanation.holds}")
        return
    if rule not in EXPLAINED:
        import difflib

        near = difflib.get_close_matches(rule, EXPLAINED, 1)
        hint = f"did you mean {near[0]}?" if near else "sbafab explain lists all rules"
        raise click.BadParameter(f"{rule!r} is not a rule; {hint}", param_hint="RULE")
    if as_json:
        print_json({"schema": EXPLAIN_SCHEMA, "rule": rule, **EXPLAINED[rule]._asdict()})
        return
    _print(rule)


def _print(rule: str) -> None:
    explanation = EXPLAINED[rule]
    print_facts(
        (
            ("rule", rule),
            ("passes when", explanation.holds),
            ("because", explanation.why),
            ("if it fails", explanation.mend),
            ("keys", ", ".join(explanation.keys) or "none"),
        )
    )
