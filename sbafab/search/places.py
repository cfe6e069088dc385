"""Where in an actuator a finding lies, in words."""

from __future__ import annotations

import math

from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Place

RING = 1.0
"""mm round a bore or the lumen that still belong to it: a bond and its mask."""


def place_said(laminate: Laminate, where: Place) -> str:
    """For example "at the lumen", "at the inlet tab of chamber2"; empty where nothing is known."""
    if where.x is None or where.y is None:
        return ""
    x, y = where.x, where.y
    if laminate.lumen is not None and math.hypot(x, y) <= laminate.lumen / 2 + RING:
        return "at the lumen"
    for bore in laminate.bores:
        if math.dist((x, y), bore.centre) <= bore.diameter / 2 + RING:
            return f"at the bore of {bore.chamber}"
    for inlet in laminate.inlets:
        mouth, along = inlet.mouth, inlet.direction
        back = (mouth[0] - x) * along[0] + (mouth[1] - y) * along[1]
        aside = abs((mouth[0] - x) * along[1] - (mouth[1] - y) * along[0])
        if -RING <= back <= inlet.length and aside <= inlet.width / 2 + RING:
            return f"at the inlet tab of {inlet.chamber}"
    return "at the rim"
