"""Random laminates of routed channels, faults planted into them, and what a raster says of them.

Channels run along the edges of a grid, in 1 to 4 interfaces, and through holes of films from one
interface to the next. The raster floods squares of film, mask and hole; it shares no code with the
rule.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from random import Random
from typing import Any

import numpy as np
import shapely

from sbafab.actuators import build, load_design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc, rectangle, strip, union
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Chamber, Inlet, Laminate, Layer

PITCH = 4.0
MARGIN = 3.0
POCKET = 1.6
"""Radius of a pocket, mm."""
OVERHANG = 0.5
CENTRE = 1.5 - MARGIN
"""x of a point in the channel from a mouth."""
PIXEL = 0.1
PAST = 0.03
"""mm that an opening may reach past its mouth."""

Place = tuple[int, int, int]
"""Interface from 0, column, row."""


@dataclass
class Routes:
    """Channels on a grid: segments and vias by net, ports by name, and shapes added by hand."""

    size: tuple[int, int]
    interfaces: int
    width: float
    hole: float
    pad: float
    nodes: dict[Place, str] = field(default_factory=dict)
    segments: dict[tuple[Place, Place], str] = field(default_factory=dict)
    vias: dict[tuple[int, int, int], str] = field(default_factory=dict)
    """Holes in the film above an interface, from 0: (film, column, row)."""
    ports: dict[str, Place] = field(default_factory=dict)
    nets: dict[str, list[str]] = field(default_factory=dict)
    tubes: list[str] = field(default_factory=list)
    """Ports through the top film."""
    mouths: list[str] = field(default_factory=list)
    """Ports that are an inlet through the left edge."""
    pockets: list[str] = field(default_factory=list)
    """Ports that are a round pocket, wider than its channel."""
    more: list[tuple[int, Region]] = field(default_factory=list)
    """Added to the mask of an interface."""
    less: list[tuple[int, Region]] = field(default_factory=list)
    holes: list[tuple[int, Point]] = field(default_factory=list)
    """Holes in a film, from 0 at the bottom, beside the vias."""
    stated: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Where the middle of a mouth is stated along the edge, and its width, where not as drawn."""
    named: dict[str, int] = field(default_factory=dict)
    """Interfaces, from 0, in which a port with a mouth is named besides its own."""


def xy(place: Sequence[int]) -> Point:
    return place[-2] * PITCH, place[-1] * PITCH


def around(place: Place, routes: Routes) -> Iterator[Place]:
    level, x, y = place
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        if 0 <= x + dx < routes.size[0] and 0 <= y + dy < routes.size[1]:
            yield level, x + dx, y + dy


def routed(seed: int) -> Routes:
    """Return routes of two to five nets, each with two to four ports."""
    random = Random(seed)
    routes = Routes(
        (random.randint(4, 7), random.randint(4, 6)),
        random.randint(2, 4),
        random.choice((0.8, 1.0, 1.2, 1.5)),
        random.choice((0.5, 0.6, 0.8)),
        random.choice((1.6, 2.0)),
    )
    for number in range(random.randint(2, 5)):
        add_net(routes, f"n{number}", random)
    return routes


def add_net(routes: Routes, name: str, random: Random) -> None:
    free = [
        (level, x, y)
        for level in range(routes.interfaces)
        for x in range(routes.size[0])
        for y in range(routes.size[1])
        if (level, x, y) not in routes.nodes
    ]
    if len(free) < 4:
        return
    start = random.choice(free)
    tree = {start: None}
    steps: list[tuple[Place, Place]] = []
    ports = [start]
    for _ in range(random.randint(1, 3)):
        goals = [place for place in free if place not in tree]
        way = shortest(routes, tree, random.choice(goals), random) if goals else []
        if way:
            steps += zip(way, way[1:], strict=False)
            tree |= dict.fromkeys(way)
            ports.append(way[-1])
    if not steps:
        return
    routes.nodes |= dict.fromkeys(tree, name)
    for a, b in steps:
        if a[0] == b[0]:
            routes.segments[a, b] = name
        else:
            routes.vias[(min(a[0], b[0]), *a[1:])] = name
    names = []
    taken = {routes.ports[port][2] for port in routes.mouths}
    for number, place in enumerate(dict.fromkeys(ports)):
        port = f"{name}p{number}"
        names.append(port)
        routes.ports[port] = place
        if place[0] == routes.interfaces - 1 and random.random() < 0.5:
            routes.tubes.append(port)
        elif place[1] == 0 and place[2] not in taken and random.random() < 0.7:
            # An inlet has no interface of its own, so that each has its place along the edge.
            routes.mouths.append(port)
            taken.add(place[2])
        elif random.random() < 0.3:
            routes.pockets.append(port)
    routes.nets[name] = names


def shortest(routes: Routes, tree: dict[Place, None], goal: Place, random: Random) -> list[Place]:
    """A shortest way from a tree to a place through what no other net uses."""
    came: dict[Place, Place | None] = dict.fromkeys(tree)
    queue = deque(tree)
    while queue:
        here = queue.popleft()
        if here == goal:
            way = [here]
            while (before := came[way[-1]]) is not None:
                way.append(before)
            return way[::-1]
        level, x, y = here
        steps = [*around(here, routes), (level + 1, x, y), (level - 1, x, y)]
        random.shuffle(steps)
        for there in steps:
            is_free = there not in came and there not in routes.nodes
            if is_free and 0 <= there[0] < routes.interfaces:
                came[there] = here
                queue.append(there)
    return []


@cache
def _pouch() -> Laminate:
    return build(load_design("pouch"))


def laminate_of(routes: Routes) -> Laminate:
    """Return the laminate of routes: films as large as the grid, and a mask in every interface."""
    pouch = _pouch()
    film, mask_film = pouch.layers[0].film, pouch.layers[1].film
    columns, rows = routes.size
    low = (-MARGIN, -MARGIN)
    high = ((columns - 1) * PITCH + MARGIN, (rows - 1) * PITCH + MARGIN)
    sheet = rectangle(low, high)
    holes: dict[int, list[Region]] = {}
    for level, x, y in routes.vias:
        holes.setdefault(level + 1, []).append(disc(xy((x, y)), routes.hole / 2))
    for port in routes.tubes:
        place = xy(routes.ports[port])
        holes.setdefault(routes.interfaces, []).append(disc(place, routes.hole / 2))
    for film_number, p in routes.holes:
        holes.setdefault(film_number, []).append(disc(p, routes.hole / 2))
    layers: list[Layer] = []
    faces: list[int] = []

    def add(role: str, profile: Region) -> None:
        pattern = f"{role}-{profile.key}"
        stock = mask_film if role == "chamber-mask" else film
        z = sum(layer.film.thickness for layer in layers)
        layers.append(
            Layer(len(layers) + 1, role, stock, profile, None, z, 1, pattern)  # type: ignore[arg-type]
        )

    for number in range(routes.interfaces + 1):
        role = "base" if number == 0 else "cap" if number == routes.interfaces else "wall"
        add(role, sheet - union(holes.get(number, [])))
        faces.append(len(layers))
        mask = mask_of(routes, number)
        if number < routes.interfaces and not mask.is_empty:
            add("chamber-mask", mask)
    masked = [layer.index for layer in layers if layer.role == "chamber-mask"]
    balloon = {
        level: masked.index(faces[level] + 1) + 1
        for level in range(routes.interfaces)
        if faces[level] + 1 in masked
    }
    ports = tuple(
        Port(
            name,
            faces[place[0]],
            faces[place[0] + 1],
            xy(place),
            "hole" if name in routes.tubes else "place",
        )
        for name, place in routes.ports.items()
        if name not in routes.mouths
    )
    chambers = []
    inlets = []
    for name in routes.mouths:
        level, y = routes.ports[name][0], xy(routes.ports[name])[1]
        levels = sorted({level, routes.named.get(name, level)})
        chambers.append(Chamber(name, ((CENTRE, y),), tuple(balloon[n] for n in levels)))
        middle, width = routes.stated.get(name, (y, routes.width))
        inlets.append(Inlet(name, (-MARGIN, middle), (-1.0, 0.0), width, 1.0, 0.3))
    return replace(
        pouch,
        layers=tuple(layers),
        chambers=tuple(chambers),
        inlets=tuple(inlets),
        bores=(),
        balloons=routes.interfaces,
        ports=ports,
        nets=tuple(Net(name, tuple(names)) for name, names in routes.nets.items()),
    )


def mask_of(routes: Routes, level: int) -> Region:
    shapes = [disc(xy(p), routes.width / 2) for p in routes.nodes if p[0] == level]
    shapes += [strip(xy(a), xy(b), routes.width) for a, b in routes.segments if a[0] == level]
    for film, x, y in routes.vias:
        if level in (film, film + 1):
            shapes.append(disc(xy((x, y)), routes.pad / 2))
    for name, place in routes.ports.items():
        if place[0] != level:
            continue
        if name in routes.tubes:
            shapes.append(disc(xy(place), routes.pad / 2))
        if name in routes.pockets:
            shapes.append(disc(xy(place), POCKET))
        if name in routes.mouths:
            end = (-MARGIN - OVERHANG, xy(place)[1])
            shapes.append(strip(end, xy(place), routes.width))
    shapes += [shape for number, shape in routes.more if number == level]
    mask = union(shapes)
    for number, shape in routes.less:
        mask = mask - shape if number == level else mask
    return mask


# Routes drawn by hand.


def line_of(ports: dict[str, tuple[int, int, int]], **nets: list[str]) -> Routes:
    """Channels 1 mm wide along one row of a grid, from the first port of a net to its last."""
    routes = Routes((6, 3), 2, 1.0, 0.6, 1.6, ports=ports, nets=nets)
    for name, members in nets.items():
        for a, b in zip(members, members[1:], strict=False):
            (level, x0, y), (_, x1, _) = ports[a], ports[b]
            for x in range(x0, x1):
                routes.segments[(level, x, y), (level, x + 1, y)] = name
            routes.nodes |= {(level, x, y): name for x in range(x0, x1 + 1)}
    return routes


def straight() -> Routes:
    ports = {"p": (0, 0, 1), "q": (0, 5, 1), "r": (1, 0, 2), "s": (1, 5, 2)}
    return line_of(ports, a=["p", "q"], b=["r", "s"])


def cut_through() -> Routes:
    """The straight channels, the first of them cut through over 1 mm round (10, 4)."""
    routes = straight()
    routes.less.append((0, rectangle((9.5, 3.0), (10.5, 5.0))))
    return routes


# Faults.


@dataclass(frozen=True)
class Planted:
    """A fault: how it must be named, at which interfaces (from 1), and its shape."""

    kind: str
    interfaces: tuple[int, ...]
    shape: Region
    routes: Routes

    def distance(self, p: Point) -> float:
        """Return the mm from the fault; 0 within its shape."""
        return 0.0 if self.shape.contains(p) else self.shape.distance_to_edge(p)


def planted(kind: str, seed: int) -> Planted:
    """Return random routes with a fault of this kind; the next seed where it has no place."""
    places, plant = FAULTS[kind]
    while True:
        routes, random = routed(seed), Random(seed)
        if found := places(routes):
            return plant(routes, random, random.choice(found))
        seed += 100_000


def unjoined(routes: Routes) -> list[tuple[Place, Place]]:
    """Places of nets with the places beside them to which no channel of theirs goes."""
    return [
        (a, b)
        for a in sorted(routes.nodes)
        for b in around(a, routes)
        if (a, b) not in routes.segments and (b, a) not in routes.segments
    ]


def crossings(routes: Routes) -> list[Place]:
    """Places under another net's."""
    nodes = routes.nodes
    return [a for a in sorted(nodes) if nodes.get((a[0] + 1, *a[1:]), nodes[a]) != nodes[a]]


def beside_others(routes: Routes) -> list[tuple[Place, Place]]:
    nodes = routes.nodes
    return [(a, b) for a, b in unjoined(routes) if b in nodes and nodes[a] != nodes[b]]


def beside_nothing(routes: Routes) -> list[tuple[Place, Place]]:
    """Places within a net, with those beside them that no net uses."""
    ends = set(routes.ports.values())
    return [(a, b) for a, b in unjoined(routes) if b not in routes.nodes and a not in ends]


def unused(routes: Routes) -> list[Place]:
    columns, rows = routes.size
    grid = product(range(routes.interfaces), range(columns), range(rows))
    return [place for place in grid if place not in routes.nodes and place[1]]


def under_nothing(routes: Routes) -> list[Place]:
    nodes = routes.nodes
    below = [a for a in sorted(nodes) if a[0] + 1 < routes.interfaces and a[1]]
    return [a for a in below if (a[0] + 1, *a[1:]) not in nodes]


def mouths_and(routes: Routes, is_there: Callable[[Place, Place], bool]) -> list[tuple[str, Place]]:
    """Ports with a mouth, and the places of other nets that are there."""
    return [
        (port, place)
        for port in routes.mouths
        for place, net in sorted(routes.nodes.items())
        if is_there(place, routes.ports[port]) and net != routes.nodes[routes.ports[port]]
    ]


def cut(routes: Routes, random: Random, way: tuple[Place, Place]) -> Planted:
    a, b = way
    ends = [between(xy(a), xy(b), 0.5 + s * random.uniform(0.08, 0.12)) for s in (-1, 1)]
    shape = strip(*ends, routes.width + 0.5)
    routes.less.append((a[0], shape))
    return Planted("open", (a[0] + 1,), shape, routes)


def bridge(routes: Routes, random: Random, way: tuple[Place, Place]) -> Planted:
    a, b = way
    shape = strip(xy(a), xy(b), random.uniform(0.3, routes.width))
    routes.more.append((a[0], shape))
    return Planted("short", (a[0] + 1,), shape, routes)


def missing_via(routes: Routes, _: Random, via: Place) -> Planted:
    # Its pads stay.
    pad = disc(xy(via), routes.pad / 2)
    routes.more += [(level, pad) for level in (via[0], via[0] + 1)]
    del routes.vias[via]
    return Planted("open", (via[0] + 1, via[0] + 2), pad, routes)


def extra_via(routes: Routes, _: Random, a: Place) -> Planted:
    routes.holes.append((a[0] + 1, xy(a)))
    return Planted("short", (a[0] + 1, a[0] + 2), disc(xy(a), routes.hole / 2), routes)


def stub(routes: Routes, _: Random, way: tuple[Place, Place]) -> Planted:
    a, b = way
    shape = strip(xy(a), xy(b), routes.width) | disc(xy(b), routes.width / 2)
    routes.more.append((a[0], shape))
    return Planted("dead-end", (a[0] + 1,), shape, routes)


def leak(routes: Routes, _: Random, a: Place) -> Planted:
    edge = ((routes.size[0] - 1) * PITCH + MARGIN, xy(a)[1])
    shape = strip(xy(a), (edge[0] + OVERHANG, edge[1]), routes.width)
    routes.more.append((a[0], shape))
    return Planted("leak", (a[0] + 1,), disc(edge, 0.1), routes)


def wide_mouth(routes: Routes, random: Random, port: str) -> Planted:
    """An opening that goes on past the end of its mouth, or a mouth stated beside its opening."""
    level, y = routes.ports[port][0], xy(routes.ports[port])[1]
    side, more = random.choice((-1, 1)), random.uniform(0.15, 0.7)
    end = y + side * routes.width / 2
    if random.random() < 0.5:
        routes.more.append((level, strip((-MARGIN - OVERHANG, end), (CENTRE, end), 2 * more)))
        end += side * more
    else:
        routes.stated[port] = y - side * more, routes.width
    return Planted("leak", (level + 1,), disc((-MARGIN, end), more), routes)


def shared_mouth(routes: Routes, _: Random, both: tuple[str, Place]) -> Planted:
    """A mouth stated so wide that the channel of another net opens into it, too."""
    port, place = both
    own, y = xy(routes.ports[port])[1], xy(place)[1]
    routes.more.append((place[0], strip((-MARGIN - OVERHANG, y), xy(place), routes.width)))
    routes.stated[port] = (own + y) / 2, abs(own - y) + routes.width
    edge = rectangle((-MARGIN - 0.1, min(own, y)), (-MARGIN + 0.1, max(own, y)))
    return Planted("short", (place[0] + 1,), edge, routes)


def foreign_balloon(routes: Routes, _: Random, both: tuple[str, Place]) -> Planted:
    """A port with a mouth that is named in one more interface, where another net lies."""
    port, place = both
    shape = strip((CENTRE - 0.5, xy(place)[1]), xy(place), routes.width)
    routes.more.append((place[0], shape))
    routes.named[port] = place[0]
    near = shape | disc(xy(place), PITCH)
    return Planted("short", (place[0] + 1,), near, routes)


def stray(routes: Routes, _: Random, a: Place) -> Planted:
    shape = disc(xy(a), routes.width)
    routes.more.append((a[0], shape))
    return Planted("stray", (a[0] + 1,), shape, routes)


def blind_hole(routes: Routes, _: Random, a: Place) -> Planted:
    routes.holes.append((a[0] + 1, xy(a)))
    return Planted("dead-end", (a[0] + 2,), disc(xy(a), routes.hole / 2), routes)


FAULTS: Mapping[str, tuple[Callable[[Routes], list[Any]], Callable[..., Planted]]] = {
    "cut": (lambda routes: sorted(routes.segments), cut),
    "bridge": (beside_others, bridge),
    "missing-via": (lambda routes: sorted(routes.vias), missing_via),
    "extra-via": (crossings, extra_via),
    "stub": (beside_nothing, stub),
    "leak": (lambda r: [p for p in sorted(r.nodes) if p[1] == r.size[0] - 1], leak),
    "wide-mouth": (lambda routes: routes.mouths, wide_mouth),
    "shared-mouth": (lambda r: mouths_and(r, lambda p, own: p[:2] == (own[0], 0)), shared_mouth),
    "foreign-balloon": (lambda r: mouths_and(r, lambda p, own: p[1:] == own[1:]), foreign_balloon),
    "stray": (unused, stray),
    "blind-hole": (under_nothing, blind_hole),
}
"""Where a fault may be, and how it is planted there."""


def between(a: Point, b: Point, share: float) -> Point:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])


# The raster.


def groups_by_raster(laminate: Laminate) -> tuple[set[frozenset[str]], set[str]]:
    """Return the ports that are joined, by flooding squares, and those that reach the outside.

    A square of an interface is void where a mask lies or a film is missing; air goes on to the next
    square, and to the next interface where the film between has a hole. A tube fills its hole, and
    closes the squares beside the left edge along its inlet's mouth, which it joins.
    """
    low_x, low_y, high_x, high_y = laminate.layers[0].profile.bounds
    # Squares that begin at the edge of the sheet, with one row round it that is outside.
    columns = round((high_x - low_x) / PIXEL) + 2
    rows = round((high_y - low_y) / PIXEL) + 2
    xs = low_x + PIXEL * (np.arange(columns) - 0.5)
    ys = low_y + PIXEL * (np.arange(rows) - 0.5)
    grid_x, grid_y = np.meshgrid(xs, ys)

    def squares(region: Region) -> np.ndarray:
        return shapely.contains_xy(region.shapely(), grid_x, grid_y)

    films = [squares(layer.profile) for layer in laminate.tpe_layers]
    outside = np.zeros_like(films[0])
    outside[0] = outside[-1] = outside[:, 0] = outside[:, -1] = True
    voids, level = [], {layer.index: n for n, layer in enumerate(laminate.tpe_layers)}
    for gap in laminate.interfaces:
        masks = [squares(mask.profile) for mask in gap.masks]
        here = ~films[level[gap.below.index]] | ~films[level[gap.above.index]]
        voids.append(np.logical_or.reduce([here, *masks]) & ~outside)
    first = np.full(outside.shape, 0) + np.arange(outside.size).reshape(outside.shape) + 1
    labels = flood(voids, films, first)
    rim = np.zeros_like(outside)
    rim[1] = rim[-2] = rim[:, 1] = rim[:, -2] = True
    rims = [rim & void for void in voids]
    balloons = [n for n, gap in enumerate(laminate.interfaces) if gap.masks]
    levels = {c.name: [balloons[b - 1] for b in c.balloons] for c in laminate.chambers}
    homes: list[tuple[str, int, int, int]] = []
    for inlet in laminate.inlets:
        near = np.abs(grid_y - inlet.mouth[1]) <= inlet.width / 2 + PAST
        near &= grid_x < low_x + PIXEL
        met = [(n, *at) for n in levels[inlet.chamber] for at in np.argwhere(rim & voids[n] & near)]
        joined_labels = {labels[n][row, column] for n, row, column in met}
        for label in labels:
            label[np.isin(label, [*joined_labels])] = max(joined_labels, default=0)
        for n in levels[inlet.chamber]:
            rims[n] &= ~near
        homes.append((inlet.chamber, *(met or [(0, 0, 0)])[0]))
    leaves = set().union(*(label[edge].tolist() for label, edge in zip(labels, rims, strict=True)))
    for film, n in ((films[0], 0), (films[-1], len(voids) - 1)):
        open_squares = ~film & voids[n]
        for port in laminate.ports:
            if port.kind == "hole" and film is films[-1]:
                x, y = port.at
                open_squares &= np.hypot(grid_x - x, grid_y - y) > 1.0
        leaves |= set(labels[n][open_squares].tolist())
    groups: dict[int, set[str]] = {}
    alone: set[frozenset[str]] = set()
    for name, n, (x, y) in places(laminate, level, levels):
        homes.append((name, n, round((y - low_y) / PIXEL + 0.5), round((x - low_x) / PIXEL + 0.5)))
    for name, n, row, column in homes:
        label = int(labels[n][row, column])
        if label == 0:
            alone.add(frozenset({name}))
        else:
            groups.setdefault(label, set()).add(name)
    joined = {frozenset(names) for names in groups.values()} | alone
    outlets = {name for label, names in groups.items() if label in leaves for name in names}
    return joined, outlets


def places(
    laminate: Laminate, level: dict[int, int], levels: Mapping[str, Sequence[int]]
) -> Iterator[tuple[str, int, Point]]:
    """Every port and every pocket: its name, its interface from 0, and its place."""
    for port in laminate.ports:
        yield port.name, level[port.below], port.at
    for chamber in laminate.chambers:
        for number in levels[chamber.name]:
            yield chamber.name, number, chamber.centres[0]


def flood(
    voids: Sequence[np.ndarray], films: Sequence[np.ndarray], first: np.ndarray
) -> list[np.ndarray]:
    """Label what hangs together: every square takes the largest label beside it, to the end."""
    size = first.size
    labels = [np.where(void, first + n * size, 0) for n, void in enumerate(voids)]
    while True:
        before = [label.copy() for label in labels]
        for n, (label, void) in enumerate(zip(labels, voids, strict=True)):
            for axis in (0, 1):
                run_maximum(label, void, axis)
            if n:
                hole = ~films[n] & void & voids[n - 1]
                most = np.where(hole, np.maximum(labels[n], labels[n - 1]), 0)
                labels[n] = np.where(hole, most, labels[n])
                labels[n - 1] = np.where(hole, most, labels[n - 1])
        if all(np.array_equal(a, b) for a, b in zip(before, labels, strict=True)):
            return labels


def run_maximum(label: np.ndarray, void: np.ndarray, axis: int) -> None:
    """Give all squares of a straight run of void its largest label.

    The squares round a sheet are no void, so that no run goes on from one line to the next.
    """
    lines, open_lines = (label, void) if axis else (label.T, void.T)
    squares, values = open_lines.ravel(), lines.ravel()
    ends = np.flatnonzero(np.diff(squares.astype(np.int8), prepend=0, append=0))
    if len(ends):
        most = np.maximum.reduceat(values, ends)[::2]
        values[squares] = np.repeat(most, np.diff(ends)[::2])
        lines[:] = values.reshape(lines.shape)
