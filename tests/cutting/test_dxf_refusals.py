"""A cut file that cannot be cut is refused with one sentence that says why."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from io import StringIO
from itertools import pairwise
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.layouts import Modelspace

from sbafab.cutting.chaining import JOINED, check_clear, closed_loops
from sbafab.cutting.dxf_read import _as_written, read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import OutputError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Line, Point
from sbafab.geometry.region import Region, disc
from tests.quick import few

OUTER = {"layer": "CUT_OUTER"}
SQUARE = [(20.0, 0.0), (24.0, 0.0), (24.0, 4.0), (20.0, 4.0)]


def drawn(text: str, draw: Callable[[Modelspace], object]) -> str:
    """The document with something added by ezdxf."""
    document = ezdxf.read(StringIO(text))
    draw(document.modelspace())
    stream = StringIO()
    document.write(stream)
    return stream.getvalue()


def entity(text: str, kind: str) -> str:
    """The first entity of a kind, with its group codes."""
    start = text.index(f"  0\n{kind}\n", text.index("\nENTITIES\n"))
    return text[start : text.index("\n  0\n", start + 4) + 1]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("$INSUNITS\n 70\n4", "$INSUNITS\n 70\n6", "not in millimetres"),
        ("  8\nCUT_OUTER\n100\nAcDbPolyline", "  8\nOUTLINE\n100\nAcDbPolyline", "layer OUTLINE"),
        ("  8\nCUT_INNER\n100", "  8\nCUT_OUTER\n100", "is a hole but on CUT_OUTER"),
        ("AcDbPolyline\n", "AcDbPolyline\n 38\n0.5\n", "not at z = 0"),
        ("AcDbPolyline\n", "AcDbPolyline\n 43\n0.2\n", "has a width"),
        ("AcDbPolyline\n", "AcDbPolyline\n210\n0.0\n220\n0.0\n230\n-1.0\n", "not at z = 0"),
        ("\n 30\n0.0\n 40\n1.0\n", "\n 30\n0.1\n 40\n1.0\n", "not at z = 0"),
        ("\n 30\n0.0\n 40\n1.0\n", "\n 30\n0.0\n 40\n0.0\n", "a zero-length edge"),
        ("\n 30\n0.0\n 40\n1.0\n", "\n 30\n0.0\n 40\nnan\n", "is not a number"),
        ("\n 30\n0.0\n 40\n1.0\n", "\n 30\n0.0\n 40\n3.8\n", "touch or cross"),
        ("\n 40\n1.0\n", "\n 40\nwide\n", "not a valid DXF"),
        ("  0\nSECTION\n  2\nHEADER", "hello", "not an ASCII DXF"),
        (" 70\n1\n 10\n", " 70\n0\n 10\n", "is open"),
        ("$INSUNITS\n 70\n4", "$INSUNITS\n 70\n1", "not in millimetres"),
        ("$MEASUREMENT\n 70\n1", "$MEASUREMENT\n 70\n0", "not in millimetres"),
        ("  8\nCUT_OUTER\n100", "  8\n0\n100", "on layer 0"),
        ("  8\nCUT_OUTER\n100", "  8\nCUT_INNER\n100", "is an outline but on CUT_INNER"),
    ],
)
def test_doctored_file_is_refused(
    old: str, new: str, says: str, plate_text: str, write: Callable[[str], Path]
) -> None:
    head, found, tail = plate_text.partition(old)
    assert found
    with pytest.raises(OutputError, match=says) as caught:
        read_profile(write(head + new + tail))
    assert str(caught.value).startswith("001_TPE_base.dxf: ")


def line(model: Modelspace, points: list[tuple[float, ...]], **form: str) -> None:
    layer = {"layer": form.pop("layer", "CUT_OUTER")}
    model.add_lwpolyline(points, close=True, dxfattribs=layer, **form)


def two(model: Modelspace) -> None:
    line(model, SQUARE)
    line(model, [(x + 4.0, y + 3.0) for x, y in SQUARE])


def old(key: str, everywhere: bool) -> Callable[[Modelspace], object]:
    """Group codes 40 and 41: of a vertex, or of the whole for vertices that have none (DXF)."""

    def draw(model: Modelspace) -> None:
        polyline = model.add_polyline2d(SQUARE, close=True, dxfattribs=OUTER)
        if everywhere:
            polyline.dxf.set(f"default_{key}", 0.2)
        else:
            polyline.vertices[2].dxf.set(key, 0.2)

    return draw


SPECK = [(20.0 + x * 1e-4, y * 1e-4) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
BOW = [SQUARE[0], SQUARE[2], SQUARE[1], (20.0, 3.0)]
BENT = [(0.0, 1.0, 1.0), (0.0, -1.0, 1.0)]
DRAWN: list[tuple[Callable[[Modelspace], object], str]] = [
    (lambda m: line(m, BENT, format="xyb", layer="CUT_INNER"), r"duplicates|twice"),
    (two, r"twice|touch or cross"),
    (lambda m: line(m, BOW), "touch or cross"),
    (lambda m: line(m, [*SQUARE, SQUARE[0]]), r"repeats its vertex x 20\.000, y 0\.000"),
    (lambda m: line(m, [(x, y, 0.0, 0.2) for x, y in SQUARE], format="xyse"), "has a width"),
    *((old(k, e), "has a width") for k in ("start_width", "end_width") for e in (True, False)),
    (lambda m: line(m, SPECK), "encloses nothing"),
    (lambda m: m.add_line((20, 0), (20, 0), dxfattribs=OUTER), "zero-length edge"),
    (lambda m: m.add_arc((20, 0), 1.0, 45.0, 45.0, dxfattribs=OUTER), "zero-length edge"),
    (lambda m: m.add_circle((20, 0), -1.0, dxfattribs=OUTER), "zero-length edge"),
    (lambda m: m.add_spline([(0, 0), (1, 1), (2, 0)], dxfattribs=OUTER), "cannot be cut"),
    (lambda m: m.add_ellipse((0, 0), (3, 0), 0.5, dxfattribs=OUTER), "cannot be cut"),
    (lambda m: m.add_text("P01", dxfattribs=OUTER), "cannot be cut"),
    (lambda m: m.add_hatch(dxfattribs=OUTER), "cannot be cut"),
    (lambda m: m.add_point((0, 0), dxfattribs=OUTER), "cannot be cut"),
    (lambda m: m.add_polyline3d([(0, 0, 0), (1, 0, 0), (1, 1, 0)], dxfattribs=OUTER), "be cut"),
    (lambda m: m.add_polyline2d(SQUARE, dxfattribs={**OUTER, "flags": 5}), "cannot be cut"),
    (lambda m: m.add_blockref(m.doc.blocks.new("PART").name, (0, 0)), "cannot be cut"),
    (lambda m: m.doc.paperspace().add_circle((0, 0), 1.0), "model space only"),
]


@pytest.mark.parametrize(("draw", "says"), DRAWN)
def test_what_cannot_be_cut_is_refused(
    draw: Callable[[Modelspace], object], says: str, plate_text: str
) -> None:
    with pytest.raises(OutputError, match=says):
        read_profile(drawn(plate_text, draw))


def test_missing_and_doubled_edges_of_a_chain_are_refused(plate: Region) -> None:
    text = dxf_text(cutting_sequence(plate), {}, "arcs")
    for kind in ("LINE", "ARC"):
        edge = entity(text, kind)
        with pytest.raises(OutputError, match="contour open at x"):
            read_profile(text.replace(edge, ""))
        handle = edge.split("\n")[3]
        copy = edge.replace(f"  5\n{handle}\n", "  5\nFFF\n")
        with pytest.raises(OutputError, match="duplicates"):
            read_profile(text.replace(edge, edge + copy))


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2, 0.5, 0.8, 0.9, 0.99, 0.9999])
def test_truncated_file_is_refused(
    share: float, plate_text: str, write: Callable[[str], Path]
) -> None:
    with pytest.raises(OutputError, match=r"DXF document|ends early"):
        read_profile(write(plate_text[: int(share * len(plate_text))]))


@pytest.mark.parametrize(("flags", "fitted"), [(1, False), (1 | 2, True), (1 | 4, True)])
def test_an_old_polyline_is_read_as_it_stands_and_refused_with_a_curve_fitted(
    flags: int, fitted: bool, plate_text: str
) -> None:
    """Flag 1 is closed; 2 and 4 tell of curves and splines fitted to the vertices (DXF)."""

    def old(model: Modelspace) -> None:
        polyline = model.add_polyline2d(SQUARE, close=True, dxfattribs=OUTER)
        polyline.dxf.flags = flags

    text = drawn(plate_text, old)
    if fitted:
        with pytest.raises(OutputError):
            read_profile(text)
    else:
        before = read_profile(plate_text).region.area
        assert read_profile(text).region.area == pytest.approx(before + 16.0)


def _swapped(old: str, new: str) -> Callable[[str], str]:
    """The file with the first such text among its entities replaced."""

    def doctored(text: str) -> str:
        head, mark, entities = text.partition("  2\nENTITIES\n")
        assert old in entities
        return head + mark + entities.replace(old, new, 1)

    return doctored


@pytest.mark.parametrize(
    ("doctored", "says"),
    [
        (lambda t: re.sub(r"(?<=INSUNITS\n 70\n) *4", "1", t), "millimetres"),
        (_swapped(" 30\n0.0\n", " 30\n1.0\n"), "not at z = 0"),
        (_swapped("AcDbEntity\n", "AcDbEntity\n 60\n1\n"), "invisible"),
        (_swapped("AcDbEntity\n", "AcDbEntity\n 67\n     1\n"), "paper space"),
        (_swapped("AcDbEntity\n", "AcDbEntity\n  6\nDASHED\n"), "linetype"),
    ],
)
def test_what_is_changed_in_our_own_form_is_seen(
    doctored: Callable[[str], str], says: str, plate_text: str
) -> None:
    with pytest.raises(OutputError, match=says):
        read_profile(doctored(plate_text))


def test_a_file_that_is_not_byte_for_byte_ours_is_read_by_ezdxf(plate_text: str) -> None:
    """Another owner, a handle that stands twice, another subclass, another next handle."""
    assert _as_written(plate_text) is not None
    entities = plate_text[plate_text.index("  2\nENTITIES\n") :]
    handles, owner = re.findall(r"\n  5\n(\w+)\n330\n", entities), entities.split("330\n", 1)[1][:2]
    for doctored in (
        _swapped(f"330\n{owner.strip()}\n", "330\n1B\n"),
        _swapped(f"  5\n{handles[1]}\n", f"  5\n{handles[0]}\n"),
        _swapped("AcDbPolyline", "AcDbCircle"),
        _swapped(" 90\n", " 91\n"),
        lambda text: re.sub(r"(?<=HANDSEED\n  5\n)\w+", "FFF", text),
    ):
        assert _as_written(doctored(plate_text)) is None


# How other programs may say that a line is drawn as its layer's; what they may not say.


Edit = Callable[[Drawing, DXFGraphic], object]


def saved(edit: Edit, version: str = "R2010") -> str:
    """A disc's cut file, changed and saved by ezdxf as another program might."""
    text = dxf_text(disc((3.0, 2.0), 4.0).contours, {"DESIGN": "disc"})
    document = ezdxf.read(StringIO(text))
    document.dxfversion = version
    edit(document, next(iter(document.modelspace().query("CIRCLE"))))
    stream = StringIO()
    document.write(stream)
    return stream.getvalue()


def coloured(entity: DXFGraphic, rgb: tuple[int, int, int]) -> None:
    entity.rgb = rgb


@pytest.mark.parametrize("version", few(["R2000", "R2004", "R2018"], 1))
@pytest.mark.parametrize(
    "edit",
    [
        lambda d, e: None,
        lambda d, e: e.dxf.set("color", 1),
        lambda d, e: e.dxf.set("linetype", "BYLAYER"),
        lambda d, e: e.dxf.set("linetype", "CONTINUOUS"),
        lambda d, e: e.dxf.set("lineweight", 25),
        lambda d, e: d.layers.get("CUT_OUTER").dxf.set("lineweight", 50),
        lambda d, e: d.layers.get("ENGRAVE").off(),
        lambda d, e: d.layers.get("REFERENCE").dxf.set("plot", 1),
    ],
)
def test_what_cuts_the_same_is_read(edit: Edit, version: str) -> None:
    assert len(read_profile(saved(edit, version)).region.outers) == 1


def test_a_true_colour_may_be_the_layers() -> None:
    assert read_profile(saved(lambda d, e: coloured(e, (255, 0, 0)))).region.outers


def test_an_entity_marked_as_one_of_paper_space_is_refused() -> None:
    text = saved(lambda d, e: None).replace(
        "CUT_OUTER\n100\nAcDbC", "CUT_OUTER\n 67\n1\n100\nAcDbC"
    )
    with pytest.raises(OutputError, match="CIRCLE is in paper space"):
        read_profile(text)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda d, e: d.layers.get("REFERENCE").off(), "REFERENCE is off"),
        (lambda d, e: d.layers.remove("CUT_OUTER"), "not in the layer table"),
        (lambda d, e: e.dxf.set("thickness", 2.0), "thickness of 2 mm"),
        (lambda d, e: setattr(e, "transparency", 0.5), "is transparent"),
    ],
)
def test_what_may_be_skipped_is_refused(edit: Edit, said: str) -> None:
    """The catalogue of faults has the other ways."""
    with pytest.raises(OutputError, match=said):
        read_profile(saved(edit))


# Loose edges become contours, also where edges are shorter than ends may lie apart.


# A square of 1 mm whose last corner is cut off by three edges of half a micrometre each.
TINY = 0.0005
CORNERS = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.001, 1.0), (0.0007, 0.9996), (0.0003, 0.9993)]


def square(apart: float = 0.0) -> list[Line]:
    """Edges of the square, each end ``apart`` mm from where the next one starts."""
    closed: list[Point] = [*CORNERS, (0.0, 0.9992), CORNERS[0]]
    return [Line((a[0], a[1] + apart), b) for a, b in pairwise(closed)]


def test_tiny_edges_whose_ends_meet_stay() -> None:
    edges = square()
    assert min(edge.length for edge in edges) < TINY < JOINED
    (contour,) = closed_loops(edges[::-1])
    assert len(contour.edges) == len(edges)


@pytest.mark.parametrize("apart", [0.0002, 0.0009])
def test_tiny_edges_whose_ends_lie_apart_become_a_corner(apart: float) -> None:
    (contour,) = closed_loops(square(apart))
    assert 4 <= len(contour.edges) < len(square())
    assert abs(contour.area) == pytest.approx(1.0, abs=4 * JOINED)


def test_a_tiny_line_by_itself_is_refused() -> None:
    with pytest.raises(OutputError, match=r"contour open at x 3\.000, y 3\.000; close it\."):
        closed_loops([*square(), Line((3.0, 3.0), (3.0, 3.0 + TINY))])


def test_an_edge_drawn_twice_is_refused() -> None:
    edges = square()
    with pytest.raises(OutputError, match="3 edges end at x"):
        closed_loops([*edges, edges[0].reversed()])


@pytest.mark.parametrize("centre", [1.5, 0.5])
def test_circles_that_just_touch_are_refused(centre: float) -> None:
    """Discs of 1 and 0.5 mm, the small one outside (1 + 0.5) or inside (1 - 0.5)."""
    way = 1 if centre > 1 else -1
    for overlap in (0.0, 1e-5):
        small = disc((centre - way * overlap, 0.0), 0.5)
        with pytest.raises(OutputError, match=r"contours touch or cross at x 1\.000"):
            check_clear([*disc((0, 0), 1.0).contours, *small.contours])
    small = disc((centre + way * 1e-4, 0.0), 0.5)
    check_clear([*disc((0, 0), 1.0).contours, *small.contours])


def test_an_edge_that_crosses_the_one_before_it_is_refused() -> None:
    """A line along y = 0 to x = 1, and an arc round (0.5, 0.2) from there back over x = 0."""
    radius, past = math.hypot(0.5, 0.2), math.atan2(-0.2, -0.5) - math.radians(30)
    end = 0.5 + radius * math.cos(past), 0.2 + radius * math.sin(past)
    arc = Arc((1.0, 0.0), end, (0.5, 0.2), radius, ccw=False)
    corners = [end, (-1.0, 1.0), (-1.0, 0.0), (1.0, 0.0)]
    lines = [Line(a, b) for a, b in pairwise(corners)]
    with pytest.raises(OutputError, match=r"contours touch or cross at x -?0\.000, y -?0\.000"):
        check_clear([Contour((arc, *lines))])
