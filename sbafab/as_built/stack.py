"""The laminate of a folder's cut files, inferred from profiles and stacking order."""

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
from sbafab.laminate.joints import balloon_numbers
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
    """Return the laminate of readable files.

    Order, roles and films come from the manifest; tube, bore, lumen and pin diameters from the
    design; names from the nearest claim of the manifest.
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
        middle_first=design.registration.is_middle_first,
    )
    drilled = sorted(
        (hole.centre for hole in bores(layers, design.bore.diameter, bare.lumen)),
        key=lambda place: _nearest_claim(place, claims),
    )
    pins = _tooling_pins(bare, drilled, claims, design)
    first, ends = _tabbed_interface(layers, [pin.centre for pin in pins])
    if first is None:
        return replace(bare, bores=_unnamed_bores(drilled, design), pins=pins)
    names = _chamber_names(ends, claims)
    claimed = [inlet.chamber for inlet in claims.inlets]
    centres: dict[str, list[Point]] = {name: [] for name in (*claimed, *names) if name in names}
    named: list[Bore] = []
    for place in drilled:
        name = names[feeding_tab(ends, place, first)]
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
    """Return the layers of readable files in order; equal profiles share a pattern."""
    patterns: dict[tuple[str, str, int, bool], str] = {}
    layers = []
    z = 0.0
    folded = {index for fold in design.stated_folds for index in (fold.lower, fold.upper)}
    balloons = balloon_numbers([file.claim.role for file in files], design.seamed_layers)
    for file, balloon in zip(files, balloons, strict=True):
        claim = file.claim
        if file.part is not None:
            # Folded layers are cut as one part, so that none is of another layer's pattern.
            number = file.position if file.position in folded else 0
            turned = file.position in design.turned_layers
            shape = (claim.material, file.part.region.key, number, turned)
            layers.append(
                Layer(
                    index=file.position,
                    role=claim.role,
                    film=_film(claim, design),
                    profile=file.part.region,
                    balloon=balloon,
                    z=round(z, 9),
                    pieces=1,
                    pattern=patterns.setdefault(shape, f"P{len(patterns) + 1:02d}"),
                )
            )
        z += claim.thickness
    return tuple(layers)


def _film(claim: LayerClaim, design: Design) -> Film:
    """Return the film of a layer's role, with the claimed name and thickness."""
    film = film_of(design, claim.role, claim.index)
    return replace(film, material=claim.material, thickness=claim.thickness)


def _pieces(layer: Layer, has_lumen: bool, chambers: int, places: int) -> int:
    """Return the number of pieces of a layer by its role: one round a lumen, else one a body.

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


def _tabbed_interface(
    layers: Sequence[Layer], ears: Sequence[Point]
) -> tuple[Interface | None, list[Tab]]:
    """Return the lowest chamber interface with inlet tabs, and these tabs."""
    examined: set[tuple[str, ...]] = set()
    for below, mask, above in zip(layers, layers[1:], layers[2:], strict=False):
        patterns = below.pattern, mask.pattern, above.pattern
        if mask.role != "chamber-mask" or patterns in examined:
            continue
        examined.add(patterns)
        regions = interface_regions(below.profile, above.profile, [mask.profile])
        gap = Interface.between(0, below, above, (mask,), regions)
        inlet_tabs = tabs(gap, ears)
        if inlet_tabs:
            return gap, sorted(inlet_tabs, key=_angle)
    return None, []


def _nearest_claim(place: Point, claims: Manifest) -> int:
    """Return the index of the nearest bore in the manifest."""
    apart = [round(math.dist((bore.x, bore.y), place), 6) for bore in claims.bores]
    return apart.index(min(apart)) if apart else 0


def _angle(tab: Tab) -> tuple[float, float]:
    """Return the angle from the x axis, degrees, and x; rounded, so that 0 is not taken for 360."""
    angle = math.degrees(math.atan2(tab.end[1], tab.end[0])) % 360
    return round(angle, 3) % 360, tab.end[0]


def _chamber_names(ends: Sequence[Tab], claims: Manifest) -> list[str]:
    """Return the chamber of the nearest claimed inlet of each tab, each claim once."""
    unassigned = list(claims.inlets)
    names: list[str] = []
    for tab in ends:
        if unassigned:
            nearest = min(unassigned, key=lambda claim: math.dist((claim.x, claim.y), tab.middle))
            unassigned.remove(nearest)
            names.append(nearest.chamber)
        else:
            names.append(f"unclaimed{len(names) + 1}")
    return names


def _unnamed_bores(places: Sequence[Point], design: Design) -> tuple[Bore, ...]:
    diameter = design.bore.diameter
    return tuple(Bore(f"channel{n}", p, diameter) for n, p in enumerate(places, start=1))


def _inlet(tab: Tab, name: str, design: Design) -> Inlet:
    width = tab.mouth[1] - tab.mouth[0] if tab.mouth else tab.width - 2 * design.rules.bond_width
    tube = design.inlet.tube_outer_diameter
    return Inlet(name, tab.middle, tab.direction, max(width, 0.01), tab.run, tube)


def _channel_pins(
    named: Sequence[Bore], bare: Laminate, claims: Manifest, design: Design
) -> list[Pin]:
    """Return a pin in every bore, and in the lumen if channels register the layers."""
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
    """Return the name of the pin that the manifest claims within 0.5 mm, else ``name``."""
    near = [pin for pin in claims.registration.pins if math.dist((pin.x, pin.y), place) < 0.5]
    return min(near, key=lambda pin: math.dist((pin.x, pin.y), place)).name if near else name


# Inlet tabs, the mouths of their strips and the chambers they feed, found in the profiles.


SQUARE = 0.1
"""Cosine of the largest error of a right angle at a tab: layers may be turned."""
ROUNDED_OFF = 0.9
"""As SQUARE, for short tabs whose large fillets meet the end at an angle."""
STEP = 0.05


class Tab(NamedTuple):
    """A square-ended tab: the middle of its end, unit vector outward, width and straight run, mm.

    ``mouth``: the ends of the strip at the tab's end, as offsets from the middle; None without
    strip.
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
    """Return the inlet tabs of a chamber interface; tabs with a tooling hole are ears."""
    inlet_tabs = []
    for tab in _square_ends(interface.contact):
        is_ear = any(
            0 <= tab.depth(p) <= tab.run + tab.width and abs(tab.offset(p)) <= tab.width / 2
            for p in tooling
        )
        if not is_ear:
            inlet_tabs.append(tab._replace(mouth=_mouth(tab, interface)))
    if not inlet_tabs:
        # Other convex corners may lie beside any straight edge: only a strip tells a tab there.
        aslant = (
            tab._replace(mouth=_mouth(tab, interface))
            for tab in _square_ends(interface.contact, ROUNDED_OFF)
        )
        inlet_tabs += [tab for tab in aslant if tab.mouth]
    return inlet_tabs


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
    """Return the straight length of a tab's side, 0 if a fillet reaches the end."""
    return side.length if isinstance(side, Line) else 0.0


def _turns_square(before: Edge, after: Edge, square: float) -> bool:
    """Return True if two edges meet in a convex right angle, within the cosine ``square``."""
    (ux, uy), (vx, vy) = before.direction(before.end), after.direction(after.start)
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


def feeding_tab(tabs: Sequence[Tab], place: Point, interface: Interface) -> int:
    """Return the index of the tab that feeds the channel or pocket at ``place``.

    The nearest of those whose strip opens into the same pocket; else of those whose strip opens
    into none; else of all.
    """
    pockets = interface.unbonded.pieces if not interface.unbonded.is_empty else ()
    holding = [piece for piece in pockets if _contains(piece, place)]
    opens = [
        [piece for piece in pockets if tab.mouth and _contains(piece, _just_inside(tab))]
        for tab in tabs
    ]
    shared = [n for n, into in enumerate(opens) if any(piece in holding for piece in into)]
    unopened = [n for n, into in enumerate(opens) if not into]
    candidates = shared or unopened or range(len(tabs))
    return min(candidates, key=lambda n: round(math.dist(tabs[n].middle, place), 6))


def inner_point(tab: Tab, interface: Interface) -> Point:
    """Return a point of the pocket behind a tab, half way through the region beyond its run."""
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


def _contains(piece: Region, p: Point) -> bool:
    return any(outer.winding(p) != 0 for outer in piece.outers)


# Bores and tooling holes found in the profiles: what most layers agree on, not what one says.


ORIGIN: Point = (0.0, 0.0)


class Opening(NamedTuple):
    """A hole of many layers in about one place: medians, and the number of layers."""

    centre: Point
    diameter: float
    layers: int


def bores(layers: Sequence[Layer], stated: float, lumen: float | None) -> list[Opening]:
    """Return the channel bores, which have the same place in walls and chamber masks.

    A place counts if most of those layers and half of the masks have a hole within half of the
    ``stated`` diameter, so that a missing or moved hole of one layer does not hide.
    """
    masks = [layer for layer in layers if layer.role == "chamber-mask"]
    bored = [layer for layer in layers if layer.role in ("wall", "chamber-mask")]
    if len(masks) < 2:
        return []
    candidates = [
        opening
        for opening in openings(bored, stated / 2)
        if 2 * opening.layers > len(bored)
        and 2 * _hole_count(opening.centre, masks, stated / 2) >= len(masks)
    ]
    if lumen is None:
        return candidates
    return [opening for opening in candidates if math.dist(opening.centre, ORIGIN) > lumen / 2]


def tooling(layers: Sequence[Layer], pin_diameter: float, taken: Iterable[Point]) -> list[Opening]:
    """Return the pin holes of ears and tails.

    They are in most TPE layers, most separator masks, and the sheet or the lowest chamber mask.
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
    """Return the holes of all layers gathered by place, in the order of their first layer."""
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


def _hole_count(place: Point, layers: Iterable[Layer], nearness: float) -> int:
    """Return the number of layers with a hole at the place."""
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
