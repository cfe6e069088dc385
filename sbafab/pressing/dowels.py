"""Commercial dowel pins, their seats in the base plate, and its holes.

A pin stands on the shoulder of its hole: loose or tight, it can neither fall through nor be driven
too deep, and its height over the plate is its length minus the hole's depth. A narrower hole
continues through the plate, so that the pin can be pushed out from below.

Lengths, diameters and chamfers: ISO 8734:1997 (hardened) and ISO 2338:1997 (unhardened, m6 or h8:
order m6). The values are from secondary sources and equal those of FreeCAD's fasteners workbench
(FsData/iso8734*.csv, iso2338*.csv), of geop's part library for ISO 8734 from 1.5 mm up, and, for
chamfers of ISO 8734, of a transcription of its Table 1 in tscircuit's modelprinter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal, NamedTuple

from sbafab.errors import DesignError
from sbafab.laminate.base_plate import HOLE_PROCESSES, PlateMachine
from sbafab.laminate.laminate import Pin

Standard = Literal["ISO 8734", "ISO 2338"]

SERIES = (2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 35, 40, 45, 50, 55, 60)
"""Lengths of both standards, mm, as far as a base plate needs them."""
RANGES: Mapping[Standard, Mapping[float, tuple[int, int]]] = {
    "ISO 8734": {
        1.0: (3, 10),
        1.5: (4, 16),
        2.0: (5, 20),
        2.5: (6, 24),
        3.0: (8, 30),
        4.0: (10, 40),
        5.0: (12, 50),
        6.0: (14, 60),
    },
    "ISO 2338": {
        0.6: (2, 6),
        0.8: (2, 8),
        1.0: (4, 10),
        1.2: (4, 12),
        1.5: (4, 16),
        2.0: (6, 20),
        2.5: (6, 24),
        3.0: (8, 30),
        4.0: (8, 40),
        5.0: (10, 50),
        6.0: (12, 60),
    },
}
"""Shortest and longest length by diameter, mm."""
CHAMFERS = {
    0.6: 0.12,
    0.8: 0.16,
    1.0: 0.2,
    1.2: 0.25,
    1.5: 0.3,
    2.0: 0.35,
    2.5: 0.4,
    3.0: 0.5,
    4.0: 0.63,
    5.0: 0.8,
    6.0: 1.2,
}
"""Height of the chamfer at a pin's end by diameter, mm; of others a fifth of the diameter."""
PLATES = (6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0)
"""Thicknesses in which plate is sold, mm."""
SEAT = 1.5
LEAST_SEAT = 2.0
"""Least length of a pin in the plate, in diameters and in mm, that keeps it straight: ours."""
LENGTH_TOLERANCES = ((10.0, 0.25), (50.0, 0.5), (math.inf, 0.75))
"""Tolerance +- of a pin's length, up to each length, mm: ISO 2338 and 8734 (from memory: neither
was opened; DIN 7, which came before, gives 0 to +0.3, +0.5 and +0.8).
"""
DEPTH_TOLERANCES = ((6.0, 0.05), (30.0, 0.1), (math.inf, 0.15))
"""Tolerance +- of the depth of a hole's shoulder, up to each depth, mm: ISO 2768-1, fine."""
STEP = 0.05
"""Depths of shoulders are multiples of this, mm."""
FLOOR = 1.0
"""Least thickness of the plate under a shoulder, mm: ours."""
PUSH_OUT = 0.6
"""Diameter of the hole through which a pin is pushed out, in diameters of the pin: its end, which
the chamfer narrows to 0.85 or more, rests on the shoulder round it.
"""
ROUNDING = 1e-6


@dataclass(frozen=True)
class PinSetting:
    """One pin in one step: ``seat_mm`` of its length are in the plate, ``stands_mm`` above it.

    The shoulder of its hole sets both. Deviations of pin and depth change its height by up to
    ``tolerance_mm``.
    """

    pin: str
    diameter_mm: float
    length_mm: float
    seat_mm: float
    stands_mm: float
    tolerance_mm: float


class PinHole(NamedTuple):
    """The hole of one pin in the base plate, mm.

    It is reamed from above down to a shoulder at ``depth`` +- ``tolerance``, on which the pin
    stands; below, it is ``push_out`` wide through the plate. ``lengths`` are those of the pins used
    in it, shortest first.
    """

    pin: str
    diameter: float
    depth: float
    tolerance: float
    push_out: float
    lengths: tuple[float, ...]


def chamfer(diameter: float) -> float:
    """Return the least height of a pin over its stack, mm: the chamfer alone holds no film."""
    return CHAMFERS.get(round(diameter, 6), round(diameter / 5, 3))


def length_tolerance(length: float) -> float:
    """Return the tolerance +- of a pin's length, mm."""
    return next(most for limit, most in LENGTH_TOLERANCES if length <= limit)


def depth_tolerance(depth: float) -> float:
    """Return the tolerance +- of a shoulder's depth, mm."""
    return next(most for limit, most in DEPTH_TOLERANCES if depth <= limit)


def push_out(diameter: float) -> float:
    """Return the diameter of the hole for pushing a pin out, mm, to 0.1."""
    return round(PUSH_OUT * diameter, 1)


def is_sold(diameter: float, standard: Standard) -> bool:
    """Return True if the standard lists pins of this diameter."""
    return any(abs(diameter - sold) < ROUNDING for sold in RANGES[standard])


def lengths_sold(
    diameter: float, standard: Standard, stock: Sequence[float] = ()
) -> tuple[float, ...]:
    """Return lengths in mm, shortest first: ``stock`` if given, else the standard's for the
    diameter.

    A diameter outside the standard gets the whole series.
    """
    if stock:
        return tuple(sorted(stock))
    spans = (span for sold, span in RANGES[standard].items() if abs(sold - diameter) < ROUNDING)
    low, high = next(spans, (SERIES[0], SERIES[-1]))
    return tuple(float(length) for length in SERIES if low <= length <= high)


def settings_by_step(
    steps: Sequence[tuple[float, Sequence[Pin]]],
    standard: Standard,
    stock: Sequence[float],
    plate: float | None,
) -> tuple[list[tuple[PinSetting, ...]], float]:
    """Return the pins of every step, given its inserted pins and the height of its stack's top, mm,
    and the thickness of the plate.

    The height is measured from the plate and includes every part under the stack. Holes of one
    diameter have one depth, and a step with a higher stack needs longer pins. Of all depths that
    fit a plate (``plate`` mm thick, or the thinnest stock size that fits any) the chosen one
    minimises the height of pins over their stacks. Even the shortest pin in the deepest hole
    projects over its stack by its chamfer. Raises DesignError if no pin is long enough, or the
    plate is too thin.
    """
    tops: dict[float, list[float]] = {}
    first: dict[float, str] = {}
    for height, pins in steps:
        for pin in pins:
            tops.setdefault(pin.diameter, []).append(height)
            first.setdefault(pin.diameter, pin.name)
    choices = {
        diameter: _choices(
            first[diameter], diameter, heights, lengths_sold(diameter, standard, stock)
        )
        for diameter, heights in tops.items()
    }
    thickness = _thickness(choices, plate)
    # Of the depths that fit the plate the one at which the pins stand out least.
    chosen = {
        diameter: min(
            (choice for choice in every if choice.depth <= thickness - FLOOR + ROUNDING),
            key=lambda choice: (choice.out, choice.depth),
        )
        for diameter, every in choices.items()
    }
    settings = [
        tuple(_setting(pin, height, chosen[pin.diameter]) for pin in pins) for height, pins in steps
    ]
    return settings, thickness


class _Choice(NamedTuple):
    """Depth of holes, pin lengths by height of stack, and the largest height over a stack."""

    depth: float
    lengths: Mapping[float, float]
    out: float


def _setting(pin: Pin, height: float, choice: _Choice) -> PinSetting:
    length = choice.lengths[height]
    return PinSetting(
        pin.name,
        pin.diameter,
        length,
        choice.depth,
        round(length - choice.depth, 3),
        round(length_tolerance(length) + depth_tolerance(choice.depth), 3),
    )


def _choices(
    pin: str, diameter: float, tops: Sequence[float], sold: Sequence[float]
) -> list[_Choice]:
    """Return depths for which some pin has its minimum height over a stack."""
    needs = {top: top + chamfer(diameter) for top in tops}
    seat = max(LEAST_SEAT, SEAT * diameter)
    depths = {
        # A multiple of ``STEP`` at or below: pins never stand lower for it.
        round(math.floor(depth / STEP + ROUNDING) * STEP, 6)
        for need in needs.values()
        for length in sold
        for depth in [length - length_tolerance(length) - depth_tolerance(length) - need]
    }
    choices = []
    for depth in sorted(depth for depth in depths if depth >= seat - ROUNDING):
        lengths = {top: _shortest(sold, depth, need) for top, need in needs.items()}
        pin_lengths = {top: length for top, length in lengths.items() if length is not None}
        if len(pin_lengths) == len(needs):
            out = max(length - depth - top for top, length in pin_lengths.items())
            choices.append(_Choice(depth, pin_lengths, round(out, 6)))
    if not choices:
        least = seat + depth_tolerance(seat) + max(needs.values())
        needed = next(least + off for limit, off in LENGTH_TOLERANCES if least + off <= limit)
        raise DesignError(
            f"the pin {pin} (diameter {diameter:g}) must be at least {needed:.3f} mm long for a "
            f"stack {max(tops):.3f} mm high, including the tolerances of pin and hole, but the "
            f"longest available is {sold[-1]:g} mm; add a longer one to registration.pin_lengths"
        )
    return choices


def _shortest(sold: Sequence[float], depth: float, need: float) -> float | None:
    """Return the shortest pin sure to stand ``need`` mm over the plate, or None."""
    off = depth_tolerance(depth)
    return next((n for n in sold if n - length_tolerance(n) - off >= depth + need - ROUNDING), None)


def _thickness(choices: Mapping[float, Sequence[_Choice]], thickness: float | None) -> float:
    """Return the plate's thickness in mm: as set, or the thinnest that fits every seat."""
    least = max((every[0].depth + FLOOR for every in choices.values()), default=0.0)
    if thickness is None:
        return _plate_sold(least)
    if thickness < least - ROUNDING:
        raise DesignError(
            f"press.plate_thickness = {thickness:g} is thinner than the {least:g} mm that a "
            f"pin's hole needs with {FLOOR:g} mm left under its shoulder; increase it, or change "
            "registration.pin_lengths"
        )
    return thickness


def pin_holes(settings: Sequence[Sequence[PinSetting]]) -> dict[str, PinHole]:
    """Return the base plate's hole for every pin in use, by the pin's name."""
    used: dict[str, list[PinSetting]] = {}
    for pin in chain.from_iterable(settings):
        used.setdefault(pin.pin, []).append(pin)
    return {
        name: PinHole(
            name,
            pin.diameter_mm,
            pin.seat_mm,
            depth_tolerance(pin.seat_mm),
            push_out(pin.diameter_mm),
            tuple(sorted({each.length_mm for each in every})),
        )
        for name, every in used.items()
        for pin in every[:1]
    }


def hole_notes(
    pins: Sequence[Pin], holes: Mapping[str, PinHole], machine: PlateMachine
) -> tuple[str, ...]:
    """Return a workshop's notes on the plate's holes, one per line, in a plotter's characters.

    ``pins`` are all pins of a laminate; pins that no step uses do not need a shoulder. The only pin
    of a plate needs just a reamed hole, wherever it is.
    """
    sizes = dict.fromkeys(
        (pin.diameter, holes[pin.name]._replace(pin="") if pin.name in holes else None)
        for pin in sorted(pins, key=lambda pin: pin.diameter)
    )
    making = HOLE_PROCESSES[machine]
    fit = "lapped to its pins m6" if making.is_lapped and len(pins) > 1 else "H7"
    lines = [
        f"D{diameter:g} {fit}, from above {hole.depth:g} +-{hole.tolerance:g} deep, flat; "
        f"D{hole.push_out:g} on through"
        if hole is not None
        else f"D{diameter:g} {fit}, through, not used"
        for diameter, hole in sizes
    ]
    if len(pins) > 1:
        lines.append(f"each hole within {making.position:g} of its place, {making.words}")
    return tuple(lines)


def _plate_sold(least: float) -> float:
    """Return the thinnest stock plate of at least ``least`` mm; whole millimetres beyond these."""
    return next((plate for plate in PLATES if plate >= least - ROUNDING), float(math.ceil(least)))
