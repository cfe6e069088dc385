"""What a user can ask for: the sections that every family's design file shares.

Every field has the paper's value as default (paper Sec. 2) or, where the paper is silent, ours,
and says so. Lengths are mm.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr

from sbafab.design.films import UNCALIBRATED, Films, KerfWidth, LayerFilms, Sheet
from sbafab.design.form import Form
from sbafab.design.section import Section
from sbafab.design.units import Length, LengthOrZero, Millimetres
from sbafab.notebook import table_html

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
RuleName = Literal[
    "bond-width",
    "mask-overhang",
    "facing-films",
    "sealing",
    "channel-clear",
    "tube-fit",
    "piece-count",
    "pin-holes",
    "film-limits",
    "press-fit",
    "registration-nominal",
    "registration-worst-case",
    "registration-yield",
]


class Bond(Section):
    """Where two structural films melt together."""

    width: Length = 0.75
    """Width of every bonded ring, web and strip edge."""


class Mask(Section):
    """The Teflon that keeps films apart."""

    overhang: Length = 0.5
    """How far a mask reaches past the edges of the TPE layers it keeps apart."""


class Bore(Section):
    """The channel along the axis of a chamber."""

    diameter: Length = 1.0
    """Channel between the balloons of a chamber, and its dowel pin (the paper gives none)."""


class Fillet(Section):
    """Rounded corners."""

    radius: LengthOrZero = 1.0
    """Rounding of the concave corners of outlines (the paper gives none); 0 leaves them sharp."""


class Inlet(Section):
    """Tab, strip and tube through which a chamber is filled."""

    tube: str = Field(default="Braintree RPT040", max_length=80)
    """The tubing to order."""
    tube_outer_diameter: Length = 1.016
    """Outer diameter of the tubing."""
    adhesive: str = Field(
        default="Loctite Vinyl, Fabric & Plastic Flexible Adhesive", min_length=1, max_length=120
    )
    """What seals tube and mouth (paper Sec. 2)."""
    width: Length | None = None
    """Width of the inlet strip; by default half the tube's perimeter, rounded up to 0.05."""
    tab_length: Length = 5.0
    """How far the inlet tab reaches past the outline (the paper gives none)."""

    @property
    def strip_width(self) -> float:
        """The strip's width: as given, or the least that opens to the tube, up to 0.05 mm."""
        if self.width is not None:
            return self.width
        return round(math.ceil(math.pi * self.tube_outer_diameter / 2 / 0.05 - 1e-9) * 0.05, 4)


class Registration(Section):
    """What keeps the layers in register, and how far off they may lie."""

    method: Literal["channel-pin", "ears"] = "channel-pin"
    """"channel-pin": dowel pins in the channel bores, and in the lumen if there is one (the
    paper's). "ears": tooling holes outside the outline, pinned in every press step."""
    pin_diameter: Length = 1.5
    """Dowel pins of the ears."""
    cutting_error: Annotated[float, Millimetres(0, 1)] = 0.1
    """The most by which a cut edge lies off its place (paper Sec. 2)."""
    pin_error: Annotated[float, Millimetres(0, 1)] = 0.004
    """The most by which a layer on its pins lies off its place (paper Sec. 2)."""
    hand_placement: Annotated[float, Millimetres(0, 5)] = 0.08
    """The most by which what no pin holds lies off what it is laid on. The paper gives none: this,
    with hand_turn, is calibrated so that the designs it built keep their limits as often as it
    succeeded, nine times in ten. A rougher hand takes larger values of both."""
    hand_turn: float = Field(default=0.4, ge=0, le=10)
    """Degrees: the most by which what fewer than two pins hold is turned. Calibrated together with
    hand_placement."""


class Press(Section):
    """The heat press: temperature, pressure, minutes, platen."""

    temperature_c: float = Field(default=135.0, gt=0, le=500)
    """C; between the TPE's melting point and the PTFE's limit."""
    pressure_kpa: float = Field(default=110.0, gt=0, le=10000)
    """On the whole platen."""
    platen_width: Length = 152.4
    """Heated area; the paper's press has 6 x 6 in."""
    platen_length: Length = 152.4
    """Heated area, the other way."""
    flash_bottom_minutes: float = Field(default=3.0, gt=0, le=600)
    """Step 1: the bottom balloon's upper two layers."""
    bond_bottom_minutes: float = Field(default=12.0, gt=0, le=600)
    """Step 2: the bottom balloon, full bond."""
    flash_middle_minutes: float = Field(default=10.0, gt=0, le=600)
    """Step 3: all layers between the bottom balloon and the top layer."""
    bond_all_minutes: float = Field(default=20.0, gt=0, le=600)
    """Step 4: the whole laminate, full bond."""


class Laser(Section):
    """The laser: what it can cut, its kerf, speeds for estimates."""

    least_feature: Length = 0.2
    """The narrowest slot or web the laser cuts well."""
    cut_speed: float = Field(default=20.0, gt=0, le=5000)
    """mm/s; for estimates of time only, no setting of a machine."""
    travel_speed: float = Field(default=200.0, gt=0, le=5000)
    """mm/s between cuts; for estimates of time only."""
    pierce_seconds: float = Field(default=0.1, ge=0, le=60)
    """Time to begin a contour; for estimates only."""
    heat_distance: LengthOrZero = 3.0
    """Parts nearer to each other than this are not cut one right after the other."""
    kerf_tpe: KerfWidth = UNCALIBRATED
    """Full kerf width in TPE, measured, or [along x, along y]; "uncalibrated" writes nominal edges
    and says so."""
    kerf_ptfe: KerfWidth = UNCALIBRATED
    """Full kerf width in PTFE, measured, likewise."""


class Sheets(Section):
    """The film sheets to cut from, and how parts are placed on them."""

    tpe: Sheet = Sheet()
    ptfe: Sheet = Sheet()
    engine: Literal["bottom-left", "spyrrow"] = "bottom-left"
    """What looks for places; "spyrrow" (an extra) packs tighter and takes its time."""
    seconds: float = Field(default=20.0, gt=0, le=3600)
    """How long spyrrow looks, for each sheet."""
    label: bool = True
    """Whether name, material, number and design hash are engraved into the border."""


class Order(Section):
    """How many, for whom."""

    copies: int = Field(default=1, ge=1, le=1000)
    """How many of the actuator are cut."""
    spares: int = Field(default=2, ge=0, le=100)
    """Spare sets of every mask's pieces that are cut beyond what the copies take: they are small
    and loose, and a lost one else costs a trip to the laser."""
    made_for: str = Field(default="", max_length=120)
    """Printed on the traveller."""
    note: str = Field(default="", max_length=400)
    """Printed on the traveller."""


class Rules(Section):
    """Limits of the rule deck, and what is waived."""

    bond_width: Length = 0.75
    """Every bond must be at least this wide."""
    mask_overhang: Length = 0.5
    """Every mask must reach at least this far past the edges it keeps apart."""
    worst_bond_width: LengthOrZero = 0.5
    """What must be left of every bond with all errors of cutting and registration at worst."""
    worst_mask_overhang: LengthOrZero = 0.25
    """What must be left of every overhang with all errors at worst."""
    target_yield: float | None = Field(default=None, gt=0, lt=1)
    """The share of random builds that must keep the two limits above; none asked for by default."""
    yield_builds: Annotated[int, Field(ge=100, le=1_000_000)] | None = None
    """Random builds drawn for registration-yield; by default 10,000, fewer for tall stacks."""
    validated_balloons: int = Field(default=20, ge=1, le=1000)
    """More balloons than this draw a warning (paper Sec. 6)."""
    waive: tuple[RuleName, ...] = Field(default=(), strict=False)
    """Rules whose failure shall not stop the cut files; every file then says so."""


class Stack(Section):
    """How high the actuator is."""

    balloons: int = Field(default=6, ge=1, le=1000)
    """Balloons in each chamber, bottom to top."""


class Chamber(Section):
    """The pockets of one chamber; a family adds their sizes."""

    outline: str | None = Field(default=None, max_length=1000)
    """DXF or SVG file with one closed path, drawn round (0, 0): the pocket, in place of the shape
    that the family gives it."""


class Design(Section):
    """The sections that all families share; a family adds its own, sets ``family`` and ``form``."""

    name: str = Field(pattern=NAME_PATTERN)
    """Names the output folder: letters, digits, dot, dash, underscore."""
    family: str
    """Which kind of actuator this is."""
    kit: str = Field(default="paper", min_length=1, max_length=1000)
    """The lab's films, tubes, press, laser and limits: "paper", or a file beside the design. It
    gives every key of its sections that the design leaves out."""
    stack: Stack = Stack()
    bond: Bond = Bond()
    mask: Mask = Mask()
    bore: Bore = Bore()
    fillet: Fillet = Fillet()
    inlet: Inlet = Inlet()
    films: Films = Films()
    layup: LayerFilms = LayerFilms()
    registration: Registration = Registration()
    press: Press = Press()
    laser: Laser = Laser()
    sheets: Sheets = Sheets()
    order: Order = Order()
    rules: Rules = Rules()
    chamber: Chamber = Chamber()

    _folder: Path = PrivateAttr(default=Path())

    @property
    def folder(self) -> Path:
        """Where relative paths of the design start: the folder of its file."""
        return self._folder

    @property
    def drawing(self) -> Path | None:
        """The file of the pockets' drawn outline, if there is one."""
        return None if self.chamber.outline is None else self.folder / self.chamber.outline

    @property
    @abstractmethod
    def form(self) -> Form:
        """What the actuator is like, for models, checks and pages. Raises DesignError."""

    def with_(self, *changes: str | Mapping[str, Any], **tables: Any) -> Self:
        """The same design with keys changed, checked like a design file.

        ``design.with_("stack.balloons=6")``, ``design.with_({"stack.balloons": 6})`` and
        ``design.with_(stack={"balloons": 6})`` say the same. Raises DesignError with one sentence.
        """
        from sbafab.design.reading import changed

        return changed(self, [*changes, tables])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.stack.balloons} balloons)"

    def _repr_html_(self) -> str:
        from sbafab.design.writing import keys_of

        return table_html(("key", "value", "default"), keys_of(self), self.name)

    def completed(self) -> Self:
        """The same design with every default that depends on another value filled in."""
        inlet = self.inlet.model_copy(update={"width": self.inlet.strip_width})
        return self.model_copy(update={"inlet": inlet})

    def placed(self, folder: Path) -> Self:
        """The same design with relative paths starting at ``folder``."""
        copy = self.model_copy()
        copy._folder = folder
        return copy
