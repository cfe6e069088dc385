"""What manifest and traveller say of sizes and areas, against the files."""

from __future__ import annotations

import hashlib
import html
import re
from collections.abc import Iterator

import numpy as np
import shapely
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import bond_of
from tests.judge.folder import Disagreement, Folder, Layer, asked_kerf, pieces

SHARE = 1e-4
SIZE = 0.002
"""mm by which a stated size may differ."""
STRIP = 0.04
"""mm, about, of an inlet strip and its fillets that are not told apart from their pocket."""
CIRCLE = re.compile(r"Diameter round the axis, without [a-z ]+?\s+([\d.]+)\s*mm")
OVERALL = re.compile(r"Diameter round the axis, with [a-z ]+?\s+([\d.]+)\s*mm")
LIMITS = re.compile(r"\bLIMITS\s+9\s+\$CUSTOMPROPERTY\s+1\s+([^\n]*)")
EXTENT = re.compile(r"Overall (width|length), with [a-z ]+?\s+([\d.]+)\s*mm")


def judge_claims(folder: Folder) -> Iterator[Disagreement]:
    """Areas, pieces and sizes are those of the files, and the files those of the hashes."""
    yield from _files(folder)
    yield from _layers(folder)
    yield from _interfaces(folder)
    yield from _sizes(folder)
    yield from _lowered(folder)


def _lowered(folder: Folder) -> Iterator[Disagreement]:
    """Limits below the paper's are named in every cut file."""
    names = {
        name.replace("_", " ")
        for name, usual in (("bond_width", 0.75), ("mask_overhang", 0.5))
        if float(folder.wish("rules", name, usual)) < usual
    }
    for file in {layer.file for layer in folder.layers} if names else ():
        text = (folder.path / file).read_text(encoding="utf-8")
        stated = LIMITS.search(text)
        said = stated.group(1).replace("_", " ").replace("-", " ") if stated else "nothing"
        if any(name not in said for name in names):
            yield Disagreement("claims", f"{file} says {said} of limits that are lowered")


def _files(folder: Folder) -> Iterator[Disagreement]:
    for name, stated in folder.manifest["files"].items():
        path = folder.path / name
        if not path.is_file():
            yield Disagreement("claims", f"{name} is listed and missing")
        elif hashlib.sha256(path.read_bytes()).hexdigest() != stated:
            yield Disagreement("claims", f"{name} is not the file that is listed")


def _slack(folder: Folder, region: BaseGeometry) -> float:
    """mm2 by which an area may differ: arcs drawn as chords, corners that a beam rounds."""
    kerf = max(max(asked_kerf(folder.asked, film) or (0.0, 0.0)) for film in ("tpe", "ptfe"))
    corners = 40 * (kerf / 2) ** 2
    return SHARE * region.area + region.length * (folder.chord_error + 5e-4) + corners


def _layers(folder: Folder) -> Iterator[Disagreement]:
    for layer, entry in zip(folder.layers, folder.manifest["layers"], strict=True):
        area = layer.profile.area
        if abs(area - entry["area"]) > _slack(folder, layer.profile):
            yield Disagreement(
                "claims", f"layer {layer.index} has {area:.4f} mm2, stated {entry['area']:.4f}"
            )
        count = len(list(pieces(layer.profile)))
        if count != entry["pieces"]:
            yield Disagreement(
                "claims", f"layer {layer.index} has {count} pieces, stated {entry['pieces']}"
            )
    for film in folder.manifest["films"]:
        own = [layer for layer in folder.layers if layer.material == film["material"]]
        area = sum(layer.profile.area for layer in own)
        slack = sum(_slack(folder, layer.profile) for layer in own)
        copies = folder.copies
        if min(abs(area - film["area"]), abs(copies * area - film["area"])) > slack * copies:
            yield Disagreement(
                "claims", f"{film['material']} has {area:.4f} mm2, stated {film['area']:.4f}"
            )


def _interfaces(folder: Folder) -> Iterator[Disagreement]:
    stated = folder.manifest["interfaces"]
    if len(stated) != len(folder.interfaces):
        yield Disagreement("claims", f"{len(stated)} interfaces stated of {len(folder.interfaces)}")
        return
    for interface, entry in zip(folder.interfaces, stated, strict=True):
        contact = interface.below.profile.intersection(interface.above.profile)
        bond = bond_of(interface)
        for name, region in (("contact", contact), ("bond", bond)):
            slack = _slack(folder, contact) + _slack(folder, bond)
            if abs(region.area - entry[f"{name}_area"]) > slack:
                yield Disagreement(
                    "claims",
                    f"the {name} of interface {interface.number} has {region.area:.4f} mm2, "
                    f"stated {entry[f'{name}_area']:.4f}",
                )


def _sizes(folder: Folder) -> Iterator[Disagreement]:
    whole = shapely.union_all([layer.profile for layer in folder.layers])
    low_x, low_y, high_x, high_y = whole.bounds
    slack = SIZE + folder.chord_error + folder.slack
    measured = {
        "thickness": sum(layer.thickness for layer in folder.layers),
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    stated = folder.manifest["sizes"]
    for name, value in measured.items():
        if abs(stated[name] - value) > slack:
            yield Disagreement("claims", f"the {name} is {value:.3f}, stated {stated[name]:.3f}")
    circles = [stated["outline_diameter"]] if "outline_diameter" in stated else []
    overall = [stated["overall_diameter"]] if "overall_diameter" in stated else []
    page = folder.path / "traveller.html"
    if page.is_file():
        text = re.sub(r"<[^>]*>", " ", html.unescape(page.read_text(encoding="utf-8")))
        told = CIRCLE.findall(text)
        if len(told) != len(circles):
            yield Disagreement("claims", f"the traveller tells {len(told)} circles that it fits")
        circles += [float(found) for found in told]
        overall += [float(found) for found in OVERALL.findall(text)]
        for name, value in EXTENT.findall(text):
            if abs(float(value) - measured[name.lower()]) > slack + 0.001:
                yield Disagreement(
                    "claims", f"the traveller says {name.lower()} {value}, which is not the files'"
                )
    far = shapely.get_coordinates(whole)
    around = 2 * float(np.hypot(far[:, 0], far[:, 1]).max())
    for circle in overall:
        if abs(circle - around) > 2 * slack:
            yield Disagreement("claims", f"all is said to fit {circle:g}, and takes {around:.3f}")
    yield from _circles(folder, circles, slack + 0.0006)


def _circles(folder: Folder, circles: list[float], slack: float) -> Iterator[Disagreement]:
    """A circle that is stated holds all films but tabs, and is no larger than it must be."""
    if not circles:
        return
    body = shapely.union_all([_without_tab(folder, film) for film in folder.films])
    # Round the axis: what lies farther out on one side cannot be turned inside a tube.
    least = 2 * shapely.minimum_bounding_radius(body)
    far = shapely.get_coordinates([film.profile for film in folder.films])
    most = 2 * float(np.hypot(far[:, 0], far[:, 1]).max())
    for circle in circles:
        if not least - STRIP - slack <= circle <= most + slack:
            yield Disagreement(
                "claims", f"it is said to fit a circle of {circle:g}, and takes {least:.3f}"
            )


def _without_tab(folder: Folder, film: Layer) -> BaseGeometry:
    """A film that has tabs or ears as its pocket and the bond round it, others as they are."""
    if film.balloon is None or (film.balloon != 1 and folder.method != "ears"):
        return film.profile
    if film.balloon == 1 and folder.wish("chamber", "outline", None) is not None:
        return Point(0, 0)  # the second balloon is the same without a tab
    bond = float(folder.wish("bond", "width", 0.75))
    pocket = next(
        layer.profile
        for layer in folder.layers
        if layer.balloon == film.balloon and layer.role == "chamber-mask"
    )
    if film.balloon != 1:
        return shapely.union_all([Polygon(p.exterior).buffer(bond) for p in pieces(pocket)])
    # Where a disc nearly as wide as the pocket cannot go is its strip; what lies beyond is a tail.
    diameter = folder.wish("chamber", "diameter", 5.0)
    radius = float(diameter[0] if isinstance(diameter, list) else diameter) / 2
    widest = 0.99 * (radius - folder.chord_error)
    bodies = [Point(0, 0)]
    for part in pieces(pocket):
        wide = pieces(Polygon(part.exterior).buffer(-widest).buffer(widest))
        nearest = min(wide, key=lambda body: body.distance(Point(0, 0)), default=None)
        bodies += [] if nearest is None else [nearest.buffer(bond)]
    return shapely.union_all(bodies)
