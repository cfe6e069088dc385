"""Pages of lines, curves and words as PDF, in millimetres and to scale.

PDF 1.4 without compression, dates or fonts of its own: the same pages give the same bytes with
every version of every library. Arcs become Bezier curves that leave them by 5e-6 of their radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sbafab.geometry.edges import Arc, Edge, Point
from sbafab.geometry.region import Contour
from sbafab.geometry.svg import number

POINTS = 72 / 25.4
"""Of a millimetre."""
MOST_SWEEP = math.pi / 4
ENCODING = "cp1252"
"""Of the fonts that every reader has."""
Rgb = tuple[float, float, float]
BLACK: Rgb = (0.0, 0.0, 0.0)


class PdfPage:
    """A page, its lower left corner at (0, 0); what is drawn later covers what was earlier."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self._drawn: list[str] = [f"{POINTS:.10f} 0 0 {POINTS:.10f} 0 0 cm 1 J 1 j"]

    def stroke(self, colour: Rgb, width: float, dashes: Iterable[float] = ()) -> None:
        """What the lines that follow look like; widths and dashes are mm."""
        shades = " ".join(map(number, colour))
        on = " ".join(map(number, dashes))
        self._drawn.append(f"{shades} RG {number(width)} w [{on}] 0 d")

    def contour(self, contour: Contour) -> None:
        """A closed line of straight edges and arcs."""
        path = [f"{_at(contour.edges[0].start)} m", *map(_drawn, contour.edges), "h S"]
        self._drawn.append(" ".join(path))

    def line(self, start: Point, end: Point) -> None:
        self._drawn.append(f"{_at(start)} m {_at(end)} l S")

    def text(self, at: Point, words: str, size: float, bold: bool = False) -> None:
        """Words that begin at a point, ``size`` mm; what Windows-1252 does not hold becomes "?"."""
        font = "F2" if bold else "F1"
        self._drawn.append(f"BT /{font} {number(size)} Tf {_at(at)} Td {_string(words)} Tj ET")

    def objects(self, number: int) -> tuple[bytes, bytes]:
        """The page and what is drawn on it, as objects of a file; the latter has this number."""
        content = "\n".join(self._drawn).encode(ENCODING, "replace")
        box = f"[0 0 {self.width * POINTS:.4f} {self.height * POINTS:.4f}]"
        return (
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {number} 0 R /Resources "
            "<< /Font << /F1 3 0 R /F2 4 0 R >> >> >>".encode(),
            b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
        )


def pdf(pages: Sequence[PdfPage], title: str) -> bytes:
    """The whole file; a printer that obeys it prints at actual size."""
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /%s /Encoding /WinAnsiEncoding >>"
    own = [page.objects(6 + 2 * place) for place, page in enumerate(pages)]
    kids = " ".join(f"{5 + 2 * place} 0 R" for place in range(len(pages)))
    return _file(
        [
            b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
            (font % "Helvetica").encode(),
            (font % "Helvetica-Bold").encode(),
            *(part for pair in own for part in pair),
            f"<< /Title {_string(title)} >>".encode(ENCODING, "replace"),
        ]
    )


def _file(objects: Iterable[bytes]) -> bytes:
    """Numbered objects with the table of where each begins; the last one is the file's title."""
    data = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    places = []
    for index, body in enumerate(objects, 1):
        places.append(len(data))
        data += b"%d 0 obj\n%s\nendobj\n" % (index, body)
    start, count = len(data), len(places) + 1
    data += b"xref\n0 %d\n0000000000 65535 f \n" % count
    data += b"".join(b"%010d 00000 n \n" % place for place in places)
    data += b"trailer\n<< /Size %d /Root 1 0 R /Info %d 0 R >>\n" % (count, count - 1)
    data += b"startxref\n%d\n%%%%EOF\n" % start
    return bytes(data)


def _string(words: str) -> str:
    for mark in "\\()":
        words = words.replace(mark, f"\\{mark}")
    return f"({words})"


def _at(p: Point) -> str:
    return f"{number(p[0])} {number(p[1])}"


def _drawn(edge: Edge) -> str:
    if not isinstance(edge, Arc):
        return f"{_at(edge.end)} l"
    parts = max(1, math.ceil(abs(edge.sweep) / MOST_SWEEP - 1e-9))
    step = edge.sweep / parts
    # Handles of this length put the curve's middle on the arc.
    handle = 4 / 3 * math.tan(step / 4) * edge.radius
    curves = []
    for part in range(parts):
        first, last = (edge.start_angle + step * n for n in (part, part + 1))
        (x0, y0), (x1, y1) = (_round(edge, angle) for angle in (first, last))
        leave = x0 - handle * math.sin(first), y0 + handle * math.cos(first)
        arrive = x1 + handle * math.sin(last), y1 - handle * math.cos(last)
        curves.append(f"{_at(leave)} {_at(arrive)} {_at((x1, y1))} c")
    return " ".join(curves)


def _round(edge: Arc, angle: float) -> Point:
    return (
        edge.centre[0] + edge.radius * math.cos(angle),
        edge.centre[1] + edge.radius * math.sin(angle),
    )
