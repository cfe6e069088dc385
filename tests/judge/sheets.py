"""Film sheets against layers: nothing missing, nothing more, nothing too near."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point, Polygon, STRtree, affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.folder import Folder, pieces
from tests.judge.reading import Drawing, read

SAME = 0.002
"""mm by which a part on a sheet may differ from the layer's."""
NEAR = 0.003
"""mm by which a gap may fall short: rounding, and what chords leave of arcs."""
USUAL = {"width": 152.4, "length": 152.4, "border": 10.0, "spacing": 1.0, "roll": False, "pins": []}
PARTS = {"CUT_INNER", "CUT_OUTER"}
KNOWN_LAYERS = {*PARTS, "CUT_SHEET", "ENGRAVE", "REFERENCE"}


@dataclass
class Part:
    """A piece of a layer, about its own middle, and how many of it the sheets still lack."""

    name: str
    material: str
    shape: Polygon
    corners: NDArray[np.float64]
    lacking: int


def judge_sheets(
    folders: Sequence[Folder], home: Path, entries: Sequence[dict[str, Any]]
) -> Iterator[str]:
    """The sheets of one or several designs; ``entries`` name their files and materials."""
    parts = _parts(folders)
    asked = folders[0].asked
    chords = max(folder.chord_error for folder in folders)
    for entry in entries:
        drawing = read(home / entry["file"])
        material = entry["material"]
        stock = {**USUAL, **asked.get("sheets", {}).get(material.lower(), {})}
        name = Path(entry["file"]).name
        turns = (0, 180) if _uneven(asked, material) else (0, 180, 90, 270)
        for piece in pieces(drawing.region):
            if not _taken(piece, [p for p in parts if p.material == material], turns):
                at = piece.representative_point()
                yield (
                    f"{name} has a part at x {at.x:.2f}, y {at.y:.2f} that is no piece of a "
                    "layer, or one too many"
                )
        yield from _layout(drawing, stock, entry, name, NEAR + 2 * chords)
        yield from _strays(drawing, stock, entry, name)
    for part in parts:
        if part.lacking:
            yield f"the sheets lack {part.lacking} of a piece of {part.name}"


def _uneven(asked: dict[str, Any], material: str) -> bool:
    width = asked.get("laser", {}).get(f"kerf_{material.lower()}")
    return isinstance(width, list) and width[0] != width[1]


def _parts(folders: Sequence[Folder]) -> list[Part]:
    parts: list[Part] = []
    for folder in folders:
        counts: dict[int, int] = {}
        first = {}
        for layer in folder.layers:
            counts[layer.shape] = counts.get(layer.shape, 0) + 1
            first.setdefault(layer.shape, layer)
        copies = folder.copies
        for number, layer in first.items():
            for piece in pieces(layer.path):
                shape = _centred(piece)
                parts.append(
                    Part(
                        f"layer {layer.index} of {folder.asked['name']}",
                        layer.material,
                        shape,
                        shapely.get_coordinates(shape),
                        counts[number] * copies + folder.spares(counts[number] * copies),
                    )
                )
    return parts


def _centred(piece: Polygon) -> Polygon:
    middle = piece.centroid
    return affinity.translate(piece, -middle.x, -middle.y)


def _taken(piece: Polygon, parts: Sequence[Part], turns: Sequence[int]) -> bool:
    """Whether the piece is one that is still lacking, turned by a quarter at a time."""
    shape = _centred(piece)
    for turn in turns:
        turned = affinity.rotate(shape, turn, origin=(0, 0))
        for part in parts:
            if part.lacking and _same(turned, part):
                part.lacking -= 1
                return True
    return False


def _same(piece: Polygon, part: Part) -> bool:
    if abs(piece.area - part.shape.area) > SAME * piece.length:
        return False
    if len(piece.interiors) != len(part.shape.interiors):
        return False
    if np.abs(np.subtract(piece.bounds, part.shape.bounds)).max() > SAME:
        return False
    there = shapely.points(shapely.get_coordinates(piece))
    here = shapely.points(part.corners)
    shapely.prepare(part.shape.boundary)
    return bool(
        shapely.distance(there, part.shape.boundary).max() <= SAME
        and shapely.distance(here, piece.boundary).max() <= SAME
    )


def _layout(
    drawing: Drawing, stock: dict[str, Any], entry: dict[str, Any], name: str, slack: float
) -> Iterator[str]:
    """Gaps, borders and pins."""
    outlines = [Polygon(c.points) for c in drawing.on("CUT_OUTER")]
    spacing, border = float(stock["spacing"]), float(stock["border"])
    width, length = float(entry["width"]), float(entry["length"])
    tree = STRtree(outlines)
    one, other = tree.query(outlines, predicate="dwithin", distance=spacing - slack)
    for i, j in zip(one, other, strict=True):
        if i < j:
            at = outlines[i].representative_point()
            yield (
                f"two parts of {name} lie {outlines[i].distance(outlines[j]):.4f} apart at "
                f"x {at.x:.2f}, y {at.y:.2f}, where {spacing:g} are asked for"
            )
    inside = shapely.box(border, border, width - border, length - border).buffer(slack)
    for outline in outlines:
        if not inside.covers(outline):
            yield f"a part of {name} lies in the border of {border:g}"
            break
    for x, y, diameter in stock["pins"]:
        pin = Point(x, y).buffer(diameter / 2, quad_segs=32)
        for number in tree.query(pin, predicate="dwithin", distance=spacing - slack):
            away = outlines[number].distance(pin)
            yield f"a part of {name} is {away:.4f} from the pin at {x}, {y}"


def _strays(
    drawing: Drawing, stock: dict[str, Any], entry: dict[str, Any], name: str
) -> Iterator[str]:
    """The sheet's own size, and lines that have no business where parts lie."""
    width, length = float(entry["width"]), float(entry["length"])
    if width != float(stock["width"]) or (
        length > float(stock["length"]) if stock["roll"] else length != float(stock["length"])
    ):
        yield f"{name} is {width:g} x {length:g}, which is no such sheet"
    frees = drawing.on("CUT_SHEET")
    if bool(frees) != bool(stock["roll"]):
        yield f"{name} has {len(frees)} cuts on CUT_SHEET"
    if any(
        abs(y - length) > NEAR or not -NEAR <= x <= width + NEAR
        for free in frees
        for x, y in free.points
    ):
        yield f"{name} is not freed along its end, y {length:g}"
    outlines: BaseGeometry = shapely.MultiPolygon(
        [Polygon(c.points) for c in drawing.on("CUT_OUTER")]
    ).buffer(-NEAR)  # without a border the cut that frees a roll's sheet runs along a part
    shapely.prepare(outlines)
    for contour in drawing.contours:
        if contour.layer not in KNOWN_LAYERS:
            yield f"{name} draws on layer {contour.layer}"
        elif contour.layer not in PARTS and outlines.intersects(contour.line):
            yield f"a line on {contour.layer} of {name} crosses a part"
    low_x, low_y, high_x, high_y = shapely.total_bounds([c.line for c in drawing.contours])
    if min(low_x, low_y) < -NEAR or high_x > width + NEAR or high_y > length + NEAR:
        yield f"{name} draws outside its sheet"
