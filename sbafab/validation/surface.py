"""Values of curves on a grid of the design unknowns, and between its nodes.

Logarithms of the values are interpolated linearly in modulus ratio (its logarithm), pocket loss and
press factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.calibrated import DESIGN_UNKNOWNS
from sbafab.models.figures import Factors
from sbafab.models.film_elements import Array
from sbafab.models.unknowns import UNKNOWNS, factors_at
from sbafab.validation.model_values import NoModel, model_values
from sbafab.validation.records import MeasuredCurve

NODES = (11, 6, 6)
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
    curves: Sequence[MeasuredCurve], progress: Callable[[str, int, int], None]
) -> list[ValueSurface]:
    """Return the surface of each curve. ``progress`` is called with step, done and total."""
    nodes = NODE_COORDINATES
    tables: list[Array | None] = [None] * len(curves)
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
                for number, curve in enumerate(curves):
                    values_there = logarithms(curve, factors)
                    table = tables[number]
                    if table is None:
                        table = tables[number] = np.zeros((*NODES, *values_there.shape))
                    table[place] = values_there
    return [ValueSurface(table) for table in tables if table is not None]


def logarithms(curve: MeasuredCurve, factors: Factors) -> Array:
    """Return logarithms of the models' values of a curve (open set-ups, points).

    A state that an actuator does not reach has IMPOSSIBLE times the measured value. Raises
    DesignError if no model gives the curve.
    """
    answer = model_values(curve, factors, shares_maps=True)
    if isinstance(answer, NoModel):
        raise DesignError(f"{curve.id}: {answer.reason}")
    rows = [
        [
            math.log(max(value or 0.0, IMPOSSIBLE * measured))
            for value, measured in zip(values, curve.y, strict=True)
        ]
        for values in answer.series.values()
    ]
    return np.array(rows)
