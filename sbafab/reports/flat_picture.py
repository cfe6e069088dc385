"""Pictures of an actuator that no model inflates: flat, as PNG and as GLB for viewers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.reports.inflated_picture import ENDINGS, MOVING

WHY = "no model inflates pockets that are not nearly round, or stand round a tube"


def write_flat_picture(laminate: Laminate, path: Path, width: int, height: int) -> None:
    """Writes ``path``, as what its ending says: the solid before inflation, so named in a PNG.

    Raises DesignError for the ending of a moving picture, and for one that is none of ENDINGS.
    """
    ending = path.suffix.lower()
    if ending in MOVING:
        raise DesignError(
            f"{path.name} would show {laminate.name} move, but {WHY}: a .png or .glb shows it "
            "flat, and sbafab simulate inflates it"
        )
    if ending == ".png":
        from sbafab.reports.solid_png import solid_png

        told = replace(laminate, notes=(WHY,))
        path.write_bytes(solid_png(told, width, height))
    elif ending == ".glb":
        from sbafab.meshing.solid import solid
        from sbafab.meshing.write_glb import write_glb

        write_glb(solid(laminate), path, laminate.bonded_materials)
    else:
        raise DesignError(f"{path.name} must end in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")
