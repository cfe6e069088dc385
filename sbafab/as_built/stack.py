"""The laminate that the cut files of a folder make, inferred from profiles and stacking order."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from sbafab.actuators.stacking import channel_pin, film_of
from sbafab.as_built.cut_files import LayerFile
from sbafab.design.records import Design
from sbafab.geometry.contour import Contour, tidy
from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import (
    LOOSE,
    Bore,
    Chamber,
    Inlet,
    Interface,
    Laminate,
    Layer,
    Pin,
    interface_regions,
)
from sbafab.output.manifest import LayerClaim, Manifest
from sbafab.rules.boundary import edges_along
from sbafab.rules.limits import TOLERANCE


def laminate_of(files: Sequence[LayerFile], claims: Manifest, design: Design) -> Laminate:
    """The laminate of files that could all be read.

    From the manifest come order, roles and films, from the design what the user stated: tube,
    bore, lumen and pin diameters. Names alone follow what the manifest calls the nearest place.
    """
    layers = stacked_layers(files, design)
    bare = Laminate(
        name=claims.name,
        family=claims.family,
        layers=layers,
        chambers=(),
        bores=(),
        inlets=(),
        pins=(),
        lumen=design.form.lumen,
        balloons=sum(layer.role == "chamber-mask" for layer in layers),
        registration=design.registration.method,
        pins_in_full_bonds=design.registration.full_bond_pins == "in",
    )
    drilled = sorted(
        (hole.centre for hole in bores(layers, design.bore.diameter, bare.lumen)),
        key=lambda place: _nearest_claim(place, claims),
    )
    pins = _tooling_pins(bare, drilled, claims, design)
    first, ends = _tabbed(layers, [pin.centre for pin in pins])
    if first is None:
        return replace(bare, bores=_nameless(drilled, design), pins=pins)
    names = _chamber_names(ends, claims)
    known = [inlet.chamber for inlet in claims.inlets]
    centres: dict[str, list[Point]] = {name: [] for name in (*known, *names) if name in names}
    named: list[Bore] = []
    for place in drilled:
        name = names[feeding(ends, place, first)]
        centres[name].append(place)
        named.append(Bore(name, place, design.bore.diameter))
    for tab, name in zip(ends, names, strict=True):
        if not centres[name]:
            centres[name].append(inner_point(tab, first))
    places = sum(len(points) for points in centres.values())
    return replace(
        bare,
        layers=tuple(
            replace(layer, pieces=_pieces(layer, bare.lumen is not None, len(centres), places))
            for layer in layers
        ),
        chambers=tuple(Chamber(name, tuple(points)) for name, points in centres.items()),
        bores=tuple(named),
        inlets=tuple(_inlet(tab, name, design) for tab, name in zip(ends, names, strict=True)),
        pins=(*_channel_pins(named, bare, claims, design), *pins),
    )


def stacked_layers(files: Sequence[LayerFile], design: Design) -> tuple[Layer, ...]:
    """The layers whose files could be read, in the manifest's order; equal profiles one pattern."""
    patterns: dict[tuple[str, str], str] = {}
    layers = []
    z, balloon = 0.0, 0
    for number, file in enumerate(files):
        claim = file.claim
        following = files[number + 1].claim.role if number + 1 < len(files) else None
        balloon += claim.role == "chamber-mask"
        is_below = not claim.role.endswith("-mask") and following == "chamber-mask"
        own = balloon + 1 if is_below else balloon
        if file.part is not None:
            shape = (claim.material, file.part.region.key)
            layers.append(
                Layer(
                    index=file.position,
                    role=claim.role,
                    film=_film(claim, design),
                    profile=file.part.region,
                    balloon=None if claim.role == "sheet" or own == 0 else own,
                    z=round(z, 9),
                    pieces=1,
                    pattern=patterns.setdefault(shape, f"P{len(patterns) + 1:02d}"),
                )
            )
        z += claim.thickness
    return tuple(layers)


def _film(claim: LayerClaim, design: Design) -> Film:
    """The film of a layer's role, as thick and of the name that the manifest claims."""
    film = film_of(design, claim.role)
    return replace(film, material=claim.material, thickness=claim.thickness)


def _pieces(layer: Layer, has_lumen: bool, chambers: int, places: int) -> int:
    """The parts a layer has by its role: bodies hang together round a lumen, else stand alone.

    In the bottom balloon, where inlets may be shared, one for each chamber.
    """
    if layer.role == "sheet":
        return 1
    is_bottom = layer.balloon is None or layer.balloon == 1
    if layer.role == "separator-mask":
        is_bottom = layer.balloon is None
    if has_lumen and layer.role != "chamber-mask":
        return 1
    return chambers if is_bottom else places


def _tabbed(layers: Sequence[Layer], ears: Sequence[Point]) -> tuple[Interface | None, list[Tab]]:
    """The lowest chamber interface with inlet tabs, and those."""
    seen: set[tuple[str, ...]] = set()
    for below, mask, above in zip(layers, layers[1:], layers[2:], strict=False):
        patterns = below.pattern, mask.pattern, above.pattern
        if mask.role != "chamber-mask" or patterns in seen:
            continue
        seen.add(patterns)
        regions = interface_regions(below.profile, above.profile, [mask.profile])
        gap = Interface.between(0, below, above, (mask,), regions)
        found = tabs(gap, ears)
        if found:
            return gap, sorted(found, key=_angle)
    return None, []


def _nearest_claim(place: Point, claims: Manifest) -> int:
    """The place in the manifest's order of the bore that it names nearest."""
    apart = [round(math.dist((bore.x, bore.y), place), 6) for bore in claims.bores]
    return apart.index(min(apart)) if apart else 0


def _angle(tab: Tab) -> tuple[float, float]:
    """From the x axis on counter-clockwise; rounded, so that 0 is not taken for a whole turn."""
    angle = math.degrees(math.atan2(tab.end[1], tab.end[0])) % 360
    return round(angle, 3) % 360, tab.end[0]


def _chamber_names(ends: Sequence[Tab], claims: Manifest) -> list[str]:
    """The claimed chamber of the nearest claimed inlet, each claim once."""
    left = list(claims.inlets)
    names: list[str] = []
    for tab in ends:
        if left:
            nearest = min(left, key=lambda claim: math.dist((claim.x, claim.y), tab.middle))
            left.remove(nearest)
            names.append(nearest.chamber)
        else:
            names.append(f"unclaimed{len(names) + 1}")
    return names


def _nameless(places: Sequence[Point], design: Design) -> tuple[Bore, ...]:
    diameter = design.bore.diameter
    return tuple(Bore(f"channel{n}", p, diameter) for n, p in enumerate(places, start=1))


def _inlet(tab: Tab, name: str, design: Design) -> Inlet:
    width = tab.mouth[1] - tab.mouth[0] if tab.mouth else tab.width - 2 * design.rules.bond_width
    tube = design.inlet.tube_outer_diameter
    return Inlet(name, tab.middle, tab.direction, max(width, 0.01), tab.run, tube)


def _channel_pins(
    named: Sequence[Bore], bare: Laminate, claims: Manifest, design: Design
) -> list[Pin]:
    """A pin in every bore, and in the lumen where the channels register the layers."""
    pins = [channel_pin(bore.chamber, bore.centre, design.bore) for bore in named]
    if bare.lumen is not None and design.registration.method == "channel-pin":
        pin = design.form.lumen_pin or bare.lumen
        pins.append(Pin("lumen", ORIGIN, pin, bare.lumen - pin))
    return [replace(pin, name=_pin_name(pin.centre, pin.name, claims)) for pin in pins]


def _tooling_pins(
    bare: Laminate, drilled: Sequence[Point], claims: Manifest, design: Design
) -> tuple[Pin, ...]:
    if design.registration.method != "ears":
        return ()
    diameter, clearance = design.registration.pin_diameter, design.registration.pin_clearance
    taken = [*drilled, ORIGIN]
    return tuple(
        Pin(_pin_name(hole.centre, f"ear{number}", claims), hole.centre, diameter, clearance)
        for number, hole in enumerate(tooling(bare.layers, diameter + clearance, taken), start=1)
    )


def _pin_name(place: Point, name: str, claims: Manifest) -> str:
    """What the manifest calls the pin at about this place."""
    near = [pin for pin in claims.registration.pins if math.dist((pin.x, pin.y), place) < 0.5]
    return min(near, key=lambda pin: math.dist((pin.x, pin.y), place)).name if near else name


# Inlet tabs, the mouths of their strips and the chambers they feed, found in the profiles.


SQUARE = 0.1
"""Cosine up to which a tab's corner counts as square: a turned layer still has its tabs."""
ROUNDED_OFF = 0.9
"""The same where a large fillet takes all of a short tab's sides, and comes aslant to its end."""
STEP = 0.05


class Tab(NamedTuple):
    """A square-ended tab: the middle of its end, unit vector outward, its width, its straight run.

    ``mouth`` holds the ends of the strip in the tab's end, as offsets from the middle; None where
    no strip reaches it.
    """

    end: Point
    direction: Point
    width: float
    run: float
    mouth: tuple[float, float] | None

    def at(self, depth: float, offset: float = 0.0) -> Point:
        (x, y), (dx, dy) = self.end, self.direction
        return x - dx * depth + dy * offset, y - dy * depth - dx * offset

    def depth(self, p: Point) -> float:
        (x, y), (dx, dy) = self.end, self.direction
        return (x - p[0]) * dx + (y - p[1]) * dy

    def offset(self, p: Point) -> float:
        (x, y), (dx, dy) = self.end, self.direction
        return (p[0] - x) * dy - (p[1] - y) * dx

    @property
    def middle(self) -> Point:
        """The middle of the mouth, or of the tab's end."""
        return self.at(0.0, sum(self.mouth) / 2) if self.mouth else self.end


def tabs(interface: Interface, tooling: Sequence[Point]) -> list[Tab]:
    """The inlet tabs of a chamber interface; those with a tooling hole are ears."""
    found = []
    for tab in _square_ends(interface.contact):
        is_ear = any(
            0 <= tab.depth(p) <= tab.run + tab.width and abs(tab.offset(p)) <= tab.width / 2
            for p in tooling
        )
        if not is_ear:
            found.append(tab._replace(mouth=_mouth(tab, interface)))
    if not found:
        # Other convex corners may lie beside any straight edge: only a strip tells a tab there.
        aslant = (
            tab._replace(mouth=_mouth(tab, interface))
            for tab in _square_ends(interface.contact, ROUNDED_OFF)
        )
        found += [tab for tab in aslant if tab.mouth]
    return found


def _square_ends(contact: Region, square: float = SQUARE) -> Iterator[Tab]:
    for outer in contact.outers:
        edges = (tidy(outer.edges) or outer).edges
        for i, edge in enumerate(edges):
            before, after = edges[i - 1], edges[(i + 1) % len(edges)]
            if (
                isinstance(edge, Line)
                and _turns_square(before, edge, square)
                and _turns_square(edge, after, square)
            ):
                ux, uy = edge.direction(edge.start)
                run = min(_straight(before), _straight(after))
                yield Tab(edge.at(0.5), (uy, -ux), edge.length, run, None)


def _straight(side: Edge) -> float:
    """How far a tab's side runs straight: not at all where its fillet reaches the end."""
    return side.length if isinstance(side, Line) else 0.0


def _turns_square(one: Edge, other: Edge, square: float) -> bool:
    """Whether two edges meet in a convex corner, no further off a right angle than ``square``."""
    (ux, uy), (vx, vy) = one.direction(one.end), other.direction(other.start)
    return abs(ux * vx + uy * vy) < square and ux * vy - uy * vx > 0


def _mouth(tab: Tab, interface: Interface) -> tuple[float, float] | None:
    offsets = [
        tab.offset(p)
        for edge in edges_along(interface.unbonded, interface.contact)
        if abs(tab.depth(edge.start)) < TOLERANCE and abs(tab.depth(edge.end)) < TOLERANCE
        for p in (edge.start, edge.end)
        if abs(tab.offset(p)) <= tab.width / 2 + TOLERANCE
    ]
    return (min(offsets), max(offsets)) if offsets else None


def feeding(tabs: Sequence[Tab], place: Point, interface: Interface) -> int:
    """Which tab feeds the channel or pocket at ``place``.

    The nearest of those whose strip opens into the same pocket; else of those whose strip opens
    into none; else of all.
    """
    pockets = interface.unbonded.pieces if not interface.unbonded.is_empty else ()
    holding = [piece for piece in pockets if _holds(piece, place)]
    opens = [
        [piece for piece in pockets if tab.mouth and _holds(piece, _just_inside(tab))]
        for tab in tabs
    ]
    own = [n for n, into in enumerate(opens) if any(piece in holding for piece in into)]
    lost = [n for n, into in enumerate(opens) if not into]
    candidates = own or lost or range(len(tabs))
    return min(candidates, key=lambda n: round(math.dist(tabs[n].middle, place), 6))


def inner_point(tab: Tab, interface: Interface) -> Point:
    """A point of the pocket behind a tab: half way through what lies beyond the tab's run."""
    for region in (interface.unbonded, interface.contact):
        depth = tab.run + STEP
        offset = tab.offset(tab.middle)
        while region.contains(tab.at(depth, offset)):
            depth += STEP
        if depth > tab.run + 10 * STEP:
            return tab.at((tab.run + depth) / 2, offset)
    return tab.at(tab.run + tab.width)


def _just_inside(tab: Tab) -> Point:
    return tab.at(10 * TOLERANCE, tab.offset(tab.middle))


def _holds(piece: Region, p: Point) -> bool:
    return any(outer.winding(p) != 0 for outer in piece.outers)


# Bores and tooling holes found in the profiles: what most layers agree on, not what one says.


ORIGIN: Point = (0.0, 0.0)


class Opening(NamedTuple):
    """A hole that many layers have at about one place: medians, and in how many layers."""

    centre: Point
    diameter: float
    layers: int


def bores(layers: Sequence[Layer], stated: float, lumen: float | None) -> list[Opening]:
    """The channel bores, bottom to top the same place in walls and chamber masks.

    A place counts where most of those layers and half of the masks have a hole within half of
    the ``stated`` diameter, so that one layer's missing or moved hole does not hide.
    """
    masks = [layer for layer in layers if layer.role == "chamber-mask"]
    bored = [layer for layer in layers if layer.role in ("wall", "chamber-mask")]
    if len(masks) < 2:
        return []
    found = [
        opening
        for opening in openings(bored, stated / 2)
        if 2 * opening.layers > len(bored)
        and 2 * _near(opening.centre, masks, stated / 2) >= len(masks)
    ]
    if lumen is None:
        return found
    return [opening for opening in found if math.dist(opening.centre, ORIGIN) > lumen / 2]


def tooling(layers: Sequence[Layer], pin_diameter: float, taken: Iterable[Point]) -> list[Opening]:
    """Pin holes of ears and tails: in most TPE layers, most separator masks, the sheet or the
    lowest chamber mask, nowhere else.
    """
    places = list(taken)

    def fits(hole: Contour) -> bool:
        circle = hole.circle
        return circle is not None and abs(2 * circle[1] - pin_diameter) < LOOSE

    groups = (
        [layer for layer in layers if layer.role in ("base", "wall", "cap")],
        [layer for layer in layers if layer.role == "separator-mask"],
        [layer for layer in layers if layer.role == "sheet"],
        [layer for layer in layers if layer.role == "chamber-mask"][:1],
    )
    return [
        opening
        for group in groups
        for opening in openings(group, LOOSE, fits)
        if 2 * opening.layers > len(group)
        and all(math.dist(opening.centre, place) > pin_diameter for place in places)
    ]


def openings(
    layers: Sequence[Layer], nearness: float, fits: Callable[[Contour], bool] = lambda hole: True
) -> list[Opening]:
    """Holes of all layers gathered by place, in the order of their first layer."""
    from statistics import median

    places: list[list[tuple[Point, float]]] = []
    for layer in layers:
        for hole in filter(fits, layer.profile.holes):
            centre, diameter = _place(hole)
            group = next((g for g in places if math.dist(g[0][0], centre) < nearness), None)
            if group is None:
                places.append(group := [])
            group.append((centre, diameter))
    return [
        Opening(
            (median(c[0] for c, _ in group), median(c[1] for c, _ in group)),
            median(d for _, d in group),
            len(group),
        )
        for group in places
    ]


def _near(place: Point, layers: Iterable[Layer], nearness: float) -> int:
    """How many layers have a hole at the place."""
    return sum(
        any(math.dist(_place(hole)[0], place) < 2 * nearness for hole in layer.profile.holes)
        for layer in layers
    )


def _place(hole: Contour) -> tuple[Point, float]:
    if hole.circle is not None:
        centre, radius = hole.circle
        return centre, 2 * radius
    low_x, low_y, high_x, high_y = hole.bounds
    return ((low_x + high_x) / 2, (low_y + high_y) / 2), min(high_x - low_x, high_y - low_y)
