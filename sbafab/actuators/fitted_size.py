"""Size round actuators by their envelope: the largest chamber that fits it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from functools import cache

from sbafab.design.records import AnyDesign, Design
from sbafab.design.toml_table import Section
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.laminate.laminate import (
    Laminate,
    beyond_the_outline,
    outline_diameter,
    overall_diameter,
)

STEP = 0.01
"""Chambers are solved in whole steps, mm."""
ROUNDING = 1e-6


class Fits(Section):
    """The envelope that the actuator must fit; without ``chamber.diameter`` the largest chamber
    that fits is used.
    """

    diameter: Length | None = None
    """The whole actuator with inlet tabs, tails and ears lies in a circle of this diameter round
    the axis."""
    outline: Length | None = None
    """Its films without tabs and ears lie in a circle of this diameter round the axis; the paper's
    3-DoF actuator fits 15."""


def fitted(design: AnyDesign, fits: Fits, build: Callable[[AnyDesign], Laminate]) -> AnyDesign:
    """Return the design with the largest chamber that fits, unless its chamber is given.

    Raises DesignError if no chamber fits.
    """
    chamber = design.chamber
    if fits == Fits() or chamber.outline or "diameter" in chamber.model_fields_set:
        return design

    @cache
    def plan(steps: int) -> Laminate | DesignError:
        # Balloons above the second do not change the plan view.
        few = design.stack.model_copy(update={"balloons": min(2, design.stack.balloons)})
        try:
            return build(_with_chamber(design, steps * STEP).model_copy(update={"stack": few}))
        except DesignError as error:
            return error

    def excess(steps: int) -> float:
        """Return the excess width of the design, mm; 0 for a chamber too small to build."""
        laminate = plan(steps)
        if isinstance(laminate, DesignError):
            return -math.inf
        return max(size - limit for _, limit, size in _sizes(fits, laminate))

    # An actuator is wider than its chamber, and one that is too small cannot be built.
    limits = fits.model_dump(exclude_none=True)
    most = int(min(limits.values()) / STEP) + 1
    steps = bisect_right(range(1, most + 1), ROUNDING, key=excess)
    largest = plan(max(steps, 1))
    if isinstance(largest, Laminate) and steps:
        return _with_chamber(design, round(steps * STEP, 6)).solved()
    smallest = plan(steps + 1)
    if isinstance(smallest, DesignError):
        raise smallest
    text = " and ".join(f"fits.{key} = {limit:g}" for key, limit in limits.items())
    raise DesignError(
        f"no chamber fits {text}: the smallest that can be built, chamber.diameter = "
        f"{(steps + 1) * STEP:.2f}, is {excess(steps + 1):.3f} mm too wide; {_room(fits, smallest)}"
    )


def refuse_unfit(design: Design, fits: Fits, laminate: Laminate) -> str | None:
    """A note on the size of a laminate that fits; None without limits. Raises DesignError."""
    over = beyond_the_outline(laminate)
    sizes = []
    for key, limit, size in _sizes(fits, laminate):
        scope = f"{'with' if key == 'diameter' else 'without'} {over}"
        if size > limit + ROUNDING:
            raise DesignError(
                f"{design.name} measures {size:.3f} mm across {scope}, and fits.{key} = "
                f"{limit:g}; omit chamber.diameter so that it is solved, or increase fits.{key} "
                f"to at least {size:.3f}"
            )
        sizes.append(f"{size:.3f} mm across {scope}, within fits.{key} = {limit:g}")
    return "; ".join(sizes) or None


def _sizes(fits: Fits, laminate: Laminate) -> list[tuple[str, float, float]]:
    """Return key, limit and size of the laminate, mm, for every limit that is set."""
    measures = {"diameter": overall_diameter, "outline": outline_diameter}
    limits = fits.model_dump(exclude_none=True)
    return [(key, limit, measures[key](laminate)) for key, limit in limits.items()]


def _with_chamber(design: AnyDesign, diameter: float) -> AnyDesign:
    chamber = design.chamber.model_copy(update={"diameter": diameter})
    return design.model_copy(update={"chamber": chamber})


def _room(fits: Fits, laminate: Laminate) -> str:
    """Return remedies that make room for a laminate; ``fits.outline`` excludes tabs."""
    also = {"diameter": " (or shorten inlet.tab_length)", "outline": ""}
    remedies = [
        f"fits.{key} at least {math.ceil((size - ROUNDING) * 1000) / 1000:.3f}{also[key]}"
        for key, limit, size in _sizes(fits, laminate)
        if size > limit + ROUNDING
    ]
    return f"make {' and '.join(remedies)}"
