"""film-limits: no web or slot is finer than the laser cuts, and all survive the kerf."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.errors import GeometryError
from sbafab.geometry.offset import beam_path, widths
from sbafab.geometry.region import Region
from sbafab.geometry.width import TAPER, Width, least_gap, least_width, place_of
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import at, holds
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "film-limits"

SHARP = TAPER
"""Degrees: between flanks at less a point is finer than any bottom; blunter ones are corners."""

ROUNDING = 1e-6
"""mm: more than the rounding of widths."""


class _Feature(NamedTuple):
    layer: Layer
    kind: str
    width: Width


def check(measures: Measures) -> list[Finding]:
    """The finest web, slot or gap of any layer; and whether the cut path keeps every contour."""
    laminate, design = measures.laminate, measures.design
    limit = design.laser.least_feature
    lost = _lost_to_kerf(laminate, design)
    if lost is not None:
        return [lost]
    finest = _finest(laminate)
    if finest is None:
        message = "no layer has a web, slot or gap"
        return [Finding(NAME, "pass", limit, None, "mm", Place(), message)]
    layer, kind, width = finest
    good = holds(width.value, limit)
    message = (
        f"the finest feature is a {kind} of {width.value:.3f} mm in layer {layer.index} "
        f"({layer.name}), {at(width.middle)}"
    )
    if not good:
        remedy = "widen it" if width.value else "end it blunt and as wide as that"
        message += f"; the laser needs {limit:g}: {remedy} or leave it out"
    place = Place(None, (layer.index,), *width.middle)
    return [Finding(NAME, "pass" if good else "fail", limit, width.value, "mm", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "nothing is finer than the laser cuts, before and after kerf",
        "A slot or web below the beam's own width burns away or stays uncut.",
        "Make the feature at the place named wider, or measure the kerf.",
        ("laser.least_feature", "laser.kerf_tpe", "laser.kerf_ptfe"),
    ),
)


def _finest(laminate: Laminate) -> _Feature | None:
    """The narrowest web or slot of all layers; wider ones than the holes known are skipped."""
    layers = [
        (layers_of_pattern[0], laminate.as_cut(layers_of_pattern[0]))
        for layers_of_pattern in laminate.patterns.values()
    ]
    round_holes = (hole.circle for _, cut in layers for hole in cut.holes if hole.circle)
    narrowest = min((2 * radius for _, radius in round_holes), default=math.inf)
    return _finer(layers, narrowest + ROUNDING) or _finer(layers, math.inf)


def _finer(layers: Iterable[tuple[Layer, Region]], than: float) -> _Feature | None:
    """Return the narrowest feature below ``than`` mm, or None."""
    finest: _Feature | None = None
    for layer, cut in layers:
        for kind, least in (("web", least_width), ("slot or hole", least_gap)):
            width = least(cut, SHARP, than)
            if width is not None and (finest is None or width.value < than):
                finest, than = _Feature(layer, kind, width), width.value
    return finest


def _lost_to_kerf(laminate: Laminate, design: Design) -> Finding | None:
    """The first layer whose cut path has other contours than its profile."""
    for layers in laminate.patterns.values():
        layer = layers[0]
        kerf = design.kerf_widths.get(layer.film.material) or 0.0
        if max(widths(kerf)) == 0:
            continue
        place, fault = Place(None, (layer.index,)), "loses or joins a hole or piece"
        try:
            lost = beam_path(laminate.as_cut(layer), kerf).lost
            if lost is None:
                continue
            spot = place_of(laminate.as_cut(layer), lost, kerf)
            place = Place(None, (layer.index,), *spot)
            kind = "hole" if lost.contour.is_hole else "outline"
            fault = f"has a {kind} that {lost.fate} at {at(spot)}"
        except GeometryError:
            pass
        width = " x ".join(f"{w:g}" for w in dict.fromkeys(widths(kerf)))
        message = (
            f"layer {layer.index} ({layer.name}) {fault} when its cut path is moved by half the "
            f"kerf of {width} mm; widen what is narrower than the kerf"
        )
        return Finding(NAME, "fail", max(widths(kerf)), None, "mm", place, message)
    return None
