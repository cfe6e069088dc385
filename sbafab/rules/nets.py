"""nets: the voids join the ports of every declared net, and join nothing else (fluidic LVS).

As in a chip's layout-versus-schematic check, the void graph is extracted from the profiles and
compared with the nets. A design without nets gets no finding.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Literal, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.geometry.lazy_numpy import np
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_width
from sbafab.laminate.joints import Net
from sbafab.laminate.laminate import Interface, Laminate
from sbafab.laminate.netlist import Netlist, compare
from sbafab.rules.boundary import middle, without_slivers
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.measures import Measures, place_in
from sbafab.rules.narrow_voids import VoidEdges, hardest_place
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Clause, explained, say, tell
from sbafab.rules.void_axes import (
    AxisNode,
    Terminal,
    VoidAxis,
    axis_of,
    blind_ends,
    shortest_way,
)
from sbafab.rules.voids import (
    OUTSIDE,
    Cavity,
    Void,
    VoidGraph,
    cavities,
    mouth_of,
    past_mouth,
    void_graph,
)

NAME = "nets"
NETLIST = "netlist"
"""Check of a laminate against a netlist in a separate file."""

FaultKind = Literal["open", "short", "leak", "dead-end", "stray"]


class NetFault(NamedTuple):
    """A difference between nets and voids, with its place.

    ``nets`` are the nets concerned; ``interface`` (None at a hole in an outer film) and ``layers``
    count from 1; ``at`` is the point in mm.
    """

    kind: FaultKind
    nets: tuple[str, ...]
    interface: int | None
    layers: tuple[int, ...]
    at: Point
    says: Clause

    @property
    def message(self) -> str:
        """The difference as one sentence."""
        return tell(self.says, {"at": self.at})

    @property
    def where(self) -> Place:
        return Place(self.interface, self.layers, *self.at)


class NarrowPlace(NamedTuple):
    """The place of a net that is hardest to open in an interface; see ``OpeningPlace``."""

    net: str
    interface: int
    width: Width
    left: float
    pressure: float | None


class Connectivity(NamedTuple):
    """The voids of a laminate compared with its nets.

    ``owners`` holds the net names of each cavity, empty for a slit or hole; ``groups`` the names of
    connected ports and chambers; ``faults`` the deviations from the declared nets.
    """

    cavities: tuple[Cavity, ...]
    owners: tuple[tuple[str, ...], ...]
    groups: tuple[frozenset[str], ...]
    faults: tuple[NetFault, ...]
    narrow: tuple[NarrowPlace, ...]


def check(measures: Measures) -> list[Finding]:
    """Return a finding for every fault, and one for the channel that is hardest to open."""
    laminate, design = measures.laminate, measures.design
    if not laminate.nets:
        return []
    read = connectivity(laminate, design)
    findings = [
        Finding(NAME, "fail", 0.0, 1.0, "faults", fault.where, fault.says) for fault in read.faults
    ]
    if not findings:
        nets = declared(laminate)
        ports = sum(len(net.ports) for net in nets)
        facts = {"nets": len(nets), "ports": ports}
        findings.append(judged(NAME, True, 0.0, 0.0, "faults", Place(), "joined", **facts))
    return [*findings, *_openings(read.narrow, laminate, design)]


RULE = Rule(NAME, check, explained(NAME), at_most=True)


def declared(laminate: Laminate) -> tuple[Net, ...]:
    """Return the declared nets, and a separate net for every other chamber and port."""
    named = {member for net in laminate.nets for member in net.ports}
    names = [chamber.name for chamber in laminate.chambers] + [p.name for p in laminate.ports]
    alone = (Net(name, (name,)) for name in dict.fromkeys(names) if name not in named)
    return (*laminate.nets, *alone)


def connectivity(laminate: Laminate, design: Design, faults: bool = True) -> Connectivity:
    """Return the voids of a laminate, their nets, and the deviations from the declared nets.

    Deviations are sought only if ``faults`` is set.
    """
    read = _Reading(laminate)
    owners = tuple(tuple(sorted(read.owners.get(part, ()))) for part in read.parts)
    differing: list[NetFault] = []
    if faults:
        differing += [*read.opens(), *read.shorts(), *read.leaks()]
        differing += [*read.dead_ends(design.rules.longest_dead_end), *read.strays()]
    narrow = tuple(read.narrow(design)) if faults else ()
    return Connectivity(read.cavities, owners, read.groups(), tuple(differing), narrow)


def netlist_findings(
    laminate: Laminate, design: Design, netlist: Netlist, file: str
) -> list[Finding]:
    """Return the findings of a laminate compared with a netlist, which replaces its own nets.

    Ports with a position need not exist in the laminate; the names of other ports and of chambers
    must.
    """
    placed = {port.name for port in netlist.ports}
    ports_drawn = (port for port in laminate.ports if port.name not in placed)
    ports = (*ports_drawn, *netlist.ports)
    names = {chamber.name for chamber in laminate.chambers} | {port.name for port in ports}
    nets = tuple(
        Net(name, tuple(member for member in members if member in names))
        for name, members in netlist.nets.items()
    )
    read = connectivity(replace(laminate, ports=ports, nets=nets), design)
    comparison = compare(read.groups, netlist.nets)
    differences = [_missing(name, names) for name in comparison.missing]
    differences += [
        (fault.where, say("netlist.fault", fault=fault.says))
        for fault in read.faults
        if fault.kind in ("open", "short", "leak")
    ]
    verdict: Verdict = "fail" if differences else "pass"
    count = float(bool(differences))
    differences = differences or [(Place(), say("netlist.joined", nets=len(comparison.matched)))]
    return [
        Finding(NETLIST, verdict, 0.0, count, "differences", where, says.also(file=file))
        for where, says in differences
    ]


def _missing(name: str, names: Iterable[str]) -> tuple[Place, Clause]:
    near = get_close_matches(name, sorted(names), 1)
    if near:
        return Place(), say("netlist.near", member=name, near_name=near[0])
    return Place(), say("netlist.unknown", member=name)


class _Terminal(NamedTuple):
    """The place of a port or chamber, which one of the ``cavities`` must contain.

    ``layers`` are the layers on either side; empty for an inlet.
    """

    member: str
    label: Clause | str
    cavities: tuple[int, ...]
    at: Point
    width: float
    is_port: bool
    layers: tuple[int, ...]


class _Reading:
    """The void graph of a laminate with the places of its ports.

    ``part_of`` numbers the connected parts of the voids without the outside; ``parts`` gives each
    cavity's part. ``homes`` gives the part of each net's terminals, None outside all voids;
    ``owners`` the nets with a terminal in a part.
    """

    def __init__(self, laminate: Laminate) -> None:
        self.laminate = laminate
        self.nets = declared(laminate)
        self.graph: VoidGraph = void_graph(laminate)
        self.cavities = cavities(laminate, self.graph)
        self.cavity_of = {v: n for n, cavity in enumerate(self.cavities) for v in cavity.voids}
        self.part_of = _parts(self.graph)
        self.parts = [self.part_of[cavity.voids[0]] for cavity in self.cavities]
        self.homes = {net.name: self._home(net) for net in self.nets}
        owners: dict[int, dict[str, None]] = {}
        for name, home in self.homes.items():
            for part in home.values():
                if part is not None:
                    owners.setdefault(part, {})[name] = None
        self.owners = {part: tuple(names) for part, names in owners.items()}

    def interface(self, index: int) -> Interface:
        return self.laminate.interfaces[index - 1]

    def of_net(self) -> Iterator[tuple[int, Cavity, Interface, tuple[str, ...]]]:
        """Yield each cavity's number, the cavity, its interface and the nets of its part."""
        for number, (cavity, part) in enumerate(zip(self.cavities, self.parts, strict=True)):
            gap = self.interface(cavity.interface)
            yield number, cavity, gap, self.owners.get(part, ())

    def _home(self, net: Net) -> dict[_Terminal, int | None]:
        """Return the part that holds each terminal of a net.

        If several cavities qualify, the cavity in the net's main part is preferred.
        """
        rows = [row for member in net.ports for row in self._terminals(member)]
        parts = {row: [self.parts[number] for number in row.cavities] for row in rows}
        votes = [part for row in rows for part in set(parts[row])]
        main = max(dict.fromkeys(votes), key=votes.count, default=None)
        return {row: main if main in parts[row] else next(iter(parts[row]), None) for row in rows}

    # Places of ports.

    def _terminals(self, member: str) -> Iterator[_Terminal]:
        laminate, graph = self.laminate, self.graph
        for port in laminate.ports:
            layers = (port.below, port.above)
            if port.name == member and port.kind == "hole":
                opening = graph.holes.get(member)
                beside = () if opening is None else self._beside(opening)
                width = 0.0 if opening is None else _across(graph.openings[opening])
                yield _Terminal(member, member, beside, port.at, width, False, layers)
            elif port.name == member:
                holding = self._holding(port.at, layers)
                yield _Terminal(member, member, holding, port.at, 0.0, True, layers)
        for number, inlet in enumerate(laminate.inlets):
            if inlet.chamber == member:
                beside, label = self._beside(mouth_of(number)), say("nets.inlet", member=member)
                yield _Terminal(member, label, beside, inlet.mouth, inlet.width, False, ())
        gaps = [gap for gap in laminate.interfaces if gap.kind == "chamber"]
        for chamber in laminate.chambers:
            levels = [(n, gap) for n, gap in enumerate(gaps, 1) if chamber.is_in(n)]
            for balloon, gap in levels if chamber.name == member else ():
                label = say("nets.pocket", member=member)
                if len(levels) > 1:
                    label = say("nets.pocket-in", member=member, balloon=balloon)
                layers = _layers(gap)
                for p in chamber.centres:
                    holding = self._holding(p, layers)
                    yield _Terminal(member, label, holding, p, 0.0, True, layers)

    def _holding(self, p: Point, layers: tuple[int, int]) -> tuple[int, ...]:
        """Return the cavities between a pair of layers that contain a point."""
        return tuple(
            number
            for number, cavity in enumerate(self.cavities)
            if _layers(self.interface(cavity.interface)) == layers
            and not cavity.is_open_film
            and cavity.region.contains(p)
        )

    def _beside(self, void: Void) -> tuple[int, ...]:
        """Return the cavities that a film hole or mouth opens into."""
        voids = self.graph.joins.get(void, {})
        return tuple(sorted({self.cavity_of[v] for v in voids if v in self.cavity_of}))

    def groups(self) -> tuple[frozenset[str], ...]:
        """Return the connected members, by part; a member outside all voids is alone."""
        groups: dict[object, set[str]] = {}
        for home in self.homes.values():
            for row, part in home.items():
                groups.setdefault(row if part is None else part, set()).add(row.member)
        return tuple(map(frozenset, groups.values()))

    # Faults.

    def opens(self) -> Iterator[NetFault]:
        """Yield the terminals outside all voids, and the disconnected parts of a net."""
        for name, home in self.homes.items():
            counts = [*home.values()]
            parts = [part for part in dict.fromkeys(counts) if part is not None]
            main = max(parts, key=counts.count, default=None)
            for row in (row for row, part in home.items() if part is None):
                gap = next((g for g in self.laminate.interfaces if _layers(g) == row.layers), None)
                number = None if gap is None else gap.index
                says = say("nets.open-void", net=name, member=row.label)
                yield NetFault("open", (name,), number, row.layers, row.at, says)
            for part in parts:
                if part != main and main is not None:
                    yield self._open(name, home, part, main)

    def _open(
        self, name: str, home: Mapping[_Terminal, int | None], part: int, main: int
    ) -> NetFault:
        cut = self._gap_between(part, main)
        gap = self.interface(cut.interface)
        says = say(
            "nets.open-hole" if cut.is_through_film else "nets.open-bond",
            net=name,
            one=_labels(home, part),
            rest=_labels(home, main),
            above=gap.above.index,
            length=cut.length,
        )
        return self._fault("open", (name,), gap, cut.at, says)

    def _fault(
        self, kind: FaultKind, nets: tuple[str, ...], gap: Interface, p: Point, says: Clause
    ) -> NetFault:
        says = says.also(interface=gap.index)
        return NetFault(kind, nets, gap.index, gap.layer_indices, p, says)

    def shorts(self) -> Iterator[NetFault]:
        """Yield the parts that several nets share, with a fault for each further net."""
        for part, names in self.owners.items():
            for name in names[1:]:
                both, says = (names[0], name), say("nets.short", net=names[0], other=name)
                shared = self._shared_mouth(part, *both)
                if shared is None:
                    number, p = self._bridge(part, *both)
                else:
                    number, p, chamber = shared
                    says = say("nets.short-mouth", net=names[0], other=name, chamber=chamber)
                gap = self.interface(self.cavities[number].interface)
                yield self._fault("short", both, gap, p, says)

    def leaks(self) -> Iterator[NetFault]:
        """Yield the places where a net reaches the outside."""
        for void, p in self.graph.joins.get(OUTSIDE, {}).items():
            names = self.owners.get(self.part_of[void], ())
            if names and void.kind == "opening":
                says = say("nets.leak-layer", net=names[0], layer=void.level)
                yield NetFault("leak", names, None, (void.level,), p, says)
            elif names:
                wide = past_mouth(self.laminate, void.level, p) if void.kind == "pocket" else None
                sentence = "nets.leak-past-mouth" if wide else "nets.leak"
                says = say(sentence, net=names[0], wide=wide)
                yield self._fault("leak", names, self.interface(void.level), p, says)

    def dead_ends(self, ratio: float) -> Iterator[NetFault]:
        """Yield the dead ends in the cavities of the nets."""
        for number, cavity, gap, names in self.of_net():
            terminals = self._ways_on(number) if names else []
            if len(terminals) > 1:
                for end in blind_ends(self.axis(number), terminals, ratio):
                    says = say("nets.dead-end", net=names[0], depth=end.depth, width=end.width)
                    yield self._fault("dead-end", names, gap, end.at, says)
            elif names and not any(terminal.is_port for terminal in terminals):
                p = self._far_from(number, terminals[0].at) if terminals else middle(cavity.region)
                blind = "nets.blind-hole" if cavity.is_open_film else "nets.blind-void"
                yield self._fault("dead-end", names, gap, p, say(blind, net=names[0]))

    def strays(self) -> Iterator[NetFault]:
        """Yield closed voids outside all nets, and chamber voids that open to the outside."""
        is_open = {self.part_of[void] for void in self.graph.joins.get(OUTSIDE, {})}
        visited: set[int] = set()
        for number, cavity, gap, names in self.of_net():
            part = self.parts[number]
            # A slit between balloons, or a flap outside a seam.
            is_slit = part in is_open and not (gap.kind == "chamber" and gap.pressed)
            if not (cavity.is_open_film or names or part in visited or is_slit):
                visited.add(part)
                yield self._fault("stray", (), gap, middle(cavity.region), say("nets.stray"))

    # Widths and places.

    def narrow(self, design: Design) -> Iterator[NarrowPlace]:
        """Yield the place of each net cavity that is hardest to open in the worst case."""
        for _, cavity, gap, names in self.of_net():
            if names and not cavity.is_open_film:
                edges = VoidEdges.of(gap, design)
                place = hardest_place(self.laminate, gap, cavity.region, edges)
                if place is not None:
                    yield NarrowPlace(names[0], gap.index, *place)

    def axis(self, number: int) -> VoidAxis:
        width = least_width(self.cavities[number].region, 0.0)
        return axis_of(self.cavities[number].region, 0.0 if width is None else width.value)

    def _ways_on(self, number: int) -> list[Terminal]:
        """Return the ports, mouths and vias of a cavity, and its openings to the outside."""
        rows = [
            Terminal(row.at, row.width, row.is_port)
            for name in self.owners.get(self.parts[number], ())
            for row, part in self.homes[name].items()
            if number in row.cavities and part == self.parts[number] and row.layers
        ]
        tubes = set(self.graph.holes.values())
        for void in self.cavities[number].voids:
            for there, p in self.graph.joins.get(void, {}).items():
                if there == OUTSIDE:
                    rows.append(Terminal(p, 0.0, False))
                elif there.kind == "mouth":
                    rows.append(Terminal(p, self.laminate.inlets[there.level].width, False))
                elif there.kind == "opening" and there not in tubes:
                    beyond = [v for v in self.graph.joins[there] if self.cavity_of.get(v) != number]
                    if beyond:
                        rows.append(Terminal(p, _across(self.graph.openings[there]), False))
        return rows

    def _far_from(self, number: int, start: Point) -> Point:
        axis = self.axis(number)
        return axis.centre(int(np.abs(axis.points - complex(*start)).argmax()))

    def _of_part(self, part: int) -> list[int]:
        return [number for number, home in enumerate(self.parts) if home == part]

    def _gap_between(self, part: int, main: int) -> _Cut:
        """Return the most likely place of a missing connection between two parts of a net.

        It is where both end one above the other, else where they are nearest.
        """
        cuts: list[_Cut] = []
        for a in self._of_part(part):
            for b in self._of_part(main):
                here, there = self.cavities[a], self.cavities[b]
                if here.interface == there.interface:
                    cuts.append(_nearest(self.axis(a), self.axis(b), here.interface))
                elif abs(here.interface - there.interface) == 1:
                    cuts += _overlaps(here, there)
        if not cuts:
            cavity = self.cavities[self._of_part(part)[0]]
            return _Cut(0.0, 0.0, cavity.interface, middle(cavity.region), True)
        return min(cuts, key=lambda cut: (cut.cost, cut.interface))

    def _shared_mouth(self, part: int, first: str, second: str) -> tuple[int, Point, str] | None:
        """Return the second net's cavity and place, and the chamber whose mouth joins both nets."""
        walled = _parts(self.graph, ("outside", "mouth"))
        firsts, seconds = (
            {
                numbers.pop()
                for row, home in self.homes[name].items()
                if home == part
                and len(numbers := {walled[self.cavities[n].voids[0]] for n in row.cavities}) == 1
            }
            for name in (first, second)
        )
        mouths = [(v, voids) for v, voids in self.graph.joins.items() if v.kind == "mouth"]
        for mouth, voids in mouths if not firsts & seconds else ():
            behind = [void for void in voids if walled[void] in seconds]
            if behind and len(behind) < len(voids):
                chamber = self.laminate.inlets[mouth.level].chamber
                return self.cavity_of[behind[0]], voids[behind[0]], chamber
        return None

    def _bridge(self, part: int, first: str, second: str) -> tuple[int, Point]:
        """Return the cavity and the place that connect two nets in one part.

        The paths between each net's own ports are excluded; the bridge is the midpoint of the
        shortest remaining path.
        """
        numbers = self._of_part(part)
        axes = [self.axis(number) for number in numbers]
        links = self._links(numbers, axes)
        trees: list[dict[AxisNode, None]] = []
        for name in (first, second):
            nodes = [
                (place, axes[place].nearest(row.at))
                for row, home in self.homes[name].items()
                if home == part
                for place, number in enumerate(numbers)
                if number in row.cavities
            ]
            tree: dict[AxisNode, None] = dict.fromkeys(nodes[:1])
            for node in nodes[1:]:
                tree.update(dict.fromkeys(shortest_way(axes, links, tree, [node])))
            trees.append(tree)
        shared = [node for node in trees[0] if node in trees[1]]
        way = shared or shortest_way(axes, links, trees[0], trees[1])
        place, sample = way[len(way) // 2]
        return numbers[place], axes[place].centre(sample)

    def _links(
        self, numbers: Sequence[int], axes: Sequence[VoidAxis]
    ) -> dict[AxisNode, list[AxisNode]]:
        """Return the nodes on both sides of every via or mouth between these cavities."""
        links: dict[AxisNode, list[AxisNode]] = {}
        for via, voids in self.graph.joins.items():
            if via.kind not in ("opening", "mouth"):
                continue
            beside = {
                self.cavity_of[void]: p for void, p in voids.items() if void in self.cavity_of
            }
            nodes = [
                (numbers.index(n), axes[numbers.index(n)].nearest(p))
                for n, p in sorted(beside.items())
                if n in numbers
            ]
            for node in nodes:
                links.setdefault(node, []).extend(linked for linked in nodes if linked != node)
        return links


class _Cut(NamedTuple):
    """A gap of ``length`` mm between two parts of a net; the least ``cost`` is the likeliest.

    A film between ends costs nothing, a bond its length, a crossing of channels twice its width.
    """

    cost: float
    length: float
    interface: int
    at: Point
    is_through_film: bool


def _nearest(a: VoidAxis, b: VoidAxis, interface: int) -> _Cut:
    best, middle_point = math.inf, 0j
    for start in range(0, len(a.points), 256):
        rows = a.points[start : start + 256]
        away = np.abs(rows[:, None] - b.points)
        i, j = np.unravel_index(away.argmin(), away.shape)
        if away[i, j] < best:
            best, middle_point = float(away[i, j]), complex(rows[i] + b.points[j]) / 2
    return _Cut(best, best, interface, (middle_point.real, middle_point.imag), False)


def _overlaps(a: Cavity, b: Cavity) -> list[_Cut]:
    """Return the places where only a film separates two cavities, ends before crossings."""
    lower = min(a.interface, b.interface)
    cuts = []
    for piece in without_slivers(a.region & b.region).pieces:
        remains = [len(without_slivers(cavity.region - piece).pieces) for cavity in (a, b)]
        cost = 2 * _across(piece) if min(remains) > 1 else 0.0
        cuts.append(_Cut(cost, 0.0, lower, middle(piece), True))
    return cuts


def _parts(graph: VoidGraph, walls: Collection[str] = ("outside",)) -> dict[Void, int]:
    """Return the part number of every void; walls do not connect parts."""
    parts: dict[Void, int] = {}
    for void in [*graph.pieces, *graph.gaps, *graph.openings]:
        if void not in parts:
            number = len(parts)
            for reached in graph.reached([void], walls):
                if reached.kind not in walls:
                    parts[reached] = number
    return parts


def _across(opening: Region) -> float:
    low_x, low_y, high_x, high_y = opening.bounds
    return min(high_x - low_x, high_y - low_y)


def _layers(gap: Interface) -> tuple[int, int]:
    return gap.below.index, gap.above.index


def _labels(home: Mapping[_Terminal, int | None], part: int) -> list[Clause | str]:
    """Return the members of a net in a part, as inlet or pocket if the other one lies elsewhere."""
    here = [row for row, number in home.items() if number == part]
    away = {row.member for row, number in home.items() if number != part}
    return [*dict.fromkeys(row.label if row.member in away else row.member for row in here)]


def _openings(
    narrow: Sequence[NarrowPlace], laminate: Laminate, design: Design
) -> Iterable[Finding]:
    """Yield the channel with the highest opening pressure; a warning if the pressure is unknown."""
    limit = design.rules.channels_open_at_kpa
    modelled = [(place.pressure, place) for place in narrow if place.pressure is not None]
    if modelled:
        pressure, worst = max(modelled, key=lambda row: row[0])
        interface = laminate.interfaces[worst.interface - 1]
        facts = {
            "net": worst.net,
            "as_drawn": worst.width.value,
            "interface": worst.interface,
            "left": worst.left,
            "pressure": pressure,
            "edges": VoidEdges.of(interface, design).causes(),
        }
        good, place = pressure <= limit * (1 + 1e-9), place_in(interface, worst.width.middle)
        measured = pressure if math.isfinite(pressure) else None
        sentence = "opens" if worst.left > 0 else "closes"
        yield judged(NAME, good, limit, measured, "kPa", place, sentence, **facts)
    if len(modelled) < len(narrow):
        unknown = next(place for place in narrow if place.pressure is None)
        facts = {"as_drawn": unknown.width.value, "left": unknown.left}
        where = Place(unknown.interface, (), *unknown.width.middle)
        facts["interface"] = unknown.interface
        yield judged(NAME, "warn", limit, None, "kPa", where, "unknown", **facts)
