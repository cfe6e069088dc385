"""Stacks put together by hand, so that their volumes can be worked out on paper."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sbafab.geometry.region import Region, disc, strip, union
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Bore, Chamber, Laminate, Layer, Role

Profiles = list[tuple[Role, Region]]
Stack = Callable[[Profiles], Laminate]

TPE = Film("TPE", "sheet", 0.038, 900.0, 125.0, 200.0)
PTFE = Film("PTFE", "sheet", 0.025, 2200.0, 327.0, 260.0, kind="mask")


def stacked(profiles: Profiles) -> Laminate:
    """A laminate of these layers with one chamber and one bore of 1.0, both on the axis."""
    layers: list[Layer] = []
    z = 0.0
    for index, (role, profile) in enumerate(profiles, start=1):
        film = PTFE if role.endswith("mask") else TPE
        layers.append(Layer(index, role, film, profile, (index + 3) // 4, z, 1, profile.key))
        z += film.thickness
    return Laminate(
        name="by-hand",
        family="1dof",
        layers=tuple(layers),
        chambers=(Chamber("A", ((0.0, 0.0),)),),
        bores=(Bore("A", (0.0, 0.0), 1.0),),
        inlets=(),
        pins=(),
        lumen=None,
        balloons=(len(layers) + 1) // 4,
        registration="channel-pin",
    )


def two_balloon_profiles() -> Profiles:
    """Two balloons with pockets of radius 2.5, bonds of 0.75, bore radius 0.5, an inlet tab."""
    axis = (0.0, 0.0)
    plate, bore, pocket = disc(axis, 3.25), disc(axis, 0.5), disc(axis, 2.5)
    tabbed = plate | strip(axis, (8.25, 0.0), 3.1)
    return [
        ("base", tabbed),
        ("chamber-mask", union([pocket, strip(axis, (8.75, 0.0), 1.6)]) - bore),
        ("wall", tabbed - bore),
        ("separator-mask", disc(axis, 3.75) - disc(axis, 1.25)),
        ("wall", plate - bore),
        ("chamber-mask", pocket - bore),
        ("cap", plate),
    ]


@pytest.fixture
def stack() -> Stack:
    return stacked


@pytest.fixture
def profiles() -> Profiles:
    """Bottom to top, to be changed by the test and stacked."""
    return two_balloon_profiles()


@pytest.fixture(scope="session")
def two_balloons() -> Laminate:
    return stacked(two_balloon_profiles())
