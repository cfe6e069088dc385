"""Film sheets as sbafab writes them, and what other programs must find on them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import shapely
from pyogrio import raw

from sbafab.actuators import load_design
from sbafab.cutting.cut_settings import Curves, DxfProfile
from sbafab.folders.run import Run, RunRequest, generate
from sbafab.laminate.films import Material

DESIGNS = {"3dof-15mm": 4, "radial-15mm": 2}
"""Balloons by template: as many as go on one sheet of each film."""
NAMES = [f"{design} {material}" for design in DESIGNS for material in ("TPE", "PTFE")]
WIDTH, LENGTH, BORDER = 120.0, 75.0, 10.0
"""mm; no square, so that axes in the wrong order are seen."""
PROFILES: tuple[DxfProfile, ...] = ("bulges", "arcs")
EXACT = 1e-3
"""What the area of a sheet may be off, of itself."""


class Sheet(NamedTuple):
    """One film sheet; the areas of its contours in mm2, least first, are the laminate's."""

    files: dict[DxfProfile, Path]
    picture: Path
    outers: list[float]
    holes: list[float]

    @property
    def film(self) -> float:
        return sum(self.outers) - sum(self.holes)


def write_design(design: str, profile: DxfProfile, folder: Path) -> Run:
    """Cut files only, on the small sheets of these tests."""
    sizes = [
        f"sheets.{film}.{key}"
        for film in ("tpe", "ptfe")
        for key in (f"width={WIDTH}", f"length={LENGTH}", f"border={BORDER}")
    ]
    overrides = [
        "order.spares=0",
        "order.spare_share=0",
        f"stack.balloons={DESIGNS[design]}",
        *sizes,
    ]
    return generate(
        RunRequest(load_design(design, overrides), folder / profile, ("cut",), Curves(profile)),
        None,
    )


def sheet_of(runs: dict[DxfProfile, Run], material: Material) -> Sheet:
    run = runs["bulges"]
    profiles = [layer.profile for layer in run.laminate.layers if layer.film.material == material]
    return Sheet(
        {profile: made.folder / f"sheets/{material}_1.dxf" for profile, made in runs.items()},
        run.folder / f"sheets/{material}_1.svg",
        sorted(contour.area for profile in profiles for contour in profile.outers),
        sorted(-contour.area for profile in profiles for contour in profile.holes),
    )


def outline_bounds(path: Path) -> tuple[float, float, float, float]:
    """Least x and y and most x and y of the outlines of a cut file, as GDAL reads them."""
    _, _, shapes, (names,) = raw.read(path, columns=["Layer"])
    outlines = [shape for shape, name in zip(shapes, names, strict=True) if name == "CUT_OUTER"]
    low_x, low_y, high_x, high_y = shapely.total_bounds(shapely.from_wkb(outlines))
    return float(low_x), float(low_y), float(high_x), float(high_y)
