"""Where air goes: the gaps between films, joined by the films' openings, from every inlet on.

A gap is all that is not bonded between two consecutive films, the plane around them included.
Masks seal nothing. An inlet is where the gap of the bottom pocket leaves the films; it is plugged,
and what can then be reached from it must be its own chamber and nothing else.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import shapely
from shapely import Polygon, box
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import bond_of
from tests.judge.folder import Folder, Interface, pieces, place

THINNEST = 0.004
PLUG = 0.05
"""mm of film that a plug takes the place of."""
OUTSIDE = ("outside",)
Node = tuple[object, ...]


class Void(NamedTuple):
    """A connected piece of what is open between two films, and its node in the graph."""

    node: Node
    region: Polygon
    is_pocket: bool = False


class Graph:
    """Nodes that air can go between."""

    def __init__(self) -> None:
        self._next: dict[Node, set[Node]] = defaultdict(set)

    def join(self, one: Node, other: Node) -> None:
        self._next[one].add(other)
        self._next[other].add(one)

    def reached(self, start: Node) -> set[Node]:
        found, left = {start}, [start]
        while left:
            for node in self._next[left.pop()] - found:
                found.add(node)
                left.append(node)
        return found


def judge_voids(folder: Folder) -> Iterator[str]:
    """From every inlet its own chamber's pockets are reached, and nothing else."""
    films = [film.profile for film in folder.films]
    plane = plane_round(films)
    bottom = next((i for i in folder.interfaces if i.is_chamber), None)
    if bottom is None:
        yield "no interface has a chamber mask"
        return
    mouths, plugs = _mouths(bottom)
    gaps = {i.number: _gaps(i, plane, plugs if i is bottom else None) for i in folder.interfaces}
    yield from _said(folder, joined(films, gaps, plane), gaps, mouths, bottom)


def _mouths(bottom: Interface) -> tuple[list[tuple[BaseGeometry, float]], BaseGeometry]:
    """Where the bottom pockets leave the films that both cover them, and how wide; the plugs."""
    contact = bottom.below.profile.intersection(bottom.above.profile)
    mask = shapely.union_all([m.profile for m in bottom.masks])
    whole = shapely.MultiPolygon([Polygon(part.exterior) for part in pieces(contact)])
    out = mask.difference(whole.buffer(THINNEST))
    mouths = []
    for part in pieces(out, 0.02):
        line = whole.boundary.intersection(part.buffer(2 * THINNEST)).intersection(mask)
        if line.length > 0.02:
            mouths.append((line, line.length))
    plugs = shapely.union_all([line.buffer(PLUG, cap_style="square") for line, _ in mouths])
    return mouths, plugs


def _gaps(interface: Interface, plane: Polygon, plugs: BaseGeometry | None) -> list[Void]:
    gap = plane.difference(bond_of(interface))
    if plugs is not None and not plugs.is_empty:
        gap = gap.difference(plugs)
    masks = shapely.union_all([mask.profile for mask in interface.masks])
    contact = interface.below.profile.intersection(interface.above.profile)
    found = []
    for number, part in enumerate(pieces(gap, THINNEST)):
        open_part = part.intersection(masks).intersection(contact)
        is_pocket = interface.is_chamber and any(pieces(open_part, 0.1))
        found.append(Void(("gap", interface.number, number), part, is_pocket))
    return found


def joined(
    films: Sequence[BaseGeometry], voids: Mapping[int, Sequence[Void]], plane: Polygon
) -> Graph:
    """Every opening of a film joins the voids below and above it; the outside lies round all.

    Films and the gaps above them count from 1 at the bottom.
    """
    graph = Graph()
    corner = shapely.Point(plane.exterior.coords[0]).buffer(1.0)
    for number, film in enumerate(films, start=1):
        beside = *voids.get(number - 1, ()), *voids.get(number, ())
        for place_number, opening in enumerate(pieces(plane.difference(film), THINNEST)):
            node = ("opening", number, place_number)
            if number in (1, len(films)) or opening.intersects(corner):
                graph.join(node, OUTSIDE)
            for void in beside:
                if any(pieces(void.region.intersection(opening), THINNEST)):
                    graph.join(node, void.node)
    return graph


def plane_round(regions: Sequence[BaseGeometry]) -> Polygon:
    low_x, low_y, high_x, high_y = shapely.union_all(regions).bounds
    return box(low_x - 5, low_y - 5, high_x + 5, high_y + 5)


def _said(
    folder: Folder,
    graph: Graph,
    gaps: dict[int, list[Void]],
    mouths: list[tuple[BaseGeometry, float]],
    bottom: Interface,
) -> Iterator[str]:
    pockets = {gap.node: gap for found in gaps.values() for gap in found if gap.is_pocket}
    chambers = _chambers(folder)
    wanted = {
        i.number: chambers.count if chambers.manifold and i is not bottom else 1
        for i in folder.interfaces
        if i.is_chamber
    }
    fed: dict[Node, list[str]] = defaultdict(list)
    count = 0
    for line, width in mouths:
        at = place(line)
        for gap in gaps[bottom.number]:
            if gap.is_pocket and gap.region.distance(line) < 2 * PLUG:
                count += 1
                reached = graph.reached(gap.node)
                yield from _tube(folder, width, at)
                yield from _from_inlet(reached, at, pockets, wanted)
                for node in reached & set(pockets):
                    fed[node].append(at)
    if count != (1 if chambers.manifold else chambers.count):
        yield f"{count} inlets lead into the bottom pockets"
    yield from _pockets(graph, pockets, fed)
    for number in wanted:
        found = sum(node[1] == number for node in pockets)
        meant = 1 if chambers.manifold and number == bottom.number else chambers.count
        if found != meant:
            yield f"{found} pockets at interface {number}, where {meant} were asked for"


def _from_inlet(
    reached: set[Node], at: str, pockets: dict[Node, Void], wanted: dict[int, int]
) -> Iterator[str]:
    """What an inlet reaches: as many pockets as wanted at every interface, and no way out."""
    if OUTSIDE in reached:
        yield f"the chamber of the inlet at {at} leaks to the outside"
        return
    for number, meant in wanted.items():
        own = sum(node[1] == number for node in reached & set(pockets))
        if own != meant:
            yield (
                f"from the inlet at {at} {own} pockets are reached at interface {number}, where "
                f"{meant} belong to its chamber"
            )


def _pockets(graph: Graph, pockets: dict[Node, Void], fed: dict[Node, list[str]]) -> Iterator[str]:
    for node, gap in pockets.items():
        if len(fed[node]) == 1:
            continue
        at = f"the pocket at interface {node[1]}, {place(gap.region)}"
        if fed[node]:
            yield f"inlets {' and '.join(fed[node])} both reach {at}"
        elif OUTSIDE in graph.reached(node):
            yield f"{at}, is open"
        else:
            yield f"no inlet reaches {at}"


class Chambers(NamedTuple):
    """How many pockets lie side by side, and whether one inlet feeds all."""

    count: int
    manifold: bool


def _chambers(folder: Folder) -> Chambers:
    family = folder.asked["family"]
    if family == "1dof":
        return Chambers(1, False)
    count = int(folder.wish("chamber", "count", 3))
    return Chambers(count, family == "radial" and bool(folder.wish("inlet", "manifold", False)))


def _tube(folder: Folder, width: float, at: str) -> Iterator[str]:
    """The inlet opens to half the tube's perimeter."""
    needed = math.pi * float(folder.wish("inlet", "tube_outer_diameter", 1.016)) / 2
    if width < needed - 2 * folder.slack:
        yield f"the inlet at {at} is {width:.4f} wide, and the tube takes {needed:.4f}"
