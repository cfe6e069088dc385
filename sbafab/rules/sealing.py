"""sealing: every inlet feeds the pockets of its own chamber, all of them, and nothing else.

Also, no balloon lies loose on the film below it. The voids of the laminate form a graph, which is
searched from each inlet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, strip
from sbafab.geometry.width import Width
from sbafab.laminate.laminate import Chamber, Interface, Laminate
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import at
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Explanation, Rule
from sbafab.rules.void_edges import VoidEdges
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


class _Offence(NamedTuple):
    """A fault of one void."""

    message: str
    interface: int | None
    at: Point | None


def check(measures: Measures) -> list[Finding]:
    """The number of pockets that leak, reach another, are cut off or missing, and loose films."""
    laminate = measures.laminate
    if laminate.nets:
        return _judged_by_nets(laminate)
    graph = void_graph(laminate)
    owners = _owners(laminate, graph)
    offences = [
        *_missing_pockets(laminate, graph, owners),
        *_wrong_reaches(laminate, graph, owners),
        *_loose_films(laminate),
    ]
    offences = offences or list(_closing(laminate, graph, owners, measures.design))
    if not offences:
        pockets = "1 pocket" if len(owners) == 1 else f"{len(owners)} pockets"
        message = f"{pockets} sealed, each reached from the inlet of its own chamber alone"
        return [Finding(NAME, "pass", 0.0, 0.0, "voids", Place(), message)]
    return [_failed(offences, laminate)]


def _judged_by_nets(laminate: Laminate) -> list[Finding]:
    """If nets are declared, the rule nets judges how voids join; loose films stay a fault."""
    offences = _loose_films(laminate)
    if offences:
        return [_failed(offences, laminate)]
    message = "no film is loose; what the voids join is judged by nets"
    return [Finding(NAME, "pass", 0.0, 0.0, "voids", Place(), message)]


def _failed(offences: Sequence[_Offence], laminate: Laminate) -> Finding:
    first = offences[0]
    layers: tuple[int, ...] = ()
    if first.interface is not None:
        layers = laminate.interfaces[first.interface - 1].layer_indices
    x, y = first.at or (None, None)
    message = first.message
    if len(offences) > 1:
        message += f" (and {len(offences) - 1} more)"
    place = Place(first.interface, layers, x, y)
    return Finding(NAME, "fail", 0.0, float(len(offences)), "voids", place, message)


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every pocket is reached from its own chamber's inlet and from nowhere else",
        "A pocket that opens elsewhere leaks; one that is cut off never inflates. Channels between "
        "seams must stay open when these lie off their paths by registration.seam_error.",
        "Look at the place named: an opening too near another, a mask that crosses a bond, or a "
        "seam with a gap.",
        ("bore.diameter", "lumen.diameter", "inlet.width", "registration.seam_error"),
    ),
    at_most=True,
)


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

    A closed seam parts the films round it in two: a pocket, and a flap that holds no pressure.
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
) -> list[_Offence]:
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
            for centre in chamber.centres:
                if not any(_holds(piece, centre) for piece in pieces):
                    remedy = "add its disc to the mask there"
                    if _is_seamed(interface):
                        remedy = "move the path of the seam off it, so that it goes round it"
                    message = (
                        f"{chamber.name} has no pocket at chamber interface {interface.index} "
                        f"({at(centre)}); {remedy}"
                    )
                    offences.append(_Offence(message, interface.index, centre))
    if len(levels) != laminate.balloons:
        message = (
            f"the laminate has {len(levels)} chamber interfaces for {laminate.balloons} balloons; "
            "each balloon needs one chamber mask between two films"
        )
        offences.append(_Offence(message, None, None))
    return offences


def _wrong_reaches(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]]
) -> list[_Offence]:
    offences: dict[Void, _Offence] = {}
    fed: dict[Void, str] = {}
    for number, inlet in enumerate(laminate.inlets):
        came = graph.reached([mouth_of(number)])
        for void in came:
            if void in owners:
                fed[void] = inlet.chamber
                if owners[void] != {inlet.chamber} and void not in offences:
                    offences[void] = _foreign(void, inlet.chamber, owners[void], graph, came)
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
                offences[void] = _cut_off(void, names, laminate, graph)
    return [offences[void] for void in sorted(offences, key=lambda void: void[1:])]


def _foreign(
    void: Void,
    inlet: str,
    names: frozenset[str],
    graph: VoidGraph,
    came: dict[Void, Void | None],
) -> _Offence:
    whose = " and ".join(sorted(names)) or "no chamber"
    before = came[void]
    assert before is not None
    p = graph.joins[before][void]
    if before.kind == "mouth" and len(graph.joins[before]) == 1:
        p = _somewhere(graph.pieces[void])
    message = (
        f"the inlet of {inlet} feeds a pocket of {whose} at chamber interface {void.level} "
        f"({at(p)}); separate them by a bond there"
    )
    return _Offence(message, void.level, p)


def _closing(
    laminate: Laminate, graph: VoidGraph, owners: dict[Void, frozenset[str]], design: Design
) -> Iterator[_Offence]:
    """Yield a place of each pocket between seams that parts it when these lie off their paths."""
    for void, names in owners.items():
        interface = laminate.interfaces[void.level - 1]
        edges = VoidEdges.of(interface, design)
        region = graph.pieces[void]
        inlets = [inlet for inlet in laminate.inlets if inlet.chamber in names]
        held = [
            c for chamber in laminate.chambers if chamber.name in names for c in chamber.centres
        ]
        held += [i.mouth for i in inlets if mouth_of(laminate.inlets.index(i)) in graph.joins[void]]
        for place, left in edges.narrow_places(region) if edges.seams else ():
            if left.value > 0 or not _parts(region, place, held):
                continue
            message = (
                f"{' and '.join(names)} may be parted at chamber interface {void.level} "
                f"({at(place.middle)}): seams leave {place.value:.3f} mm there, and nothing at "
                f"worst ({edges.words()}); lay them farther apart, or state a smaller "
                "registration.seam_error that the tool keeps"
            )
            yield _Offence(message, void.level, place.middle)
            break


def _parts(region: Region, place: Width, held: Sequence[Point]) -> bool:
    """Return True if points of a void lie on both sides of a place across it."""
    (x, y), (u, v) = place.start, place.end
    dx, dy = (CUT * (u - x) / place.value, CUT * (v - y) / place.value)
    cut = strip((x - dx, y - dy), (u + dx, v + dy), CUT)
    parts = (region - cut).pieces

    def home(p: Point) -> int:
        off = [0.0 if _holds(part, p) else part.distance_to_edge(p) for part in parts]
        return off.index(min(off))

    homes = {home(p) for p in held}
    return len(homes) > 1


def _loose_films(laminate: Laminate) -> list[_Offence]:
    """Pieces of film that nothing bonds to the balloon or sheet below."""
    offences = []
    for distinct in distinct_interfaces(laminate):
        gap = distinct.interface
        pieces = gap.above.profile.pieces if gap.kind == "separator" else ()
        for piece in pieces:
            bond = gap.bond if len(pieces) == 1 else gap.bond & piece
            if bond.is_empty:
                p = _somewhere(piece)
                remedy = f"open the mask at interface {gap.index} there"
                if _is_seamed(gap):
                    remedy = "move the path of a seam onto it"
                message = (
                    f"the film of layer {gap.above.index} ({gap.above.name}) at {at(p)} is bonded "
                    f"to nothing below it; {remedy}"
                )
                offences.append(_Offence(message, gap.index, p))
    return offences


def _leak(
    chamber: Chamber, laminate: Laminate, graph: VoidGraph, came: dict[Void, Void | None]
) -> tuple[Void, _Offence]:
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
    where = f"layer {last.level}" if last.kind == "opening" else f"interface {interface}"
    if foreign.kind == "separator":
        outlet = f"into the slit between two balloons at interface {foreign.level}"
    else:
        outlet = f"to the outside at {where}"
    remedy = "close the opening or bond round it"
    if last.kind != "opening" and _is_seamed(laminate.interfaces[interface - 1]):
        remedy = "close the path of the seam there, make it wider, or move it onto both films"
    message = (
        f"{chamber.name} leaks {outlet} ({at(p)}), from its pocket at chamber interface "
        f"{pocket.level}; {remedy}"
    )
    wide = past_mouth(laminate, interface, p) if last.kind == "pocket" else None
    if wide is not None:
        message = f"{chamber.name} leaks {outlet} ({at(p)}): {wide}"
    return pocket, _Offence(message, interface, p)


def _cut_off(void: Void, names: frozenset[str], laminate: Laminate, graph: VoidGraph) -> _Offence:
    p = _somewhere(graph.pieces[void])
    where = f"at chamber interface {void.level} ({at(p)})"
    if names:
        whose = f"the pocket of {' and '.join(sorted(names))}"
        remedy = "open a bore or a strip to it"
        if _is_seamed(laminate.interfaces[void.level - 1]):
            remedy = "open the path of the seam toward the mouth"
        message = f"{whose} {where} is reached from no inlet; {remedy}"
    else:
        remedy = "remove that part of the mask"
        if _is_seamed(laminate.interfaces[void.level - 1]):
            remedy = "make the seam there wider, or move its path, so that it bonds there"
        message = f"a pocket of no chamber lies {where}; {remedy}"
    return _Offence(message, void.level, p)


def _is_seamed(interface: Interface) -> bool:
    """Return True if seams alone bond, so that masks do not decide which areas are open."""
    return bool(interface.seams) and not interface.pressed


def _somewhere(piece: Region) -> Point:
    low_x, low_y, high_x, high_y = piece.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2
