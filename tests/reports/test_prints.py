"""underlay.pdf, seams.pdf and tray.pdf read back by PDFium: true sizes, every line in its place."""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
import pytest
import shapely
import shapely.affinity

from sbafab.actuators import build, load_design
from sbafab.cutting.fixture import plate_corner
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import Runs, design_runs, runs_of
from sbafab.pressing.schedule import schedule
from sbafab.reports.prints import guides, leaves, tray_pdf, underlay_pdf

SHA = "0123456789abcdef" * 4
MM = 25.4 / 72
FILM, MASK, BLACK, GREY = (13, 64, 140), (217, 102, 0), (0, 0, 0), (140, 140, 140)
PLATE = 152.4
Points = list[tuple[float, float]]


def document_of(data: bytes | None) -> pypdfium2.PdfDocument:
    assert data is not None
    return pypdfium2.PdfDocument(data)


def words(document: pypdfium2.PdfDocument, page: int = 0) -> str:
    return str(document[page].get_textpage().get_text_range())


def size_of(document: pypdfium2.PdfDocument, page: int = 0) -> tuple[float, float]:
    width, height = document[page].get_size()
    return width * MM, height * MM


def paths(
    document: pypdfium2.PdfDocument, colour: tuple[int, int, int], page: int = 0
) -> Iterator[Points]:
    """Points in mm along every path of a colour, curves followed in eight steps."""
    for thing in document[page].get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH]):
        shades = [ctypes.c_uint() for _ in range(4)]
        assert pdfium.FPDFPageObj_GetStrokeColor(thing.raw, *shades)
        if tuple(int(shade.value) for shade in shades[:3]) == colour:
            yield _followed(thing)


def _followed(thing: Any) -> Points:
    matrix = thing.get_matrix()
    found: Points = []
    handles: Points = []
    for index in range(pdfium.FPDFPath_CountSegments(thing.raw)):
        segment = pdfium.FPDFPath_GetPathSegment(thing.raw, index)
        x, y = ctypes.c_float(), ctypes.c_float()
        assert pdfium.FPDFPathSegment_GetPoint(segment, x, y)
        px, py = matrix.on_point(x.value, y.value)
        handles.append((px * MM, py * MM))
        if pdfium.FPDFPathSegment_GetType(segment) != pdfium.FPDF_SEGMENT_BEZIERTO:
            found, handles = [*found, *handles], []
        elif len(handles) == 3:
            corners = np.array([found[-1], *handles])
            for t in np.arange(1, 9) / 8:
                shares = [math.comb(3, n) * t**n * (1 - t) ** (3 - n) for n in range(4)]
                found.append(tuple(shares @ corners))
            handles = []
    return found


def lengths(document: pypdfium2.PdfDocument, page: int = 0) -> list[float]:
    """Lengths of the black lines, sorted."""
    return sorted(math.dist(path[0], path[-1]) for path in paths(document, BLACK, page))


@pytest.mark.parametrize("template", ["3dof-15mm", "1dof-5mm", "radial-15mm"])
def test_the_print_is_at_actual_size_and_its_trim_line_is_the_edge_of_the_plate(
    template: str,
) -> None:
    """Cut out and laid flush with the plate, its lines lie where the plate's holes want them."""
    laminate = build(load_design(template))
    data = underlay_pdf(laminate, SHA)
    document = document_of(data)
    assert len(document) == 1
    # As wide as A4, as long as Letter: both print it whole.
    assert size_of(document) == pytest.approx((210.0, 279.4), abs=0.01)
    # The file answers a printer's window: no scaling.
    assert b"/PrintScaling /None" in (data or b"")
    assert lengths(document)[-2:] == pytest.approx([100.0, 100.0], abs=1e-3)
    # A square of 6 inches, less 5 mm at the corner of largest x and y.
    outlines = [shapely.Polygon(path) for path in paths(document, BLACK) if len(path) >= 5]
    [edge] = [outline for outline in outlines if outline.area > 1e4]
    assert edge.area == pytest.approx(PLATE**2 - 5 * 5 / 2, abs=0.1)
    left, low, right, top = edge.bounds
    assert (right - left, top - low) == pytest.approx((PLATE, PLATE), abs=2e-3)
    assert not edge.contains(shapely.Point(right - 1, top - 1))
    # The actuator's axis, where the cross is, lies from the edge as the plate's datum does.
    x0, y0 = plate_corner(laminate, (PLATE, PLATE))
    lines = [path for path in paths(document, GREY) if len(path) == 2]
    [upright] = [path for path in lines if abs(path[0][0] - path[1][0]) < 1e-3]
    [level] = [path for path in lines if abs(path[0][1] - path[1][1]) < 1e-3]
    assert (upright[0][0] - left, level[0][1] - low) == pytest.approx((-x0, -y0), abs=2e-3)
    assert 18 < left < right < 210 - 18
    assert 40 < low < top < 279.4 - 50


def test_every_line_is_the_edge_of_what_is_laid_there() -> None:
    laminate = build(load_design("3dof-15mm"))
    document = document_of(underlay_pdf(laminate, SHA))
    drawn = [line for colour in (FILM, MASK) for line in paths(document, colour) if len(line) > 2]
    laid = [laminate.patterns[guide.patterns[0]][0].profile for guide in guides(laminate)]
    rings = [piece[0] for profile in laid for piece in profile.polygons(1e-5)]
    meant = shapely.MultiLineString([[*ring, ring[0]] for ring in rings])
    found = shapely.MultiLineString([[*line, line[0]] for line in drawn])
    shift = [a - b for a, b in zip(meant.bounds, found.bounds, strict=True)]
    assert shift[:2] == pytest.approx(shift[2:], abs=2e-3)
    # Chords of the followed curves leave them by up to 0.004 mm.
    back = shapely.affinity.translate(found, *shift[:2])
    assert shapely.hausdorff_distance(meant, back, densify=0.1) < 0.01
    assert len(drawn) == len(rings)


def test_a_cycle_larger_than_the_paper_is_tiled_edge_to_edge() -> None:
    platen = 300.0, 300.0
    sides = ["press.platen_width=300", "press.platen_length=300"]
    laminate = build(load_design("3dof-15mm", sides))
    places = runs_of(laminate, 40, platen).places
    spread = leaves(laminate, places, platen)
    assert sorted(n for leaf in spread for n in leaf.places) == list(range(1, 41))
    document = document_of(underlay_pdf(laminate, SHA, places, platen))
    assert len(document) == len(spread) == 4
    for page, leaf in enumerate(spread):
        assert size_of(document, page) == pytest.approx((210.0, 279.4), abs=0.01)
        bars = [length for length in lengths(document, page) if abs(length - 100) < 1e-3]
        assert len(bars) == 2
        outlines = [line for line in paths(document, FILM, page) if len(line) > 2]
        # Two outlines of the laminate at each place, as far from each other as in the press.
        middles = [shapely.Polygon(line).centroid for line in outlines][
            :: len(guides(laminate)) - 1
        ]
        for number, middle in zip(leaf.places, middles, strict=True):
            (x, y), (u, v) = places[number - 1], places[leaf.places[0] - 1]
            off = middle.x - middles[0].x, middle.y - middles[0].y
            assert off == pytest.approx((x - u, y - v), abs=2e-3)
        # Every outline lies whole within the frame that is cut out.
        (frame,) = (shapely.Polygon(p) for p in paths(document, BLACK, page) if len(p) >= 5)
        x0, y0, x1, y1 = leaf.trim.bounds
        assert frame.area == pytest.approx((x1 - x0) * (y1 - y0), rel=1e-4)
        assert frame.contains_properly(shapely.MultiLineString(outlines))
    tiles = [shapely.box(*leaf.trim.bounds) for leaf in spread]
    whole = shapely.union_all(tiles)
    assert sum(tile.area for tile in tiles) == pytest.approx(whole.area)
    assert whole.area == pytest.approx(whole.envelope.area)


def test_it_shows_what_a_hand_lays_in_films_by_their_names() -> None:
    # Base and cap; a 1-DoF separator, whose hole is wider than the pin, in step 3 as well.
    one = {
        guide.patterns[0]: tuple(guide.steps) for guide in guides(build(load_design("1dof-5mm")))
    }
    assert one == {"P01": (2, 4), "P04": (3, 4), "P07": (4,)}
    three = {
        guide.patterns[0]: tuple(guide.steps) for guide in guides(build(load_design("3dof-15mm")))
    }
    assert three == {"P01": (2, 4), "P04": (4,), "P07": (4,)}
    assert underlay_pdf(build(load_design("1dof-5mm", ["registration.method=ears"])), SHA) is None
    film = 'kind="mask", product="PTFE", thickness=0.05, density=2200, temperature_limit=250'
    named = ["name=a.b_c-d", f"films.ptfe50={{{film}}}", "layup.separator_mask=ptfe50"]
    found = words(document_of(underlay_pdf(build(load_design("1dof-5mm", named)), SHA)))
    for expected in ("a.b_c-d: alignment underlay", "“actual size”", "(TPE): outer edge"):
        assert expected in found
    assert "(PTFE50, dashed): outer edge" in found


def planned(template: str, *changes: str) -> tuple[Laminate, Runs, pypdfium2.PdfDocument]:
    design = load_design(template, changes)
    laminate = build(design)
    runs = design_runs(design, laminate)
    return laminate, runs, document_of(tray_pdf(laminate, runs, SHA, design.order.batch))


@pytest.mark.parametrize(
    ("template", "changes", "pages"),
    [
        ("3dof-15mm", ("order.copies=20", "stack.balloons=5"), 1),
        ("1dof-10mm", ("order.copies=3", "registration.method=ears"), 1),
        ("radial-15mm", ("order.copies=2",), 1),
        ("3dof-15mm", ("stack.balloons=30", "order.copies=2"), 2),
    ],
)
def test_every_part_of_a_laminate_has_its_place_at_full_size(
    template: str, changes: tuple[str, ...], pages: int
) -> None:
    laminate, runs, document = planned(template, *changes)
    each = len(document) // runs.together
    assert len(document) == each * runs.together
    assert each == pages
    labels = []
    areas: list[float] = []
    for page in range(each):
        labels += re.findall(r"(\d+) (P\d+)", words(document, page))
        lines = [line for colour in (FILM, MASK) for line in paths(document, colour, page)]
        shapes = [shapely.Polygon(line) for line in lines]
        areas += [shape.area for shape in shapes]
        whole = shapely.box(0, 0, *size_of(document, page))
        assert all(whole.contains(shape) for shape in shapes)
        # Holes lie in their parts; nothing else lies on anything.
        for one, other in shapely.STRtree(shapes).query(shapes, predicate="intersects").T:
            a, b = shapes[one], shapes[other]
            assert one == other or a.contains(b) or b.contains(a)
        assert lengths(document, page)[-2:] == pytest.approx([100, 100], abs=0.01)
    if template == "3dof-15mm":
        # The paper's order: the bottom balloon, its base below it, the middle, the cap.
        order = [2, 3, 1, *range(4, len(laminate.layers) + 1)]
        assert [int(number) for number, _ in labels] == order
    assert {int(n): p for n, p in labels} == {
        layer.index: layer.pattern for layer in laminate.layers
    }
    assert len(labels) == len(laminate.layers)
    # Curves are followed in chords, which lie within a hundredth of the area.
    expected = sum(abs(c.area) for layer in laminate.layers for c in layer.profile.contours)
    assert sum(areas) == pytest.approx(expected, rel=0.01)
    assert len(areas) == sum(len(x.profile.contours) for x in laminate.layers)


def test_each_place_of_a_cycle_has_its_pages_with_its_serials() -> None:
    _, runs, document = planned("1dof-5mm", "order.copies=20", "order.batch=24")
    assert runs.cycles == (7, 7, 6)
    for page in range(len(document)):
        place = page + 1
        names = [f"24-{c}-{place:02d}" for c in ("ABC" if place < 7 else "AB")]
        assert f"place {place} ({', '.join(names)})" in words(document, page)


def test_paper_that_is_no_plate_ends_on_the_plate() -> None:
    laminate = build(load_design("1dof-5mm"))
    [leaf] = leaves(laminate, ((0.0, 0.0),), (400.0, 400.0))
    assert not leaf.is_plate
    assert shapely.box(*leaf.trim.bounds).within(shapely.box(-200, -200, 200, 200))
    [narrow] = leaves(laminate, ((0.0, 0.0),), (17.0, 170.0))
    x0, _, x1, _ = narrow.trim.bounds
    assert x1 - x0 <= 17.0 + 1e-9


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("template", ["3dof-15mm", "1dof-5mm", "radial-15mm"])
def test_it_lies_in_every_step_that_counts_its_thickness(template: str, method: str) -> None:
    design = load_design(template, [f'registration.method="{method}"'])
    laminate = build(design)
    with_lines = {number for guide in guides(laminate) for number in guide.steps}
    counted = {
        step.step
        for step in schedule(laminate, design).steps
        if any(item.part == "underlay" for item in step.build_up)
    }
    assert counted == with_lines
