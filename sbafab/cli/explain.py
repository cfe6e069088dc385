"""``sbafab explain``: what a rule asks, why, and what to change."""

from __future__ import annotations

import click

from sbafab.cli.options import json_option, rules


@click.command()
@click.argument("rule", required=False, shell_complete=rules)
@json_option
def explain(rule: str | None, as_json: bool) -> None:
    """Say what a rule asks, why, and what to change.

    Without RULE: a line for every rule and check.
    """
    from sbafab.cli.printing import print_json
    from sbafab.output.schema_ids import EXPLAIN_SCHEMA, EXPLAINED_SCHEMA
    from sbafab.rules.explained import EXPLAINED

    if rule is None:
        if as_json:
            every = {name: one._asdict() for name, one in EXPLAINED.items()}
            print_json({"schema": EXPLAINED_SCHEMA, "rules": every})
            return
        width = max(map(len, EXPLAINED))
        for name, one in EXPLAINED.items():
            click.echo(f"{name:<{width}}  {one.holds}")
        return
    if rule not in EXPLAINED:
        import difflib

        near = difflib.get_close_matches(rule, EXPLAINED, 1)
        hint = f"did you mean {near[0]}?" if near else "sbafab explain lists them"
        raise click.BadParameter(f"{rule!r} is no rule; {hint}", param_hint="RULE")
    if as_json:
        print_json({"schema": EXPLAIN_SCHEMA, "rule": rule, **EXPLAINED[rule]._asdict()})
        return
    _print(rule)


def _print(rule: str) -> None:
    from rich.text import Text

    from sbafab.cli.printing import console, facts_table
    from sbafab.rules.explained import EXPLAINED

    one = EXPLAINED[rule]
    table = facts_table()
    for label, said in (
        ("rule", rule),
        ("holds when", one.holds),
        ("because", one.why),
        ("if it fails", one.mend),
        ("keys", ", ".join(one.keys) or "none"),
    ):
        table.add_row(label, Text(said))
    console().print(table)
