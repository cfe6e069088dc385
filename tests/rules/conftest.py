"""Good laminates from the templates, ways to spoil them, and findings held against each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate

Build = Callable[..., Laminate]
Spoil = Callable[..., Laminate]
Change = Region | Callable[[Region], Region]

ROUND_NUMBERS = (
    "bore.diameter=1",
    "bore.clearance=0",
    "inlet.width=1.6",
    "inlet.tube_outer_diameter=0.8",
)
"""Sizes that the expected values of these tests are worked out with."""


@cache
def built(template: str, *assignments: str) -> Laminate:
    return build(load_design(template, [*ROUND_NUMBERS, *assignments]))


def spoiled(laminate: Laminate, index: int, change: Change, pieces: int | None = None) -> Laminate:
    """The laminate with another profile in one layer, and another number of pieces asked for."""
    layers = list(laminate.layers)
    layer = laminate.layer(index)
    profile = change if isinstance(change, Region) else change(layer.profile)
    layers[index - 1] = replace(
        layer,
        profile=profile,
        pattern=f"spoiled-{profile.key}",
        pieces=layer.pieces if pieces is None else pieces,
    )
    return replace(laminate, layers=tuple(layers))


def made(design: tuple[str, ...], changes: Mapping[int, Change], **fields: Any) -> Laminate:
    """The laminate of a design with changed layers, and with other fields."""
    laminate = built(*design)
    for index, change in changes.items():
        laminate = spoiled(laminate, index, change)
    return replace(laminate, **fields)


@pytest.fixture(scope="session")
def good() -> Build:
    return built


@pytest.fixture(scope="session")
def spoil() -> Spoil:
    return spoiled
