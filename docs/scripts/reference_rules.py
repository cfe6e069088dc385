"""The page of rules and checks: what each asks, with a picture of right and wrong."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from docs.scripts.rule_pictures import pair
from sbafab.assemblies.checks import CHECKS
from sbafab.catalogue import names
from sbafab.design.files import rule_names
from sbafab.rules.deck import EXPLAINED
from sbafab.rules.sentences import Explanation

HEAD = """# Rules in pictures

Every rule with a laminate that passes and one that fails, drawn from the tests; the sentence below is the rule's
message. TPE is blue, PTFE orange, a ring marks the place. `sbafab explain RULE` prints the same words. Measures and
limits: [rules and limits](../rules.md).
"""


def write(folder: Path) -> None:
    """The page, and two pictures a rule."""
    pictures = folder / "rules"
    pictures.mkdir()
    parts = [HEAD, "\n## On a design\n"]
    for name in rule_names():
        one = EXPLAINED[name]
        parts += [f"\n### {name}\n", _words(one)]
        drawn = pair(name)
        for which, text in (("right", drawn.right), ("wrong", drawn.wrong)):
            (pictures / f"{name}-{which}.svg").write_text(text, encoding="utf-8")
        parts += [_figure(name), f"> {_plain(drawn.said)}\n"]
    parts.append("\n## Between the parts of an assembly\n")
    parts += [_short(CHECKS)]
    parts.append("\n## On a folder\n\nThe rules above are run on what the files will cut, and:\n")
    parts += [_short(names("folders"))]
    (folder / "rules.md").write_text("\n".join(parts), encoding="utf-8")


def _words(one: Explanation) -> str:
    keys = ", ".join(f"`{key}`" for key in one.keys) or "none"
    return (
        f"Holds when {_plain(one.holds)}. {_plain(one.why)}\n\n"
        f"**If it fails:** {_plain(one.mend)}\n\n**Keys:** {keys}\n"
    )


def _figure(name: str) -> str:
    return (
        "| right | wrong |\n|---|---|\n"
        f"| ![{name} passes](rules/{name}-right.svg) | ![{name} fails](rules/{name}-wrong.svg) |\n"
    )


def _short(names: Iterable[str]) -> str:
    rows = "\n".join(
        f"| `{name}` | {_plain(one.holds)} | {_plain(one.why)} | {_plain(one.mend)} |"
        for name in names
        for one in [EXPLAINED[name]]
    )
    return f"| check | holds when | because | if it fails |\n|---|---|---|---|\n{rows}\n"


def _plain(text: str) -> str:
    return text.replace("<", "&lt;").replace("*", "\\*").replace("|", "\\|")
