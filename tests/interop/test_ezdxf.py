"""ezdxf opens the cut files and finds nothing to mend."""

from __future__ import annotations

import math
import re
from io import StringIO

import ezdxf
import pytest
from ezdxf.document import Drawing

from sbafab.cutting.cut_settings import DxfProfile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.region import Region, disc, strip, union

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
