"""The deck makes no objects that hold each other: what it leaves is freed at once, and memory stays
flat however seldom Python looks for rings.
"""

from __future__ import annotations

import gc
from itertools import product

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck
from tests.quick import few


@pytest.mark.parametrize(
    ("template", "method"),
    few(product(("1dof-5mm", "3dof-15mm", "radial-15mm"), ("channel-pin", "ears")), 3, names=2),
)
def test_a_deck_leaves_no_rings(template: str, method: str) -> None:
    def asked(overhang: float) -> tuple[Laminate, Design]:
        made = load_design(
            template, [f'registration.method="{method}"', f"mask.overhang={overhang}"]
        )
        return build(made), made

    # Once before, for what is loaded and compiled at the first time.
    run_deck(*asked(0.53))
    other = asked(0.57)
    gc.collect()
    gc.disable()
    try:
        run_deck(*other)
        assert gc.collect() == 0
    finally:
        gc.enable()
