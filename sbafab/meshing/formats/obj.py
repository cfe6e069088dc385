"""OBJ: a surface as text."""

from __future__ import annotations

from pathlib import Path

from sbafab.meshing.surface import Surface

POINT = "v %.10g %.10g %.10g\n"
FACE = "f %d %d %d\n"


def write_obj(surface: Surface, path: Path) -> None:
    """Write a surface; lengths are mm."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("".join(POINT % tuple(p) for p in surface.points.tolist()))
        file.write("".join(FACE % tuple(f) for f in (surface.faces + 1).tolist()))
