"""Random designs of every family, as a user would type them; some break rules, and may.

Nothing of sbafab is used. Values are drawn wide: what counts here is what gets past the rules.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import ezdxf
import numpy as np
import tomli_w
from scipy.interpolate import BSpline
from shapely import LineString, Point, Polygon

from tests.judge.reading import bulged

PROFILES = ("bulges", "bulges", "arcs", "chords")
CHORD_ERRORS = (0.001, 0.005, 0.02, 0.05, 0.1)


class Draft(NamedTuple):
    """A design file as tables, the drawing beside it, how it is cut, and the pockets it means."""

    tables: dict[str, Any]
    drawing: Drawing | None
    dxf_profile: str
    chord_error: float
    pockets: tuple[Polygon, ...]

    @property
    def name(self) -> str:
        return str(self.tables["name"])

    def write(self, folder: Path) -> Path:
        """The design file, written into ``folder`` with its drawing."""
        folder.mkdir(parents=True, exist_ok=True)
        if self.drawing is not None:
            (folder / self.drawing.name).write_text(self.drawing.text, encoding="utf-8")
        path = folder / f"{self.name}.toml"
        path.write_text(tomli_w.dumps(self.tables), encoding="utf-8")
        return path

    @property
    def options(self) -> list[str]:
        """What is typed behind the design's name."""
        if self.dxf_profile == "bulges":
            return []
        typed = ["--dxf-profile", self.dxf_profile]
        if self.dxf_profile == "chords":
            typed += ["--chord-error", f"{self.chord_error:g}"]
        return typed


def draft(seed: int, number: int, most_balloons: int = 4) -> Draft:
    """The design of a seed and number: always the same one."""
    rng = Random(f"{seed}/{number}")
    family = rng.choice(("1dof", "1dof", "lobed", "lobed", "radial"))
    tables = _common(rng, f"s{seed}n{number}", family, most_balloons)
    profile = rng.choice(PROFILES)
    if profile == "chords" and _is_pair(tables) and rng.random() < 0.9:
        profile = "arcs"  # as the program would say
    chord_error = rng.choice(CHORD_ERRORS) if profile == "chords" else 0.0
    drawn, pockets = _pockets(rng, tables)
    return Draft(tables, drawn, profile, chord_error, pockets)


def beside(first: Draft, second: Draft) -> Draft:
    """The second draft on the first one's sheets, cut as that is: what may be cut together."""
    tables = dict(second.tables)
    for section in ("laser", "sheets"):
        tables.pop(section, None)
        if section in first.tables:
            tables[section] = first.tables[section]
    drawn = second.drawing
    if drawn is not None:
        drawn = drawn._replace(name=drawn.name.replace("pocket", "other"))
        tables["chamber"] = {**tables["chamber"], "outline": drawn.name}
    return Draft(tables, drawn, first.dxf_profile, first.chord_error, second.pockets)


def _mm(rng: Random, low: float, high: float, digits: int = 3) -> float:
    return round(rng.uniform(low, high), digits)


def _is_pair(tables: dict[str, Any]) -> bool:
    return any(isinstance(width, list) for width in tables.get("laser", {}).values())


def _common(rng: Random, name: str, family: str, most_balloons: int) -> dict[str, Any]:
    balloons = rng.choice([1, 2, 2, 3, 3, 4, 5])
    tables: dict[str, Any] = {
        "name": name,
        "family": family,
        "stack": {"balloons": min(balloons, most_balloons)},
        "rules": {"yield_builds": 100, "worst_bond_width": 0, "worst_mask_overhang": 0},
        "registration": {"method": rng.choice(["channel-pin", "ears"])},
    }
    if tables["registration"]["method"] == "ears" and rng.random() < 0.3:
        tables["registration"]["pin_diameter"] = _mm(rng, 0.95, 2.0)
    if rng.random() < 0.4:
        tables["bond"] = {"width": _mm(rng, 0.75, 1.6)}
    if rng.random() < 0.4:
        tables["mask"] = {"overhang": _mm(rng, 0.5, 1.2)}
    if rng.random() < 0.1:
        tables["rules"] |= {"bond_width": 0.4, "mask_overhang": 0.3}
        tables["bond"] = {"width": _mm(rng, 0.4, 0.75)}
        tables["mask"] = {"overhang": _mm(rng, 0.3, 0.5)}
    if rng.random() < 0.5:
        tables["bore"] = {"diameter": _mm(rng, 0.8, 1.6)}
    if rng.random() < 0.6:
        tables["fillet"] = {"radius": rng.choice([0.0, 0.3, 1.0, 2.0, 4.0, _mm(rng, 0.05, 5.0)])}
    tables["inlet"] = _inlet(rng)
    tables |= _cutting(rng)
    if rng.random() < 0.3:
        tables["order"] = {"copies": rng.randint(2, 5)}
    return tables


OPENED, MASK, LOST = math.pi / 2, 0.025, 0.3
"""Half a perimeter over its diameter; the strip beside the tube; cutting errors and a kerf."""


def _inlet(rng: Random) -> dict[str, Any]:
    inlet: dict[str, Any] = {}
    if rng.random() < 0.5:
        inlet["tube_outer_diameter"] = _mm(rng, 0.4, 1.6)
    tube = inlet.get("tube_outer_diameter", 1.016)
    if rng.random() < 0.3:
        spare = rng.choice([0.001, _mm(rng, 0.0, 1.0)])
        inlet["width"] = round(OPENED * (tube + MASK) + LOST + spare, 4)
    if rng.random() < 0.6:
        inlet["tab_length"] = rng.choice([0.001, 0.1, 1.0, _mm(rng, 0.5, 12.0)])
    return inlet


def _cutting(rng: Random) -> dict[str, Any]:
    """Sheets and kerf."""
    tables: dict[str, Any] = {}
    kind = rng.choice(["none", "none", "one", "pair", "pair"])
    if kind == "one":
        tables["laser"] = {"kerf_tpe": _mm(rng, 0, 0.2), "kerf_ptfe": _mm(rng, 0, 0.2)}
    elif kind == "pair":
        tables["laser"] = {
            key: [_mm(rng, 0.04, 0.2), _mm(rng, 0.04, 0.2)] for key in ("kerf_tpe", "kerf_ptfe")
        }
    sheets: dict[str, Any] = {}
    for film in ("tpe", "ptfe"):
        sheet: dict[str, Any] = {}
        size = rng.choice([0, 200, 300, 300])
        if size:
            sheet |= {"width": float(size), "length": float(size)}
        if rng.random() < 0.4:
            sheet["roll"] = True
        if rng.random() < 0.4:
            sheet["border"] = rng.choice([0.0, 2.0, 5.5, 15.0])
        if rng.random() < 0.4:
            sheet["spacing"] = _mm(rng, 0.3, 4.0)
        if rng.random() < 0.4:
            sheet["pins"] = [
                [_mm(rng, 5, 120, 1), _mm(rng, 5, 120, 1), _mm(rng, 1, 6, 1)]
                for _ in range(rng.randint(1, 4))
            ]
        if sheet:
            sheets[film] = sheet
    if rng.random() < 0.2:
        sheets["label"] = False
    if sheets:
        tables["sheets"] = sheets
    return tables


def _neck(tables: dict[str, Any]) -> float:
    """About what a pocket must leave free round its axis."""
    bond = tables.get("bond", {}).get("width", 0.75)
    back = 0.0
    if tables["registration"]["method"] == "ears":
        back = tables.get("mask", {}).get("overhang", 0.5)
    bore = tables.get("bore", {}).get("diameter", 1.04) / 2
    inlet = tables["inlet"]
    tube = inlet.get("tube_outer_diameter", 1.016)
    strip = inlet.get("width", OPENED * (tube + MASK) + LOST + 0.05)
    neck = bore + back + bond + 0.15 if tables["stack"]["balloons"] > 1 else 0.0
    return float(max(neck, strip / 2 + 0.05, 0.8))


def _pockets(rng: Random, tables: dict[str, Any]) -> tuple[Drawing | None, tuple[Polygon, ...]]:
    """Fills in the chamber; the drawing it names, and the pocket of every balloon."""
    family, least = tables["family"], _neck(tables)
    balloons = tables["stack"]["balloons"]
    chamber: dict[str, Any] = {}
    tables["chamber"] = chamber
    if family == "lobed":
        chamber["count"] = rng.choice([2, 3, 3, 4, 5, 6, 7, 8])
        if rng.random() < 0.4:
            tables["lumen"] = {"diameter": _mm(rng, 0.95, 5.0)}
    if family == "radial":
        _tube(rng, tables, chamber)
    most = least + rng.choice([1.0, 3.0, 6.0])
    if rng.random() < 0.4:
        drawn = drawing(rng, least, most)
        if drawn is not None:
            chamber["outline"] = drawn.name
            if family == "radial":
                _room_round_tube(rng, tables, drawn)
            if family == "lobed" and rng.random() < 0.3:
                chamber["axis_radius"] = _mm(rng, 4.0, 20.0)
            return drawn, (drawn.pocket,) * balloons
    if family == "radial":
        return None, (_oblong(rng, tables, chamber, least),) * balloons
    if rng.random() < 0.55 and balloons > 1:
        few = [_mm(rng, 2 * least, 2 * most) for _ in range(3)]
        near = few[0] + rng.choice([0.01, 0.3, 1.0])
        sizes = [rng.choice([*few, near]) for _ in range(balloons)]
        chamber["diameter"] = sizes
    else:
        sizes = [_mm(rng, 2 * least, 2 * most)] * balloons
        chamber["diameter"] = sizes[0]
    return None, tuple(_disc(size) for size in sizes)


def _disc(diameter: float) -> Polygon:
    return Polygon(Point(0, 0).buffer(diameter / 2, quad_segs=200).exterior)


def _tube(rng: Random, tables: dict[str, Any], chamber: dict[str, Any]) -> None:
    chamber["count"] = rng.choice([1, 2, 3, 3, 4])
    if rng.random() < 0.3:
        tables["inlet"]["manifold"] = True
    if rng.random() < 0.4:
        tables["sheet"] = {"margin": _mm(rng, 0.2, 4.0), "overlap": rng.choice([0.0, 1.5])}


def _room_round_tube(rng: Random, tables: dict[str, Any], drawn: Drawing) -> None:
    """A tube that the drawn pockets go round, sometimes hardly."""
    low_x, _, high_x, _ = drawn.pocket.bounds
    bond = tables.get("bond", {}).get("width", 0.75)
    overhang = tables.get("mask", {}).get("overhang", 0.5)
    room = rng.choice([0.25, 2.0, 5.0, 9.0])
    if tables["registration"]["method"] == "ears":
        room += rng.choice([4.0, 10.0])
        tables["fillet"] = {"radius": rng.choice([0.2, 1.0])}
        tables["chamber"]["count"] = min(tables["chamber"]["count"], 3)
    pitch = high_x - low_x + 2 * bond + 2 * overhang + room
    tables["tube"] = {
        "outer_diameter": round(pitch * tables["chamber"]["count"] / math.pi + 0.01, 3)
    }


def _oblong(rng: Random, tables: dict[str, Any], chamber: dict[str, Any], least: float) -> Polygon:
    bond = tables.get("bond", {}).get("width", 0.75)
    overhang = tables.get("mask", {}).get("overhang", 0.5)
    width = _mm(rng, 2 * (least + bond) + 0.05, 2 * (least + bond) + 8)
    length = _mm(rng, 2 * (least + bond) + 0.05, 26)
    chamber |= {"width": width, "length": length}
    pitch = width + 2 * overhang + rng.choice([0.25, 2.0, 5.0, 9.0])
    tables["tube"] = {"outer_diameter": round(pitch * chamber["count"] / math.pi + 0.01, 3)}
    radius = min(width, length) / 2 - bond
    along = abs(length - width) / 2
    ends = (0.0, along) if length >= width else (along, 0.0)
    spine = LineString([(-ends[0], -ends[1]), ends]) if along > 1e-9 else Point(0, 0)
    return Polygon(spine.buffer(radius, quad_segs=200).exterior)


# Drawings of pockets, as people make them: the file's text, and the polygon it means. Curves of the
# polygon are followed in chords of 0.001 mm error or less; y points up.


CHORDS = 160
Corner = tuple[float, float]


class Drawing(NamedTuple):
    """A drawn pocket: file name, text, and what it means in mm."""

    name: str
    text: str
    pocket: Polygon


def drawing(rng: Random, least: float, most: float) -> Drawing | None:
    """A closed path round (0, 0) that leaves ``least`` free there, if it can; None where not."""
    made = rng.choice(KINDS)(rng, least, most)
    return made if made.pocket.is_valid and made.pocket.area > 0 else None


def _svg(rng: Random, path: str, corners: list[Corner]) -> Drawing:
    """As it is, or in a page with a size and a viewBox that scale it."""
    points = [(x, -y) for x, y in corners]
    pocket = Polygon(points)
    if rng.random() < 0.6:
        text = f'<svg xmlns="http://www.w3.org/2000/svg"><path d="{path}"/></svg>'
        return Drawing("pocket.svg", text, pocket)
    scale = rng.choice([0.5, 2.0, 10.0])
    unit, mm = rng.choice([("mm", 1.0), ("cm", 10.0)])
    size = 100.0
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size / mm:g}{unit}" '
        f'height="{size / mm:g}{unit}" viewBox="0 0 {size * scale:g} {size * scale:g}">'
        f'<g transform="scale({scale:g})"><path d="{path}"/></g></svg>'
    )
    return Drawing("pocket.svg", text, pocket)


def _n(*values: float) -> str:
    return " ".join(f"{value:.6f}" for value in values)


def blob(rng: Random, least: float, most: float) -> Drawing:
    """A smooth closed curve of Béziers through points at random distances."""
    count = rng.randint(4, 9)
    mean = rng.uniform(least * 1.1, most)
    wild = rng.choice([0.08, 0.2, 0.35])
    radii = [mean * rng.uniform(1 - wild, 1 + wild) for _ in range(count)]
    start = rng.uniform(0, 2 * math.pi)
    knots = [
        (
            round(r * math.cos(start + 2 * math.pi * i / count), 6),
            round(r * math.sin(start + 2 * math.pi * i / count), 6),
        )
        for i, r in enumerate(radii)
    ]
    path, corners = f"M{_n(*knots[0])}", []
    for i in range(count):
        a, b, c, d = (knots[(i + k) % count] for k in (-1, 0, 1, 2))
        one = (round(b[0] + (c[0] - a[0]) / 6, 6), round(b[1] + (c[1] - a[1]) / 6, 6))
        two = (round(c[0] - (d[0] - b[0]) / 6, 6), round(c[1] - (d[1] - b[1]) / 6, 6))
        path += f" C{_n(*one)} {_n(*two)} {_n(*c)}"
        corners += [_cubic(b, one, two, c, k / CHORDS) for k in range(CHORDS)]
    return _svg(rng, path + " Z", corners)


def _cubic(a: Corner, b: Corner, c: Corner, d: Corner, t: float) -> Corner:
    u = 1 - t
    wa, wb, wc, wd = u**3, 3 * u * u * t, 3 * u * t * t, t**3
    return (
        wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0],
        wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1],
    )


def slot(rng: Random, least: float, most: float) -> Drawing:
    """A slot with round ends, lying at any angle, off its middle."""
    radius = rng.uniform(least * 1.02, max(most * 0.7, least * 1.1))
    half = rng.uniform(0.2, max(0.4, most - radius))
    angle = rng.uniform(0, math.pi)
    shift = rng.uniform(-0.3, 0.3) * half
    ux, uy = math.cos(angle), math.sin(angle)

    def at(along: float, across: float) -> Corner:
        return (
            round(ux * (along + shift) - uy * across, 6),
            round(uy * (along + shift) + ux * across, 6),
        )

    a, b, c, d = at(-half, -radius), at(half, -radius), at(half, radius), at(-half, radius)
    path = (
        f"M{_n(*a)} L{_n(*b)} A{_n(radius, radius)} 0 0 1 {_n(*c)} "
        f"L{_n(*d)} A{_n(radius, radius)} 0 0 1 {_n(*a)} Z"
    )
    corners = [a, *bulged(b, c, 1.0), c, *bulged(d, a, 1.0)]
    return _svg(rng, path, corners)


def star(rng: Random, least: float, most: float) -> Drawing:
    """A star with sharp or cut tips: concave, of straight lines."""
    tips = rng.randint(3, 8)
    inner = rng.uniform(least * 1.05, max(least * 1.1, most * 0.8))
    outer = inner * rng.uniform(1.1, 1.9)
    start = rng.uniform(0, 2 * math.pi)
    corners = []
    for i in range(2 * tips):
        r, angle = (outer if i % 2 else inner), start + math.pi * i / tips
        corners.append((round(r * math.cos(angle), 4), round(r * math.sin(angle), 4)))
    return _straight(rng, corners)


def _straight(rng: Random, corners: list[Corner]) -> Drawing:
    if rng.random() < 0.5:
        path = "M" + " L".join(_n(*corner) for corner in corners) + " Z"
        return _svg(rng, path, corners)
    return _dxf(lambda space: space.add_lwpolyline(corners, close=True), corners)


def _dxf(add: Callable[[Any], object], corners: list[Corner]) -> Drawing:
    document = ezdxf.new(units=4)
    add(document.modelspace())
    stream = io.StringIO()
    document.write(stream)
    return Drawing("pocket.dxf", stream.getvalue(), Polygon(corners))


def spline(rng: Random, least: float, most: float) -> Drawing:
    """A closed cubic B-spline of a DXF file."""
    count = rng.randint(5, 10)
    mean = rng.uniform(least * 1.3, max(least * 1.4, most * 1.1))
    wild = rng.choice([0.05, 0.2, 0.4])
    start = rng.uniform(0, 2 * math.pi)
    control = [
        (
            mean * rng.uniform(1 - wild, 1 + wild) * math.cos(start + 2 * math.pi * i / count),
            mean * rng.uniform(1 - wild, 1 + wild) * math.sin(start + 2 * math.pi * i / count),
        )
        for i in range(count)
    ]
    wrapped = control + control[:3]
    knots = [float(k) for k in range(len(wrapped) + 4)]
    curve = BSpline(np.array(knots), np.array(wrapped), 3)
    ends = np.linspace(knots[3], knots[len(wrapped)], count * CHORDS, endpoint=False)
    corners = [(float(x), float(y)) for x, y in curve(ends)]

    def add(space: Any) -> None:
        made = space.add_spline(degree=3)
        made.control_points = [(x, y, 0.0) for x, y in wrapped]
        made.knots = knots
        made.closed = False

    return _dxf(add, corners)


def bulges(rng: Random, least: float, most: float) -> Drawing:
    """A polygon whose sides bulge in or out: bones, cushions, lenses."""
    count = rng.randint(2, 7)
    start = rng.uniform(0, 2 * math.pi)
    radius = rng.uniform(least * 1.2, max(least * 1.3, most))
    corners = []
    for i in range(count):
        r, angle = radius * rng.uniform(0.9, 1.1), start + 2 * math.pi * i / count
        low = 0.4 if count < 4 else -0.15
        bulge = rng.choice([0.0, rng.uniform(low, 0.9)]) if count > 3 else rng.uniform(low, 1.0)
        corners.append((r * math.cos(angle), r * math.sin(angle), bulge))
    points = [
        point
        for i, corner in enumerate(corners)
        for point in bulged(corner, corners[(i + 1) % count], corner[2])
    ]
    return _dxf(
        lambda space: space.add_lwpolyline(corners, format="xyb", close=True),
        points,
    )


def ellipse(rng: Random, least: float, most: float) -> Drawing:
    """An ellipse of a DXF file."""
    short = rng.uniform(least * 1.05, max(least * 1.1, most * 0.7))
    long = short * rng.uniform(1.02, 1.8)
    turn = rng.uniform(0, math.pi)
    ux, uy = math.cos(turn), math.sin(turn)
    corners = []
    for k in range(6 * CHORDS):
        t = 2 * math.pi * k / (6 * CHORDS)
        a, b = long * math.cos(t), short * math.sin(t)
        corners.append((ux * a - uy * b, uy * a + ux * b))
    axis = (long * ux, long * uy)
    return _dxf(lambda space: space.add_ellipse((0, 0), axis, short / long), corners)


def corner_piece(rng: Random, least: float, most: float) -> Drawing:
    """An L, T or C of straight lines round the axis: far from convex."""
    w = rng.uniform(least * 1.05, max(least * 1.1, most * 0.6))
    arm = w + rng.uniform(0.5, max(0.6, 1.5 * (most - w)))
    thick = rng.uniform(1.0, 2 * w)
    kind = rng.randint(0, 2)
    if kind == 0:
        corners = [(-w, -w), (arm, -w), (arm, -w + thick), (w, w), (-w, w)]
    elif kind == 1:
        corners = [(-w, -w), (w, -w), (w, w), (arm, w), (arm, w + thick), (-arm, w + thick)]
        corners += [(-arm, w), (-w, w)]
    else:
        corners = [(-w, -arm), (arm, -arm), (arm, -arm + thick), (w, -arm + thick), (w, arm)]
        corners += [(arm, arm), (arm, arm + thick), (-w, arm + thick)]
    turn = rng.choice([0.0, math.pi / 2, math.pi, rng.uniform(0, 6.28)])
    c, s = math.cos(turn), math.sin(turn)
    corners = [(round(c * x - s * y, 5), round(s * x + c * y, 5)) for x, y in corners]
    return _straight(rng, corners)


KINDS = (blob, blob, slot, star, spline, bulges, ellipse, corner_piece)
