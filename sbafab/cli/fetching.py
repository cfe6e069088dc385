"""The commands by name, each imported when it is first asked for."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module

import click

from sbafab.cli.progress_line import add_verbosity

NAMES = (
    "templates",
    "new",
    "generate",
    "check",
    "explain",
    "cut",
    "press",
    "mesh",
    "nest",
    "kerf",
    "predict",
    "map",
    "picture",
    "simulate",
    "sweep",
    "find",
    "record",
    "reproduce",
    "studio",
    "schema",
)
"""In the order a newcomer needs them. A module has the name of its command."""
BUILTIN = {"map": "map_"}
"""Functions that cannot have the name of their command."""


class Fetched(MutableMapping[str, click.Command]):
    """What a group of commands is told: all names, and a command once its name is asked for."""

    def __init__(self) -> None:
        self._known: dict[str, click.Command | None] = dict.fromkeys(NAMES)

    def __getitem__(self, name: str) -> click.Command:
        found = self._known[name]
        if found is None:
            module = import_module(f"sbafab.cli.{name}")
            found = self._known[name] = getattr(module, BUILTIN.get(name, name))
            add_verbosity(found)
        return found

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._known[name] = command

    def __delitem__(self, name: str) -> None:
        del self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in self._known

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)
