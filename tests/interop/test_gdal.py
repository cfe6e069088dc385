"""GDAL reads the cut files with the areas that closed formulas give."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pyogrio
import pytest
import shapely
from pyogrio import raw

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.properties import DxfProfile
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, stadium, strip, union


@pytest.fixture(autouse=True)
def fine_arcs() -> Iterator[None]:
    """GDAL turns arcs into chords; a quarter degree keeps the area to 3e-6."""
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": "0.25"})
    yield
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": None})


def lobed_plate() -> tuple[Region, float]:
    """The paper's 3-DoF plate, overall 15 mm, with bores of 1 mm and a lumen of 2 mm.

    Chamber axes and the centres of the 1 mm fillets all stand 4.25 from the axis: a hexagon, less
    three thirds of a disc at the fillets, plus two thirds of a disc of 3.25 at every lobe.
    """
    axes = [
        (4.25 * math.cos(math.radians(turn)), 4.25 * math.sin(math.radians(turn)))
        for turn in (90, 210, 330)
    ]
    outline = fillet(union([disc((0.0, 0.0), 1.75), *(disc(axis, 3.25) for axis in axes)]), 1.0)
    region = outline - union([disc((0.0, 0.0), 1.0), *(disc(axis, 0.5) for axis in axes)])
    hexagon = 1.5 * math.sqrt(3) * 4.25**2
    area = hexagon - math.pi + 2 * math.pi * 3.25**2 - math.pi - 3 * math.pi * 0.25
    return region, area


def disc_with_tab() -> tuple[Region, float]:
    """A disc of 3.25 with a tab 3.1 wide whose end stands 8.25 from the centre."""
    half = 3.1 / 2
    angle = math.asin(half / 3.25)
    segment = 3.25**2 * (angle - math.sin(angle) * math.cos(angle))
    tab = 3.1 * (8.25 - 3.25 * math.cos(angle)) - segment
    region = disc((0.0, 0.0), 3.25) | strip((0.0, 0.0), (8.25 * 0.6, 8.25 * 0.8), 3.1)
    return region, math.pi * 3.25**2 + tab


CASES = {
    "disc": (disc((0.7, -1.3), 6.5), math.pi * 6.5**2),
    "ring": (disc((0.0, 0.0), 3.25) - disc((0.0, 0.0), 0.5), math.pi * (3.25**2 - 0.25)),
    "stadium": (stadium((0.0, 0.0), 11.5, 20.0), 11.5 * 8.5 + math.pi * 5.75**2),
    "three discs": (
        union([disc((x, 1.0), 2.5) for x in (-6.0, 0.0, 6.0)]),
        3 * math.pi * 2.5**2,
    ),
    "tab": disc_with_tab(),
    "plate": lobed_plate(),
}


def read(region: Region, profile: DxfProfile, folder: Path) -> tuple[list[str], list[object]]:
    """Layer name and geometry of every cut entity, as GDAL reads them."""
    if profile == "chords":
        region = in_chords(region, None, 0.005)
    path = folder / "part.dxf"
    path.write_text(dxf_text(cutting_sequence(region), {}, profile), encoding="utf-8")
    _, _, shapes, (layers,) = raw.read(path, columns=["Layer"])
    kept = [index for index, layer in enumerate(layers) if layer.startswith("CUT_")]
    return [layers[index] for index in kept], [shapely.from_wkb(shapes[index]) for index in kept]


@pytest.mark.parametrize("name", CASES)
def test_closed_contours_enclose_the_area(name: str, tmp_path: Path) -> None:
    region, area = CASES[name]
    layers, shapes = read(region, "bulges", tmp_path)
    assert layers == ["CUT_INNER"] * len(region.holes) + ["CUT_OUTER"] * len(region.outers)
    assert all(shape.is_ring for shape in shapes)
    signs = [-1 if layer == "CUT_INNER" else 1 for layer in layers]
    found = sum(
        sign * shapely.Polygon(shape).area for sign, shape in zip(signs, shapes, strict=True)
    )
    assert found == pytest.approx(area, rel=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_lines_and_arcs_close_to_the_same_area(name: str, tmp_path: Path) -> None:
    region, area = CASES[name]
    layers, shapes = read(region, "arcs", tmp_path)
    found = 0.0
    for layer, sign in (("CUT_INNER", -1), ("CUT_OUTER", 1)):
        edges = [shape for shape, on in zip(shapes, layers, strict=True) if on == layer]
        # Ends of neighbours differ in the last digits, so all go to a grid of a nanometre.
        polygons = shapely.polygonize(shapely.set_precision(edges, 1e-6))
        found += sign * sum(polygon.area for polygon in polygons.geoms)
    assert found == pytest.approx(area, rel=1e-4)


@pytest.mark.parametrize("name", CASES)
def test_chords_stay_within_their_error(name: str, tmp_path: Path) -> None:
    region, area = CASES[name]
    layers, shapes = read(region, "chords", tmp_path)
    signs = [-1 if layer == "CUT_INNER" else 1 for layer in layers]
    found = sum(
        sign * shapely.Polygon(shape).area for sign, shape in zip(signs, shapes, strict=True)
    )
    length = sum(contour.length for contour in region.contours)
    assert abs(found - area) < 0.005 * length
