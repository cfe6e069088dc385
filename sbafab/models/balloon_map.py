"""One balloon as a smooth map: what it holds and pushes with, at any pressure and height.

Both come from one potential, the films' energy less the work of the air: force -dW/dh, volume
-dW/dp. It is a quintic spline in the height and in asinh(p / P0), fitted by least squares to W and
both derivatives of balloons between plates. So the map keeps energy: what the air gives on any
way round comes back. A balloon of least energy holds the more the higher its pressure, and pushes
the less the higher it stands (W is concave in p, convex in h): of all splines that do, and hold a
volume above 0, the map is the one nearest to the balloons. Lengths mm, pressures kPa, volumes ul,
forces mN, energies uJ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes
from sbafab.models.rippled import pressed, risen

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from sbafab.models.film_elements import Array

DEGREE = 5
PRESSURE_SPANS, HEIGHT_SPANS = 12, 12
"""Pieces of the spline each way."""
PRESSURE_POINTS, HEIGHT_POINTS = 16, 24
"""Balloons computed each way."""
P0 = 0.1
"""Pressure in kPa below which the spline's pieces are alike in pressure, above alike in ratio."""
RISES = 65
"""Pressures at which free heights are kept to begin with."""
CAVES_IN = 0.1
"""Suction in kPa by which a slack film caves in: about what brings one taut, ours, not measured."""
ABOVE = 1.15
"""How far the map goes on above the highest free balloon, as a share of it."""
FLATTEST = 0.01
"""Least height in mm that is computed; what lies below is carried on."""
FLAT = 0.1
"""Weight of balloons that are pressed flat and hold nothing."""
LOW = 0.1
"""Pressure in kPa below which forces are fitted all alike, above by their share of it."""
VOLUMES = 0.6
"""Weight of volumes beside forces."""
NEARLY_FLAT = 0.2
"""Height in mm above which volumes are fitted by their share of what they are, below all alike."""
PRESSURE_CHECKS, HEIGHT_CHECKS = 8 * PRESSURE_SPANS + 1, 4 * HEIGHT_SPANS + 1
"""Places each way at which volumes are made to rise with pressure and forces to fall with height.
"""
LOWEST = np.array([0.001, 0.002, 0.004, 0.007])
"""Further ones near the flat, as shares of the map's height."""
EMPTIEST = 0.005
"""Share of the map's height from which on volumes are made to be above 0."""
MARGIN = 5e-5
"""By how much, as a share, they do so there, that they do it between as well."""
ROUNDS = 12
"""How often places at which they do not are looked for."""
MOST_STRETCH = 0.15
"""Share by which films may stretch; one modulus is unlikely to hold beyond."""


def _pieces() -> Array:
    """Polynomials of the uniform B-spline: row j is that of coefficient j, in powers of u."""
    rows = np.ones((1, 1))
    for degree in range(1, DEGREE + 1):
        wider = np.zeros((degree + 1, degree + 1))
        for j, row in enumerate(rows):
            # Cox-de Boor: basis j counts from degree - 1 - j pieces before u.
            start = degree - 1 - j
            rising = np.convolve(row, [start, 1.0]) / degree
            falling = np.convolve(row, [degree - start, -1.0]) / degree
            wider[j + 1] += rising[: degree + 1]
            wider[j] += falling[: degree + 1]
        rows = wider
    return rows


PIECES = _pieces()
POWERS = np.arange(DEGREE + 1.0)
SLOPES = np.stack([PIECES[:, k] * k for k in range(1, DEGREE + 1)], -1)
WINDOWS = np.arange(HEIGHT_SPANS)[:, None] + np.arange(DEGREE + 1)
"""The coefficients of each piece by height."""
PIECES_IN_ALL = HEIGHT_SPANS + 2
"""Those of a spline by height, and what it goes on with at either end."""
CURVES = np.stack([SLOPES[:, k] * k for k in range(1, DEGREE)], -1)


def basis(x: Array, order: int = 0) -> tuple[NDArray[np.int_], Array]:
    """Where the piece at ``x`` (in pieces) begins among the coefficients, and their weights there:
    of the value, or of its first or second derivative.
    """
    first = x.astype(np.int_)
    table = (PIECES, SLOPES, CURVES)[order]
    u = x - first
    powers = u[..., None] ** np.arange(table.shape[1])
    return first, powers @ table.T


def _shifted(by: float, count: int) -> Array:
    """What the first three powers of a polynomial are about a place ``by`` further: (3, count)."""
    found = np.zeros((3, count))
    for k in range(count):
        for j in range(min(k, 2) + 1):
            found[j, k] = math.comb(k, j) * by ** (k - j)
    return found


ENDS = _shifted(-1.0, 3), _shifted(1.0, DEGREE + 1)
"""What goes on below the first piece, and above the last one."""


@dataclass(frozen=True, eq=False)
class BalloonMap:
    """The map of one balloon from no pressure to ``most_pressure`` kPa and from flat to
    ``most_height`` mm; ``coefficients`` are those of the potential.
    """

    balloon: Balloon
    most_pressure: float
    most_height: float
    coefficients: Array

    @cached_property
    def spans(self) -> float:
        """Pieces of the spline a mm of height."""
        return HEIGHT_SPANS / self.most_height

    @cached_property
    def _polynomials(self) -> Array:
        """By powers of both places: (pieces in pressure, powers, pieces by height x powers)."""
        by_height = pieces(self.coefficients).reshape(len(self.coefficients), -1)
        rows = by_height[np.arange(PRESSURE_SPANS)[:, None] + np.arange(DEGREE + 1)]
        return np.asarray(PIECES.T @ rows)

    def pressed(self, pressure: ArrayLike, sucked: bool = False) -> Array:
        """Polynomials by height, of W and of -dW/dp (the volume), at pressures: (..., 2, pieces,
        powers).

        With ``sucked`` pressures may be below 0, as in a chamber that is shut and pulled open:
        slack films cave in, their volume falls by exp(p / CAVES_IN). Raises DesignError for a
        pressure outside the map.
        """
        below = np.asarray(pressure, dtype=float)
        p = np.maximum(below, 0.0) if sucked else below
        if not (p.min() >= 0 and p.max() <= self.most_pressure):
            worst = p.max() if p.min() >= 0 else p.min()
            raise DesignError(
                f"a pressure of {float(worst):g} kPa is outside the balloon's map; give 0 to "
                f"{self.most_pressure:g} kPa"
            )
        x, rate = self._scaled(p)
        first = x.astype(np.int_)
        powers = np.empty((*p.shape, 2, DEGREE + 1))
        powers[..., 0, :] = (x - first)[..., None] ** POWERS
        powers[..., 1, 0] = 0.0
        powers[..., 1, 1:] = powers[..., 0, :-1] * POWERS[1:] * -rate[..., None]
        found = powers @ self._polynomials[first]
        found = found.reshape(*p.shape, 2, PIECES_IN_ALL, DEGREE + 1)
        if sucked:
            kept = np.exp((below - p) / CAVES_IN)[..., None, None]
            found[..., 0, :, :] -= CAVES_IN * (kept - 1) * found[..., 1, :, :]
            found[..., 1, :, :] *= kept
        return found

    def _scaled(self, p: Array) -> tuple[Array, Array]:
        """Place among the pieces in pressure, and its rate by pressure."""
        each = PRESSURE_SPANS / math.asinh(self.most_pressure / P0)
        x = np.minimum(np.arcsinh(p / P0) * each, PRESSURE_SPANS * (1 - 1e-12))
        return x, each / np.hypot(p, P0)

    def force(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """MN on the plate at either end; below 0 where the balloon is pulled on."""
        return -self._along(0, pressure, height).first * self.spans

    def volume(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Ul in the balloon."""
        return self._along(1, pressure, height).value

    def potential(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """uJ: energy of the films less pressure times volume."""
        return self._along(0, pressure, height).value

    def _along(self, which: int, pressure: ArrayLike, height: ArrayLike) -> Along:
        p, h = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(height, float))
        found = self.pressed(p)[..., which, :, :].reshape(-1, DEGREE + 1)
        return along(
            derivatives(found), PIECES_IN_ALL * np.arange(p.size).reshape(p.shape), h * self.spans
        )

    def free_height(self, pressure: ArrayLike) -> Array:
        """Mm to which it rises where nothing holds it."""
        p = np.asarray(pressure, float)
        low, high = np.zeros(p.shape), np.full(p.shape, self.most_height)
        for _ in range(50):
            middle = (low + high) / 2
            pushes = self.force(p, middle) > 0
            low, high = np.where(pushes, middle, low), np.where(pushes, high, middle)
        return np.asarray((low + high) / 2)

    def rises(self, pressure: ArrayLike) -> Array:
        """About its free height, at little cost: where to begin a search."""
        return np.interp(np.arcsinh(np.asarray(pressure, float) / P0), *self._rises)

    @cached_property
    def _rises(self) -> tuple[Array, Array]:
        x = np.linspace(0, math.asinh(self.most_pressure / P0), RISES)
        return x, self.free_height(np.minimum(P0 * np.sinh(x), self.most_pressure))


class Along(NamedTuple):
    """Value, first and second derivative of splines, by pieces."""

    value: Array
    first: Array
    second: Array


def pieces(coefficients: Array) -> Array:
    """Polynomials of splines by height: (..., coefficients) become (..., PIECES_IN_ALL, powers).

    The first goes on below the spline and the last above it, with the second derivative there.
    """
    inner = coefficients[..., WINDOWS] @ PIECES
    found = np.zeros((*inner.shape[:-2], PIECES_IN_ALL, DEGREE + 1))
    found[..., 1:-1, :] = inner
    found[..., 0, :3] = inner[..., 0, :3] @ ENDS[0].T
    found[..., -1, :3] = inner[..., -1, :] @ ENDS[1].T
    return found


def derivatives(polynomials: Array) -> Array:
    """Polynomials (rows, powers) with their first two derivatives: (powers, 3, rows)."""
    found = np.zeros((DEGREE + 1, 3, len(polynomials)))
    powers = np.arange(1.0, DEGREE + 1)[:, None]
    found[:, 0] = polynomials.T
    np.multiply(found[1:, 0], powers, out=found[:-1, 1])
    np.multiply(found[1:-1, 1], powers[:-1], out=found[:-2, 2])
    return found


def along(table: Array, which: NDArray[np.int_], y: Array) -> Along:
    """Splines at places ``y``, in pieces.

    ``table`` are the ``derivatives`` of the pieces of all splines; ``which`` says at which row each
    one begins.
    """
    found = horner(table, which, y)
    return Along(*found)


def horner(table: Array, which: NDArray[np.int_], y: Array) -> Array:
    """Polynomials (powers, ..., rows) of splines at places ``y``, in pieces."""
    # Pieces are counted from the one below the spline.
    after = y + 1.0
    piece = np.minimum(np.maximum(after, 0.0), PIECES_IN_ALL - 1).astype(np.int_)
    u = after - piece
    powers = table.take(which + piece, axis=-1)
    found = powers[DEGREE] * u
    for power in powers[DEGREE - 1 : 0 : -1]:
        found += power
        found *= u
    found += powers[0]
    return np.asarray(found)


@lru_cache(maxsize=64)
def balloon_map(balloon: Balloon, most_pressure: float) -> BalloonMap:
    """The map of a balloon from 0 to a pressure in kPa, and somewhat higher than it may rise."""
    top = ABOVE * highest(balloon, most_pressure)
    p = P0 * np.sinh(_spread(PRESSURE_POINTS) * math.asinh(most_pressure / P0))
    # A film that is slack comes taut at a pressure that is the lower the flatter it lies.
    even = _spread(HEIGHT_POINTS)
    h = FLATTEST + (top - FLATTEST) * (even + even**2) / 2
    pressures, heights = (grid.ravel() for grid in np.meshgrid(p, h))
    found = pressed(balloon, pressures, heights, tied=True)
    return BalloonMap(
        balloon, most_pressure, top, _fitted(pressures, heights, found, most_pressure, top)
    )


def highest(balloon: Balloon, most_pressure: float) -> float:
    """Height in mm to which it may rise freely: at a pressure, or where its films stretch most."""
    pressures = np.linspace(most_pressure / 8, most_pressure, 8)
    free = risen(balloon, pressures)
    longer = stretch(balloon, free)
    return float(np.interp(MOST_STRETCH, longer, free.height))


def _spread(count: int) -> Array:
    """Points from 0 to 1, closer at the ends."""
    even = np.linspace(0, 1, count)
    return (even + (1 - np.cos(math.pi * even)) / 2) / 2


def _fitted(p: Array, h: Array, found: Shapes, most: float, top: float) -> Array:
    """Coefficients of the potential: least squares of W, the force and the volume."""
    blank = np.zeros((PRESSURE_SPANS + DEGREE, HEIGHT_SPANS + DEGREE))
    x, rate = BalloonMap(Balloon(), most, top, blank)._scaled(p)
    y = np.minimum(h * HEIGHT_SPANS / top, HEIGHT_SPANS * (1 - 1e-12))
    by_p = [_rows(x, order, blank.shape[0]) for order in (0, 1)]
    by_h = [_rows(y, order, blank.shape[1]) for order in (0, 1)]

    flat, lowest = _rows(0 * y, 0, blank.shape[1]), h == h.min()

    def equations(i: int, j: int, scale: Array, by_height: Array | None = None) -> Array:
        rows = by_h[j] if by_height is None else by_height
        return np.asarray((by_p[i][:, :, None] * rows[:, None, :]).reshape(len(p), -1) * scale)

    # ``inflate`` keeps what wrinkles carry while it looks for balance, so that its forces and its
    # volumes are not quite slopes of one potential. Heights and bends hang on the forces.
    area = found.r[:, -1].max() ** 2 * math.pi
    push = 1 / (area * (p + LOW) + 3 * np.abs(found.force))
    room = VOLUMES / (area * np.minimum(h + NEARLY_FLAT, top))
    potential = found.energy - p * found.volume
    scale = push / top
    matrix = np.concatenate(
        [
            equations(0, 0, scale[:, None]),
            equations(0, 1, (-push * HEIGHT_SPANS / top)[:, None]),
            equations(1, 0, (-rate * room)[:, None]),
            # Pressed flat, it holds nothing.
            equations(1, 0, (-FLAT * rate * room)[:, None], flat)[lowest],
        ]
    )
    wanted = np.concatenate(
        [potential * scale, found.force * push, found.volume * room, np.zeros(lowest.sum())]
    )
    best = _admissible(matrix, wanted, _limits(most, top, area))
    if best is None:
        raise DesignError(
            f"no smooth map of a balloon fits up to {most:g} kPa; ask for less pressure"
        )
    return np.asarray(best.reshape(blank.shape))


class MapLimits(NamedTuple):
    """Linear functions of a spline's coefficients that must not fall below MARGIN: the matrices by
    pressure and by height (places, coefficients) of each kind.
    """

    kinds: tuple[tuple[Array, Array], ...]

    def values(self, coefficients: Array) -> list[Array]:
        """Return the values at all places of each kind: (pressures, heights)."""
        grid = coefficients.reshape(PRESSURE_SPANS + DEGREE, HEIGHT_SPANS + DEGREE)
        return [across @ grid @ along.T for across, along in self.kinds]

    def rows(self, chosen: list[NDArray[np.bool_]]) -> Array:
        """Return the equations of the places chosen: (places, coefficients)."""
        found = []
        for (across, along), these in zip(self.kinds, chosen, strict=True):
            i, j = np.nonzero(these)
            size = across.shape[1] * along.shape[1]
            found.append((across[i][:, :, None] * along[j][:, None]).reshape(len(i), size))
        return np.concatenate(found)


def _limits(most: float, top: float, area: float) -> MapLimits:
    """Return what W has to obey: volumes that rise with pressure and are above 0 without any, as
    shares of what area times height holds; forces that fall with height, of pressure times area.
    """
    each = PRESSURE_SPANS / math.asinh(most / P0)
    x = np.linspace(0, PRESSURE_SPANS * (1 - 1e-12), PRESSURE_CHECKS)
    even = np.linspace(0, 1 - 1e-12, HEIGHT_CHECKS)
    y = HEIGHT_SPANS * np.sort(np.concatenate([(even + even**2) / 2, LOWEST]))
    value, slope, curve = (_rows(x, order, PRESSURE_SPANS + DEGREE) for order in (0, 1, 2))
    slope, curve = each * slope, each**2 * curve
    # With p = P0 sinh s the volume is -W_s / (P0 cosh s).
    s = (x / each)[:, None]
    rises = (np.tanh(s) * slope - curve) / (P0 * np.cosh(s) * area * top)
    falls = value * HEIGHT_SPANS**2 / top / (area * (P0 * np.sinh(s) + LOW))
    share = np.maximum(y / HEIGHT_SPANS, EMPTIEST)
    by_height, bent = (_rows(y, order, HEIGHT_SPANS + DEGREE) for order in (0, 2))
    by_height /= share[:, None]
    holds = _rows(share * HEIGHT_SPANS * (1 - 1e-12), 0, HEIGHT_SPANS + DEGREE) / share[:, None]
    return MapLimits(((rises, by_height), (falls, bent), (-slope[:1] / (P0 * area * top), holds)))


def _admissible(matrix: Array, wanted: Array, limits: MapLimits) -> Array | None:
    """Return the coefficients of least squares that keep the limits; None where none are found.

    Limits are taken up where they are not kept, until all are.
    """
    stiff = 1e-9 * np.abs(matrix).max() * np.eye(matrix.shape[1])
    upper = np.linalg.qr(np.concatenate([matrix, stiff]), mode="r")
    back = np.linalg.inv(upper)
    free = back.T @ (matrix.T @ wanted)
    best, chosen = back @ free, [np.zeros(one.shape, bool) for one in limits.values(back @ free)]
    for _ in range(ROUNDS):
        values = limits.values(best)
        if min(one.min() for one in values) >= MARGIN / 2:
            return np.asarray(best)
        chosen = [old | (one < 2 * MARGIN) for old, one in zip(chosen, values, strict=True)]
        rows = limits.rows(chosen) @ back
        size = np.linalg.norm(rows, axis=1)
        kept = nearest(free, rows / size[:, None], MARGIN / size)
        if kept is None:
            return None
        best = back @ kept
    return None


def _rows(x: Array, order: int, count: int) -> Array:
    first, weights = basis(x, order)
    rows = np.zeros((len(x), count))
    np.put_along_axis(rows, first[:, None] + np.arange(DEGREE + 1), weights, 1)
    return rows


def stretch(kind: Balloon, shape: Shapes) -> Array:
    """By what share the film between neck and rim is longer than it was flat."""
    part = slice(kind.held, kind.edge + 1)
    lengths = np.hypot(np.diff(shape.r[:, part]), np.diff(shape.z[:, part]))
    return np.asarray(lengths.sum(-1) / (kind.pocket - kind.neck) - 1)


# The nearest point to another that keeps linear limits: a convex quadratic program.


STEPS = 80
CLOSE, SMALL = 1e-5, 1e-8
"""Out of balance that is none; limits missed, and slack times its multiplier, that are none."""
SHORT = 0.99
"""Share of the way to the next limit that a step may go."""


def nearest(point: Array, rows: Array, least: Array) -> Array | None:
    """Return the x nearest to ``point`` (n,) with ``rows @ x >= least``; None where none is found.

    Rows (m, n) are unit vectors. Mehrotra's predictor and corrector (Nocedal and Wright, Numerical
    Optimization, Sec. 16.6).
    """
    x = point.copy()
    room = rows @ x - least
    begin = max(1e-2 * float(np.abs(room).max(initial=0.0)), 1e-4)
    slack, push = np.maximum(room, begin), np.full(len(rows), begin)
    for _ in range(STEPS):
        off = x - point - push @ rows
        gap = rows @ x - slack - least
        mean = float(slack @ push) / len(rows)
        if np.abs(off).max() < CLOSE and max(np.abs(gap).max(), mean) < SMALL:
            return x
        matrix = np.eye(len(x)) + (rows * (push / slack)[:, None]).T @ rows
        inverse = np.linalg.inv(matrix)

        def step(wanted: Array) -> tuple[Array, Array, Array]:
            ahead = inverse @ (((-wanted - push * gap) / slack) @ rows - off)  # noqa: B023
            slacker = rows @ ahead + gap  # noqa: B023
            return ahead, slacker, (-wanted - push * slacker) / slack  # noqa: B023

        _, slacker, harder = step(slack * push)
        to = _share(slack, slacker), _share(push, harder)
        left = (slack + to[0] * slacker) @ (push + to[1] * harder) / len(rows)
        aim = (left / mean) ** 3 * mean
        ahead, slacker, harder = step(slack * push + slacker * harder - aim)
        share = min(1.0, SHORT * min(_share(slack, slacker), _share(push, harder)))
        x, slack, push = x + share * ahead, slack + share * slacker, push + share * harder
    return None


def _share(values: Array, by: Array) -> float:
    """Share of a step after which the first of the values is 0; inf where none ever is."""
    falls = by < 0
    return float((values[falls] / -by[falls]).min(initial=np.inf))
