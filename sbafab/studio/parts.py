"""What the page draws of an assembly: each part's surface once, and where it stands.

A surface is sent under its key once, in the part's own frame, and not again to a page that says it
has it: a part that is moved costs nothing but its place.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from sbafab import api

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled, PlacedPart
    from sbafab.meshing.surface import Surface

PLACED_BY = {"on", "at", "angle", "along", "offset", "glue", "note", "design", "set"}
"""Keys of a part that do not change its own surface; of an actuator its laminate does."""


def parts_model(assembled: Assembled, has: Collection[str]) -> dict[str, Any]:
    """Parts with their places, each after what it is fixed on, and surfaces the page lacks."""
    surfaces: dict[str, dict[str, str]] = {}
    parts = []
    for placed in assembled.parts:
        key = _key(placed)
        if key not in has and key not in surfaces:
            surfaces[key] = _surface(placed, key)
        parts.append({**_part(placed), "surface": key})
    return {"kind": "parts", "parts": parts, "surfaces": surfaces}


def _part(placed: PlacedPart) -> dict[str, Any]:
    part, made = placed.part, placed.made
    design = None
    if made is not None:
        design = {
            "name": made.design.name,
            "family": made.design.family,
            "values": api.resolved(made.design),
        }
    return {
        "name": placed.name,
        "kind": part.kind,
        "on": part.on,
        "at": part.at,
        "design": design,
        "rows": [list(row) for row in placed.pose.rows],
        "shift": list(placed.pose.shift),
    }


def _key(placed: PlacedPart) -> str:
    """Names a surface by all that decides it."""
    own: list[Any] = [placed.turn, placed.radius]
    if placed.made is None:
        own.append(placed.part.model_dump(mode="json", exclude=PLACED_BY))
    else:
        layers = placed.made.laminate.layers
        own += [(one.profile.key, one.z, one.film.thickness, one.is_mask) for one in layers]
    return hashlib.sha256(repr(own).encode()).hexdigest()[:24]


def _surface(placed: PlacedPart, key: str) -> dict[str, str]:
    found = _KNOWN.get(key)
    if found is None:
        found = _KNOWN[key] = packed(api.solid(placed))
        while len(_KNOWN) > MOST_KNOWN:
            del _KNOWN[next(iter(_KNOWN))]
    return found


def packed(surface: Surface) -> dict[str, str]:
    """Points and faces of a surface as the page unpacks them."""
    return {"points": _words(surface.points, "<f4"), "faces": _words(surface.faces, "<u4")}


def _words(numbers: Any, kind: str) -> str:
    return base64.b64encode(numbers.astype(kind).tobytes()).decode("ascii")


_KNOWN: dict[str, dict[str, str]] = {}
MOST_KNOWN = 24
"""Surfaces that a worker keeps, so that a page that lost one is answered at once."""
