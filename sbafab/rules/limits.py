"""Limits that the rules measure against, and the limits that a design lowers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from sbafab.geometry.edges import Point
from sbafab.geometry.offset import Kerf
from sbafab.laminate.base_plate import PlateMachine
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.laminate.joints import SeamTool
from sbafab.laminate.laminate import Laminate

GUIDED_TOOL = 0.3
"""mm: error of place of a seam's tool other than a laser; ours, nobody measured it."""
TOLERANCE = 0.001
"""mm by which a value may miss its limit and still pass: the resolution of the cut files."""


@dataclass(frozen=True)
class Tolerances:
    """The most by which cut edges and layers may lie off their places.

    ``cutting``: mm, any cut edge along its normal; ``pin``: mm, a layer on its pins; ``placement``
    mm and ``turn`` degrees: a layer laid by hand. The first two are the paper's (Sec. 2); the hand
    is calibrated on its success rate (``docs/scripts/hand.py``).
    ``lone_pin``: mm, a layer on the plate's only pin, whose own place does not count (None: as on
    several). ``seam``: mm, a seam off its path (None: as cut edges for a laser, ``GUIDED_TOOL``
    for other tools).
    """

    cutting: float = 0.1
    pin: float = 0.004
    placement: float = 0.08
    turn: float = 0.4
    lone_pin: float | None = None
    seam: float | None = None

    def of_seam(self, tool: SeamTool) -> float:
        """Return the most by which a seam of a tool lies off its path, mm."""
        if self.seam is not None:
            return self.seam
        return self.cutting if tool == "laser" else GUIDED_TOOL

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
    them (None: none asked for; for the builds: as many as are quick). ``opening_pressure``: kPa
    that may open a channel; ``dead_end``: widths that a blind branch may be long. ``minutes_for``:
    product and thickness of the films that the press minutes were stated for. ``plate``: the
    machine that makes the base plate's holes, None where it does not set the pins' error, or bonds
    are as drawn. ``working_pressure``: gauge, kPa, a vacuum below 0 (None: not stated), of which
    the burst pressure must be ``safety_factor`` times.
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
    opening_pressure: float = 100.0
    dead_end: float = 2.0
    target_yield: float | None = None
    yield_builds: int | None = None
    minutes_for: tuple[tuple[str, float], ...] = ((PAPER_PRODUCT, PAPER_THICKNESS),)
    working_pressure: float | None = None
    safety_factor: float = 2.0
    waive: frozenset[str] = frozenset()
    plate: PlateMachine | None = None


def holds(measured: float, limit: float) -> bool:
    """True if a value reaches a least limit, to within TOLERANCE (with room for rounding)."""
    return measured >= least_passing(limit)


def least_passing(limit: float) -> float:
    """Return the least value that passes a least limit."""
    return limit - TOLERANCE - 1e-9


def at(p: Point) -> str:
    """Return a point as messages print it."""
    return f"x {round(p[0], 3) + 0.0:.3f}, y {round(p[1], 3) + 0.0:.3f}"


# Limits that a design lowers below the usual ones. No waiver, but stated in every file like one.


USUAL = Limits()
CHECKED_AGAINST = "checked against limits below the usual ones: "
"""Introduces the lowered limits in a sentence."""
WORST = ("registration-worst-case", "registration-yield")


class _Key(NamedTuple):
    """A key of the design, the rules that it weakens, and where its usual value comes from."""

    name: str
    rules: tuple[str, ...]
    value: Callable[[Limits], float]
    source: str = "paper"
    is_weaker_above: bool = False


# Left out, as none of them lets a worse design pass: target_yield (none by default), yield_builds
# (the finding states its interval), speeds and heat_distance (no rule reads them), kerf (measured,
# and written in KERF_WIDTH), platen (the size of a press, printed at every step).
KEYS = (
    _Key("bond_width", ("bond-width", "tube-fit"), lambda lim: lim.bond_width),
    _Key("mask_overhang", ("mask-overhang",), lambda lim: lim.mask_overhang),
    _Key("worst_bond_width", WORST, lambda lim: lim.worst_bond_width, "default"),
    _Key("worst_mask_overhang", WORST, lambda lim: lim.worst_mask_overhang, "default"),
    _Key("validated_balloons", ("press-fit",), lambda lim: lim.validated_balloons, "paper", True),
    _Key("least_feature", ("film-limits",), lambda lim: lim.least_feature, "default"),
    _Key("unknown_kerf", ("tube-fit", "nets"), lambda lim: lim.unknown_kerf, "default"),
    _Key("pin_stretch", ("pin-fit",), lambda lim: lim.pin_stretch, "default", True),
    _Key(
        "cutting_error", (*WORST, "pin-fit", "tube-fit", "nets"), lambda lim: lim.tolerances.cutting
    ),
    _Key("pin_error", WORST, lambda lim: lim.tolerances.pin),
    _Key("hand_placement", WORST, lambda lim: lim.tolerances.placement, "default"),
    _Key("hand_turn", WORST, lambda lim: lim.tolerances.turn, "default"),
    _Key(
        "seam_error",
        (*WORST, "sealing", "nets", "tube-fit"),
        lambda lim: lim.tolerances.of_seam("hot-tip"),
        "default",
    ),
    _Key("opening_pressure_kpa", ("nets",), lambda lim: lim.opening_pressure, "default", True),
    _Key("dead_end", ("nets",), lambda lim: lim.dead_end, "default", True),
    _Key("safety_factor", ("pressure-rating",), lambda lim: lim.safety_factor, "default"),
)
"""Smaller tolerances assume a better shop than is usual, so they weaken the rules as well."""


def lowered(limits: Limits, rule: str | None = None) -> tuple[str, ...]:
    """Return each lowered limit (of one rule) with its value: "bond_width 0.3 (paper 0.75)"."""
    return tuple(
        weakened(key.name, key.value(limits), key.value(USUAL), key.source)
        for key in KEYS
        if (rule is None or rule in key.rules) and _is_weaker(key, limits)
    )


def _is_weaker(key: _Key, limits: Limits) -> bool:
    value, usual = key.value(limits), key.value(USUAL)
    return value > usual if key.is_weaker_above else value < usual


def weakened(name: str, value: float, usual: float, source: str) -> str:
    """Return one lowered limit as every file states it."""
    return f"{name} {value:g} ({source} {usual:g})"
