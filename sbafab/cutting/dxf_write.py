"""Cut files: ASCII DXF R2010 with true arcs, written into the packaged empty document."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from sbafab.cutting.cut_settings import (
    COLOURS,
    CUT_INNER,
    CUT_OUTER,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
    SEAM,
    SEAM_COLOUR,
    DxfProfile,
)
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import EPSILON, Arc, Bounds, Edge, Line, Point, quarter_arcs

QUARTER = math.sqrt(2)
"""The chord of a quarter turn, in radii."""
DATUM_ARM = 1.0
"""Half the length in mm of the datum cross at the origin."""


class Surroundings(NamedTuple):
    """The drawing of a film sheet besides its parts: open runs of points, and the far corner of its
    frame.
    """

    engraved: Sequence[Sequence[Point]] = ()
    parting: Sequence[Sequence[Point]] = ()
    frame: Point | None = None

    @property
    def frames(self) -> tuple[Sequence[Point], ...]:
        """The frame as one closed run of points; empty without a frame."""
        if self.frame is None:
            return ()
        x, y = self.frame
        return (((0.0, 0.0), (x, 0.0), (x, y), (0.0, y), (0.0, 0.0)),)


class LaserRun(NamedTuple):
    """Consecutive edges on a layer; whether they close, and whether they form a circle."""

    layer: str
    edges: tuple[Edge, ...]
    closed: bool
    circle: tuple[Point, float] | None = None


def drawn(cuts: Iterable[LaserRun], sheet: Surroundings) -> Iterator[LaserRun]:
    """Yield the content of a sheet in cutting order; the frame, which is not cut, comes last."""
    for run in sheet.engraved:
        yield stroke_run(ENGRAVE, run)
    yield from cuts
    for run in sheet.parting:
        yield stroke_run(CUT_SHEET, run)
    for run in sheet.frames:
        yield stroke_run(REFERENCE, run)


def stroke_run(layer: str, run: Sequence[Point]) -> LaserRun:
    """Return a run of straight lines; it is closed if it ends where it began."""
    edges = tuple(map(Line, run[:-1], run[1:]))
    return LaserRun(layer, edges, run[0] == run[-1])


def contour_runs(contours: Iterable[Contour]) -> Iterator[LaserRun]:
    """Yield contours unchanged, on the layer of holes or outlines."""
    for contour in contours:
        yield LaserRun(layer_of(contour), contour.edges, True, contour.circle)


def layer_of(contour: Contour) -> str:
    return CUT_INNER if contour.is_hole else CUT_OUTER


_Entity = tuple[str, str, str, str]
"""One DXF entity: its type, layer, subclass marker and group codes."""


def dxf_text(
    contours: Sequence[Contour],
    properties: Mapping[str, str],
    profile: DxfProfile = "bulges",
    sheet: Surroundings | None = None,
    notes: Sequence[Sequence[Point]] = (),
) -> str:
    """A DXF document of the contours, cut in the order given.

    Holes (clockwise) go on CUT_INNER, outlines on CUT_OUTER. ``properties`` become the document's
    custom properties. The chords profile accepts only contours of lines. A layer's file has a cross
    at the origin on REFERENCE, after all cuts, and on the same layer the strokes of its ``notes``;
    a ``sheet`` has its engraving, parting cut and frame instead.
    """
    cuts = contour_runs(contours)
    if sheet is None:
        entities = [
            *_entities(cuts, profile),
            *_datum_cross(),
            *_entities((stroke_run(REFERENCE, run) for run in notes), profile),
        ]
        low, high = (-DATUM_ARM, -DATUM_ARM), (DATUM_ARM, DATUM_ARM)
    else:
        entities = list(_entities(drawn(cuts, sheet), profile))
        low, high = (0.0, 0.0), sheet.frame or (0.0, 0.0)
    return document_text(
        entities, [*(contour.bounds for contour in contours), (*low, *high)], properties
    )


def seam_text(path: Sequence[Sequence[Edge]], properties: Mapping[str, str]) -> str:
    """A DXF document of the path of a seam: its chains on SEAM, open or closed, in order."""
    runs = [
        LaserRun(SEAM, tuple(chain), math.dist(chain[0].start, chain[-1].end) < EPSILON)
        for chain in path
    ]
    arm = (-DATUM_ARM, -DATUM_ARM, DATUM_ARM, DATUM_ARM)
    boxes = [part.bounds for run in runs for edge in run.edges for part in _quarters(edge)]
    entities = [*_entities(runs), *_datum_cross()]
    return document_text(entities, [*boxes, arm], properties, has_seam=True)


def document_text(
    entities: Sequence[_Entity],
    boxes: Sequence[Bounds],
    properties: Mapping[str, str],
    has_seam: bool = False,
) -> str:
    """Return the packaged empty document with the entities, extents and custom properties."""
    space, first, (head, to_extents, to_seed, tables, end) = _shell()
    drawn = "".join(
        f"  0\n{kind}\n  5\n{handle:X}\n330\n{space}\n100\nAcDbEntity\n"
        f"  8\n{layer}\n100\n{subclass}\n{body}"
        for handle, (kind, layer, subclass, body) in enumerate(entities, first)
    )
    free = first + len(entities)
    if has_seam:
        tables, free = _with_seam_layer(tables, free), free + 1
    custom = "".join(
        f"  9\n$CUSTOMPROPERTYTAG\n  1\n{_one_line(name)}\n"
        f"  9\n$CUSTOMPROPERTY\n  1\n{_one_line(value)}\n"
        for name, value in properties.items()
    )
    filled = custom, to_extents, _extents(boxes), to_seed
    return "".join((head, *filled, f"{free:X}", tables, drawn, end))


def _with_seam_layer(text: str, handle: int) -> str:
    """Return a document with the layer SEAM, a copy of the engraving layer before it."""
    engraving = re.search(
        rf"  0\nLAYER\n  5\n\w+\n(?:(?!  0\n).*\n)*?  2\n{ENGRAVE}\n(?:(?!  0\n).*\n)*", text
    )
    if engraving is None:
        raise ValueError("skeleton.dxf has no layer for engraving: regenerate it.")
    record = re.sub(r"(?<=LAYER\n  5\n)\w+", f"{handle:X}", engraving[0])
    record = record.replace(f"  2\n{ENGRAVE}\n", f"  2\n{SEAM}\n")
    record = record.replace(f" 62\n{COLOURS[ENGRAVE]}\n", f" 62\n{SEAM_COLOUR}\n")
    return text[: engraving.end()] + record + text[engraving.end() :]


def _entities(runs: Iterable[LaserRun], profile: DxfProfile = "bulges") -> Iterator[_Entity]:
    for run in runs:
        edges = [part for edge in run.edges for part in _quarters(edge)]
        if run.circle is not None:
            yield "CIRCLE", run.layer, "AcDbCircle", _round(*run.circle)
        elif profile == "chords" and any(isinstance(edge, Arc) for edge in edges):
            raise ValueError("an arc remains; convert the contours to chords")
        elif profile == "arcs" and run.layer in (CUT_INNER, CUT_OUTER):
            yield from (_edge_entity(run.layer, edge) for edge in edges)
        else:
            yield _polyline(run.layer, edges, run.closed)


def _quarters(edge: Edge) -> Sequence[Edge]:
    """Return the edge as arcs of at most a quarter turn."""
    if not isinstance(edge, Arc) or math.dist(edge.start, edge.end) <= QUARTER * edge.radius:
        return [edge]
    return quarter_arcs(edge.start, edge.end, edge.centre, edge.radius, edge.sweep)


def _polyline(layer: str, edges: Sequence[Edge], closed: bool) -> _Entity:
    vertices = [(*edge.start, edge.bulge) for edge in edges]
    if not closed:
        vertices.append((*edges[-1].end, 0.0))
    rows = [f" 90\n{len(vertices)}\n 70\n{int(closed)}\n"]
    for x, y, bulge in vertices:
        rows.append(f" 10\n{number(x)}\n 20\n{number(y)}\n")
        if bulge:
            rows.append(f" 42\n{number(bulge)}\n")
    return "LWPOLYLINE", layer, "AcDbPolyline", "".join(rows)


def _edge_entity(layer: str, edge: Edge) -> _Entity:
    if isinstance(edge, Line):
        return _line(layer, edge.start, edge.end)
    first, last = (edge.start, edge.end) if edge.ccw else (edge.end, edge.start)
    span = (
        f"100\nAcDbArc\n 50\n{number(_degrees(edge.centre, first))}\n"
        f" 51\n{number(_degrees(edge.centre, last))}\n"
    )
    return "ARC", layer, "AcDbCircle", _round(edge.centre, edge.radius) + span


def _line(layer: str, start: Point, end: Point) -> _Entity:
    body = (
        f" 10\n{number(start[0])}\n 20\n{number(start[1])}\n 30\n0.0\n"
        f" 11\n{number(end[0])}\n 21\n{number(end[1])}\n 31\n0.0\n"
    )
    return "LINE", layer, "AcDbLine", body


def _round(centre: Point, radius: float) -> str:
    x, y = centre
    return f" 10\n{number(x)}\n 20\n{number(y)}\n 30\n0.0\n 40\n{number(radius)}\n"


def _degrees(centre: Point, p: Point) -> float:
    return math.degrees(math.atan2(p[1] - centre[1], p[0] - centre[0])) % 360.0


def _datum_cross() -> tuple[_Entity, _Entity]:
    return (
        _line(REFERENCE, (-DATUM_ARM, 0.0), (DATUM_ARM, 0.0)),
        _line(REFERENCE, (0.0, -DATUM_ARM), (0.0, DATUM_ARM)),
    )


def number(value: float) -> str:
    """Return a decimal to a picometre, without exponent or negative zero."""
    text = f"{value:.9f}".rstrip("0")
    if text.endswith("."):
        text += "0"
    return "0.0" if text == "-0.0" else text


def _one_line(text: str) -> str:
    """Return a value on one line, since a line break would shift every subsequent group code."""
    return " ".join(text.split())


def _extents(boxes: Sequence[Bounds]) -> str:
    low = f" 10\n{number(min(b[0] for b in boxes))}\n 20\n{number(min(b[1] for b in boxes))}\n"
    high = f" 10\n{number(max(b[2] for b in boxes))}\n 20\n{number(max(b[3] for b in boxes))}\n"
    return (
        f"  9\n$EXTMIN\n{low} 30\n0.0\n  9\n$EXTMAX\n{high} 30\n0.0\n"
        f"  9\n$LIMMIN\n{low}  9\n$LIMMAX\n{high}"
    )


# The empty DXF document that every cut file is filled into.
#
# ``python -m sbafab.cutting.dxf_write`` regenerates it with ezdxf. Keeping it as a file means that
# writing a cut file takes no time but for its entities.


SKELETON = Path(__file__).with_name("skeleton.dxf")


@cache
def _shell() -> tuple[str, int, tuple[str, ...]]:
    """Return the owner and first handle of entities, and the packaged empty document in parts.

    Custom properties, extents, the next free handle and the entities go between the parts.
    """
    text = SKELETON.read_text(encoding="utf-8")
    space = re.search(r"\nBLOCK_RECORD\n  5\n(\w+)\n(?:(?!  0\n).*\n)*?\*Model_Space\n", text)
    parts = re.fullmatch(
        r"(.*)(  9\n\$INSBASE\n.*)  9\n\$EXTMIN\n.*(  9\n\$ORTHOMODE\n.*\$HANDSEED\n  5\n)"
        r"(\w+)(\n.*  2\nENTITIES\n)(.*)",
        text,
        re.DOTALL,
    )
    if space is None or parts is None:
        raise ValueError("skeleton.dxf has no model space: regenerate it.")
    return space[1], int(parts[4], 16), (*parts.groups()[:3], *parts.groups()[4:])


def skeleton_text() -> str:
    """Return an empty R2010 document in millimetres with the cut layers and fixed metadata."""
    from ezdxf import options  # type: ignore[attr-defined]
    from ezdxf.filemanagement import new

    # The switch holds for the whole process, so it goes back to what it was.
    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        document = new("R2010", units=4)
        document.header["$MEASUREMENT"] = 1
        for name, colour in COLOURS.items():
            document.layers.add(name, color=colour, plot=name != REFERENCE)
        # ezdxf adds classes in the order of a set; those that are there it leaves in place.
        document.classes.add_required_classes(document.dxfversion)
        document.classes.classes = dict(sorted(document.classes.classes.items()))
        stream = StringIO()
        document.write(stream)
    finally:
        options.write_fixed_meta_data_for_testing = before
    return stream.getvalue()


if __name__ == "__main__":
    SKELETON.write_text(skeleton_text(), encoding="utf-8", newline="\n")
