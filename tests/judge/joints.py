"""Seams, faces and folds judged from a folder's files: what bonds, what leaks, what heat spoils.

Bonds are buffers of the seam files' lines; a folded film's halves are its flat part cut along the
fold line, one of them turned over. What the user asked for comes from the design file.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from pathlib import Path
from typing import Any

import shapely
from shapely import LineString, Point, Polygon, affinity
from shapely.geometry.base import BaseGeometry

from tests.judge.bonds import narrow_places
from tests.judge.folder import Disagreement, pieces
from tests.judge.reading import read
from tests.judge.voids import OUTSIDE, Graph, Void, joined, plane_round

CHORDS = 48
"""Chords a quarter turn of a tool."""
SLACK = 0.004
THINNEST = 0.004
WALL = 0.01
"""mm: half the thickness of the wall that stands for a fold, and of the plug of an inlet."""
WELD = 0.02
"""mm2 that two films may share by the chords of arcs."""
FAR = 1e4


@dataclass(frozen=True)
class Film:
    """A structural layer as it lies, and what its upper and its lower face are of."""

    index: int
    profile: BaseGeometry
    upper: str
    lower: str


@dataclass(frozen=True)
class Weld:
    """A seam: its films by index, its tool, and what the tool covers."""

    name: str
    below: int
    above: int
    tool: str
    region: BaseGeometry


@dataclass(frozen=True)
class Gap:
    """Two films that lie next to each other, and the masks between them."""

    number: int
    below: Film
    above: Film
    mask: BaseGeometry
    bond: BaseGeometry
    is_chamber: bool
    fold: LineString | None

    @property
    def contact(self) -> BaseGeometry:
        return self.below.profile.intersection(self.above.profile)


@dataclass(frozen=True)
class Stack:
    """A drawn laminate: films, masks and seams as files and design file give them."""

    asked: dict[str, Any]
    profiles: tuple[BaseGeometry, ...]
    welds: tuple[Weld, ...]

    @property
    def centre(self) -> Point:
        return Point(self.asked["chambers"][0]["centres"][0])

    def folds(self) -> list[tuple[int, int, LineString]]:
        return [(*f["layers"], LineString(f["line"])) for f in self.asked.get("folds", [])]

    @cached_property
    def films(self) -> list[Film]:
        films = []
        turned = {n: bool(row.get("turned")) for n, row in enumerate(self.asked["layers"], 1)}
        for lower, upper, _ in self.folds():
            turned[upper] = not turned[lower]
        for n, row in enumerate(self.asked["layers"], start=1):
            if row["role"].endswith("-mask"):
                continue
            name = row.get("film", "tpe")
            faces = self.asked.get("films", {}).get(name, {}).get("faces")
            upper, lower = (faces["upper"], faces["lower"]) if faces else (name, name)
            if turned[n]:
                upper, lower = lower, upper
            films.append(Film(n, self.profiles[n - 1], upper, lower))
        return films

    def joins(self, below: Film, above: Film, by: str) -> bool:
        table = self.asked.get("face_bonds")
        pair = sorted((below.upper, above.lower))
        if table is None:
            return by != "press" or not any(
                (weld.below, weld.above) == (below.index, above.index) for weld in self.welds
            )
        return any(bond["by"] == by and sorted(bond["faces"]) == pair for bond in table.values())

    @cached_property
    def gaps(self) -> list[Gap]:
        return [
            self._gap(n, *pair)
            for n, pair in enumerate(zip(self.films, self.films[1:], strict=False), 1)
        ]

    def _gap(self, number: int, below: Film, above: Film) -> Gap:
        masks = [self.profiles[n - 1] for n in range(below.index + 1, above.index)]
        mask = shapely.union_all(masks)
        contact = below.profile.intersection(above.profile)
        bond: BaseGeometry = Polygon()
        if self.joins(below, above, "press"):
            bond = contact.difference(mask)
        else:
            between = (below.index, above.index)
            regions = [w.region for w in self.welds if (w.below, w.above) == between]
            bond = contact.intersection(shapely.union_all(regions)).difference(mask)
        roles = [row["role"] for row in self.asked["layers"]]
        is_chamber = "chamber-mask" in roles[below.index : above.index - 1] or (
            not masks and roles[below.index - 1] != "cap" and roles[above.index - 1] != "base"
        )
        fold = next(
            (line for a, b, line in self.folds() if (a, b) == (below.index, above.index)), None
        )
        return Gap(number, below, above, mask, bond, is_chamber, fold)


def swept(line: LineString, width: float, tool: str) -> BaseGeometry:
    """What a tool covers on its way along a line."""
    cap = "flat" if tool == "roller" else "round"
    return line.buffer(width / 2, quad_segs=CHORDS, cap_style=cap, join_style="round")


def open_stack(folder: Path, design: Path) -> Stack:
    """The laminate of a folder's cut files and seam files."""
    asked = tomllib.loads(design.read_text(encoding="utf-8"))
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    regions = [read(folder / layer["file"]).region for layer in manifest["layers"]]
    for number, row in enumerate(asked["layers"]):
        if row.get("turned"):
            regions[number] = affinity.scale(regions[number], -1.0, 1.0, origin=(0, 0))
    centre = Point(asked["chambers"][0]["centres"][0])
    for fold in asked.get("folds", []):
        lower, upper = fold["layers"]
        # Folded, both halves lie on the side of the line where the pocket is.
        near = _half_plane(fold["line"], centre)
        flat = regions[lower - 1]
        regions[lower - 1] = flat.intersection(near)
        regions[upper - 1] = _turned_over(flat.difference(near), fold["line"])
    paths = {seam["name"]: read(folder / seam["file"]) for seam in manifest.get("seams", [])}
    return Stack(
        asked,
        tuple(regions),
        tuple(_welds(asked, lambda name: [contour.line for contour in paths[name].on("SEAM")])),
    )


def drawn_stack(design: Path) -> Stack:
    """The laminate of a design whose shapes are plain polygons, where nothing was written."""
    asked = tomllib.loads(design.read_text(encoding="utf-8"))
    shapes = {
        name: Polygon(shape["polygon"])
        for name, shape in asked["shapes"].items()
        if "polygon" in shape
    }
    profiles = tuple(shapes[row["shape"].removesuffix("-bored")] for row in asked["layers"])
    lines = {seam["name"]: _asked_line(seam) for seam in asked.get("seams", [])}
    return Stack(asked, profiles, tuple(_welds(asked, lambda name: [lines[name]])))


def _asked_line(seam: dict[str, Any]) -> LineString:
    points = seam["path"]
    return LineString([*points, points[0]] if seam.get("closed") else points)


def _welds(asked: dict[str, Any], lines: Any) -> Iterator[Weld]:
    for seam in asked.get("seams", []):
        region = shapely.union_all(
            [swept(line, seam["width"], seam["tool"]) for line in lines(seam["name"])]
        )
        yield Weld(seam["name"], *seam["layers"], seam["tool"], region)


def _half_plane(line: Sequence[Sequence[float]], inside: Point) -> Polygon:
    (x0, y0), (x1, y1) = line
    length = math.hypot(x1 - x0, y1 - y0)
    ux, uy = (x1 - x0) / length * FAR, (y1 - y0) / length * FAR
    if (x1 - x0) * (inside.y - y0) - (y1 - y0) * (inside.x - x0) < 0:
        ux, uy = -ux, -uy
    a, b = (x0 - ux, y0 - uy), (x0 + ux, y0 + uy)
    return Polygon([a, b, (b[0] - uy, b[1] + ux), (a[0] - uy, a[1] + ux)])


def _turned_over(region: BaseGeometry, line: Sequence[Sequence[float]]) -> BaseGeometry:
    (x0, y0), (x1, y1) = line
    angle = math.degrees(math.atan2(y1 - y0, x1 - x0))
    level = affinity.rotate(region, -angle, origin=(x0, y0))
    flipped = affinity.scale(level, 1.0, -1.0, origin=(x0, y0))
    return affinity.rotate(flipped, angle, origin=(x0, y0))


def narrow_bonds(stack: Stack, limit: float = 0.75) -> list[str]:
    """Bonds narrower than the limit; at a fold the film beyond it counts as well."""
    found = []
    for gap in stack.gaps:
        bond = gap.bond
        if gap.fold is not None:
            beyond = _turned_over(bond, list(gap.fold.coords))
            # Chords of both sides may leave a slit that is none.
            bond = bond.union(beyond).buffer(1e-6).buffer(-1e-6)
        for width, x, y in narrow_places(bond, limit - SLACK):
            found.append(f"{width:.3f} mm at gap {gap.number}, x {x:.3f}, y {y:.3f}")
    return found


def leaks(stack: Stack) -> list[str]:
    """Chambers that lose air, reach one another, or have no inlet."""
    plane = plane_round(stack.profiles)
    plugs = {chamber["name"]: _plug(chamber) for chamber in stack.asked["chambers"]}
    walls = shapely.union_all([*plugs.values()])
    voids: dict[int, list[Void]] = {}
    for gap in stack.gaps:
        shut = gap.bond.union(walls) if gap.is_chamber else gap.bond
        if gap.fold is not None:
            shut = shut.union(gap.fold.buffer(WALL, cap_style="square"))
        parts = pieces(plane.difference(shut), THINNEST)
        voids[gap.number] = [Void(("gap", gap.number, n), part) for n, part in enumerate(parts)]
    graph = joined([film.profile for film in stack.films], voids, plane)
    return list(_leaks(stack, graph, voids, plugs))


def _leaks(
    stack: Stack, graph: Graph, voids: dict[int, list[Void]], plugs: dict[str, BaseGeometry]
) -> Iterator[str]:
    levels = [gap.number for gap in stack.gaps if gap.is_chamber]
    pockets: dict[str, list[Void]] = {}
    for chamber in stack.asked["chambers"]:
        centre = Point(chamber["centres"][0])
        for balloon in chamber.get("balloons", range(1, len(levels) + 1)):
            own = voids[levels[balloon - 1]]
            holding = [void for void in own if Polygon(void.region.exterior).contains(centre)]
            if holding:
                innermost = min(holding, key=lambda void: Polygon(void.region.exterior).area)
                pockets.setdefault(chamber["name"], []).append(innermost)
    for name, own in pockets.items():
        reached = graph.reached(own[0].node)
        if OUTSIDE in reached:
            yield f"{name} leaks"
        if any(void.node not in reached for void in own):
            yield f"{name} has a pocket that its inlet does not reach"
        if any(void.node in reached for key in pockets.keys() - {name} for void in pockets[key]):
            yield f"{name} reaches another chamber"
        if all(void.region.distance(plugs[name]) > 2 * WALL for void in own):
            yield f"{name} has no inlet"


def _plug(chamber: dict[str, Any]) -> BaseGeometry:
    """The end of an inlet, shut by its tube: a wall across the mouth."""
    x, y = chamber["mouth"]
    angle = math.radians(chamber["angle"])
    across = -math.sin(angle), math.cos(angle)
    half = chamber["width"] / 2 + 0.02
    ends = [(x + side * half * across[0], y + side * half * across[1]) for side in (-1, 1)]
    return LineString(ends).buffer(WALL, cap_style="flat")


def spoiled(stack: Stack, order: Sequence[str]) -> list[str]:
    """What seams made in this order weld by mistake, or cannot reach; each joins all in hand."""
    welds = {weld.name: weld for weld in stack.welds}
    bodies = [{film.index} for film in stack.films]
    found = []
    for name in order:
        weld = welds[name]
        hand = set().union(*(b for b in bodies if b & {weld.below, weld.above}))
        bodies = [b for b in bodies if not b & hand] + [hand]
        for gap in stack.gaps:
            pair = gap.below.index, gap.above.index
            if pair == (weld.below, weld.above) or not {*pair} <= hand:
                continue
            if stack.joins(gap.below, gap.above, weld.tool):
                area = _open(stack, gap).intersection(weld.region).area
                if area > WELD:
                    found.append(f"{name} welds layers {pair[0]} and {pair[1]}, {area:.3f} mm2")
        covers = [
            [f for f in stack.films if f.index in hand and f.index > weld.above],
            [f for f in stack.films if f.index in hand and f.index < weld.below],
        ]
        if all(any(f.profile.intersection(weld.region).area > WELD for f in c) for c in covers):
            found.append(f"{name} is covered from both sides")
    return found


def _open(stack: Stack, gap: Gap) -> BaseGeometry:
    """What must not weld: a chamber's pocket, and between chambers all that is not bonded."""
    bare = gap.contact.difference(gap.bond).difference(gap.mask)
    if not gap.is_chamber:
        return bare
    holding = [p for p in pieces(bare) if Polygon(p.exterior).contains(stack.centre)]
    return min(holding, key=lambda p: Polygon(p.exterior).area) if holding else bare


def has_an_order(stack: Stack) -> bool:
    """Return True if the seams can be made in any order at all."""
    names = [weld.name for weld in stack.welds]
    return any(not spoiled(stack, order) for order in permutations(names))


def judge_joints(folder: Path, design: Path, verdicts: dict[str, str]) -> Iterator[Disagreement]:
    """The program's verdicts on bonds and voids, and its order, against the files' own."""
    stack = open_stack(folder, design)
    for rule, faults in (("bond-width", narrow_bonds(stack)), ("sealing", leaks(stack))):
        if (verdicts[rule] == "pass") != (not faults):
            yield Disagreement(rule, f"the program says {verdicts[rule]}; {faults[:2]}")
    press = json.loads((folder / "press.json").read_text(encoding="utf-8"))
    seams = sorted(press.get("seams", []), key=lambda seam: seam["step"])
    for fault in spoiled(stack, [seam["seam"] for seam in seams]):
        yield Disagreement("order", fault)
