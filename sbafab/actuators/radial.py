"""Radial expansion: oblong balloons side by side on a sheet that wraps a tube.

Laid flat for cutting, x runs around the tube and y along it (paper Sec. 2.1).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, Self

from pydantic import Field

from sbafab.actuators import Family
from sbafab.actuators.ears import (
    Ear,
    Ray,
    head_reach,
    placed,
    tails,
    with_film_ears,
    with_mask_ears,
    with_sheet_ears,
)
from sbafab.actuators.stacking import (
    BalloonShape,
    BalloonStack,
    CutFilm,
    bonded,
    check_neck,
    stacked,
    tab_and_strip,
)
from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Drawn, Form, Free, Slots, Wrap, card
from sbafab.design.sections import Chamber as ChamberSection
from sbafab.design.sections import Inlet, Stack
from sbafab.design.toml_table import Section
from sbafab.design.units import Length, LengthOrZero
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, rectangle, section, stadium, strip, union
from sbafab.laminate.laminate import Chamber, Laminate
from sbafab.laminate.laminate import Inlet as LaminateInlet


class OblongChamber(ChamberSection):
    """Oblong pockets, or one drawn outline."""

    count: int = Field(default=3, ge=1, le=12)
    """Oblong SBAs round the tube, at equal pitch."""
    width: Length = 11.5
    """Outline of one SBA round the tube, bonds included."""
    length: Length = 20.0
    """Outline of one SBA along the tube, bonds included."""


class Tube(Section):
    """The tube inside the wrapped sheet."""

    outer_diameter: Length = 15.0
    """The tube that the sheet is wrapped round."""
    glue: str = Field(default="3M 1587", min_length=1, max_length=120)
    """Adhesive that holds the sheet round its tube. The paper does not say; this is its adhesive
    between actuators and silicone tubes."""


class SheetSection(Section):
    """The sheet that carries the SBAs."""

    overlap: LengthOrZero = 0.0
    """Extra length at one end of the sheet, to close it round the tube."""
    margin: Length = 1.0
    """Sheet past the SBAs at both ends, along the tube (the paper gives none)."""


class Window(Section):
    """The bond between sheet and SBA."""

    width: Length | None = None
    """Bond between sheet and SBA, round the tube; by default two bond widths."""
    length: Length | None = None
    """Bond between sheet and SBA, along the tube; by default the pocket's straight run plus two
    bond widths."""


class RadialInlet(Inlet):
    """Tab, strip and tube, or one inlet for all SBAs."""

    manifold: bool = False
    """One shared inlet: the bottom pockets joined by strips."""


class RadialStack(Stack):
    """Number of balloons in each SBA."""

    balloons: int = Field(default=1, ge=1, le=1000)
    """Balloons in each SBA."""


class RadialDesign(Design):
    """Oblong SBAs bonded to one sheet that wraps a tube."""

    model_config = card(
        "On a tube",
        "M4 6h46v28H4Z"
        "M8 15a4.5 4.5 0 0 1 9 0v10a4.5 4.5 0 0 1-9 0Z"
        "M22.5 15a4.5 4.5 0 0 1 9 0v10a4.5 4.5 0 0 1-9 0Z"
        "M37 15a4.5 4.5 0 0 1 9 0v10a4.5 4.5 0 0 1-9 0Z",
    )

    family: Literal["radial"]
    """Kind of actuator."""
    stack: RadialStack = RadialStack.model_construct()
    inlet: RadialInlet = RadialInlet.model_construct()
    chamber: OblongChamber = OblongChamber.model_construct()
    tube: Tube = Tube.model_construct()
    sheet: SheetSection = SheetSection.model_construct()
    window: Window = Window.model_construct()

    @property
    def pitch(self) -> float:
        """The distance between neighbouring SBAs around the tube."""
        return math.pi * self.tube.outer_diameter / self.chamber.count

    @property
    def pocket(self) -> tuple[float, float]:
        """The width around the tube and the length along it of an oblong pocket."""
        bonds = 2 * self.bond.width
        return self.chamber.width - bonds, self.chamber.length - bonds

    @property
    def form(self) -> Form:
        drawn = self.chamber.outline is not None
        width, length = sorted(self.pocket)
        pockets = Drawn() if drawn else Slots(width, length - width)
        tube, sheet = self.tube.model_dump(), self.sheet
        wrap = Wrap.model_construct(**tube, pitch=self.pitch, overlap=sheet.overlap)
        words = "radial expansion stacked balloon actuator"
        return Form(words, self.chamber.count, pockets, wrap=wrap)

    @property
    def free(self) -> tuple[Free, ...]:
        if self.chamber.outline is not None:
            return ()
        width = Free("chamber.width", 5.0, 20.0, 0.5, widens=True)
        length = Free("chamber.length", 8.0, 60.0, 0.5, widens=True)
        return (width, length, Free("stack.balloons", 1, 3, 1), *super().free[1:])

    def completed(self) -> Self:
        """Return the design with inlet and window sizes filled in."""
        completed = super().completed()
        if self.chamber.outline is not None:
            return completed
        width, length = _window_size(self, _pocket(self))
        window = Window(width=width, length=length)
        return completed.model_copy(update={"window": window})


def build(design: RadialDesign) -> Laminate:
    """Return the flat laminate of a radial design. Raises DesignError if parts do not fit."""
    bond, overhang = design.bond.width, design.mask.overhang
    pocket = _pocket(design)
    check_neck(design, [pocket])
    outline = bonded(pocket, bond)
    count = design.chamber.count
    centres = tuple(((i - (count - 1) / 2) * design.pitch, 0.0) for i in range(count))
    _check_pitch(design, outline)

    outlines = union(outline.moved(*centre) for centre in centres)
    pockets = union(pocket.moved(*centre) for centre in centres)
    shape = BalloonShape(outlines, pockets, count, count)
    bottom, inlets = _bottom(design, shape, outline, centres)
    sheet = _sheet(design, outline)
    ears = _ears(design, bottom, sheet, outline, centres)
    inlet_tails = tails(inlets, bottom.outline, ears, design, sheet)
    stack = BalloonStack(
        bottom, (shape,), (0,) * design.stack.balloons, centres, ears=ears, tails=inlet_tails
    )
    window = _window(design, pocket, outline)
    windows = union(window.moved(*centre) for centre in centres)
    fillet_radius = design.fillet.radius
    eared = with_film_ears(bottom.outline, ears, fillet_radius)
    carrier_mask = with_mask_ears(grow(eared, overhang), ears, overhang) - windows
    carrier = [
        CutFilm("sheet", with_sheet_ears(sheet, ears, fillet_radius), None, 1),
        CutFilm("separator-mask", carrier_mask, None, bottom.outline_pieces),
    ]
    parts = [centres] if design.inlet.manifold else [(centre,) for centre in centres]
    chambers = [Chamber(f"chamber{number}", part) for number, part in enumerate(parts, start=1)]
    laminate = stacked(design, stack, chambers, inlets, carrier, "channel")
    return replace(laminate, tube=design.tube.outer_diameter)


def _slot(width: float, length: float) -> Region:
    """Return a slot with round ends, along its longer side."""
    slot = stadium((0.0, 0.0), min(width, length), max(width, length))
    return slot if width <= length else slot.turned(90)


def _pocket(design: RadialDesign) -> Region:
    if design.drawing is not None:
        return read_outline(design.drawing)
    width, length = design.pocket
    if min(width, length) <= 0:
        raise DesignError(
            f"chamber.width = {design.chamber.width:g} and chamber.length = "
            f"{design.chamber.length:g} must both exceed two bond widths, "
            f"{2 * design.bond.width:g}"
        )
    return _slot(width, length)


def _check_pitch(design: RadialDesign, outline: Region) -> None:
    low_x, _, high_x, _ = outline.bounds
    needed = high_x - low_x + 2 * design.mask.overhang + design.laser.least_feature
    if design.chamber.count > 1 and design.pitch < needed:
        raise DesignError(
            f"chamber.count = {design.chamber.count} SBAs {high_x - low_x:g} wide do not fit "
            f"around tube.outer_diameter = {design.tube.outer_diameter:g}: the pitch is "
            f"{design.pitch:.3f} and must be at least {needed:.3f}; use fewer or narrower SBAs, "
            "or a thicker tube"
        )


def _window_size(design: RadialDesign, pocket: Region) -> tuple[float, float]:
    low_x, low_y, high_x, high_y = pocket.bounds
    straight = max(0.0, (high_y - low_y) - (high_x - low_x))
    width = design.window.width or 2 * design.bond.width
    return width, design.window.length or round(straight + 2 * design.bond.width, 6)


def _window(design: RadialDesign, pocket: Region, outline: Region) -> Region:
    width, length = _window_size(design, pocket)
    window = _slot(width, length)
    if not (window - outline).is_empty:
        raise DesignError(
            f"window.width = {width:g} and window.length = {length:g} exceed the outline of the "
            "SBA; reduce them"
        )
    return window


def _sheet(design: RadialDesign, outline: Region) -> Region:
    half = math.pi * design.tube.outer_diameter / 2
    _, low_y, _, high_y = outline.bounds
    margin = design.sheet.margin
    return rectangle((-half, low_y - margin), (half + design.sheet.overlap, high_y + margin))


def _bottom(
    design: RadialDesign, shape: BalloonShape, outline: Region, centres: tuple[Point, ...]
) -> tuple[BalloonShape, tuple[LaminateInlet, ...]]:
    """The bottom balloons with tabs, strips and, for a manifold, the bridges between them."""
    count, manifold = len(centres), design.inlet.manifold
    fed = [centres[(count - 1) // 2]] if manifold else centres
    feeds = [
        tab_and_strip(
            design, f"chamber{number}", shape.pockets, centre, (0.0, 1.0), outline.bounds[3]
        )
        for number, centre in enumerate(fed, start=1)
    ]
    tabs = [tab for tab, _, _ in feeds]
    strips = [mask for _, mask, _ in feeds]
    if manifold and count > 1:
        width = design.strip_width
        tabs.append(strip(centres[0], centres[-1], width + 2 * design.bond.width))
        strips.append(strip(centres[0], centres[-1], width))
    if manifold:
        bottom = fillet(union([shape.outline, *tabs]), design.fillet.radius)
    else:
        # One by one: a joint fillet would also fill narrow gaps between neighbours.
        bottom = union(
            fillet(outline.moved(*centre) | tab, design.fillet.radius)
            for centre, tab in zip(centres, tabs, strict=True)
        )
    pieces = 1 if manifold else count
    return (
        BalloonShape(bottom, union([shape.pockets, *strips]), pieces, pieces),
        tuple(inlet for _, _, inlet in feeds),
    )


def _ears(
    design: RadialDesign,
    bottom: BalloonShape,
    sheet: Region,
    outline: Region,
    centres: tuple[Point, ...],
) -> tuple[Ear, ...]:
    """Return two film ears at the lower end of each SBA, two mask ears beside its tab, and two of
    the sheet.

    A manifold joins all SBAs into one part in the bottom balloon, but not above it.
    """
    if design.registration.method != "ears":
        return ()
    low_x, low_y, high_x, high_y = sheet.bounds
    feet = _Feet(design, outline)
    films, masks = feet.of_films(), feet.of_masks()
    rays = []
    for number, (x, _) in enumerate(centres, start=1):
        for end, film, (mask, joint) in zip((1, 2), films, masks, strict=True):
            foot, start = (x + film[0], film[1]), (x + mask[0], mask[1])
            joined = joint and (x + joint[0], joint[1])
            rays += [
                Ray(f"film{number}.{end}", "film", foot, (0.0, -1.0), end == 2),
                Ray(f"mask{number}.{end}", "mask", start, (0.0, 1.0), end == 2, joined),
            ]
    middle, off = (low_y + high_y) / 2, (high_y - low_y) / 6
    rays += [
        Ray("sheet1", "sheet", (high_x - 1.0, middle + off), (1.0, 0.0), False),
        Ray("sheet2", "sheet", (low_x + 1.0, middle), (-1.0, 0.0), True),
    ]
    return placed(rays, bottom.outline | sheet, bottom.outline, design)


STEP = 0.25
"""Step between positions tried along an outline, mm."""


class _Feet:
    """Starts of ears on an outline of any shape: two below, and two above beside its tab.

    The tab is on the upper side at x = 0. A ``side`` is 1 above, -1 below.
    """

    def __init__(self, design: RadialDesign, outline: Region) -> None:
        self.outline, self.bond, self.overhang = outline, design.bond.width, design.mask.overhang
        self.half = design.registration.hole_diameter / 2 + self.bond
        """Half the width of an ear."""
        self.apart = self.half + design.fillet.radius + self.overhang / 2
        """Half the distance of two film ears: the fillets beside both, plus a margin."""
        self.tab = max(design.strip_width / 2 + self.bond, head_reach(design))
        """Reach of the tab and its tail's head to either side."""

    def of_films(self) -> tuple[Point, Point]:
        """Return starts of two film ears, a quarter of the width beside the outline's middle.

        Raises DesignError if the outline has no room for both.
        """
        low_x, _, high_x, _ = self.outline.bounds
        middle = round((low_x + high_x) / 2, 6)
        beside = max(round((high_x - low_x) / 4, 6), self.apart)
        first = self._nearest(middle - beside, -1)
        second = first and self._nearest(middle + beside, -1, first[0])
        if first is None or second is None:
            raise self._no_room(2 * self.apart + self.bond)
        return first, second

    def of_masks(self) -> list[tuple[Point, Point | None]]:
        """Return starts of two mask ears, clear of the tab and the head of its tail.

        Each comes with the point of the outline to which it is joined, if it starts beside it.
        """
        beside = self.tab + 2 * self.overhang + self.half
        feet: list[tuple[Point, Point | None]] = []
        for x in (-beside, beside):
            # A mask reaches past the outline: an ear may be half beside it.
            inner = x - math.copysign(self.half - self.bond, x)
            start = self._foot(x, 1) or self._foot(inner, 1)
            joint = None if start else self._nearest(x, 1)
            start = start or joint
            if start is None:
                raise self._no_room(self.bond)
            feet.append(((x, start[1]), joint))
        return feet

    def _no_room(self, width: float) -> DesignError:
        return DesignError(
            f"the outline of an SBA has no room for ears, which take {width:.3f} mm of its width; "
            "make the chamber wider or registration.pin_diameter smaller, or use "
            'registration.method = "channel-pin"'
        )

    def _foot(self, x: float, side: int) -> Point | None:
        """A point of the outermost stretch of the outline at ``x``; None if that is too short."""
        stretches = section(self.outline, (x, 0.0), (0.0, float(side)))
        if not stretches or stretches[-1][1] - stretches[-1][0] < self.bond:
            return None
        start, end = stretches[-1]
        return x, side * (end - min((end - start) / 2, 2 * self.half))

    def _nearest(self, preferred: float, side: int, clear_of: float | None = None) -> Point | None:
        """Return the foot nearest to ``preferred`` with no other part of the outline ahead, or with
        the least ahead.

        ``clear_of`` is the x of another ear.
        """
        low_x, _, high_x, _ = self.outline.bounds
        reach = max(high_x, preferred) - min(low_x, preferred)
        steps = [STEP * k for k in range(round(reach / STEP) + 1)]
        best: tuple[float, Point] | None = None
        for x in (preferred + sign * step for step in steps for sign in (1, -1)):
            if clear_of is not None and abs(x - clear_of) < 2 * self.apart - 1e-9:
                continue
            start = self._foot(x, side)
            if start is None:
                continue
            ahead = self._ahead(start, side)
            if ahead < 4 * self.half:
                return start
            if best is None or ahead < best[0]:
                best = ahead, start
        return best and best[1]

    def _ahead(self, start: Point, side: int) -> float:
        """Return the extent of the outline beyond ``start`` in the path of an ear, mm."""
        half = self.half + 2 * self.overhang
        _, low, _, high = self.outline.bounds
        band = self.outline & rectangle((start[0] - half, low - 1), (start[0] + half, high + 1))
        return band.bounds[3] - start[1] if side > 0 else start[1] - band.bounds[1]


FAMILY = Family(RadialDesign, build)
