"""A balloon asked the other way round: at a volume, or under a force; and what its film bears."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import DesignError
from sbafab.models import rim_ripple
from sbafab.models.balloon import Balloon, Shapes, inflate, rippling
from sbafab.models.film_elements import strain
from sbafab.models.paper import BURST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from sbafab.models.film_elements import Array

LEAST_KPA, FIRST_KPA, WIDER = 1e-3, 1.0, 4.0
"""The lowest pressure looked at, the first one, and the factor to the next."""
FLAT = 2e-3
"""mm that stand for a balloon pressed flat."""
CLOSE = 1e-5
"""Share of what is asked for, within which it is met."""
MOST_STEPS = 60


class FilmStress(NamedTuple):
    """Force over the film's section as it is, a flat film's thickness taken, kPa, by element."""

    meridian: Array
    hoop: Array


def inflate_to(balloon: Balloon, volume: ArrayLike, height: ArrayLike | None = None) -> Shapes:
    """The shapes that hold volumes (ul), free or between plates at heights (mm).

    Raises DesignError for volumes that it takes no pressure, or more than the paper's burst
    pressure, to hold.
    """
    shape = np.broadcast_shapes(np.shape(volume), np.shape(height) if height is not None else ())
    wanted = np.broadcast_to(np.asarray(volume, dtype=float), shape).reshape(-1)
    held = None if height is None else np.broadcast_to(height, shape).reshape(-1)

    def over(log_p: Array) -> Array:
        return np.asarray(inflate(balloon, np.exp(log_p), held).volume / wanted - 1)

    if not (wanted > 0).all():
        raise DesignError("volumes of a balloon must be above 0 ul")
    low = high = np.full(wanted.shape, np.log(FIRST_KPA))
    while (is_over := over(low) > 0).any():
        if (low[is_over] < np.log(LEAST_KPA)).any():
            raise DesignError(
                f"a balloon holds {float(wanted[is_over][0]):g} ul without pressure; ask for more"
            )
        low = np.where(is_over, low - np.log(WIDER), low)
    while (is_under := over(high) < 0).any():
        if (high[is_under] >= np.log(BURST.value)).any():
            raise DesignError(
                f"a balloon does not hold {float(wanted[is_under][0]):g} ul at {BURST.value:g} "
                "kPa, where the paper's burst; ask for less"
            )
        wider = np.minimum(high + np.log(WIDER), np.log(BURST.value))
        high = np.where(is_under, wider, high)
    return inflate(balloon, np.exp(_crossing(over, low, high)), held)


def pressed_by(balloon: Balloon, pressure: ArrayLike, force: ArrayLike) -> Shapes:
    """The shapes at pressures (kPa) between plates that press with forces (mN).

    Raises DesignError for forces that press it flat.
    """
    p, pushed = np.broadcast_arrays(
        np.atleast_1d(np.asarray(pressure, dtype=float)), np.asarray(force, dtype=float)
    )
    if not (pushed > 0).all():
        raise DesignError("forces on a balloon must be above 0 mN")

    def over(height: Array) -> Array:
        return np.asarray(1 - inflate(balloon, p, height).force / pushed)

    low = np.full(p.shape, FLAT)
    if (flat := over(low) > 0).any():
        raise DesignError(
            f"{float(pushed[flat][0]):g} mN press a balloon flat at {float(p[flat][0]):g} kPa; "
            "ask for less force"
        )
    return inflate(balloon, p, _crossing(over, low, inflate(balloon, p).height))


def _crossing(over: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where a rising function is 0, between places (the Illinois variant of regula falsi)."""
    below, above = over(low), over(high)
    for _ in range(MOST_STEPS):
        span = np.where(above == below, 1.0, above - below)
        middle = low - below * (high - low) / span
        found = over(middle)
        if (np.abs(found) < CLOSE).all():
            return middle
        up = found > 0
        # Of an end that stays, the value counts half, so that the next place lies nearer to it.
        below, above = np.where(up, below / 2, found), np.where(up, found, above / 2)
        low, high = np.where(up, low, middle), np.where(up, middle, high)
    raise DesignError("a balloon finds no such state; ask for another load")


def stresses(balloon: Balloon, shapes: Shapes) -> FilmStress:
    """What the film's elements bear, from the inside outward; round the hoop 0 where it wrinkles.

    A rim that ripples bears the mean round it: more inside, less or pull outside. Bending, which
    adds to it at neck and rim, is left out. Raises DesignError for unlike films.
    """
    if balloon.mate is not None:
        raise DesignError("stresses of unlike films are not given; ask for each film alone")
    film = balloon.film
    e1, e2 = strain(film, shapes.r, shapes.z)
    plane, nu = film.modulus / (1 - film.poisson**2), film.poisson
    wrinkled = (e2 + nu * e1 < 0) & balloon.may_wrinkle
    s1 = np.where(wrinkled, film.modulus * e1, plane * (e1 + nu * e2))
    s2 = np.where(wrinkled, 0.0, plane * (e2 + nu * e1))
    if balloon.wrinkles and not balloon.inextensible:
        (ripple,) = rippling((balloon,), ((shapes.r, shapes.z),))
        tilt = rim_ripple.amplitude(film, balloon.edge, ripple, shapes.r)
        s2[:, balloon.edge :] += film.modulus * tilt[:, None] * ripple.relief
    along = np.hypot(np.diff(shapes.r), np.diff(shapes.z)) / film.lengths
    around = (shapes.r[:, 1:] + shapes.r[:, :-1]) / (2 * film.middles)
    power = film.order - 1
    return FilmStress(s1 * along**power / around, s2 * around**power / along)
