"""What is written is read back as the same contours, in every way of writing curves."""

from __future__ import annotations

import math
import re

import ezdxf
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sbafab.cutting.cut_settings import COLOURS, DxfProfile
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import SKELETON, dxf_text, number, skeleton_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.contour import in_reading_order
from sbafab.geometry.offset import shrink
from sbafab.geometry.region import Region, disc, union
from sbafab.geometry.width import least_gap
from tests.cutting.shapes import shapes


@given(
    parts=st.lists(shapes(), min_size=1, max_size=3),
    holes=st.lists(shapes(), max_size=2),
    profile=st.sampled_from(["bulges", "arcs", "chords"]),
)
def test_what_is_written_is_read(
    parts: list[Region], holes: list[Region], profile: DxfProfile
) -> None:
    region = union(parts) - union(holes)
    # Contours that touch at a point are refused: a shrunk part has none.
    region = shrink(region, 0.05)
    assume(all(piece.area > 1e-3 for piece in region.pieces) and not region.is_empty)
    gap = least_gap(region, 0.0)
    assume(min(edge.length for edge in region.edges) > 0.01 and (not gap or gap.value > 0.01))
    drawn = in_chords(region, None, 0.005) if profile == "chords" else region
    text = dxf_text(cutting_sequence(drawn), {"DESIGN": "a"}, profile)
    plain = read_profile(text)
    # A space less makes it another program's file, which ezdxf reads.
    by_ezdxf = read_profile(text.removeprefix(" "))
    assert plain == by_ezdxf
    read = plain.region
    assert Region(in_reading_order(read.contours)) == drawn
    assert read.area == pytest.approx(drawn.area, abs=1e-6)


def test_custom_properties_come_back() -> None:
    properties = {"DESIGN": "Grüße", "WAIVED": "none", "NOTE": "two\nlines"}
    found = read_profile(dxf_text(disc((0.0, 0.0), 1.0).contours, properties)).properties
    assert found == {"DESIGN": "Grüße", "WAIVED": "none", "NOTE": "two lines"}


def test_holes_come_first_and_the_datum_last(plate: Region) -> None:
    found = read_profile(dxf_text(cutting_sequence(plate), {}))
    assert found.layers == (*["CUT_INNER"] * 4, "CUT_OUTER", "REFERENCE", "REFERENCE")
    assert found.other == ("LINE", "LINE")
    assert found.units == "mm"


def test_a_large_bulge_from_elsewhere_is_read_exactly(plate_text: str) -> None:
    """Three quarters of a circle of radius 1 and the chord: area 3/4 pi + 1/2."""
    bulge = math.tan(math.radians(270) / 4)
    body = f" 90\n2\n 70\n1\n 10\n1.0\n 20\n0.0\n 42\n{bulge}\n 10\n0.0\n 20\n-1.0\n"
    start = plate_text.index("  0\nCIRCLE\n")
    end = plate_text.index("  0\nENDSEC", start)
    entity = (
        f"  0\nLWPOLYLINE\n  5\n900\n100\nAcDbEntity\n  8\nCUT_OUTER\n100\nAcDbPolyline\n{body}"
    )
    region = read_profile(plate_text[:start] + entity + plate_text[end:]).region
    assert math.isclose(region.area, 0.75 * math.pi + 0.5, rel_tol=1e-9)


def test_extents_bound_the_drawing(plate: Region, plate_text: str) -> None:
    low = re.search(r"\$EXTMIN\n 10\n(.*)\n 20\n(.*)\n", plate_text)
    high = re.search(r"\$EXTMAX\n 10\n(.*)\n 20\n(.*)\n", plate_text)
    assert low is not None
    assert high is not None
    found = [float(value) for value in (*low.groups(), *high.groups())]
    assert found == pytest.approx(plate.bounds, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.0, "0.0"), (-1e-12, "0.0"), (2.5, "2.5"), (1e-7, "0.0000001"), (1 / 3, "0.333333333")],
)
def test_numbers_have_no_exponent_and_no_negative_zero(value: float, text: str) -> None:
    assert number(value) == text


# The packaged empty document is what ezdxf writes.


@pytest.mark.skipif(ezdxf.version < (1, 4), reason="older ezdxf writes more tags")
def test_packaged_document_is_the_one_ezdxf_writes() -> None:
    assert SKELETON.read_text(encoding="utf-8") == skeleton_text()


def test_it_is_an_empty_document_in_millimetres_with_the_cut_layers() -> None:
    document = ezdxf.readfile(SKELETON)
    assert document.dxfversion == "AC1024"
    assert (document.header["$INSUNITS"], document.header["$MEASUREMENT"]) == (4, 1)
    assert len(document.modelspace()) == 0
    colours = {layer.dxf.name: layer.dxf.color for layer in document.layers}
    assert colours.items() >= COLOURS.items()
    assert document.layers.get("REFERENCE").dxf.plot == 0
    assert document.layers.get("CUT_OUTER").dxf.plot == 1
