"""The films a laminate is made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Material = str
"""What files, sheets and lists call a film: "TPE", "PTFE", or a further one's name in capitals."""
FilmKind = Literal["structural", "mask"]
"""A structural film bonds where it touches another; nothing bonds to a mask."""
FIRST: tuple[Material, ...] = ("TPE", "PTFE")
"""The films that every design knows; lists begin with them."""
PTFE_WARNING = (
    "Extract the fumes: hot PTFE gives off toxic COF2 and HF. Cut it with a laser only on a "
    "machine whose owner permits PTFE, or use a drag knife."
)


PAPER_TPE = (10.0, 0.2)
"""Young's modulus in MPa and Poisson's ratio of the paper's model (Sec. 3.2.1)."""


@dataclass(frozen=True)
class Film:
    """A film as it comes off the roll.

    ``thickness`` mm, ``density`` kg/m3. ``softens_above`` is the temperature in C at which the film
    bonds (the melting point of a TPE; None for one that stays solid and bonds to what melts on it),
    ``limit`` the one in C that it must not exceed. ``shade`` counts the films of a kind,
    for colours; ``warning`` is what its cut files say; ``elastic`` are Young's modulus in MPa and
    Poisson's ratio, for simulators.
    """

    material: Material
    product: str
    thickness: float
    density: float
    softens_above: float | None
    limit: float
    kind: FilmKind = "structural"
    shade: int = 0
    warning: str = ""
    elastic: tuple[float, float] | None = None

    @property
    def is_mask(self) -> bool:
        """Whether nothing bonds to it."""
        return self.kind == "mask"


def in_order(materials: Iterable[Material]) -> list[Material]:
    """Every material once: TPE, PTFE, then the others by name."""
    rank = {material: place for place, material in enumerate(FIRST)}
    return sorted(set(materials), key=lambda name: (rank.get(name, len(FIRST)), name))
