"""Tapered stacks: no two films meet past a smaller balloon, judged on polygons by shapely.

Six random 1-DoF tapers and three lobed ones; SBAFAB_TAPERS=49 takes as many 1-DoF tapers.
"""

from __future__ import annotations

import math
import os
import random
from dataclasses import replace
from functools import cache
from itertools import combinations

import pytest
from shapely import Point, Polygon, union_all
from shapely.geometry.base import BaseGeometry

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region, disc
from sbafab.laminate.laminate import Laminate
from sbafab.rules import facing_films
from sbafab.rules.measures import Measures
from tests.designs import PAPER

SEED = 12
ASKED = int(os.environ.get("SBAFAB_TAPERS", "6"))
CASES = [
    *(("1dof-5mm", number) for number in range(ASKED)),
    *(("3dof-15mm", number) for number in range(math.ceil(ASKED / 3))),
]
CHORDS = 0.004
"""mm by which chords may leave their arcs."""
DUST = 0.02
"""mm2 that chords may leave of a seam."""
OVERHANG = 0.5

Pairs = dict[tuple[int, int], tuple[BaseGeometry, BaseGeometry]]


def taper(template: str, number: int) -> list[str]:
    """The settings of a random taper; the same number gives the same."""
    draw = random.Random(f"{SEED} {template} {number}")
    lobed = template.startswith("3dof")
    count = draw.randint(3, 4 if lobed else 6)
    palette = [round(draw.uniform(4.0, 8.0 if lobed else 14.0), 2) for _ in range(3)]
    sizes = [draw.choice(palette) for _ in range(count)]
    method = draw.choice(["channel-pin", "channel-pin", "ears"])
    settings = [
        f"stack.balloons={count}",
        f"chamber.diameter={sizes}",
        f"registration.method={method}",
    ]
    return [*settings, f"chamber.count={draw.randint(2, 5)}"] if lobed else settings


def flat(region: Region) -> BaseGeometry:
    return union_all([Polygon(outer, holes) for outer, *holes in region.polygons(CHORDS)])


def facing(laminate: Laminate) -> Pairs:
    """By the layers' indices: where two films, not next to each other, have no film between them
    outside the bores, and all masks between them.
    """
    shapes = {layer.pattern: flat(layer.profile) for layer in laminate.layers}
    bores = union_all([Point(b.centre).buffer(b.diameter / 2 + 0.01) for b in laminate.bores])
    found: Pairs = {}
    for below, above in combinations(laminate.tpe_layers, 2):
        between = laminate.layers[below.index : above.index - 1]
        region = shapes[below.pattern] & shapes[above.pattern]
        region -= bores
        for pattern in dict.fromkeys(layer.pattern for layer in between if not layer.is_mask):
            region -= shapes[pattern]
        if region.area > DUST and len(between) > 1:
            masks = {layer.pattern: shapes[layer.pattern] for layer in between if layer.is_mask}
            found[below.index, above.index] = region, union_all(list(masks.values()))
    return found


@cache
def case(template: str, number: int) -> tuple[Laminate, Pairs]:
    laminate = build(load_design(template, taper(template, number)))
    return laminate, facing(laminate)


def bare(pairs: Pairs) -> float:
    """The area in mm2 over which films weld past the films between them."""
    return float(sum((region - masks).area for region, masks in pairs.values()))


def wider(region: BaseGeometry, distance: float) -> BaseGeometry:
    """Grown by a distance; what is thinner than the chords' error is left out first."""
    return region.buffer(-2 * CHORDS).buffer(distance + 2 * CHORDS)


@pytest.mark.parametrize(("template", "number"), CASES)
def test_films_of_a_random_taper_do_not_meet(template: str, number: int) -> None:
    laminate, pairs = case(template, number)
    assert bare(pairs) < DUST
    if laminate.registration == "channel-pin":
        # Only where they end at pins do masks stop short; no such place is near here.
        for region, masks in pairs.values():
            assert (wider(region, OVERHANG - 0.01) - masks).area < DUST
    verdicts = {finding.verdict for finding in facing_films.check(Measures(laminate, PAPER))}
    assert verdicts == {"pass"}


def test_the_rule_measures_what_polygons_measure() -> None:
    """With masks that end where they would between equal balloons of the smaller size."""
    settings = ["stack.balloons=3", "chamber.diameter=[5, 5, 12]"]
    laminate = build(load_design("1dof-5mm", settings))
    small = disc((0.0, 0.0), 3.75) - disc((0.0, 0.0), 1.25)
    faulty = with_profile(laminate, 8, small)
    (found,) = facing_films.check(Measures(faulty, PAPER))
    assert found.verdict == "fail"
    # The tab, 3.45 wide, from 3.75 on (as wide as the fillets make it) to 6.75.
    assert found.measured == pytest.approx(10.566, abs=0.01)
    assert found.measured == pytest.approx(bare(facing(faulty)), abs=DUST)
    assert found.where.layers == (3, 8, 9)


def with_profile(laminate: Laminate, index: int, profile: Region) -> Laminate:
    layers = [
        replace(layer, profile=profile, pattern="spoiled") if layer.index == index else layer
        for layer in laminate.layers
    ]
    return replace(laminate, layers=tuple(layers))
