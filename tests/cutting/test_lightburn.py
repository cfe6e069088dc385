"""LightBurn projects: exact to a micrometre, with nothing fired that nobody set, read back."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from sbafab.cutting.beam_paths import contour_runs, drawn
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.laser_programs import (
    LaserSheet,
    laser_text,
    read_laser_file,
    verify_laser_file,
)
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import OutputError
from sbafab.geometry.region import Region, disc

AROUND = Surroundings(
    engraved=(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)),),
    parting=(((0.0, 60.0), (50.0, 60.0)),),
    frame=(50.0, 60.0),
)
NOTES = 'DESIGN: arm "2" & co'


def of_sheet(region: Region, around: Surroundings) -> LaserSheet:
    """Return a sheet without recipes."""
    runs = list(drawn(contour_runs(cutting_sequence(region)), around))
    return LaserSheet(runs, (50.0, 60.0), "arm", notes=NOTES)


@pytest.fixture
def parts(plate: Region) -> Region:
    """The plate and a large ring, on a sheet."""
    ring = disc((30.0, 45.0), 12.0) - disc((30.0, 45.0), 10.0)
    return Region((*plate.moved(15.0, 15.0).contours, *ring.contours))


@pytest.fixture
def project(parts: Region, tmp_path: Path) -> Path:
    path = tmp_path / "TPE_1.lbrn2"
    path.write_text(laser_text("lightburn", of_sheet(parts, AROUND)))
    return path


def test_what_is_written_reads_back(project: Path, parts: Region) -> None:
    verify_laser_file(project, "lightburn", of_sheet(parts, AROUND))
    found = read_laser_file(project, "lightburn")
    order = ["ENGRAVE", *["CUT_INNER"] * 5, *["CUT_OUTER"] * 2, "CUT_SHEET", "REFERENCE"]
    assert [run.layer for run in found.runs] == order
    outputs = {layer: told["doOutput"] for layer, told in found.settings.items()}
    assert outputs == {**dict.fromkeys(order, "1"), "REFERENCE": "0"}


def test_curves_leave_their_arcs_by_less_than_their_formula_says(tmp_path: Path) -> None:
    """A cubic of 45 degrees is at most 4.3e-6 of the radius outside, and nowhere inside."""
    region = disc((0.0, 0.0), 400.0)
    half = region - Region((disc((0.0, 0.0), 400.0).contours[0],)).moved(0.0, 300.0)
    path = tmp_path / "large.lbrn2"
    path.write_text(laser_text("lightburn", of_sheet(half, Surroundings())))
    [run] = read_laser_file(path, "lightburn").runs
    offs = []
    for curve in run.curves:
        for k in range(33):
            x, y = curve.at(k / 32)
            offs.append(min(abs(math.hypot(x, y - c) - 400) for c in (0.0, 300.0)))
    assert 1e-4 < max(offs) < 4.3e-6 * 400
    path.write_text(path.read_text().replace("B1 2", "L1 2"))
    with pytest.raises(OutputError, match="differs from what was written"):
        verify_laser_file(path, "lightburn", of_sheet(half, Surroundings()))


def test_no_power_and_no_order_is_left_to_the_reader(project: Path) -> None:
    root = ElementTree.parse(project).getroot()
    for setting in root.iter("CutSetting"):
        told = {child.tag: child.get("Value") for child in setting}
        assert {told[name] for name in ("minPower", "maxPower", "minPower2", "maxPower2")} == {"0"}
        assert "speed" not in told
        assert setting.get("type") == "Cut"
    prefs = {child.tag: child.get("Value") for child in root.iterfind("UIPrefs/*")}
    assert prefs.pop("Optimize_ByGroup") == "-1"
    assert prefs.pop("Optimize_ByPriority") == "1"
    assert set(prefs.values()) == {"0"}
    notes = root.find("Notes")
    assert notes is not None
    assert 'DESIGN: arm "2" & co' in notes.get("Notes", "")
    ids = [shape.get("VertID") for shape in root.iter("Shape") if shape.get("Type") == "Path"]
    assert len(set(ids)) == len(ids), "LightBurn takes shapes of one VertID for one"


def changed(pattern: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        text, count = re.subn(pattern, new, text, count=1, flags=re.DOTALL)
        assert count
        return text

    return change


ROUND = "is not the circle that was written"
SPOILT: dict[str, tuple[Callable[[str], str], str]] = {
    "a vertex 2 um off": (changed(r"V(\d+\.\d\d)\d*", r"V\g<1>9999"), "differs from"),
    "a circle 2 um larger": (changed(r'Rx="10" Ry="10"', 'Rx="10.002" Ry="10.002"'), ROUND),
    "a circle that is an ellipse": (changed(r'Rx="10"', 'Rx="10.1"'), "type Ellipse"),
    "a circle elsewhere": (changed(r"(1 0 0 1 30 45)", "1 0 0 1 30.002 45"), ROUND),
    "all of it mirrored": (changed('MirrorX="False"', 'MirrorX="True"'), "mirrored"),
    "the frame cut": (
        changed(r'doOutput Value="0"', 'doOutput Value="1"'),
        "doOutput of layer REFERENCE is 1",
    ),
    "holes not cut": (
        changed(r'(index Value="1".*?)doOutput Value="1"', r'\1doOutput Value="0"'),
        "doOutput of layer CUT_INNER is 0",
    ),
    "outlines filled": (
        changed(r'type="Cut"(><index Value="2")', r'type="Scan"\1'),
        "type of layer CUT_OUTER is Scan",
    ),
    "kerf taken off twice": (
        changed(r'<kerf Value="0"/>', '<kerf Value="0.1"/>'),
        "kerf of layer ENGRAVE is 0.1",
    ),
    "outlines before holes": (
        changed(r'priority Value="1"', 'priority Value="9"'),
        "priority of layer CUT_INNER is 9",
    ),
    "a hole on the outlines' layer": (changed('CutIndex="1"', 'CutIndex="2"'), "of CUT_OUTER, not"),
    "a shape too few": (
        changed(r'<Shape Type="Ellipse".*?</Shape>\n', ""),
        "it has 9 lines, not 10",
    ),
    "an open outline": (
        changed(r'(CutIndex="2".*?)([LB]\d+ 0)(</PrimList>)', r"\1\3"),
        "differs from what was written",
    ),
    "layer without settings": (
        changed(r'<CutSetting type="Cut"><index Value="7".*?</CutSetting>', ""),
        "layers are others",
    ),
    "a power set": (changed(r'<maxPower Value="0"', '<maxPower Value="9"'), "maxPower of layer"),
    "a picture": (
        changed(r'Type="Path"', 'Type="Bitmap"'),
        "a shape of the type Bitmap that no sheet has",
    ),
    "a part turned": (changed("<XForm>1 0 0 1", "<XForm>0 1 -1 0"), "turns or stretches a shape"),
    "half a circle": (
        changed(
            r'<Shape Type="Ellipse" CutIndex="1" Rx="10".*?</Shape>',
            '<Shape Type="Path" CutIndex="1"><XForm>1 0 0 1 0 0</XForm>'
            "<VertList>V40 45c0x1c1x1V40 45c0x1c1x1</VertList>"
            "<PrimList>L0 1L1 0</PrimList></Shape>",
        ),
        ROUND,
    ),
    "half of it": (lambda text: text[: len(text) // 2], "cannot be read"),
    "words in a path": (changed(r"<VertList>V", "<VertList>W"), "says 'W"),
    "another document": (lambda text: "<svg/>", "no LightBurn project"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_is_not_the_sheet_is_told(name: str, project: Path, parts: Region) -> None:
    change, says = SPOILT[name]
    project.write_text(change(project.read_text()))
    with pytest.raises(OutputError, match=says):
        verify_laser_file(project, "lightburn", of_sheet(parts, AROUND))
