"""What a conforming mesh is asked to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Element = Literal["wedge", "tet"]
Symmetry = Literal["full", "half", "quarter", "sector"]


@dataclass(frozen=True)
class MeshSettings:
    """How the meshes are made.

    ``h`` is the side of the triangles in mm. ``symmetry``: half of the actuator, the quarter of a
    1-DoF one that lies away from its inlet, or one lobe's sector. ``fill_ul`` is the air in every
    balloon's pocket in ul, or in those of each chamber by name; None is the flat shape.
    ``gaps`` keeps the films as far apart as the masks hold them, with bonds between them that
    are as thick; without it films lie on each other, and the height is the sum of the TPE films.
    ``wrapped``: what is made for a tube lies round it, its axis z; else it lies flat.
    """

    h: float = 0.35
    element: Element = "wedge"
    symmetry: Symmetry = "full"
    fill_ul: float | Mapping[str, float] | None = None
    gaps: bool = False
    wrapped: bool = True
