"""GDAL reads the cut files with the areas that closed formulas give."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import shapely
from hypothesis import given, settings
from pyogrio import raw

from sbafab.actuators import build, load_design
from sbafab.cutting.cut_settings import DxfProfile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, stadium, strip, union
from tests.interop.judging import areas
from tests.properties.designs import Draft, valid

pytestmark = pytest.mark.usefixtures("fine_arcs")


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
    "ring": (disc((0.0, 0.0), 3.25) - disc((0.0, 0.0), 0.5), math.pi * (3.25**2 - 0.25)),
    "stadium": (stadium((0.0, 0.0), 11.5, 20.0), 11.5 * 8.5 + math.pi * 5.75**2),
    "three discs": (
        union([disc((x, 1.0), 2.5) for x in (-6.0, 0.0, 6.0)]),
        3 * math.pi * 2.5**2,
    ),
    "tab": disc_with_tab(),
    "plate": lobed_plate(),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("profile", ["bulges", "arcs", "chords"])
def test_contours_enclose_the_area(name: str, profile: DxfProfile, tmp_path: Path) -> None:
    region, area = CASES[name]
    written = in_chords(region, None, 0.005) if profile == "chords" else region
    path = tmp_path / "part.dxf"
    path.write_text(dxf_text(cutting_sequence(written), {}, profile), encoding="utf-8")
    _, _, shapes, (layers,) = raw.read(path, columns=["Layer"])
    found = 0.0
    for layer, sign, contours in (("CUT_INNER", -1, region.holes), ("CUT_OUTER", 1, region.outers)):
        edges = shapely.from_wkb(shapes[layers == layer])
        assert profile == "arcs" or len(edges) == len(contours)
        # Ends of neighbours differ in the last digits, so all go to a grid of a nanometre.
        polygons = shapely.polygonize(shapely.set_precision(edges, 1e-6))
        found += sign * sum(polygon.area for polygon in polygons.geoms)
    length = sum(contour.length for contour in region.contours)
    assert found == pytest.approx(area, abs=0.005 * length if profile == "chords" else 1e-4 * area)


@settings(max_examples=8)
@given(valid())
def test_every_layer_of_a_random_design_has_its_area(draft: Draft) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        laminate = build(load_design(draft.write(folder)))
        for ours, theirs in areas(laminate, folder):
            assert theirs == pytest.approx(ours, rel=1e-4)
