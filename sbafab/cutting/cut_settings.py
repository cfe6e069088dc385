"""Layers, colours, names and custom properties of cut files, and their representation of arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from sbafab.design.films import Operation, Recipe, is_kerf
from sbafab.errors import OutputError
from sbafab.geometry.offset import Kerf, widths
from sbafab.laminate.films import PTFE_WARNING, Material

Recipes = Mapping[Operation, Recipe]
"""Recipes of a film on the machine, by operation."""
DxfProfile = Literal["bulges", "arcs", "chords"]


class Curves(NamedTuple):
    """The representation of arcs in cut files; ``chord_error`` in mm applies only to chords."""

    profile: DxfProfile = "bulges"
    chord_error: float = 0.005

    @property
    def in_chords(self) -> bool:
        return self.profile == "chords"


TRUE_ARCS = Curves()
"""Form of written curves: polylines with bulges, LINE and ARC, or polylines of short chords."""


UNCALIBRATED = "uncalibrated: nominal edges"
COMPENSATED = "compensated"
LIMITS = "LIMITS"
CHORDS = "chords within"
FOLDER = "layers"


@dataclass(frozen=True)
class LeadIns:
    """Lead-ins, overcuts and tabs of a film's contours, in mm; 0 turns one off.

    Each outline has ``tabs``, each ``tab_width`` of film wide; the beam skips ``gap``, which is
    wider by its ``kerf``. Lead-ins keep ``clearance`` from everything but their own contour.
    ``key`` is the design's table with these keys, for messages.
    """

    lead_in: float = 0.0
    overcut: float = 0.0
    tab_width: float = 0.0
    tabs: int = 0
    kerf: float = 0.0
    clearance: float = 0.2
    key: str = "sheets.tpe"

    @property
    def is_plain(self) -> bool:
        """True if contours are cut without lead-ins, overcuts and tabs."""
        return not (self.lead_in or self.overcut or self.tabs)

    @property
    def gap(self) -> float:
        """The length of an outline that a tab leaves uncut, mm."""
        return self.tab_width + self.kerf if self.tabs else 0.0

    @property
    def properties(self) -> dict[str, str]:
        """A text that describes them, for laser program files."""
        tabs = f"{self.tabs} an outline, {self.tab_width:g} mm wide, {self.gap:g} mm uncut"
        return {
            **({"LEAD_IN": f"{self.lead_in:g} mm"} if self.lead_in else {}),
            **({"OVERCUT": f"{self.overcut:g} mm"} if self.overcut else {}),
            **({"TABS": tabs} if self.tabs else {}),
        }


PLAIN = LeadIns()


@dataclass(frozen=True)
class CutSettings:
    """The settings of the cut files besides the laminate."""

    design: str
    design_sha256: str
    kerf_widths: Mapping[Material, Kerf | None] = field(default_factory=dict)
    waived: tuple[str, ...] = ()
    lowered: tuple[str, ...] = ()
    curves: Curves = TRUE_ARCS
    generator: str = "sbafab"
    warnings: Mapping[str, str] = field(default_factory=lambda: {"PTFE": PTFE_WARNING})
    machine: str | None = None
    recipes: Mapping[Material, Recipes] = field(default_factory=dict)
    lead_ins: Mapping[Material, LeadIns] = field(default_factory=dict)
    seam_offsets: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def kerf_width(self, material: Material) -> Kerf | None:
        return self.kerf_widths.get(material)


def file_properties(
    settings: CutSettings, material: Material, pattern: str, parts: str | None = None
) -> dict[str, str]:
    """Return custom properties of the cut file of one pattern, equal for all layers that share it.

    A film sheet has "sheet 1 of 2" as its pattern and lists its ``parts``.
    """
    warning = settings.warnings.get(material)
    return {
        **_properties(settings, material, pattern, settings.kerf_width(material)),
        **({} if parts is None else {"PARTS": parts}),
        **({"WARNING": warning} if warning else {}),
    }


def fixture_properties(settings: CutSettings, notes: Sequence[str] = ()) -> dict[str, str]:
    """Return custom properties of the base plate's cut file; its edges are nominal.

    ``notes`` inform a workshop about its holes.
    """
    properties = _properties(settings, "plate", "fixture", None)
    return {**properties, "HOLES": " / ".join(notes)} if notes else properties


def _properties(
    settings: CutSettings, material: str, pattern: str, kerf: Kerf | None
) -> dict[str, str]:
    curves = curves_text(settings.curves)
    return {
        "DESIGN": settings.design,
        "DESIGN_SHA256": settings.design_sha256,
        "PATTERN": pattern,
        "MATERIAL": material,
        "UNITS": "mm",
        **kerf_properties(kerf),
        "WAIVED": ", ".join(settings.waived) or "none",
        **({LIMITS: ", ".join(settings.lowered)} if settings.lowered else {}),
        "GENERATOR": settings.generator,
        **({} if curves is None else {"CURVES": curves}),
    }


def kerf_properties(kerf: Kerf | None) -> dict[str, str]:
    """Return a cut file's kerf statement."""
    if kerf is None:
        return {"KERF_STATE": UNCALIBRATED, "KERF_WIDTH": "none"}
    return {"KERF_STATE": COMPENSATED, "KERF_WIDTH": kerf_text(kerf)}


def kerf_of(properties: Mapping[str, str]) -> Kerf | None:
    """Return the kerf that a file states as compensated; None for nominal edges.

    Raises OutputError without a clear statement.
    """
    state, width = properties.get("KERF_STATE"), properties.get("KERF_WIDTH", "")
    if (state, width) == (UNCALIBRATED, "none"):
        return None
    try:
        x, _, y = width.partition(" x ")
        kerf = float(x), float(y or x)
    except ValueError:
        kerf = math.nan, math.nan
    if state != COMPENSATED or not is_kerf(*kerf):
        raise OutputError(
            f"its properties KERF_STATE {state!r} and KERF_WIDTH {width!r} do not define the "
            "kerf compensation; regenerate it"
        )
    return kerf[0] if kerf[0] == kerf[1] else kerf


def kerf_text(kerf: Kerf) -> str:
    """Return a kerf as files and messages print it: ``0.12``, or ``0.12 x 0.1`` along x and y."""
    x, y = widths(kerf)
    return f"{x:g}" if x == y else f"{x:g} x {y:g}"


def kerf_suffix(kerf: Kerf | None) -> str:
    """Return the end of a compensated cut file's name: ``_kerf0.12``, ``_kerf0.12x0.1``."""
    return "" if kerf is None else f"_kerf{kerf_text(kerf).replace(' ', '')}"


def layer_path(name: str, kerf: Kerf | None) -> str:
    """Return the path in an output folder of the cut file of the layer of this name."""
    return f"{FOLDER}/{name}{kerf_suffix(kerf)}.dxf"


def curves_text(curves: Curves) -> str | None:
    """Return the statement on chords in files and manifest; None for true arcs."""
    return f"{CHORDS} {curves.chord_error:g} mm" if curves.in_chords else None


def curves_of(text: str | None) -> Curves:
    """Return the representation of arcs that a file or manifest states; true arcs for None.

    Raises OutputError if the statement is invalid.
    """
    if text is None:
        return TRUE_ARCS
    try:
        error = float(text.removeprefix(CHORDS).removesuffix(" mm"))
    except ValueError:
        error = 0.0
    if not 0 < error <= 0.1:
        raise OutputError(
            f"custom property CURVES is {text!r}, not {CHORDS} up to 0.1 mm; regenerate it."
        )
    return Curves("chords", error)


# The layers of a cut file, in the order a laser program takes them.


ENGRAVE = "ENGRAVE"
CUT_INNER = "CUT_INNER"
CUT_OUTER = "CUT_OUTER"
CUT_SHEET = "CUT_SHEET"
REFERENCE = "REFERENCE"

COLOURS = {ENGRAVE: 7, CUT_INNER: 5, CUT_OUTER: 1, CUT_SHEET: 6, REFERENCE: 8}
"""AutoCAD colour index of every layer; REFERENCE is neither cut nor plotted."""

SEAM = "SEAM"
"""Layer of a seam's path, which a tool follows; seams have separate files."""
SEAM_COLOUR = 3

CUT_SEQUENCE = (ENGRAVE, CUT_INNER, CUT_OUTER, CUT_SHEET)
"""In cutting order: a hole cut after its outline would be cut in a loose part."""
