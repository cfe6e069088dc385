"""Dowel pins as they are sold, and how deep they sit in the base plate.

Lengths, diameters and chamfers: ISO 8734:1997 (hardened) and ISO 2338:1997 (unhardened, m6 or h8:
order m6). The standards themselves were not opened. Held against the tables of FreeCAD's workbench
for fasteners (FsData/iso8734*.csv, iso2338*.csv), all equal; against a table of ISO 8734 in the
public part library of geop, equal from 1.5 mm up; chamfers of ISO 8734 against a transcription of
its Table 1 in tscircuit's modelprinter, equal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from sbafab.errors import DesignError
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
"""A pin stands straight with this many diameters of it, and this many mm, in the plate: ours."""
SAME = 1e-6


@dataclass(frozen=True)
class PinSetting:
    """One pin in one step: ``seat_mm`` of its length are in the plate, ``stands_mm`` above it."""

    pin: str
    diameter_mm: float
    length_mm: float
    seat_mm: float
    stands_mm: float


def chamfer(diameter: float) -> float:
    """By how much a pin stands over a stack, mm: the chamfer alone holds no film."""
    return CHAMFERS.get(round(diameter, 6), round(diameter / 5, 3))


def is_sold(diameter: float, standard: Standard) -> bool:
    """Whether the standard has pins of this diameter."""
    return any(abs(diameter - known) < SAME for known in RANGES[standard])


def lengths_sold(
    diameter: float, standard: Standard, own: Sequence[float] = ()
) -> tuple[float, ...]:
    """Lengths in mm, shortest first: ``own`` if given, else the standard's for the diameter.

    A diameter that the standard does not have gets the whole series.
    """
    if own:
        return tuple(sorted(own))
    low, high = next(
        (span for known, span in RANGES[standard].items() if abs(known - diameter) < SAME),
        (SERIES[0], SERIES[-1]),
    )
    return tuple(float(length) for length in SERIES if low <= length <= high)


def least_seat(diameter: float) -> float:
    return max(LEAST_SEAT, SEAT * diameter)


def settings_by_step(
    steps: Sequence[tuple[float, Sequence[Pin]]],
    standard: Standard,
    own: Sequence[float] = (),
) -> list[tuple[PinSetting, ...]]:
    """The pins of every step, given the height of its stack's top over the plate in mm, release
    film included, and the pins that are in.

    A pin has the same length in all steps, the shortest that is sold and sits firm under the
    highest stack; it is driven in until it stands over the stack by its chamfer. Raises DesignError
    where no pin is long enough.
    """
    highest: dict[Pin, float] = {}
    for height, pins in steps:
        for pin in pins:
            highest[pin] = max(highest.get(pin, 0.0), height)
    length = {pin: _length(pin, height, standard, own) for pin, height in highest.items()}
    return [
        tuple(
            PinSetting(
                pin.name,
                pin.diameter,
                length[pin],
                round(length[pin] - height - chamfer(pin.diameter), 3),
                round(height + chamfer(pin.diameter), 3),
            )
            for pin in pins
        )
        for height, pins in steps
    ]


def _length(pin: Pin, height: float, standard: Standard, own: Sequence[float]) -> float:
    needed = height + chamfer(pin.diameter) + least_seat(pin.diameter)
    sold = lengths_sold(pin.diameter, standard, own)
    found = next((length for length in sold if length >= needed - SAME), None)
    if found is None:
        where = "registration.pin_lengths" if own else f"{standard} in this diameter"
        raise DesignError(
            f"the pin {pin.name} (diameter {pin.diameter:g}) must be at least {needed:.3f} mm long "
            f"for a stack {height:.3f} mm high, and the longest of {where} has {sold[-1]:g}; give "
            "a longer one in registration.pin_lengths"
        )
    return found


def plate_thickness(
    asked: float | None, settings: Sequence[Sequence[PinSetting]], usual: float = PLATES[0]
) -> float:
    """The base plate's thickness in mm: as asked, or the thinnest sold that takes every seat.

    Raises DesignError where a pin would reach through the plate that was asked for.
    """
    deepest = max((s.seat_mm for step in settings for s in step), default=0.0)
    if asked is not None:
        if asked < deepest - SAME:
            raise DesignError(
                f"press.plate_thickness = {asked:g} is thinner than the {deepest:g} mm that a "
                "dowel pin sits in it; make it thicker, or give shorter pins in "
                "registration.pin_lengths"
            )
        return asked
    thick = (plate for plate in PLATES if plate >= max(deepest, usual) - SAME)
    return next(thick, float(math.ceil(deepest)))
