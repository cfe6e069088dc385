"""PLY: a surface, binary in double precision."""

from __future__ import annotations

from pathlib import Path

from sbafab.meshing.surface import Surface

FACE = [("count", "u1"), ("nodes", "<i4", 3)]


def write_ply(surface: Surface, path: Path) -> None:
    """Write a surface; lengths are mm."""
    import numpy as np

    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(surface.points)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(surface.faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    faces = np.empty(len(surface.faces), dtype=FACE)
    faces["count"] = 3
    faces["nodes"] = surface.faces
    points = surface.points.astype("<f8")
    content = "\n".join([*header, ""]).encode() + points.tobytes() + faces.tobytes()
    path.write_bytes(content)
