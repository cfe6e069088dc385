"""Limits that the rules measure against, and the limits that a design lowers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sbafab.design.records import Design, Form
from sbafab.laminate.laminate import Laminate

TOLERANCE = 0.001
"""mm by which a value may miss its limit and still pass: the resolution of the cut files."""


def error_on_pins(design: Design, laminate: Laminate) -> float:
    """Return the most by which a layer of a laminate lies off its place on its pins, mm."""
    return design.pin_error if len(laminate.pins) > 1 else design.lone_pin_error


def holds(measured: float, limit: float) -> bool:
    """True if a value reaches a least limit, to within TOLERANCE (with room for rounding)."""
    return measured >= least_passing(limit)


def least_passing(limit: float) -> float:
    """Return the least value that passes a least limit."""
    return limit - TOLERANCE - 1e-9


# Limits that a design lowers below the usual ones. No waiver, but stated in every file like one.


class _Usual(Design):
    """A design that sets no limit; it has no form."""

    @property
    def form(self) -> Form:
        raise NotImplementedError


USUAL = _Usual.model_construct(name="usual")
CHECKED_AGAINST = "checked against limits below the usual ones: "
"""Introduces the lowered limits in a sentence."""
WORST = ("registration-worst-case", "registration-yield")


class _Key(NamedTuple):
    """A key of the design, the rules that it weakens, and where its usual value comes from."""

    name: str
    rules: tuple[str, ...]
    value: Callable[[Design], float]
    source: str = "paper"
    is_weaker_above: bool = False


# Left out, as none of them lets a worse design pass: target_yield (none by default), yield_builds
# (the finding states its interval), speeds and heat_distance (no rule reads them), kerf (measured,
# and written in KERF_WIDTH), platen (the size of a press, printed at every step).
KEYS = (
    _Key("bond_width", ("bond-width", "tube-fit"), lambda d: d.rules.bond_width),
    _Key("mask_overhang", ("mask-overhang",), lambda d: d.rules.mask_overhang),
    _Key("worst_bond_width", WORST, lambda d: d.rules.worst_bond_width, "default"),
    _Key("worst_mask_overhang", WORST, lambda d: d.rules.worst_mask_overhang, "default"),
    _Key("validated_balloons", ("press-fit",), lambda d: d.rules.validated_balloons, "paper", True),
    _Key("least_feature", ("film-limits",), lambda d: d.laser.least_feature, "default"),
    _Key("unknown_kerf", ("tube-fit", "nets"), lambda d: d.laser.unknown_kerf, "default"),
    _Key("pin_stretch", ("pin-fit",), lambda d: d.registration.pin_stretch, "default", True),
    _Key(
        "cutting_error",
        (*WORST, "pin-fit", "tube-fit", "nets"),
        lambda d: d.registration.cutting_error,
    ),
    _Key("pin_error", WORST, lambda d: d.pin_error),
    _Key("hand_placement", WORST, lambda d: d.registration.hand_placement, "default"),
    _Key("hand_turn", WORST, lambda d: d.registration.hand_turn, "default"),
    _Key(
        "seam_error",
        (*WORST, "sealing", "nets", "tube-fit"),
        lambda d: d.registration.error_of_seam("hot-tip"),
        "default",
    ),
    _Key(
        "opening_pressure_kpa", ("nets",), lambda d: d.rules.channels_open_at_kpa, "default", True
    ),
    _Key("dead_end", ("nets",), lambda d: d.rules.longest_dead_end, "default", True),
    _Key("safety_factor", ("pressure-rating",), lambda d: d.acceptance.safety_factor, "default"),
)
"""Smaller tolerances assume a better shop than is usual, so they weaken the rules as well."""


def lowered(design: Design, rule: str | None = None) -> tuple[str, ...]:
    """Return each lowered limit (of one rule) with its value: "bond_width 0.3 (paper 0.75)"."""
    return tuple(
        weakened(key.name, key.value(design), key.value(USUAL), key.source)
        for key in KEYS
        if rule is None or rule in key.rules
        if (key.value(design) - key.value(USUAL)) * (1 if key.is_weaker_above else -1) > 0
    )


def weakened(name: str, value: float, usual: float, source: str) -> str:
    """Return one lowered limit as every file states it."""
    return f"{name} {value:g} ({source} {usual:g})"
