"""Notes for whoever opens the cut files in another program: only what was tried or is documented.

Tried with sheets and layer files of this program: LibreCAD 2.2.0 (``librecad dxf2pdf``) and
Inkscape 1.2.2 (its DXF import, and ``--query-all``). LightBurn: from its documentation only.
"""

from __future__ import annotations

from typing import NamedTuple

from sbafab.cutting.cut_layers import (
    COLOURS,
    CUT_INNER,
    CUT_OUTER,
    CUT_SEQUENCE,
    CUT_SHEET,
    ENGRAVE,
    REFERENCE,
)
from sbafab.cutting.fixture import fixture
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.bill import kerf_states
from sbafab.reports.traveller.job import Work

COLOUR_NAMES = {1: "red", 5: "blue", 6: "magenta", 7: "black or white", 8: "grey"}
MEANINGS = {
    ENGRAVE: "the sheet's label, in its border; leave it out if you like",
    CUT_INNER: "holes: cut these before the outlines",
    CUT_OUTER: "outlines of the parts",
    CUT_SHEET: "cuts the used sheet off a roll; last",
    REFERENCE: "sheet frame or datum cross; never cut",
}


class CutLayer(NamedTuple):
    """A row of the table of cut layers."""

    order: str
    name: str
    colour: str
    meaning: str


class Program(NamedTuple):
    """A program and what is known of it; ``known`` says how."""

    name: str
    known: str
    notes: tuple[str, ...]


PROGRAMS = (
    Program(
        "LightBurn",
        "from its documentation, not tried",
        (
            "Open the .lbrn2 beside each DXF: layers, order and a frame without output are set, "
            "all powers are 0. Set power and speed of each layer. The rest of this list is for "
            "whoever opens the DXF.",
            "Each colour becomes a layer of its own in the Cuts / Layers window. By default layers "
            "run in the order of that window, from the top: bring them into the order above.",
            "Switch Output off for the layer of the grey REFERENCE lines.",
            "Set every cut layer to Line mode, Kerf Offset 0.",
            "Optimization Settings count only while Optimize Cut Path is on: keep Order by Layer "
            "first and Cut inner shapes first on, as they are by default.",
            "What it asks or assumes about the units of a DXF is not known to us: compare the "
            "overall size above before you cut.",
            "Run Preview and watch the order of the holes and outlines.",
        ),
    ),
    Program(
        "Inkscape",
        "tried: 1.2.2",
        (
            "Use File > Open, not Import: only then the layers keep their names (its own help says "
            "so). In the DXF dialog choose “Read from file”, or “Manual scale” with 1.0: the size "
            "is then right.",
            "Do not choose “Automatic scaling to size A4”: it enlarges the drawing.",
            "Circles and arcs stay true arcs, layer colours are kept.",
            "It measures with the width of the line unless its preferences say geometric bounding "
            "box.",
        ),
    ),
    Program(
        "LibreCAD",
        "tried: 2.2.0",
        (
            "Opens the DXF as it is: layers, colours and arcs are right. Printed at scale 1:1 the "
            "parts measure what they should, to 0.1 mm.",
            "REFERENCE does not print: the frame is missing on paper, which is right.",
        ),
    ),
)


def cut_layers() -> list[CutLayer]:
    """The layers in cutting order, what is not cut last."""
    numbered = {name: str(place) for place, name in enumerate(CUT_SEQUENCE, 1)}
    return [
        CutLayer(
            numbered.get(name, "not cut"),
            name,
            f"{COLOUR_NAMES[COLOURS[name]]} ({COLOURS[name]})",
            MEANINGS[name],
        )
        for name in (*CUT_SEQUENCE, REFERENCE)
    ]


def expected_sizes(work: Work) -> list[tuple[str, str]]:
    """For every sheet and the base plate: file, and how large it must be after opening."""
    found = [(sheet.path, say.size(sheet.width, sheet.length)) for sheet in work.sheets]
    press = work.design.press
    platen = press.platen_width, press.platen_length
    plate = fixture(work.laminate, platen, work.runs.places)
    if work.job.fixture is not None and plate is not None:
        low_x, low_y, high_x, high_y = plate.bounds
        found.append((work.job.fixture, say.size(high_x - low_x, high_y - low_y)))
    return found


def kerf_notes(work: Work) -> list[str]:
    """What to do about the kerf in the laser's own program, by material."""
    materials = list(dict.fromkeys(layer.film.material for layer in work.laminate.layers))
    return [
        f"{material}: {words}. "
        + (
            "The paths hold the kerf already: kerf offset 0 in the laser's program."
            if measured
            else "No offset is known: kerf offset 0 in the laser's program, and calibrate."
        )
        for material, words, measured in kerf_states(work.job, materials)
    ]
