"""film-limits: no web or slot is finer than the laser cuts, and all survive the kerf."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.geometry.boolean import GeometryError
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from sbafab.geometry.width import Width, least_gap, least_width
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import Limits, at, holds

NAME = "film-limits"

SHARP = 15.0
"""Degrees: a point sharper than this is a sliver; blunter ones are cut as drawn."""


class _Feature(NamedTuple):
    layer: Layer
    kind: str
    width: Width


def check(laminate: Laminate, limits: Limits) -> list[Finding]:
    """The finest web, slot or gap of any layer; and whether the cut path keeps every contour."""
    limit = limits.least_feature
    lost = _lost_to_kerf(laminate, limits)
    if lost is not None:
        return [lost]
    features = [
        feature for layers in laminate.patterns.values() for feature in _features(layers[0])
    ]
    if not features:
        message = "no layer has a web, slot or gap"
        return [Finding(NAME, "pass", limit, None, "mm", Place(), message)]
    layer, kind, width = min(features, key=lambda feature: feature.width.value)
    good = holds(width.value, limit)
    message = (
        f"the finest feature is a {kind} of {width.value:.3f} mm in layer {layer.index} "
        f"({layer.name}), {at(width.middle)}"
    )
    if not good:
        message += f"; the laser needs {limit:g}: widen it or leave it out"
    place = Place(None, (layer.index,), *width.middle)
    return [Finding(NAME, "pass" if good else "fail", limit, width.value, "mm", place, message)]


def _features(layer: Layer) -> list[_Feature]:
    web, slot = least_width(layer.profile, SHARP), least_gap(layer.profile, SHARP)
    found = (("web", web), ("slot or hole", slot))
    return [_Feature(layer, kind, width) for kind, width in found if width is not None]


def _lost_to_kerf(laminate: Laminate, limits: Limits) -> Finding | None:
    """The first layer whose cut path has other contours than its profile."""
    for layers in laminate.patterns.values():
        layer = layers[0]
        kerf = limits.kerf.get(layer.film.material, 0.0)
        if kerf > 0 and not _keeps_contours(layer.profile, kerf / 2):
            message = (
                f"layer {layer.index} ({layer.name}) loses or joins a hole or piece when its cut "
                f"path is moved by half the kerf of {kerf:g} mm; widen what is narrower than the "
                "kerf"
            )
            place = Place(None, (layer.index,))
            return Finding(NAME, "fail", kerf, None, "mm", place, message)
    return None


def _keeps_contours(profile: Region, distance: float) -> bool:
    try:
        path = grow(profile, distance)
    except GeometryError:
        return False
    same_pieces = len(path.outers) == len(profile.outers)
    return same_pieces and len(path.holes) == len(profile.holes)
