"""The balloons of a design as files for other programs: CSV, and Python without dependencies that
takes numpy arrays too.

CSV has rows only where the map holds, by a balloon computed at each place.
Pressures kPa, heights mm (that a balloon has risen by), forces mN, volumes ul, potentials uJ.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sbafab.models.balloon_map import (
    DEGREE,
    HEIGHT_SPANS,
    PIECES,
    PRESSURE_SPANS,
    holds_at,
    map_range,
)
from sbafab.spreadsheet import csv_text

if TYPE_CHECKING:
    from sbafab.models.stack import Stack

COLUMNS = ("balloon", "pressure_kpa", "height_mm", "force_mn", "volume_ul", "potential_uj")
FORMATS = ("csv", "py")


def map_text(name: str, stack: Stack, form: str, points: int) -> str:
    """Return the text of a file of one of FORMATS; CSV with so many pressures, closer together
    where they are low, and heights.
    """
    if form == "py":
        return _python(name, stack)
    rows: list[Sequence[str]] = [COLUMNS]
    even = np.linspace(0.0, 1.0, points)
    for number, of in enumerate(stack.maps, start=1):
        grid = np.meshgrid(of.most_pressure * even**2, of.most_height * even, indexing="ij")
        p, h = (axis.ravel() for axis in grid)
        columns = np.stack([p, h, of.force(p, h), of.volume(p, h), of.potential(p, h)])
        for row in columns[:, holds_at(of, p, h)].T.tolist():
            rows.append([str(number), *(f"{value:.7g}" for value in row)])
    return csv_text(rows)


def _short(value: float) -> float:
    """Return a number to seven digits."""
    return float(f"{value:.7g}")


PYTHON = '''"""The balloons of {name}, as sbafab maps them. Plain Python and its standard library.

force(p, h), volume(p, h), stiffness(p, h) of one balloon at a pressure p (kPa) and a height h (mm,
what it has risen by): mN on the plates, ul, mN/mm. Below 0 the plates pull. All three come from one
potential W, so force = -dW/dh, volume = -dW/dp and dvolume/dh = dforce/dp. balloon is one of
BALLOONS; LEVELS says which one each level of a chamber has, bottom to top. p, h or both may be
numpy arrays, of shapes that numpy broadcasts. Where holds(p, h) is false the map may be more
than 3 % off, and the others warn.
"""

import math
import warnings
from bisect import bisect

LEVELS = {levels}
FLAT_LEVEL = {pitch}  # mm, to be added to a balloon's height for that of its level
CHAMBER_AXES = {axes}  # mm
SPANS_P, SPANS_H = {spans_p}, {spans_h}
PIECES = {pieces}
BALLOONS = {balloons}


def _cell_holds(b, p, h):
    i, j = bisect(b["cell_pressures"], p) - 1, bisect(b["cell_heights"], h) - 1
    return b["holds"][min(i, len(b["holds"]) - 1)][min(j, len(b["holds"][0]) - 1)] == "+"


def _warn(holds):
    if not holds:
        warnings.warn("the map may be more than 3 % off here, see holds", stacklevel=4)


def _weights(u, order):
    weights = []
    for row in PIECES:
        coefficients = list(row)
        for _ in range(order):
            coefficients = [k * c for k, c in enumerate(coefficients)][1:]
        value = 0.0
        for c in reversed(coefficients):
            value = value * u + c
        weights.append(value)
    return weights


def _spline(balloon, p, h, by_p, by_h):
    b = BALLOONS[balloon]
    if hasattr(p, "shape") or hasattr(h, "shape"):
        import numpy as np

        each = np.vectorize(lambda p, h: _spline(balloon, float(p), float(h), by_p, by_h), "d")
        return each(p, h)
    if not (0.0 <= p <= b["most_pressure"] and 0.0 <= h <= b["most_height"]):
        most = (b["most_pressure"], b["most_height"])
        raise ValueError("outside the map: give 0 to %g kPa and 0 to %g mm" % most)
    p0 = b["scale_pressure"]
    each = SPANS_P / math.asinh(b["most_pressure"] / p0)
    x = min(math.asinh(p / p0) * each, SPANS_P * (1 - 1e-12))
    y = min(h * SPANS_H / b["most_height"], SPANS_H * (1 - 1e-12))
    i, j = int(x), int(y)
    across, along = _weights(x - i, by_p), _weights(y - j, by_h)
    _warn(_cell_holds(b, p, h))
    rate = (each / math.hypot(p, p0)) ** by_p * (SPANS_H / b["most_height"]) ** by_h
    rows = b["coefficients"][i : i + {count}]
    return rate * sum(
        a * sum(w * c for w, c in zip(along, row[j : j + {count}])) for a, row in zip(across, rows)
    )


def holds(p, h, balloon=0):
    """Whether the map is within 3 % at numbers p and h."""
    return _cell_holds(BALLOONS[balloon], p, h)


def potential(p, h, balloon=0):
    """uJ: energy of the films less pressure times volume."""
    return _spline(balloon, p, h, 0, 0)


def force(p, h, balloon=0):
    """mN on the plate at either end."""
    return -_spline(balloon, p, h, 0, 1)


def volume(p, h, balloon=0):
    """ul in the balloon."""
    return -_spline(balloon, p, h, 1, 0)


def stiffness(p, h, balloon=0):
    """mN/mm by which the force falls with the height."""
    return _spline(balloon, p, h, 0, 2)


def area(p, h, balloon=0):
    """mm2: dvolume/dheight at a pressure, the effective area of the balloon."""
    return -_spline(balloon, p, h, 1, 1)
'''


def _python(name: str, stack: Stack) -> str:
    balloons = []
    for each in stack.maps:
        of, covered = each.balloon, map_range(each)
        within = [["-+"[cell] for cell in row] for row in covered.within.tolist()]
        coefficients = each.coefficients.tolist()
        balloons.append(
            {
                "pocket_radius_mm": of.pocket,
                "neck_radius_mm": of.neck,
                "bore_radius_mm": of.bore,
                "film_mm": of.thickness,
                "modulus_kpa": of.modulus,
                "poisson": of.poisson,
                "most_pressure": each.most_pressure,
                "most_height": each.most_height,
                "scale_pressure": each.scale_pressure,
                "coefficients": [[float(f"{c:.10g}") for c in row] for row in coefficients],
                "cell_pressures": [_short(p) for p in covered.pressures.tolist()],
                "cell_heights": [_short(h) for h in covered.heights.tolist()],
                "holds": ["".join(row) for row in within],
            }
        )
    return PYTHON.format(
        name=name,
        levels=stack.levels.tolist(),
        pitch=_short(stack.pitch),
        axes=[[_short(x) for x in axis] for axis in stack.axes.tolist()],
        spans_p=PRESSURE_SPANS,
        spans_h=HEIGHT_SPANS,
        pieces=PIECES.tolist(),
        balloons=balloons,
        count=DEGREE + 1,
    )
