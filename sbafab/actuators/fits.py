"""Size round actuators by their envelope: the largest chamber that fits it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

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
STARTS = (500, 800, 1200, 300, 2000, 3000)
"""Steps of diameters at which to start, until one of them can be built."""
ROUNDING = 1e-6


class Fits(Section):
    """Envelope that the actuator must fit; without ``chamber.diameter`` the largest chamber is
    chosen.
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
    diameter = _Search(design, fits, build).largest() * STEP
    return _with_chamber(design, round(diameter, 6)).solved()


def refuse_unfit(design: Design, fits: Fits, laminate: Laminate) -> str | None:
    """A note on the size of a laminate that fits; None without limits. Raises DesignError."""
    over = beyond_the_outline(laminate)
    sizes = []
    for key, limit, measure, scope in (
        ("diameter", fits.diameter, overall_diameter, f"with {over}"),
        ("outline", fits.outline, outline_diameter, f"without {over}"),
    ):
        if limit is None:
            continue
        size = measure(laminate)
        if size > limit + ROUNDING:
            raise DesignError(
                f"{design.name} measures {size:.3f} mm across {scope}, and fits.{key} = {limit:g}; "
                f"leave chamber.diameter out to have it solved, or make fits.{key} at least "
                f"{size:.3f}"
            )
        sizes.append(f"{size:.3f} mm across {scope}, within fits.{key} = {limit:g}")
    return "; ".join(sizes) or None


def _with_chamber(design: AnyDesign, diameter: float, balloons: int | None = None) -> AnyDesign:
    changes: dict[str, Any] = {"chamber": design.chamber.model_copy(update={"diameter": diameter})}
    if balloons is not None:
        changes["stack"] = design.stack.model_copy(update={"balloons": balloons})
    return design.model_copy(update=changes)


class _Search:
    """Search for the largest chamber, in steps of its diameter."""

    def __init__(self, design: Any, fits: Fits, build: Callable[[Any], Laminate]) -> None:
        self._design = design
        self._fits = fits
        self._build = build
        self._known: dict[int, float | None] = {}
        self._why = ""

    def over(self, steps: int) -> float | None:
        """Return the excess width of the design, mm; None if it cannot be built."""
        if steps not in self._known:
            try:
                laminate = self._laminate(steps)
            except DesignError as error:
                self._why = str(error)
                self._known[steps] = None
            else:
                self._known[steps] = self._excess(laminate)
        return self._known[steps]

    def _excess(self, laminate: Laminate) -> float:
        fits = self._fits
        limits = [(fits.diameter, overall_diameter), (fits.outline, outline_diameter)]
        return max(measured(laminate) - most for most, measured in limits if most is not None)

    def largest(self) -> int:
        """The most steps that fit. Raises DesignError if none do."""
        start = next((n for n in STARTS if self.over(n) is not None), None)
        if start is None:
            raise DesignError(self._why)
        if self._fit(start):
            good, bad = start, start + 1
            while self._fit(bad):
                good, bad = bad, bad + max(1, self._guess(bad))
        else:
            bad, good = start, max(1, start - self._guess(start))
            while not self._fit(good):
                if self.over(good) is None or good == 1:
                    return self._between(self._least(good, bad), bad)
                bad, good = good, max(1, good - self._guess(good))
        return self._between(good, bad)

    def _fit(self, steps: int) -> bool:
        over = self.over(steps)
        return over is not None and over <= ROUNDING

    def _guess(self, steps: int) -> int:
        """Steps by which the chamber could grow if the excess scaled with it, and one."""
        over = self.over(steps)
        return 1 + int(abs(over or 0.0) / STEP)

    def _least(self, none: int, some: int) -> int:
        """The fewest steps that can be built, if they fit. Raises DesignError if not."""
        while some - none > 1:
            middle = (none + some) // 2
            if self.over(middle) is None:
                none = middle
            else:
                some = middle
        over = self.over(some)
        if over is not None and over <= ROUNDING:
            return some
        limits = [(f"fits.{key}", value) for key, value in self._fits if value is not None]
        text = " and ".join(f"{key} = {value:g}" for key, value in limits)
        raise DesignError(
            f"no chamber fits {text}: the smallest that can be built, chamber.diameter = "
            f"{some * STEP:.2f}, is {over or 0.0:.3f} mm too wide; {self._room(some)}"
        )

    def _room(self, steps: int) -> str:
        """Remedies that make room for a chamber; ``fits.outline`` does not include tabs."""
        laminate, remedies = self._laminate(steps), []
        for key, most, measure, also in (
            ("diameter", self._fits.diameter, overall_diameter, " (or shorten inlet.tab_length)"),
            ("outline", self._fits.outline, outline_diameter, ""),
        ):
            if most is not None and (size := measure(laminate)) > most + ROUNDING:
                remedies.append(
                    f"fits.{key} at least {math.ceil((size - ROUNDING) * 1000) / 1000:.3f}{also}"
                )
        return f"make {' and '.join(remedies)}"

    def _laminate(self, steps: int) -> Laminate:
        # Balloons above the second do not change the plan view.
        few = min(2, self._design.stack.balloons)
        return self._build(_with_chamber(self._design, steps * STEP, few))

    def _between(self, good: int, bad: int) -> int:
        """The most steps that fit, between a number that fits and a larger one that does not."""
        while bad - good > 1:
            middle = self._straight_between(good, bad)
            if self._fit(middle):
                good = middle
            else:
                bad = middle
        return good

    def _straight_between(self, good: int, bad: int) -> int:
        """Secant estimate of the largest fit between two sizes; else the midpoint."""
        low, high = self.over(good), self.over(bad)
        if low is None or high is None or high <= low:
            return (good + bad) // 2
        guess = good + int(-low / (high - low) * (bad - good) + ROUNDING)
        return min(max(guess, good + 1), bad - 1)
