"""Inspect a picture of a cut sheet against its cut file.

The sheet is located, its edges are measured and its pieces identified; the result is written as
JSON, as a table of sizes for ``sbafab kerf``, and as a picture with the deviations.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.geometry.region import coord
from sbafab.lab.coupon import COLUMNS, INSTRUMENT, Value, student_t
from sbafab.lab.edges import EdgeFit, Scale, fitted, scale_of
from sbafab.lab.pieces import PieceFinding, piece_findings
from sbafab.lab.registration import SMALLEST, Content, locate
from sbafab.lab.scan import Scan, ScanPicture
from sbafab.reports.drawing import TEXT, box, document, line, text
from sbafab.spreadsheet import csv_text

FEWEST = 100  # least number of samples for a kerf
FINEST = 0.02  # standard uncertainty of an edge from grey levels and their rounding, in pixels
LARGEST_KERF = 1.0  # shown in mm
HARMLESS = ("sound", "moved", "turned")


class Inspection:
    """Measurements of a cut sheet from a picture.

    ``kerf`` is twice the distance of the film's edge inside the beam's path, mm. ``rms`` and
    ``within_95`` mm: deviations of edges from the drawn ones apart from kerf, scale and the pieces'
    displacements. ``pixel`` and ``blur`` mm in the picture. Raises DesignError if the picture does
    not show the sheet, or too little of it.
    """

    def __init__(self, scan: Scan) -> None:
        self.sheet, self.picture = scan.sheet, scan.picture
        self.location = locate(scan)
        self.fit = fitted(scan, self.location)
        weighted = self.fit.weights > 0
        self.edges = int(weighted.sum())
        if self.edges < FEWEST:
            raise DesignError(
                f"{scan.picture.path.name} shows {self.edges} edge points of {scan.sheet.name}, "
                f"but {FEWEST} are needed; scan at a higher resolution, or more of the sheet"
            )
        self.scale = scale_of(scan, self.fit)
        self.pixel = 1 / self.fit.warp.pixels_per_mm
        self.kerf = _kerf(scan.picture, self.fit, self.pixel)
        residuals = np.abs(self.fit.residuals[weighted])
        self.rms = math.sqrt(float((residuals**2).mean()))
        self.within_95 = float(np.percentile(residuals, 95))
        self.pieces = piece_findings(scan, self.location, self.fit)

    @property
    def amiss(self) -> list[PieceFinding]:
        """The places without their piece as drawn."""
        return [piece for piece in self.pieces if piece.verdict != "sound"]

    @property
    def failed(self) -> bool:
        """True if a piece is missing, wrong, or not visible enough to tell."""
        return any(piece.verdict not in HARMLESS for piece in self.pieces)


class InspectionDocument(Document, schema="sbafab/inspection@1"):
    """An inspection; lengths in mm."""

    sheet: str = attribute("sheet.name")
    film: str = attribute("sheet.film")
    picture: str = attribute("picture.path.name")
    picture_sha256: str = attribute("picture.sha256")
    shows: Content = attribute("location.content")
    from_below: bool = attribute("location.from_below")
    kerf: Value
    kerf_in_file: str = attribute("sheet.kerf")
    scale: Scale
    edges: int
    rms: float
    within_95: float
    pixel: float
    blur: float = attribute("fit.blur")
    failed: bool
    pieces: list[PieceFinding]


def _kerf(picture: ScanPicture, fit: EdgeFit, pixel: float) -> Value:
    kerf = -2 * fit.offset
    uncertainty = 2 * math.hypot(fit.uncertainty, FINEST * pixel)
    half = student_t(fit.degrees) * uncertainty
    if not -half <= kerf <= LARGEST_KERF:
        raise DesignError(
            f"{picture.path.name}: the film reads {-kerf:.3f} mm larger than it is drawn; if it is "
            "darker than what it lies on, give --paper light"
            if kerf < 0
            else f"{picture.path.name}: kerf {kerf:.2f} mm is implausible; check --sheet and --dpi"
        )
    return Value(kerf, uncertainty, half)


MOST_NOTE = 400  # most characters of a note in a lab's file


def history(inspection: Inspection) -> dict[str, Any]:
    """Return an entry of a device's history, in the format of ``sbafab record --history``."""
    sound = len(inspection.pieces) - len(inspection.amiss)
    picture = inspection.picture
    note = (
        f"{inspection.sheet.name} {picture.path.name[:60]} sha256 {picture.sha256}: {sound} of "
        f"{len(inspection.pieces)} pieces as drawn"
    )
    for piece in inspection.amiss:
        note += f"; {piece.name} at x {piece.x:.1f}, y {piece.y:.1f} {piece.verdict}"
    if len(note) > MOST_NOTE:
        note = note[: MOST_NOTE - 4] + " ..."
    entry: dict[str, Any] = {"item": inspection.sheet.film or "film", "note": note}
    if inspection.kerf.value > 0:
        entry["kerf_mm"] = round(inspection.kerf.value, 4)
    return {"entry": [entry]}


# The table of sizes for ``sbafab kerf``.


FACING = 0.985  # cosine of the largest angle between a side and the axis that it bounds


def sizes_csv(inspection: Inspection) -> str:
    """Return the sizes of all sound contours along x and y, in the columns of a coupon's table."""
    remark = f"# {inspection.picture.path.name} sha256 {inspection.picture.sha256}\n"
    return remark + csv_text([(*COLUMNS, INSTRUMENT), *_sizes(inspection)])


def _sizes(inspection: Inspection) -> Iterator[tuple[str, str, str, str, str]]:
    is_skeleton = inspection.location.content == "skeleton"
    number = 0
    for place, finding in zip(inspection.sheet.places, inspection.pieces, strict=True):
        for contour in place.region.contours:
            if contour.is_hole and (is_skeleton or -contour.area < SMALLEST):
                continue
            kind = "window" if contour.is_hole or is_skeleton else "outer"
            for axis, scale in ((0, inspection.scale.x), (1, inspection.scale.y)):
                low, high = contour.bounds[axis], contour.bounds[axis + 2]
                gain = _gain(inspection.fit, number, axis, (low, high))
                if finding.verdict == "sound" and gain is not None:
                    measured = (high - low + (gain if kind == "outer" else -gain)) * scale
                    feature = f"{place.name} {kind}"
                    yield feature, "xy"[axis], f"{high - low:.4f}", f"{measured:.4f}", "scanner"
            number += 1


def _gain(fit: EdgeFit, contour: int, axis: int, ends: tuple[float, float]) -> float | None:
    """Return the total extent of film beyond both ends of a contour along an axis, mm."""
    mine = (fit.samples.contours == contour) & (fit.weights > 0)
    room = 0.05 + 0.02 * (ends[1] - ends[0])
    places, faces = fit.samples.points[:, axis], np.abs(fit.samples.normals[:, axis]) > FACING
    gains = [fit.outside[mine & faces & (np.abs(places - end) < room)] for end in ends]
    return None if min(map(len, gains)) == 0 else float(sum(gain.mean() for gain in gains))


# The picture with deviations.


SHOWN_SIDE, PAGE = 1600, 240.0  # longer side of the picture in the drawing, pixels and mm
LEGEND = 230.0  # least width of the page, mm: the legend's
STEPS = (-0.05, -0.02, -0.01, 0.01, 0.02, 0.05)  # step between the colours, mm
COLOURS = ("#2166ac", "#67a9cf", "#b9d9ea", "#4daf4a", "#fdcf9c", "#ef8a62", "#b2182b")
"""From film too small to film too large, distinct for the colour blind too."""
UNSEEN, AMISS = "#ff00ff", "#e6007e"


def drawing(inspection: Inspection) -> str:
    """Return an SVG: the picture, with its edges coloured by deviation and faulty pieces named."""
    sheet, picture, warp = inspection.sheet, inspection.picture, inspection.fit.warp
    rows, columns = picture.pixels.shape
    factor = PAGE / max(rows, columns)
    width, height = columns * factor, rows * factor
    places = [
        (warp(np.array([(piece.x, piece.y)]))[0] + 0.5) * factor for piece in inspection.amiss
    ]
    names = [
        text((x, y + line), words, anchor="middle", bold=True, colour=AMISS)
        for piece, (x, y) in zip(inspection.amiss, places, strict=True)
        for line, words in ((0.0, piece.name), (1.1 * TEXT, piece.verdict))
    ]
    elements = [
        f'<image width="{coord(width)}" height="{coord(height)}" href="{_embedded(picture)}"/>',
        *_coloured(inspection.fit, factor),
        '<g stroke="white" stroke-width="0.5" paint-order="stroke">',
        *names,
        "</g>",
        *_legend(height),
    ]
    title = f"{sheet.name}: {picture.path.name}"
    return document(max(width, LEGEND), height + 4 * TEXT, title, elements)


def _embedded(picture: ScanPicture) -> str:
    from PIL import Image

    image = Image.fromarray(np.clip(picture.pixels, 0, 255).astype(np.uint8))
    image.thumbnail((SHOWN_SIDE, SHOWN_SIDE))
    data = io.BytesIO()
    image.save(data, "JPEG", quality=70)
    return f"data:image/jpeg;base64,{base64.b64encode(data.getvalue()).decode()}"


def _coloured(fit: EdgeFit, factor: float) -> Iterator[str]:
    """Yield lines along the measured edges, each of one colour."""
    measured = np.isfinite(fit.outside) & (fit.weights > 0)
    kinds = np.where(measured, np.digitize(fit.residuals, STEPS), len(COLOURS))
    at = (fit.warp(fit.samples.points) + 0.5) * factor
    contours = fit.samples.contours
    cuts = np.nonzero((np.diff(contours) != 0) | (np.diff(kinds) != 0))[0] + 1
    for run in np.split(np.arange(len(at)), cuts):
        last = run[-1] + 1
        # Up to the next sample, so that colours are continuous.
        ends = [*run, last] if last < len(at) and contours[last] == contours[run[0]] else list(run)
        colour = (*COLOURS, UNSEEN)[kinds[run[0]]]
        yield line([(float(x), float(y)) for x, y in at[ends]], colour=colour, width=0.3)


def _legend(height: float) -> Iterator[str]:
    between = [f"{low:g} to {high:g}" for low, high in zip(STEPS, STEPS[1:], strict=False)]
    words = [f"under {STEPS[0]:g}", *between, f"over {STEPS[-1]:g} mm", "no such edge"]
    head = "Film beyond the drawn edge, apart from kerf, scale and the piece's own place:"
    yield text((TEXT, height + 1.4 * TEXT), head)
    for number, (colour, label) in enumerate(zip((*COLOURS, UNSEEN), words, strict=True)):
        x, y = TEXT + number * LEGEND / len(words), height + 2.9 * TEXT
        yield box((x, y - 0.8 * TEXT), (x + TEXT, y + 0.2 * TEXT), fill=colour)
        yield text((x + 1.4 * TEXT, y), label)
