"""The second cut of registered sheets: slots that sever the bridges, laid by the fiducials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from sbafab.cutting.dxf_write import DATUM_ARM, Surroundings, dxf_text
from sbafab.cutting.kerf import compensate
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, second_cut_properties
from sbafab.cutting.verify import check_surroundings, verify_file
from sbafab.errors import OutputError
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import Kerf, widths
from sbafab.geometry.region import Region, rectangle
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate, SheetPanel

PATH = "sheets/second_cut.dxf"
ROOM = 10.0


def second_path(panel: SheetPanel, kerf: Kerf) -> Region:
    """The beam's path inside the slots, so that what stays keeps its size."""
    x0, y0, x1, y1 = panel.second.bounds
    around = rectangle((x0 - ROOM, y0 - ROOM), (x1 + ROOM, y1 + ROOM))
    slots = [contour.reversed() for contour in panel.second.contours]
    path = compensate(Region((*around.contours, *slots)), kerf)
    return Region(tuple(hole.reversed() for hole in path.holes))


def marks(panel: SheetPanel) -> Surroundings:
    """Return the reference drawing: the sheet's edge, its datum and a cross in every fiducial."""
    outline = [edge.start for edge in panel.outline.edges]
    crosses = [run for p in ((0.0, 0.0), *panel.fiducials) for run in _cross(p)]
    return Surroundings(marks=((*outline, outline[0]), *crosses))


def severed(laminate: Laminate) -> tuple[Material, ...]:
    """The films whose bridges the second cut goes through, lowest first."""
    return tuple(dict.fromkeys(layer.film.material for layer in laminate.tpe_layers))


def stack_kerf(kerfs: Mapping[Material, Kerf | None], films: Sequence[Material]) -> Kerf | None:
    """The kerf of one beam through all of the films: the widest of theirs along x and along y.

    None where that of any was not measured. A beam that is narrower leaves the parts a little
    larger at their bridges; one that is wider would take of them.
    """
    measured = [kerf for kerf in map(kerfs.get, films) if kerf is not None]
    if len(measured) < len(films):
        return None
    x, y = (max(widths(kerf)[axis] for kerf in measured) for axis in (0, 1))
    return x if x == y else (x, y)


def laser_path(laminate: Laminate, settings: CutSettings) -> Region:
    """The beam's path in the second cut of a laminate in registered sheets."""
    assert laminate.panel is not None
    kerf = stack_kerf(settings.kerf_widths, severed(laminate))
    return second_path(laminate.panel, kerf or 0.0)


def properties_of(laminate: Laminate, settings: CutSettings) -> dict[str, str]:
    """Custom properties of the second cut's file: it goes through masks as well."""
    films = severed(laminate)
    masks = dict.fromkeys(layer.film.material for layer in laminate.layers if layer.is_mask)
    kerf = stack_kerf(settings.kerf_widths, films)
    return second_cut_properties(settings, films, tuple(masks), kerf)


def write_second_cut(laminate: Laminate, folder: Path, settings: CutSettings) -> str:
    """Writes and reads back the file; its path in ``folder``. Raises OutputError, OSError."""
    assert laminate.panel is not None
    properties = properties_of(laminate, settings)
    path = laser_path(laminate, settings)
    around = marks(laminate.panel)
    text = dxf_text(cutting_order(path), properties, settings.curves.profile, around)
    target = folder / PATH
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(text.encode())
    read = verify_file(target, path, properties)
    try:
        check_surroundings(read, around)
    except OutputError as error:
        raise OutputError(f"{target.name}: {error}") from error
    return PATH


def _cross(p: Point) -> tuple[tuple[Point, Point], tuple[Point, Point]]:
    (x, y), arm = p, DATUM_ARM
    return ((x - arm, y), (x + arm, y)), ((x, y - arm), (x, y + arm))
