"""Small laminates built by hand, layer by layer, as the paper stacks them (Sec. 2)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest

from sbafab.geometry.region import Region, disc
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate, Layer, Pin, Role

TPE = Film("TPE", "Stretchlon 200", 0.038, 1122, softens_above=120, limit=200)
PTFE = Film("PTFE", "PTFE film", 0.025, 2200, softens_above=327, limit=260, kind="mask")

Stack = Callable[..., Laminate]


def _roles(balloons: int, sheet: bool) -> list[Role]:
    roles: list[Role] = ["sheet", "separator-mask"] if sheet else []
    roles += ["base", "chamber-mask"]
    for _ in range(balloons - 1):
        roles += ["wall", "separator-mask", "wall", "chamber-mask"]
    return [*roles, "cap"]


def _profile(role: Role, bore: Region, lumen: Region) -> Region:
    """Pocket at the origin, lumen at x = 4.25."""
    plate = disc((0, 0), 3.25) | disc((4.25, 0), 1.75)
    shapes: dict[Role, Region] = {
        "sheet": disc((0, 0), 20),
        "base": plate - lumen,
        "chamber-mask": disc((0, 0), 2.5) - bore,
        "wall": plate - lumen - bore,
        "separator-mask": disc((0, 0), 6) - lumen - disc((0, 0), 1.25),
        "cap": plate - lumen,
    }
    return shapes[role]


@pytest.fixture(scope="session")
def stack() -> Stack:
    """Builds a laminate of one chamber; ``lumen`` adds the through channel and its pin."""

    def build(balloons: int, *, sheet: bool = False, lumen: bool = False) -> Laminate:
        bored = disc((0, 0), 0.5) if balloons > 1 else Region()
        channel = disc((4.25, 0), 1.0) if lumen else Region()
        roles = _roles(balloons, sheet)
        profiles = {role: _profile(role, bored, channel) for role in dict.fromkeys(roles)}
        films = [PTFE if role.endswith("mask") else TPE for role in roles]
        layers = tuple(
            Layer(index, role, film, profiles[role], None, 0.0, 1, role)
            for index, (role, film) in enumerate(zip(roles, films, strict=True), 1)
        )
        assert sheet or all(a.is_mask != b.is_mask for a, b in pairwise(layers))
        pins = (Pin("chamber_1", (0, 0), 1.0),) if balloons > 1 else ()
        pins += (Pin("lumen", (4.25, 0), 2.0),) if lumen else ()
        return Laminate(
            name="hand-built",
            family="1dof",
            layers=layers,
            chambers=(),
            bores=(),
            inlets=(),
            pins=pins,
            lumen=2.0 if lumen else None,
            balloons=balloons,
            registration="channel-pin",
        )

    return build
