"""Sections of a design file that all families share, with defaults in mm."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from sbafab.design.files import hint, rule_names
from sbafab.design.films import UNCALIBRATED, KerfWidth, MachineName, Recipe, Sheet
from sbafab.design.toml_table import BATCH_PATTERN, Section, writable
from sbafab.design.units import CELSIUS, SHORTEST, Length, LengthOrZero, Millimetres, millimetres
from sbafab.laminate.base_plate import PlateMachine
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS, film_name
from sbafab.laminate.joints import SeamTool

MOST = 1000
"""Actuators of one order."""


ROUNDING = 1e-9


class OrderSection(Section):
    """Number of actuators, customer, and copies at once."""

    copies: int = Field(default=1, ge=1, le=MOST)
    """Number of actuators made; more if order.good needs more."""
    success_rate: float = Field(default=0.9, gt=0, le=1)
    """Share of builds that succeed (paper Sec. 4: under 10 % failed). Replace it by your lab's own,
    from "sbafab record --report", once there is one."""
    certainty: float = Field(default=0.8, gt=0, lt=1)
    """Probability that at least order.good succeed (ours): 20 good ones at 0.9 need 23 builds for
    0.81, 24 for 0.91, 25 for 0.97."""
    good: int | None = Field(default=None, ge=1, le=MOST)
    """Number that must succeed. order.success_rate and order.certainty determine the additional
    builds; none by default."""
    spare_share: float = Field(default=0.05, ge=0, le=2)
    """Spare parts as a share of the number that the actuators need of each pattern, rounded up
    (ours). A part lost or torn at the press otherwise means recutting."""
    spares: int = Field(default=1, ge=0, le=100)
    """Least number of spares of a pattern, for films and masks; 0, with spare_share = 0, cuts
    none."""
    at_once: int | None = Field(default=None, ge=1, le=MOST)
    """Maximum copies in one press cycle, as far as they fit the heated area; by default the number
    that one person lays up and presses in 8 hours (ours)."""
    batch: str | None = Field(default=None, pattern=BATCH_PATTERN)
    """Name of the batch, a prefix of its serials: "24" makes "24-A-03" of "A-03". None by default;
    set one if a design is made again, since records identify an actuator by design and serial."""
    tray: bool | None = None
    """True if a tray plan (tray.pdf, 1:1) is written; by default for more than one copy."""
    cure_hours: float | None = Field(default=None, gt=0, le=168)
    """Cure time of the tubes' adhesive in hours, from its package; by default that of the kit's
    adhesive, else the traveller assumes 24 (ours)."""
    made_for: str = Field(default="", max_length=120)
    """Printed on the traveller."""
    note: str = Field(default="", max_length=400)
    """Printed on the traveller."""

    @field_validator("batch", mode="before")
    @classmethod
    def _may_be_a_number(cls, batch: object) -> object:
        return str(batch) if type(batch) is int else writable(batch)

    @field_validator("good")
    @classmethod
    def _copies_suffice(cls, good: int | None, info: ValidationInfo) -> int | None:
        rate, certainty = info.data.get("success_rate"), info.data.get("certainty")
        if good is None or rate is None or certainty is None:
            return good
        needed = builds_for(good, rate, certainty)
        odds = f"at success_rate = {rate:g} and certainty = {certainty:g}"
        if needed is None:
            raise ValueError(
                f"{odds} needs more than {MOST} builds; lower good or certainty, or split the order"
            )
        if 1 < info.data.get("copies", 1) < needed:
            raise ValueError(
                f"{odds} needs {needed}, but order.copies = {info.data['copies']}; omit copies "
                "or good, or lower certainty"
            )
        return good

    @property
    def quantity(self) -> int:
        """The number of actuators to make."""
        if self.good is None:
            return self.copies
        needed = builds_for(self.good, self.success_rate, self.certainty)
        return max(self.copies, needed or MOST)

    @property
    def why(self) -> str:
        """The quantity and its probability of success, as text; empty unless ``good`` is given."""
        if self.good is None:
            return ""
        likely = probability_of(self.good, self.quantity, self.success_rate)
        return (
            f"{self.quantity} are made for {self.good} good ones: if {self.success_rate:.0%} of "
            "builds come out good, each whatever the others do, at least "
            f"{self.good} of {self.quantity} do with a probability of {likely:.0%} (binomial)."
        )

    def spare_parts(self, needed: int) -> int:
        """Return the number of spares of a pattern if the actuators need ``needed`` parts of it."""
        return max(self.spares, math.ceil(self.spare_share * needed - ROUNDING)) if needed else 0


def probability_of(good: int, builds: int, rate: float) -> float:
    """Return the probability that at least ``good`` of ``builds`` succeed, each with probability
    ``rate``.

    The upper tail of the binomial distribution, summed over the number of failures. Builds are
    assumed independent, which is only partly true within one press cycle.
    """
    return math.fsum(
        math.comb(builds, failed) * rate ** (builds - failed) * (1 - rate) ** failed
        for failed in range(builds - good + 1)
    )


def builds_for(good: int, rate: float, certainty: float) -> int | None:
    """The least number of builds for ``good`` successes with this certainty; None beyond MOST."""
    counts = range(good, MOST + 1)
    # The probability grows with the number of builds.
    place = bisect_left(counts, certainty, key=lambda builds: probability_of(good, builds, rate))
    return counts[place] if place < len(counts) else None


PAPER_FILM = film_name(PAPER_PRODUCT, PAPER_THICKNESS)


FITTING = "blunt dispensing needle, 22 G (outer diameter 0.718 mm), Luer lock"
"""For the paper's tube of 0.635 mm bore, which it stretches by 13 %; 23 G (0.641 mm) by 1 %."""


def name_of(names: Callable[[], Sequence[str]]) -> tuple[AfterValidator, Any]:
    """Return the annotation for one of several names, which installed packages may extend, in
    validation and in the schema.
    """

    def checked(name: str) -> str:
        allowed = names()
        if name not in allowed:
            near = hint(name, allowed, f"there are {', '.join(allowed)}")
            raise ValueError(f"must be the name of a rule; {near}")
        return name

    def listed(schema: dict[str, Any]) -> None:
        schema["enum"] = [*names()]

    return AfterValidator(checked), Field(json_schema_extra=listed)


class Bond(Section):
    """The bond of two melted structural films."""

    width: Length = 0.75
    """Width of every bonded ring, web and strip edge."""


class Mask(Section):
    """The PTFE film that separates films."""

    overhang: Length = 0.5
    """Distance by which a mask extends past the edges of the TPE layers that it separates."""


class Bore(Section):
    """The channel along the axis of a chamber."""

    diameter: Length = 1.04
    """Channel between the balloons of a chamber, and hole for its dowel pin (the paper gives
    none)."""
    clearance: Annotated[float, Millimetres(0, 1)] = 0.04
    """Excess of the bore over its dowel pin in diameter. Ours: the value allowed by registration,
    since 0.75 - 2 x (0.1 + 0.004 + 0.02) is just the 0.5 that must remain of a bond at worst."""
    pin_diameter: Length | None = None
    """Dowel pin of the bore; by default the bore minus the clearance."""

    @property
    def pin(self) -> float:
        """The diameter of the bore's dowel pin."""
        if self.pin_diameter is not None:
            return self.pin_diameter
        return round(max(self.diameter - self.clearance, self.diameter / 2), 6)


class Fillet(Section):
    """Rounded corners."""

    radius: LengthOrZero = 1.0
    """Rounding of the concave corners of outlines (the paper gives none); 0 leaves them sharp."""


class Inlet(Section):
    """The tab, strip and tube through which a chamber is filled."""

    tube: str = Field(default="Braintree RPT040", max_length=80)
    """The tubing to order."""
    tube_outer_diameter: Length = 1.016
    """Outer diameter of the tubing."""
    adhesive: str = Field(
        default="Loctite Vinyl, Fabric & Plastic Flexible Adhesive", min_length=1, max_length=120
    )
    """Adhesive that seals tube and mouth (paper Sec. 2)."""
    width: Length | None = None
    """Width of the inlet strip; by default what tube and strip need together, with cutting error
    and an unknown kerf taken off, rounded up to 0.05."""
    tab_length: Length = 5.0
    """Distance by which the inlet tab reaches past the outline (the paper gives none)."""


GUIDED_TOOL = 0.3
"""Position error of a seam's tool other than a laser, mm; ours, not measured."""


class Registration(Section):
    """Registration of the layers, and its errors."""

    method: Literal["channel-pin", "ears"] = "channel-pin"
    """"channel-pin": dowel pins in the channel bores, and in the lumen if there is one (the
    paper's). "ears": tooling holes outside the outline, pinned in every press step."""
    pin_diameter: Length = 1.5
    """Dowel pins of the ears."""
    full_bond_pins: Literal["out", "in"] = "out"
    """Ears: "out" tacks base and cap on the pins by a flash bond and removes the pins before the
    full bond, since the paper keeps pins out of molten TPE; "in" leaves them in, under a release
    sleeve or coat. Both are untested."""
    sequence: Literal["bottom-first", "middle-first"] | None = None
    """Order of stacking. "bottom-first" (default, the paper's): the bottom balloon with its base,
    then the middle layers on the pins, then both with the top layer. "middle-first": all layers
    between base and cap on the pins, then base and cap; one hand placement fewer, untested."""
    pin_clearance: Annotated[float, Millimetres(0, 1)] = 0.0
    """Excess of the ears' holes over their pins in diameter; it adds up over up to three steps."""
    pin_stretch: float = Field(default=0.3, ge=0, le=2)
    """Maximum strain of a hole over its pin. Ours, untested: less than a tenth of the 400 % that
    cast PTFE film of 0.025 mm must reach before it tears (ASTM D3369, Table 1); skived film reaches
    less, TPE more."""
    pin_standard: Literal["ISO 8734", "ISO 2338"] = "ISO 8734"
    """Standard for the diameters and lengths of dowel pins; order them ground to m6."""
    pin_lengths: tuple[Length, ...] = Field(default=(), max_length=30, strict=False)
    """Lengths of pins in stock, instead of the standard's."""
    cutting_error: Annotated[float, Millimetres(0, 1)] = 0.1
    """Maximum displacement of a cut edge (paper Sec. 2)."""
    plate_made_by: PlateMachine = "jig-borer"
    """Machine for the holes of the base plate: "jig-borer" (position error 0.003, each hole lapped
    to its pin), "cnc-mill" (0.025, reamed H7) or "drill-press" (marked out by hand, 0.2, reamed
    H7)."""
    pin_error: Annotated[float, Millimetres(0, 1)] | None = None
    """Maximum displacement of a layer on its pins; by default that of plate_made_by: for a jig
    borer the paper's 0.004 (Sec. 2), for a CNC mill 0.029, for a drill press 0.204. The position of
    a plate's only pin does not count: each then gives 0.004."""
    hand_placement: Annotated[float, Millimetres(0, 5)] = 0.08
    """Maximum displacement of a part without pins from the part below. The paper gives none: this,
    with hand_turn, is calibrated so that the paper's designs keep their limits at its success rate,
    nine in ten. Less accurate placement needs larger values of both."""
    hand_turn: float = Field(default=0.4, ge=0, le=10)
    """Degrees: maximum rotation of a part on fewer than two pins. Calibrated together with
    hand_placement."""
    seam_error: Annotated[float, Millimetres(0, 5)] | None = None
    """Maximum displacement of a seam from its path, for any tool; by default cutting_error for a
    laser, which the same machine moves, and 0.3 for other tools: ours, not measured."""

    @property
    def is_middle_first(self) -> bool:
        """True if the layers between base and cap are tacked before any balloon is pressed."""
        return self.sequence == "middle-first"

    @property
    def hole_diameter(self) -> float:
        """The diameter of the holes in ears and tails."""
        return self.pin_diameter + self.pin_clearance

    def error_of_seam(self, tool: SeamTool) -> float:
        """Return the largest displacement of a tool's seam from its path, mm."""
        if self.seam_error is not None:
            return self.seam_error
        return self.cutting_error if tool == "laser" else GUIDED_TOOL


MountCoordinate = Annotated[float, Millimetres(-500, 500)]


class SeamToolSection(Section):
    """The mounting of a seam tool on its machine."""

    offset: Annotated[tuple[MountCoordinate, MountCoordinate], Field(strict=False)]
    """Position of its middle, x and y from the laser or pen head that defines the machine's origin.
    Seam files are shifted by minus this offset; all other output shows seams in place."""


class SeamTools(Section):
    """Seam tools that are not mounted in place of the machine's head."""

    laser: SeamToolSection | None = None
    """The laser."""
    hot_tip: SeamToolSection | None = None
    """The hot tip."""
    ultrasonic: SeamToolSection | None = None
    """The ultrasonic horn."""
    roller: SeamToolSection | None = None
    """The roller."""

    @property
    def offsets(self) -> dict[str, tuple[float, float]]:
        """The nonzero offsets, by the tools' names in seams."""
        rows = {name.replace("_", "-"): getattr(self, name) for name in SeamTools.model_fields}
        return {tool: row.offset for tool, row in rows.items() if row and any(row.offset)}


NOT_MEASURED: Literal["not measured"] = "not measured"


LONGEST_CONSTANT = 120.0
"""Minutes, of a plate between platens."""


def named_film(text: str) -> tuple[str, float]:
    """Return product and thickness (mm) of a text such as "Stretchlon 200, 0.038 mm".

    Raises ValueError with a sentence about the allowed form.
    """
    product, _, thickness = text.rpartition(",")
    try:
        thick = millimetres(thickness)
    except ValueError:
        thick = 0.0
    if not product.strip() or not SHORTEST <= thick <= 1:
        raise ValueError(f'must be product and thickness of a film, such as "{PAPER_FILM}"')
    return product.strip(), thick


def _named_film(text: str) -> str:
    writable(text)
    named_film(text)
    return text


def _time_constant(value: object) -> object:
    if value == NOT_MEASURED:
        return value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not 0 < float(str(value)) <= LONGEST_CONSTANT:
        raise ValueError(
            f'must be minutes, more than 0 and at most {LONGEST_CONSTANT:g}, or "{NOT_MEASURED}"'
        )
    return float(str(value))


TimeConstant = Annotated[float | Literal["not measured"], BeforeValidator(_time_constant)]
"""Minutes, or "not measured"."""


MINUTES = tuple(
    f"{step}_minutes" for step in ("flash_bottom", "bond_bottom", "flash_middle", "bond_all")
)
"""Keys of the minutes of press steps."""


class Press(Section):
    """The heat press: temperature, pressure, minutes, platen."""

    temperature_c: Annotated[float, Field(gt=0, le=500), CELSIUS] = 135.0
    """C; between the TPE's melting point and the PTFE's limit."""
    pressure_kpa: float = Field(default=110.0, gt=0, le=10000)
    """On the whole platen."""
    platen_width: Length = 152.4
    """Heated area; the paper's press has 6 x 6 in."""
    platen_length: Length = 152.4
    """Heated area, in the other direction."""
    plate_material: str = Field(default="steel", max_length=80)
    """Base plate, as large as the platen: under every lay-up, with the holes for the pins."""
    plate_thickness: Length | None = None
    """Thickness of the base plate; by default the thinnest stock plate, from 6 mm, that holds the
    pins."""
    release_film: str = Field(default="PTFE film", max_length=80)
    """Release film, to which TPE does not stick, one sheet below and one above (the paper names
    none)."""
    release_thickness: Annotated[float, Millimetres(SHORTEST, 1)] = 0.05
    """Thickness of one release film; PTFE film is sold in this thickness."""
    underlay_thickness: Annotated[float, Millimetres(SHORTEST, 1)] = 0.1
    """Thickness of the printed underlay, if one lies on the plate; plain paper of 80 g/m2."""
    pad_material: Literal["silicone sponge", "silicone rubber"] = "silicone sponge"
    """Press pad: the compliant sheet, as large as the platen, that spreads the force (ours)."""
    pad_thickness: Length | None = None
    """Thickness of the press pad; by default the thinnest stock pad that gives films 1.5 times the
    pressure."""
    pad_hardness: float = Field(default=10.0, ge=5, le=90)
    """Shore A; 10 is a soft closed-cell silicone sponge, between grades 3 and 4 of ASTM D1056 class
    D; sheets of solid silicone rubber have 40 to 70."""
    flash_bottom_minutes: float | None = Field(default=3.0, gt=0, le=600)
    """Step 1: the bottom balloon's upper two layers."""
    bond_bottom_minutes: float | None = Field(default=12.0, gt=0, le=600)
    """Step 2: the bottom balloon, full bond."""
    flash_middle_minutes: float | None = Field(default=10.0, gt=0, le=600)
    """Step 3: all layers between the bottom balloon and the top layer."""
    bond_all_minutes: float | None = Field(default=20.0, gt=0, le=600)
    """Step 4: the whole laminate, full bond."""
    minutes_for: tuple[Annotated[str, Field(max_length=120), AfterValidator(_named_film)], ...] = (
        Field(default=(PAPER_FILM,), max_length=20, strict=False)
    )
    """Films for which the minutes above are stated, each as "product, thickness". A laminate of any
    other structural film gets no minutes: blanks on the traveller, null in press.json. If a kit
    names a film other than the paper's, minutes that it omits are unknown."""
    time_constant: TimeConstant = NOT_MEASURED
    """Minutes in which the edge of the base plate, laid cold between the hot platens under the pad,
    covers 63 % of the temperature difference; measured once at the bench."""
    cool_minutes: float | None = Field(default=None, gt=0, le=600)
    """Minutes in which the base plate cools beside the press until it can be touched; measured once
    at the bench. By default the traveller's times take a first-order estimate."""

    @property
    def platen(self) -> tuple[float, float]:
        """The heated area, mm x mm."""
        return self.platen_width, self.platen_length

    @property
    def platen_area(self) -> float:
        """The heated area, mm2."""
        return self.platen_width * self.platen_length

    @property
    def force_n(self) -> float:
        """The force on the whole platen."""
        return self.pressure_kpa * self.platen_area / 1000

    @property
    def timed_films(self) -> tuple[tuple[str, float], ...]:
        """The product and thickness, mm, of the films for which the minutes are stated."""
        return tuple(map(named_film, self.minutes_for))


class Acceptance(Section):
    """Working pressure of an actuator, and its tests before delivery: our values except the burst
    pressure.
    """

    working_pressure_kpa: float | None = Field(default=None, ge=-101.325, le=10000)
    """Highest working gauge pressure; a vacuum is negative. By default none is stated, and the rule
    pressure-rating warns if the actuator is unsuitable for 100 kPa, at which the paper gives
    forces."""
    safety_factor: float = Field(default=2.0, ge=1, le=100)
    """Ratio of the estimated burst pressure to the highest working pressure. Ours: the estimate
    rests on three actuators, and the fatigue life of the film is unknown."""

    leak_pressure_kpa: float = Field(default=5.0, gt=0, le=1000)
    """Leak test under water: enough to open every balloon (a stack of d = 5 unfolds up to 0.95)."""
    leak_seconds: float = Field(default=60.0, gt=0, le=36000)
    """Duration of the leak test."""
    proof_pressure_kpa: float = Field(default=150.0, gt=0, le=10000)
    """Proof test: 1.5 times the 100 kPa at which the paper gives forces. Lower if 60 % of the
    estimated burst pressure is less. For a film without a burst test these 150 kPa are left blank,
    and any other pressure is printed as stated."""
    proof_seconds: float = Field(default=60.0, gt=0, le=36000)
    """Duration of the proof test."""
    fitting: str = Field(default=FITTING, min_length=1, max_length=200)
    """Connector from the tube to a syringe, regulator or gauge."""


HoldDown = Literal["border", "carrier", "vacuum"]
"""Means of holding a film under the beam."""


class Laser(Section):
    """The laser: its limits, kerf, film fixing, and speeds for estimates."""

    least_feature: Length = 0.2
    """The narrowest slot or web that the laser cuts reliably."""
    cut_speed: float = Field(default=20.0, gt=0, le=5000)
    """mm/s; only for time estimates, not a machine setting."""
    travel_speed: float = Field(default=200.0, gt=0, le=5000)
    """mm/s between cuts; only for time estimates."""
    pierce_seconds: float = Field(default=0.1, ge=0, le=60)
    """Time to start a contour; only for estimates."""
    heat_distance: LengthOrZero = 3.0
    """Parts closer to each other than this are not cut consecutively."""
    kerf_tpe: KerfWidth = UNCALIBRATED
    """Full kerf width in TPE, measured, or [along x, along y]; "uncalibrated" writes nominal edges
    and states so."""
    kerf_ptfe: KerfWidth = UNCALIBRATED
    """Full kerf width in PTFE, measured, as laser.kerf_tpe."""
    hold_tpe: HoldDown = "border"
    """Fixing of TPE, and other films that bond, under the beam: its "border" taped to card, a
    low-tack "carrier" sheet, or a "vacuum" bed. Ours, untested: carrier adhesive left in a bond may
    cause a leak."""
    hold_ptfe: HoldDown = "carrier"
    """Fixing of PTFE, and other masks, as in laser.hold_tpe. Ours, untested: masks are light and
    loose, and do not bond."""
    unknown_kerf: Annotated[float, Millimetres(0, 1)] = 0.1
    """Allowance in a part's width for an unmeasured kerf: ours."""
    machine: MachineName | None = None
    """The machine whose recipes LightBurn's projects use; by default none, so every power is 0."""
    recipe: Annotated[tuple[Recipe, ...], Field(max_length=200, strict=False)] | None = None
    """Power and speed by film, thickness and machine, one [[laser.recipe]] each."""

    @model_validator(mode="after")
    def _recipes_are_one_each(self) -> Self:
        purposes = set()
        for recipe in self.recipe or ():
            if recipe.purpose in purposes:
                raise ValueError(
                    f"has two recipes to {recipe.operation} {recipe.film} of "
                    f"{recipe.thickness_mm:g} mm on {recipe.machine}; keep one"
                )
            purposes.add(recipe.purpose)
        return self


class Sheets(Section):
    """The film sheets to cut, and the placement of parts on them."""

    tpe: Sheet = Sheet.model_construct()
    ptfe: Sheet = Sheet.model_construct()
    label: bool = True
    """True if name, material, number and design hash are engraved into the border."""
    index_marks: bool | None = None
    """True if the number of its pattern is engraved into the skeleton beside each part with enough
    space; off by default. Wider spacing leaves more space."""
    program: Literal["rdworks", "epilog"] | None = None
    """A laser program besides LightBurn for which each sheet gets a machine file: "rdworks" (DXF
    R12 by colour) or "epilog" (SVG with hairlines by colour)."""


class Rules(Section):
    """Limits of the rule deck, and waivers."""

    bond_width: Length = 0.75
    """Every bond must be at least this wide."""
    mask_overhang: Length = 0.5
    """Every mask must extend at least this far past the edges that it separates."""
    worst_bond_width: LengthOrZero = 0.5
    """Least remaining width of every bond with all errors of cutting and registration at worst."""
    worst_mask_overhang: LengthOrZero = 0.25
    """Least remaining width of every overhang with all errors at worst."""
    target_yield: float | None = Field(default=None, gt=0, lt=1)
    """The share of random builds that must keep the two limits above; none by default."""
    yield_builds: Annotated[int, Field(ge=100, le=1_000_000)] | None = None
    """Random builds drawn for registration-yield; by default 10,000, fewer for tall stacks."""
    validated_balloons: int = Field(default=20, ge=1, le=1000)
    """More balloons than this draw a warning (paper Sec. 6), as do films with a greater height than
    so many of the paper's, 0.125 mm per balloon."""
    opening_pressure_kpa: float | None = Field(default=None, gt=0, le=10000)
    """A channel of a net must open at this pressure: one of its films lifts by its thickness. By
    default 100 kPa, at which the paper gives forces."""
    dead_end: float | None = Field(default=None, ge=0.5, le=1000)
    """Largest ratio of length to width of a branch of a net without a port; by default 2."""
    waive: tuple[Annotated[str, *name_of(rule_names)], ...] = Field(default=(), strict=False)
    """Rules whose failure does not stop the cut files; every file then says so."""

    @property
    def validated_height(self) -> float:
        """The height in mm of the validated number of balloons in the paper's films. It is no key,
        since a new key would change the hash of every design.
        """
        return 0.125 * self.validated_balloons

    @field_validator("waive", mode="before")
    @classmethod
    def _without_removed_rules(cls, names: object) -> object:
        # Earlier design files waive the rules of registered sheets, which need no waiver.
        if isinstance(names, list | tuple):
            return [name for name in names if name not in ("bridges", "scrap")]
        return names

    @property
    def channels_open_at_kpa(self) -> float:
        """The pressure at which a channel of a net must open."""
        return self.opening_pressure_kpa or 100.0

    @property
    def longest_dead_end(self) -> float:
        """The largest ratio of length to width of a dead-end branch of a net."""
        return self.dead_end or 2.0


class Models(Section):
    """The basis of predictions."""

    calibration: str = Field(default="paper", min_length=1, max_length=1000)
    """The calibration of the models: "paper", a file written by sbafab calibrate beside the design,
    or "none" for films as drawn and bought, without intervals."""


class Stack(Section):
    """The height of the actuator."""

    balloons: int = Field(default=6, ge=1, le=1000)
    """Balloons in each chamber, bottom to top."""


class Chamber(Section):
    """The pockets of one chamber; a family adds their sizes."""

    outline: str | None = Field(default=None, max_length=1000)
    """DXF or SVG file with one closed path: the pocket, in place of the shape that the family gives
    it. Drawn round (0, 0) it keeps its place, else its centroid moves to the chamber's axis."""
