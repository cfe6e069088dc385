"""The film sheet as a LightBurn project: its cuts in order, and no power that anybody guessed.

The format (``.lbrn2``) is not documented; what is written here is what files that LightBurn saved
hold, and no more. It knows lines, cubic Bezier curves and ellipses, so an arc becomes Bezier curves
of at most 45 degrees, which leave it by 4e-6 of its radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sbafab.cutting.cut_layers import CUT_INNER, CUT_OUTER, CUT_SHEET, ENGRAVE, REFERENCE
from sbafab.cutting.dxf_write import Surroundings
from sbafab.geometry.copies import Copies
from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.region import Contour
from sbafab.geometry.svg import number
from sbafab.markup import quoteattr

ENDING = ".lbrn2"
INDICES = {ENGRAVE: 0, CUT_INNER: 1, CUT_OUTER: 2, CUT_SHEET: 7, REFERENCE: 8}
"""LightBurn's colours: black, blue, red, magenta, grey, as in the sheet's picture."""
CUT_MODE = "Cut"
"""What LightBurn calls Line: the beam follows the line."""
MOST_TURN = math.radians(45)
POWERS = ("minPower", "maxPower", "minPower2", "maxPower2")
ORDER = {"Optimize_ByLayer": 0, "Optimize_ByGroup": -1, "Optimize_ByPriority": 1}
"""Layers in their order, then shapes in the order of the file."""
NOT_OPTIMIZED = (
    "WhichDirection",
    "InnerToOuter",
    "ByDirection",
    "ReduceTravel",
    "HideBacklash",
    "ReduceDirChanges",
    "ChooseCorners",
    "AllowReverse",
    "RemoveOverlaps",
    "OptimalEntryPoint",
)
ADVICE = (
    "Powers are 0: set power and speed of each layer for this film. Leave kerf offset 0 and the "
    "frame (REFERENCE) without output. The engraved label must read from left to right"
)


class LaserRun(NamedTuple):
    """Edges one after the other on a layer, whether they close, and whether they are a circle."""

    layer: str
    edges: tuple[Edge, ...]
    closed: bool
    circle: tuple[Point, float] | None = None


def drawn(contours: Sequence[Contour], sheet: Surroundings) -> Iterator[LaserRun]:
    """What a sheet holds, in cutting order; the frame, which is not cut, comes last."""
    for run in sheet.engraved:
        yield _run(ENGRAVE, run)
    for contour in contours:
        layer = CUT_INNER if contour.is_hole else CUT_OUTER
        yield LaserRun(layer, contour.edges, True, contour.circle)
    for run in sheet.parting:
        yield _run(CUT_SHEET, run)
    for run in sheet.marks:
        yield _run(REFERENCE, run)
    if sheet.frame is not None:
        x, y = sheet.frame
        yield _run(REFERENCE, ((0.0, 0.0), (x, 0.0), (x, y), (0.0, y), (0.0, 0.0)))


def _run(layer: str, run: Sequence[Point]) -> LaserRun:
    edges = tuple(map(Line, run[:-1], run[1:]))
    return LaserRun(layer, edges, run[0] == run[-1])


def parts_of(edge: Edge) -> Sequence[Edge]:
    """The edge, or the pieces of an arc that become a curve each."""
    if isinstance(edge, Line):
        return (edge,)
    count = max(1, math.ceil(abs(edge.sweep) / MOST_TURN - 1e-9))
    stops = [edge.start, *(edge.at(k / count) for k in range(1, count)), edge.end]
    return [edge.part(*stops[k : k + 2]) for k in range(count)]


def project_text(
    contours: Sequence[Contour],
    sheet: Surroundings,
    properties: Mapping[str, str],
    advice: str = ADVICE,
) -> str:
    """The project of a film sheet; ``properties`` are those of its cut file, for its notes.

    Contours are cut in the order given, holes before outlines. Lower left corner at the origin,
    y upwards, mm.
    """
    shapes, outlines = list(drawn(contours, sheet)), _Outlines()
    layers = [layer for layer in INDICES if any(shape.layer == layer for shape in shapes)]
    prefs = {**ORDER, **{f"Optimize_{name}": 0 for name in NOT_OPTIMIZED}}
    notes = "\n".join((advice, *(f"{name}: {value}" for name, value in properties.items())))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<LightBurnProject AppVersion="1.0.00" FormatVersion="1" MaterialHeight="0" '
        'MirrorX="False" MirrorY="False">',
        "<UIPrefs>",
        *(f'<{name} Value="{value}"/>' for name, value in prefs.items()),
        "</UIPrefs>",
        *(_setting(layer, rank) for rank, layer in enumerate(layers)),
        *(_shape(serial, shape, outlines) for serial, shape in enumerate(shapes)),
        f'<Notes ShowOnLoad="1" Notes={quoteattr(notes)}/>',
        "</LightBurnProject>\n",
    ]
    return "\n".join(lines)


def _setting(layer: str, rank: int) -> str:
    """A layer's settings: a power of 0 fires nothing, where one left out is the reader's guess."""
    says = "not cut" if layer == REFERENCE else "set power and speed"
    values = {
        "index": INDICES[layer],
        "name": f"{layer}: {says}",
        **dict.fromkeys(POWERS, 0),
        "kerf": 0,
        "priority": rank,
        "doOutput": int(layer != REFERENCE),
    }
    inner = "".join(f'<{name} Value="{value}"/>' for name, value in values.items())
    return f'<CutSetting type="{CUT_MODE}">{inner}</CutSetting>'


def _shape(serial: int, run: LaserRun, outlines: _Outlines) -> str:
    index = INDICES[run.layer]
    if run.circle is not None:
        (x, y), radius = run.circle
        size = f'Rx="{number(radius)}" Ry="{number(radius)}"'
        place = f"<XForm>1 0 0 1 {number(x)} {number(y)}</XForm>"
        return f'<Shape Type="Ellipse" CutIndex="{index}" {size}>{place}</Shape>'
    vertices, primitives = outlines.drawn(run)
    x, y = run.edges[0].start
    return (
        f'<Shape Type="Path" CutIndex="{index}" VertID="{serial}" PrimID="{serial}">'
        f"<XForm>1 0 0 1 {number(x)} {number(y)}</XForm><VertList>{vertices}</VertList>"
        f"<PrimList>{primitives}</PrimList></Shape>"
    )


class _Outlines:
    """The paths of a sheet, each shape written once: vertices from its first, and primitives."""

    def __init__(self) -> None:
        self._copies = Copies()
        self._known: dict[int, tuple[str, str]] = {}

    def drawn(self, run: LaserRun) -> tuple[str, str]:
        """Vertices and primitives of a run."""
        if not run.closed:
            return _outline(Contour(run.edges), False)
        first = self._copies.first(Contour(run.edges))
        if id(first) not in self._known:
            self._known[id(first)] = _outline(first, True)
        return self._known[id(first)]


def _outline(contour: Contour, closed: bool) -> tuple[str, str]:
    parts = [part for edge in contour.edges for part in parts_of(edge)]
    count = len(parts) + (not closed)
    leaving = [_handles(part) for part in parts]
    x, y = contour.edges[0].start
    vertices = []
    for k in range(count):
        u, v = parts[k].start if k < len(parts) else parts[-1].end
        vertices.append(f"V{number(u - x)} {number(v - y)}")
        handles = (
            ("c0", leaving[k][0] if k < len(parts) else None),
            ("c1", leaving[k - 1][1] if closed or k else None),
        )
        for name, place in handles:
            # A control point that is not there is said by a 1.
            vertices.append(
                f"{name}x{number(place[0] - x)}{name}y{number(place[1] - y)}"
                if place is not None
                else f"{name}x1"
            )
    primitives = "".join(
        f"{'L' if isinstance(part, Line) else 'B'}{k} {(k + 1) % count}"
        for k, part in enumerate(parts)
    )
    return "".join(vertices), primitives


def _handles(part: Edge) -> tuple[Point, Point] | tuple[None, None]:
    """The two inner control points of the curve that stands for a short arc."""
    if not isinstance(part, Arc):
        return None, None
    reach = 4 / 3 * math.tan(abs(part.sweep) / 4) * part.radius
    (x, y), (u, v) = part.start, part.end
    (px, py), (qx, qy) = part.direction(part.start), part.direction(part.end)
    return (x + reach * px, y + reach * py), (u - reach * qx, v - reach * qy)
