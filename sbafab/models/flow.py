"""Time to put a volume in at a steady flow (paper, Sec. 4.5 and 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import DesignError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

ATMOSPHERE_KPA = 101.325
LEAST_FLOW, MOST_FLOW = 1e-6, 1e6
"""ml/min: from a nanolitre a minute, of the slowest syringe pumps, to 1,000 litres."""


def seconds(
    volume_ul: ArrayLike, flow_ml_min: float, gas_at_kpa: float = 0.0
) -> NDArray[np.float64]:
    """Seconds to a volume at a flow.

    ``gas_at_kpa`` is the pressure that a gas is squeezed to, above the atmosphere at which its
    flow is counted; leave it for a liquid. Raises DesignError for a flow that no pump has.
    """
    if not LEAST_FLOW <= flow_ml_min <= MOST_FLOW:
        raise DesignError(
            f"flow = {flow_ml_min:g} ml/min must be from {LEAST_FLOW:g} to {MOST_FLOW:g} ml/min"
        )
    squeezed = 1 + gas_at_kpa / ATMOSPHERE_KPA
    return np.asarray(volume_ul, dtype=float) * squeezed / (flow_ml_min * 1000 / 60)
