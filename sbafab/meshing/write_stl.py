"""Binary STL in millimetres."""

from __future__ import annotations

from pathlib import Path

from sbafab.meshing.surface import Surface


def write_stl(surface: Surface, path: Path) -> None:
    """Write the surface in mm; the format itself carries no unit."""
    import numpy as np

    corners = surface.points.take(surface.faces, axis=0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    records = np.zeros(len(corners), dtype=record)
    normals /= np.where(lengths == 0, 1.0, lengths)
    records["normal"] = normals
    records["corners"] = corners
    # "solid" at the start would make readers take it for the text format.
    header = b"binary STL, millimetres".ljust(80)
    with path.open("wb") as file:
        # Not tofile, which says of a full disk only how much it wrote.
        file.write(header + np.uint32(len(records)).tobytes() + records.tobytes())
