"""Extensions of packages, by name: the program's own entries and, by entry points, those of other
packages.

Both are entries, ``module:attribute``, and are loaded by one function. The program's own are in its
source and not in the metadata of its installation, so that a checkout, a page in the browser or an
outdated installation has all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

FAMILIES, RULES, SIMULATORS = "sbafab.families", "sbafab.rules", "sbafab.simulators"
IMPORTERS, MESH_FORMATS, ARTEFACTS = "sbafab.importers", "sbafab.mesh_formats", "sbafab.artefacts"
"""Groups of entry points, which are an interface: docs/plugins.md describes them."""
Kind = TypeVar("Kind")


@cache
def _every() -> Any:
    """Return the entry points of all installed packages: a search among many takes 0.03 s."""
    from importlib.metadata import entry_points

    return entry_points()


@cache
def installed(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group in all installed packages, by name."""
    return tuple(sorted(_every().select(group=group), key=lambda entry: (entry.name, entry.value)))


def load(entry: str) -> Any:
    """Return the object of an entry: ``module:attribute``, or a module."""
    name, _, attribute = entry.partition(":")
    module = import_module(name)
    return getattr(module, attribute) if attribute else module


class Plugins(Mapping[str, Kind], Generic[Kind]):
    """The named entries of a group: the program's ``own``, then those of installed packages.

    An entry is loaded on demand, and packages are searched only for a name that is not ours, or for
    all names. ``noun`` is the word for an entry in messages. Raises DesignError if a package's
    entry cannot be loaded, is not a ``kind``, or uses an existing name.
    """

    def __init__(self, group: str, noun: str, kind: type[Kind], own: Mapping[str, str]) -> None:
        self.group, self.noun, self.kind, self.own = group, noun, kind, own
        self._loaded: dict[str, Kind] = {}

    def __getitem__(self, name: str) -> Kind:
        if name not in self._loaded:
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.own, *self._added))

    def __len__(self) -> int:
        return len(self.own) + len(self._added)

    @property
    def _added(self) -> dict[str, EntryPoint]:
        """Return the entries of installed packages by name."""
        added: dict[str, EntryPoint] = {}
        for entry in installed(self.group):
            if entry.name in self.own or entry.name in added:
                raise DesignError(
                    f"{self.noun} {entry.name} already exists; uninstall one of the packages "
                    "that add it"
                )
            added[entry.name] = entry
        return added

    def _load(self, name: str) -> Kind:
        if name in self.own:
            own: Kind = load(self.own[name])
            return own
        entry = self._added[name]
        try:
            value = entry.load()
            if not isinstance(value, self.kind):
                raise TypeError(f"{entry.value} is not a {self.kind.__name__}")
        except Exception as error:
            raise DesignError(
                f"{self.noun} {name} of the installed package {entry.module.partition('.')[0]} "
                f"cannot be loaded ({error}); repair or uninstall that package"
            ) from error
        return value


def added(group: str, noun: str, kind: type[Kind], own: Iterable[str] = ()) -> tuple[Kind, ...]:
    """The additions of installed packages to a table, whose ``own`` rows have these names."""
    rows = Plugins(group, noun, kind, dict.fromkeys(own, ""))
    return tuple(rows[name] for name in rows if name not in rows.own)
