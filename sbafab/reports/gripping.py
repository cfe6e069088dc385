"""The balloons of an inflated radial actuator as a surface, to be looked at."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sbafab.assemblies.build import PlacedSba
from sbafab.design.form import Slots
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

ACROSS, ALONG, HALVINGS = 13, 17, 50


def gripping(placed: PlacedSba, height: float) -> Surface:
    """Balloons ``height`` mm high each on the tangents of their tube, in the part's own frame.

    Across, a film is an arc that keeps its pocket's width (the lens of ``models.lens``); towards
    the pocket's round ends the lens shrinks with its chord.
    """
    pockets = placed.made.design.form.pockets
    assert isinstance(pockets, Slots)
    laminate, radius = placed.made.laminate, placed.radius or 0.0
    lens = _lens(pockets, height)
    points: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int_]] = []
    for chamber in laminate.chambers:
        for middle in dict.fromkeys(chamber.centres):
            ((x, y, _),) = placed.turned(np.array([[*middle, 0.0]]))
            angle = x / radius if radius else 0.0
            for level in range(laminate.balloons):
                out = radius + laminate.thickness + (level + 0.5) * height + lens.points[:, 2]
                aside, along = lens.points[:, 0], lens.points[:, 1] + y
                faces.append(lens.faces + sum(map(len, points)))
                points.append(
                    np.column_stack(
                        [
                            out * math.cos(angle) - aside * math.sin(angle),
                            out * math.sin(angle) + aside * math.cos(angle),
                            along,
                        ]
                    )
                )
    return Surface(np.concatenate(points), np.concatenate(faces))


def _lens(pockets: Slots, height: float) -> Surface:
    """One balloon about its middle: x across, y along, z up; both films, their rims apart."""
    half = _half_angle(pockets.width, height)
    bow = pockets.width / (2 * half)
    long = pockets.run + pockets.width
    t = np.linspace(-1.0, 1.0, ALONG)
    # Denser towards the ends, which are round.
    y = long / 2 * np.sin(t * math.pi / 2)
    beyond = np.maximum(np.abs(y) - pockets.run / 2, 0.0) / (pockets.width / 2)
    share = np.sqrt(np.maximum(1.0 - beyond**2, 0.0))
    u = np.linspace(-half, half, ACROSS)
    sheets = []
    for side in (1, -1):
        x = bow * np.sin(u) * share[:, None]
        z = side * bow * (np.cos(u) - math.cos(half)) * share[:, None]
        sheets.append(np.stack([x, np.broadcast_to(y[:, None], x.shape), z], -1).reshape(-1, 3))
    i, j = np.meshgrid(np.arange(ALONG - 1), np.arange(ACROSS - 1), indexing="ij")
    a = (i * ACROSS + j).ravel()
    b, c, d = a + 1, a + ACROSS, a + ACROSS + 1
    upper = np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    lower = upper[:, ::-1] + ALONG * ACROSS
    return Surface(np.concatenate(sheets), np.concatenate([upper, lower]))


def _half_angle(width: float, height: float) -> float:
    """Half the angle of an arc of length ``width`` that rises half of ``height``, up to a circle's
    quarter: height = width (1 - cos a) / a.
    """
    low, high = 1e-6, math.pi / 2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if width * (1 - math.cos(middle)) / middle < height:
            low = middle
        else:
            high = middle
    return high
