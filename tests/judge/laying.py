"""The traveller's lay-up and press steps against the files: what is laid, along what, held how."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from tests.judge.folder import Folder, Layer, pieces
from tests.judge.page import NUMBERS, PinHole, listed, pin_holes, rows, standing, words

HOLE = 0.012
"""mm by which a hole's middle or its diameter may differ from what the page says."""
SHOWN = 0.0051
"""mm by which a figure with two digits behind the point may be off."""
EDGE = 0.04
"""mm by which an edge may lie elsewhere than said, so that no hand sees it."""
TABS = 0.6
"""Share of an outline of many chambers that may be tabs, where the rest is laid along."""
APART = 0.2
"""mm between the points at which edges are held against each other."""
FLOOR, LENGTH, DEPTH = 1.0, 0.25, 0.05
"""mm of plate under a pin, and by how much a pin's length (ISO 8734) and a depth may be off."""
LAID = re.compile(r"\b(TPE|PTFE) ([a-z ]+?) (P\d+)")
ALONG = r"(?:([\d.]+) mm )?(on|outside|inside) that of the (?:TPE|PTFE) [a-z ]+ below"
WHOLE = r", (all round(?: but for the tabs)?)"
BY_HAND = re.compile(
    r"(?:No|One) pin holds (P\d+)(?: in layers? ([^:]+))?: "
    rf"(?:lay|turn) by eye, (?:its|each) edge {ALONG}{WHOLE}"
)
NUMBERED = re.compile(rf"Lay (?:its|each) edge (?:\(layer (\d+)\) )?(.*? below \(layer.*?){WHOLE}")
STACK = re.compile(r"Lay the (?:stack|\d+ stacks) from step \d+ \(layers? ([^)]*)\)")
BESIDE = re.compile(rf"{ALONG} \(layer (\d+)\)")


def judge_laying(folder: Folder, page: Any, of: dict[int, str]) -> Iterator[str]:
    """The table of the whole stack, and every press step; ``of`` is the pattern of each layer."""
    yield from _stacked(folder, page, of, _held(folder, page))
    yield from _laid(folder, page, of)
    yield from _set(folder, page)


def role(layer: Layer) -> str:
    return layer.role.replace("-", " ")


@cache
def _rings(profile: BaseGeometry) -> tuple[tuple[float, float, float], ...]:
    """Middles of the holes in a profile, and the diameters of circles as large."""
    found = []
    for piece in pieces(profile):
        for ring in piece.interiors:
            hole = Polygon(ring)
            middle = hole.centroid
            found.append((middle.x, middle.y, 2 * math.sqrt(hole.area / math.pi)))
    return tuple(found)


def _held(folder: Folder, page: Any) -> dict[int, set[str]]:
    """Layers, and the pins that stand in the plate when they are laid and whose hole they have."""
    found: dict[int, set[str]] = {}
    by_index = {layer.index: layer for layer in folder.layers}
    holes = {hole.pin: hole for hole in pin_holes(page)}
    for step in page.xpath("//article[@class='step']"):
        stand = [holes[standing.pin] for standing in standing(step)]
        for item in step.xpath(".//li[@data-layers]"):
            for index in map(int, item.get("data-layers").split()):
                rings = _rings(by_index[index].profile)
                found[index] = {pin.pin for pin in stand if _has_hole(rings, pin)}
    return found


def _has_hole(rings: Iterable[tuple[float, float, float]], pin: PinHole) -> bool:
    return any(
        math.dist(pin.datum, (x, y)) < HOLE and abs(d - pin.films) < HOLE for x, y, d in rings
    )


def _stacked(
    folder: Folder, page: Any, of: dict[int, str], held: dict[int, set[str]]
) -> Iterator[str]:
    """The table of the whole stack, its turns written out: every layer once, from the lowest."""
    groups: list[tuple[int, list[dict[str, str]]]] = []
    before = None
    for row in rows(page, "Repeat", "Layers", "Pattern"):
        often = row["Repeat"]
        turns = 1 if often == "once" else int(NUMBERS.findall(often)[0])
        if turns > 1 and before == often:
            groups[-1][1].append(row)
        else:
            groups.append((turns, [row]))
        before = often if turns > 1 else None
    order: list[int] = []
    for turns, group in groups:
        columns = [listed(row["Layers"]) for row in group]
        if any(len(column) != turns for column in columns):
            yield f"{turns} turns, and layers {columns}"
            continue
        order += [column[turn] for turn in range(turns) for column in columns]
        for row, column in zip(group, columns, strict=True):
            yield from _row(folder, row, column, of, held)
    if order != [layer.index for layer in folder.layers]:
        yield f"the whole stack is said to be {order}"


def _row(
    folder: Folder,
    row: dict[str, str],
    column: tuple[int, ...],
    of: dict[int, str],
    held: dict[int, set[str]],
) -> Iterator[str]:
    by_index = {layer.index: layer for layer in folder.layers}
    said = row["Pins that hold it"]
    names = set() if said.startswith("none") else set(re.split(r", | and ", said))
    for index in column:
        layer = by_index[index]
        wrong = [
            of[index] != row["Pattern"],
            layer.material != row["Film"],
            role(layer) != row["Used as"],
            len(list(pieces(layer.path))) != int(row["Pieces"]),
        ]
        if any(wrong):
            yield f"layer {index} is listed as {row}"
        if names != held.get(index):
            yield (
                f"layer {index} is said to be held by {said}, and has holes for "
                f"{sorted(held.get(index, ()))}"
            )


def _laid(folder: Folder, page: Any, of: dict[int, str]) -> Iterator[str]:
    """Every layer is laid once, in the step of press.json, as what it is, along what is said."""
    seen: list[int] = []
    for number, step in enumerate(page.xpath("//article[@class='step']"), start=1):
        adds: list[int] = []
        lying: list[int] = []
        for item in step.xpath(".//li"):
            said = words(item)
            indices = [int(index) for index in item.get("data-layers", "").split()]
            stack = STACK.match(said)
            lying += listed(stack.group(1)) if stack else ()
            yield from _named(folder, said, indices, of)
            yield from _by_hand(folder, said, [*lying, *indices], indices, of)
            yield from _along(folder, said, indices)
            adds += indices
            lying += indices
        seen += adds
        if folder.press is not None:
            wanted = folder.press["steps"][number - 1]["adds"]
            if sorted(adds) != wanted:
                yield f"step {number} lays {adds}, not {wanted}"
    if sorted(seen) != [layer.index for layer in folder.layers]:
        yield f"its steps lay the layers {seen}"


def _named(folder: Folder, said: str, indices: list[int], of: dict[int, str]) -> Iterator[str]:
    """What a line lays: as many names as layers, or as many as a turn has."""
    by_index = {layer.index: layer for layer in folder.layers}
    named = LAID.findall(re.split(r" (?:No|One) pin holds", said)[0])
    if not named:
        return
    for place, index in enumerate(indices):
        layer = by_index[index]
        if named[place % len(named)] != (layer.material, role(layer), of[index]):
            yield f"layer {index} is laid as {named[place % len(named)]}"


def _by_hand(
    folder: Folder, said: str, lying: list[int], indices: list[int], of: dict[int, str]
) -> Iterator[str]:
    """Edges that are laid along others lie so in the files, wherever this line lays them."""
    for pattern, those, far, way, whole in BY_HAND.findall(said):
        named = listed(those) if those else indices
        for index in (index for index in named if of[index] == pattern):
            below = [other for other in lying if other < index]
            if below:
                yield from _beside(folder, (index, max(below)), far, way, whole)


def _along(folder: Folder, said: str, indices: list[int]) -> Iterator[str]:
    """The same where the line names the layers: its own, if it is the lowest of a stack."""
    for own, along, whole in NUMBERED.findall(said):
        for far, way, other in BESIDE.findall(along):
            yield from _beside(folder, (int(own or indices[0]), int(other)), far, way, whole)


def _beside(folder: Folder, pair: tuple[int, int], far: str, way: str, whole: str) -> Iterator[str]:
    own, other = ({layer.index: layer.profile for layer in folder.layers}[i] for i in pair)
    wanted = float(far or 0) * (-1 if way == "inside" else 1)
    gaps = _outside(own, other)
    off = np.abs(gaps - wanted) > EDGE + folder.chord_error
    if np.mean(off) > (TABS if "tabs" in whole else 0.0):
        yield (
            f"layer {pair[0]} is to lie {far} {way} layer {pair[1]} {whole}, and lies "
            f"{gaps.min():.2f} to {gaps.max():.2f} mm outside"
        )


def _outside(profile: BaseGeometry, other: BaseGeometry) -> np.ndarray[Any, np.dtype[np.float64]]:
    """How far points of a profile's outline lie outside another's outline; below 0 inside."""
    rings = [Polygon(piece.exterior).exterior for piece in pieces(profile)]
    points = np.concatenate([ring.interpolate(np.arange(0, ring.length, APART)) for ring in rings])
    whole = MultiPolygon([Polygon(piece.exterior) for piece in pieces(other)])
    gaps = shapely.distance(whole.boundary, points)
    return np.where(shapely.contains(whole, points), -gaps, gaps)


def _set(folder: Folder, page: Any) -> Iterator[str]:
    """Dials, heights of pins and of the stack."""
    bill = {row["Item"]: row["What"] for row in rows(page, "Item", "What", "Quantity")}
    plate = float(NUMBERS.findall(bill["Base plate"])[0])
    thick = {layer.index: layer.thickness for layer in folder.layers}
    steps = (folder.press or {"steps": []})["steps"]
    shown = page.xpath("//article[@class='step']")
    if folder.press is not None and len(shown) != len(steps):
        yield f"it has {len(shown)} steps, and press.json {len(steps)}"
        return
    for number, (step, asked) in enumerate(zip(shown, steps, strict=True), start=1):
        said = words(step)
        dials = words(step.xpath(".//table[@class='dials']/tbody")[0])
        for wanted in (
            f"{asked['temperature_c']:g} °C",
            f"{asked['force_n']:.0f} N",
            f"{asked['minutes']:g} min",
        ):
            if wanted not in dials:
                yield f"step {number} shows {dials}, not {wanted}"
        height = sum(thick[index] for index in asked["layers"])
        flat = re.search(r"the stack lies flat \(about ([\d.]+) mm\)", said)
        if flat and abs(float(flat.group(1)) - height) > 0.0006:
            yield f"step {number} is {height:.3f} mm high, not {flat.group(1)}"
        for pin in standing(step):
            over = (pin.low + pin.high) / 2
            if abs(pin.inside + over - pin.length) > 2 * SHOWN or pin.inside > plate - FLOOR:
                yield f"step {number} divides its length wrongly: {pin}"
            if (pin.high - pin.low) / 2 < LENGTH + DEPTH - SHOWN:
                yield f"step {number} wants truer pins: {pin}"
            paper = "Tape a fresh print" in said
            below = float(folder.wish("press", "release_thickness", 0.05))
            below += float(folder.wish("press", "underlay_thickness", 0.1)) if paper else 0.0
            if pin.clear <= 0 or abs(pin.low - pin.clear - height - below) > 2 * SHOWN + 1e-9:
                yield f"step {number} is {height:.3f} mm high: {pin}"
