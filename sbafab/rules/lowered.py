"""Limits that a design asks less of than is usual: no waiver, and said in every file like one."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sbafab.rules.limits import Limits

USUAL = Limits()
CHECKED_AGAINST = "checked against limits below the usual ones: "
"""What stands before them where a sentence is needed."""
WORST = ("registration-worst-case", "registration-yield")


class _Key(NamedTuple):
    """A key of the design, the rules that it weakens, and where its usual value comes from."""

    name: str
    rules: tuple[str, ...]
    value: Callable[[Limits], float]
    source: str = "paper"
    is_weaker_above: bool = False


# Not here, for none of them lets a worse design pass: target_yield (none is asked for by default),
# yield_builds (the finding states its interval), speeds and heat_distance (no rule reads them),
# kerf (measured, and said in KERF_WIDTH), platen (the size of a press, printed at every step).
KEYS = (
    _Key("bond_width", ("bond-width", "tube-fit"), lambda own: own.bond_width),
    _Key("mask_overhang", ("mask-overhang",), lambda own: own.mask_overhang),
    _Key("worst_bond_width", WORST, lambda own: own.worst_bond_width, "default"),
    _Key("worst_mask_overhang", WORST, lambda own: own.worst_mask_overhang, "default"),
    _Key("validated_balloons", ("press-fit",), lambda own: own.validated_balloons, "paper", True),
    _Key("least_feature", ("film-limits",), lambda own: own.least_feature, "default"),
    _Key("unknown_kerf", ("tube-fit",), lambda own: own.unknown_kerf, "default"),
    _Key("pin_stretch", ("pin-fit",), lambda own: own.pin_stretch, "default", True),
    _Key("cutting_error", (*WORST, "pin-fit", "tube-fit"), lambda own: own.tolerances.cutting),
    _Key("pin_error", WORST, lambda own: own.tolerances.pin),
    _Key("hand_placement", WORST, lambda own: own.tolerances.placement, "default"),
    _Key("hand_turn", WORST, lambda own: own.tolerances.turn, "default"),
    _Key("sheet_error", WORST, lambda own: own.tolerances.sheet, "default"),
    _Key("second_cut_error", ("bridges",), lambda own: own.tolerances.second_cut, "default"),
)
"""Smaller tolerances assume a better shop than is usual, so they weaken the rules as well."""


def lowered(limits: Limits, rule: str | None = None) -> tuple[str, ...]:
    """Each weakened limit (of one rule) with its value: "bond_width 0.3 (paper 0.75)"."""
    return tuple(
        weakened(key.name, key.value(limits), key.value(USUAL), key.source)
        for key in KEYS
        if (rule is None or rule in key.rules) and _is_weaker(key, limits)
    )


def _is_weaker(key: _Key, limits: Limits) -> bool:
    own, usual = key.value(limits), key.value(USUAL)
    return own > usual if key.is_weaker_above else own < usual


def weakened(name: str, own: float, usual: float, source: str) -> str:
    """One weakened limit as every file says it."""
    return f"{name} {own:g} ({source} {usual:g})"
