"""Laminates, findings and assemblies as data for the page: numbers and text, no pictures.

A contour is a flat list of x, y and bulge (mm; the DXF convention), so arcs stay arcs on screen. A
shape is sent once under its key, and never to a page that names it as present.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, TypeVar

from sbafab import api
from sbafab.api.records import (
    Assembled,
    Finding,
    FindingEntry,
    Laminate,
    NetMap,
    PlacedPart,
    Region,
    Surface,
)

Kept = TypeVar("Kept")
CancelCheck = Callable[[], None]
"""Called between steps of work; raises if the answer is not needed any longer."""


def of(record: object, *names: str) -> dict[str, Any]:
    """Return these attributes of a record by name."""
    return {name: getattr(record, name) for name in names}


@dataclass
class AnswerShapes:
    """The shapes of one answer; shapes that the page ``has`` are only named."""

    has: Collection[str]
    new: dict[str, list[list[float]]] = field(default_factory=dict)

    def key(self, region: Region) -> str:
        """The name of a region, which is sent along if the page lacks it."""
        key = region.key[:24]
        if key not in self.has and key not in self.new:
            self.new[key] = [flat(contour.vertices) for contour in region.contours]
        return key


def flat(vertices: Iterable[tuple[float, float, float]]) -> list[float]:
    """A contour as the page reads it; its bulges are exact enough to write arcs back to a
    design.
    """
    rounded = ((round(x, 6), round(y, 6), round(bulge, 12)) for x, y, bulge in vertices)
    return [number for vertex in rounded for number in vertex]


def laminate_model(laminate: Laminate, has: Collection[str]) -> dict[str, Any]:
    """Layers, patterns and their positions; plan, section and solid are drawn from it."""
    shapes = AnswerShapes(has)
    patterns = {
        name: {
            "shape": shapes.key(group[0].profile),
            "layers": [layer.index for layer in group],
            "area": round(group[0].profile.area, 4),
            "bounds": group[0].profile.bounds,
            "marks": [asdict(mark) for mark in api.dimensions(laminate, group[0])],
        }
        for name, group in laminate.patterns.items()
    }
    layers = [
        {
            **of(layer, "index", "role", "balloon", "pattern", "z"),
            **of(layer.film, "material", "shade", "thickness"),
            "mask": layer.is_mask,
        }
        for layer in laminate.layers
    ]
    lists = ("chambers", "bores", "inlets", "pins")
    names = ("name", "family", "thickness", "balloons", "lumen", "bounds", "registration", "notes")
    return {
        "kind": "laminate",
        **of(laminate, *names),
        **{name: [asdict(row) for row in getattr(laminate, name)] for name in lists},
        "layers": layers,
        "patterns": patterns,
        "shapes": shapes.new,
    }


def shapes_model(drawn: Mapping[str, Region | None], has: Collection[str]) -> dict[str, Any]:
    """The shapes that a design file names, each with the key of its region or None."""
    shapes = AnswerShapes(has)
    named = {name: region and shapes.key(region) for name, region in drawn.items()}
    return {"kind": "shapes", "named": named, "shapes": shapes.new}


def nets_model(laminate: Laminate, nets: NetMap, has: Collection[str]) -> dict[str, Any]:
    """Voids with their nets by gap, the gaps of films, ports, and faults with their places."""
    shapes = AnswerShapes(has)
    gaps = [
        {"interface": gap.index, "layers": gap.layer_indices, "contact": shapes.key(gap.contact)}
        for gap in laminate.interfaces
    ]
    areas = [
        {**of(area, "nets", "interface", "colour"), "shape": shapes.key(area.region)}
        for area in nets.areas
    ]
    ports = [
        {"name": port.name, "layers": (port.below, port.above), "at": port.at}
        for port in laminate.ports
    ]
    names = ("kind", "nets", "interface", "layers", "at", "message")
    return {
        "kind": "nets",
        "declared": bool(laminate.nets),
        "colours": nets.colours,
        "gaps": gaps,
        "areas": areas,
        "ports": ports,
        "faults": [of(fault, *names) for fault in nets.faults],
        "shapes": shapes.new,
    }


def finding_model(finding: Finding) -> dict[str, Any]:
    """A finding as in ``checks.json``, its design, whose name the message omits, and its parts."""
    entry = FindingEntry.of(replace(finding, design=""))
    design = {"design": finding.design} if finding.design else {}
    return {**entry, **design, **of(finding, "by_user", "parts")}


# Assemblies: the surface of each part once, and its place.
#
# A surface is sent once under its key, in the part's own frame, and not again to a page that
# names it as present: for a moved part only its place is sent.


PLACED_BY = {"on", "at", "angle", "along", "offset", "glue", "note", "design", "set"}
"""Keys of a part that do not change its own surface; an actuator's depends on its laminate."""


def parts_model(assembled: Assembled, has: Collection[str]) -> dict[str, Any]:
    """Parts with their places, in order of support, and surfaces that the page lacks."""
    surfaces: dict[str, dict[str, str]] = {}
    parts = []
    for placed in assembled.parts:
        key = _key(placed)
        if key not in has and key not in surfaces:
            surfaces[key] = packed(api.solid(placed))
        design = None
        if placed.made is not None:
            values = api.resolved(placed.made.design)
            design = {**of(placed.made.design, "name", "family"), "values": values}
        part = {**of(placed.part, "kind", "on", "at"), **of(placed.pose, "rows", "shift")}
        parts.append({**part, "name": placed.name, "design": design, "surface": key})
    return {"kind": "parts", "parts": parts, "surfaces": surfaces}


def _key(placed: PlacedPart) -> str:
    """Names a surface by everything that determines it."""
    decisive: list[Any] = [placed.turn, placed.radius]
    if placed.made is None:
        decisive.append(placed.part.model_dump(mode="json", exclude=PLACED_BY))
    else:
        layers = placed.made.laminate.layers
        decisive += [
            (layer.profile.key, layer.z, layer.film.thickness, layer.is_mask) for layer in layers
        ]
    return hashlib.sha256(repr(decisive).encode()).hexdigest()[:24]


def remembered(kept: dict[str, Kept], key: str, make: Callable[[], Kept], most: int) -> Kept:
    """Return the value of a key, made if it is missing; the oldest of over ``most`` is dropped."""
    if key not in kept:
        kept[key] = make()
        while len(kept) > most:
            del kept[next(iter(kept))]
    return kept[key]


def packed(surface: Surface) -> dict[str, str]:
    """Points and faces of a surface as the page unpacks them."""
    arrays = {"points": surface.points.astype("<f4"), "faces": surface.faces.astype("<u4")}
    return {name: base64.b64encode(rows.tobytes()).decode() for name, rows in arrays.items()}
