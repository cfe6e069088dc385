"""Force of a chamber that is held at a height: virtual work, F dh = p dv (paper, Sec. 4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.paper import BURST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def force(pressure_kpa: ArrayLike, rate: ArrayLike) -> NDArray[np.float64]:
    """Newtons from a pressure and dv/dh in mm2. Raises DesignError past the burst pressure."""
    pressure = np.asarray(pressure_kpa, dtype=float)
    good = (pressure >= 0) & (pressure <= BURST.value)
    if not good.all():
        raise DesignError(
            f"pressure = {float(pressure[~good].flat[0]):g} kPa is out of range; give 0 to "
            f"{BURST.value:g} kPa, where the paper's actuators burst"
        )
    return np.asarray(pressure * np.asarray(rate, dtype=float) / 1000)


def work_uj(pressure_kpa: float, volume_ul: float) -> float:
    """Microjoules that air at constant pressure puts in: 1 kPa x 1 ul = 1 uJ.

    An upper bound of the integral of p dv up to that pressure.
    """
    return pressure_kpa * volume_ul
