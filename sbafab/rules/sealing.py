"""sealing: every inlet feeds the pockets of its own chamber, all of them, and nothing else.

Also, no balloon lies loose on the film below it. The voids of the laminate form a graph, which is
searched from each inlet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, strip
from sbafab.geometry.width import Width
from sbafab.laminate.laminate import Chamber, Interface, Laminate
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
    """Return the number of pockets that leak, reach another, are cut off or missing, and of loose
    films. If nets are declared, the rule nets judges how voids join.
    """
    laminate, offences, owners = measures.laminate, _loose_films(measures.laminate), {}
    if not laminate.nets:
        graph = void_graph(laminate)
        owners = _owners(laminate, graph)
        offences = [
            *_missing_pockets(laminate, graph, owners),
            *_wrong_reaches(laminate, graph, owners),
            *offences,
        ]
        offences = offences or list(_closing(laminate, graph, owners, measures.design))
    if not offences:
        sentence = "by-nets" if laminate.nets else "sealed"
        return [judged(NAME, True, 0.0, 0.0, "voids", Place(), sentence, count=len(owners))]
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


def _owners(laminate: Laminate, graph: VoidGraph) -> dict[Void, frozenset[str]]:
    """The chambers whose centres each pocket holds; equal pockets are examined once."""
    names_by_id: dict[int, frozenset[str]] = {}
    by_level = chambers_by_level(laminate)
    owners = {}
    for void, piece in graph.pieces.items():
        if void.kind == "pocket":
            # Equal interfaces have the very same pieces.
            if id(piece) not in names_by_id:
                names_by_id[id(piece)] = frozenset(
                    chamber.name
                    for chamber in laminate.chambers
                    if any(_holds(piece, centre) for centre in chamber.centres)
                )
            in_balloon = by_level[void.level]
            owners[void] = names_by_id[id(piece)] & in_balloon
    for interface in laminate.interfaces:
        if interface.kind == "chamber" and not interface.pressed:
            _leave_to_innermost(laminate, graph, owners, interface.index)
    return owners


def _leave_to_innermost(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]], level: int
) -> None:
    """Assign chambers between seams to the pocket inside; the void outside all seams is a flap.

    A closed seam divides the films round it into a pocket and a flap that holds no pressure.
    """
    voids = sorted(
        (void for void in owners if void.level == level),
        key=lambda void: Region(graph.pieces[void].outers).area,
    )
    taken: set[Point] = set()
    for void in voids:
        names = owners[void]
        centres = {
            (chamber.name, centre)
            for chamber in laminate.chambers
            for centre in chamber.centres
            if chamber.name in names and _holds(graph.pieces[void], centre)
        }
        owners[void] = frozenset(name for name, centre in centres if centre not in taken)
        taken |= {centre for _, centre in centres}
        if not owners[void] and OUTSIDE in graph.joins.get(void, {}):
            del owners[void]


def _holds(piece: Region, p: Point) -> bool:
    """Return True if ``p`` lies in the piece with its holes filled."""
    return any(outer.winding(p) != 0 for outer in piece.outers)


def _missing_pockets(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]]
) -> list[Finding]:
    """Centres of a chamber without a pocket in a balloon."""
    pockets: dict[tuple[int, str], list[Region]] = {}
    for void, names in owners.items():
        for name in names:
            pockets.setdefault((void.level, name), []).append(graph.pieces[void])
    offences = []
    levels = [interface for interface in laminate.interfaces if interface.kind == "chamber"]
    for balloon, interface in enumerate(levels, start=1):
        for chamber in laminate.chambers:
            if not chamber.is_in(balloon):
                continue
            pieces = pockets.get((interface.index, chamber.name), [])
            sentence = _seamed("no-pocket", interface)
            offences += [
                _offence(sentence, interface, centre, chamber=chamber.name)
                for centre in chamber.centres
                if not any(_holds(piece, centre) for piece in pieces)
            ]
    if len(levels) != laminate.balloons:
        count = len(levels)
        offences.append(_offence("levels", None, None, levels=count, balloons=laminate.balloons))
    return offences


def _wrong_reaches(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]]
) -> list[Finding]:
    offences: dict[Void, Finding] = {}
    fed: dict[Void, str] = {}
    for number, inlet in enumerate(laminate.inlets):
        came = graph.reached([mouth_of(number)])
        for void in came:
            if void in owners:
                fed[void] = inlet.chamber
                if owners[void] != {inlet.chamber} and void not in offences:
                    offences[void] = _foreign(
                        void, inlet.chamber, owners[void], laminate, graph, came
                    )
    for chamber in laminate.chambers:
        voids = [void for void, names in owners.items() if names == {chamber.name}]
        came = graph.reached(void for void in voids if void in fed)
        if OUTSIDE in came:
            leak = _leak(chamber, laminate, graph, came)
            offences.setdefault(leak[0], leak[1])
    for void, names in owners.items():
        if void not in fed and void not in offences:
            came = graph.reached([void])
            if OUTSIDE in came and len(names) == 1:
                chamber = next(c for c in laminate.chambers if c.name in names)
                offences[void] = _leak(chamber, laminate, graph, came)[1]
            else:
                interface = laminate.interfaces[void.level - 1]
                sentence, p = (
                    _seamed("cut-off" if names else "stray", interface),
                    graph.pieces[void],
                )
                offences[void] = _offence(sentence, interface, middle(p), whose=sorted(names))
    return [offences[void] for void in sorted(offences, key=lambda void: void[1:])]


def _foreign(
    void: Void,
    inlet: str,
    names: frozenset[str],
    laminate: Laminate,
    graph: VoidGraph,
    came: Mapping[Void, Void | None],
) -> Finding:
    before = came[void]
    assert before is not None
    p = graph.joins[before][void]
    if before.kind == "mouth" and len(graph.joins[before]) == 1:
        p = middle(graph.pieces[void])
    whose = sorted(names) or "no chamber"
    return _offence("foreign", laminate.interfaces[void.level - 1], p, inlet=inlet, whose=whose)


def _closing(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]], design: Design
) -> Iterator[Finding]:
    """Yield a place of each pocket between seams that parts it when these lie off their paths."""
    for void, names in owners.items():
        interface = laminate.interfaces[void.level - 1]
        edges = VoidEdges.of(interface, design)
        region = graph.pieces[void]
        inlets = [inlet for inlet in laminate.inlets if inlet.chamber in names]
        inside = [
            c for chamber in laminate.chambers if chamber.name in names for c in chamber.centres
        ]
        inside += [
            i.mouth for i in inlets if mouth_of(laminate.inlets.index(i)) in graph.joins[void]
        ]
        for place, remaining in edges.narrow_places(region) if edges.seams else ():
            if remaining.value > 0 or not _parts(region, place, inside):
                continue
            facts = {"whose": [*names], "as_drawn": place.value, "edges": edges.causes()}
            yield _offence("closing", interface, place.middle, **facts)
            break


def _parts(region: Region, place: Width, inside: Sequence[Point]) -> bool:
    """Return True if points of a void lie on both sides of a place across it."""
    (x, y), (u, v) = place.start, place.end
    dx, dy = (CUT * (u - x) / place.value, CUT * (v - y) / place.value)
    cut = strip((x - dx, y - dy), (u + dx, v + dy), CUT)
    parts = (region - cut).pieces

    def home(p: Point) -> int:
        off = [0.0 if _holds(part, p) else part.distance_to_edge(p) for part in parts]
        return off.index(min(off))

    homes = {home(p) for p in inside}
    return len(homes) > 1


def _loose_films(laminate: Laminate) -> list[Finding]:
    """Pieces of film that nothing bonds to the balloon or sheet below."""
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


def _leak(
    chamber: Chamber, laminate: Laminate, graph: VoidGraph, came: dict[Void, Void | None]
) -> tuple[Void, Finding]:
    """Pocket at which the path to the outside starts, and the fault where it leaves."""
    path = [OUTSIDE]
    while (before := came[path[-1]]) is not None:
        path.append(before)
    path.reverse()
    # The way leaves the chamber where it enters the outside or the slit between two balloons.
    step = next(i for i, void in enumerate(path) if void.kind in ("outside", "separator"))
    last, foreign = path[step - 1], path[step]
    p = graph.joins[last][foreign]
    pocket = next(void for void in reversed(path[:step]) if void.kind == "pocket")
    interface = last.level if last.kind == "gap" else pocket.level
    if foreign.kind == "separator":
        outlet = say("sealing.into-slit", slit=foreign.level)
    elif last.kind == "opening":
        outlet = say("sealing.outside-at-layer", layer=last.level)
    else:
        outlet = say("sealing.outside-at-interface")
    facts = {"chamber": chamber.name, "outlet": outlet, "pocket": pocket.level}
    sentence, wide = "leak", past_mouth(laminate, interface, p) if last.kind == "pocket" else None
    if wide is not None:
        sentence, facts["wide"] = "leak-past-mouth", wide
    elif last.kind != "opening":
        sentence = _seamed("leak", laminate.interfaces[interface - 1])
    return pocket, _offence(sentence, laminate.interfaces[interface - 1], p, **facts)


def _seamed(sentence: str, interface: Interface) -> str:
    """Return the sentence for an interface that seams alone bond."""
    return f"{sentence}-seamed" if interface.seams and not interface.pressed else sentence
