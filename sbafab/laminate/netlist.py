"""Netlists: intended connections, by name, compared with the connections through a laminate's
voids.

Read from JSON: this program's format (``sbafab/nets@1``), or the connections of a ParchMint file
(the exchange format of 3DuF and its benchmarks).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args

from sbafab.errors import DesignError
from sbafab.laminate.joints import Port, PortKind

SCHEMA = "sbafab/nets@1"
OTHER_LETTERS = re.compile("[^A-Za-z0-9._-]+")
"""Characters not allowed in the name of a port."""
VIA = "VIA"
"""Component that joins its layers."""
NO_MASK = "INTEGRATION"
"""Type of layers without channels, such as electrodes."""


@dataclass(frozen=True)
class Netlist:
    """Named nets, each with its port and chamber names, and ports with a position."""

    nets: Mapping[str, tuple[str, ...]]
    ports: tuple[Port, ...] = ()


class NetlistComparison(NamedTuple):
    """Matched nets, open nets, shorted pairs of nets, and missing names.

    A net with a missing name is neither open nor matched.
    """

    matched: tuple[str, ...]
    open: tuple[str, ...]
    shorted: tuple[tuple[str, str], ...]
    missing: tuple[str, ...]


def compare(
    groups: Iterable[frozenset[str]], nets: Mapping[str, Sequence[str]]
) -> NetlistComparison:
    """Compare nets with groups of connected ports; every port of a laminate is in a group.

    A port that no net names counts as a net of one port, with its name. A port in two groups, such
    as the inlet and pocket of a chamber, makes its net open.
    """
    home: dict[str, list[int]] = {}
    for number, part in enumerate(groups):
        for port in part:
            home.setdefault(port, []).append(number)
    named = dict.fromkeys(port for ports in nets.values() for port in ports)
    missing = tuple(port for port in named if port not in home)
    parts = {
        name: {n for port in ports for n in home.get(port, ())} for name, ports in nets.items()
    }
    broken = tuple(name for name in nets if len(parts[name]) > 1)
    alone = {port: set(home[port]) for port in sorted(home) if port not in named}
    owners: dict[int, list[str]] = {}
    for name, numbers in {**parts, **alone}.items():
        for number in sorted(numbers):
            owners.setdefault(number, []).append(name)
    pairs = ((first, other) for first, *others in owners.values() for other in others)
    shorted = tuple(dict.fromkeys(pairs))
    faulty = {*broken, *(name for pair in shorted for name in pair)}
    matched = tuple(
        name for name, ports in nets.items() if name not in faulty and not {*ports} & {*missing}
    )
    return NetlistComparison(matched, broken, shorted, missing)


# Files.


def read_netlist(path: Path) -> Netlist:
    """Return the netlist of a JSON file. Raises DesignError with file and place."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DesignError(f"{path} cannot be read as a netlist: {error}") from error
    if isinstance(document, dict) and document.get("schema") == SCHEMA:
        return _netlist(path, document)
    if isinstance(document, dict) and isinstance(document.get("connections"), list):
        try:
            return Netlist(parchmint_nets(document))
        except (LookupError, TypeError, AttributeError) as error:
            raise DesignError(
                f"{path} has connections unknown to ParchMint ({error!r}); each has a layer, "
                "and a source and sinks that name a component"
            ) from None
    raise DesignError(
        f'{path} is not a netlist; it is JSON with "schema": "{SCHEMA}" and "nets", or a ParchMint '
        'file with "connections"'
    )


def _netlist(path: Path, document: dict[str, Any]) -> Netlist:
    tables = document.get("nets")
    if not isinstance(tables, dict) or not tables:
        raise DesignError(f"{path}: nets must be an object with at least one named list")
    ports: dict[str, Port] = {}
    nets: dict[str, tuple[str, ...]] = {}
    home: dict[str, str] = {}
    for net, rows in tables.items():
        if not isinstance(rows, list) or not rows:
            raise DesignError(f"{path}: nets.{net} must be a list of at least one port")
        names = []
        for number, row in enumerate(rows):
            place = f"{path}: nets.{net}[{number}]"
            name, port = _member(place, row)
            if name in home:
                raise DesignError(
                    f"{place} names {name!r}, as does nets.{home[name]}; list each port once, in "
                    "one net"
                )
            home[name] = net
            names.append(name)
            if port is not None:
                ports[name] = port
        nets[net] = tuple(names)
    return Netlist(nets, tuple(ports.values()))


def _member(place: str, row: Any) -> tuple[str, Port | None]:
    """Return the name of a row, and its port if it states a position."""
    if isinstance(row, str):
        return row, None
    if not isinstance(row, dict) or not isinstance(row.get("name"), str):
        raise DesignError(f'{place} must be a name, or an object with "name"')
    if "at" not in row:
        return row["name"], None
    layers, at, kind = row.get("layers", []), row["at"], row.get("kind", "place")
    if not (_is_pair(layers, int) and _is_pair(at, int, float) and kind in get_args(PortKind)):
        raise DesignError(
            f'{place} must have "at": [x, y], "layers": [below, above] and, optionally, '
            f'"kind": {" or ".join(get_args(PortKind))}'
        )
    below, above = layers
    return row["name"], Port(row["name"], below, above, (float(at[0]), float(at[1])), kind)


def _is_pair(values: Any, *kinds: type) -> bool:
    return (
        isinstance(values, list)
        and len(values) == 2
        and all(isinstance(value, kinds) and not isinstance(value, bool) for value in values)
    )


def parchmint_nets(document: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the nets of a ParchMint document, as ``sbafab import`` names them.

    A component is a port on every layer, named by its id, and by the layer's name if it is on
    several. Connections join the components at their ends, on their layer; a VIA joins its layers.
    Components are joined only on such layers. A component without a size, such as a NODE where
    channels meet, joins them and is not a port.
    """
    labels = dict(parchmint_labels(document))
    titles, components = _titles(document), document.get("components", ())
    spots_of = [_spots(row, titles) for row in components]
    spots_here = {spot for spots in spots_of for spot in spots}
    near: dict[Spot, Spot] = {}
    for row, spots in zip(components, spots_of, strict=True):
        if str(row.get("entity", "")).upper() == VIA:
            _join(near, spots)
    for row in document["connections"]:
        spots = [(row.get("layer", ""), end["component"]) for end in (row["source"], *row["sinks"])]
        for spot in spots if not components else ():
            labels.setdefault(spot, _free_name(spot[1], labels.values()))
        _join(near, [spot for spot in spots if spot in spots_here or not components])
    groups: dict[Spot, list[str]] = {}
    for spot, label in labels.items():
        groups.setdefault(_root(near, spot), []).append(label)
    return {f"net{i}": tuple(members) for i, members in enumerate(groups.values(), start=1)}


def parchmint_labels(document: Mapping[str, Any]) -> dict[Spot, str]:
    """Return the port name of every component with a size, on each of its layers."""
    titles = _titles(document)
    labels: dict[Spot, str] = {}
    for row in document.get("components", ()):
        spots = _spots(row, titles)
        for spot in spots if row.get("x-span", 1) or row.get("y-span", 1) else ():
            text = f"{row['id']}-{titles[spot[0]]}" if len(spots) > 1 else row["id"]
            labels[spot] = _free_name(text, labels.values())
    return labels


def _titles(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the names of the layers with channels, by id."""
    return {
        row["id"]: row.get("name") or row["id"]
        for row in document.get("layers", ())
        if str(row.get("type", "")).upper() != NO_MASK
    }


def _spots(component: Mapping[str, Any], titles: Mapping[str, str]) -> list[Spot]:
    return [(layer, component["id"]) for layer in component["layers"] if layer in titles]


Spot = tuple[str, str]
"""A component on a layer: the ids of layer and component."""


def _join(near: dict[Spot, Spot], spots: Sequence[Spot]) -> None:
    for spot in spots[1:]:
        near[_root(near, spot)] = _root(near, spots[0])


def _root(near: Mapping[Spot, Spot], spot: Spot) -> Spot:
    while near.get(spot, spot) != spot:
        spot = near[spot]
    return spot


def _free_name(text: str, taken: Iterable[str]) -> str:
    stem = name = OTHER_LETTERS.sub("-", text).strip("-._")[:64] or "port"
    number, names = 1, set(taken)
    while name in names:
        number += 1
        name = f"{stem[:60]}-{number}"
    return name
