"""Ears of a radial design stand where the drawn outline is, whatever its shape.

SBAFAB_EAR_OUTLINES=100 asks for as many random outlines.
"""

from __future__ import annotations

import math
import os
import random
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.rules import pin_holes
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.measures import Measures
from tests.designs import PAPER

COUNT = int(os.environ.get("SBAFAB_EAR_OUTLINES", "4"))
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">'
SHAPES = {
    "disc": '<circle r="5"/>',
    "small disc": '<circle r="3"/>',
    "large disc": '<circle r="9"/>',
    "off-centre disc": '<circle cx="2.5" cy="-1" r="5"/>',
    "slot": '<rect x="-3.5" y="-8" width="7" height="16" rx="3.4"/>',
    "low slot": '<rect x="-7" y="-3" width="14" height="6" rx="2.9"/>',
    "star": '<path d="M0,7 2,3 6.5,2 3,-1.5 4,-6 0,-4 -4,-6 -3,-1.5 -6.5,2 -2,3Z"/>',
    "horseshoe": '<path d="M-7,-7 H7 V8 H3.5 V2 H-3.5 V8 H-7Z"/>',
}


def drawn(folder: Path, shape: str, *settings: str, outer: float = 30) -> list[str]:
    """Settings of a radial design with ears and this pocket."""
    path = folder / "pocket.svg"
    path.write_text(f"{SVG}{shape}</svg>")
    return [
        'registration.method="ears"',
        f'chamber.outline="{path}"',
        f"tube.outer_diameter={outer:g}",
        *settings,
    ]


def made(settings: list[str]) -> Laminate:
    return build(load_design("radial-15mm", settings))


def assert_held(laminate: Laminate) -> None:
    """Every piece of every film, separator and sheet has two tooling holes of the plate."""
    bores = {bore.centre for bore in laminate.bores}
    for layers in laminate.patterns.values():
        if layers[0].role != "chamber-mask":
            for piece in layers[0].profile.pieces:
                tools = [p for p in laminate.pins_in(piece) if p.centre not in bores]
                assert len(tools) >= 2, layers[0].name
    assert [f.verdict for f in pin_holes.check(Measures(laminate, PAPER))] == ["pass"]


@pytest.mark.parametrize("name", SHAPES)
def test_ears_reach_from_the_outline_that_is_drawn(name: str, tmp_path: Path) -> None:
    laminate = made(drawn(tmp_path, SHAPES[name], "chamber.count=1"))
    assert_held(laminate)
    assert not has_failed(run_deck(laminate, PAPER.with_("rules.yield_builds=100"))), name


@pytest.mark.parametrize("number", range(COUNT))
def test_ears_of_random_outlines(number: int, tmp_path: Path) -> None:
    rng = random.Random(f"ears {number}")
    count, size, rough = rng.randint(5, 10), rng.uniform(4, 7), rng.uniform(0.05, 0.35)
    points = [
        (r * math.cos(math.tau * i / count), r * math.sin(math.tau * i / count))
        for i in range(count)
        for r in [size * rng.uniform(1 - rough, 1 + rough)]
    ]
    path = [f"M{points[0][0]:.3f},{points[0][1]:.3f}"]
    for i in range(count):
        (ax, ay), (bx, by) = points[i - 1], points[i]
        (cx, cy), (dx, dy) = points[(i + 1) % count], points[(i + 2) % count]
        first = f"{bx + (cx - ax) / 6:.3f},{by + (cy - ay) / 6:.3f}"
        second = f"{cx - (dx - bx) / 6:.3f},{cy - (dy - by) / 6:.3f}"
        path.append(f"C{first} {second} {cx:.3f},{cy:.3f}")
    shape = f'<path d="{" ".join(path)}Z"/>'
    settings = [f"stack.balloons={rng.choice([1, 2])}", f"chamber.count={rng.choice([1, 3])}"]
    assert_held(made(drawn(tmp_path, shape, *settings)))


def test_an_outline_without_room_is_refused_with_the_reason(tmp_path: Path) -> None:
    slot = '<rect x="-1.2" y="-8" width="2.4" height="16"/>'
    with pytest.raises(DesignError, match=r"no room for ears, which take 6\.250 mm of its width"):
        made(drawn(tmp_path, slot))
