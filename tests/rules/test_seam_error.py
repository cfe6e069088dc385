"""A seam's error of place at bonds and overlaps.

The seams of the folded film's template are 2 mm wide, and their paths end 1 mm past the film.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from random import Random

import pytest
import shapely
from shapely import affinity

from sbafab.actuators import build, load_design, records
from sbafab.design.records import validated
from sbafab.rules.deck import run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.registration_worst_case import RULE as WORST_CASE
from sbafab.rules.registration_yield import RULE as YIELD
from sbafab.rules.rule import Rule
from tests.quick import few

UPPER, LOWER = shapely.Point(0, 9), shapely.Point(0, -9)
STEADY = {"registration.hand_placement": 0, "registration.hand_turn": 0}


def findings(rule: object, **settings: object) -> list[Finding]:
    named = {key.replace("__", "."): value for key, value in settings.items()}
    design = load_design("folded").with_({**STEADY, **named})
    return run_rule(rule, Measures(build(design), design))  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [0.0, 0.5, 1.2])
def test_the_tools_error_is_taken_off_a_bond_from_seam_to_edge(error: float) -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=error)
    # The film's edge and the seam's width lie off by the cutting error each.
    assert bond.measured == pytest.approx(2.0 - 2 * 0.1 - error)
    assert bond.verdict == "pass"


def test_a_tool_that_strays_too_far_fails() -> None:
    bond, _ = findings(WORST_CASE, registration__seam_error=1.6)
    assert bond.verdict == "fail"
    assert bond.measured == pytest.approx(0.2)
    assert "position of seam" in bond.message
    assert "make the seam wider, extend it farther past the edge" in bond.message


def test_by_default_a_laser_is_as_exact_as_its_cuts_and_other_tools_are_not() -> None:
    bond, _ = findings(WORST_CASE)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.3)
    seams = load_design("folded").model_dump()["seams"]
    laser = [{**seam, "tool": "laser"} for seam in seams]
    bond, _ = findings(WORST_CASE, seams=laser)
    assert bond.measured == pytest.approx(2.0 - 0.2 - 0.1)


# Overlaps: a pouch with seams all round, halved by two that meet between its chambers.


Points = Sequence[tuple[float, float]]
FILM = [(-30, -22), (30, -22), (30, 22), (-30, 22)]
ROUND: dict[str, Points] = {
    "west": [(-2.5, 23), (-2.5, 14), (-20, 14), (-20, -14), (-2.5, -14), (-2.5, -23)],
    "east": [(2.5, 23), (2.5, 14), (20, 14), (20, -14), (2.5, -14), (2.5, -23)],
}
WIDTH = 3.0


def turned(points: Points, degrees: float) -> list[list[float]]:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [[x * c - y * s, x * s + y * c] for x, y in points]


def worst(
    seams: dict[str, Points], error: float = 0.3, turn: float = 0, rule: Rule = WORST_CASE
) -> Finding:
    """What is left of the pouch's bonds, with these seams, all of it turned."""
    mouths = turned([(0, 22), (0, -22)], turn)
    tables = {
        "name": "halved",
        "family": "drawn",
        "layers": [{"role": "base", "shape": "film"}, {"role": "cap", "shape": "film"}],
        "shapes": {"film": {"polygon": turned(FILM, turn)}},
        "chambers": [
            {"name": name, "centres": centre, "mouth": mouth, "angle": angle + turn, "width": 2}
            for name, centre, mouth, angle in (
                ("upper", turned([(0, 9)], turn), mouths[0], 90),
                ("lower", turned([(0, -9)], turn), mouths[1], -90),
            )
        ],
        "seams": [
            {
                "name": name,
                "layers": [1, 2],
                "path": turned(path, turn),
                "width": WIDTH,
                "tool": "hot-tip",
            }
            for name, path in seams.items()
        ],
        "registration": {"hand_placement": 0, "hand_turn": 0, "seam_error": error},
    }
    design = validated(tables, records(), Path())
    return run_rule(rule, Measures(build(design), design))[0]


def end_on_end(overlap: float) -> dict[str, Points]:
    """Two seams along one line whose round ends lie over each other by so much."""
    end = (WIDTH - overlap) / 2
    return {"left": [(-23, 0), (-end, 0)], "right": [(23, 0), (end, 0)]}


@pytest.mark.parametrize("turn", [0, 11.25, 22.5, 100])
@pytest.mark.parametrize(("error", "overlap"), [(0.0, 0.5), (0.3, 0.5), (0.3, 1.1), (0.7, 1.9)])
def test_seams_that_meet_overlap_by_both_errors_and_the_least_bond(
    overlap: float, error: float, turn: float
) -> None:
    for more, verdict in ((0.005, "pass"), (-0.005, "fail")):
        seams = {**ROUND, **end_on_end(overlap + more)}
        bond = worst(seams, error, turn)
        left = max(0.0, overlap + more - 2 * error)
        assert bond.measured == pytest.approx(left, abs=1e-6)
        assert bond.verdict == ("fail" if left < 0.5 else verdict)
        assert "overlap of seams left and right" in bond.message


@pytest.mark.parametrize("count", [0, 3, 11, 12, 13, 20])
def test_neither_the_number_of_seams_nor_their_order_matters(count: int) -> None:
    """Seams that lie over each other by a hair where nothing leaks, and one overlap that counts."""
    row = {
        f"x{n}": [(25.5, 2.4 * n - 18.9 - 0.2), (25.5, 2.4 * n - 18.9 + 0.2)] for n in range(count)
    }
    seams = {**ROUND, **row, **end_on_end(0.5)}
    names = list(seams)
    for order in (names, names[::-1], names[::2] + names[1::2]):
        bond = worst({name: seams[name] for name in order})
        assert bond.verdict == "fail"
        assert "overlap of seams" in bond.message
        assert abs(bond.where.x or 0) < 0.01
    assert worst({**ROUND, **row, **end_on_end(1.5)}).measured == pytest.approx(0.9)


def test_a_seam_that_ends_on_another_counts_from_its_tip() -> None:
    bar = [(-23, 0), (0, 0), (0, 7)]
    for end in (0.9, 2.4):
        bond = worst({**ROUND, "left": bar, "right": [(23, 4), (end, 4)]})
        # The tip lies half a width before the end, and the bar's side half a width before it.
        assert bond.measured == pytest.approx(min(WIDTH - end - 0.6, 2.5))


def test_seams_that_cross_are_not_pulled_apart() -> None:
    crossed = {"left": [(-23, -5), (9, 4)], "right": [(23, -5), (-9, 4)]}
    assert worst({**ROUND, **crossed}, error=0.8).measured == pytest.approx(WIDTH - 0.2)


@pytest.mark.parametrize(("run", "error"), [(1.1, 0.3), (0.35, 0.3), (0.325, 0.3), (1.1, 1.2)])
def test_a_seam_runs_past_the_edge_of_the_film(run: float, error: float) -> None:
    """A leg of the mouth whose round tip runs past the film bonds a chord of it along the edge."""
    end = 22 + run - WIDTH / 2
    leg = [(x, y if abs(y) < 23 else math.copysign(end, y)) for x, y in ROUND["west"]]
    bond = worst({**ROUND, "west": leg, **end_on_end(3)}, error)
    left = max(0.0, run - error)
    chord = 2 * math.sqrt(left * (WIDTH - left))
    assert bond.verdict == ("pass" if chord > 0.5 else "fail")
    if bond.verdict == "fail":
        assert bond.measured == pytest.approx(chord, abs=1e-6)
        assert "seam west bonds only" in bond.message or "seam west ends short" in bond.message


def test_half_of_all_builds_keep_an_overlap_as_deep_as_its_limit() -> None:
    """What both seams add to the overlap is even about zero."""
    share = worst({**ROUND, **end_on_end(0.5)}, rule=YIELD)
    assert share.measured == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("seed", few(range(24), 6))
def test_another_program_pulls_seams_apart(seed: int) -> None:
    """Swaths of random seams, moved by shapely in many directions until the chambers are joined."""
    random = Random(seed)
    walls = {
        name: [
            (23 * side, random.uniform(-5, 5)),
            (side * random.uniform(3, 8), random.uniform(-4, 4)),
        ]
        for name, side in (("left", -1), ("right", 1))
    }
    middle = random.uniform(-2, 2), random.uniform(-3, 3)
    for path, side in zip(walls.values(), (-1, 1), strict=True):
        past = random.uniform(-1.4, -0.6)
        path.append((middle[0] - side * past, middle[1] + random.uniform(-1, 1)))
    swaths = [shapely.LineString(path).buffer(WIDTH / 2, quad_segs=64) for path in walls.values()]
    rest = shapely.union_all([shapely.LineString(p).buffer(WIDTH / 2) for p in ROUND.values()])
    inside = shapely.box(-20, -14, 20, 14) - rest

    def are_joined(by: float, degrees: float) -> bool:
        x, y = by * math.cos(math.radians(degrees)), by * math.sin(math.radians(degrees))
        open_area = inside - swaths[0] - affinity.translate(swaths[1], x, y)
        parts = shapely.get_parts(open_area)
        return any(part.contains(UPPER) and part.contains(LOWER) for part in parts)

    depth = 2.0
    for degrees in range(0, 360, 4):
        if are_joined(depth, degrees):
            low = 0.0
            while depth - low > 0.002:
                between = (low + depth) / 2
                low, depth = (low, between) if are_joined(between, degrees) else (between, depth)
    bond = worst({**ROUND, **walls}, error=0.0)
    assert bond.measured == pytest.approx(depth, abs=0.006)
