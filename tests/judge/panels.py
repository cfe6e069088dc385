"""Registered sheets: both cuts are made here, and what comes free of them goes to the other judges.

Films lie on each other as they are drawn, masks face down, the one way that the pins let them. The
second cut takes its slots out of the films. Then each copy is a stack like any other, and the rest
is scrap that must lift off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import shapely
from shapely import MultiPolygon, Point, Polygon, affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import judge_bonds
from tests.judge.facing import judge_facing
from tests.judge.folder import Disagreement, Folder, Hole, Layer, asked_kerf, pieces, place
from tests.judge.overhangs import judge_overhangs
from tests.judge.reading import read
from tests.judge.voids import judge_voids

STACKED = (judge_facing, judge_bonds, judge_overhangs, judge_voids)
ROUND = 0.995
"""Area of a hole over that of a circle with its circumference, at least, if it is a bore."""
STANDING = 0.01
"""mm by which a pin is thinner here than its hole in the plate."""
SPECKLE = 0.02
"""mm: what is thinner is rounding between a slot's side and a part's edge."""


@dataclass(frozen=True)
class Copy(Folder):
    """The stack in one place, once it is free: no pin holds it, bonds go round its ``bores``."""

    bores: tuple[Hole, ...] = ()

    @property
    def holes(self) -> tuple[Hole, ...]:  # type: ignore[override]
        return self.bores


def judge_panel(folder: Folder) -> Iterator[Disagreement]:
    """What each copy is once it is free, and that sheets hold it before and let it go after."""
    panel = folder.manifest["panel"]
    slots = _slots(folder, panel["second_cut"])
    lying = {}
    for layer in folder.layers:
        ways = list(_as_laid(folder, layer))
        if len(ways) != 1:
            yield Disagreement("panel", f"layer {layer.index} goes on its pins in {len(ways)} ways")
            return
        lying[layer.index] = ways[0]
    for layer in folder.films:
        if len(list(pieces(lying[layer.index], SPECKLE))) != 1:
            yield Disagreement("panel", f"film {layer.index} falls apart before the second cut")
    places = [(spot["x"], spot["y"]) for spot in panel["places"]]
    free = {
        layer.index: lying[layer.index].difference(slots)
        if not layer.is_mask
        else lying[layer.index]
        for layer in folder.layers
    }
    scrap = dict(free)
    for number, (x, y) in enumerate(places, start=1):
        layers = []
        for layer in folder.layers:
            own = _part(free[layer.index], folder, (x, y))
            if own.is_empty:
                yield Disagreement("panel", f"nothing of layer {layer.index} is in place {number}")
                return
            scrap[layer.index] = scrap[layer.index].difference(own.buffer(1e-6))
            moved = affinity.translate(own, -x, -y)
            layers.append(replace(layer, path=moved, profile=moved))
        copy = Copy(**_fields(folder) | {"layers": tuple(layers)}, bores=_bores(layers))
        for judge in STACKED:
            for found in judge(copy):
                yield found._replace(said=f"place {number}: {found.said}")
    yield from _stuck(folder, free, scrap)


def _fields(folder: Folder) -> dict[str, Any]:
    return {field.name: getattr(folder, field.name) for field in fields(folder)}


def _slots(folder: Folder, file: str) -> BaseGeometry:
    """What the second cut takes away: its contours, and half a beam more all round."""
    drawing = read(folder.path / file)
    slots = shapely.union_all([Polygon(c.points) for c in drawing.on("CUT_OUTER", "CUT_INNER")])
    kerf = asked_kerf(folder.asked, "TPE")
    return slots if kerf is None else slots.buffer(max(kerf) / 2)


def _as_laid(folder: Folder, layer: Layer) -> Iterator[BaseGeometry]:
    """Ways in which the sheet goes on the pins: films as drawn or turned round, masks face down."""
    here, there = _middle(layer.profile), _middle(folder.layers[0].profile)
    centred = affinity.translate(layer.profile, -here.x, -here.y)
    ways = ((-1.0, 1.0), (1.0, -1.0)) if layer.is_mask else ((1.0, 1.0), (-1.0, -1.0))
    for x, y in ways:
        turned = affinity.scale(centred, x, y, origin=(0, 0))
        laid = affinity.translate(turned, there.x, there.y)
        if not any(laid.intersects(_pin(hole)) for hole in folder.holes):
            yield laid


def _middle(region: BaseGeometry) -> Point:
    return shapely.box(*region.bounds).centroid


def _pin(hole: Hole) -> BaseGeometry:
    return Point(hole.x, hole.y).buffer(hole.radius - STANDING)


def _sheet(region: BaseGeometry) -> Polygon:
    return max(pieces(region), key=lambda piece: Polygon(piece.exterior).area)


def _part(region: BaseGeometry, folder: Folder, at: tuple[float, float]) -> BaseGeometry:
    """The pieces inside the windows that lie nearest to a place."""
    sheet = _sheet(region)
    loose = [piece for piece in pieces(region, SPECKLE) if piece is not sheet and piece != sheet]
    panel = folder.manifest["panel"]
    spots = [Point(spot["x"], spot["y"]) for spot in panel["places"]]
    own = spots.index(Point(at))
    near = [p for p in loose if min(range(len(spots)), key=lambda i: p.distance(spots[i])) == own]
    return MultiPolygon(near)


def _bores(layers: Sequence[Layer]) -> tuple[Hole, ...]:
    """Round holes in the films of a copy: pins take none of them, bonds go round them."""
    found = {}
    for layer in layers:
        for piece in () if layer.is_mask else pieces(layer.profile):
            for ring in piece.interiors:
                hole = Polygon(ring)
                if 4 * math.pi * hole.area > ROUND * ring.length**2:
                    middle, radius = hole.centroid, math.sqrt(hole.area / math.pi)
                    key = round(middle.x, 2), round(middle.y, 2), round(radius, 2)
                    found[key] = Hole(middle.x, middle.y, radius)
    return tuple(found.values())


def _stuck(
    folder: Folder, free: dict[int, BaseGeometry], scrap: dict[int, BaseGeometry]
) -> Iterator[Disagreement]:
    """Scrap of one film that touches a part of the next, with nothing between."""
    for interface in folder.interfaces:
        masks = shapely.union_all([free[mask.index] for mask in interface.masks])
        for one, other in (
            (interface.below.index, interface.above.index),
            (interface.above.index, interface.below.index),
        ):
            part = free[other].difference(scrap[other].buffer(1e-6))
            touching = scrap[one].intersection(part).difference(masks)
            for spot in pieces(touching, SPECKLE):
                yield Disagreement(
                    "panel",
                    f"scrap of film {one} is bonded to a part of film {other}: {place(spot)}",
                )
