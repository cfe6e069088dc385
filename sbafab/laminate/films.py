"""The films a laminate is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Material = Literal["TPE", "PTFE"]


@dataclass(frozen=True)
class Film:
    """A film as it comes off the roll.

    ``thickness`` mm, ``density`` kg/m3. ``softens_above`` is what the film bonds at (the melting
    point of a TPE), ``limit`` the temperature it must not exceed; both in C.
    """

    material: Material
    product: str
    thickness: float
    density: float
    softens_above: float
    limit: float
