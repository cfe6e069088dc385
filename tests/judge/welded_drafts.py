"""Random welded, stacked and folded pouches, sound ones and some with a fault."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any, NamedTuple

import tomli_w

FAULTS = ("none", "none", "narrow", "open", "off the film")
COATED = {
    "coated": {
        "kind": "structural",
        "product": "coated nylon",
        "thickness": 0.12,
        "melting_point": 160,
        "faces": {"upper": "pu", "lower": "nylon"},
    }
}
BONDS = {
    "weld": {"faces": ["pu", "pu"], "by": "hot-tip", "temperature_c": 180.0},
    "spot": {"faces": ["nylon", "nylon"], "by": "laser"},
}


class WeldedDraft(NamedTuple):
    """A random design, and the fault in it."""

    tables: dict[str, Any]
    fault: str

    def write(self, home: Path) -> Path:
        path = home / f"{self.tables['name']}.toml"
        path.write_text(tomli_w.dumps(self.tables), encoding="utf-8")
        return path


def welded_draft(seed: int, number: int) -> WeldedDraft:
    """The draft of this number: every third is a pouch of two films, stacked, or folded."""
    dice = random.Random(f"{seed}-{number}")
    make = (_pouch, _stacked, _folded)[number % 3]
    draft = make(dice)
    draft.tables["name"] = f"welded-{seed}-{number}"
    return draft


def _box(half_x: float, half_y: float, tab: float = 0.0, end: float = 0.0) -> list[list[float]]:
    corners = [[-half_x, -half_y], [half_x, -half_y], [half_x, half_y]]
    if tab:
        corners += [[tab, half_y], [tab, end], [-tab, end], [-tab, half_y]]
    return [*corners, [-half_x, half_y]]


def _rim(half_x: float, half_y: float, mouth: float, end: float) -> list[list[float]]:
    """A path from the tab's end round the pocket and back, clockwise from above."""
    corners = [[-half_x, half_y], [-half_x, -half_y], [half_x, -half_y], [half_x, half_y]]
    return [[-mouth, end], [-mouth, half_y], *corners, [mouth, half_y], [mouth, end]]


def _size(dice: random.Random) -> tuple[float, float]:
    return round(dice.uniform(8, 20), 2), round(dice.uniform(8, 16), 2)


def _pouch(dice: random.Random) -> WeldedDraft:
    half_x, half_y = _size(dice)
    width, fault = round(dice.uniform(0.85, 1.6), 2), dice.choice(FAULTS)
    flap = round(dice.uniform(1.2, 3), 2)
    end, mouth = half_y + 6, 2.6
    path = _rim(half_x, half_y, mouth, end)
    if fault == "narrow":
        width = round(dice.uniform(0.3, 0.7), 2)
    if fault == "open":
        path = path[: -dice.choice([1, 2])]
    if fault == "off the film":
        out = round(flap - width / 2 + width - dice.uniform(0.2, 0.65), 3)
        path = [[x + (out if x == half_x else 0), y] for x, y in path]
    seam = {"name": "rim", "layers": [1, 2], "path": path, "width": width}
    tables = {
        "family": "drawn",
        "layers": [{"role": "base", "shape": "film"}, {"role": "cap", "shape": "film"}],
        "shapes": {"film": {"polygon": _box(half_x + flap, half_y + flap, mouth + 2, end)}},
        "seams": [{**seam, "tool": dice.choice(["hot-tip", "laser", "ultrasonic"])}],
        "chambers": [_chamber("pouch", end, 2 * mouth - width)],
    }
    return WeldedDraft(tables, fault)


def _chamber(name: str, end: float, width: float) -> dict[str, Any]:
    mouth = {"mouth": [0, end], "angle": 90, "width": round(width, 3)}
    return {"name": name, "centres": [[0, 0]], **mouth}


def _stacked(dice: random.Random) -> WeldedDraft:
    """Two coated pouches on each other, the upper one fed through a neck."""
    half_x, half_y = _size(dice)
    fault = dice.choice(["none", "none", "no neck", "thin neck", "wide top"])
    end, mouth, width = half_y + 6, 2.6, round(dice.uniform(0.85, 1.4), 2)
    top_x, top_y = half_x - dice.uniform(0, 4), half_y - dice.uniform(0, 4)
    if fault == "wide top":
        top_x, top_y = half_x + dice.uniform(1, 1.4), half_y - dice.uniform(2, 4)
    top = [[-top_x, top_y], [-top_x, -top_y], [top_x, -top_y], [top_x, top_y]]
    neck = round(dice.uniform(1.8, 3), 2)
    ring = [[-neck, -neck], [neck, -neck], [neck, neck], [-neck, neck]]
    shapes: dict[str, Any] = {
        "film": {"polygon": _box(half_x + 2, half_y + 2, mouth + 2, end)},
        "plain": {"polygon": _box(half_x + 2, half_y + 2)},
        "bore": {"disc": 1.04},
        "film-bored": {"difference": ["film", "bore"]},
        "plain-bored": {"difference": ["plain", "bore"]},
    }
    thin = round(dice.uniform(0.3, 0.65), 2)
    seams = [
        {
            "name": "lower",
            "layers": [1, 2],
            "path": _rim(half_x, half_y, mouth, end),
            "width": width,
            "tool": "hot-tip",
        },
        {
            "name": "neck",
            "layers": [2, 3],
            "path": ring,
            "closed": True,
            "width": thin if fault == "thin neck" else width,
            "tool": "laser",
        },
        {
            "name": "upper",
            "layers": [3, 4],
            "path": top,
            "closed": True,
            "width": width,
            "tool": "hot-tip",
        },
    ]
    rows = [("base", "film"), ("cap", "film-bored"), ("base", "plain-bored"), ("cap", "plain")]
    tables = {
        "family": "drawn",
        "layers": [
            {"role": role, "shape": shape, "film": "coated", "turned": role == "cap"}
            for role, shape in rows
        ],
        "films": COATED,
        "face_bonds": BONDS,
        "shapes": shapes,
        "seams": [seam for seam in seams if (seam["name"], fault) != ("neck", "no neck")],
        "chambers": [_chamber("pouch", end, 2 * mouth - width)],
    }
    return WeldedDraft(tables, fault)


def _folded(dice: random.Random) -> WeldedDraft:
    """One film folded over a mask at its left edge."""
    half_x, half_y = _size(dice)
    fault = dice.choice(["none", "none", "not folded", "narrow"])
    bond = round(dice.uniform(0.3, 0.7) if fault == "narrow" else dice.uniform(0.85, 1.5), 2)
    end = half_y + 6
    body = _box(half_x, half_y, 2 + bond, end)
    body = [[x + bond if x == half_x else x, y] for x, y in body]
    low = -half_y - bond
    body = [[x, low if y == -half_y else y + bond if y == half_y else y] for x, y in body]
    mask = _box(half_x, half_y, 1.0, end + 0.5)
    tables: dict[str, Any] = {
        "family": "drawn",
        "layers": [
            {"role": "base", "shape": "film"},
            {"role": "chamber-mask", "shape": "mask"},
            {"role": "cap", "shape": "film"},
        ],
        "shapes": {"film": {"polygon": body}, "mask": {"polygon": mask}},
        "chambers": [_chamber("pouch", end, 2.0)],
    }
    if fault != "not folded":
        line = [[-half_x, low], [-half_x, half_y + bond]]
        tables["folds"] = [{"layers": [1, 3], "line": line}]
    return WeldedDraft(tables, fault)
