"""Channels at worst: what cutting, kerf and seams leave of them, in nets, sealing and tube-fit."""

from __future__ import annotations

import math
from pathlib import Path
from random import Random
from typing import Any

import pytest
import shapely

from sbafab.actuators import build, load_design, records
from sbafab.design.records import Design, validated
from sbafab.rules.deck import run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.nets import RULE as NETS
from sbafab.rules.sealing import RULE as SEALING
from sbafab.rules.tube_fit import RULE as TUBE_FIT
from tests.rules.test_opening_pressure import film_of, plate

BOX = [[-25, -20], [25, -20], [25, 20], [-25, 20]]


def masked(width: float, **sections: Any) -> Design:
    """A pouch, a channel of a width and a pocket with a port, all under one mask."""
    tables: dict[str, Any] = {
        "name": "channel",
        "family": "drawn",
        "layers": [
            {"role": "base", "shape": "film"},
            {"role": "chamber-mask", "shape": "mask"},
            {"role": "cap", "shape": "film"},
        ],
        "shapes": {
            "film": {"polygon": BOX},
            "strip": {"slot": [[-26, 0], [-10, 0]], "width": 3},
            "channel": {"slot": [[-11, 0], [11, 0]], "width": width},
            "end": {"disc": 4, "at": [12, 0]},
            "mask": {"union": ["strip", "channel", "end"]},
        },
        "chambers": [
            {"name": "a", "centres": [[-15, 0]], "mouth": [-25, 0], "angle": 180, "width": 3}
        ],
        "ports": [{"name": "p", "layers": [1, 3], "at": [12, 0]}],
        "nets": {"n": ["a", "p"]},
    }
    return validated(tables | sections, records(), Path())


def welded(seams: dict[str, tuple[list[list[float]], str]], **sections: Any) -> Design:
    """A pouch inside a seam, with a mouth of 3 mm, parted by others."""
    rim = [[-2.25, 21], [-2.25, 10], [-15, 10], [-15, -10]]
    rim += [[-x, y] for x, y in reversed(rim)]
    tables: dict[str, Any] = {
        "name": "welded",
        "family": "drawn",
        "layers": [{"role": "base", "shape": "film"}, {"role": "cap", "shape": "film"}],
        "shapes": {"film": {"polygon": BOX}},
        "seams": [
            {"name": name, "layers": [1, 2], "path": path, "width": 1.5, "tool": tool}
            for name, (path, tool) in {"rim": (rim, "hot-tip"), **seams}.items()
        ],
        "chambers": [{"name": "a", "centres": [[0, 5]], "mouth": [0, 20], "angle": 90, "width": 3}],
        "ports": [{"name": "p", "layers": [1, 2], "at": [0, -7]}],
        "nets": {"n": ["a", "p"]},
    }
    return validated(tables | sections, records(), Path())


def opening(design: Design) -> Finding:
    (finding,) = [f for f in run_rule(NETS, Measures(build(design), design)) if f.unit == "kPa"]
    return finding


@pytest.mark.parametrize(
    ("width", "laser", "left"),
    [
        (0.8, {}, 0.5),
        (0.8, {"kerf_ptfe": 0.12}, 0.6),
        (0.8, {"unknown_kerf": 0.3}, 0.3),
        (0.35, {}, 0.05),
    ],
)
def test_a_masked_channel_loses_two_cuts_and_an_unknown_kerf(
    width: float, laser: dict[str, float], left: float
) -> None:
    design = masked(width, laser=laser)
    found = opening(design)
    pressure = plate([film_of(build(design))], left)
    assert found.measured == pytest.approx(pressure, rel=1e-6)
    assert found.verdict == ("pass" if pressure < 100 else "fail")
    assert f"and is {left:.3f} mm at worst" in found.message


def test_a_channel_that_cuts_may_close_takes_any_pressure() -> None:
    found = opening(masked(0.3))
    assert (found.verdict, found.measured) == ("fail", None)
    assert "closes at worst" in found.message


TOOLS = ("hot-tip", "hot-tip"), ("laser", "hot-tip"), ("laser", "laser")


@pytest.mark.parametrize(("tools", "lost"), [*zip(TOOLS, (0.6, 0.4, 0.2), strict=True)])
@pytest.mark.parametrize("gap", [0.62, 1.0])
def test_a_channel_between_two_seams_loses_the_errors_of_both(
    gap: float, tools: tuple[str, str], lost: float
) -> None:
    off = (gap + 1.5) / 2
    walls = {
        name: ([[15 * side, 0], [off * side, 0], [off * side, -4]], tool)
        for name, side, tool in (("left", -1, tools[0]), ("right", 1, tools[1]))
    }
    design = welded(walls)
    found = opening(design)
    assert found.measured == pytest.approx(plate([film_of(build(design))], gap - lost), rel=1e-6)


def test_a_channel_between_two_legs_of_one_seam_moves_with_it() -> None:
    """Between the legs of one seam it stays as drawn."""
    hook = [[-15, 3], [-6, 3], [-6, -3], [-3.9, -3], [-3.9, 1]]
    walls = {"hook": (hook, "hot-tip"), "bar": ([[15, -5], [-5, -5]], "hot-tip")}
    port = [{"name": "p", "layers": [1, 2], "at": [-4.95, 0]}]
    design = welded(walls, ports=port)
    film = film_of(build(design))
    # Between the hook's legs 0.6 mm; between both seams 0.5, closed at worst.
    assert opening(design).measured is None
    design = welded({"hook": walls["hook"]}, ports=port)
    assert opening(design).measured == pytest.approx(plate([film], 0.6), rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_another_program_measures_what_is_left_between_two_seams(seed: int) -> None:
    random = Random(seed)
    walls = {}
    for name, side in (("left", -1), ("right", 1)):
        tip = [side * random.uniform(0.3, 2.5), random.uniform(-4, 4)]
        walls[name] = ([[side * 15, random.uniform(-6, 2)], tip], "hot-tip")
    swaths = [shapely.LineString(path).buffer(0.75, quad_segs=256) for path, _ in walls.values()]
    apart = swaths[0].distance(swaths[1])
    design = welded(walls)
    found = opening(design)
    if apart < 0.6:
        assert found.measured is None or apart == 0
    elif apart < 2.5:
        pressure = plate([film_of(build(design))], apart - 0.6)
        assert found.measured == pytest.approx(pressure, rel=0.02)


@pytest.mark.parametrize(("gap", "verdict"), [(0.62, "pass"), (0.58, "fail")])
def test_a_chamber_is_parted_where_seams_close_a_channel(gap: float, verdict: str) -> None:
    off = (gap + 1.5) / 2
    walls = {
        name: ([[15 * side, 0], [off * side, 0]], "hot-tip") for name, side in (("l", -1), ("r", 1))
    }
    both = [{"name": "a", "centres": [[0, 5], [0, -7]], "mouth": [0, 20], "angle": 90, "width": 3}]
    design = welded(walls, chambers=both, nets=None, ports=None)
    (found,) = run_rule(SEALING, Measures(build(design), design))
    assert found.verdict == verdict
    if verdict == "fail":
        assert "a may be divided at chamber interface 1" in found.message
        assert (found.where.x, found.where.y) == pytest.approx((0, 0), abs=0.1)


@pytest.mark.parametrize(("width", "verdict"), [(2.0, "warn"), (2.2, "pass"), (1.59, "fail")])
def test_a_mouth_between_two_seams_is_narrower_by_their_errors(width: float, verdict: str) -> None:
    """Welded 0.6 mm narrower at worst; the tube needs 1.596."""
    half = width / 2 + 1
    paths = {
        "left": [[-19, -13], [-19, 12], [-half, 12], [-half, 25]],
        "right": [[half, 25], [half, 12], [19, 12], [19, -13]],
    }
    design = load_design("folded")
    seams = [{**seam, "path": paths[seam["name"]]} for seam in design.model_dump()["seams"]]
    (pouch,) = design.model_dump()["chambers"]
    design = design.with_({"seams": seams, "chambers": [{**pouch, "width": width}]})
    found = run_rule(TUBE_FIT, Measures(build(design), design))[0]
    assert (found.verdict, found.limit) == (verdict, pytest.approx(math.pi * 1.016 / 2))
    assert found.measured == pytest.approx(width - 0.6)
