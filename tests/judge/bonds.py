"""Where films bond, and how wide; and where others face each other."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from tests.judge.folder import Folder, Interface, Layer, asked_kerf, pieces, place
from tests.judge.pins import play

THINNEST = 0.004
"""mm: narrower bonds are what flattened arcs make of edges that coincide."""
TAPER = math.radians(30.0)
"""Edges at a wider angle to each other are a corner, no bond that tapers (docs/rules.md)."""
SQUARE = math.cos(TAPER / 2 + 0.02)
ROUNDED = 1 - math.cos(math.radians(20.0))
"""Share of half a kerf by which a corner that the beam rounds seems narrower than the bond is."""
NEAREST = 0.002
"""mm: points of one edge, or of both sides of a sharp corner's tip."""
STEP = 0.05
FAN = math.radians(10.0)
Array = NDArray[np.float64]


def bond_of(interface: Interface) -> BaseGeometry:
    """Where two consecutive films touch."""
    bond = interface.below.profile.intersection(interface.above.profile)
    for mask in interface.masks:
        bond = bond.difference(mask.profile)
    return shapely.MultiPolygon(list(pieces(bond, THINNEST)))


def judge_bonds(folder: Folder) -> Iterator[str]:
    """Every bond is as wide as the design's limit, and between balloons lies round a pin's hole."""
    seen = set()
    kerfs = [asked_kerf(folder.asked, film) or (0.0, 0.0) for film in ("tpe", "ptfe")]
    limit = folder.bond_limit - folder.slack - ROUNDED * max(map(max, kerfs)) / 2
    for interface in folder.interfaces:
        if interface.shape in seen:
            continue
        seen.add(interface.shape)
        bond = bond_of(interface)
        where = f"interface {interface.number}"
        for width, x, y in narrow_places(bond, limit):
            yield (
                f"the bond of {where} is {width:.4f} wide at x {x:.3f}, y {y:.3f}, where "
                f"{folder.bond_limit:g} are asked for"
            )
        if not interface.is_chamber and interface.below.role != "sheet":
            yield from _stray(folder, bond, where)
        if bond.is_empty:
            yield f"nothing bonds at {where}"


def _stray(folder: Folder, bond: BaseGeometry, where: str) -> Iterator[str]:
    """Bonds between two balloons that are no ring round a bore, and no ear: neighbours that weld.

    An ear is as wide as its pin and two bonds, and ends as far from the pin.
    """
    width = float(folder.wish("bond", "width", 0.75))
    back = float(folder.wish("mask", "overhang", 0.5)) if folder.method != "channel-pin" else 0.0
    meant = shapely.union_all(
        [
            shapely.Point(hole.x, hole.y).buffer(math.sqrt(2) * (hole.radius + width) + back + 0.01)
            for hole in folder.holes
        ]
    )
    for part in pieces(bond.difference(meant), THINNEST):
        yield f"{part.area:.4f} mm2 of {where} bond where there is no bore, at {place(part)}"


def narrow_places(region: BaseGeometry, limit: float) -> Iterator[tuple[float, float, float]]:
    """Width, x and y of the narrowest place of each part of a region that is below a limit.

    Measured between points of its edges that face each other through the region.
    """
    for part in pieces(region):
        points, normals = _samples(part)
        pairs = KDTree(points).query_pairs(limit, output_type="ndarray")
        ways = points[pairs[:, 1]] - points[pairs[:, 0]]
        lengths = np.hypot(ways[:, 0], ways[:, 1])
        apart = lengths > NEAREST
        pairs, ways, lengths = pairs[apart], ways[apart], lengths[apart]
        along = ways / lengths[:, None]
        one, other = normals[pairs[:, 0]], normals[pairs[:, 1]]
        facing = (
            ((one * other).sum(axis=1) <= -math.cos(TAPER))
            & ((along * one).sum(axis=1) >= SQUARE)
            & ((along * other).sum(axis=1) <= -SQUARE)
        )
        inside = part.buffer(1e-4)
        shapely.prepare(inside)
        for number in np.flatnonzero(facing)[np.argsort(lengths[facing])]:
            ends = points[pairs[number]]
            if inside.covers(LineString(ends)):
                x, y = ends.mean(axis=0)
                yield float(lengths[number]), float(x), float(y)
                break


def sampled(corners: Array, step: float, with_ends: bool) -> tuple[Array, Array]:
    """Points along a ring, at most a step apart, with the normals to the left of its edges: with
    the ends of every edge, or the middles of its steps.
    """
    ways = np.diff(corners, axis=0)
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    keep = lengths > 1e-7
    starts, ways, lengths = corners[:-1][keep], ways[keep], lengths[keep]
    counts = np.maximum(1, np.ceil(lengths / step)).astype(int)
    places = [(np.arange(n + 1) if with_ends else np.arange(n) + 0.5) / n for n in counts.tolist()]
    owner = np.repeat(np.arange(len(counts)), counts + with_ends)
    left = np.stack([-ways[:, 1], ways[:, 0]], axis=1) / lengths[:, None]
    return starts[owner] + ways[owner] * np.concatenate(places)[:, None], left[owner]


def _samples(part: Polygon) -> tuple[Array, Array]:
    """Points along the edges with the normals into the material; at concave corners a fan."""
    part = shapely.geometry.polygon.orient(part)
    found = []
    for ring in (part.exterior, *part.interiors):
        # The material lies to the left.
        points, normals = sampled(np.asarray(ring.coords), STEP, True)
        found.append((points, normals))
        headings = np.arctan2(normals[:, 1], normals[:, 0])
        before = np.roll(headings, 1)
        turns = (headings - before + math.pi) % (2 * math.pi) - math.pi
        for number in np.flatnonzero(turns < -0.02):  # the material bulges round a corner
            count = math.ceil(-turns[number] / FAN)
            at = before[number] + turns[number] * np.arange(1, count) / count
            fan = np.stack([np.cos(at), np.sin(at)], axis=1)
            found.append((np.tile(points[number], (len(fan), 1)), fan))
    points, normals = (np.concatenate(columns) for columns in zip(*found, strict=True))
    return points, normals


# Films that face each other in the press with nothing between: they weld there.


def judge_facing(folder: Folder) -> Iterator[str]:
    """No two films but consecutive ones see each other, other than down a pinned bore."""
    bores = shapely.union_all(
        [Point(hole.x, hole.y).buffer(hole.radius + play(folder) + 0.003) for hole in folder.holes]
    )
    for below, above, seen in _sights(folder):
        for part in pieces(seen.difference(bores), THINNEST):
            yield (
                f"films {below} and {above} face each other over {part.area:.4f} mm2 with "
                f"nothing between, at {place(part)}"
            )


def _sights(folder: Folder) -> Iterator[tuple[int, int, BaseGeometry]]:
    """Pairs of films that are not consecutive, and where one sees the other."""
    layers = folder.layers
    known: dict[tuple[int, ...], list[tuple[int, BaseGeometry]]] = {}
    for start, lowest in enumerate(layers):
        if lowest.is_mask:
            continue
        key = tuple(layer.shape for layer in layers[start:])
        if key not in known:
            known[key] = list(_seen_from(layers[start:]))
        for ahead, seen in known[key]:
            yield lowest.index, layers[start + ahead].index, seen


def _seen_from(layers: tuple[Layer, ...]) -> Iterator[tuple[int, BaseGeometry]]:
    open_sky: BaseGeometry = layers[0].profile
    passed = 0
    for ahead, layer in enumerate(layers[1:], start=1):
        if not layer.is_mask:
            passed += 1
            if passed > 1:
                seen = open_sky.intersection(layer.profile)
                if not seen.is_empty:
                    yield ahead, seen
        open_sky = open_sky.difference(layer.profile)
        if open_sky.is_empty:
            return
