"""Tapered stacks: no two films meet past a smaller balloon, judged on polygons by shapely."""

from __future__ import annotations

import os
import random
from itertools import combinations

import pytest
from shapely import Polygon, unary_union
from shapely.geometry import Point as Place
from shapely.geometry.base import BaseGeometry

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate

SEED = 12
ONE_DOF = int(os.environ.get("SBAFAB_TAPERS", "49"))
LOBED = max(6, ONE_DOF // 8)
CHORDS = 0.0005
"""mm by which chords may leave their arcs."""
DUST = 0.01
"""mm2 that chords and rounding may leave of a seam."""
OVERHANG = 0.5


def taper(number: int, template: str) -> tuple[str, ...]:
    """The settings of a random taper; the same number gives the same."""
    draw = random.Random(f"{SEED} {template} {number}")
    count = draw.randint(3, 6)
    low, high = (4.0, 14.0) if template.startswith("1dof") else (4.0, 8.0)
    palette = [round(draw.uniform(low, high), 2) for _ in range(draw.randint(2, 3))]
    sizes = [draw.choice(palette) for _ in range(count)]
    method = draw.choice(["channel-pin", "channel-pin", "ears"])
    lobes = () if template.startswith("1dof") else (f"chamber.count={draw.randint(2, 5)}",)
    return (
        f"stack.balloons={count}",
        f"chamber.diameter={sizes}",
        f"registration.method={method}",
        *lobes,
    )


def flat(region: Region) -> BaseGeometry:
    return unary_union([Polygon(outer, holes) for outer, *holes in region.polygons(CHORDS)]).buffer(
        0
    )


def facing(laminate: Laminate) -> dict[tuple[int, int], tuple[BaseGeometry, BaseGeometry]]:
    """By layers: where two films, not next to each other, have no film between them, and the masks
    there; bores left out.
    """
    shapes = {layer.index: flat(layer.profile) for layer in laminate.layers}
    open_ = unary_union([Place(b.centre).buffer(b.diameter / 2 + 0.01) for b in laminate.bores])
    found = {}
    for below, above in combinations(laminate.tpe_layers, 2):
        between = laminate.layers[below.index : above.index - 1]
        films = [shapes[layer.index] for layer in between if not layer.is_mask]
        if not films:
            continue
        masks = unary_union([shapes[layer.index] for layer in between if layer.is_mask])
        shared = shapes[below.index] & shapes[above.index]
        region = shared - unary_union(films) - open_
        if region.area > DUST:
            found[below.index, above.index] = region, masks
    return found


def welded(laminate: Laminate) -> float:
    """The area in mm2 over which films meet past the films between them."""
    return sum((region - masks).area for region, masks in facing(laminate).values())


@pytest.mark.parametrize(
    ("template", "numbers"),
    [("1dof-5mm", range(ONE_DOF)), ("3dof-15mm", range(LOBED))],
)
def test_films_of_random_tapers_do_not_meet(template: str, numbers: range) -> None:
    faced = 0
    for number in numbers:
        settings = taper(number, template)
        laminate = build(load_design(template, settings))
        places = facing(laminate)
        faced += bool(places)
        for pair, (region, masks) in places.items():
            assert (region - masks).area < DUST, (settings, pair)
            # No film's edge comes nearer to a mask's edge than the overhang, but where the film
            # between them ends.
            # ...
    assert faced > len(numbers) / 4
