"""Lobed actuators: N chambers around a lumen; the paper's 3-DoF actuator has N = 3 (Sec. 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, Self

from pydantic import Field

from sbafab.actuators import Family
from sbafab.actuators.ears import film_setback, reach
from sbafab.actuators.fitted_size import Fits, fitted
from sbafab.actuators.stacking import (
    Footprint,
    RoundChamber,
    build_footprint,
    free_of_round,
    pocket_shapes,
    round_pockets,
)
from sbafab.design.records import Design, Form, Free, card, degrees_of_freedom
from sbafab.design.toml_table import Section
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.region import Region, disc
from sbafab.laminate.laminate import Laminate

ROUNDING = 1e-9


class LobedChamber(RoundChamber):
    """Round chambers on a circle about the lumen, or drawn chambers."""

    count: int = Field(default=3, ge=2, le=8)
    """Chambers round the lumen."""
    axis_radius: Length | None = None
    """Distance of the chamber axes from the lumen's; by default the least that the bonds allow."""


class Lumen(Section):
    """The open channel in the middle."""

    diameter: Length = 2.0
    """The central channel, open in every layer."""
    pin_diameter: Length | None = None
    """Its dowel pin; by default the lumen's diameter: films stretch over it (rule pin-fit)."""

    @property
    def pin(self) -> float:
        """The diameter of the lumen's dowel pin."""
        return self.diameter if self.pin_diameter is None else self.pin_diameter


class LobedDesign(Design):
    """Two to eight parallel chambers around a central lumen."""

    model_config = card(
        "Lobed",
        "M27.4 20a8 8 0 1 0 16 0 8 8 0 1 0-16 0Z"
        "M14.8 12.7a8 8 0 1 0 16 0 8 8 0 1 0-16 0Z"
        "M14.8 27.3a8 8 0 1 0 16 0 8 8 0 1 0-16 0Z",
    )

    family: Literal["lobed"]
    """Kind of actuator."""
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
    """Return the distance of the chamber axes from the lumen's axis, and a note if it was
    increased.

    One bond width lies between lumen and pockets, and between neighbouring pockets; each pocket
    stays within its own sector. Raises DesignError if the given radius is too small.
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
    radius = design.chamber.axis_radius
    if radius is not None:
        if radius < least - ROUNDING:
            obstacle = "the lumen" if by_lumen >= by_neighbour else "each other"
            raise DesignError(
                f"chamber.axis_radius = {radius:g} brings the chambers nearer than bond.width = "
                f"{bond:g} to {obstacle}; it must be at least {least:.4f}"
            )
        return radius, None
    if by_neighbour > by_lumen + ROUNDING:
        return by_neighbour, (
            f"axis radius raised from {by_lumen:.3f} to {by_neighbour:.3f} mm so that "
            f"{bond:g} mm of bond separate neighbouring chambers"
        )
    return by_lumen, None


def footprint(design: LobedDesign) -> Footprint:
    """Return lobes on a circle, joined by a hub around the lumen."""
    pockets, shape_of = pocket_shapes(design, design.chamber)
    radius, note = axis_radius(design, pockets)
    count = design.chamber.count
    angles = [360 * i / count for i in range(count)]
    directions = [unit(angle) for angle in angles]
    axes = tuple((radius * x, radius * y) for x, y in directions)
    return Footprint(
        pockets=[[p.moved(radius, 0.0).turned(angle) for angle in angles] for p in pockets],
        shape_of=shape_of,
        axes=axes,
        directions=directions,
        edge=pockets[shape_of[0]].bounds[2] + design.bond.width,
        ears=_ears(axes),
        hub=disc((0.0, 0.0), _hub_radius(design, pockets, radius)),
        lumen=design.lumen.diameter,
        lumen_pin=design.lumen.pin,
        notes=(note,) if note else (),
    )


def build(design: LobedDesign) -> Laminate:
    """Return the laminate of a lobed design. Raises DesignError if parts do not fit."""
    return build_footprint(design, footprint(design))


def _hub_radius(design: LobedDesign, pockets: list[Region], axis: float) -> float:
    """Return the hub radius: one bond around the lumen, or more to join chambers that are farther
    out.

    The hub then reaches every pocket's inner edge, and the midpoint between two neighbours.
    """
    inward = min(-pocket.bounds[0] for pocket in pockets)
    return max(
        design.lumen.diameter / 2 + film_setback(design) + design.bond.width,
        axis - inward,
        axis * math.cos(math.pi / design.chamber.count),
    )


def _ears(axes: Sequence[Point]) -> list[tuple[Point, float]]:
    """Return start and angle of two film and two mask ears between the inlet tabs.

    Up to four lobes have them on their flanks, 60 degrees from the tab; more lobes leave too little
    room there, so the ears are midway between two lobes.
    """
    step = 360 / len(axes)
    if len(axes) > 4:
        return [((0.0, 0.0), step * (k + 0.5)) for k in (0, 2, 1, 3)]
    return [
        (axes[0], 60.0),
        (axes[1], step + 60.0),
        (axes[0], -60.0),
        (axes[-1], -step - 60.0),
    ]


FAMILY = Family(LobedDesign, build)
