"""Pockets of discs or of a drawn outline, tapered or not, and their inlet strips and tabs."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from sbafab.actuators.ears import film_setback
from sbafab.design.form import Discs, Drawn, Free
from sbafab.design.records import Chamber, Design
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, strip
from sbafab.laminate.laminate import Inlet

MOST_SIZES = 40
"""Different pockets in a stack: twice the balloons that have been built (paper Sec. 6)."""


class RoundChamber(Chamber):
    """The chamber of a family whose pockets are discs, or one drawn outline."""

    diameter: Length | Annotated[tuple[Length, ...], Field(strict=False, min_length=1)] = 5.0
    """Pocket diameter; a list gives one a balloon, bottom to top (a tapered stack)."""


def free_diameter(chamber: RoundChamber) -> tuple[Free, ...]:
    """A search may change the diameter that all balloons share, or the largest of a list."""
    if chamber.outline is not None:
        return ()
    return (Free("chamber.diameter", 2.6, 16.0, 0.1, widens=True),)


def free_of_round(chamber: RoundChamber, others: tuple[Free, ...]) -> tuple[Free, ...]:
    """Its diameter and the ``others``; a list of diameters settles how many balloons there are."""
    is_list = chamber.outline is None and not isinstance(chamber.diameter, float)
    settled = ("stack.balloons",) if is_list else ()
    return (*free_diameter(chamber), *(one for one in others if one.key not in settled))


def diameters(design: Design, chamber: RoundChamber) -> tuple[float, ...]:
    """The pocket diameter of every balloon, bottom to top."""
    if isinstance(chamber.diameter, float):
        return (chamber.diameter,) * design.stack.balloons
    if len(chamber.diameter) != design.stack.balloons:
        raise DesignError(
            f"chamber.diameter lists {len(chamber.diameter)} balloons but stack.balloons = "
            f"{design.stack.balloons}; give one diameter a balloon, bottom to top"
        )
    return chamber.diameter


def round_pockets(design: Design, chamber: RoundChamber) -> Discs | Drawn:
    """The form of these pockets."""
    return Drawn() if chamber.outline is not None else Discs(diameters(design, chamber))


def drawn_pocket(design: Design) -> Region | None:
    """The pocket that the user drew, if any. Raises DesignError for what cannot be read."""
    if design.drawing is None:
        return None
    from sbafab.design.outline import read_outline

    return read_outline(design.drawing)


def pocket_shapes(design: Design, chamber: RoundChamber) -> tuple[list[Region], tuple[int, ...]]:
    """The distinct pockets round (0, 0), and the index of each balloon's own."""
    if chamber.outline is not None and not isinstance(chamber.diameter, float):
        raise DesignError(
            "chamber.outline and a list in chamber.diameter exclude each other; remove one"
        )
    drawn = drawn_pocket(design)
    if drawn is not None:
        return [drawn], (0,) * design.stack.balloons
    sizes = diameters(design, chamber)
    distinct = list(dict.fromkeys(sizes))
    if len(distinct) > MOST_SIZES:
        raise DesignError(
            f"chamber.diameter lists {len(distinct)} different diameters, where at most "
            f"{MOST_SIZES} are allowed; let neighbouring balloons share one"
        )
    return (
        [disc((0.0, 0.0), size / 2) for size in distinct],
        tuple(distinct.index(size) for size in sizes),
    )


def check_neck(design: Design, pockets: list[Region], centres: list[Point]) -> None:
    """Raises DesignError where bore and neck ring leave no free film in the smallest pocket."""
    if design.stack.balloons == 1:
        return
    ring = design.bore.diameter / 2 + film_setback(design) + design.bond.width
    room = min(pocket.distance_to_edge(centre) for pocket in pockets for centre in centres)
    if ring >= room:
        largest = design.bore.diameter - 2 * (ring - room)
        remedy = f"make the bore less than {largest:.3f}" if largest > 0 else "widen the pocket"
        raise DesignError(
            f"bore.diameter = {design.bore.diameter:g} with a neck ring of bond.width = "
            f"{design.bond.width:g} round it (outer radius {ring:.3f}) does not fit a pocket that "
            f"leaves {room:.3f} round the channel; {remedy}"
        )


def reach(region: Region, direction: Point) -> float:
    """How far the region extends from (0, 0) along a unit direction."""
    turn = -math.degrees(math.atan2(direction[1], direction[0]))
    return region.turned(turn).bounds[2]


def tab_and_strip(
    design: Design, chamber: str, pocket: Region, start: Point, direction: Point, edge: float
) -> tuple[Region, Region, Inlet]:
    """Inlet tab, mask strip and inlet of a chamber.

    The strip starts at ``start`` inside the pocket and runs along ``direction``; the outline ends
    ``edge`` mm from there. The strip reaches one overhang past the tab's end. Raises DesignError
    where the strip is wider than the pocket.
    """
    width = design.strip_width
    for side in (1, -1):
        corner = (
            start[0] - side * direction[1] * width / 2,
            start[1] + side * direction[0] * width / 2,
        )
        if not pocket.contains(corner):
            raise DesignError(
                f"inlet.width = {width:g} is wider than the pocket of {chamber} where the strip "
                "leaves it; make inlet.width smaller or the chamber larger"
            )
    length = edge + design.inlet.tab_length

    def along(distance: float) -> Point:
        return start[0] + direction[0] * distance, start[1] + direction[1] * distance

    tab = strip(start, along(length), width + 2 * design.bond.width)
    mask = strip(start, along(length + design.mask.overhang), width)
    inlet = Inlet(
        chamber,
        along(length),
        direction,
        width,
        design.inlet.tab_length,
        design.inlet.tube_outer_diameter,
    )
    return tab, mask, inlet


def bonded(pockets: Region, width: float) -> Region:
    """The outline of pockets with a bonded ring round them; filled inside."""
    return Region(grow(pockets, width).outers)
