"""What the rules measure against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sbafab.geometry.beam import Kerf
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Laminate

TOLERANCE = 0.001
"""mm by which a value may miss its limit and still hold it: what the cut files promise."""


@dataclass(frozen=True)
class Tolerances:
    """The most by which cut edges and layers may lie off their places.

    ``cutting``: mm, any cut edge along its normal; ``pin``: mm, a layer on its pins; ``placement``
    mm and ``turn`` degrees: a layer laid by hand. The first two are the paper's (Sec. 2); the hand
    is calibrated on its success rate (``docs/scripts/hand.py``).
    ``sheet``: mm, a part in its registered sheet; ``second_cut``: mm, the second cut of these.
    ``lone_pin``: mm, a layer on the plate's only pin, whose own place does not count (None: as on
    several).
    """

    cutting: float = 0.1
    pin: float = 0.004
    placement: float = 0.08
    turn: float = 0.4
    sheet: float = 0.05
    second_cut: float = 0.2
    lone_pin: float | None = None

    def on_pins(self, laminate: Laminate) -> float:
        """Return the most by which a layer of a laminate lies off its place on its pins, mm."""
        if self.lone_pin is None or len(laminate.pins) > 1:
            return self.pin
        return self.lone_pin


@dataclass(frozen=True)
class Limits:
    """A design's limits, mm; the defaults are the paper's (Sec. 2).

    ``pin_stretch`` is the share by which a hole may be stretched over its pin, ``least_feature`` is
    the laser's, ``kerf`` the full kerf width by material, or that along x and along y (none given:
    not calibrated, and up to ``unknown_kerf``), ``waive`` the rules whose failure the user accepts
    by name. The ``worst_`` limits are for what is left of bond and overhang under the
    ``tolerances``; ``target_yield`` is the share of ``yield_builds`` random builds that must keep
    them (None: none asked for; for the builds: as many as are quick).
    """

    bond_width: float = 0.75
    mask_overhang: float = 0.5
    least_feature: float = 0.2
    kerf: Mapping[str, Kerf] = field(default_factory=dict)
    heated_width: float = 152.4
    heated_length: float = 152.4
    validated_balloons: int = 20
    registration_tolerance: float = 0.001
    tolerances: Tolerances = Tolerances()
    unknown_kerf: float = 0.1
    pin_stretch: float = 0.3
    worst_bond_width: float = 0.5
    worst_mask_overhang: float = 0.25
    target_yield: float | None = None
    yield_builds: int | None = None
    waive: frozenset[str] = frozenset()


def holds(measured: float, limit: float) -> bool:
    """Whether a value reaches a least limit, to within TOLERANCE (with room for rounding)."""
    return measured >= least_held(limit)


def least_held(limit: float) -> float:
    """The least value that still holds a least limit."""
    return limit - TOLERANCE - 1e-9


def at(p: Point) -> str:
    """A point as messages print it."""
    return f"x {round(p[0], 3) + 0.0:.3f}, y {round(p[1], 3) + 0.0:.3f}"
