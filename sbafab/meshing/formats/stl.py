"""Binary STL in millimetres."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

AT_ONCE = 8192
"""Triangles worked out together: few enough that their numbers stay in the processor's cache."""


def write_stl(surface: Surface, path: Path, _material: str = "") -> None:
    """Write the surface in mm; the format itself has no place for a unit or a material."""
    import numpy as np

    places = np.ascontiguousarray(surface.points.T)
    # "solid" at the start would make readers take it for the text format.
    parts = [b"binary STL, millimetres".ljust(80), np.uint32(len(surface.faces)).tobytes()]
    for first in range(0, len(surface.faces), AT_ONCE):
        parts.append(_records(places, surface.faces[first : first + AT_ONCE]))
    # Not tofile, which says of a full disk only how much it wrote.
    path.write_bytes(b"".join(parts))


def _records(places: NDArray[np.float64], faces: NDArray[np.int64]) -> bytes:
    """A record a triangle: its normal, its corners and two spare bytes."""
    import numpy as np

    a, b, c = (places.take(corner, axis=1) for corner in faces.T)
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    lengths = np.sqrt(x * x + y * y + z * z)
    lengths[lengths == 0] = 1.0
    records = np.zeros(len(faces), dtype=[("numbers", "<f4", 12), ("spare", "<u2")])
    columns = records["numbers"].T
    for column, number in zip(
        columns, [x / lengths, y / lengths, z / lengths, *a, *b, *c], strict=True
    ):
        column[:] = number
    return records.tobytes()
