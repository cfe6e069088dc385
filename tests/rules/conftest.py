"""Good laminates from the templates, and a way to spoil one layer of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate

Build = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


@cache
def built(template: str, *assignments: str) -> Laminate:
    return build(load_design(template, assignments))


def spoiled(laminate: Laminate, index: int, profile: Region, pieces: int | None = None) -> Laminate:
    """The laminate with another profile in one layer, and another number of pieces asked for."""
    layers = list(laminate.layers)
    layer = laminate.layer(index)
    layers[index - 1] = replace(
        layer,
        profile=profile,
        pattern=f"spoiled-{profile.key}",
        pieces=layer.pieces if pieces is None else pieces,
    )
    return replace(laminate, layers=tuple(layers))


@pytest.fixture(scope="session")
def good() -> Build:
    return built


@pytest.fixture(scope="session")
def spoil() -> Spoil:
    return spoiled
