"""Records of an assembly file: parts, joints, passages that the whole must fit, and limits.

Defaults are the paper's (Sec. 2.1) if it gives a value; otherwise the field states that they are
ours. Lengths are in mm, angles in degrees.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from sbafab import catalogue
from sbafab.design.files import rule_names
from sbafab.design.sections import Laser, OrderSection, Press, Sheets, name_of
from sbafab.design.toml_table import NAME_PATTERN, PART_PATTERN, Section
from sbafab.design.units import Length, LengthOrZero, Millimetres

Seat = Literal["top", "bottom", "start", "end", "outside", "lumen", "inlet"]
Degrees = Annotated[float, Field(ge=-360, le=360)]
Shift = Annotated[float, Millimetres(-1000, 1000)]
PartName = Annotated[str, Field(pattern=PART_PATTERN)]
Words = Annotated[str, Field(max_length=120)]


class Fixed(Section):
    """The joint of a part. The root, which supports all others, has no ``on``."""

    on: str | None = None
    """The part that this one is fixed on."""
    at: Seat | None = None
    """Place on that part: top or bottom (of an SBA, a magnet, a base), start, end or outside (of a
    tube), lumen (lines only: of an SBA or a tube), inlet (lines only: of an SBA)."""
    angle: Degrees = 0.0
    """At the outside of a tube: angle round the tube."""
    turn: Degrees = 0.0
    """Turn of the part about its own axis before it is fixed."""
    along: Shift = 0.0
    """At the outside of a tube or in a lumen: distance from the start to the part's own origin."""
    offset: Annotated[tuple[Shift, Shift], Field(strict=False)] = (0.0, 0.0)
    """At a top, bottom, start or end: offset from the axis, x and y."""
    glue: Words | None = None
    """The adhesive to order; none if the part is held otherwise."""
    note: Annotated[str, Field(max_length=400)] = ""
    """Printed with the part's step in the traveller."""


class Sba(Fixed):
    """A stacked balloon actuator, cut and pressed from its own design."""

    kind: Literal["sba"]
    """A stacked balloon actuator, from a design."""
    design: Annotated[str, Field(max_length=1000)]
    """A template's name, or a design file, relative to the assembly's file."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Keys of that design to override, as tables."""


def _with_a_wall(part: Tube | Line) -> Tube | Line:
    if part.inner_diameter >= part.outer_diameter:
        raise ValueError("must have an inner_diameter smaller than its outer_diameter")
    return part


class Tube(Fixed):
    kind: Literal["tube"]
    """A tube."""
    outer_diameter: Length = 15.0
    """From the paper, Sec. 2.1."""
    inner_diameter: Length = 11.0
    """Ours: the paper gives none."""
    length: Length = 40.0
    """Ours: the paper gives none."""
    material: Words = "silicone"
    """Printed on the traveller."""

    _is_hollow = model_validator(mode="after")(_with_a_wall)


class Magnet(Fixed):
    kind: Literal["magnet"]
    """A disc magnet."""
    diameter: Length = 1.5875
    """1/16 in, as the seller's part numbers read: D, then sixteenths of an inch."""
    thickness: Length = 1.5875
    """1/16 in."""
    part: Words = "K&J Magnetics D11SH"
    """The part to order (paper, Sec. 2.1)."""


class Cup(Fixed):
    """A cast, bell-shaped suction cup: its narrow end is glued on, its wide end is open."""

    kind: Literal["cup"]
    """A cast suction cup."""
    diameter: Length = 8.0
    """Diameter of the rim. Ours: the paper gives none."""
    neck: Length = 5.0
    """Diameter of the end that is glued on. Ours."""
    height: Length = 4.0
    """Ours."""
    wall: Length = 1.0
    """Ours."""
    bore: Length = 1.1
    """For the vacuum line. Ours."""
    material: Words = "Ecoflex 00-30 silicone"
    """The cast material (paper, Sec. 2.1)."""

    @model_validator(mode="after")
    def _is_hollow(self) -> Self:
        if self.neck - self.bore < 2 * self.wall:
            raise ValueError("must have a neck at least as wide as its bore and two walls together")
        if self.height <= self.wall:
            raise ValueError("must be higher than its wall is thick")
        if self.diameter < self.neck:
            raise ValueError("must not be narrower at its rim (diameter) than at its neck")
        return self


class Line(Fixed):
    """A tube for vacuum or fluid through a lumen or into an inlet."""

    kind: Literal["line"]
    """Tubing for vacuum or fluid."""
    outer_diameter: Length = 1.016
    """The paper's tubing."""
    inner_diameter: Length = 0.635
    """The paper's tubing."""
    length: Length = 60.0
    """The length to draw. Ours."""
    tubing: Words = "Braintree RPT040"
    """The tubing to order (paper, Sec. 2.1)."""
    chamber: Words = "chamber1"
    """The chamber whose inlet it goes into, at an inlet."""

    _is_hollow = model_validator(mode="after")(_with_a_wall)


class Base(Fixed):
    """A flat base for other parts."""

    kind: Literal["base", "sheet"]
    """A flat piece."""
    width: Length
    """Along x."""
    length: Length
    """Along y."""
    thickness: Length
    """Its height."""
    material: Words
    """Printed on the traveller."""


AnyPart = Sba | Tube | Magnet | Cup | Line | Base


def girth_and_height(part: AnyPart) -> tuple[float, float]:
    """Return the diameter of the smallest round hole that a purchased part passes, and its size
    along its own axis, mm.
    """
    match part:
        case Tube() | Line():
            return part.outer_diameter, part.length
        case Magnet():
            return part.diameter, part.thickness
        case Cup():
            return part.diameter, part.height
        case Base():
            short, middle, _ = sorted((part.width, part.length, part.thickness))
            return float((short**2 + middle**2) ** 0.5), part.thickness
    raise TypeError("a part made from a design has its size")


KINDS: dict[str, type[AnyPart]] = {
    "sba": Sba,
    "tube": Tube,
    "magnet": Magnet,
    "cup": Cup,
    "line": Line,
    "base": Base,
    "sheet": Base,
}


class Deploy(Section):
    """The passages that the assembly must fit; none by default."""

    aperture_diameter: Length | None = None
    """It must pass this hole, folded (paper, Sec. 5: 9.25)."""
    lumen_diameter: Length | None = None
    """It must pass this lumen deflated and hold in it inflated (paper, Sec. 5: 25.4)."""


def _waivable() -> tuple[str, ...]:
    return (*catalogue.names("assemblies"), *rule_names())


class AssemblyRules(Section):
    """Limits of the checks between parts, and waived checks and rules."""

    line_clearance: LengthOrZero = 0.1
    """Lumen less line, in diameter, at least (the paper gives none)."""
    tube_tolerance: LengthOrZero = 0.05
    """Largest difference between a radial design's tube and the tube it is wrapped round (ours)."""
    seat_share: float = Field(default=0.25, ge=0, le=1)
    """Least share of the smaller of two glued faces that lies on the other (ours)."""
    waive: tuple[Annotated[str, *name_of(_waivable)], ...] = Field(default=(), strict=False)
    """Checks and rules whose failure shall not stop the cut files; sheets, traveller and manifest
    then say so."""


class Assembly(Section):
    """An assembly: a tree of parts with one root.

    ``kit``, ``sheets``, ``laser`` and ``press``, if given, apply to every part's design.
    """

    name: str = Field(pattern=NAME_PATTERN)
    """Names the output folder."""
    family: Literal["assembly"] = "assembly"
    """That this is an assembly."""
    pose: Literal["upright", "lying"] = "upright"
    """Pose in pictures and the solid: the root's axis upright, or lying (angle 0 is down)."""
    parts: Annotated[
        dict[PartName, Annotated[AnyPart, Field(discriminator="kind")]],
        Field(min_length=1, max_length=60),
    ]
    """The parts by name; each but the root names what it is fixed on."""
    deploy: Deploy = Deploy.model_construct()
    rules: AssemblyRules = AssemblyRules.model_construct()
    order: OrderSection = OrderSection.model_construct()
    kit: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    """The kit for all parts' designs, overriding theirs: a kit's name, or a file beside this."""
    sheets: Sheets | None = None
    """Sheets for all parts' designs, which override theirs."""
    laser: Laser | None = None
    """The laser for all parts' designs."""
    press: Press | None = None
    """The press for all parts' designs."""

    _folder: Path = PrivateAttr(default=Path())

    @field_validator("order")
    @classmethod
    def _counts_wholes(cls, order: OrderSection) -> OrderSection:
        if order.good is not None:
            raise ValueError(
                "has good, which counts the actuators of one design; use order.copies for an "
                "assembly"
            )
        return order

    @property
    def folder(self) -> Path:
        """The base of relative paths of part designs: the folder of the assembly's file."""
        return self._folder

    def placed(self, folder: Path) -> Self:
        """Return the assembly with relative paths based on ``folder``."""
        copy = self.model_copy()
        copy._folder = folder
        return copy

    @property
    def shared(self) -> dict[str, Any]:
        """The keys that the assembly sets for every part's design."""
        sections = {"sheets": self.sheets, "laser": self.laser, "press": self.press}
        kit = {} if self.kit is None else {"kit": self.kit}
        return kit | {
            name: section.model_dump(exclude_unset=True)
            for name, section in sections.items()
            if section is not None
        }
