"""The laminate that the cut files of a folder make, inferred from profiles and stacking order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from sbafab.actuators.stacking import channel_pin, film_of
from sbafab.as_built.cut_files import LayerFile
from sbafab.as_built.inlets import Tab, feeding, inner_point, tabs
from sbafab.as_built.openings import ORIGIN, bores, tooling
from sbafab.design.records import Design
from sbafab.geometry.edges import Point
from sbafab.laminate.films import Film
from sbafab.laminate.interfaces import Interface, interface_regions
from sbafab.laminate.laminate import Bore, Chamber, Inlet, Laminate, Layer, Pin
from sbafab.output.manifest_records import LayerClaim, Manifest


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
