"""Files of laser programs: settings, colours, order and shapes, read by other readers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
import shapely
import svgelements

from sbafab.cutting.beam_paths import beam_runs
from sbafab.cutting.cut_settings import PLAIN, LeadIns
from sbafab.cutting.dxf_write import Surroundings, contour_runs, drawn
from sbafab.cutting.laser_programs import (
    PROGRAMS,
    LaserSheet,
    laser_text,
    read_laser_file,
    verify_laser_file,
)
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc, stadium

SIZE = (80.0, 60.0)
AROUND = Surroundings(
    engraved=(((1.0, 1.0), (3.0, 1.0), (3.0, 2.0)),),
    parting=(((0.0, 60.0), (80.0, 60.0)),),
    frame=SIZE,
)
ASKED = LeadIns(lead_in=1.0, overcut=0.5, tab_width=0.6, tabs=2)
RING = disc((20.0, 20.0), 10.0) - disc((20.0, 20.0), 4.0)
OBLONG = stadium((50.0, 30.0), 16.0, 36.0)
PARTS = Region((*RING.contours, *OBLONG.contours))
AREA = math.pi * (10**2 - 4**2) + math.pi * 8**2 + 20 * 16
"""mm2: a ring, and a stadium."""


def sheet_of(lead_ins: LeadIns) -> LaserSheet:
    cuts = beam_runs(cutting_sequence(PARTS), lead_ins, AROUND)
    return LaserSheet(list(drawn(cuts, AROUND)), SIZE, "arm & co <1>", notes='arm "2" & co')


def written(folder: Path, program: str, lead_ins: LeadIns = PLAIN) -> Path:
    path = folder / f"TPE_1{PROGRAMS[program].ending}"
    path.write_text(laser_text(program, sheet_of(lead_ins)))
    return path


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("lead_ins", [PLAIN, ASKED])
def test_what_is_written_reads_back(program: str, lead_ins: LeadIns, tmp_path: Path) -> None:
    path = written(tmp_path, program, lead_ins)
    verify_laser_file(path, program, sheet_of(lead_ins))
    has_frame = "REFERENCE" in path.read_text()
    assert has_frame == (program == "lightburn"), "what the others see, they cut"


def test_rdworks_gets_a_sound_r12_whose_colours_are_its_layers(tmp_path: Path) -> None:
    """Order of cutting and of colours: black, blue, red, magenta."""
    document = ezdxf.readfile(written(tmp_path, "rdworks"))
    assert document.dxfversion == "AC1009"
    assert not document.audit().errors
    entities = list(document.modelspace())
    colours = [entity.dxf.color for entity in entities]
    assert colours == [7, 5, 1, 1, 6]
    assert [document.layers.get(e.dxf.layer).color for e in entities] == colours
    area = 0.0
    for entity in entities:
        if entity.dxf.color == 5:
            area -= math.pi * entity.dxf.radius**2
        elif entity.dxftype() == "CIRCLE":
            area += math.pi * entity.dxf.radius**2
        elif entity.dxf.color == 1:
            assert entity.is_closed
            ring = [(p.x, p.y) for e in entity.virtual_entities() for p in chords(e)]
            area += shapely.Polygon(ring).area
    assert area == pytest.approx(AREA, rel=1e-5)


def chords(entity: object) -> list[ezdxf.math.Vec3]:
    if entity.dxftype() == "LINE":  # type: ignore[attr-defined]
        return [entity.dxf.start, entity.dxf.end]  # type: ignore[attr-defined]
    return list(entity.flattening(1e-5))  # type: ignore[attr-defined]


def test_epilog_gets_hairlines_in_pure_colours_and_millimetres(tmp_path: Path) -> None:
    path = written(tmp_path, "epilog")
    root = ElementTree.parse(path).getroot()
    assert (root.get("width"), root.get("height")) == ("80mm", "60mm")
    groups = [item for item in root if item.tag.endswith("}g")]
    assert [group.get("stroke") for group in groups] == [
        *("#000000", "#0000ff", "#ff0000", "#ff00ff")
    ]
    for group in groups:
        assert float(group.get("stroke-width", "")) == 0.001 * 25.4
        assert group.get("fill") == "none"
    # svgelements reads a page of millimetres in 96ths of an inch, y downwards.
    area = 0.0
    for shape in svgelements.SVG.parse(path).elements():
        if isinstance(shape, svgelements.Shape) and shape.stroke.hex in ("#ff0000", "#0000ff"):
            ring = svgelements.Path(shape).npoint(np.linspace(0, 1, 4000))
            sign = 1 if shape.stroke.hex == "#ff0000" else -1
            area += sign * shapely.Polygon(ring).area * (25.4 / 96) ** 2
    assert area == pytest.approx(AREA, rel=1e-4)
    bounds = [shape.bbox() for shape in svgelements.SVG.parse(path).elements() if shape_is(shape)]
    top = min(box[1] for box in bounds) * 25.4 / 96
    assert top == pytest.approx(60 - 48), "the upper edge is at y = 48 mm from below"


def shape_is(shape: object) -> bool:
    return isinstance(shape, svgelements.Shape) and shape.stroke.hex == "#ff0000"


def test_curves_leave_their_arcs_by_less_than_their_formula_says(tmp_path: Path) -> None:
    """A cubic of 45 degrees is at most 4.3e-6 of the radius outside, and nowhere inside."""
    region = disc((0.0, 0.0), 400.0)
    half = region - region.moved(0.0, 300.0)
    runs = list(drawn(contour_runs(cutting_sequence(half)), Surroundings()))
    sheet = LaserSheet(runs, SIZE, "half")
    path = tmp_path / "large.lbrn2"
    path.write_text(laser_text("lightburn", sheet))
    [run] = read_laser_file(path, "lightburn").runs
    places = [curve.at(k / 32) for curve in run.curves for k in range(33)]
    offs = [min(abs(math.hypot(x, y - c) - 400) for c in (0.0, 300.0)) for x, y in places]
    assert 1e-4 < max(offs) < 4.3e-6 * 400
    path.write_text(path.read_text().replace("B1 2", "L1 2"))
    with pytest.raises(OutputError, match="differs from the written one"):
        verify_laser_file(path, "lightburn", sheet)


def test_no_power_and_no_order_is_left_to_lightburn(tmp_path: Path) -> None:
    root = ElementTree.parse(written(tmp_path, "lightburn")).getroot()
    for setting in root.iter("CutSetting"):
        told = {child.tag: child.get("Value") for child in setting}
        assert {told[name] for name in ("minPower", "maxPower", "minPower2", "maxPower2")} == {"0"}
        assert "speed" not in told
        assert setting.get("type") == "Cut"
        assert told["doOutput"] == ("0" if told["name"] == "REFERENCE: not cut" else "1")
    prefs = {child.tag: child.get("Value") for child in root.iterfind("UIPrefs/*")}
    assert (prefs.pop("Optimize_ByGroup"), prefs.pop("Optimize_ByPriority")) == ("-1", "1")
    assert set(prefs.values()) == {"0"}
    notes = root.find("Notes")
    assert notes is not None
    assert notes.get("Notes") == 'arm "2" & co'
    ids = [shape.get("VertID") for shape in root.iter("Shape") if shape.get("Type") == "Path"]
    assert len(set(ids)) == len(ids), "LightBurn takes shapes of one VertID for one"


def once(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        changed, count = re.subn(old, new, text, count=1, flags=re.DOTALL)
        assert count
        return changed

    return change


FAULTS: list[tuple[str, Callable[[str], str], str]] = [
    ("rdworks", once(r" 62\n5\n 10", " 62\n1\n 10"), "is one of CUT_OUTER, not of CUT_INNER"),
    (
        "rdworks",
        once(r" 62\n5\n 10", " 62\n3\n 10"),
        "has colour 3, which does not belong to a layer",
    ),
    ("rdworks", once(r" 40\n4\.0", " 40\n4.002"), "is not the circle that was written"),
    ("rdworks", once(r"  0\nCIRCLE.*?(?=  0\n[CP])", ""), "it has 4 lines, not 5"),
    ("rdworks", once(r"( 62\n1\n 10\n\d+\.\d)", r"\g<1>2"), "differs from the written one|circle"),
    ("rdworks", once(r"42\n0\.414", "42\n0.424"), "differs from the written one"),
    ("rdworks", lambda text: text[: len(text) // 2], "not a valid DXF|cannot be read"),
    ("rdworks", once("CIRCLE", "POINT"), "POINT .* cannot be cut"),
    (
        "rdworks",
        once("AC1009\n", "AC1009\n  9\n$INSUNITS\n 70\n1\n"),
        r"not in millimetres: \$INSUNITS is 1",
    ),
    ("epilog", once("#0000ff", "#ff0000"), "is one of CUT_OUTER, not of CUT_INNER"),
    ("epilog", once("#0000ff", "#00ff00"), "not hairlines in a layer colour"),
    ("epilog", once("0.0254", "0.254"), "not hairlines in a layer colour"),
    ("epilog", once('width="80mm"', 'width="80"'), "its page is not in millimetres"),
    ("epilog", once('r="4"', 'r="4.002"'), "is not the circle that was written"),
    ("epilog", once("A8 8 0 0 0", "A8 8 0 0 1"), "differs from the written one"),
    ("epilog", once(r"<circle .*?/>\n", ""), "it has 4 lines, not 5"),
    ("epilog", lambda text: text[: len(text) // 2], "cannot be read"),
    ("lightburn", once(r"V(-?\d+\.\d\d)\d*", r"V\g<1>9999"), "differs from"),
    ("lightburn", once(r'Rx="4" Ry="4"', 'Rx="4.002" Ry="4.002"'), "is not the circle"),
    ("lightburn", once(r'Rx="4"', 'Rx="4.1"'), "type Ellipse"),
    ("lightburn", once('MirrorX="False"', 'MirrorX="True"'), "mirrored"),
    ("lightburn", once(r'doOutput Value="0"', 'doOutput Value="1"'), "doOutput of layer REFERENCE"),
    (
        "lightburn",
        once(r'type="Cut"(><index Value="2")', r'type="Scan"\1'),
        "type of layer CUT_OUTER",
    ),
    ("lightburn", once('<kerf Value="0"/>', '<kerf Value="0.1"/>'), "kerf of layer ENGRAVE is 0.1"),
    ("lightburn", once('priority Value="1"', 'priority Value="9"'), "priority of layer CUT_INNER"),
    ("lightburn", once(r'<maxPower Value="0"', '<maxPower Value="9"'), "maxPower of layer"),
    ("lightburn", once(r'CutIndex="1"', 'CutIndex="2"'), "one of CUT_OUTER, not of CUT_INNER"),
    ("lightburn", once(r'<Shape Type="Ellipse".*?</Shape>\n', ""), "it has 5 lines, not 6"),
    (
        "lightburn",
        once(r'<CutSetting type="Cut"><index Value="7".*?</CutSetting>', ""),
        "are others",
    ),
    ("lightburn", once(r"([LB]\d+ 0)(</PrimList>)", r"\2"), "differs from the written one"),
    ("lightburn", once(r'Type="Path"', 'Type="Bitmap"'), "type Bitmap, which sheets do not use"),
    ("lightburn", once("<XForm>1 0 0 1", "<XForm>0 1 -1 0"), "rotates or scales a shape"),
    ("lightburn", once(r"<VertList>V", "<VertList>W"), "has 'W"),
    ("lightburn", lambda text: text[: len(text) // 2], "cannot be read"),
    ("lightburn", lambda text: "<svg/>", "not a LightBurn project"),
]


@pytest.mark.parametrize(("program", "change", "says"), FAULTS)
def test_a_file_that_is_not_the_sheet_is_told(
    program: str, change: Callable[[str], str], says: str, tmp_path: Path
) -> None:
    path = written(tmp_path, program)
    path.write_text(change(path.read_text()))
    with pytest.raises(OutputError, match=says):
        verify_laser_file(path, program, sheet_of(PLAIN))
