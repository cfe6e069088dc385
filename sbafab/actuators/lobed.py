"""Lobed actuators: N chambers round a lumen; the paper's 3-DoF actuator is N = 3 (Sec. 2)."""

from __future__ import annotations

import math
from typing import Literal, Self

from pydantic import Field

from sbafab.actuators.ears import NOTE, Ear, Holder, Ray, film_setback, placed, tails
from sbafab.actuators.fits import Fits, fitted
from sbafab.actuators.panel import on_panel, roots, with_stubs
from sbafab.actuators.stacking import (
    BalloonShape,
    BalloonStack,
    RoundChamber,
    balloon_cuts,
    bonded,
    channel_pin,
    check_neck,
    free_of_round,
    layers,
    pocket_shapes,
    reach,
    round_pockets,
    tab_and_strip,
)
from sbafab.design.records import Design, Form, Free, degrees_of_freedom
from sbafab.design.section import Section
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.nearby import boxes_meet
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, disc, union
from sbafab.laminate.laminate import Bore, Chamber, Inlet, Laminate, Pin

ROUNDING = 1e-9


class LobedChamber(RoundChamber):
    """Round chambers in a circle about the lumen, or drawn ones."""

    count: int = Field(default=3, ge=2, le=8)
    """Chambers round the lumen."""
    axis_radius: Length | None = None
    """Distance of the chamber axes from the lumen's; by default as near as the bonds allow."""


class Lumen(Section):
    """The open channel in the middle."""

    diameter: Length = 2.0
    """The central channel, open in every layer."""
    pin_diameter: Length | None = None
    """Its dowel pin; by default the lumen's diameter: films stretch over it (rule pin-fit)."""

    @property
    def pin(self) -> float:
        """Diameter of the lumen's dowel pin."""
        return self.diameter if self.pin_diameter is None else self.pin_diameter


class LobedDesign(Design):
    """Two to eight chambers in parallel round a central lumen."""

    family: Literal["lobed"]
    """Which kind of actuator this is."""
    chamber: LobedChamber = LobedChamber.model_construct()
    fits: Fits = Fits.model_construct()
    lumen: Lumen = Lumen.model_construct()

    @property
    def form(self) -> Form:
        pockets, count = round_pockets(self, self.chamber), self.chamber.count
        lumen = self.lumen
        words = degrees_of_freedom(count)
        return Form(words, count, pockets, lumen=lumen.diameter, lumen_pin=lumen.pin)

    @property
    def thickest_pin(self) -> float:
        return max(super().thickest_pin, self.lumen.pin)

    @property
    def free(self) -> tuple[Free, ...]:
        lumen = Free("lumen.diameter", 1.0, 10.0, 0.1, asked="lumen", widens=True)
        return free_of_round(self.chamber, (lumen, *super().free))

    def fitted(self) -> Self:
        return fitted(self, self.fits, build)


def axis_radius(design: LobedDesign, pockets: list[Region]) -> tuple[float, str | None]:
    """Distance of the chamber axes from the lumen's axis, and a note where it was raised.

    One bond width lies between lumen and pockets, and between neighbouring pockets, each of
    which is kept within its own sector. Raises DesignError if a radius asked for is too small.
    """
    half = math.pi / design.chamber.count
    bond = design.bond.width
    inward = max(-pocket.bounds[0] for pocket in pockets)
    by_lumen = design.lumen.diameter / 2 + film_setback(design) + bond + inward
    # For a pocket point (x, y) off the axis the sector's edge is b/2 away when
    # (R + x) sin(half) - |y| cos(half) = b/2; the farthest point rules. Exact for a disc.
    spread = max(
        reach(pocket, (-math.sin(half), sign * math.cos(half)))
        for pocket in pockets
        for sign in (1, -1)
    )
    by_neighbour = (bond / 2 + spread) / math.sin(half)
    least = max(by_lumen, by_neighbour)
    asked = design.chamber.axis_radius
    if asked is not None:
        if asked < least - ROUNDING:
            other = "the lumen" if by_lumen >= by_neighbour else "each other"
            raise DesignError(
                f"chamber.axis_radius = {asked:g} brings the chambers nearer than bond.width = "
                f"{bond:g} to {other}; it must be at least {least:.4f}"
            )
        return asked, None
    if by_neighbour > by_lumen + ROUNDING:
        return by_neighbour, (
            f"axis radius raised from {by_lumen:.3f} to {by_neighbour:.3f} mm so that "
            f"{bond:g} mm of bond separate neighbouring chambers"
        )
    return by_lumen, None


def build(design: LobedDesign) -> Laminate:
    """The laminate of a lobed design. Raises DesignError where parts do not fit."""
    pockets, shape_of = pocket_shapes(design, design.chamber)
    check_neck(design, pockets, [(0.0, 0.0)])
    radius, note = axis_radius(design, pockets)
    count = design.chamber.count
    angles = [360 * i / count for i in range(count)]
    directions = [unit(angle) for angle in angles]
    axes = tuple((radius * x, radius * y) for x, y in directions)
    names = [f"chamber{i + 1}" for i in range(count)]

    hub = disc((0.0, 0.0), _hub_radius(design, pockets, radius))
    lobes = [[p.moved(radius, 0.0).turned(angle) for angle in angles] for p in pockets]
    shapes = tuple(_plate(design, hub, lobe) for lobe in lobes)

    first = lobes[shape_of[0]]
    outlines = [bonded(pocket, design.bond.width) for pocket in first]
    edge = pockets[shape_of[0]].bounds[2] + design.bond.width
    inlets = [
        tab_and_strip(design, name, pocket, axis, direction, edge)
        for name, pocket, axis, direction in zip(names, first, axes, directions, strict=True)
    ]
    _check_tabs(design, outlines, inlets)
    bottom = BalloonShape(
        fillet(union([hub, *outlines, *(tab for tab, _, _ in inlets)]), design.fillet.radius),
        union([*first, *(strip for _, strip, _ in inlets)]),
        1,
        count,
    )
    plates = union(shape.outline for shape in shapes)
    held_by = roots(design, shapes, bottom.outline, [inlet for _, _, inlet in inlets])
    bottom, shapes = with_stubs(bottom, held_by), tuple(with_stubs(s, held_by) for s in shapes)
    # Nothing but ears and tails asks for both together.
    body = bottom.outline | plates if design.registration.method == "ears" else plates
    ears = _ears(design, body, plates, axes)
    held = tails([inlet for _, _, inlet in inlets], body, ears, design)
    stack = BalloonStack(bottom, shapes, shape_of, axes, design.lumen.diameter, ears, held)
    has_bores = design.stack.balloons > 1
    bore = design.bore.diameter
    pins = [
        channel_pin(n, axis, design.bore) for n, axis in zip(names, axes, strict=True) if has_bores
    ]
    lumen_pin = Pin("lumen", (0.0, 0.0), design.lumen.pin, design.lumen.diameter - design.lumen.pin)
    laminate = Laminate(
        name=design.name,
        family=design.family,
        layers=layers(balloon_cuts(stack, design), design),
        chambers=tuple(Chamber(n, (axis,)) for n, axis in zip(names, axes, strict=True)),
        bores=tuple(Bore(n, axis, bore) for n, axis in zip(names, axes, strict=True))
        if has_bores
        else (),
        inlets=tuple(inlet for _, _, inlet in inlets),
        pins=(*pins, *(ear.pin for ear in ears), *(pin for tail in held for pin in tail.pins))
        if ears
        else (*pins, lumen_pin),
        lumen=design.lumen.diameter,
        balloons=design.stack.balloons,
        registration=design.registration.method,
        pins_in_full_bonds=design.registration.full_bond_pins == "in",
        notes=(*((note,) if note else ()), *((NOTE,) if ears else ())),
        outline=plates,
    )
    return on_panel(laminate, held_by, design)


def _hub_radius(design: LobedDesign, pockets: list[Region], axis: float) -> float:
    """One bond round the lumen; more where the chambers stand farther out, to stay one piece.

    The hub then reaches every pocket's inner edge, and the middle between two neighbours.
    """
    inward = min(-pocket.bounds[0] for pocket in pockets)
    return max(
        design.lumen.diameter / 2 + film_setback(design) + design.bond.width,
        axis - inward,
        axis * math.cos(math.pi / design.chamber.count),
    )


def _plate(design: LobedDesign, hub: Region, pockets: list[Region]) -> BalloonShape:
    lobes = [bonded(pocket, design.bond.width) for pocket in pockets]
    outline = fillet(union([hub, *lobes]), design.fillet.radius)
    return BalloonShape(Region(outline.outers), union(pockets), 1, len(pockets))


def _check_tabs(
    design: LobedDesign, outlines: list[Region], inlets: list[tuple[Region, Region, Inlet]]
) -> None:
    """Raises DesignError where a tab comes nearer than one overhang to another lobe or tab."""
    room = design.mask.overhang
    for i, (tab, _, inlet) in enumerate(inlets):
        aside = [
            j
            for j, other in enumerate(outlines)
            if j != i
            and not all(_lies_ahead(tab, one, inlet, room) for one in (other, inlets[j][0]))
        ]
        if not aside:
            continue
        free = grow(tab - outlines[i], room)
        for j in aside:
            if _overlap(free, outlines[j]) or _overlap(free, inlets[j][0]):
                raise DesignError(
                    f"the inlet tab of {inlet.chamber} ({inlet.width + 2 * design.bond.width:g} "
                    f"wide) meets the lobe or tab of {inlets[j][2].chamber}; make inlet.width "
                    "smaller, chamber.axis_radius larger or chamber.count smaller"
                )


def _lies_ahead(tab: Region, other: Region, inlet: Inlet, room: float) -> bool:
    """Whether all of a tab lies farther out along its inlet than another shape, and some room."""
    (x, y), centre = inlet.direction, (0.0, 0.0)
    nearest = -max(edge.farthest_along(centre, (-x, -y)) for edge in tab.edges)
    return nearest - max(edge.farthest_along(centre, (x, y)) for edge in other.edges) > room


def _overlap(a: Region, b: Region) -> bool:
    return boxes_meet(a.bounds, b.bounds) and not (a & b).is_empty


def _ears(
    design: LobedDesign, body: Region, plates: Region, axes: tuple[Point, ...]
) -> tuple[Ear, ...]:
    """Two film and two mask ears between the inlet tabs.

    Up to four lobes have them on their flanks, 60 degrees off the tab; more lobes leave too
    little room there, and the ears stand in the middle between two lobes.
    """
    if design.registration.method != "ears":
        return ()
    count = design.chamber.count
    step = 360 / count
    if count <= 4:
        places = [
            (axes[0], 60.0),
            (axes[1], step + 60.0),
            (axes[0], -60.0),
            (axes[-1], -step - 60.0),
        ]
    else:
        places = [((0.0, 0.0), step * (k + 0.5)) for k in (0, 2, 1, 3)]
    names: tuple[tuple[str, Holder], ...] = (
        ("film1", "film"),
        ("film2", "film"),
        ("mask1", "mask"),
        ("mask2", "mask"),
    )
    rays = [
        Ray(name, holder, start, unit(angle), name.endswith("2"))
        for (name, holder), (start, angle) in zip(names, places, strict=True)
        if holder == "film" or design.stack.balloons > 1
    ]
    return placed(rays, body, plates, design)
