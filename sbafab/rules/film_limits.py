"""film-limits: no web or slot is below the laser's limit, and all survive the kerf."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sbafab.design.records import Design
from sbafab.errors import GeometryError
from sbafab.geometry.offset import beam_path, widths
from sbafab.geometry.region import Region
from sbafab.geometry.width import TAPER, Width, least_gap, least_width, place_of
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.limits import holds
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name, say

NAME = "film-limits"

SHARP = TAPER
"""Degrees: between flanks at less a point is finer than any bottom; blunter ones are corners."""

ROUNDING = 1e-6
"""mm: more than the rounding of widths."""


def check(measures: Measures) -> list[Finding]:
    """Return the narrowest web, slot or gap of all layers, and whether contours survive kerf."""
    laminate, design = measures.laminate, measures.design
    limit = design.laser.least_feature
    lost = _lost_to_kerf(laminate, design)
    if lost is not None:
        return [lost]
    finest = _finest(laminate)
    if finest is None:
        return [judged(NAME, True, limit, None, "mm", Place(), "none")]
    layer, kind, width = finest
    sentence = "finest" if width.value else "pointed"
    facts = {"kind": kind, "layer": layer_name(layer)}
    place, good = Place(None, (layer.index,), *width.middle), holds(width.value, limit)
    return [judged(NAME, good, limit, width.value, "mm", place, sentence, **facts)]


RULE = Rule(NAME, check, explained(NAME))


def _finest(laminate: Laminate) -> tuple[Layer, str, Width] | None:
    """Return the narrowest web or slot of all layers; skip those wider than the known holes."""
    layers = [
        (layers_of_pattern[0], laminate.as_cut(layers_of_pattern[0]))
        for layers_of_pattern in laminate.patterns.values()
    ]
    round_holes = (hole.circle for _, cut in layers for hole in cut.holes if hole.circle)
    narrowest = min((2 * radius for _, radius in round_holes), default=math.inf)
    return _finer(layers, narrowest + ROUNDING) or _finer(layers, math.inf)


def _finer(layers: Iterable[tuple[Layer, Region]], than: float) -> tuple[Layer, str, Width] | None:
    """Return the narrowest feature below ``than`` mm, or None."""
    finest: tuple[Layer, str, Width] | None = None
    for layer, cut in layers:
        for kind, least in (("web", least_width), ("slot or hole", least_gap)):
            width = least(cut, SHARP, than)
            if width is not None and (finest is None or width.value < than):
                finest, than = (layer, kind, width), width.value
    return finest


def _lost_to_kerf(laminate: Laminate, design: Design) -> Finding | None:
    """Return the first layer whose cut path and profile have different contours."""
    for layers in laminate.patterns.values():
        layer = layers[0]
        kerf = design.kerf_widths.get(layer.film.material) or 0.0
        if max(widths(kerf)) == 0:
            continue
        place, fault = Place(None, (layer.index,)), say("film-limits.unnamed")
        try:
            _, lost = beam_path(laminate.as_cut(layer), kerf)
            if lost is None:
                continue
            spot = place_of(laminate.as_cut(layer), lost, kerf)
            place = Place(None, (layer.index,), *spot)
            kind = "hole" if lost.contour.is_hole else "outline"
            fault = say("film-limits.contour", kind=kind, fate=lost.fate)
        except GeometryError:
            pass
        limit, width = max(widths(kerf)), " x ".join(f"{w:g}" for w in dict.fromkeys(widths(kerf)))
        facts = {"layer": layer_name(layer), "fault": fault, "kerf": width}
        return judged(NAME, False, limit, None, "mm", place, "lost", **facts)
    return None
