"""Actuator families by name: each module holds a family's design record and builds its laminate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel

from sbafab.actuators import drawn, lobed, one_dof, radial
from sbafab.actuators.fits import Fits, refuse_unfit
from sbafab.design.files import (
    FITS,
    Change,
    add_waivers,
    design_path,
    open_what_fits,
    override,
    read_toml,
    suggest_from_user_folder,
)
from sbafab.design.outline import understood
from sbafab.design.records import Design, validated
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate

Item = TypeVar("Item")


class Family(NamedTuple):
    """A family's design record, and the function that builds the laminate of a design."""

    record: type[Design]
    build: Callable[[Any], Laminate]


FAMILIES = {
    "1dof": Family(one_dof.OneDofDesign, one_dof.build),
    "lobed": Family(lobed.LobedDesign, lobed.build),
    "radial": Family(radial.RadialDesign, radial.build),
    "drawn": Family(drawn.DrawnDesign, drawn.build),
}
PLUGINS = "sbafab.families"
"""Entry points by which an installed package adds families, each a ``Family``."""


class _LazyMapping(Mapping[str, Item]):
    """A mapping that calls ``every`` only for names that are not ``here``, or for all names."""

    def __init__(self, here: Mapping[str, Item], every: Callable[[], Mapping[str, Item]]) -> None:
        self.here = here
        self.every = every

    def __getitem__(self, name: str) -> Item:
        return self.here[name] if name in self.here else self.every()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.every())

    def __len__(self) -> int:
        return len(self.every())


@cache
def _every() -> Mapping[str, Family]:
    """All families by name: those here, then those of installed packages.

    Raises DesignError where a package's family cannot be loaded or takes a name that is in use.
    """
    from importlib.metadata import entry_points

    families = dict(FAMILIES)
    for entry in sorted(entry_points(group=PLUGINS), key=lambda entry: entry.name):
        try:
            family = entry.load()
        except Exception as error:
            raise DesignError(
                f"family {entry.name} of the installed package {entry.value.partition(':')[0]} "
                f"cannot be loaded ({error}); repair or uninstall that package"
            ) from error
        if entry.name in families:
            raise DesignError(
                f"family {entry.name} is there already; uninstall one of the packages that add it"
            )
        families[entry.name] = family
    return families


def families() -> Mapping[str, Family]:
    """Return all families by name.

    Installed packages are searched only for a name that is not built in, or for all names: that may
    raise DesignError.
    """
    return _LazyMapping(FAMILIES, _every)


def records() -> Mapping[str, type[Design]]:
    """Return the design record of every family, likewise."""
    here = {name: family.record for name, family in FAMILIES.items()}
    return _LazyMapping(here, lambda: {name: family.record for name, family in _every().items()})


def load_design(
    source: str | Path, changes: Iterable[Change] = (), waivers: Sequence[str] = ()
) -> Design:
    """Return a design from a template's name or a TOML file, with changes made to its keys.

    ``waivers`` are rule names added to those that the file waives. Raises DesignError with one
    sentence where it cannot be built.
    """
    path = design_path(source)
    changes = list(changes)
    data = add_waivers(override(read_toml(path), changes), waivers)
    data.setdefault("name", path.stem)
    suggest_from_user_folder(data, changes)
    open_what_fits(data, changes)
    return validated(data, records(), path.parent)


def build(design: Design) -> Laminate:
    """Return the laminate of a design of any family. Raises DesignError where parts do not fit.

    Its notes state the size of a drawn outline, and that the actuator fits ``fits``.
    """
    laminate = families()[design.family].build(design)
    fits = getattr(design, FITS, None)
    room = refuse_unfit(design, fits, laminate) if isinstance(fits, Fits) else None
    if room is not None:
        laminate = replace(laminate, notes=(room, *laminate.notes))
    if design.drawing is None:
        return laminate

    note = understood(design.drawing).description
    return replace(laminate, notes=(note, *laminate.notes))


def schema(*more: type[BaseModel]) -> dict[str, Any]:
    """The JSON schema of a design file of any family, or of ``more`` records (draft 2020-12)."""
    from pydantic.json_schema import models_json_schema

    every = [*records().values(), *more]
    _, definitions = models_json_schema([(record, "validation") for record in every])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "sbafab design",
        "oneOf": [{"$ref": f"#/$defs/{record.__name__}"} for record in every],
        **definitions,
    }
