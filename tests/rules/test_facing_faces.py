"""facing-films asks the press: which faces bond in it, and which films one step holds.

Three coated films; the outer two face each other through the holes of the one between.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import build, records
from sbafab.design.records import validated
from sbafab.rules.deck import run_rule
from sbafab.rules.facing_films import RULE as FACING
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures

Bonds = dict[tuple[str, str], str]


def film(upper: str, lower: str) -> dict[str, Any]:
    faces = {"upper": upper, "lower": lower}
    return {
        "kind": "structural",
        "product": "coated",
        "melting_point": 110,
        "thickness": 0.1,
        "density": 1000,
        "faces": faces,
    }


def facing(bonds: Bonds) -> Finding:
    """The rule on such films, each pair of faces bonded by the press or a tool, with its seams."""
    seams = [
        {"name": "low", "layers": [1, 2], "path": [[-1.8, 31], [-1.8, 10], [-12, 10], [-12, -10]]},
        {
            "name": "up",
            "layers": [2, 3],
            "path": [[-9, -8], [9, -8], [9, 8], [-9, 8]],
            "closed": True,
        },
    ]
    low, up = bonds["b", "b"], bonds["a", "a"]
    seams[0]["path"] += [[-x, y] for x, y in reversed(seams[0]["path"])]  # type: ignore[operator]
    tables: dict[str, Any] = {
        "name": "three",
        "family": "drawn",
        "layers": [
            {"role": "base", "shape": "film", "film": "lower"},
            {"role": "wall", "shape": "pierced", "film": "middle"},
            {"role": "cap", "shape": "film", "film": "upper"},
        ],
        "shapes": {
            "film": {"polygon": [[-20, -15], [20, -15], [20, 30], [-20, 30]]},
            "hole": {"disc": 1.2},
            "pierced": {"difference": ["film", "hole"]},
        },
        "films": {"lower": film("b", "n"), "middle": film("a", "b"), "upper": film("n", "a")},
        "face_bonds": {
            f"{one}{other}": {"faces": [one, other], "by": by, "temperature_c": 150}
            for (one, other), by in bonds.items()
        },
        "seams": [
            {**seam, "width": 1.5, "tool": tool}
            for seam, tool in zip(seams, (low, up), strict=True)
            if tool != "press"
        ],
        "chambers": [
            {
                "name": "c",
                "centres": [[0, 0]],
                "mouth": [0, 30],
                "angle": 90,
                "width": 2.1,
                "balloons": [1],
            }
        ],
        "ports": [{"name": "top", "layers": [2, 3], "at": [5, 0]}],
        "nets": {"n": ["c", "top"]},
    }
    if low == "press":
        # A pocket beside the hole.
        tables["shapes"]["pocket"] = {"disc": 6, "at": [-10, 20]}
        tables["layers"].insert(1, {"role": "chamber-mask", "shape": "pocket"})
        for row in (*tables["seams"], *tables["ports"]):
            row["layers"] = [3, 4]
    if not tables["seams"]:
        del tables["seams"]
    design = validated(tables, records(), Path())
    return run_rule(FACING, Measures(build(design), design))[0]


@pytest.mark.parametrize(
    ("bonds", "is_welded"),
    [
        # Seams alone: nothing is pressed.
        ({("b", "b"): "laser", ("a", "a"): "hot-tip"}, False),
        ({("b", "b"): "laser", ("a", "a"): "hot-tip", ("a", "b"): "press"}, False),
        # The press holds two of the films alone, the third comes by a seam.
        ({("b", "b"): "press", ("a", "a"): "hot-tip", ("a", "b"): "press"}, False),
        # The press holds all three, and the outer faces bond in it, or do not.
        ({("b", "b"): "press", ("a", "a"): "press"}, False),
        ({("b", "b"): "press", ("a", "a"): "press", ("a", "b"): "press"}, True),
    ],
)
def test_films_weld_where_one_step_presses_faces_that_bond(bonds: Bonds, is_welded: bool) -> None:
    found = facing(bonds)
    assert found.verdict == ("fail" if is_welded else "pass")
    area = math.pi * 0.6**2 if is_welded else 0.0
    assert found.measured == pytest.approx(area, abs=1e-6)
