"""The page of a design file's keys, as ``sbafab explain`` tells them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sbafab import actuators
from sbafab.api.explained import DesignKey, design_keys
from sbafab.assemblies.records import Assembly

HEAD = """# Keys of a design file

`sbafab explain KEY` prints the same, `sbafab schema` a JSON schema. Lengths are millimetres or carry a unit (`"0.75 mm"`,
`"38 um"`, `"6 in"`). Every key but `family` and `name` may be left out: the kit gives it, or it has the default below,
which is the paper's value where the paper gives one. `--set section.key=value` overrides a key on the command line.

To have an editor complete and check keys, save the schema (`sbafab schema > design.schema.json`) and begin a design
file with `#:schema ./design.schema.json`, which Taplo and its editor plug-ins read.
"""


def page(schema: Mapping[str, Any] | None = None) -> str:
    """Return the whole page, as MyST Markdown: a table for each section."""
    parts = [HEAD]
    rows = design_keys(schema or actuators.schema(Assembly))
    by_section: dict[str, list[DesignKey]] = {}
    for row in rows:
        section = row.key.partition(".")[0] if "." in row.key else "keys outside sections"
        by_section.setdefault(section, []).append(row)
    for section, keys in by_section.items():
        parts.append(
            f"\n## {section}\n\n| key | default | what it is | families |\n|---|---|---|---|"
        )
        parts += [
            f"| `{row.key}` | {_cell(row.default)} | {_cell(row.meaning)} *{_cell(row.allowed)}* "
            f"| {', '.join(row.families)} |"
            for row in keys
        ]
    return "\n".join(parts) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
