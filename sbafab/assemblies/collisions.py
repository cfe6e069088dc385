"""Parts that run into each other: solids in place, deflated, their pockets filled."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.fits import found
from sbafab.assemblies.shapes import placed_surface
from sbafab.meshing.surface import Surface
from sbafab.rules.finding import Finding

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

TOUCH = 0.05
"""mm3 of overlap up to which two parts touch: arcs are chords here."""
NAME = "collision"


def collision(assembled: Assembled) -> Iterator[Finding]:
    """A finding for every two parts that share space, or one that says none do.

    What is bent round a tube lies on it by construction and is not held against it.
    """
    surfaces = {p.name: placed_surface(p, filled=True) for p in assembled.parts}
    boxes = {name: _box(surface) for name, surface in surfaces.items()}
    solids: dict[str, Any] = {}
    worst = 0.0
    hit = False
    for number, one in enumerate(assembled.parts):
        for other in assembled.parts[:number]:
            if _lies_on(one, other) or not _meet(boxes[one.name], boxes[other.name]):
                continue
            for name in (one.name, other.name):
                if name not in solids:
                    solids[name] = _solid(surfaces[name])
            shared = solids[one.name] ^ solids[other.name]
            volume = float(shared.volume())
            worst = max(worst, volume)
            if volume > TOUCH:
                hit = True
                yield _hit(one, other, volume, _box_of(shared))
    if not hit:
        message = "no two parts run into each other, deflated, at nominal film thickness"
        yield found(NAME, True, TOUCH, worst, message, "mm3")


def _hit(one: PlacedPart, other: PlacedPart, volume: float, at: NDArray[np.float64]) -> Finding:
    x, y, z = at
    return found(
        NAME,
        False,
        TOUCH,
        volume,
        f"{one.name} and {other.name} share {volume:.2f} mm3 round x {x:.1f}, y {y:.1f}, "
        f"z {z:.1f}; move one of them (along, angle, offset, turn) or make it smaller",
        "mm3",
    )


def _lies_on(one: PlacedPart, other: PlacedPart) -> bool:
    return any(
        upper.part.at == "outside" and upper.part.on == lower.name
        for upper, lower in ((one, other), (other, one))
    )


def _box(surface: Surface) -> NDArray[np.float64]:
    import numpy as np

    return np.array([surface.points.min(axis=0), surface.points.max(axis=0)])


def _meet(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return bool((a[0] < b[1]).all() and (b[0] < a[1]).all())


def _box_of(solid: Any) -> NDArray[np.float64]:
    import numpy as np

    low, high = np.array(solid.bounding_box()).reshape(2, 3)
    middle: NDArray[np.float64] = (low + high) / 2
    return middle


def _solid(surface: Surface) -> Any:
    import numpy as np
    from manifold3d import Manifold, Mesh64

    return Manifold(
        Mesh64(
            vert_properties=np.ascontiguousarray(surface.points),
            tri_verts=surface.faces.astype(np.uint64),
        )
    )
