"""sealing: every inlet feeds the pockets of its own chamber, all of them, and nothing else.

Also, no balloon lies loose on the film below it. The voids of the laminate form a graph, which is
searched from each inlet.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from sbafab.geometry.boolean import alone, turned_round
from sbafab.geometry.cache import cached
from sbafab.geometry.contour import in_reading_order, tidy
from sbafab.geometry.edges import Arc, Bounds, Edge, Point
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Region, rectangle
from sbafab.laminate.laminate import Chamber, Inlet, Interface, Laminate
from sbafab.rules.boundary import beside, edges_along
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, at
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Explanation, Rule

NAME = "sealing"


class _Offence(NamedTuple):
    """A fault of one void."""

    message: str
    interface: int | None
    at: Point | None


def check(measures: Measures) -> list[Finding]:
    """The number of pockets that leak, reach another, are cut off or missing, and loose films."""
    laminate = measures.laminate
    graph = void_graph(laminate)
    owners = _owners(laminate, graph)
    offences = [
        *_missing_pockets(laminate, graph, owners),
        *_wrong_reaches(laminate, graph, owners),
        *_loose_films(laminate),
    ]
    if not offences:
        pockets = "1 pocket" if len(owners) == 1 else f"{len(owners)} pockets"
        message = f"{pockets} sealed, each reached from the inlet of its own chamber alone"
        return [Finding(NAME, "pass", 0.0, 0.0, "voids", Place(), message)]
    first = offences[0]
    layers: tuple[int, ...] = ()
    if first.interface is not None:
        layers = laminate.interfaces[first.interface - 1].layer_indices
    x, y = first.at or (None, None)
    message = first.message
    if len(offences) > 1:
        message += f" (and {len(offences) - 1} more)"
    place = Place(first.interface, layers, x, y)
    return [Finding(NAME, "fail", 0.0, float(len(offences)), "voids", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every pocket is reached from its own chamber's inlet and from nowhere else",
        "A pocket that opens elsewhere leaks; one that is cut off never inflates.",
        "Look at the place named: an opening too near another, or a mask that crosses a bond.",
        ("bore.diameter", "lumen.diameter", "inlet.width"),
    ),
    at_most=True,
)


def _owners(laminate: Laminate, graph: VoidGraph) -> dict[Void, frozenset[str]]:
    """The chambers whose centres each pocket holds; equal pockets are examined once."""
    names_by_id: dict[int, frozenset[str]] = {}
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
            owners[void] = names_by_id[id(piece)]
    return owners


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
    for interface in levels:
        for chamber in laminate.chambers:
            pieces = pockets.get((interface.index, chamber.name), [])
            for centre in chamber.centres:
                if not any(_holds(piece, centre) for piece in pieces):
                    message = (
                        f"{chamber.name} has no pocket at chamber interface {interface.index} "
                        f"({at(centre)}); add its disc to the mask there"
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
        came = graph.reached(graph.mouths.get(number, ()))
        for void in came:
            if void in owners:
                fed[void] = inlet.chamber
                if owners[void] != {inlet.chamber} and void not in offences:
                    offences[void] = _foreign(void, inlet.chamber, owners[void], graph, came)
    for chamber in laminate.chambers:
        voids = [void for void, names in owners.items() if names == {chamber.name}]
        came = graph.reached(void for void in voids if void in fed)
        if OUTSIDE in came:
            leak = _leak(chamber, graph, came)
            offences.setdefault(leak[0], leak[1])
    for void, names in owners.items():
        if void not in fed and void not in offences:
            came = graph.reached([void])
            if OUTSIDE in came and len(names) == 1:
                chamber = next(c for c in laminate.chambers if c.name in names)
                offences[void] = _leak(chamber, graph, came)[1]
            else:
                offences[void] = _cut_off(void, names, graph)
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
    p = graph.joins[before][void] if before is not None else _somewhere(graph.pieces[void])
    message = (
        f"the inlet of {inlet} feeds a pocket of {whose} at chamber interface {void.level} "
        f"({at(p)}); separate them by a bond there"
    )
    return _Offence(message, void.level, p)


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
                message = (
                    f"the film of layer {gap.above.index} ({gap.above.name}) at {at(p)} is bonded "
                    f"to nothing below it; open the mask at interface {gap.index} there"
                )
                offences.append(_Offence(message, gap.index, p))
    return offences


def _leak(
    chamber: Chamber, graph: VoidGraph, came: dict[Void, Void | None]
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
    message = (
        f"{chamber.name} leaks {outlet} ({at(p)}), from its pocket at chamber interface "
        f"{pocket.level}; close the opening or bond round it"
    )
    return pocket, _Offence(message, interface, p)


def _cut_off(void: Void, names: frozenset[str], graph: VoidGraph) -> _Offence:
    p = _somewhere(graph.pieces[void])
    where = f"at chamber interface {void.level} ({at(p)})"
    if names:
        whose = f"the pocket of {' and '.join(sorted(names))}"
        message = f"{whose} {where} is reached from no inlet; open a bore or a strip to it"
    else:
        message = f"a pocket of no chamber lies {where}; remove that part of the mask"
    return _Offence(message, void.level, p)


def _somewhere(piece: Region) -> Point:
    low_x, low_y, high_x, high_y = piece.bounds
    return (low_x + high_x) / 2, (low_y + high_y) / 2


# Voids of a laminate as a graph of the paths that air takes.
#
# Nodes are the connected pieces of unbonded film in each interface, the places in each interface
# where one of the films is missing, the openings of each film, and the outside. The masks seal
# nothing and are not in it.


INSET: Final = 1e-5
"""mm from an edge at which a point surely lies on one side of it."""


class Void(NamedTuple):
    """A node: ``level`` is an interface's index, or a layer's for an opening."""

    kind: Literal["outside", "pocket", "separator", "gap", "opening"]
    level: int = 0
    piece: int = 0


OUTSIDE = Void("outside")


@dataclass
class VoidGraph:
    """Voids, the points at which they join, and the voids that inlets open into."""

    pieces: dict[Void, Region] = field(default_factory=dict)
    joins: dict[Void, dict[Void, Point]] = field(default_factory=dict)
    mouths: dict[int, list[Void]] = field(default_factory=dict)
    """By the inlet's place in ``laminate.inlets``."""

    def join(self, a: Void, b: Void, p: Point) -> None:
        self.joins.setdefault(a, {}).setdefault(b, p)
        self.joins.setdefault(b, {}).setdefault(a, p)

    def reached(self, starts: Iterable[Void]) -> dict[Void, Void | None]:
        """Return every void joined to ``starts`` with its predecessor, nearest first.

        The outside is entered but not passed through.
        """
        came: dict[Void, Void | None] = dict.fromkeys(starts)
        queue = deque(came)
        while queue:
            here = queue.popleft()
            if here == OUTSIDE:
                continue
            for there in self.joins.get(here, {}):
                if there not in came:
                    came[there] = here
                    queue.append(there)
        return came


class _Gap(NamedTuple):
    """Contribution of an interface, by its pattern: pieces by number, joins between them."""

    unbonded: tuple[Region, ...]
    missing: tuple[Region, ...]
    touching: tuple[tuple[int, int, Point], ...]
    outside: int


def void_graph(laminate: Laminate) -> VoidGraph:
    """The graph of all voids; equal interfaces and films are cut into pieces once."""
    graph = VoidGraph()
    low_x, low_y, high_x, high_y = laminate.bounds
    frame = rectangle((low_x - 10, low_y - 10), (high_x + 10, high_y + 10))
    openings = {
        pattern: _around(layers[0].profile, frame).pieces
        for pattern, layers in laminate.patterns.items()
        if not layers[0].is_mask
    }
    outside = {pattern: _outside(pieces, frame) for pattern, pieces in openings.items()}
    gaps: dict[tuple[str, ...], _Gap] = {}
    homes: dict[tuple[tuple[str, ...], str], list[tuple[int, Point]]] = {}
    opened: dict[int, list[Void]] = {}
    for interface in laminate.interfaces:
        gap = gaps.get(interface.pattern)
        if gap is None:
            gap = gaps[interface.pattern] = _gap(interface.unbonded, interface.contact, frame)
        missing = [_missing(interface, home, gap) for home in range(len(gap.missing))]
        _add_gap(graph, interface, gap, missing, laminate.inlets)
        for layer in (interface.below, interface.above):
            key = interface.pattern, layer.pattern
            if key not in homes:
                homes[key] = [_home(piece, gap.missing) for piece in openings[layer.pattern]]
            if layer.index not in opened:
                opened[layer.index] = [
                    _opening(layer.index, number, outside[layer.pattern])
                    for number in range(len(openings[layer.pattern]))
                ]
            for opening, (home, p) in zip(opened[layer.index], homes[key], strict=True):
                if opening is not OUTSIDE or missing[home] is not OUTSIDE:
                    graph.join(opening, missing[home], p)
    for layer in (laminate.tpe_layers[0], laminate.tpe_layers[-1]):
        for number, piece in enumerate(openings[layer.pattern]):
            opening = _opening(layer.index, number, outside[layer.pattern])
            if opening != OUTSIDE:
                graph.join(opening, OUTSIDE, _middle(piece.bounds))
    return graph


@cached
def _gap(unbonded: Region, contact: Region, frame: Region) -> _Gap:
    pieces = unbonded.pieces
    missing = _around(contact, frame).pieces
    touching: list[tuple[int, int, Point]] = []
    # Where no contours touch, one side of a circle is one void as far as edges go on along it.
    goes_on = not (_touches_itself(unbonded) or _touches_itself(contact))
    before: Edge | None = None
    number = home = 0
    for edge in edges_along(unbonded, contact):
        p = edge.at(0.5)
        if not (goes_on and _follows(before, edge)):
            home = _holding(missing, beside(edge, -INSET))
            number = _bounded(pieces, p)
        touching.append((number, home, p))
        before = edge
    touching.sort(key=lambda entry: entry[0])
    outside = _outside(missing, frame)
    # Inlets open to the outside; of any other two voids it counts that they join, and first where.
    joins: dict[tuple[int, int, Point | None], tuple[int, int, Point]] = {}
    for number, home, p in touching:
        joins.setdefault((number, home, p if home == outside else None), (number, home, p))
    return _Gap(pieces, missing, tuple(joins.values()), outside)


def _touches_itself(region: Region) -> bool:
    """Return True if contours meet at a point."""
    return len({edge.start for edge in region.edges}) < len(region.edges)


def _follows(before: Edge | None, edge: Edge) -> bool:
    """Return True if an arc continues the arc before it, on the same circle."""
    return (
        isinstance(before, Arc)
        and isinstance(edge, Arc)
        and before.end == edge.start
        and before.centre == edge.centre
        and before.radius == edge.radius
        and before.ccw == edge.ccw
    )


def _bounded(pieces: tuple[Region, ...], p: Point) -> int:
    """The number of the piece that has ``p`` on an edge."""
    # Most lie in the box of that piece alone.
    inside = [
        number
        for number, piece in enumerate(pieces)
        for left, low, right, high in [widened(piece.bounds, TOLERANCE)]
        if left <= p[0] <= right and low <= p[1] <= high
    ]
    if len(inside) == 1:
        return inside[0]
    return min(range(len(pieces)), key=lambda number: pieces[number].distance_to_edge(p))


def _around(region: Region, frame: Region) -> Region:
    """The rest of a frame well outside the region: the contours, turned round."""
    if _touches_itself(region):
        # Where contours touch at a point, what they leave may hang together otherwise.
        return frame - region
    turned = (
        turned_round(contour) if alone(contour) is contour else tidy(contour.reversed().edges)
        for contour in region.contours
    )
    return Region(
        in_reading_order([*frame.contours, *(contour for contour in turned if contour is not None)])
    )


def _add_gap(
    graph: VoidGraph,
    interface: Interface,
    gap: _Gap,
    missing: list[Void],
    inlets: tuple[Inlet, ...],
) -> None:
    voids = [_unbonded(interface, number) for number in range(len(gap.unbonded))]
    graph.pieces.update(zip(voids, gap.unbonded, strict=True))
    for number, home, p in gap.touching:
        inlet = None
        if interface.kind == "chamber" and home == gap.outside:
            inlet = _inlet_at(p, inlets)
        if inlet is None:
            graph.join(voids[number], missing[home], p)
        else:
            graph.mouths.setdefault(inlet, []).append(voids[number])


def _inlet_at(p: Point, inlets: tuple[Inlet, ...]) -> int | None:
    for number, inlet in enumerate(inlets):
        dx, dy = p[0] - inlet.mouth[0], p[1] - inlet.mouth[1]
        along = dx * inlet.direction[0] + dy * inlet.direction[1]
        across = dx * inlet.direction[1] - dy * inlet.direction[0]
        if abs(along) <= TOLERANCE and abs(across) <= inlet.width / 2 + TOLERANCE:
            return number
    return None


def _unbonded(interface: Interface, number: int) -> Void:
    kind: Literal["pocket", "separator"] = "pocket" if interface.kind == "chamber" else "separator"
    return Void(kind, interface.index, number)


def _missing(interface: Interface, number: int, gap: _Gap) -> Void:
    return OUTSIDE if number == gap.outside else Void("gap", interface.index, number)


def _opening(layer: int, number: int, outside: int) -> Void:
    return OUTSIDE if number == outside else Void("opening", layer, number)


def _outside(pieces: tuple[Region, ...], frame: Region) -> int:
    """The number of the piece that reaches the frame."""
    return next(n for n, piece in enumerate(pieces) if piece.bounds[0] == frame.bounds[0])


def _home(opening: Region, missing: tuple[Region, ...]) -> tuple[int, Point]:
    """The piece of a gap that an opening lies over: just one, as film is missing all over it."""
    edge = max(opening.edges, key=lambda edge: edge.length)
    return _holding(missing, beside(edge, INSET)), _middle(opening.bounds)


def _holding(pieces: tuple[Region, ...], p: Point) -> int:
    x, y = p
    for number, piece in enumerate(pieces):
        left, low, right, high = piece.bounds
        if left <= x <= right and low <= y <= high and piece.contains(p):
            return number
    return min(range(len(pieces)), key=lambda number: pieces[number].distance_to_edge(p))


def _middle(box: Bounds) -> Point:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
