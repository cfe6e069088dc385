"""The catalogue of rules and checks, ``rules/sentences.toml``: explanations and messages."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, Literal, get_args

Group = Literal["rules", "assemblies", "folders", "netlists"]
"""What is checked: a design, the parts of an assembly, a folder of files, a separate netlist."""


@cache
def _tables() -> Mapping[str, Any]:
    file = resources.files("sbafab") / "rules" / "sentences.toml"
    return tomllib.loads(file.read_text(encoding="utf-8"))


def names(group: Group) -> tuple[str, ...]:
    """Return the names of the rules or checks of a group, in order; for rules, only our own."""
    return tuple(_tables()[group])


@cache
def catalogue() -> Mapping[str, Any]:
    """Return the tables of all rules and checks by name, in order, and the common words."""
    groups = (_tables()[group] for group in get_args(Group))
    return {"words": _tables()["words"]} | {k: v for group in groups for k, v in group.items()}
