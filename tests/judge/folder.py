"""An output folder as a stack of profiles, read from its files alone.

Of the manifest only the stacking order, file names, films, thickness, kerf, roles and the names of
the pins are taken; where pins are, the plate's own file says. What the user asked for comes from
the design file that was given, with the defaults that the docs name.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.reading import Drawing, UnreadableError, read

ROUND = 24
"""Chords a quarter circle where kerf is taken back."""
SPECK = 1e-8
"""mm2: no piece of film; what buffers leave by rounding."""
FINE = 2e-4
"""mm by which points are left out again where a shrunk path has more than it needs."""
Kerf = tuple[float, float]


class Disagreement(NamedTuple):
    """What a judge saw: which judge, and one sentence with the place."""

    judge: str
    said: str


@dataclass(frozen=True)
class Layer:
    """One film or mask: what the file cuts, and what is left of the film once it is cut."""

    index: int
    role: str
    material: str
    balloon: int | None
    thickness: float
    file: str
    path: BaseGeometry
    profile: BaseGeometry
    shape: int
    """Equal for layers of equal drawings."""

    @property
    def is_mask(self) -> bool:
        return self.material == "PTFE"


class Interface(NamedTuple):
    """Two consecutive films and the masks between them; ``number`` counts from 1 at the bottom."""

    number: int
    below: Layer
    above: Layer
    masks: tuple[Layer, ...]

    @property
    def is_chamber(self) -> bool:
        return any(mask.role == "chamber-mask" for mask in self.masks)

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.below.shape, self.above.shape, *(mask.shape for mask in self.masks))


class Hole(NamedTuple):
    """A hole of the pin plate."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Folder:
    """What one design's folder says, and what was asked for."""

    path: Path
    sheets: Path
    manifest: dict[str, Any]
    asked: dict[str, Any]
    layers: tuple[Layer, ...]
    chord_error: float = 0.0

    def wish(self, table: str, key: str, default: Any) -> Any:
        return self.asked.get(table, {}).get(key, default)

    @property
    def copies(self) -> int:
        return int(self.wish("order", "copies", 1))

    def spares(self, needed: int) -> int:
        """Of a pattern of which so many are needed: a share of them, and at least some."""
        share = Fraction(str(self.wish("order", "spare_share", 0.05)))
        return max(int(self.wish("order", "spares", 1)), math.ceil(share * needed))

    @property
    def method(self) -> str:
        return str(self.wish("registration", "method", "channel-pin"))

    @property
    def bond_limit(self) -> float:
        return float(self.wish("rules", "bond_width", 0.75))

    @property
    def overhang_limit(self) -> float:
        return float(self.wish("rules", "mask_overhang", 0.5))

    @cached_property
    def slack(self) -> float:
        """Mm by which a measure may fall short: rule, flattening, and the kerf's own arcs."""
        pair = any(isinstance(self.wish("laser", f"kerf_{m}", 0), list) for m in ("tpe", "ptfe"))
        return 0.004 if pair else 0.0025

    @property
    def films(self) -> list[Layer]:
        return [layer for layer in self.layers if not layer.is_mask]

    @cached_property
    def interfaces(self) -> tuple[Interface, ...]:
        films = self.films
        return tuple(
            Interface(
                number,
                below,
                above,
                tuple(layer for layer in self.layers if below.index < layer.index < above.index),
            )
            for number, (below, above) in enumerate(zip(films, films[1:], strict=False), start=1)
        )

    @cached_property
    def plate(self) -> Drawing | None:
        path = self.path / "sheets" / "fixture.dxf"
        return read(path) if path.is_file() else None

    @cached_property
    def holes(self) -> tuple[Hole, ...]:
        """The holes of the pin plate."""
        if self.plate is None:
            return ()
        found = []
        for contour in self.plate.on("CUT_INNER"):
            low_x, low_y, high_x, high_y = contour.line.bounds
            x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
            found.append(Hole(x, y, max(high_x - low_x, high_y - low_y) / 2))
        return tuple(found)

    @cached_property
    def press(self) -> dict[str, Any] | None:
        path = self.path / "press.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def asked_kerf(asked: dict[str, Any], material: str) -> Kerf | None:
    """The kerf along x and y that a design asks for; None if it has none."""
    width = asked.get("laser", {}).get(f"kerf_{material.lower()}", "uncalibrated")
    if width == "uncalibrated":
        return None
    return (width[0], width[1]) if isinstance(width, list) else (width, width)


def cut_with(path: BaseGeometry, kerf: Kerf | None) -> BaseGeometry:
    """What is left of a film when a beam as wide as the kerf has gone along the path."""
    return _beside(path, kerf, -1)


def closed_by(region: BaseGeometry, kerf: Kerf | None) -> BaseGeometry:
    """The film left when a beam goes round a region as close as it can.

    A beam enters no corner narrower than itself.
    """
    return cut_with(_beside(region, kerf, 1), kerf)


def _beside(region: BaseGeometry, kerf: Kerf | None, side: int) -> BaseGeometry:
    """The region grown (``side`` 1) or shrunk (-1) by half the beam.

    The beam's section is an ellipse: scaled to a circle, the region is moved and scaled back.
    """
    if kerf is None or max(kerf) == 0:
        return region
    x, y = max(kerf[0], 1e-6), max(kerf[1], 1e-6)
    if x == y:
        return region.buffer(side * x / 2, quad_segs=ROUND).simplify(FINE)
    scaled = affinity.scale(region, y / x, 1.0, origin=(0, 0))
    moved = scaled.buffer(side * y / 2, quad_segs=ROUND)
    return affinity.scale(moved, x / y, 1.0, origin=(0, 0)).simplify(FINE)


def open_folder(path: Path, design: Path, chord_error: float = 0.0) -> Folder:
    """The folder of one design, made from the design file. Raises UnreadableError."""
    asked = tomllib.loads(design.read_text(encoding="utf-8"))
    manifest = json.loads((path / "manifest.json").read_text(encoding="utf-8"))
    shapes: dict[int, int] = {}
    profiles: dict[tuple[bytes, Kerf | None], BaseGeometry] = {}
    layers = []
    for entry in manifest["layers"]:
        drawing = read(path / entry["file"])
        key = (drawing.region.wkb, asked_kerf(asked, entry["material"]))
        if key not in profiles:
            profiles[key] = cut_with(drawing.region, key[1])
        layers.append(
            Layer(
                entry["index"],
                entry["role"],
                entry["material"],
                entry["balloon"],
                entry["thickness"],
                entry["file"],
                drawing.region,
                profiles[key],
                shapes.setdefault(id(profiles[key]), len(shapes)),
            )
        )
    if not layers:
        raise UnreadableError("the manifest lists no layer")
    return Folder(path, path / "sheets", manifest, asked, tuple(layers), chord_error)


def pieces(region: BaseGeometry, thinner: float = 0.0) -> Iterator[shapely.Polygon]:
    """The polygons of a region that are wider than ``thinner`` somewhere, without its specks."""
    for part in getattr(region, "geoms", [region]):
        if isinstance(part, shapely.Polygon) and part.area > SPECK:
            if thinner == 0 or not part.buffer(-thinner / 2).is_empty:
                yield part
        elif hasattr(part, "geoms"):
            yield from pieces(part, thinner)


def place(region: BaseGeometry) -> str:
    """Where a region is, for a sentence."""
    point = region.representative_point()
    return f"x {point.x:.3f}, y {point.y:.3f}"
