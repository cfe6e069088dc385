"""Prisms over planar regions, and the closed surface of their union."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.meshing.facets import facets

if TYPE_CHECKING:
    import numpy as np
    from manifold3d import CrossSection
    from numpy.typing import NDArray

SAGITTA = 0.002
"""Default height in mm of an arc over its chord."""


class Slab(NamedTuple):
    """A region between two heights in mm."""

    region: Region
    bottom: float
    top: float

    @property
    def volume(self) -> float:
        """Exact volume in mm3: area x thickness."""
        return self.region.area * (self.top - self.bottom)


class Surface(NamedTuple):
    """A triangulated closed surface, normals outward.

    ``points`` (n, 3) float64 in mm; ``faces`` (m, 3) indices of points, counter-clockwise from
    outside.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]

    @property
    def volume(self) -> float:
        """Enclosed volume in mm3."""
        import numpy as np

        a, b, c = (self.points[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def fuse(slabs: Sequence[Slab], sagitta: float = SAGITTA) -> Surface:
    """The surface of the union of slabs that lie on each other, bottom to top.

    Arcs become chords within ``sagitta`` mm of them, of equal area.
    """
    import numpy as np
    from manifold3d import Error, Manifold, OpType

    extrusions: dict[tuple[Region, float], Manifold] = {}
    prisms: list[Manifold] = []
    for slab in slabs:
        bottom = _exact(slab.bottom)
        height = _exact(slab.top) - bottom
        key = slab.region, height
        if key not in extrusions:
            extrusions[key] = Manifold.extrude(_section(slab.region, sagitta), height)
        prisms.append(extrusions[key].translate((0.0, 0.0, bottom)))
    union = Manifold.batch_boolean(prisms, OpType.Add)
    if union.status() != Error.NoError or union.is_empty():
        raise OutputError(
            f"The solid could not be built from its {len(slabs)} films ({union.status().name}); "
            "run the rule deck to find the profile that is at fault."
        )
    mesh = union.to_mesh64()
    points = np.ascontiguousarray(mesh.vert_properties[:, :3], dtype=np.float64)
    return Surface(points, mesh.tri_verts.astype(np.int64))


def _exact(height: float) -> float:
    """The height to a billionth of a mm, in a binary fraction.

    Sums of such numbers are exact, so faces that touch lie at one number.
    """
    return round(height * 2**30) / 2**30


def _section(region: Region, sagitta: float) -> CrossSection:
    import numpy as np
    from manifold3d import CrossSection

    return CrossSection([np.array(facets(contour, sagitta)) for contour in region.contours])
