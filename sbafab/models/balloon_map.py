"""One balloon as a smooth map: its volume and its force, at any pressure and height.

Both come from one potential, the films' energy less the work of the air: force -dW/dh, volume
-dW/dp. It is a quintic spline in the height and in asinh(p / p0), fitted by least squares to W and
both derivatives of balloons between plates, and to free ones. The map therefore conserves energy:
no cycle of pressure and height yields or consumes work. A balloon of least energy holds more at a
higher pressure, and pushes less at a greater height (W is concave in p, convex in h). The map is
the spline nearest to the balloons whose Bernstein coefficients guarantee this, with volumes above 0
and at most what balloons hold at the pressure, so it holds everywhere on the map by construction.
Lengths mm, pressures kPa, volumes ul, forces mN, energies uJ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes, distinct
from sbafab.models.film_elements import Array
from sbafab.models.least_energy import eliminated, solved
from sbafab.models.rim_correction import compressed_shapes, free_shapes
from sbafab.runtime import one_blas_thread

DEGREE = 5
PRESSURE_SPANS, HEIGHT_SPANS = 12, 12
"""Pieces of the spline by pressure and by height."""
PRESSURE_POINTS, HEIGHT_POINTS = 16, 24
"""Balloons computed by pressure and by height."""
SCALE_STRAIN = 3e-4
"""Film strain, p R / (E t), below which the spline's pieces are equal in pressure, above equal in
ratio.
"""
RISES = 8
"""Number of pressures at which the rise of free balloons is computed."""
RISE_POINTS = 65
"""Pressures at which free heights are tabulated, to start from."""
COLLAPSE_SUCTION = 0.1
"""Suction in kPa at which a slack film collapses: about the pressure that tightens it; assumed."""
HEADROOM = 1.15
"""Height of the map as a multiple of the highest free balloon's."""
LEAST_HEIGHT, LEAST_SHARE = 0.01, 0.01
"""Least computed height in mm, and its largest share of the map's height; below it the map
extrapolates.
"""
FREE_WEIGHT = 2.0
"""Weight of free balloons."""
FLAT_WEIGHT = 0.1
"""Weight of balloons pressed flat, without volume."""
LOW_PRESSURE = 0.1
"""Pressure in kPa below which force errors are weighted absolutely, above relatively."""
VOLUME_WEIGHT = 0.6
"""Weight of volumes beside forces."""
LOW_HEIGHT = 0.2
"""Height in mm below which volume errors are weighted absolutely, above relatively."""
PRESSURE_PARTS, HEIGHT_PARTS = 4, 1
"""Parts of each piece, by pressure and height, on which volumes must rise with pressure and forces
fall with height. A polynomial with positive Bernstein coefficients on a part is positive on it.
"""
LOW_PARTS = np.array([0.005, 0.02])
"""Additional part boundaries near the flat state, as shares of the map's height."""
HELD_MARGIN = 0.01
"""Share by which volumes may exceed the largest one computed at a pressure."""
LEAST_CHECK = 0.005
"""Share of the map's height by which limits are scaled below it."""
MARGIN = 5e-5
"""Share by which the limits are met, far above floating-point rounding of sums."""
MOST_STRETCH = 0.15
"""Share by which films may stretch; a single modulus is unlikely to hold beyond it."""


_POWERS = range(DEGREE + 1)
POWERS = np.arange(DEGREE + 1.0)
BASIS = np.zeros((3, DEGREE + 1, DEGREE + 1))
"""Weights of a piece's coefficients by powers of the place in it, from 0 to 1: of the value of a
uniform B-spline (in truncated powers), its first and second derivative.
"""
BASIS[0] = [
    [
        sum(
            (-1) ** i
            * math.comb(DEGREE + 1, i)
            * math.comb(DEGREE, k)
            * (DEGREE - j - i) ** (DEGREE - k)
            for i in range(DEGREE + 1 - j)
        )
        / math.factorial(DEGREE)
        for k in _POWERS
    ]
    for j in _POWERS
]
for _order in (1, 2):
    BASIS[_order, :, :-1] = BASIS[_order - 1, :, 1:] * POWERS[1:]
PIECES = BASIS[0]
BERNSTEIN = np.linalg.inv(
    [
        [math.comb(DEGREE, k) * u**k * (1 - u) ** (DEGREE - k) for k in _POWERS]
        for u in np.linspace(0, 1, DEGREE + 1)
    ]
)
"""Matrix from values at evenly spaced places from 0 to 1 to Bernstein coefficients."""
WINDOWS = np.arange(HEIGHT_SPANS)[:, None] + np.arange(DEGREE + 1)
"""The coefficients of each piece by height."""
PIECES_IN_ALL = HEIGHT_SPANS + 2
"""Pieces of a spline by height, with an extrapolation at either end."""
BELOW = np.array([[1.0, -1.0, 1.0], [0.0, 1.0, -2.0], [0.0, 0.0, 1.0]])
ABOVE = np.stack([POWERS**0, POWERS, POWERS * (POWERS - 1) / 2])
"""First three powers of a piece about a point one piece before its own first three, and after."""


def _near_pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs (first, second) of ``count`` coefficients that share a piece of the spline,
    and, for each element of a matrix by products of coefficients (pressure x height, twice), its
    place in a matrix by pairs (pressure, height); one place past the end stands for no pair.
    """
    first, second = np.nonzero(np.triu(np.tri(count, k=DEGREE)))
    pair = np.full((count, count), len(first))
    pair[first, second] = pair[second, first] = np.arange(len(first))
    size = count**2
    places = pair[:, None, :, None] * (len(first) + 1) + pair[None, :, None, :]
    return first, second, places.reshape(size, size)


*PAIRS, PAIR_OF = _near_pairs(HEIGHT_SPANS + DEGREE)


@dataclass(frozen=True, eq=False)
class BalloonMap:
    """The map of one balloon from no pressure to ``most_pressure`` kPa and from flat to
    ``most_height`` mm; ``coefficients`` are the potential's, in height and in
    asinh(p / ``scale_pressure``). ``base`` is the map that this one was ``stiffened`` from.
    """

    balloon: Balloon
    most_pressure: float
    most_height: float
    coefficients: Array
    scale_pressure: float
    base: BalloonMap | None = None

    def stiffened(self, ratio: float) -> BalloonMap:
        """Return the map of the balloon whose films have ``ratio`` times the modulus.

        Energies are proportional to the modulus at equal pressure over modulus:
        W(ratio E; p, h) = ratio W(E; p / ratio, h). The map reaches ``ratio`` times the pressure.
        """
        return self if ratio == 1 else _stiffened(self, ratio)

    @cached_property
    def spans(self) -> float:
        """Pieces of the spline per mm of height."""
        return HEIGHT_SPANS / self.most_height

    @cached_property
    def _by_pressure(self) -> Array:
        """Polynomials by height of each coefficient: (powers x pieces, coefficients)."""
        rows = pieces(self.coefficients).transpose(2, 1, 0)
        return np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]))

    def splines(self, pressure: ArrayLike, orders: int = 2, sucked: bool = False) -> Array:
        """Return the polynomials by height of W, of -dW/dp (the volume) and of the volume's rate by
        pressure, the first ``orders`` of these, at pressures: (powers, pieces, orders, ...).

        With ``sucked`` pressures may be below 0, as in a shut chamber that is pulled open: slack
        films cave in, their volume falls by exp(p / COLLAPSE_SUCTION). Raises DesignError for a
        pressure outside the map.
        """
        below = np.asarray(pressure, dtype=float)
        p = np.maximum(below, 0.0) if sucked else below
        refuse_outside(p, self.most_pressure)
        x, rate = (part.ravel() for part in self.scaled(p))
        first = x.astype(np.int_)
        each = BASIS[:orders] @ (x - first) ** POWERS[:, None]
        if orders > 2:
            each[2] *= rate * rate
            flat = p.ravel()
            each[2] -= each[1] * (rate * flat / (flat * flat + self.scale_pressure**2))
        if orders > 1:
            each[1:] *= -1.0
            each[1] *= rate
        weights = np.zeros((len(self.coefficients), orders, p.size))
        states = np.arange(p.size)
        weights[first + WINDOWS[0, :, None], :, states] = each.transpose(1, 2, 0)
        if sucked:
            fall = np.exp((below - p) / COLLAPSE_SUCTION).ravel()
            weights[:, 0] -= COLLAPSE_SUCTION * (fall - 1) * weights[:, 1]
            weights[:, 1] *= fall
            if orders > 2:
                is_slack = below.ravel() < 0
                weights[:, 2] = np.where(is_slack, weights[:, 1] / COLLAPSE_SUCTION, weights[:, 2])
        found = self._by_pressure @ weights.reshape(len(weights), -1)
        return np.asarray(found.reshape(DEGREE + 1, PIECES_IN_ALL, orders, *p.shape))

    def scaled(self, p: Array) -> tuple[Array, Array]:
        """Return the coordinate in pieces of the spline at pressures, and its rate by pressure."""
        each = PRESSURE_SPANS / math.asinh(self.most_pressure / self.scale_pressure)
        x = np.minimum(np.arcsinh(p / self.scale_pressure) * each, PRESSURE_SPANS * (1 - 1e-12))
        return x, each / np.hypot(p, self.scale_pressure)

    def force(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the force in mN on the plate at either end; below 0 for a pull."""
        return -self._along(0, pressure, height)[1] * self.spans

    def volume(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the volume of the balloon, ul."""
        return self._along(1, pressure, height)[0]

    def potential(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the energy of the films less pressure times volume, uJ."""
        return self._along(0, pressure, height)[0]

    def _along(self, which: int, pressure: ArrayLike, height: ArrayLike) -> tuple[Array, ...]:
        """Return one of ``splines`` and its rate by height, in pieces."""
        p, h = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(height, float))
        table = self.splines(p)[:, :, which].reshape(DEGREE + 1, -1)
        return horner(table, np.arange(p.size).reshape(p.shape), h * self.spans, p.size)

    def free_height(self, pressure: ArrayLike) -> Array:
        """Return the height in mm of the unloaded balloon."""
        p = np.asarray(pressure, float)
        low, high = np.zeros(p.shape), np.full(p.shape, self.most_height)
        for _ in range(50):
            middle = (low + high) / 2
            pushes = self.force(p, middle) > 0
            low, high = np.where(pushes, middle, low), np.where(pushes, high, middle)
        return np.asarray((low + high) / 2)

    def rises(self, pressure: ArrayLike) -> Array:
        """Return an interpolated free height, to start a search from."""
        return np.interp(
            np.arcsinh(np.asarray(pressure, float) / self.scale_pressure), *self._rises
        )

    @cached_property
    def _rises(self) -> tuple[Array, Array]:
        x = np.linspace(0, math.asinh(self.most_pressure / self.scale_pressure), RISE_POINTS)
        pressures = np.minimum(self.scale_pressure * np.sinh(x), self.most_pressure)
        return x, self.free_height(pressures)


def refuse_outside(pressures: Array, most_pressure: float) -> None:
    """Raise DesignError for pressures in kPa below 0 or above the most, which itself is inside.

    It stays inside even if asinh and sinh, or a film's modulus, round it up.
    """
    if pressures.min() >= 0 and pressures.max() <= most_pressure * (1 + 1e-12):
        return
    worst = pressures.max() if pressures.min() >= 0 else pressures.min()
    raise DesignError(
        f"a pressure of {float(worst):g} kPa is outside the balloon's map; give 0 to "
        f"{most_pressure:g} kPa"
    )


@lru_cache(maxsize=64)
def _stiffened(original: BalloonMap, ratio: float) -> BalloonMap:
    """Return ``original.stiffened(ratio)``, cached so that it keeps its range."""
    return BalloonMap(
        original.balloon.stiffened(ratio),
        ratio * original.most_pressure,
        original.most_height,
        ratio * original.coefficients,
        ratio * original.scale_pressure,
        original.base or original,
    )


def pieces(coefficients: Array) -> Array:
    """Polynomials of splines by height: (..., coefficients) become (..., PIECES_IN_ALL, powers).

    The first extends below the spline and the last above it, with the second derivative there.
    """
    inner = coefficients[..., WINDOWS] @ PIECES
    polynomials = np.zeros((*inner.shape[:-2], PIECES_IN_ALL, DEGREE + 1))
    polynomials[..., 1:-1, :] = inner
    polynomials[..., 0, :3] = inner[..., 0, :3] @ BELOW.T
    polynomials[..., -1, :3] = inner[..., -1, :] @ ABOVE.T
    return polynomials


def horner(
    table: Array, which: NDArray[np.int_], y: Array, stride: int = 1, with_rates: bool = True
) -> tuple[Array, Array, Array]:
    """Return splines (powers, rows) at heights ``y``, in pieces: their values, and their first and
    second derivatives unless these are left out as 0.

    ``which`` is the row of each spline's first piece; its next one is ``stride`` rows on.
    """
    # Pieces are counted from the one below the spline.
    after = y + 1.0
    piece = np.minimum(np.maximum(after, 0.0), PIECES_IN_ALL - 1).astype(np.int_)
    u = after - piece
    if stride != 1:
        piece *= stride
    powers = table.take(which + piece, axis=-1)
    value = powers[DEGREE] * u
    value += powers[DEGREE - 1]
    first = second = powers[DEGREE]
    for number, power in enumerate(powers[DEGREE - 2 :: -1]):
        if with_rates:
            if number:
                second = second * u
                second += first
            first = first * u
            first += value
        value *= u
        value += power
    return value, first, 2 * second


@lru_cache(maxsize=64)
@one_blas_thread
def balloon_map(balloon: Balloon, most_pressure: float) -> BalloonMap:
    """The map of a balloon from 0 to a pressure in kPa, to somewhat above its free height."""
    scale = SCALE_STRAIN * balloon.membrane_stiffness / balloon.pocket
    p = scale * np.sinh(_spread(PRESSURE_POINTS) * math.asinh(most_pressure / scale))
    rises = np.linspace(most_pressure / RISES, most_pressure, RISES)
    free = free_shapes(balloon, np.concatenate([rises, p[1:]]))
    rising, free = free.rows(slice(RISES)), free.rows(slice(RISES, None))
    # Up to the last pressure, or to the largest allowed stretch of its films.
    top = HEADROOM * float(np.interp(MOST_STRETCH, stretch(balloon, rising), rising.height))
    # The flatter a slack film lies, the lower the pressure that makes it taut.
    even = _spread(HEIGHT_POINTS)
    least = min(LEAST_HEIGHT, LEAST_SHARE * top)
    h = least + (top - least) * (even + even**2) / 2
    pressures, heights = (grid.ravel() for grid in np.meshgrid(p, h))
    shapes = compressed_shapes(balloon, pressures, heights, tied=True)
    blank = np.zeros((PRESSURE_SPANS + DEGREE, HEIGHT_SPANS + DEGREE))
    frame = BalloonMap(balloon, most_pressure, top, blank, scale)
    return replace(frame, coefficients=_fitted(frame, shapes, heights, free))


def _spread(count: int) -> Array:
    """Return points from 0 to 1, closer together at the ends."""
    even = np.linspace(0, 1, count)
    return (even + (1 - np.cos(math.pi * even)) / 2) / 2


def _fitted(frame: BalloonMap, shapes: Shapes, h: Array, free: Shapes) -> Array:
    """Return the coefficients of the potential: least squares of W, the force and the volume of
    balloons between plates at heights ``h``, and of ``free`` ones.

    ``inflate`` fixes the wrinkles' stress while it seeks equilibrium, so its forces and volumes are
    not exactly slopes of one potential. Heights and bends depend on the forces.
    """
    top, p = frame.most_height, shapes.pressure
    area = shapes.r[:, -1].max() ** 2 * math.pi
    push = 1 / (area * (p + LOW_PRESSURE) + 3 * np.abs(shapes.force))
    room = VOLUME_WEIGHT / (area * np.minimum(h + LOW_HEIGHT, top))
    inside = free.height < top
    stands, at, held = free.height[inside], free.pressure[inside], free.volume[inside]
    lift = FREE_WEIGHT / (area * (at + LOW_PRESSURE))
    roomy = FREE_WEIGHT * VOLUME_WEIGHT / (area * np.minimum(stands + LOW_HEIGHT, top))
    lowest = h == h.min()
    flat = FLAT_WEIGHT * room[lowest]
    matrix, right_side = (
        np.concatenate(each)
        for each in zip(
            (
                _rows(frame, p, h, 0, 0) * push[:, None] / top,
                (shapes.energy - p * shapes.volume) * push / top,
            ),
            (_rows(frame, p, h, 0, 1) * push[:, None], shapes.force * push),
            (_rows(frame, p, h, 1, 0) * room[:, None], shapes.volume * room),
            # A balloon pressed flat has no volume, a free one carries no force.
            (_rows(frame, p[lowest], 0 * p[lowest], 1, 0) * flat[:, None], 0 * flat),
            (_rows(frame, at, stands, 0, 1) * lift[:, None], 0 * lift),
            (_rows(frame, at, stands, 1, 0) * roomy[:, None], held * roomy),
            strict=True,
        )
    )
    most = shapes.volume.reshape(HEIGHT_POINTS, -1).max(0)
    best = _admissible(
        matrix, right_side, _limits(frame, area, np.append(0.0, free.pressure), most)
    )
    if best is None:
        raise DesignError(
            f"no smooth map of a balloon fits up to {frame.most_pressure:g} kPa; ask for less "
            "pressure"
        )
    return np.asarray(best.reshape(frame.coefficients.shape))


def _rows(frame: BalloonMap, p: Array, h: Array, by_p: int, by_h: int) -> Array:
    """Return W, or the volume or the force as its negative derivative by pressure or by height, at
    places (n,) as a matrix by coefficients: (n, coefficients).
    """
    x, rate = frame.scaled(p)
    y = np.minimum(h * frame.spans, HEIGHT_SPANS * (1 - 1e-12))
    sides = []
    for place, order, count in zip((x, y), (by_p, by_h), frame.coefficients.shape, strict=True):
        first = place.astype(np.int_)
        weights = (place - first)[:, None] ** POWERS @ BASIS[order].T
        side = np.zeros((len(place), count))
        np.put_along_axis(side, first[:, None] + WINDOWS[0], weights, 1)
        sides.append(side)
    if by_p:
        sides[0] *= -rate[:, None]
    if by_h:
        sides[1] *= -frame.spans
    return np.asarray((sides[0][:, :, None] * sides[1][:, None]).reshape(len(p), -1))


LimitKinds = tuple[tuple[Array, Array, Array], ...]
"""Of each kind of limit the matrices by pressure and by height (Bernstein coefficients,
coefficients), and a constant for each row by pressure, added to the result.
"""


class MapLimits:
    """Functions of a spline's coefficients ``units * x`` that must be above 0, with MARGIN as
    target.

    Limits are ``rows @ x >= least``. A row is the product of one by pressure and one by height, of
    six coefficients each, over the length ``size`` of its gradient g, sqrt(g @ metric @ g). All
    products with ``rows``, (values, coefficients), are computed from these.
    """

    def __init__(self, kinds: LimitKinds, units: Array, metric: Array) -> None:
        self.units, self.unit_products = units, units[:, None] * units
        self.sides = [(across, along) for across, along, _ in kinds]
        # Products of near coefficients, of each kind's rows: (rows, pairs), twice.
        first, second = PAIRS
        self.pairs = [
            (a[:, first] * a[:, second], b[:, first] * b[:, second]) for a, b in self.sides
        ]
        count = len(first) + 1
        near = np.bincount(PAIR_OF.ravel(), (self.unit_products * metric).ravel(), count**2)
        near = near.reshape(count, count)[:-1, :-1]
        self.size = self._row_by_row([np.sqrt(a @ near @ b.T) for a, b in self.pairs])
        rooms = [np.broadcast_to(room[:, None], (len(a), len(b))) for a, b, room in kinds]
        self.least = (MARGIN - self._row_by_row(rooms)) / self.size

    def times(self, x: Array) -> Array:
        """Return ``rows @ x``."""
        grid = (self.units * x).reshape(PRESSURE_SPANS + DEGREE, HEIGHT_SPANS + DEGREE)
        return self._row_by_row([a @ grid @ b.T for a, b in self.sides]) / self.size

    def transposed(self, factors: Array) -> Array:
        """Return ``factors @ rows``."""
        parts = zip(self.sides, self._grids(factors / self.size), strict=True)
        total = sum(a.T @ grid @ b for (a, b), grid in parts)
        return np.asarray(np.ravel(total) * self.units)

    def normal_matrix(self, weights: Array) -> Array:
        """Return ``rows.T @ diag(weights) @ rows``."""
        pairs = np.zeros((len(PAIRS[0]) + 1,) * 2)
        grids = self._grids(weights / self.size**2)
        for (a, b), grid in zip(self.pairs, grids, strict=True):
            pairs[:-1, :-1] += a.T @ (grid @ b)
        matrix = pairs.take(PAIR_OF)
        matrix *= self.unit_products
        return np.asarray(matrix)

    @staticmethod
    def _row_by_row(grids: Sequence[Array]) -> Array:
        return np.concatenate([grid.ravel() for grid in grids])

    def _grids(self, values: Array) -> Iterator[Array]:
        """Yield each kind's values: (by pressure, by height)."""
        start = 0
        for a, b in self.sides:
            end = start + len(a) * len(b)
            yield values[start:end].reshape(len(a), len(b))
            start = end


def _limits(frame: BalloonMap, area: float, pressures: Array, held: Array) -> LimitKinds:
    """Return the limits on W. Volumes rise with pressure, are above 0 without
    pressure, and at the end of each piece at most the largest volume ``held`` at the next of
    ``pressures`` at any height, as shares of area times height. Forces fall with height, as shares
    of pressure times area.

    The limits apply to Bernstein coefficients, so that they also hold between places.
    """
    top, scale_pressure = frame.most_height, frame.scale_pressure
    each = PRESSURE_SPANS / math.asinh(frame.most_pressure / scale_pressure)
    x = np.linspace(0, PRESSURE_SPANS, PRESSURE_SPANS * PRESSURE_PARTS + 1)
    even = np.linspace(0, 1, HEIGHT_SPANS * HEIGHT_PARTS + 1)
    y = HEIGHT_SPANS * np.sort(np.concatenate([even, LOW_PARTS]))
    value, slope, curve = (_parts(x, order, PRESSURE_SPANS + DEGREE) for order in (0, 1, 2))
    slope, curve = each * slope, each**2 * curve
    # With p = p0 sinh s the volume is -W_s / (p0 cosh s). It rises if tanh(s) W_s - W_ss > 0.
    # W_s < 0, and tangents of tanh lie above it: the tangent at a part's middle replaces it.
    low, high = x[:-1] / each, x[1:] / each
    middle = (low + high) / 2
    bend = (high - low) / 2 / np.cosh(middle) ** 2
    tangent = np.tanh(middle) + np.stack([-bend, bend])
    scale = (scale_pressure * np.cosh(middle))[:, None, None]
    rises = (_times_line(slope, tangent) - curve) / (scale * area * top)
    falls = value * HEIGHT_SPANS**2 / top
    falls /= (area * (scale_pressure * np.sinh(middle) + LOW_PRESSURE))[:, None, None]
    share = np.maximum(y[1:] / HEIGHT_SPANS, LEAST_CHECK)[:, None, None]
    by_height, bent = (_parts(y, order, HEIGHT_SPANS + DEGREE) for order in (0, 2))
    by_height /= share
    along, none = _joined(by_height), -slope[0, :1] / (scale_pressure * area * top)
    every = rises.reshape(-1, rises.shape[-1])
    # Volumes rise with pressure, so in a piece they are bounded by the value at its end.
    ends = slice(PRESSURE_PARTS - 1, None, PRESSURE_PARTS)
    at = scale_pressure * np.sinh(high[ends])
    content = slope[ends, -1] / (np.hypot(at, scale_pressure) * area * top)[:, None]
    next_one = np.minimum(np.searchsorted(pressures, at * (1 - 1e-9)), len(pressures) - 1)
    most = (1 + HELD_MARGIN) * np.maximum.accumulate(held)[next_one] / (area * top)
    plain = _joined(_parts(y, 0, HEIGHT_SPANS + DEGREE))
    return (
        (every, along, np.zeros(len(every))),
        (_joined(falls), _joined(bent), np.zeros(len(falls) * DEGREE + 1)),
        (none, along, np.zeros(1)),
        (content, plain, most),
    )


def _joined(parts: Array) -> Array:
    """List the coefficients of all parts; coefficients shared by two parts appear once."""
    return np.concatenate([parts[:, :-1].reshape(-1, parts.shape[-1]), parts[-1, -1:]])


def _parts(ends: Array, order: int, count: int) -> Array:
    """Return the Bernstein coefficients, all of degree DEGREE, of a spline or a derivative on the
    parts between ``ends`` (in pieces): the matrix (parts, DEGREE + 1, count) to its coefficients.
    """
    low, wide = ends[:-1], np.diff(ends)
    first = (low + wide / 2).astype(np.int_)
    places = (low - first)[:, None] + wide[:, None] * np.linspace(0, 1, DEGREE + 1)
    weights = BERNSTEIN @ (places[..., None] ** POWERS) @ BASIS[order].T
    matrices = np.zeros((len(low), DEGREE + 1, count))
    columns = first[:, None, None] + np.arange(DEGREE + 1)
    np.put_along_axis(matrices, np.broadcast_to(columns, weights.shape), weights, -1)
    return matrices


def _times_line(parts: Array, line: Array) -> Array:
    """Return Bernstein coefficients (parts, DEGREE + 1, count) of polynomials below DEGREE, times
    lines (2, parts) given at either end of the part.
    """
    places = np.linspace(0, 1, DEGREE + 1)
    line_values = line[0][:, None] * (1 - places) + line[1][:, None] * places
    values = np.linalg.inv(BERNSTEIN) @ parts
    return np.asarray(BERNSTEIN @ (line_values[..., None] * values))


def _admissible(matrix: Array, right_side: Array, kinds: LimitKinds) -> Array | None:
    """Return the least-squares coefficients within the limits; None if none exist."""
    # With columns scaled to equal length the normal equations are well-conditioned (2e6; 1e17
    # without scaling), and need no orthogonal factorisation.
    units = 1 / np.sqrt((matrix * matrix).sum(0))
    columns = matrix * units
    normal = columns.T @ columns
    free = np.linalg.solve(normal, columns.T @ right_side)
    limits = MapLimits(kinds, units, np.linalg.inv(normal))
    best = nearest_admissible(free, normal, limits)
    return None if best is None else np.asarray(units * best)


def stretch(kind: Balloon, shape: Shapes) -> Array:
    """Return the relative elongation of the film between neck and rim."""
    part = slice(kind.neck_edge, kind.edge + 1)
    lengths = np.hypot(np.diff(shape.r[:, part]), np.diff(shape.z[:, part]))
    return np.asarray(lengths.sum(-1) / (kind.pocket - kind.neck) - 1)


# Projection onto linear limits: a convex quadratic program.


QP_STEPS = 80
CLOSE, SMALL = 1e-7, 1e-10
"""Tolerance of the residual; tolerance of a violation, and of slack times its multiplier."""
BLOCK = 3
"""Pressures whose coefficients are eliminated together."""
STEP_SHARE = 0.99
"""Maximum step as a share of the distance to the next limit."""


def nearest_admissible(point: Array, metric: Array, limits: MapLimits) -> Array | None:
    """Return the x within the limits that is nearest to ``point`` (n,), by the squared distance
    d @ ``metric`` @ d; None if no such x is found.

    Mehrotra's predictor and corrector (Nocedal and Wright, Numerical Optimization, Sec. 16.6).
    """
    x, least = point.copy(), limits.least
    room = limits.times(x) - least
    begin = max(1e-2 * float(np.abs(room).max(initial=0.0)), 1e-4)
    slack, push = np.maximum(room, begin), np.full(len(least), begin)
    for _ in range(QP_STEPS):
        off = metric @ (x - point) - limits.transposed(push)
        gap = limits.times(x) - slack - least
        mean = float(slack @ push) / len(least)
        if np.abs(off).max() < CLOSE and max(np.abs(gap).max(), mean) < SMALL:
            return x
        ratio = push / slack
        matrix = limits.normal_matrix(ratio)
        matrix += metric
        width = HEIGHT_SPANS + DEGREE
        parts = eliminated(matrix, BLOCK * width, DEGREE * width)
        even = ratio * gap

        def step(pull: Array) -> tuple[Array, Array, Array]:
            ahead = solved(parts, -limits.transposed(pull + even) - off)  # noqa: B023
            slacker = limits.times(ahead) + gap  # noqa: B023
            return ahead, slacker, -pull - ratio * slacker  # noqa: B023

        _, slacker, harder = step(push)
        to = _share(slack, slacker), _share(push, harder)
        remainder = (slack + to[0] * slacker) @ (push + to[1] * harder) / len(least)
        aim = (remainder / mean) ** 3 * mean
        ahead, slacker, harder = step(push + (slacker * harder - aim) / slack)
        share = min(1.0, STEP_SHARE * min(_share(slack, slacker), _share(push, harder)))
        x, slack, push = x + share * ahead, slack + share * slacker, push + share * harder
    return None


def _share(values: Array, by: Array) -> float:
    """Return the share of a step after which the first of positive values is 0; inf if none."""
    fall = -float((by / values).min())
    return 1 / fall if fall > 0 else math.inf


# Valid range of a map: within 3 % of balloons computed between its support points.


MOST_ERROR, CELL_ERROR = 0.03, 0.02
"""Allowed relative error of a map, and the stricter limit where a cell is checked, since errors
between these places may be larger: free heights jump where another wave begins.
"""
FLAT = 1e-3
"""Height in mm that represents 0."""
PRESSURE_CHECKS, HEIGHT_CHECKS = 37, 25
"""Balloons computed by pressure and by height."""
PLACE_DIGITS = 6
"""Decimals to which places in kPa and mm are distinguished."""


class MapRange(NamedTuple):
    """Cells of a map between ``pressures`` (n) and ``heights`` (m), and which of them hold:
    ``within`` (n - 1, m - 1), true where the map does at all four corners and in the middle.
    """

    pressures: Array
    heights: Array
    within: NDArray[np.bool_]

    def holds(self, pressure: ArrayLike, height: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the map holds at pressures and heights inside it."""
        cells = []
        for ends, places in ((self.pressures, pressure), (self.heights, height)):
            cell = np.searchsorted(ends, places, side="right") - 1
            cells.append(np.clip(cell, 0, len(ends) - 2))
        return np.asarray(self.within[cells[0], cells[1]])


@lru_cache(maxsize=64)
def map_range(made: BalloonMap) -> MapRange:
    """Return where a map is within CELL_ERROR of balloons between plates, as far as checked, by the
    map that it was stiffened from: heights are equal at equal pressure over modulus.
    """
    base, ratio = _base(made)
    pressures, heights, corners = _checked(base, 0.0)
    rows = corners[:-1] & corners[1:]
    middles = _checked(base, 0.5)[2][:-1, :-1]
    return MapRange(ratio * pressures, heights, rows[:, :-1] & rows[:, 1:] & middles)


def _base(stiffened_map: BalloonMap) -> tuple[BalloonMap, float]:
    """Return the map that one was stiffened from, and the ratio of their moduli."""
    base = stiffened_map.base or stiffened_map
    return base, stiffened_map.scale_pressure / base.scale_pressure


def _checked(base: BalloonMap, offset: float) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the pressures and the heights of the checks, ``offset`` cells further, and where the
    map is within CELL_ERROR there: (pressures, heights).
    """
    x, y = (
        np.minimum((np.arange(count) + offset) / (count - 1), 1.0)
        for count in (PRESSURE_CHECKS, HEIGHT_CHECKS)
    )
    pressures = base.scale_pressure * np.sinh(
        x * math.asinh(base.most_pressure / base.scale_pressure)
    )
    pressures = np.minimum(pressures, base.most_pressure)
    heights = base.most_height * (y + y**2) / 2
    p, h = np.meshgrid(pressures, np.maximum(heights, FLAT), indexing="ij")
    near = relative_errors(base, p.ravel(), h.ravel()) <= CELL_ERROR
    return pressures, heights, near.reshape(p.shape)


def relative_errors(checked_map: BalloonMap, pressure: Array, height: Array) -> Array:
    """Return the larger relative error of a map in force and volume, against balloons between
    plates computed at its places (n,), heights above 0. Raises DesignError if one has no
    equilibrium.

    Forces are compared as shares of pressure (and 0.1 kPa) times pocket, and the force; volumes as
    shares of the volume and of what a pocket holds at the least height computed.
    """
    exact = compressed_shapes(checked_map.balloon, pressure, height, tied=True)
    area = math.pi * checked_map.balloon.pocket**2
    push = area * (pressure + LOW_PRESSURE) + np.abs(exact.force)
    room = exact.volume + area * LEAST_HEIGHT
    force = np.abs(checked_map.force(pressure, height) - exact.force) / push
    return np.maximum(force, np.abs(checked_map.volume(pressure, height) - exact.volume) / room)


def holds_at(made: BalloonMap, pressure: Array, height: Array) -> NDArray[np.bool_]:
    """Return where a map is within MOST_ERROR of the balloons computed at places (n,); not where
    one lies outside the map.

    Suction counts as no pressure, and heights below FLAT as FLAT. The balloons belong to the map
    that this one was stiffened from. Raises DesignError if one has no equilibrium.
    """
    base, ratio = _base(made)
    places = np.stack([np.maximum(pressure / ratio, 0.0), np.maximum(height, FLAT)], -1)
    unique, back = distinct(places.round(PLACE_DIGITS))
    p, h = np.minimum(unique[:, 0], base.most_pressure), unique[:, 1]
    holds, inside = np.zeros(len(h), bool), h <= base.most_height
    if inside.any():
        holds[inside] = relative_errors(base, p[inside], h[inside]) <= MOST_ERROR
    return holds[back]
