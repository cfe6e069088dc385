"""Laminates, findings and assemblies as data for the page: numbers and text, no pictures.

A contour is a flat list of x, y and bulge (mm; the DXF convention), so arcs stay arcs on screen. A
shape is sent once under its key, and never to a page that names it as present.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from sbafab import api
from sbafab.folders.checks import FindingEntry

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled, PlacedPart
    from sbafab.geometry.region import Region
    from sbafab.laminate.laminate import Laminate, Layer
    from sbafab.meshing.surface import Surface
    from sbafab.reports.nets_svg import NetMap
    from sbafab.rules.finding import Finding

Kept = TypeVar("Kept")
CancelCheck = Callable[[], None]
"""Called between steps of work; raises if the answer is not needed any longer."""


@dataclass
class AnswerShapes:
    """The shapes of one answer; shapes that the page ``has`` are only named."""

    has: Collection[str]
    new: dict[str, list[list[float]]] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)

    def key(self, region: Region) -> str:
        """The name of a region, which is sent along if the page lacks it."""
        key = region.key[:24]
        self.used.add(key)
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
    layers = [_layer(layer) for layer in laminate.layers]
    patterns = {
        name: _pattern(laminate, group, shapes) for name, group in laminate.patterns.items()
    }
    return {
        "kind": "laminate",
        "name": laminate.name,
        "family": laminate.family,
        "thickness": laminate.thickness,
        "balloons": laminate.balloons,
        "lumen": laminate.lumen,
        "bounds": list(laminate.bounds),
        "registration": laminate.registration,
        "notes": list(laminate.notes),
        "layers": layers,
        "patterns": patterns,
        "chambers": [asdict(chamber) for chamber in laminate.chambers],
        "bores": [asdict(bore) for bore in laminate.bores],
        "inlets": [asdict(inlet) for inlet in laminate.inlets],
        "pins": [asdict(pin) for pin in laminate.pins],
        "shapes": shapes.new,
    }


def _layer(layer: Layer) -> dict[str, Any]:
    return {
        "index": layer.index,
        "role": layer.role,
        "balloon": layer.balloon,
        "pattern": layer.pattern,
        "material": layer.film.material,
        "mask": layer.is_mask,
        "shade": layer.film.shade,
        "thickness": layer.film.thickness,
        "z": layer.z,
    }


def _pattern(laminate: Laminate, layers: tuple[Layer, ...], shapes: AnswerShapes) -> dict[str, Any]:
    first = layers[0]
    return {
        "shape": shapes.key(first.profile),
        "layers": [layer.index for layer in layers],
        "area": round(first.profile.area, 4),
        "bounds": list(first.profile.bounds),
        "marks": [asdict(mark) for mark in api.dimensions(laminate, first)],
    }


def shapes_model(drawn: Mapping[str, Region | None], has: Collection[str]) -> dict[str, Any]:
    """The shapes that a design file names, each with the key of its region or None."""
    shapes = AnswerShapes(has)
    named = {name: region and shapes.key(region) for name, region in drawn.items()}
    return {"kind": "shapes", "named": named, "shapes": shapes.new}


def nets_model(laminate: Laminate, nets: NetMap, has: Collection[str]) -> dict[str, Any]:
    """Voids with their nets by gap, the gaps of films, ports, and faults with their places."""
    shapes = AnswerShapes(has)
    return {
        "kind": "nets",
        "declared": bool(laminate.nets),
        "colours": dict(nets.colours),
        "gaps": [
            {
                "interface": gap.index,
                "layers": list(gap.layer_indices),
                "contact": shapes.key(gap.contact),
            }
            for gap in laminate.interfaces
        ],
        "areas": [
            {
                "nets": list(area.nets),
                "interface": area.interface,
                "colour": area.colour,
                "shape": shapes.key(area.region),
            }
            for area in nets.areas
        ],
        "ports": [
            {"name": port.name, "layers": [port.below, port.above], "at": list(port.at)}
            for port in laminate.ports
        ],
        "faults": [
            {
                "kind": fault.kind,
                "nets": list(fault.nets),
                "interface": fault.interface,
                "layers": list(fault.layers),
                "at": list(fault.at),
                "message": fault.message,
            }
            for fault in nets.faults
        ],
        "shapes": shapes.new,
    }


def finding_model(finding: Finding) -> dict[str, Any]:
    """A finding as in ``checks.json``, its design, whose name the message omits, and its parts."""
    entry = FindingEntry.of(replace(finding, design=""))
    design = {"design": finding.design} if finding.design else {}
    return {**entry, **design, "by_user": finding.by_user, "parts": list(finding.parts)}


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
            make = partial(_solid, placed)
            surfaces[key] = remembered(_SURFACES, key, make, MOST_SURFACES)
        parts.append({**_part(placed), "surface": key})
    return {"kind": "parts", "parts": parts, "surfaces": surfaces}


def _part(placed: PlacedPart) -> dict[str, Any]:
    part, actuator = placed.part, placed.made
    design = None
    if actuator is not None:
        design = {
            "name": actuator.design.name,
            "family": actuator.design.family,
            "values": api.resolved(actuator.design),
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


def _solid(placed: PlacedPart) -> dict[str, str]:
    return packed(api.solid(placed))


def remembered(kept: dict[str, Kept], key: str, make: Callable[[], Kept], most: int) -> Kept:
    """Return the value of a key, made if it is missing; the oldest of over ``most`` is dropped."""
    if key not in kept:
        kept[key] = make()
        while len(kept) > most:
            del kept[next(iter(kept))]
    return kept[key]


def packed(surface: Surface) -> dict[str, str]:
    """Points and faces of a surface as the page unpacks them."""
    return {"points": _words(surface.points, "<f4"), "faces": _words(surface.faces, "<u4")}


def _words(numbers: Any, kind: str) -> str:
    return base64.b64encode(numbers.astype(kind).tobytes()).decode("ascii")


_SURFACES: dict[str, dict[str, str]] = {}
MOST_SURFACES = 24
"""Surfaces that a worker keeps, so that a page that lost one is answered at once."""
