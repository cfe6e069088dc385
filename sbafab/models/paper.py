"""What the paper measured, one place for plots and for the table of docs/validation.md."""

from __future__ import annotations

from typing import NamedTuple


class Measured(NamedTuple):
    """A value +- its error (0 where none is given), its unit, and where it stands."""

    value: float
    error: float
    unit: str
    where: str

    def __str__(self) -> str:
        shown = f"{self.value:g} +- {self.error:g}" if self.error else f"{self.value:g}"
        return f"{shown} {self.unit}"


HEIGHTS = (0.0, 0.25, 0.75)
"""Shares of the largest height at which forces were measured."""
FORCE_KPA = 100.0
FORCE_1DOF = (
    Measured(1.48, 0.04, "N", "Sec. 4.3"),
    Measured(1.01, 0.01, "N", "Sec. 4.3"),
    Measured(0.64, 0.01, "N", "Sec. 4.3"),
)
FORCE_3DOF = (
    Measured(4.87, 0.02, "N", "Sec. 4.3"),
    Measured(4.07, 0.07, "N", "Sec. 4.3"),
    Measured(2.40, 0.03, "N", "Sec. 4.3"),
)
FORCE_BENT = (
    (30, Measured(3.22, 0.12, "N", "Sec. 4.3")),
    (60, Measured(1.41, 0.05, "N", "Sec. 4.3")),
    (90, Measured(0.55, 0.02, "N", "Sec. 4.3")),
)
BENDING = (
    (0.56, Measured(30.3, 1.3, "deg", "Sec. 4.6")),
    (0.78, Measured(58.5, 1.2, "deg", "Sec. 4.6")),
    (0.91, Measured(89.7, 2.0, "deg", "Sec. 4.6")),
)
"""Seconds at 35 ml/min, and the angle reached."""
LARGEST_BEND = Measured(81, 6, "deg", "Sec. 4.6")
FULL_HEIGHT = Measured(17.5, 0, "mm", "Sec. 4.6")
FLAT_HEIGHT = Measured(0.95, 0, "mm", "Sec. 4.6")
BALLOONS = 15
"""Of the 3-DoF actuator that was measured."""
WATER_FLOW = 35.0
"""ml/min (Sec. 7)."""
AIR_FLOW = 2500.0
"""ml/min (Sec. 7)."""
FULL_KPA = 10.0
"""Pressure that counts as full actuation (Sec. 4.5)."""
WATER_TIME = Measured(0.92, 0.08, "s", "Sec. 4.5")
AIR_TIME = Measured(0.067, 0.011, "s", "Sec. 4.5")
MODULUS_1DOF = Measured(35, 0, "kPa", "Sec. 4.4")
MODULUS_3DOF = Measured(60, 0, "kPa", "Sec. 4.4")
SUCCESS = Measured(0.9, 0, "", "Sec. 6")
"""Share of the actuators built that held."""
WORK = Measured(45.3, 0, "mJ", "Sec. 4.1")
"""Pneumatic input work at 10 kPa, 6 balloons of d = 10."""
BURST = Measured(367, 18, "kPa", "Sec. 4")
FOLDED = Measured(9.25, 0, "mm", "Sec. 2")
RADIAL_FLAT = Measured(15.33, 0, "mm", "Sec. 2.1")
RADIAL_FULL = Measured(28, 0, "mm", "Sec. 2.1")
VALID = (
    ("air", 45.0, Measured(0.13, 0, "mm", "Sec. 4.2")),
    ("water", 86.0, Measured(0.12, 0, "mm", "Sec. 4.2")),
)
"""ul a balloon up to which Eq. 4 held for d = 10, and its largest error there."""
VALID_RADIUS = 5.0
"""Pocket radius to which VALID belongs."""

FULL_SHARE = FULL_HEIGHT.value / BALLOONS / 2.5
"""Stroke of a full balloon over its pocket's radius: 17.5 mm of 15 balloons of radius 2.5."""
