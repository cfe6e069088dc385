"""Parts that several tests nest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.nesting.records import NestPart, parts_of


@pytest.fixture
def lobed_plates() -> list[NestPart]:
    """40 walls without tabs and 39 separators of the 15 mm actuator, taken as one material."""
    laminate = build(load_design("3dof-15mm"))
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    by_role = {
        laminate.patterns[part.pattern][0].role: part
        for part in parts_of(laminate, paths, 1)
        if part.count > 10
    }
    return [
        replace(by_role["wall"], count=40),
        replace(by_role["separator-mask"], count=39, material="TPE"),
    ]
