"""Laminates put together by hand, so that their volumes can be worked out on paper."""

from __future__ import annotations

import pytest

from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, strip
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Bore, Chamber, Inlet, Laminate, Layer, Role

TPE = Film("TPE", "TPE film", 0.038, 900.0, 125.0, 200.0)
PTFE = Film("PTFE", "PTFE film", 0.025, 2200.0, 327.0, 260.0)


def stack(
    profiles: list[tuple[Role, Region]], centres: list[Point], balloons: int, bore: float
) -> Laminate:
    layers: list[Layer] = []
    z = 0.0
    patterns: dict[Region, str] = {}
    for index, (role, profile) in enumerate(profiles, start=1):
        film = PTFE if role.endswith("mask") else TPE
        pattern = patterns.setdefault(profile, f"P{len(patterns) + 1:02d}")
        layers.append(
            Layer(index, role, film, profile, (index + 3) // 4, z, len(profile.outers), pattern)
        )
        z += film.thickness
    names = [chr(ord("a") + i) for i in range(len(centres))]
    return Laminate(
        name="by-hand",
        family="1dof",
        layers=tuple(layers),
        chambers=tuple(Chamber(n, (c,)) for n, c in zip(names, centres, strict=True)),
        bores=tuple(Bore(n, c, 2 * bore) for n, c in zip(names, centres, strict=True)),
        inlets=(),
        pins=(),
        lumen=None,
        balloons=balloons,
        registration="channel-pin",
    )
