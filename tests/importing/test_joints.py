"""Seams, folds, faces, ports and nets of a laminate.json come back with its design."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sbafab.design.laminate_file import FILE, laminate_json
from sbafab.geometry.edges import Line
from sbafab.importing.laminates import import_laminate
from sbafab.importing.records import Written, write_imported
from sbafab.laminate.laminate import Laminate
from tests.designs import drawn, tables

HALF_RING = [[-2, 30], [-2, 20, 1], [-2, -20], [2, -20], [2, 30]]


def welded(**changes: Any) -> dict[str, Any]:
    """Two coated films on their coated faces, welded along an open path of lines."""
    data = tables("welded")
    data["films"] = {
        "tpe": {"faces": {"upper": "pu", "lower": "nylon"}},
        "foil": {
            "kind": "structural",
            "product": "foil",
            "thickness": 0.05,
            "melting_point": 130,
            "faces": {"upper": "nylon", "lower": "pu"},
        },
    }
    data["layers"][1]["film"] = "foil"
    data["face_bonds"] = {"weld": {"faces": ["pu", "pu"], "by": "hot-tip", "temperature_c": 150}}
    return {**data, **changes}


def turned() -> dict[str, Any]:
    """The same of one film, the upper one turned."""
    data = welded()
    data["layers"][1] = {"role": "cap", "shape": "film", "turned": True}
    return data


def ringed() -> dict[str, Any]:
    """Welded along the boundary of a shape with a hole, and named places on two nets."""
    data = tables("welded")
    data["shapes"]["rim"] = {"ring": [38, 20]}
    data["seams"] = [
        {"name": "rim", "layers": [1, 2], "shape": "rim", "width": 1, "tool": "roller"},
    ]
    data["ports"] = [
        {"name": "middle", "layers": [1, 2], "at": [0, 0]},
        {"name": "between", "layers": [1, 2], "at": [14, 0]},
    ]
    data["nets"] = {"a": ["pouch", "between"]}
    return data


DESIGNS = {"faces": welded, "turned": turned, "shape": ringed, "fold": lambda: tables("folded")}


def again(data: dict[str, Any], folder: Path) -> tuple[Laminate, Written]:
    laminate = drawn(folder, data)
    (folder / FILE).write_text(laminate_json(laminate), encoding="utf-8")
    written = write_imported(import_laminate(folder / FILE), folder / "again.toml", FILE)
    return laminate, written


@pytest.mark.parametrize("name", DESIGNS)
def test_joints_come_back_exactly(name: str, tmp_path: Path) -> None:
    laminate, written = again(DESIGNS[name](), tmp_path)
    assert written.laminate == laminate
    assert any((laminate.seams, laminate.folds, laminate.nets, laminate.bonds))


def test_an_open_path_keeps_its_arcs(tmp_path: Path) -> None:
    data = tables("welded")
    data["seams"][0]["path"] = HALF_RING
    laminate, written = again(data, tmp_path)
    (ours,), (theirs,) = laminate.seams[0].path, written.laminate.seams[0].path
    assert replace(laminate.seams[0], path=()) == replace(written.laminate.seams[0], path=())
    assert sum(not isinstance(edge, Line) for edge in ours) >= 1
    for a, b in zip(ours, theirs, strict=True):
        assert a.start == pytest.approx(b.start, abs=1e-12)
        assert a.bulge == pytest.approx(b.bulge, abs=1e-12)
