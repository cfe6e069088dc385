"""The cut file that a picture is compared with: its pieces, each with the names of its patterns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import shapely

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.placements import TURNS
from sbafab.errors import DesignError, OutputError
from sbafab.folders.as_cut import path_in_folder
from sbafab.folders.manifest import JobManifest, Manifest, read_design_index, read_index
from sbafab.geometry.edges import Bounds
from sbafab.geometry.region import Region

SPACING = 1.0  # default distance between cuts, for a file without one, mm
SAME_SIZE, SAME_EDGE = 1e-4, 2e-3
"""Largest difference of congruent pieces in area, mm2, and of their edges, mm."""


@dataclass(frozen=True)
class SheetShape:
    """A piece of a pattern: ``name`` is the pattern, such as P05."""

    name: str
    region: Region


@dataclass(frozen=True)
class DrawnSheet:
    """Contours of a cut file as the beam runs, mm.

    ``places``: the pieces at their cut positions, named by their patterns. ``shapes``: every piece
    of the folder, any of them may lie in a place. ``pins``: x, y and diameter of the pins of a
    sheet. ``kerf`` is the file's kerf compensation.
    """

    name: str
    places: tuple[SheetShape, ...]
    shapes: tuple[SheetShape, ...]
    pins: tuple[tuple[float, float, float], ...]
    spacing: float
    kerf: str
    film: str

    @property
    def bounds(self) -> Bounds:
        return Region(tuple(c for place in self.places for c in place.region.contours)).bounds


def read_cut_sheet(source: Path, name: str | None) -> DrawnSheet:
    """Return the sheet or layer ``name`` of an output folder, or a cut file given by its path.

    Raises DesignError if the folder has no such file, OutputError if a file is corrupt.
    """
    if source.suffix.lower() == ".dxf":
        return _sheet(source.stem, source)
    claims = read_index(source)
    sheets = {Path(sheet.file).stem: sheet for sheet in claims.sheets}
    layers = dict(_layers(source, claims))
    name = _chosen(name, [*sheets, *layers])
    shapes = tuple(_shapes(layers))
    if name not in sheets:
        return _sheet(name, layers[name][1], shapes)
    sheet = sheets[name]
    path = path_in_folder(source, sheet.file)
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in sheet.pins)
    return _sheet(name, path, shapes, sheet.spacing, pins)


def _chosen(name: str | None, names: Sequence[str]) -> str:
    listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    if name is None:
        if len(names) == 1:
            return names[0]
        raise DesignError(f"--sheet is missing; name the cut file in the picture: {listed}")
    stem = Path(name).name.removesuffix(".dxf")
    if stem not in names:
        raise DesignError(f"--sheet is {name[:60]!r}, which the folder has not; it has {listed}")
    return stem


def _layers(folder: Path, claims: Manifest | JobManifest) -> Iterator[tuple[str, tuple[str, Path]]]:
    """Yield the name of each layer's cut file with its pattern and path."""
    if isinstance(claims, JobManifest):
        for design in claims.designs:
            inner = path_in_folder(folder, design.folder)
            for name, (pattern, path) in _layers(inner, read_design_index(inner)):
                yield f"{design.name}/{name}", (f"{design.name} {pattern}", path)
        return
    for layer in claims.layers:
        if layer.file is not None:
            path = path_in_folder(folder, layer.file)
            yield path.stem, (layer.pattern, path)


def _shapes(layers: dict[str, tuple[str, Path]]) -> Iterator[SheetShape]:
    """Yield the pieces of every pattern once."""
    patterns = dict(reversed(layers.values()))
    for pattern, path in sorted(patterns.items()):
        pieces = {piece.key: piece for piece in read_profile(path).region.pieces}
        yield from (SheetShape(pattern, piece) for piece in pieces.values())


def _sheet(
    name: str,
    path: Path,
    shapes: tuple[SheetShape, ...] = (),
    spacing: float = SPACING,
    pins: tuple[tuple[float, float, float], ...] = (),
) -> DrawnSheet:
    drawing = read_profile(path)
    if not drawing.region.contours:
        raise OutputError(f"{path.name} contains no parts; give a sheet or layer that has some")
    named: list[SheetShape] = []
    unnamed: list[SheetShape] = []
    for piece in drawing.region.pieces:
        names = [shape.name for shape in shapes if _is_congruent(piece, shape.region)]
        if not names:
            names = [f"part {len(unnamed) + 1}"]
            unnamed.append(SheetShape(names[0], piece))
        named.append(SheetShape(", ".join(dict.fromkeys(names)), piece))
    kerf, film = (drawing.properties.get(key, "") for key in ("KERF_WIDTH", "MATERIAL"))
    every = (*shapes, *unnamed)
    return DrawnSheet(name, tuple(named), every, pins, spacing, kerf or "none", film)


def _is_congruent(piece: Region, shape: Region) -> bool:
    """Return True if a piece is a shape shifted and turned by quarter turns."""
    if len(piece.contours) != len(shape.contours) or abs(piece.area - shape.area) > SAME_SIZE:
        return False
    lying = _centred(piece)
    turned = (_centred(shape.turned(90.0 * turn)) for turn in TURNS)
    return any(lying.hausdorff_distance(each) < SAME_EDGE for each in turned)


def _centred(region: Region) -> shapely.MultiPolygon:
    """Return a region with the middle of its box at the origin."""
    low_x, low_y, high_x, high_y = region.bounds
    return region.moved(-(low_x + high_x) / 2, -(low_y + high_y) / 2).shapely()
