"""Unknowns of the elastic models: what calibration estimates, each with its prior and the prior's
source.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Unknown:
    """One unknown of the models; ``field`` names the field of ``Factors``.

    The prior is normal in the coordinate, which is the logarithm of the value (``is_log``) or the
    value itself: ``middle`` is the value at its mean, ``spread`` its standard deviation in the
    coordinate, and ``source`` its reason. Values lie from ``least`` to ``most``.
    """

    field: str
    title: str
    unit: str
    is_log: bool
    middle: float
    spread: float
    least: float
    most: float
    source: str

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        return math.log(value) if self.is_log else value

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate, within its bounds."""
        value = math.exp(coordinate) if self.is_log else coordinate
        return min(max(value, self.least), self.most)

    def shown(self, value: float) -> str:
        """Return a value to three digits, with its unit."""
        return f"{value:.3g} {self.unit}".rstrip()


UNKNOWNS = (
    Unknown(
        "modulus_ratio",
        "modulus ratio",
        "",
        True,
        1.5,
        0.6,
        0.8,
        10.0,
        "assumed, from half of the film's stated modulus to four times it: that is of a long pull, "
        "and films stretch little here",
    ),
    Unknown(
        "pocket_loss",
        "pocket loss",
        "mm",
        False,
        0.2,
        0.2,
        0.0,
        0.6,
        "assumed: molten film creeps under the mask, which overhangs the bond by 0.5 mm (Sec. 2)",
    ),
    Unknown(
        "press_factor",
        "press factor",
        "",
        True,
        0.32,
        0.7,
        0.05,
        1.0,
        "assumed: films that melt flow in the press, from not at all to a tenth of their thickness "
        "left; masks and films that stay solid keep theirs",
    ),
    Unknown(
        "water_delay",
        "delay of pump and tube with water",
        "s",
        True,
        0.15,
        1.0,
        0.001,
        2.0,
        "assumed: a syringe pump takes some tenths of a second to reach its flow",
    ),
    Unknown(
        "air_delay",
        "delay of valve and tube with air",
        "s",
        True,
        0.02,
        0.8,
        0.001,
        0.5,
        "assumed: pneumatic valves take 5 to 50 ms to open",
    ),
    Unknown(
        "loss_share",
        "share of work lost in a cycle",
        "",
        True,
        0.15,
        0.7,
        0.005,
        0.9,
        "assumed: a cycle of a thermoplastic elastomer loses a twentieth to a half of its work",
    ),
)
"""In the order of a calibration's mean and covariance."""
