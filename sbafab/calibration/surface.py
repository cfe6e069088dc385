"""Values of curves on a grid of the design unknowns, and between its nodes.

Logarithms of the values are interpolated linearly in modulus ratio (its logarithm), pocket loss and
press factor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.calibration.curve_model import CurveModel
from sbafab.models.calibrated import DESIGN_UNKNOWNS
from sbafab.models.unknowns import UNKNOWNS, factors_at

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array

NODES = (11, 6, 3)
"""Nodes by modulus ratio, pocket loss and press factor."""
IMPOSSIBLE = 1e-3
"""Share of a curve's measured values that stands for a state which an actuator cannot reach."""


@dataclass(frozen=True)
class ValueSurface:
    """Logarithms of a curve's values: (ratio, loss, press, open set-ups, points)."""

    table: Array

    def at(self, coordinates: Array) -> Array:
        """Return logarithms at coordinates (n, unknowns): (n, open set-ups, points)."""
        flat = self.table.reshape(np.prod(NODES), -1)
        values = interpolated(flat, coordinates)
        return values.reshape(len(coordinates), *self.table.shape[DESIGN_UNKNOWNS:])


def interpolated(flat: Array, coordinates: Array) -> Array:
    """Return values between the nodes of a table (nodes, values) at coordinates (n, unknowns):
    (n, values).
    """
    row = np.zeros((1, len(coordinates)), dtype=np.int_)
    weight = np.ones((1, len(coordinates)))
    for axis, nodes in enumerate(NODE_COORDINATES):
        place = (coordinates[:, axis] - nodes[0]) / (nodes[1] - nodes[0])
        place = np.clip(place, 0.0, len(nodes) - 1.0)
        first = np.minimum(place.astype(np.int_), len(nodes) - 2)
        share = place - first
        row = np.concatenate([row * len(nodes) + first, row * len(nodes) + first + 1])
        weight = np.concatenate([weight * (1 - share), weight * share])
    return np.asarray((weight[..., None] * flat[row]).sum(0))


def node_coordinates() -> list[Array]:
    """Return the coordinates of the nodes by each design unknown, evenly spaced."""
    return [
        np.linspace(unknown.coordinate(unknown.least), unknown.coordinate(unknown.most), count)
        for unknown, count in zip(UNKNOWNS, NODES, strict=False)
    ]


NODE_COORDINATES = node_coordinates()


def surfaces(
    models: Sequence[CurveModel], progress: Callable[[str, int, int], None]
) -> list[ValueSurface]:
    """Return the surface of each curve. ``progress`` is called with step, done and total."""
    nodes = NODE_COORDINATES
    tables = [np.zeros((*NODES, len(model.open_setups), len(model.curve.y))) for model in models]
    # Maps of balloons hang on the pocket loss alone.
    for loss in range(NODES[1]):
        progress("models", loss, NODES[1])
        for ratio in range(NODES[0]):
            for press in range(NODES[2]):
                place = (ratio, loss, press)
                values = [
                    unknown.value(float(nodes[axis][place[axis]]))
                    for axis, unknown in enumerate(UNKNOWNS[:DESIGN_UNKNOWNS])
                ]
                fields = (unknown.field for unknown in UNKNOWNS)
                factors = factors_at(dict(zip(fields, values, strict=False)))
                for model, table in zip(models, tables, strict=True):
                    least = IMPOSSIBLE * np.array(model.curve.y)
                    values_there = model.values(factors)
                    reached = np.where(np.isfinite(values_there), values_there, 0.0)
                    table[place] = np.log(np.maximum(reached, least))
    return [ValueSurface(table) for table in tables]
