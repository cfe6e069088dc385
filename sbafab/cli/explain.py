"""``sbafab explain``: a rule's criterion, reason and remedy; a design key; a quantity."""

from __future__ import annotations

from dataclasses import asdict

import click
from click.shell_completion import CompletionItem

from sbafab.api import explained as api
from sbafab.cli import options as opt
from sbafab.cli import show


def _completed(ctx: click.Context, param: click.Parameter, typed: str) -> list[CompletionItem]:
    return opt.completions(typed, ((name, None) for name in api.explainable_names()))


@click.command()
@click.argument("name", required=False, shell_complete=_completed)
@opt.json_option
def explain(name: str | None, as_json: bool) -> None:
    """Explain a rule, a key of design files, a quantity, or a flag of figures.

    Without NAME: list all rules and checks, one per line. A section such as chamber lists its keys.
    """
    if name is None:
        if as_json:
            show.document(api.ExplainedDocument.of(None, rules=api.EXPLAINED))
        else:
            show.names({rule: each.holds for rule, each in api.EXPLAINED.items()})
        return
    document = api.explained(name)
    if as_json:
        show.document(api.ExplainDocument.of(None, **document))
    elif "rule" in document:
        keys = ", ".join(document["keys"]) or "none"
        heads = {"rule": "rule", "holds": "passes when", "why": "because", "mend": "if it fails"}
        show.facts([*((head, document[key]) for key, head in heads.items()), ("keys", keys)])
    elif "term" in document:
        show.facts(document.items())
    elif "quantities" in document:
        for row in document["quantities"]:
            show.facts(
                [("quantity", row.written), ("unit", row.unit or "none"), ("meaning", row.meaning)]
            )
    elif any(row.key != name for row in document["keys"]):
        show.names({row.key: row.meaning for row in document["keys"]})
    else:
        for row in document["keys"]:
            show.facts({**asdict(row), "families": ", ".join(row.families)}.items())
