"""Films that face each other in the press with nothing between: they weld there."""

from __future__ import annotations

from collections.abc import Iterator

import shapely
from shapely import Point
from shapely.geometry.base import BaseGeometry

from tests.judge.folder import Folder, Layer, pieces, place
from tests.judge.pins import play

THINNEST = 0.004
"""mm: narrower overlaps are what flattened arcs make of edges that coincide."""


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
