"""What the manifest says of areas, and what was drawn, against the files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from shapely import Polygon, affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import bond_of
from tests.judge.folder import Folder, asked_kerf, closed_by, pieces, place

SHARE = 1e-4


def judge_claims(folder: Folder) -> Iterator[str]:
    """Areas and pieces are those of the files."""
    yield from _layers(folder)
    yield from _interfaces(folder)


def _slack(folder: Folder, region: BaseGeometry) -> float:
    """mm2 by which an area may differ: arcs drawn as chords, corners that a beam rounds."""
    kerf = max(max(asked_kerf(folder.asked, film) or (0.0, 0.0)) for film in ("tpe", "ptfe"))
    corners = 40 * (kerf / 2) ** 2
    return SHARE * region.area + region.length * (folder.chord_error + 5e-4) + corners


def _layers(folder: Folder) -> Iterator[str]:
    for layer, entry in zip(folder.layers, folder.manifest["layers"], strict=True):
        area = layer.profile.area
        if abs(area - entry["area"]) > _slack(folder, layer.profile):
            yield f"layer {layer.index} has {area:.4f} mm2, stated {entry['area']:.4f}"
        count = len(list(pieces(layer.profile)))
        if count != entry["pieces"]:
            yield f"layer {layer.index} has {count} pieces, stated {entry['pieces']}"
    for film in folder.manifest["films"]:
        own = [layer for layer in folder.layers if layer.material == film["material"]]
        area = sum(layer.profile.area for layer in own)
        slack = sum(_slack(folder, layer.profile) for layer in own)
        copies = folder.copies
        if min(abs(area - film["area"]), abs(copies * area - film["area"])) > slack * copies:
            yield f"{film['material']} has {area:.4f} mm2, stated {film['area']:.4f}"


def _interfaces(folder: Folder) -> Iterator[str]:
    stated = folder.manifest["interfaces"]
    if len(stated) != len(folder.interfaces):
        yield f"{len(stated)} interfaces stated of {len(folder.interfaces)}"
        return
    for interface, entry in zip(folder.interfaces, stated, strict=True):
        contact = interface.below.profile.intersection(interface.above.profile)
        bond = bond_of(interface)
        for name, region in (("contact", contact), ("bond", bond)):
            slack = _slack(folder, contact) + _slack(folder, bond)
            if abs(region.area - entry[f"{name}_area"]) > slack:
                yield (
                    f"the {name} of interface {interface.number} has {region.area:.4f} mm2, "
                    f"stated {entry[f'{name}_area']:.4f}"
                )


# The pockets against what was drawn: same shape, same size, same side up.


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
