"""One balloon as a smooth map: its volume and its force, at any pressure and height.

Both come from one potential, the films' energy minus the work of the air: force -dW/dh, volume
-dW/dp. It is a quintic spline in the height and in asinh(p / p0), fitted by least squares to W and
both derivatives of balloons between plates, and to free ones. The map therefore conserves energy:
no cycle of pressure and height yields or consumes work. A balloon of least energy holds more at a
higher pressure, and pushes less at a greater height (W is concave in p, convex in h). The map is
the nearest spline to the balloons whose Bernstein coefficients guarantee this, with volumes above 0
and at most those of balloons at the pressure, so it is true everywhere on the map by construction.
Lengths mm, pressures kPa, volumes ul, forces mN, energies uJ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sbafab.errors import DesignError
from sbafab.models.balloon import Shapes
from sbafab.models.film_elements import Array, Balloon
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
PRESSURE_PARTS = 4
"""Parts of each piece by pressure on which volumes must rise with pressure and forces fall with
height. A polynomial with positive Bernstein coefficients on a part is positive on it.
"""
LOW_PARTS = np.array([0.005, 0.02])
"""Additional part boundaries near the flat state, as shares of the map's height."""
HELD_MARGIN = 0.01
"""Share by which volumes may exceed the largest one computed at a pressure."""
LEAST_CHECK = 0.005
"""Share of the map's height by which limits are scaled below it."""
MARGIN, MET = 5e-5, 1e-8
"""Share by which the limits are met, far above floating-point rounding of sums; and by how much of
a limit's length one may be missed."""
MOST_CHANGES = 4000
"""Changes of the limits that hold the coefficients after which no map is taken to fit."""
MOST_STRETCH = 0.15
"""Share by which films may stretch; a single modulus is unlikely to hold beyond it."""


POWERS = np.arange(DEGREE + 1.0)
BASIS = np.zeros((3, DEGREE + 1, DEGREE + 1))
"""Weights of a piece's coefficients by powers of the place in it, from 0 to 1: of the value of a
uniform B-spline, its first and its second derivative.
"""
BASIS[0] = np.array(
    [
        [1, -5, 10, -10, 5, -1],
        [26, -50, 20, 20, -20, 5],
        [66, 0, -60, 0, 30, -10],
        [26, 50, 20, -20, -20, 10],
        [1, 5, 10, 10, 5, -5],
        [0, 0, 0, 0, 0, 1],
    ]
) / math.factorial(DEGREE)
for _order in (1, 2):
    BASIS[_order, :, :-1] = BASIS[_order - 1, :, 1:] * POWERS[1:]
EVEN = np.linspace(0, 1, DEGREE + 1)
BERNSTEIN = np.linalg.inv(
    [
        [math.comb(DEGREE, k) * u**k * (1 - u) ** (DEGREE - k) for k in range(DEGREE + 1)]
        for u in EVEN
    ]
)
"""Matrix from values at the places EVEN to Bernstein coefficients."""
WINDOWS = np.arange(HEIGHT_SPANS)[:, None] + np.arange(DEGREE + 1)
"""The coefficients of each piece by height."""
PIECES_IN_ALL = HEIGHT_SPANS + 2
"""Pieces of a spline by height, with an extrapolation at either end."""
BELOW = np.array([[1.0, -1.0, 1.0], [0.0, 1.0, -2.0], [0.0, 0.0, 1.0]])
ABOVE = np.stack([POWERS**0, POWERS, POWERS * (POWERS - 1) / 2])
"""First three powers of a piece about a point one piece before its own first three, and after."""


@dataclass(frozen=True, eq=False)
class BalloonMap:
    """The map of one balloon from zero to ``most_pressure`` kPa and from flat to ``most_height``
    mm.

    ``coefficients`` are the potential's, in height and in asinh(p / ``scale_pressure``). ``base``
    is the map from which this one was ``stiffened``.
    """

    balloon: Balloon
    most_pressure: float
    most_height: float
    coefficients: Array
    scale_pressure: float
    base: BalloonMap | None = None

    def stiffened(self, ratio: float) -> BalloonMap:
        """Return the map of the balloon with the modulus of its films multiplied by ``ratio``.

        Energies are proportional to the modulus at equal pressure over modulus: W(ratio E; p, h) =
        ratio W(E; p / ratio, h). The map then extends to ``ratio`` times the pressure.
        """
        if ratio == 1:
            return self
        return BalloonMap(
            self.balloon.stiffened(ratio),
            ratio * self.most_pressure,
            self.most_height,
            ratio * self.coefficients,
            ratio * self.scale_pressure,
            self.drawn,
        )

    @property
    def drawn(self) -> BalloonMap:
        """The map that this one was stiffened from, or itself."""
        return self.base or self

    @property
    def ratio(self) -> float:
        """Pressures of this map by those at which ``drawn`` has the same heights."""
        return self.scale_pressure / self.drawn.scale_pressure

    def pressures(self, shares: Array) -> Array:
        """Return pressures in kPa from 0 to the most, even in the spline's coordinate."""
        most = math.asinh(self.most_pressure / self.scale_pressure)
        return np.minimum(self.scale_pressure * np.sinh(shares * most), self.most_pressure)

    @cached_property
    def spans(self) -> float:
        """The pieces of the spline per mm of height."""
        return HEIGHT_SPANS / self.most_height

    @cached_property
    def _by_pressure(self) -> Array:
        """The polynomials in height of each coefficient: (powers x pieces, coefficients)."""
        rows = pieces(self.coefficients).transpose(2, 1, 0)
        return np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]))

    def splines(self, pressure: ArrayLike, orders: int = 2, sucked: bool = False) -> Array:
        """Return the polynomials by height of W, of -dW/dp (the volume) and of the volume's rate by
        pressure, the first ``orders`` of these, at pressures: (powers, pieces, orders, ...).

        With ``sucked`` pressures may be below 0, as in a closed chamber that is pulled open: slack
        films collapse, and their volume falls by exp(p / COLLAPSE_SUCTION). Raises DesignError for
        a pressure outside the map.
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
        """Return the coordinate in pieces of the spline at pressures, and its derivative."""
        each = PRESSURE_SPANS / math.asinh(self.most_pressure / self.scale_pressure)
        x = np.minimum(np.arcsinh(p / self.scale_pressure) * each, PRESSURE_SPANS * (1 - 1e-12))
        return x, each / np.hypot(p, self.scale_pressure)

    def force(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the force in mN on the plate at either end; negative for a pull."""
        return -self._along(0, pressure, height)[1] * self.spans

    def volume(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the volume of the balloon, ul."""
        return self._along(1, pressure, height)[0]

    def potential(self, pressure: ArrayLike, height: ArrayLike) -> Array:
        """Return the energy of the films minus pressure times volume, uJ."""
        return self._along(0, pressure, height)[0]

    def _along(self, which: int, pressure: ArrayLike, height: ArrayLike) -> tuple[Array, ...]:
        """Return one of ``splines`` and its derivative with respect to height, in pieces."""
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
        """Return an interpolated free height, as the start of a search."""
        x = np.arcsinh(np.asarray(pressure, float) / self.scale_pressure)
        return np.interp(x, *self.drawn._rises)

    @cached_property
    def _rises(self) -> tuple[Array, Array]:
        shares = np.linspace(0, 1, RISE_POINTS)
        x = shares * math.asinh(self.most_pressure / self.scale_pressure)
        return x, self.free_height(self.pressures(shares))


def refuse_outside(pressures: Array, most_pressure: float) -> None:
    """Raise DesignError for pressures in kPa below 0 or above the maximum, which itself is inside.

    It stays inside even if asinh and sinh, or a film's modulus, round it up.
    """
    if pressures.min() >= 0 and pressures.max() <= most_pressure * (1 + 1e-12):
        return
    worst = pressures.max() if pressures.min() >= 0 else pressures.min()
    raise DesignError(
        f"a pressure of {float(worst):g} kPa is outside the balloon's map; give 0 to "
        f"{most_pressure:g} kPa"
    )


def pieces(coefficients: Array) -> Array:
    """Return polynomials of splines in height: (..., coefficients) become (..., PIECES_IN_ALL,
    powers).

    The first extends below the spline and the last above it, with the second derivative there.
    """
    inner = coefficients[..., WINDOWS] @ BASIS[0]
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

    ``which`` is the row of each spline's first piece; the next one is ``stride`` rows later.
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
    blank = np.zeros((PRESSURE_SPANS + DEGREE, HEIGHT_SPANS + DEGREE))
    frame = BalloonMap(balloon, most_pressure, math.inf, blank, scale)
    p = frame.pressures(_spread(PRESSURE_POINTS))
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
    frame = replace(frame, most_height=top)
    return replace(frame, coefficients=_fitted(frame, shapes, heights, free))


def _spread(count: int) -> Array:
    """Return points from 0 to 1, closer together at the ends."""
    even = np.linspace(0, 1, count)
    return (even + (1 - np.cos(math.pi * even)) / 2) / 2


def _fitted(frame: BalloonMap, shapes: Shapes, h: Array, free: Shapes) -> Array:
    """Return the coefficients of the potential: least squares of W, the force and the volume of
    balloons between plates at heights ``h``, and of ``free`` ones, within the limits.

    ``inflate`` fixes the wrinkles' stress while it seeks equilibrium, so its forces and volumes are
    not exactly slopes of one potential. Heights and bends depend on the forces. Raises DesignError
    if no coefficients are within the limits.
    """
    top, p = frame.most_height, shapes.pressure
    area = shapes.r[:, -1].max() ** 2 * math.pi
    push = 1 / (area * (p + LOW_PRESSURE) + 3 * np.abs(shapes.force))
    room = VOLUME_WEIGHT / (area * np.minimum(h + LOW_HEIGHT, top))
    inside = free.height < top
    stands, at, held = free.height[inside], free.pressure[inside], free.volume[inside]
    lift = FREE_WEIGHT / (area * (at + LOW_PRESSURE))
    roomy = FREE_WEIGHT * VOLUME_WEIGHT / (area * np.minimum(stands + LOW_HEIGHT, top))
    low = h == h.min()
    # Places, orders of the derivatives by pressure and height, weights and values. A balloon
    # pressed flat has no volume, a free one carries no force.
    fitted = (
        (p, h, 0, 0, push / top, shapes.energy - p * shapes.volume),
        (p, h, 0, 1, push, shapes.force),
        (p, h, 1, 0, room, shapes.volume),
        (p[low], 0 * p[low], 1, 0, FLAT_WEIGHT * room[low], 0 * p[low]),
        (at, stands, 0, 1, lift, 0 * at),
        (at, stands, 1, 0, roomy, held),
    )
    matrix = np.concatenate([_rows(frame, *each) * weight[:, None] for *each, weight, _ in fitted])
    right_side = np.concatenate([weight * values for *_, weight, values in fitted])
    # With columns scaled to equal length the normal equations are well-conditioned (2e6; 1e17
    # without scaling), and need no orthogonal factorisation.
    units = 1 / np.sqrt((matrix * matrix).sum(0))
    matrix *= units
    normal = matrix.T @ matrix
    most = shapes.volume.reshape(HEIGHT_POINTS, -1).max(0)
    limits = MapLimits(units, *_limits(frame, area, np.append(0.0, free.pressure), most))
    best = nearest_admissible(np.linalg.solve(normal, matrix.T @ right_side), normal, limits)
    if best is None:
        raise DesignError(
            f"no smooth map of the balloon was found up to {frame.most_pressure:g} kPa; lower "
            "the pressure"
        )
    return np.asarray((units * best).reshape(frame.coefficients.shape))


def _rows(frame: BalloonMap, p: Array, h: Array, by_p: int, by_h: int) -> Array:
    """Return W, or the volume or force as its negative derivative with respect to pressure or
    height, at places (n,) as a matrix by coefficients: (n, coefficients).
    """
    x, rate = frame.scaled(p)
    y = np.minimum(h * frame.spans, HEIGHT_SPANS * (1 - 1e-12))
    across = _weights(x, by_p, PRESSURE_SPANS) * (-rate[:, None] if by_p else 1.0)
    along = _weights(y, by_h, HEIGHT_SPANS) * (-frame.spans if by_h else 1.0)
    return np.asarray((across[:, :, None] * along[:, None]).reshape(len(p), -1))


def _weights(places: Array, order: int, spans: int, first: Array | None = None) -> Array:
    """Return the weights of a spline's coefficients for its value, or a derivative, at places in
    pieces: (..., coefficients). ``first`` are the pieces that places on their ends belong to.
    """
    piece = (places if first is None else first + 0 * places).astype(np.int_)
    weights = np.zeros((*places.shape, spans + DEGREE))
    windows = piece[..., None] + np.arange(DEGREE + 1)
    values = (places - piece)[..., None] ** POWERS @ BASIS[order].T
    np.put_along_axis(weights, windows, values, -1)
    return weights


MapLimit = tuple[Array, Array, Array]
"""Matrices by pressure and by height (Bernstein coefficients, coefficients), and a constant for
each row by pressure, added to the result.
"""


class MapLimits:
    """Functions of a spline's coefficients ``units * x`` that must be above 0, with MARGIN as
    target: the products of the rows by pressure and by height of each kind, over their lengths.
    """

    def __init__(self, units: Array, *kinds: MapLimit) -> None:
        self.units = units.reshape(PRESSURE_SPANS + DEGREE, -1)
        self.kinds = [
            (a, b, constant[:, None] - MARGIN, np.sqrt(a**2 @ self.units**2 @ (b**2).T))
            for a, b, constant in kinds
        ]

    def worst(self, x: Array) -> tuple[float, Array]:
        """Return the room left by the most violated limit, and its slopes by x."""
        grid, worst, slopes = self.units * x.reshape(self.units.shape), math.inf, self.units
        for a, b, constant, size in self.kinds:
            room = a @ grid @ b.T
            room += constant
            room /= size
            i, j = divmod(int(room.argmin()), len(b))
            if room[i, j] < worst:
                worst = float(room[i, j])
                slopes = self.units * np.outer(a[i], b[j]) / size[i, j]
        return worst, slopes.ravel()


def _limits(frame: BalloonMap, area: float, pressures: Array, held: Array) -> Iterator[MapLimit]:
    """Yield the limits on W. Volumes rise with pressure, are above 0 without pressure, and at the
    end of each piece at most the largest volume ``held`` at the next of ``pressures`` at any
    height, as shares of area times height. Forces fall with height, as shares of pressure times
    area.

    The limits apply to Bernstein coefficients, so that they also hold between places.
    """
    top, scale_pressure = frame.most_height, frame.scale_pressure
    each = PRESSURE_SPANS / math.asinh(frame.most_pressure / scale_pressure)
    x = np.linspace(0, PRESSURE_SPANS, PRESSURE_SPANS * PRESSURE_PARTS + 1)
    y = np.sort(np.concatenate([np.arange(HEIGHT_SPANS + 1.0), HEIGHT_SPANS * LOW_PARTS]))
    value, slope, curve = (each**order * _parts(x, order, PRESSURE_SPANS) for order in (0, 1, 2))
    # With p = p0 sinh s the volume is -W_s / (p0 cosh s). It rises if tanh(s) W_s - W_ss > 0.
    # W_s < 0, and tangents of tanh lie above it: the tangent at a part's middle replaces it.
    low, high = x[:-1, None] / each, x[1:, None] / each
    middle = (low + high) / 2
    tangent = np.tanh(middle) + (high - low) * (EVEN - 0.5) / np.cosh(middle) ** 2
    scale = scale_pressure * np.cosh(middle[..., None]) * area * top
    rises = BERNSTEIN @ ((tangent[..., None] * slope - curve) / scale)
    falls = BERNSTEIN @ value * HEIGHT_SPANS**2 / top
    falls /= area * (scale_pressure * np.sinh(middle[..., None]) + LOW_PRESSURE)
    share = np.maximum(y[1:, None, None] / HEIGHT_SPANS, LEAST_CHECK)
    by_height, bent = (BERNSTEIN @ _parts(y, order, HEIGHT_SPANS) for order in (0, 2))
    plain, along = _joined(by_height), _joined(by_height / share)
    # Volumes rise with pressure, so in a piece they are bounded by the value at its end.
    ends = slice(PRESSURE_PARTS - 1, None, PRESSURE_PARTS)
    at = scale_pressure * np.sinh(high[ends, 0])
    content = slope[ends, -1] / (np.hypot(at, scale_pressure) * area * top)[:, None]
    next_one = np.minimum(np.searchsorted(pressures, at * (1 - 1e-9)), len(pressures) - 1)
    most = (1 + HELD_MARGIN) * np.maximum.accumulate(held)[next_one] / (area * top)
    every, none = rises.reshape(-1, rises.shape[-1]), -slope[0, :1] / (scale_pressure * area * top)
    yield every, along, np.zeros(len(every))
    yield _joined(falls), _joined(bent), np.zeros(len(falls) * DEGREE + 1)
    yield none, along, np.zeros(1)
    yield content, plain, most


def _joined(parts: Array) -> Array:
    """Return the coefficients of all parts; those shared by two parts appear once."""
    return np.concatenate([parts[:, :-1].reshape(-1, parts.shape[-1]), parts[-1, -1:]])


def _parts(ends: Array, order: int, spans: int) -> Array:
    """Return the values at EVEN places of a spline or a derivative on the parts between ``ends``
    (in pieces): the matrix (parts, DEGREE + 1, coefficients) to its coefficients.
    """
    low, wide = ends[:-1, None], np.diff(ends)[:, None]
    return _weights(low + wide * EVEN, order, spans, first=low + wide / 2)


def nearest_admissible(point: Array, metric: Array, limits: MapLimits) -> Array | None:
    """Return the x within the limits that is nearest to ``point`` (n,), by the squared distance
    d @ ``metric`` @ d; None if no such x is found.

    Dual active set (Goldfarb and Idnani, Math. Programming 27 (1983) 1): each step adds the most
    violated limit to the active ones, ``rows`` scaled by the metric's root with the multipliers
    ``pushes``, and drops those whose multiplier would change its sign.
    """
    root = np.linalg.inv(np.linalg.cholesky(metric))
    x, rows, pushes, gram = point, np.zeros((0, len(point))), np.zeros(0), np.zeros((0, 0))
    lack = 0.0
    for _ in range(MOST_CHANGES):
        if not lack:
            room, slopes = limits.worst(x)
            if room > -MET:
                return x
            added, own, lack = root @ slopes, 0.0, -room
            near, square = rows @ added, float(added @ added)
        change = np.linalg.solve(gram, near)
        way = added - change @ rows
        fall = float(way @ added)
        is_free = fall > 1e-10 * square
        shares = np.divide(pushes, change, out=np.full(len(rows), math.inf), where=change > 0)
        first = float(shares.min(initial=math.inf))
        share = min(first, lack / fall) if is_free else first
        if math.isinf(share):
            return None
        pushes, own = pushes - share * change, own + share
        x = x + share * is_free * (way @ root)
        if share < first:
            rows, pushes, lack = np.vstack([rows, added]), np.append(pushes, own), 0.0
            gram = np.block([[gram, near[:, None]], [near, square]])
        else:
            stays = shares > first
            rows, pushes, near, gram = (
                rows[stays],
                pushes[stays],
                near[stays],
                gram[stays][:, stays],
            )
            lack -= share * is_free * fall
    return None


def stretch(kind: Balloon, shape: Shapes) -> Array:
    """Return the relative elongation of the film between neck and rim."""
    part = slice(kind.neck_edge, kind.edge + 1)
    lengths = np.hypot(np.diff(shape.r[:, part]), np.diff(shape.z[:, part]))
    return np.asarray(lengths.sum(-1) / (kind.pocket - kind.neck) - 1)


# Valid range of a map: within 3 % of balloons computed between its support points.


MOST_ERROR = 0.03
"""Allowed relative error of a map."""
FLAT = 1e-3
"""Height in mm that represents 0."""
PLACE_DIGITS = 6
"""Decimals to which places in kPa and mm are distinguished."""


def holds_at(made: BalloonMap, pressure: Array, height: Array) -> NDArray[np.bool_]:
    """Return where a map is within MOST_ERROR of the balloons computed at places (n,); not where
    one lies outside the map. Raises DesignError if one has no equilibrium.

    Forces are compared as shares of pressure (and 0.1 kPa) times pocket, and the force; volumes as
    shares of the volume and of what a pocket holds at the least height computed. Suction counts as
    no pressure, and heights below FLAT as FLAT. The balloons are ``drawn``'s.
    """
    base = made.drawn
    places = np.stack([np.maximum(pressure / made.ratio, 0.0), np.maximum(height, FLAT)], -1)
    unique, back = np.unique(places.round(PLACE_DIGITS), axis=0, return_inverse=True)
    holds, inside = np.zeros(len(unique), bool), unique[:, 1] <= base.most_height
    if inside.any():
        p, h = np.minimum(unique[inside, 0], base.most_pressure), unique[inside, 1]
        exact = compressed_shapes(base.balloon, p, h, tied=True)
        area = math.pi * base.balloon.pocket**2
        push = area * (p + LOW_PRESSURE) + np.abs(exact.force)
        room = exact.volume + area * LEAST_HEIGHT
        force = np.abs(base.force(p, h) - exact.force) / push
        volume = np.abs(base.volume(p, h) - exact.volume) / room
        holds[inside] = np.maximum(force, volume) <= MOST_ERROR
    return holds[back]
