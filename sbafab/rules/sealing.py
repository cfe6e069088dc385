"""sealing: every inlet feeds all pockets of its own chamber and nothing else.

Also, every balloon is bonded to the film below it. The voids of the laminate form a graph, which is
searched from each inlet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, strip
from sbafab.geometry.width import Width
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.rules.boundary import middle
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.measures import Measures, distinct_interfaces, place_in
from sbafab.rules.narrow_voids import VoidEdges
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name, say
from sbafab.rules.voids import (
    OUTSIDE,
    Void,
    VoidGraph,
    chambers_by_level,
    mouth_of,
    past_mouth,
    void_graph,
)

NAME = "sealing"
CUT = 1e-4
"""mm: width of a cut across a void."""


def check(measures: Measures) -> list[Finding]:
    """Return the number of pockets that leak, meet another or are cut off, and loose films.

    If nets are declared, the rule nets judges how voids connect.
    """
    laminate, offences, count = measures.laminate, _loose_films(measures.laminate), 0
    if not laminate.nets:
        pockets = _Pockets.of(laminate)
        count = len(pockets.owners)
        offences = [*pockets.missing(), *pockets.wrong(), *offences]
        offences = offences or list(pockets.closing(measures.design))
    if not offences:
        sentence = "by-nets" if laminate.nets else "sealed"
        return [judged(NAME, True, 0.0, 0.0, "voids", Place(), sentence, count=count)]
    first, *further = offences
    says = say("sealing.more", first=first.says, more=len(further)) if further else first.says
    return [replace(first, measured=float(len(offences)), says=says)]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def _offence(sentence: str, interface: Interface | None, at: Point | None, **facts: Any) -> Finding:
    """Return the fault of one void."""
    index = None if interface is None else interface.index
    place = place_in(interface, at) if interface else Place()
    says = say(f"{NAME}.{sentence}", interface=index, at=at, **facts)
    return Finding(NAME, "fail", 0.0, 1.0, "voids", place, says)


class _Pockets(NamedTuple):
    """The void graph of a laminate, and the chambers that each pocket belongs to."""

    laminate: Laminate
    graph: VoidGraph
    owners: dict[Void, frozenset[str]]

    @classmethod
    def of(cls, laminate: Laminate) -> _Pockets:
        """Return the chambers whose centres each pocket holds; equal pockets are examined once."""
        names_by_id: dict[int, frozenset[str]] = {}
        by_level = chambers_by_level(laminate)
        pockets = cls(laminate, void_graph(laminate), {})
        for void, piece in pockets.graph.pieces.items():
            if void.kind == "pocket":
                # Equal interfaces have the very same pieces.
                if id(piece) not in names_by_id:
                    names_by_id[id(piece)] = frozenset(
                        name for name, p in _centres(laminate) if _holds(piece, p)
                    )
                pockets.owners[void] = names_by_id[id(piece)] & by_level[void.level]
        for interface in laminate.interfaces:
            if interface.kind == "chamber" and not interface.pressed:
                pockets.leave_to_innermost(interface.index)
        return pockets

    def leave_to_innermost(self, level: int) -> None:
        """Assign chambers between seams to the inner pocket; the void outside all is a flap.

        A closed seam divides the films around it into a pocket and a flap that holds no pressure.
        """
        pieces, owners = self.graph.pieces, self.owners
        taken: set[Point] = set()
        for void in sorted(
            (void for void in owners if void.level == level),
            key=lambda void: Region(pieces[void].outers).area,
        ):
            centres = {
                (name, p)
                for name, p in _centres(self.laminate)
                if name in owners[void] and _holds(pieces[void], p)
            }
            owners[void] = frozenset(name for name, p in centres if p not in taken)
            taken |= {p for _, p in centres}
            if not owners[void] and OUTSIDE in self.graph.joins.get(void, {}):
                del owners[void]

    def missing(self) -> Iterator[Finding]:
        """Yield the centres of chambers that lack a pocket in a balloon."""
        pockets: dict[tuple[int, str], list[Region]] = {}
        for void, names in self.owners.items():
            for name in names:
                pockets.setdefault((void.level, name), []).append(self.graph.pieces[void])
        levels = [gap for gap in self.laminate.interfaces if gap.kind == "chamber"]
        for balloon, interface in enumerate(levels, start=1):
            here = {chamber.name for chamber in self.laminate.chambers if chamber.is_in(balloon)}
            for name, p in _centres(self.laminate):
                pieces = pockets.get((interface.index, name), [])
                if name in here and not any(_holds(piece, p) for piece in pieces):
                    yield _offence(_seamed("no-pocket", interface), interface, p, chamber=name)
        count, balloons = len(levels), self.laminate.balloons
        if count != balloons:
            yield _offence("levels", None, None, levels=count, balloons=balloons)

    def wrong(self) -> list[Finding]:
        """Return the pockets that leak, reach another chamber, or are cut off."""
        laminate, graph, owners = self.laminate, self.graph, self.owners
        offences: dict[Void, Finding] = {}
        fed: set[Void] = set()
        for number, inlet in enumerate(laminate.inlets):
            came = graph.reached([mouth_of(number)])
            for void in came:
                if void in owners:
                    fed.add(void)
                    if owners[void] != {inlet.chamber} and void not in offences:
                        offences[void] = self.foreign(void, inlet.chamber, came)
        for chamber in laminate.chambers:
            voids = [void for void, names in owners.items() if names == {chamber.name}]
            came = graph.reached(void for void in voids if void in fed)
            if OUTSIDE in came:
                offences.setdefault(*self.leak(chamber.name, came))
        for void, names in owners.items():
            if void in fed or void in offences:
                continue
            came = graph.reached([void])
            if OUTSIDE in came and len(names) == 1:
                offences[void] = self.leak(next(iter(names)), came)[1]
            else:
                interface, p = laminate.interfaces[void.level - 1], middle(graph.pieces[void])
                sentence = _seamed("cut-off" if names else "stray", interface)
                offences[void] = _offence(sentence, interface, p, whose=sorted(names))
        return [offences[void] for void in sorted(offences, key=lambda void: void[1:])]

    def foreign(self, void: Void, inlet: str, came: Mapping[Void, Void | None]) -> Finding:
        before = came[void]
        assert before is not None
        p = self.graph.joins[before][void]
        if before.kind == "mouth" and len(self.graph.joins[before]) == 1:
            p = middle(self.graph.pieces[void])
        interface, whose = self.laminate.interfaces[void.level - 1], sorted(self.owners[void])
        return _offence("foreign", interface, p, inlet=inlet, whose=whose or "no chamber")

    def leak(self, chamber: str, came: dict[Void, Void | None]) -> tuple[Void, Finding]:
        """Return the pocket at which the path to the outside starts, and the fault at its exit."""
        path = [OUTSIDE]
        while (before := came[path[-1]]) is not None:
            path.append(before)
        path.reverse()
        # It leaves the chamber where it enters the outside or the slit between two balloons.
        step = next(i for i, void in enumerate(path) if void.kind in ("outside", "separator"))
        last, foreign = path[step - 1], path[step]
        p = self.graph.joins[last][foreign]
        pocket = next(void for void in reversed(path[:step]) if void.kind == "pocket")
        level = last.level if last.kind == "gap" else pocket.level
        if foreign.kind == "separator":
            outlet = say("sealing.into-slit", slit=foreign.level)
        elif last.kind == "opening":
            outlet = say("sealing.outside-at-layer", layer=last.level)
        else:
            outlet = say("sealing.outside-at-interface")
        facts = {"chamber": chamber, "outlet": outlet, "pocket": pocket.level}
        interface, sentence = self.laminate.interfaces[level - 1], "leak"
        wide = past_mouth(self.laminate, level, p) if last.kind == "pocket" else None
        if wide is not None:
            sentence, facts["wide"] = "leak-past-mouth", wide
        elif last.kind != "opening":
            sentence = _seamed("leak", interface)
        return pocket, _offence(sentence, interface, p, **facts)

    def closing(self, design: Design) -> Iterator[Finding]:
        """Yield a place of each pocket between seams that closes if they leave their paths."""
        for void, names in self.owners.items():
            interface, region = self.laminate.interfaces[void.level - 1], self.graph.pieces[void]
            edges = VoidEdges.of(interface, design)
            inside = [p for name, p in _centres(self.laminate) if name in names]
            inside += [
                inlet.mouth
                for number, inlet in enumerate(self.laminate.inlets)
                if inlet.chamber in names and mouth_of(number) in self.graph.joins[void]
            ]
            for place, remaining in edges.narrow_places(region) if edges.seams else ():
                if remaining.value > 0 or not _parts(region, place, inside):
                    continue
                facts = {"whose": [*names], "as_drawn": place.value, "edges": edges.causes()}
                yield _offence("closing", interface, place.middle, **facts)
                break


def _centres(laminate: Laminate) -> list[tuple[str, Point]]:
    """Return the centres of all chambers, each with its chamber's name."""
    return [(chamber.name, p) for chamber in laminate.chambers for p in chamber.centres]


def _holds(piece: Region, p: Point) -> bool:
    """Return True if ``p`` lies in the piece with its holes filled."""
    return any(outer.winding(p) != 0 for outer in piece.outers)


def _parts(region: Region, place: Width, inside: Sequence[Point]) -> bool:
    """Return True if points of a void lie on both sides of a cut across it."""
    (x, y), (u, v) = place.start, place.end
    dx, dy = (CUT * (u - x) / place.value, CUT * (v - y) / place.value)
    cut = strip((x - dx, y - dy), (u + dx, v + dy), CUT)
    parts = (region - cut).pieces

    def home(p: Point) -> int:
        off = [0.0 if _holds(part, p) else part.distance_to_edge(p) for part in parts]
        return off.index(min(off))

    return len({home(p) for p in inside}) > 1


def _loose_films(laminate: Laminate) -> list[Finding]:
    """Return pieces of film without a bond to the balloon or sheet below."""
    offences = []
    for distinct in distinct_interfaces(laminate):
        gap = distinct.interface
        pieces = gap.above.profile.pieces if gap.kind == "separator" else ()
        for piece in pieces:
            bond = gap.bond if len(pieces) == 1 else gap.bond & piece
            if bond.is_empty:
                sentence, name = _seamed("loose", gap), layer_name(gap.above)
                offences.append(_offence(sentence, gap, middle(piece), layer=name))
    return offences


def _seamed(sentence: str, interface: Interface) -> str:
    """Return the sentence for an interface that only seams bond."""
    return f"{sentence}-seamed" if interface.seams and not interface.pressed else sentence
