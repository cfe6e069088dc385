"""The yield of a written folder by plain random builds, with nothing of the program.

Layers, pins and steps are read from ``laminate.json`` and ``press.json``, errors and limits from
``design.toml``; what they mean stands in docs/registration.md. Edges are sampled, rays from them
find what they face, and every build adds up all its errors at every sample.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon, prepare
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

Floats = NDArray[np.float64]
SPACING = 0.15
"""mm between samples of an edge, at most."""
STEP = math.radians(2)
"""Between samples of an arc, at most: two arcs come nearest to each other at one place."""
ALIKE = 3
"""Samples of an edge in a row, of which the narrowest counts."""
CHORD = math.radians(1)
"""Arcs are cut into chords of this angle where rays hit them, within 0.0001 mm at 2.5 mm."""
FACING = 0.9
"""Cosine between a ray and the normal of the edge it hits, from which they face each other."""
BESIDE = 1e-3
"""mm from an edge at which it is asked what lies there."""
BEHIND = 0.4
"""mm behind the first edge that a ray hits within which another film's edge ends the same bond."""
ROUNDING = 1e-3
"""mm that a width may miss its limit by: the resolution of cut files."""
AT_ONCE = 2_000
PIN_ERRORS = {"jig-borer": 0.004, "cnc-mill": 0.029, "drill-press": 0.204}
ON_ONE_PIN = 0.004

Part = tuple[int, int]
"""A layer's number and a piece of it."""


class Ring(NamedTuple):
    """A cut contour: samples with their outward normals, chords, and its circle if it is one."""

    layer: int
    number: int
    piece: int
    is_film: bool
    points: Floats
    normals: Floats
    chords: Floats
    circle: tuple[float, float, float] | None


class Sheet(NamedTuple):
    """A layer: its pieces and rings."""

    index: int
    is_film: bool
    pieces: list[BaseGeometry]
    rings: list[Ring]

    @property
    def region(self) -> BaseGeometry:
        return unary_union(self.pieces)


Motion = Floats
"""Shift along x and y and turn about the origin of every build, to first order: mm and radians."""


class Rows(NamedTuple):
    """Places between two rings of an interface: both rings and by how their cuts count, the room of
    each place above its limit, and columns for the shift along x and y of the second ring against
    the first, and for both turns.
    """

    quantity: str
    rings: tuple[Ring, Ring]
    signs: tuple[int, int]
    room: Floats
    factors: Floats


class Errors(NamedTuple):
    """Largest errors, mm and radians, and limits, mm, of a design file."""

    cut: float
    pin: float
    placement: float
    turn: float
    bond: float
    overhang: float
    drawn_overhang: float


def judged_yield(folder: Path, builds: int = 100_000, seed: int = 1) -> float:
    """Return the share of good builds of a written folder."""
    document = json.loads((folder / "laminate.json").read_text(encoding="utf-8"))
    steps = json.loads((folder / "press.json").read_text(encoding="utf-8"))["steps"]
    design = tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))
    errors = _errors(design, document["pins"])
    sheets = _sheets(document)
    interfaces = list(_interfaces(sheets))
    places = _places(interfaces, document, errors)
    dice = np.random.Generator(np.random.SFC64(seed))
    good = 0
    for first in range(0, builds, AT_ONCE):
        count = min(AT_ONCE, builds - first)
        motions = _motions(sheets, document["pins"], steps, errors, dice, count)
        cuts: dict[tuple[int, int], Floats] = {
            (ring.layer, ring.number): dice.uniform(-errors.cut, errors.cut, count)
            for sheet in sheets.values()
            for ring in sheet.rings
        }
        is_good = np.ones(count, dtype=bool)
        for rows in places:
            is_good &= _keeps(rows, motions, cuts)
        good += int(is_good.sum())
    return good / builds


def _errors(design: dict[str, Any], pins: Sequence[dict[str, Any]]) -> Errors:
    keys, rules = design["registration"], design["rules"]
    machine = keys["plate_made_by"]
    usual = PIN_ERRORS[machine] if len(pins) > 1 else ON_ONE_PIN
    return Errors(
        keys["cutting_error"],
        keys.get("pin_error", usual),
        keys["hand_placement"],
        math.radians(keys["hand_turn"]),
        rules["worst_bond_width"],
        rules["worst_mask_overhang"],
        rules["mask_overhang"],
    )


# Layers.


def _sheets(document: dict[str, Any]) -> dict[int, Sheet]:
    sheets = {}
    for row in document["layers"]:
        is_film = document["films"][row["film"]]["kind"] != "mask"
        sheets[row["index"]] = _sheet(row["index"], is_film, document["shapes"][row["shape"]])
    return sheets


def _sheet(index: int, is_film: bool, contours: list[list[list[Any]]]) -> Sheet:
    outlines = [_corners(contour) for contour in contours]
    areas = [Polygon(outline) for outline in outlines]
    is_outer = [area.exterior.is_ccw for area in areas]
    pieces: list[BaseGeometry] = []
    piece_of: dict[int, int] = {}
    for place, number in enumerate(np.flatnonzero(is_outer).tolist()):
        holes = [
            other
            for other, area in enumerate(areas)
            if not is_outer[other] and areas[number].contains(area.representative_point())
        ]
        pieces.append(Polygon(outlines[number], [outlines[other] for other in holes]))
        piece_of |= dict.fromkeys((number, *holes), place)
    rings = [
        _ring(index, number, piece_of[number], is_film, contour)
        for number, contour in enumerate(contours)
    ]
    return Sheet(index, is_film, pieces, rings)


def _at(edge: list[Any], shares: Floats) -> Floats:
    """Places along an edge: x, y and the normal out of the region, which lies to its left."""
    x1, y1, x2, y2 = edge[:4]
    if len(edge) == 4:
        length = math.dist((x1, y1), (x2, y2))
        normal = [(y2 - y1) / length, (x1 - x2) / length]
        return np.array([[x1 + s * (x2 - x1), y1 + s * (y2 - y1), *normal] for s in shares])
    cx, cy, radius, left = edge[4:]
    angles = math.atan2(y1 - cy, x1 - cx) + _sweep(edge) * shares
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.hstack([(cx, cy) + radius * out, out if left else -out])


def _sweep(edge: list[Any]) -> float:
    """Signed angle of an arc; 0 of a line."""
    if len(edge) == 4:
        return 0.0
    x1, y1, x2, y2, cx, cy, _, left = edge
    turn = (math.atan2(y2 - cy, x2 - cx) - math.atan2(y1 - cy, x1 - cx)) % math.tau
    if left:
        return turn or math.tau
    return turn - math.tau if turn else -math.tau


def _corners(contour: list[list[Any]]) -> Floats:
    """The beginnings of its edges, and of the chords of its arcs."""
    counts = [max(1, math.ceil(abs(_sweep(edge)) / CHORD)) for edge in contour]
    found = [_at(edge, np.arange(n) / n) for edge, n in zip(contour, counts, strict=True)]
    return np.concatenate(found)[:, :2]


def _samples(edge: list[Any]) -> Floats:
    if len(edge) == 4:
        count = max(1, math.ceil(math.dist(edge[:2], edge[2:]) / SPACING))
    else:
        count = max(1, math.ceil(abs(_sweep(edge)) * max(edge[6] / SPACING, 1 / STEP)))
    return _at(edge, (np.arange(count) + 0.5) / count)


def _ring(layer: int, number: int, piece: int, is_film: bool, contour: list[list[Any]]) -> Ring:
    places = np.concatenate([_samples(edge) for edge in contour])
    corners = _corners(contour)
    chords = np.hstack([corners, np.roll(corners, -1, axis=0)])
    circles = {tuple(np.round(edge[4:7], 6)) if len(edge) > 4 else None for edge in contour}
    circle = circles.pop() if len(circles) == 1 else None
    return Ring(layer, number, piece, is_film, places[:, :2], places[:, 2:], chords, circle)


# Where bonds and overhangs are narrow.


Interface = tuple[Sheet, Sheet, list[Sheet]]


def _interfaces(sheets: dict[int, Sheet]) -> Iterator[Interface]:
    below: Sheet | None = None
    masks: list[Sheet] = []
    for index in sorted(sheets):
        sheet = sheets[index]
        if not sheet.is_film:
            masks.append(sheet)
            continue
        if below is not None:
            yield below, sheet, masks
        below, masks = sheet, []


def _places(
    interfaces: Sequence[Interface], document: dict[str, Any], errors: Errors
) -> list[Rows]:
    """Bonds, then overhangs, of every interface. Equal shapes are searched once."""
    shape_of = {row["index"]: row["shape"] for row in document["layers"]}
    known: dict[tuple[int, ...], list[tuple[str, list[tuple[Any, ...]]]]] = {}
    places = []
    for below, above, masks in interfaces:
        seats = (below, above, *masks)
        key = tuple(shape_of[sheet.index] for sheet in seats)
        if key not in known:
            holes = [
                (*pin["centre"], (pin["diameter"] + pin["clearance"]) / 2)
                for pin in document["pins"]
            ]
            known[key] = [
                ("bond", list(_bonds(below, above, masks, errors))),
                ("overhang", list(_overhangs(below, above, masks, errors, holes))),
            ]
        for quantity, found in known[key]:
            places += _rows(quantity, found, seats, errors)
    return places


def _rows(
    quantity: str, found: list[tuple[Any, ...]], seats: Sequence[Sheet], errors: Errors
) -> Iterator[Rows]:
    limit = errors.bond if quantity == "bond" else errors.overhang
    pairs: dict[tuple[int, ...], list[tuple[Any, ...]]] = defaultdict(list)
    for row in found:
        pairs[row[:4]].append(row[4:])
    for (seat, ring, other_seat, other), rows in pairs.items():
        rings = seats[seat].rings[ring], seats[other_seat].rings[other]
        first, second = (1 if each.is_film == (quantity == "bond") else -1 for each in rings)
        narrow = [
            min(rows[number : number + ALIKE], key=lambda row: float(row[2]))
            for number in range(0, len(rows), ALIKE)
        ]
        start, along = (np.array([row[place] for row in narrow]).T for place in (0, 1))
        width = np.array([row[2] for row in narrow])
        end = start + width * along
        # Displacement of the end less that of the start, along the direction.
        turns = [along[1] * x - along[0] * y for x, y in (end, start)]
        factors = np.column_stack([*along, turns[0], -turns[1]])
        yield Rows(quantity, rings, (first, second), width - limit + ROUNDING, factors)


def _bonds(
    below: Sheet, above: Sheet, masks: Sequence[Sheet], errors: Errors
) -> Iterator[tuple[Any, ...]]:
    contact = below.region & above.region
    cover = unary_union([mask.region for mask in masks])
    bond = contact - cover
    prepare(bond)
    seats = (below, above, *masks)
    for seat, sheet in enumerate(seats):
        for number, ring in enumerate(sheet.rings):
            # Into the bond: into the film, or out of the mask.
            inward = -ring.normals if sheet.is_film else ring.normals
            for point, direction in zip(ring.points, inward, strict=True):
                if bond.contains(Point(*(point + BESIDE * direction))):
                    for hit in _hits(point, direction, seats, (seat, number), errors.bond):
                        yield (seat, number, *hit[:2], point, direction, hit[2])


def _overhangs(
    below: Sheet,
    above: Sheet,
    masks: Sequence[Sheet],
    errors: Errors,
    holes: Sequence[tuple[float, float, float]],
) -> Iterator[tuple[Any, ...]]:
    cover = unary_union([mask.region for mask in masks])
    unbonded = (below.region & above.region) & cover
    if unbonded.is_empty:
        return
    prepare(cover)
    prepare(unbonded)
    seats = (below, above, *masks)
    for seat, sheet in enumerate(seats[:2]):
        for number, ring in enumerate(sheet.rings):
            for point, normal in zip(ring.points, ring.normals, strict=True):
                outside, inside = (
                    Point(*(point + BESIDE * normal)),
                    Point(*(point - BESIDE * normal)),
                )
                if not (cover.contains(outside) and unbonded.contains(inside)):
                    continue
                for hit in _hits(
                    point, normal, seats, (seat, number), errors.overhang, masks_only=True
                ):
                    if hit[2] < errors.drawn_overhang - ROUNDING and _is_pinned(ring, holes):
                        continue
                    yield (seat, number, *hit[:2], point, normal, hit[2])


def _is_pinned(ring: Ring, holes: Sequence[tuple[float, float, float]]) -> bool:
    """Return True if the ring is a hole that a pin fills: masks may be flush there."""
    return ring.circle is not None and any(
        math.dist(ring.circle, hole) < 2 * ROUNDING for hole in holes
    )


def _hits(
    point: Floats,
    direction: Floats,
    seats: Sequence[Sheet],
    own: tuple[int, int],
    limit: float,
    masks_only: bool = False,
) -> Iterator[tuple[int, int, float]]:
    """Yield seat, ring and distance of what a ray meets, near the first of all."""
    found = []
    for seat, sheet in enumerate(seats):
        if masks_only and sheet.is_film:
            continue
        for number, ring in enumerate(sheet.rings):
            distance = _distance(point, direction, ring.chords)
            if distance is not None and distance[0] > 2 * BESIDE:
                found.append((distance[0], distance[1], seat, number))
    if not found:
        return
    nearest = min(found)[0]
    for far, is_facing, seat, number in found:
        if far <= nearest + BEHIND and is_facing and far < limit + 1.5:
            yield seat, number, far


def _distance(point: Floats, direction: Floats, chords: Floats) -> tuple[float, bool] | None:
    """Distance along a ray to the first chord that it crosses, and whether that faces it."""
    start, end = chords[:, :2], chords[:, 2:]
    along = end - start
    off = start - point
    cross = direction[0] * along[:, 1] - direction[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0]) / cross
        share = (off[:, 0] * direction[1] - off[:, 1] * direction[0]) / cross
    hit = (far > 2 * BESIDE) & (share >= 0) & (share <= 1)
    if not hit.any():
        return None
    number = int(np.where(hit, far, np.inf).argmin())
    cosine = abs(cross[number]) / math.hypot(*along[number])
    return float(far[number]), bool(cosine >= FACING)


# Random builds.


def _keeps(
    rows: Rows, motions: dict[Part, Motion], cuts: dict[tuple[int, int], Floats]
) -> NDArray[np.bool_]:
    """Return in which builds all places keep their limit."""
    names = [(ring.layer, ring.number) for ring in rows.rings]
    first, second = (motions[ring.layer, ring.piece] for ring in rows.rings)
    # An edge that faces itself counts twice.
    cut = rows.signs[0] * cuts[names[0]] + rows.signs[1] * cuts[names[1]]
    moves = np.stack([*(second - first)[:2], second[2], first[2]])
    most = np.abs(moves).max(axis=1)
    near = rows.room < np.abs(cut).max() + np.abs(rows.factors) @ most
    left = rows.factors[near] @ moves + rows.room[near][:, None]
    keeps: NDArray[np.bool_] = (left >= -cut).all(axis=0)
    return keeps


def _motions(
    sheets: dict[int, Sheet],
    pins: Sequence[dict[str, Any]],
    steps: Sequence[dict[str, Any]],
    errors: Errors,
    dice: np.random.Generator,
    count: int,
) -> dict[Part, Motion]:
    """Return how each piece of each layer lies off its place once all steps are done."""
    still = np.zeros((3, count))
    motions = {
        (index, piece): still
        for index, sheet in sheets.items()
        for piece in range(len(sheet.pieces))
    }
    bodies: list[list[Part]] = [[part] for part in sorted(motions)]
    for step in steps:
        layers = set(step["layers"])
        present = sorted(body for body in bodies if body[0][0] in layers)
        held = [_held(body, sheets, pins, step["pins"]) for body in present]
        for body, play in zip(present, held, strict=True):
            under = None if play else _under(body, present, sheets)
            if not play and under is None and not any(held):
                continue
            own = _body_motion(body, sheets, play, errors, dice, count)
            if under is not None:
                own = own + motions[under]
            for part in body:
                motions[part] = motions[part] + own
        bodies = [body for body in bodies if body[0][0] not in layers]
        bodies += _joined(present, sheets)
    return motions


def _held(
    body: list[Part],
    sheets: dict[int, Sheet],
    pins: Sequence[dict[str, Any]],
    names: Sequence[str],
) -> dict[tuple[float, float], float]:
    """Play on each pin of the step that fits a hole of the body, by the pin's centre."""
    play: dict[tuple[float, float], float] = {}
    for pin in pins:
        if pin["name"] not in names:
            continue
        centre = tuple(pin["centre"])
        for layer, piece in body:
            for ring in sheets[layer].rings:
                if ring.piece != piece or ring.circle is None:
                    continue
                x, y, radius = ring.circle
                loose = radius - pin["diameter"] / 2
                if math.dist((x, y), centre) < 1e-3 and loose <= pin["clearance"] / 2 + 1e-3:
                    play[centre] = min(play.get(centre, math.inf), max(loose, 0.0))
    return play


def _under(
    body: list[Part], present: Sequence[list[Part]], sheets: dict[int, Sheet]
) -> Part | None:
    """Return the highest film of what lies under a body."""
    lowest = min(body)[0]
    feet = [sheets[layer].pieces[piece] for layer, piece in body if layer == lowest]
    below = [(part, other) for other in present for part in other if part[0] < lowest]
    for (layer, piece), other in sorted(below, reverse=True):
        if any(foot.intersection(sheets[layer].pieces[piece]).area > 1e-6 for foot in feet):
            films = [part for part in other if part[0] < lowest and sheets[part[0]].is_film]
            return max(films or [part for part in other if part[0] < lowest])
    return None


def _body_motion(
    body: list[Part],
    sheets: dict[int, Sheet],
    play: dict[tuple[float, float], float],
    errors: Errors,
    dice: np.random.Generator,
    count: int,
) -> Motion:
    reach = errors.pin + min(play.values()) if play else errors.placement
    most_turn, (cx, cy) = errors.turn, (0.0, 0.0)
    if len(play) >= 2:
        turns = []
        for (a, loose), (b, other) in combinations(play.items(), 2):
            share = loose / (loose + other) if loose + other else 0.0
            between = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
            turns.append(((loose + other) / math.dist(a, b), between))
        most_turn, (cx, cy) = min(turns)
    elif play:
        (cx, cy) = next(iter(play))
    else:
        pieces = [sheets[layer].pieces[piece] for layer, piece in body]
        area = sum(piece.area for piece in pieces)
        cx = sum(piece.area * piece.centroid.x for piece in pieces) / area
        cy = sum(piece.area * piece.centroid.y for piece in pieces) / area
    radius = reach * np.sqrt(dice.random(count))
    angle = dice.uniform(0, math.tau, count)
    turn = dice.uniform(-most_turn, most_turn, count)
    return np.stack([radius * np.cos(angle) + turn * cy, radius * np.sin(angle) - turn * cx, turn])


def _joined(present: Sequence[list[Part]], sheets: dict[int, Sheet]) -> list[list[Part]]:
    """Bodies that lie on each other have become one."""
    groups = [list(body) for body in present]
    layers = sorted({layer for body in present for layer, _ in body})
    for lower, upper in zip(layers, layers[1:], strict=False):
        for i, a in enumerate(sheets[lower].pieces):
            for j, b in enumerate(sheets[upper].pieces):
                one = next(group for group in groups if (lower, i) in group)
                other = next(group for group in groups if (upper, j) in group)
                if one is not other and a.intersection(b).area > 1e-6:
                    groups.remove(other)
                    one += other
    return [sorted(group) for group in groups]
