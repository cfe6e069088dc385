"""Random designs of every family, as a user would type them; some break rules, and may.

Nothing of sbafab is used. Values are drawn wide: what counts here is what gets past the rules.
"""

from __future__ import annotations

import math
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import tomli_w
from shapely import Point, Polygon

from tests.judge.drawings import Drawing, drawing

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
    from shapely import LineString

    spine = LineString([(-ends[0], -ends[1]), ends]) if along > 1e-9 else Point(0, 0)
    return Polygon(spine.buffer(radius, quad_segs=200).exterior)
