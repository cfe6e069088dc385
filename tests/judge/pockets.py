"""The pockets against what was drawn: same shape, same size, same side up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from shapely import Polygon, affinity

from tests.judge.folder import Folder, asked_kerf, closed_by, pieces, place

OFF = 0.003
"""mm: the program's arcs stay within half a micrometre of a drawn curve."""


def judge_pockets(folder: Folder, drawn: Sequence[Polygon]) -> Iterator[str]:
    """``drawn`` holds the pocket of every balloon, round (0, 0), bottom to top."""
    masks = [layer for layer in folder.layers if layer.role == "chamber-mask"]
    off = OFF + folder.chord_error + folder.slack
    kerf = asked_kerf(folder.asked, "ptfe")
    for mask, pocket in zip(masks, drawn, strict=True):
        for part in pieces(mask.profile):
            filled = Polygon(part.exterior)
            home = _axis(folder, part)
            if home is None:
                continue
            turn = _turn(folder, home)
            meant = affinity.translate(affinity.rotate(pocket, turn, origin=(0, 0)), *home)
            missing = meant.buffer(-off).difference(filled)
            cut = closed_by(meant, kerf).buffer(off)
            more = filled.difference(cut) if mask is not masks[0] else Polygon()
            for what, region in (("lacks", missing), ("has more by", more)):
                if not region.is_empty:
                    yield (
                        f"mask {mask.index} {what} {region.area:.4f} mm2 of what was drawn, at "
                        f"{place(region)}"
                    )
    if len(masks) != len(drawn):
        yield f"{len(masks)} chamber masks for {len(drawn)} balloons"


def _axis(folder: Folder, part: Polygon) -> tuple[float, float] | None:
    """The axis of a pocket: the middle of its bore; without one known only for 1-DoF."""
    if folder.asked["family"] == "1dof":
        return 0.0, 0.0
    bore = float(folder.wish("bore", "diameter", 1.04))
    inlet_side = [
        ring.centroid
        for ring in map(Polygon, part.interiors)
        if abs(2 * math.sqrt(ring.area / math.pi) - bore) < 0.02 + folder.chord_error
        and any(
            math.dist(ring.centroid.coords[0], (entry["x"], entry["y"])) < 0.01
            for entry in folder.manifest["bores"]
        )
    ]
    if len(inlet_side) != 1:
        return None
    return float(inlet_side[0].x), float(inlet_side[0].y)


def _turn(folder: Folder, home: tuple[float, float]) -> float:
    if folder.asked["family"] != "lobed":
        return 0.0
    return math.degrees(math.atan2(home[1], home[0]))
