"""Film sheets in other programs: GDAL, ezdxf, svgelements and OpenSCAD read every contour;
LibreCAD, Inkscape and Chromium paint them at their size.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import ezdxf
import numpy as np
import pypdfium2
import pytest
import shapely
from ezdxf.addons.drawing import Frontend, RenderContext, layout, svg
from numpy.typing import NDArray
from PIL import Image
from pyogrio import raw
from svgelements import SVG, Move, PathSegment, Shape
from svgelements import Path as SvgPath

from sbafab.cutting.beam_paths import beam_runs
from sbafab.cutting.cut_settings import PLAIN
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Surroundings, drawn
from sbafab.cutting.laser_programs import LaserSheet, laser_text
from sbafab.cutting.sequence import cutting_sequence
from tests.interop.made import BORDER, EXACT, LENGTH, PROFILES, WIDTH, Sheet, outline_bounds
from tests.interop.painting import painted
from tests.shared import CHROMIUM, chromium

pytestmark = pytest.mark.usefixtures("fine_arcs")

BLUE, RED, GREY = "#0000ff", "#ff0000", "#808080"
NANOMETRE = 1e-6
Areas = tuple[list[float], list[float]]


def program(*names: str) -> str:
    """The path of an installed program; the test is skipped without it."""
    found = next(filter(None, map(shutil.which, names)), None)
    return found or pytest.skip(f"no {names[0]} here")


# The contours of an SVG as svgelements reads them, in millimetres.


STEPS = 128
"""Chords a curve of a quarter turn: 3e-5 of a disc's area."""
CLOSED = 1e-3
"""mm between the ends of a closed contour; ezdxf rounds every step to an eighth of that."""


class Drawing(NamedTuple):
    """Size of the page in mm, and the closed contours by the colour of their lines."""

    width: float
    height: float
    contours: dict[str, list[shapely.Polygon]]

    def areas(self, colour: str) -> list[float]:
        """In mm2, least first."""
        return sorted(polygon.area for polygon in self.contours.get(colour, []))


def svg_contours(file: Path) -> Drawing:
    page = SVG.parse(file, ppi=25.4)
    found: dict[str, list[shapely.Polygon]] = {}
    for shape in page.elements():
        if isinstance(shape, Shape):
            colour = shape.stroke.hex if shape.stroke.value is not None else ""
            rings = [_points(subpath) for subpath in SvgPath(shape).as_subpaths()]
            found.setdefault(colour, []).extend(
                shapely.Polygon(ring) for ring in rings if _closes(ring)
            )
    return Drawing(float(page.width), float(page.height), found)


def _points(edges: Iterable[PathSegment]) -> NDArray[np.float64]:
    places = np.linspace(0.0, 1.0, STEPS + 1)
    drawn = [edge for edge in edges if not isinstance(edge, Move) and edge.length() > 0]
    return np.concatenate([np.asarray(edge.npoint(places), dtype=float) for edge in drawn])


def _closes(ring: NDArray[np.float64]) -> bool:
    return len(ring) > 2 * (STEPS + 1) and bool(np.hypot(*(ring[0] - ring[-1])) < CLOSED)


# Programs that read contours.


def lines(path: Path) -> dict[str, list[shapely.LineString]]:
    """What lies on each layer, in the order of the file, as GDAL reads it."""
    _, _, shapes, (names,) = raw.read(path, columns=["Layer"])
    found: dict[str, list[shapely.LineString]] = {}
    for name, shape in zip(names, shapes, strict=True):
        found.setdefault(name, []).append(shapely.from_wkb(shape))
    return found


def rings(edges: list[shapely.LineString]) -> list[shapely.Polygon]:
    """The rings that edges close to, least first; no end is left over."""
    # Ends of neighbours differ in the last digits.
    polygons, *loose = shapely.polygonize_full(shapely.set_precision(edges, NANOMETRE))
    assert [list(left.geoms) for left in loose] == [[], [], []]
    return sorted(polygons.geoms, key=lambda polygon: float(polygon.area))


def by_gdal(path: Path, _folder: Path) -> Areas:
    found = lines(path)
    outers, holes = (rings(found[layer]) for layer in ("CUT_OUTER", "CUT_INNER"))
    return [ring.area for ring in outers], [ring.area for ring in holes]


def by_ezdxf(path: Path, folder: Path) -> Areas:
    document = ezdxf.readfile(path)
    backend = svg.SVGBackend()
    Frontend(RenderContext(document), backend).draw_layout(document.modelspace())
    page = layout.Page(0, 0, layout.Units.mm, layout.Margins.all(0))
    picture = folder / "drawn.svg"
    picture.write_text(backend.get_string(page, settings=layout.Settings(fit_page=False)))
    found = svg_contours(picture)
    assert (found.width, found.height) == pytest.approx((WIDTH, LENGTH), abs=0.001)
    return found.areas(RED), found.areas(BLUE)


def by_openscad(path: Path, folder: Path) -> Areas:
    def layer(name: str) -> list[float]:
        script, exported = folder / "sheet.scad", folder / f"{name}.svg"
        script.write_text(f'$fn=360; import("{path}", layer="{name}");')
        command = [program("openscad"), "-o", str(exported), str(script)]
        subprocess.run(command, capture_output=True, timeout=60, check=True)
        drawing = svg_contours(exported)
        return sorted(polygon.area for found in drawing.contours.values() for polygon in found)

    return layer("CUT_OUTER"), layer("CUT_INNER")


def by_svgelements(path: Path, _folder: Path) -> Areas:
    found = svg_contours(path.with_suffix(".svg"))
    assert found.areas(GREY) == pytest.approx([WIDTH * LENGTH], rel=1e-4)
    low_x, low_y, high_x, high_y = shapely.total_bounds(found.contours[RED])
    upright = (low_x, LENGTH - high_y, high_x, LENGTH - low_y)
    assert upright == pytest.approx(outline_bounds(path), abs=0.001)
    return found.areas(RED), found.areas(BLUE)


@pytest.mark.parametrize(
    ("profile", "read", "exact"),
    [
        *((profile, by_gdal, 1e-5) for profile in PROFILES),
        ("bulges", by_ezdxf, EXACT),
        ("bulges", by_svgelements, 1e-4),
        pytest.param("arcs", by_openscad, EXACT, marks=pytest.mark.long),
    ],
)
def test_every_contour_has_its_area(
    profile: str, read: Callable[[Path, Path], Areas], exact: float, sheet: Sheet, tmp_path: Path
) -> None:
    outers, holes = read(sheet.files[profile], tmp_path)  # type: ignore[index]
    assert outers == pytest.approx(sheet.outers, rel=exact)
    assert holes == pytest.approx(sheet.holes, rel=exact)


@pytest.mark.long
def test_openscad_loses_bulges_without_a_word(sheets: dict[str, Sheet], tmp_path: Path) -> None:
    """That is what the profile of lines and arcs is for."""
    sheet = sheets["3dof-15mm TPE"]
    assert sum(by_openscad(sheet.files["bulges"], tmp_path)[0]) < 0.9 * sum(sheet.outers)


@pytest.mark.parametrize("profile", PROFILES)
def test_layers_come_in_cutting_order_and_parts_lie_inside_the_border(
    profile: str, sheet: Sheet
) -> None:
    found = lines(sheet.files[profile])  # type: ignore[index]
    assert list(found) == ["ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"]
    if profile == "bulges":
        contours = found["CUT_OUTER"] + found["CUT_INNER"]
        assert len(contours) == len(sheet.outers) + len(sheet.holes)
        assert all(contour.is_ring for contour in contours)
    (frame,) = rings(found["REFERENCE"])
    assert frame.bounds == pytest.approx((0.0, 0.0, WIDTH, LENGTH), abs=NANOMETRE)
    parts = shapely.union_all(rings(found["CUT_OUTER"]))
    usable = shapely.box(BORDER, BORDER, WIDTH - BORDER, LENGTH - BORDER)
    assert usable.buffer(NANOMETRE).contains(parts)
    assert all(frame.contains(run) and parts.disjoint(run) for run in found["ENGRAVE"])


# Programs that paint: black, red and blue lines on white. Each gives the picture and dots per mm.


Picture = tuple[Image.Image, float]
PIXELS_PER_MM = 96 / 25.4
"""CSS pixels, as Inkscape and Chromium count."""


def machine_file(sheet: Sheet, laser: str, path: Path) -> Path:
    """The file of a laser program for the same sheet."""
    around = Surroundings(engraved=(((2.0, 2.0), (30.0, 2.0), (30.0, 5.0)),), frame=(WIDTH, LENGTH))
    contours = cutting_sequence(read_profile(sheet.files["bulges"]).region)
    runs = list(drawn(beam_runs(contours, PLAIN, around), around))
    path.write_text(laser_text(laser, LaserSheet(runs, (WIDTH, LENGTH), "sheet")))
    return path


def librecad(drawing: Path, folder: Path) -> Picture:
    """Its print, at the lower left corner of a page of its own choice."""
    shutil.copy(drawing, folder / "print.dxf")
    # Without its scale given, LibreCAD prints next to nothing; the PDF is in the current folder.
    subprocess.run(
        [program("librecad"), "dxf2pdf", "-s", "1", "print.dxf"],
        cwd=folder,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "HOME": str(folder)},
        capture_output=True,
        timeout=60,
        check=True,
    )
    with pypdfium2.PdfDocument(folder / "print.pdf") as document:
        (page,) = document
        width, height = page.get_size()
        crop = (0.0, 0.0, width - WIDTH * 72 / 25.4, height - LENGTH * 72 / 25.4)
        picture: Image.Image = page.render(scale=600 / 72, crop=crop).to_pil().convert("RGB")
    # The frame does not print: the margin is white.
    for strip in ((0, 0, picture.width, 20), (0, 0, 20, picture.height)):
        assert picture.crop(strip).convert("L").getextrema() == (255, 255)
    return picture, 600 / 25.4


def inkscape(*arguments: str) -> str:
    return subprocess.run(
        [program("inkscape"), *arguments], capture_output=True, text=True, timeout=60, check=True
    ).stdout


def exported(drawing: Path, dots: int, folder: Path, *options: str) -> Picture:
    picture = folder / "picture.png"
    look = ("--export-type=png", f"--export-dpi={dots}", "--export-background=white")
    inkscape(*look, *options, f"--export-filename={picture}", str(drawing))
    with Image.open(picture) as opened:
        return opened.convert("RGB"), dots / 25.4


def inkscape_dxf(drawing: Path, folder: Path) -> Picture:
    """What Inkscape's own importer makes of a DXF file: its dialogue needs a screen."""
    extensions = Path(inkscape("--system-data-directory").strip()) / "extensions"
    command = ["/usr/bin/python3", str(extensions / "dxf_input.py"), "--scalemethod=file"]
    done = subprocess.run(
        [*command, str(drawing)], capture_output=True, text=True, timeout=60, check=False
    )
    if "ModuleNotFoundError" in done.stderr:
        pytest.skip("Inkscape's importer wants python3-lxml, python3-numpy and python3-cssselect")
    assert done.returncode == 0, done.stderr
    for name in ("ENGRAVE", "CUT_INNER", "CUT_OUTER", "REFERENCE"):
        assert f'inkscape:label="{name}"' in done.stdout
    imported = folder / "imported.svg"
    imported.write_text(done.stdout, encoding="utf-8")
    # The importer puts the origin at the lower left corner of an A4 page.
    corner = (0.0, 297.0 - LENGTH, WIDTH, 297.0)
    area = ":".join(str(place * PIXELS_PER_MM) for place in corner)
    return exported(imported, 300, folder, f"--export-area={area}")


def inkscape_svg(drawing: Path, folder: Path) -> Picture:
    picture, dots = exported(drawing.with_suffix(".svg"), 600, folder)
    assert picture.size == pytest.approx((WIDTH * dots, LENGTH * dots), abs=1.0)
    return picture, dots


def shown(page: Path, folder: Path, finer: int = 4) -> Picture:
    """What Chromium shows of a page, cut to the size of the sheet."""
    if CHROMIUM is None:
        pytest.skip("no chromium here")
    dots, shot = finer * PIXELS_PER_MM, folder / "shot.png"
    window = f"{math.ceil(WIDTH * PIXELS_PER_MM)},{math.ceil(LENGTH * PIXELS_PER_MM)}"
    look = ("--hide-scrollbars", f"--force-device-scale-factor={finer}", f"--screenshot={shot}")
    chromium(folder, page, f"--window-size={window}", *look)
    with Image.open(shot) as opened:
        size = (0, 0, round(WIDTH * dots), round(LENGTH * dots))
        return opened.convert("RGB").crop(size), dots


def chromium_svg(drawing: Path, folder: Path) -> Picture:
    return shown(drawing.with_suffix(".svg"), folder)


@pytest.mark.long
@pytest.mark.parametrize(
    ("paint", "laser", "exact"),
    [
        (librecad, None, EXACT),
        (librecad, "rdworks", EXACT),
        (inkscape_dxf, None, EXACT),
        (inkscape_svg, None, EXACT),
        (chromium_svg, None, None),
    ],
)
def test_painted_sheets_have_the_area_the_contours_and_the_place(
    paint: Callable[[Path, Path], Picture],
    laser: str | None,
    exact: float | None,
    sheet: Sheet,
    tmp_path: Path,
) -> None:
    file = sheet.files["bulges"]
    if laser is not None:
        file = machine_file(sheet, laser, tmp_path / "machine.dxf")
    found = painted(*paint(file, tmp_path))
    if exact is not None:
        assert found.film == pytest.approx(sheet.film, rel=exact)
    assert (found.pieces, found.holes) == (len(sheet.outers), len(sheet.holes))
    assert found.bounds == pytest.approx(outline_bounds(sheet.files["bulges"]), abs=0.2)


# Holes over outlines: red where there is film, black in the holes, white beside.
FILLED = """<style>
body { margin: 0 } svg { display: block } g { display: none }
#CUT_OUTER, #CUT_INNER { display: inline; stroke: none; mix-blend-mode: multiply }
#CUT_OUTER { fill: #f00 } #CUT_INNER { fill: #00f }
</style>"""


@pytest.mark.long
def test_what_lines_enclose_in_chromium_has_the_area(sheet: Sheet, tmp_path: Path) -> None:
    page = tmp_path / "filled.html"
    page.write_text(FILLED + sheet.picture.read_text(encoding="utf-8"), encoding="utf-8")
    picture, dots = shown(page, tmp_path, 8)
    red, green, _ = (int(np.asarray(channel).sum(dtype=np.int64)) for channel in picture.split())
    assert (red - green) / 255 / dots**2 == pytest.approx(sheet.film, rel=EXACT)


@pytest.mark.long
def test_inkscape_finds_epilog_s_outlines_where_the_cut_file_has_them(
    sheet: Sheet, tmp_path: Path
) -> None:
    rows = inkscape("--query-all", str(machine_file(sheet, "epilog", tmp_path / "epilog.svg")))
    boxes = {name: values for name, *values in (row.split(",") for row in rows.splitlines())}
    x, y, width, height = (float(value) / PIXELS_PER_MM for value in boxes["CUT_OUTER"])
    edge = 0.0127  # Inkscape counts half a hairline on every side.
    found = x + edge, LENGTH - y - height + edge, x + width - edge, LENGTH - y - edge
    assert found == pytest.approx(outline_bounds(sheet.files["bulges"]), abs=0.01)
