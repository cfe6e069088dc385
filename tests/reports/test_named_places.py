"""Names beside places: the cheapest of all places, though most of them are not looked at."""

from __future__ import annotations

import random

from sbafab.geometry.edges import Bounds
from sbafab.reports.traveller import step_pictures
from sbafab.reports.traveller.step_pictures import FAR, STEPS, PlanName

HALF = 3.0, 1.0
ROOM: Bounds = (-20.0, -15.0, 20.0, 15.0)


def crowd(seed: int) -> list[Bounds]:
    draw = random.Random(seed)
    corners = [(draw.uniform(-12, 12), draw.uniform(-9, 9)) for _ in range(3 * seed)]
    return [(x - 2, y - 1.5, x + 2, y + 1.5) for x, y in corners]


def test_a_name_stands_where_it_costs_least() -> None:
    name = PlanName("pin", (1.0, 2.0), 1.5, (0.6, 0.8))
    distances = set()
    for seed in range(12):
        taken = crowd(seed)
        costs = {
            (middle, away): step_pictures._cost(name, middle, HALF, ROOM, taken) + FAR * away
            for away in STEPS
            for middle in step_pictures._places(name, HALF, away)
        }
        best = step_pictures._best(name, HALF, ROOM, taken)
        assert costs[best] == min(costs.values())
        distances.add(best[1])
    assert len(distances) > 2
