"""ezdxf opens the cut files and finds nothing to mend."""

from __future__ import annotations

import math
import re
from io import StringIO
from pathlib import Path

import ezdxf
import pytest
import shapely
from ezdxf.document import Drawing
from pyogrio import raw

from sbafab.cutting.cut_settings import DxfProfile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, stadium, strip, union

AXES = [(4.25 * math.cos(turn), 4.25 * math.sin(turn)) for turn in (0.5, 2.6, 4.7)]
PROFILES: list[DxfProfile] = ["bulges", "arcs", "chords"]


def lobed() -> Region:
    outline = union([disc((0.0, 0.0), 1.75), *(disc(axis, 3.25) for axis in AXES)])
    outline = outline | strip((0.0, 0.0), (12.0, 3.0), 3.1)
    return outline - union([disc((0.0, 0.0), 1.0), *(disc(axis, 0.5) for axis in AXES)])


def text(profile: DxfProfile) -> str:
    region = in_chords(lobed(), "wall", 0.005) if profile == "chords" else lobed()
    return dxf_text(cutting_sequence(region), {"DESIGN": "lobed", "UNITS": "mm"}, profile)


def document(profile: DxfProfile) -> Drawing:
    return ezdxf.read(StringIO(text(profile)))


@pytest.mark.parametrize("profile", PROFILES)
def test_header_layers_and_properties(profile: DxfProfile) -> None:
    drawing = document(profile)
    auditor = drawing.audit()
    assert auditor.errors == auditor.fixes == []
    assert drawing.dxfversion == "AC1024"
    assert (drawing.header["$INSUNITS"], drawing.header["$MEASUREMENT"]) == (4, 1)
    assert drawing.header.custom_vars.properties == [("DESIGN", "lobed"), ("UNITS", "mm")]
    colours = {"ENGRAVE": 7, "CUT_INNER": 5, "CUT_OUTER": 1, "CUT_SHEET": 6}
    for name, colour in colours.items():
        assert drawing.layers.get(name).dxf.color == colour
    assert not drawing.layers.get("REFERENCE").dxf.plot


@pytest.mark.parametrize(
    ("profile", "kinds"),
    [
        ("bulges", {"CIRCLE", "LWPOLYLINE", "LINE"}),
        ("arcs", {"CIRCLE", "LINE", "ARC"}),
        ("chords", {"LWPOLYLINE", "LINE"}),
    ],
)
def test_entities_lie_flat_in_model_space(profile: DxfProfile, kinds: set[str]) -> None:
    drawing = document(profile)
    model = drawing.modelspace()
    assert {entity.dxftype() for entity in model} == kinds
    assert len(drawing.paperspace()) == 0
    for entity in model:
        attributes = entity.dxfattribs()
        for name in ("start", "end", "center"):
            assert attributes.get(name, (0, 0, 0))[2] == 0.0
        assert not {"elevation", "extrusion", "thickness", "const_width"} & attributes.keys()
    reference = model.query('*[layer=="REFERENCE"]')
    assert len(reference) == 2
    assert [entity.dxf.handle for entity in reference] == [
        entity.dxf.handle for entity in list(model)[-2:]
    ]


def test_polylines_are_closed_without_width_and_turn_a_quarter_at_most() -> None:
    (outline,) = document("bulges").modelspace().query("LWPOLYLINE")
    assert outline.closed
    assert not outline.has_width
    vertices = outline.get_points("xyb")
    assert vertices[0][:2] != vertices[-1][:2]
    assert max(abs(bulge) for *_, bulge in vertices) <= math.tan(math.pi / 8) + 1e-9
    assert all(
        bulge == 0.0
        for line in document("chords").modelspace().query("LWPOLYLINE")
        for *_, bulge in line.get_points("xyb")
    )


@pytest.mark.parametrize("profile", PROFILES)
def test_handles_are_unique_below_the_seed_and_owned_by_model_space(profile: DxfProfile) -> None:
    written = text(profile)
    seed = re.search(r"\$HANDSEED\n  5\n(\w+)\n", written)
    assert seed is not None
    body = written[written.index("\nCLASSES\n") :]
    used = [int(handle, 16) for handle in re.findall(r"\n(?:  5|105)\n(\w+)\n", body)]
    assert len(set(used)) == len(used)
    assert max(used) < int(seed[1], 16)
    drawing = document(profile)
    owner = drawing.modelspace().block_record_handle
    entities = body[body.index("\nENTITIES\n") : body.index("\nOBJECTS\n")]
    assert set(re.findall(r"\n330\n(\w+)\n", entities)) == {owner}
    assert drawing.entitydb[owner].dxf.name == "*Model_Space"


# GDAL reads the cut files with the areas that closed formulas give.


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
