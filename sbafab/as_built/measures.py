"""Claims of the manifest in numbers: areas, pieces, patterns, interfaces, bores, pins, batches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from sbafab.as_built.claims import claim, waiver_properties
from sbafab.as_built.cut_files import CutPart, LayerFile, claimed_properties, read_part
from sbafab.as_built.records import CLAIMS, INTEGRITY, Problem
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.laminate.assembly import PLATE_MARGIN
from sbafab.laminate.laminate import LOOSE, Laminate, Layer, Pin
from sbafab.output.manifest import Manifest
from sbafab.pressing.cycles import APART, are_apart
from sbafab.rules.limits import TOLERANCE, at

SHARE = 1e-4
"""Relative tolerance of areas."""


def layer_problems(files: Iterable[LayerFile], claims: Manifest) -> list[Problem]:
    """Return differences of area, pieces and open bores of layers from their files."""
    problems = []
    for file in files:
        if file.part is None:
            continue
        layer, region = file.claim, file.part.region
        if abs(region.area - layer.area) > _area_room(region, file.part):
            problems.append(
                claim(
                    f"{file.label} has an area of {region.area:.4f} mm2, the manifest says "
                    f"{layer.area:.4f}",
                    file.position,
                )
            )
        if len(region.pieces) != layer.pieces:
            problems.append(
                claim(
                    f"{file.label} falls into {len(region.pieces)} pieces, the manifest says "
                    f"{layer.pieces}",
                    file.position,
                )
            )
        holes = region.holes
        drilled = tuple(
            bore.chamber
            for bore in claims.bores
            if any(hole.winding((bore.x, bore.y)) != 0 for hole in holes)
        )
        if drilled != layer.bores:
            problems.append(
                claim(
                    f"{file.label} is open at the bores of {_listed(drilled)}, the manifest "
                    f"says {_listed(layer.bores)}",
                    file.position,
                )
            )
    return problems


def _area_room(region: Region, part: CutPart) -> float:
    """Return the tolerance of an area, mm2: its share, the error of its edges, rounded corners."""
    length = sum(contour.length for contour in region.contours)
    return SHARE * region.area + part.corner_room + (part.chord_error + TOLERANCE) * length


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


def pattern_problems(layers: Sequence[Layer], claims: Manifest) -> list[Problem]:
    """Return layers that share a pattern only in the manifest or only on disk.

    Patterns that differ by less than the tolerance of files may be equal on disk: the areas in the
    manifest then differ.
    """
    problems = []
    areas = [layer.area for layer in claims.layers]
    claimed_of: dict[str, tuple[str, int]] = {}
    cut_of: dict[str, tuple[str, int]] = {}
    for layer in layers:
        claimed = claims.layers[layer.index - 1].pattern
        pattern, first = cut_of.setdefault(claimed, (layer.pattern, layer.index))
        if pattern != layer.pattern:
            message = f"layers {first} and {layer.index} are both of pattern {claimed} and differ"
            problems.append(claim(message, first, layer.index))
        name, twin = claimed_of.setdefault(layer.pattern, (claimed, layer.index))
        one_area = areas[twin - 1] == areas[layer.index - 1]
        if name != claimed and pattern == layer.pattern and one_area:
            message = (
                f"layers {twin} and {layer.index} are equal, and of patterns {name}, {claimed}"
            )
            problems.append(claim(message, twin, layer.index))
    return problems


def interface_problems(
    laminate: Laminate, claims: Manifest, parts: Sequence[CutPart]
) -> list[Problem]:
    """Return differences of kind, layers, contact and bond of interfaces."""
    interfaces, claimed = laminate.interfaces, claims.interfaces
    if len(interfaces) != len(claimed):
        return [
            claim(
                f"the layers make {len(interfaces)} interfaces, the manifest lists {len(claimed)}"
            )
        ]
    problems = []
    for gap, gap_claim in zip(interfaces, claimed, strict=True):
        masks = tuple(mask.index for mask in gap.masks)
        structure = (gap.below.index, gap.above.index, masks, gap.kind)
        if structure != (gap_claim.below, gap_claim.above, gap_claim.masks, gap_claim.kind):
            message = (
                f"interface {gap.index} is a {gap.kind} interface of layers "
                f"{', '.join(map(str, gap.layer_indices))}, which the manifest tells otherwise"
            )
            problems.append(claim(message, *gap.layer_indices))
            continue
        lot = [parts[index - 1] for index in gap.layer_indices]
        for kind, region, area in (
            ("contact", gap.contact, gap_claim.contact_area),
            ("bond", gap.bond, gap_claim.bond_area),
        ):
            room = sum(_area_room(part.region, part) - SHARE * part.region.area for part in lot)
            if abs(region.area - area) > room + SHARE * area:
                message = (
                    f"the {kind} at {gap.kind} interface {gap.index} has {region.area:.4f} mm2, "
                    f"the manifest says {area:.4f}"
                )
                problems.append(Problem(CLAIMS, message, gap.layer_indices, gap.index))
    return problems


def place_problems(laminate: Laminate, claims: Manifest) -> list[Problem]:
    """Return differences of place and width of bores, inlets, pins and lumen."""
    room = TOLERANCE
    pairs: list[tuple[str, Sequence[_Spot], Sequence[_Spot]]] = [
        (
            "bore",
            [(b.chamber, (b.x, b.y), b.diameter) for b in claims.bores],
            [(b.chamber, b.centre, b.diameter) for b in laminate.bores],
        ),
        (
            "inlet",
            [(i.chamber, (i.x, i.y), i.width) for i in claims.inlets],
            [(i.chamber, i.mouth, i.width) for i in laminate.inlets],
        ),
        (
            "pin",
            [(p.name, (p.x, p.y), p.diameter) for p in claims.registration.pins],
            [(p.name, p.centre, p.diameter) for p in laminate.pins],
        ),
    ]
    problems = [
        problem
        for feature, claimed, cut in pairs
        for problem in _unmatched(feature, claimed, cut, room)
    ]
    if (claims.lumen is None) != (laminate.lumen is None) or (
        claims.lumen is not None
        and laminate.lumen is not None
        and abs(claims.lumen - laminate.lumen) > room
    ):
        message = f"the lumen is {claims.lumen} in the manifest and {laminate.lumen} by design.toml"
        problems.append(claim(message))
    for inlet in claims.inlets:
        tubes = {inlet_cut.tube_diameter for inlet_cut in laminate.inlets}
        if any(abs(tube - inlet.tube_outer_diameter) > room for tube in tubes):
            message = (
                f"the tube of {inlet.chamber} is {inlet.tube_outer_diameter:g} in the manifest"
            )
            problems.append(claim(f"{message} and {min(tubes):g} by design.toml"))
    return problems


def size_problems(claims: Manifest, sizes: Mapping[str, float], room: float) -> list[Problem]:
    """Return differences of overall sizes, mm, from the cut parts."""
    return [
        claim(
            f"the {name.replace('_', ' ')} is {claims.sizes.get(name, math.nan):g} mm in the "
            f"manifest and {size:g} as cut"
        )
        for name, size in (dict.fromkeys(claims.sizes, math.nan) | dict(sizes)).items()
        if not abs(claims.sizes.get(name, math.nan) - size) <= room
    ]


_Spot = tuple[str, Point, float]


def _unmatched(
    feature: str, claimed: Sequence[_Spot], cut: Sequence[_Spot], room: float
) -> list[Problem]:
    """Return claims without a place in the cut files, and places without a claim."""

    def agree(a: _Spot, candidate: _Spot) -> bool:
        return (
            a[0] == candidate[0]
            and math.dist(a[1], candidate[1]) <= room + 1e-6
            and abs(a[2] - candidate[2]) <= 2 * room
        )

    def description(spot: _Spot) -> str:
        return f"{feature} of {spot[0]}, {spot[2]:.3f} wide at {at(spot[1])}"

    return [
        *(
            claim(f"the manifest has a {description(spot)}, which the cut files have not")
            for spot in claimed
            if not any(agree(spot, candidate) for candidate in cut)
        ),
        *(
            claim(f"the cut files have a {description(spot)}, which the manifest has not")
            for spot in cut
            if not any(agree(spot, candidate) for candidate in claimed)
        ),
    ]


def fixture_problems(folder: Path, laminate: Laminate, claims: Manifest) -> list[Problem]:
    """Return problems of the base plate: soundness, a hole for every pin and no other."""
    if claims.fixture is None:
        return [claim("the manifest names no fixture for the pins")] if laminate.pins else []
    if claims.fixture not in claims.files:
        return [claim(f"the fixture {claims.fixture!r} is not among the manifest's files")]
    try:
        part = read_part(
            folder / claims.fixture,
            properties=claimed_properties(claims, "plate"),
            has_letters=True,
        )
    except OutputError as error:
        name = Path(claims.fixture).name
        reason = str(error).removeprefix(f"{name}: ")
        return [Problem(INTEGRITY, f"{claims.fixture}: {reason}")]
    circles = [hole.circle for hole in part.region.holes]
    holes = [("hole", c[0], 2 * c[1]) for c in circles if c is not None]
    pins = [
        ("hole", (pin.centre[0] + x, pin.centre[1] + y), pin.diameter)
        for x, y in _places(claims)
        for pin in laminate.pins
    ]
    room = TOLERANCE
    for name, stated in waiver_properties(claims).items() if part.properties else ():
        actual = part.properties.get(name)
        if actual != stated:
            return [
                claim(f"{claims.fixture}: custom property {name} is {actual!r}, not {stated!r}")
            ]
    problems = _unmatched("pin's hole of the plate", pins, holes, room)
    if problems or len(circles) != len(pins):
        of = "laminate has" if len(_places(claims)) == 1 else "laminates at its places have"
        return [claim(f"{claims.fixture} has other holes than the {of} pins")]
    return []


def batch_problems(laminate: Laminate, claims: Manifest, design: Design) -> list[Problem]:
    """Return cycles that do not make all copies, and places too near each other or off the
    platen.
    """
    if claims.copies == 1:
        return []
    batch = claims.batch
    if batch is None:
        return [claim("the manifest does not say how copies are pressed; regenerate the folder")]
    problems = []
    if sum(batch.cycles) != claims.copies or max(batch.cycles) > len(batch.places):
        problems.append(
            claim(
                f"the cycles press {sum(batch.cycles)} copies at {len(batch.places)} places, and "
                f"{claims.copies} are ordered"
            )
        )
    places, bounds = _places(claims), laminate.bounds
    if not are_apart(places, bounds, 2 * TOLERANCE):
        problems.append(claim(f"places in the press are less than {APART:g} mm apart"))
    room = sorted(design.press.platen)
    margin = 2 * PLATE_MARGIN if laminate.pins else 0.0
    taken = sorted(
        max(p[i] for p in places) - min(p[i] for p in places) + bounds[i + 2] - bounds[i] + margin
        for i in (0, 1)
    )
    if len(places) > 1 and any(a > b + 2 * TOLERANCE for a, b in zip(taken, room, strict=True)):
        width, length = taken
        problems.append(
            claim(f"the places take {width:.1f} x {length:.1f} mm, more than the heated area has")
        )
    return problems


def _places(claims: Manifest) -> tuple[Point, ...]:
    """Return the places of the laminates of a press cycle on their plate."""
    if claims.batch is None:
        return ((0.0, 0.0),)
    return tuple((place.x, place.y) for place in claims.batch.places)


def with_plate_pins(folder: Path, laminate: Laminate, claims: Manifest) -> Laminate:
    """Return the laminate with a pin in every hole of the plate."""
    if claims.fixture is None or claims.fixture not in claims.files:
        return laminate
    try:
        holes = read_part(folder / claims.fixture, has_letters=True).region.holes
    except OutputError:
        return laminate
    names = {(pin.x, pin.y): pin.name for pin in claims.registration.pins}
    pins = list(laminate.pins)
    low_x, low_y, high_x, high_y = laminate.bounds
    middle = (low_x + high_x) / 2, (low_y + high_y) / 2
    for number, (spot, radius) in enumerate((h.circle for h in holes if h.circle), start=1):
        # Its position within the nearest laminate on the plate.
        candidates = [(spot[0] - x, spot[1] - y) for x, y in _places(claims)]
        centre = min(candidates, key=lambda place: math.dist(place, middle))
        if not any(
            math.dist(pin.centre, centre) < LOOSE and abs(pin.diameter - 2 * radius) < LOOSE
            for pin in pins
        ):
            near = [name for place, name in names.items() if math.dist(place, centre) < LOOSE]
            pins.append(Pin(near[0] if near else f"plate{number}", centre, 2 * radius))
    return replace(laminate, pins=tuple(pins))
