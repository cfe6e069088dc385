"""Film sheets in the conventions of other laser programs: colours define the cuts and their order.

RDWorks (Ruida controllers) makes a layer of each colour of a drawing; its file is the oldest DXF,
R12, in which every entity has its colour, and polylines their arcs as bulges. Epilog's software
cuts a line if it is a hairline, 0.001 in wide, and maps red, green and blue to settings; its file
is an SVG in millimetres. Neither file has the sheet's frame, since these programs cut every line.
Both files follow general knowledge of the programs, which have not been run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from sbafab.cutting.beam_paths import BeamRun, LaserRun, check_runs, run_difference
from sbafab.cutting.dxf_read import drawn_entity
from sbafab.cutting.dxf_write import number
from sbafab.cutting.properties import (
    COLOURS,
    CUT_INNER,
    CUT_OUTER,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
    LaserProgram,
)
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.contour import circle
from sbafab.geometry.edges import Arc, Edge, Line, Point
from sbafab.geometry.region import chain_data, coord

RGB = {
    ENGRAVE: "#000000",
    CUT_INNER: "#0000ff",
    CUT_OUTER: "#ff0000",
    CUT_SHEET: "#ff00ff",
    REFERENCE: "#808080",
}
"""Colours of the layers in the order of cutting, pure ones that a driver can map; ENGRAVE is black,
as its DXF colour is on white."""
HAIRLINE = 0.0254
"""mm: 0.001 in."""
UNITLESS, MILLIMETRES = 0, 4
"""Values of $INSUNITS."""
SVG = "{http://www.w3.org/2000/svg}"


# RDWorks: DXF R12.


def _rdworks(runs: Sequence[LaserRun], _size: Point, _title: str) -> str:
    layers = [layer for layer in RGB if any(run.layer == layer for run in runs)]
    table = "".join(
        f"  0\nLAYER\n  2\n{layer}\n 70\n0\n 62\n{COLOURS[layer]}\n  6\nCONTINUOUS\n"
        for layer in layers
    )
    return "".join(
        (
            "  0\nSECTION\n  2\nHEADER\n  9\n$ACADVER\n  1\nAC1009\n  0\nENDSEC\n",
            "  0\nSECTION\n  2\nTABLES\n  0\nTABLE\n  2\nLAYER\n",
            f" 70\n{len(layers)}\n{table}  0\nENDTAB\n  0\nENDSEC\n",
            "  0\nSECTION\n  2\nENTITIES\n",
            *map(_r12_entity, runs),
            "  0\nENDSEC\n  0\nEOF\n",
        )
    )


def _r12_entity(run: LaserRun) -> str:
    head = f"  8\n{run.layer}\n 62\n{COLOURS[run.layer]}\n"
    if run.circle is not None:
        (x, y), radius = run.circle
        return f"  0\nCIRCLE\n{head} 10\n{number(x)}\n 20\n{number(y)}\n 40\n{number(radius)}\n"
    rows = [(*edge.start, edge.bulge) for edge in run.edges]
    if not run.closed:
        rows.append((*run.edges[-1].end, 0.0))
    vertices = "".join(
        f"  0\nVERTEX\n{head} 10\n{number(x)}\n 20\n{number(y)}\n"
        + (f" 42\n{number(bulge)}\n" if bulge else "")
        for x, y, bulge in rows
    )
    return (
        f"  0\nPOLYLINE\n{head} 66\n1\n 10\n0.0\n 20\n0.0\n 70\n{int(run.closed)}\n"
        f"{vertices}  0\nSEQEND\n{head}"
    )


def _read_rdworks(path: Path) -> Iterator[BeamRun]:
    """Yield the runs of a DXF as ezdxf reads it, by the colour of each entity.

    Its polylines may be of a later DXF than was written. It names no unit, which RDWorks takes for
    mm, or mm.
    """
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import BYLAYER, DXFError

    layers = {COLOURS[layer]: layer for layer in RGB}
    try:
        document = readfile(path)
    except DXFError as error:
        raise OutputError(f"it is no sound DXF ({error})") from error
    unit = document.header.get("$INSUNITS", UNITLESS)
    if unit not in (UNITLESS, MILLIMETRES):
        raise OutputError(f"not in millimetres: $INSUNITS is {unit}")
    for entity in document.modelspace():
        colour = entity.dxf.color
        if colour == BYLAYER and entity.dxf.layer in document.layers:
            colour = abs(document.layers.get(entity.dxf.layer).dxf.color)
        layer = layers.get(colour)
        if layer is None:
            raise OutputError(f"a line has the colour {colour}, which no layer has")
        drawn = drawn_entity(entity, may_be_open=True)
        yield BeamRun(layer, drawn.edges if drawn.contour is None else drawn.contour.edges)


# Epilog: SVG with hairlines.


def _epilog(runs: Sequence[LaserRun], size: Point, title: str) -> str:
    return svg_text(runs, size, title, HAIRLINE)


def svg_text(runs: Iterable[LaserRun], size: Point, title: str, stroke: float = 0.1) -> str:
    """Return runs as an SVG on a page of a size in mm: a group for each layer, with true arcs.

    The page's lower left corner is the origin; coordinates have no transforms. The beam follows the
    middle of a line, which is ``stroke`` mm wide.
    """
    by_layer: dict[str, list[LaserRun]] = {layer: [] for layer in RGB}
    for run in runs:
        by_layer[run.layer].append(run)
    across, up = (coord(side) for side in size)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{across}mm" height="{up}mm" '
        f'viewBox="0 0 {across} {up}">',
        f"<title>{escape(title)}</title>",
    ]
    for layer, drawn in by_layer.items():
        if drawn:
            look = f'fill="none" stroke="{RGB[layer]}" stroke-width="{coord(stroke)}"'
            lines += [f'<g id="{layer}" {look}>', *(_svg_shape(run, size[1]) for run in drawn)]
            lines.append("</g>")
    return "\n".join((*lines, "</svg>\n"))


def _svg_shape(run: LaserRun, height: float) -> str:
    if run.circle is not None:
        (x, y), radius = run.circle
        return f'<circle cx="{coord(x)}" cy="{coord(height - y)}" r="{coord(radius)}"/>'
    edges = [_turned_over(edge, height) for edge in run.edges]
    return f'<path d="{chain_data(edges)}{"Z" if run.closed else ""}"/>'


def _turned_over(edge: Edge, height: float) -> Edge:
    """The edge with y downwards, from an upper edge at ``height``."""

    def flip(p: Point) -> Point:
        return p[0], height - p[1]

    if isinstance(edge, Line):
        return Line(flip(edge.start), flip(edge.end))
    return Arc(flip(edge.start), flip(edge.end), flip(edge.centre), edge.radius, not edge.ccw)


class _SvgCurve(NamedTuple):
    """A segment of a path from svgelements, with y upwards."""

    segment: Any
    height: float

    @property
    def start(self) -> Point:
        return self.at(0.0)

    @property
    def end(self) -> Point:
        return self.at(1.0)

    def at(self, t: float) -> Point:
        p = self.segment.point(t)
        return float(p.x), self.height - float(p.y)


def _read_epilog(path: Path) -> Iterator[BeamRun]:
    """Yield the runs of an SVG, its paths read by svgelements, by the colour of their strokes."""
    from svgelements import Close
    from svgelements import Path as SvgPath

    root = ElementTree.parse(path).getroot()
    box = [float(word) for word in root.get("viewBox", "").split()]
    if len(box) != 4 or root.get("width") != f"{coord(box[2])}mm":
        raise OutputError("its page is not in millimetres")
    layers = {colour: layer for layer, colour in RGB.items()}
    for group in root.iter(f"{SVG}g"):
        layer = layers.get(group.get("stroke", ""))
        if layer is None or group.get("stroke-width") != f"{HAIRLINE:g}":
            raise OutputError(f"lines of {group.get('id')} are no hairlines in a colour of a layer")
        for shape in group:
            if shape.tag == f"{SVG}circle":
                x, y, r = (float(shape.get(key, "")) for key in ("cx", "cy", "r"))
                yield BeamRun(layer, circle((x, box[3] - y), r).edges)
                continue
            segments = [*SvgPath(shape.get("d", ""))][1:]
            curves = [
                _SvgCurve(segment, box[3])
                for segment in segments
                # A closing line of length 0 belongs to a path that is already closed.
                if not isinstance(segment, Close)
                or abs(segment.end - segment.start) > TOLERANCE / 10
            ]
            yield BeamRun(layer, curves)


# The table of programs, and what all of them share.


class MachineFile(NamedTuple):
    """The file of a laser program: its name's end after the sheet's name, its writer and reader."""

    ending: str
    text: Callable[[Sequence[LaserRun], Point, str], str]
    read: Callable[[Path], Iterable[BeamRun]]


PROGRAMS: dict[LaserProgram, MachineFile] = {
    "rdworks": MachineFile("_rdworks.dxf", _rdworks, _read_rdworks),
    "epilog": MachineFile("_epilog.svg", _epilog, _read_epilog),
}


def machine_text(program: LaserProgram, runs: Sequence[LaserRun], size: Point, title: str) -> str:
    """Return the file of a film sheet of a size in mm for a laser program, runs in their order."""
    return PROGRAMS[program].text(_cut(runs), size, title)


def _cut(runs: Sequence[LaserRun]) -> list[LaserRun]:
    """The runs without the frame, which these programs would cut."""
    return [run for run in runs if run.layer != REFERENCE]


def read_machine_file(path: Path, program: LaserProgram) -> list[BeamRun]:
    """Return the beam's runs in a machine file, in its order. Raises OutputError."""
    try:
        return [*PROGRAMS[program].read(path)]
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}; regenerate it") from error
    except (OSError, ValueError, LookupError, ArithmeticError, SyntaxError) as error:
        raise OutputError(f"{path.name}: it cannot be read ({error}); regenerate it") from error


def verify_machine_file(path: Path, program: LaserProgram, expected: Sequence[LaserRun]) -> None:
    """Reads the file at ``path`` and compares it with the expected runs. Raises OutputError."""
    check_runs(path, read_machine_file(path, program), _cut(expected))


def rdworks_difference(path: Path, expected: Path) -> str:
    """Return text on an RDWorks file's difference from the expected one; "" if it cuts the same.

    Raises OutputError if the file cannot be read.
    """
    read, runs = (read_machine_file(file, "rdworks") for file in (path, expected))
    wanted = [
        LaserRun(layer, tuple(edge for edge in curves if isinstance(edge, Line | Arc)), False)
        for layer, curves in runs
    ]
    return run_difference(read, wanted)
