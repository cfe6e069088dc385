"""Faults put into a folder that the program wrote, without any function of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import ezdxf
import shapely
from ezdxf import bbox
from shapely import Polygon, affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.folder import Folder, open_folder, pieces

Box = tuple[float, float, float, float]
Change = Callable[[BaseGeometry], BaseGeometry]


class Patient:
    """A copy of a written folder; layers are counted from 1."""

    def __init__(self, folder: Path, design: Path) -> None:
        self.folder = folder
        self.design = design

    def opened(self) -> Folder:
        return open_folder(self.folder, self.design)

    def layer_file(self, layer: int) -> Path:
        entries = json.loads((self.folder / "manifest.json").read_text())["layers"]
        return self.folder / str(entries[layer - 1]["file"])

    def redraw(self, layers: Iterable[int], change: Change) -> None:
        """The layers' cut paths, changed."""
        folder = self.opened()
        for layer in layers:
            draw(self.layer_file(layer), change(folder.layers[layer - 1].path))

    def edit(self, name: str, change: Callable[[Any], object]) -> None:
        """A JSON file as ``change`` leaves it."""
        path = self.folder / name
        content = json.loads(path.read_text(encoding="utf-8"))
        change(content)
        path.write_text(json.dumps(content), encoding="utf-8")

    def edit_dxf(self, name: str, change: Callable[[Any], object]) -> None:
        """A DXF file's model space as ``change`` leaves it."""
        document = ezdxf.readfile(self.folder / name)
        change(document.modelspace())
        document.saveas(self.folder / name)

    def replace(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")


def draw(path: Path, region: BaseGeometry) -> None:
    """A cut file of the region, in straight lines."""
    document = ezdxf.new("R2010", units=4)
    space = document.modelspace()
    for part in pieces(region):
        add_part(space, part)
    document.saveas(path)


def add_part(space: Any, part: Polygon) -> None:
    space.add_lwpolyline(part.exterior.coords[:-1], close=True, dxfattribs={"layer": "CUT_OUTER"})
    for ring in part.interiors:
        space.add_lwpolyline(ring.coords[:-1], close=True, dxfattribs={"layer": "CUT_INNER"})


def parts_of(space: Any) -> list[tuple[Box, list[Any]]]:
    """The parts of a sheet: each one's extent, and its outline and holes."""
    outlines = [e for e in space if e.dxf.layer == "CUT_OUTER"]
    holes = [e for e in space if e.dxf.layer == "CUT_INNER"]
    found = []
    for outline in outlines:
        extent = extent_of(outline)
        inside = shapely.box(*extent)
        mine = [hole for hole in holes if inside.contains(shapely.box(*extent_of(hole)))]
        found.append((extent, [outline, *mine]))
    return found


def extent_of(entity: Any) -> Box:
    """Lowest and highest x and y."""
    low, high = bbox.extents([entity])
    return low.x, low.y, high.x, high.y


def shift(entities: Iterable[Any], x: float, y: float) -> None:
    for entity in entities:
        entity.translate(x, y, 0)


def moved_hole(region: BaseGeometry, number: int, x: float, y: float) -> BaseGeometry:
    """The first piece's hole of that number, moved."""
    first, *others = pieces(region)
    holes = list(first.interiors)
    holes[number] = affinity.translate(holes[number], x, y)
    return shapely.MultiPolygon([Polygon(first.exterior, holes), *others])


def without_hole(region: BaseGeometry, number: int) -> BaseGeometry:
    """The first piece with its hole of that number filled."""
    first, *others = pieces(region)
    holes = [hole for i, hole in enumerate(first.interiors) if i != number]
    return shapely.MultiPolygon([Polygon(first.exterior, holes), *others])
