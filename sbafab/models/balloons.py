"""The elastic balloons of a design's chambers; one balloon at a volume or under a force, and the
stress of its film.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.design.records import Discs, Form
from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon, Shapes, inflate, ripples_at, squared_tilt
from sbafab.models.film_elements import strain
from sbafab.models.paper import BURST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from sbafab.design.records import Design
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.figures import Factors
    from sbafab.models.film_elements import Array

LEAST_RATIO, LEAST_RADIUS = 1.1, 0.1
"""Least pocket radius: in neck radii, and in mm."""


def has_balloons(form: Form) -> bool:
    """Return True if the elastic model covers such pockets: round ones on flat plates."""
    return isinstance(form.pockets, Discs) and form.wrap is None


def balloons_of(
    design: Design,
    laminate: Laminate,
    factors: Factors | None = None,
    form: Form | None = None,
) -> list[Balloon]:
    """Return the balloons of one chamber, bottom to top, all taken for inner ones.

    ``form`` replaces the design's own. ``factors`` may make the pockets smaller than drawn, and
    give another modulus than the film's. Raises DesignError where pockets are not round, or for
    films whose modulus is not known.
    """
    form = form or design.form
    if not has_balloons(form) or not isinstance(form.pockets, Discs):
        raise DesignError(
            f"design {design.name} has no round pockets on flat plates; only those have an elastic "
            "model: simulate the design instead"
        )
    loss = 0.0 if factors is None else factors.pocket_loss
    pairs = _films(laminate, factors)
    radii = [diameter / 2 - loss for diameter in form.pockets.diameters]
    bore = design.bore.diameter / 2 if len(radii) > 1 else 0.0
    neck = bore + design.bond.width if len(radii) > 1 else 0.0
    least, smallest = max(LEAST_RATIO * neck, LEAST_RADIUS), min(radii)
    if smallest < least:
        has = f"a pocket loss of {loss:g} mm leaves {smallest:.4g}"
        if not loss:
            has = f"this one has {smallest:.4g}"
        of = f", {LEAST_RATIO:g} times the neck's {neck:.4g}" if least > LEAST_RADIUS else ""
        raise DesignError(
            f"the elastic balloon's pocket must be at least {least:.4g} mm in radius{of}, and "
            f"{has}; {'give less loss' if loss else 'make the chamber wider'}"
        )
    ring = design.bond.width + loss
    balloons = []
    for radius, films in zip(radii, pairs, strict=True):
        lower, upper = (Balloon(radius, ring, neck, bore, *film) for film in films)
        balloons.append(lower if lower == upper else replace(lower, mate=upper))
    return balloons


def _films(laminate: Laminate, factors: Factors | None) -> list[list[tuple[float, float, float]]]:
    """Return thickness in mm, modulus in kPa and Poisson's ratio of each balloon's two films."""
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    unknown = {film.material for film in films if film.elastic is None}
    if unknown:
        raise DesignError(
            f"modulus and Poisson's ratio of {min(unknown)} are not known; add "
            f"films.{min(unknown).lower()}.modulus, in MPa, and poisson, its ratio"
        )
    measured = None if factors is None else factors.modulus_mpa
    ratio = 1.0 if factors is None else factors.modulus_ratio
    if measured is not None and len(films) > 1:
        raise DesignError(
            "one modulus is given for unlike films; leave it out, and set films.<name>.modulus of "
            "each instead"
        )
    properties = {}
    for film in films:
        modulus, poisson = film.elastic or (0.0, 0.0)
        properties[film] = (
            film.thickness,
            1000 * ratio * (modulus if measured is None else measured),
            poisson,
        )
    row = [properties[layer.film] for layer in laminate.tpe_layers]
    return [row[i : i + 2] for i in range(0, len(row), 2)]


# One balloon at a volume or under a force, and the stress of its film.


LEAST_KPA, FIRST_KPA, WIDER_BRACKET = 1e-3, 1.0, 4.0
"""Lowest pressure of the search, its first one, and the factor by which the bracket widens."""
FLAT = 2e-3
"""Height in mm that stands for a balloon pressed flat."""
TOLERANCE = 1e-5
"""Relative error of the volume or force that is met."""
MOST_STEPS = 60


class FilmStress(NamedTuple):
    """Stress by element, kPa: force over the deformed width times the flat film's thickness."""

    meridian: Array
    hoop: Array


def inflate_to(balloon: Balloon, volume: ArrayLike, height: ArrayLike | None = None) -> Shapes:
    """Return the shapes that hold volumes (ul), free or between plates at heights (mm).

    Raises DesignError for volumes that need no pressure, or more than the paper's burst pressure.
    """
    shape = np.broadcast_shapes(np.shape(volume), np.shape(height) if height is not None else ())
    target = np.broadcast_to(np.asarray(volume, dtype=float), shape).reshape(-1)
    plates = None if height is None else np.broadcast_to(height, shape).reshape(-1)

    def over(log_p: Array) -> Array:
        return np.asarray(inflate(balloon, np.exp(log_p), plates).volume / target - 1)

    if not (target > 0).all():
        raise DesignError("volumes of a balloon must be above 0 ul")
    low = high = np.full(target.shape, np.log(FIRST_KPA))
    while (is_over := over(low) > 0).any():
        if (low[is_over] < np.log(LEAST_KPA)).any():
            raise DesignError(
                f"a balloon holds {float(target[is_over][0]):g} ul without pressure; ask for more"
            )
        low = np.where(is_over, low - np.log(WIDER_BRACKET), low)
    while (is_under := over(high) < 0).any():
        if (high[is_under] >= np.log(BURST.value)).any():
            raise DesignError(
                f"a balloon does not hold {float(target[is_under][0]):g} ul at {BURST.value:g} "
                "kPa, where the paper's burst; ask for less"
            )
        wider = np.minimum(high + np.log(WIDER_BRACKET), np.log(BURST.value))
        high = np.where(is_under, wider, high)
    return inflate(balloon, np.exp(_root(over, low, high)), plates)


def pressed_by(balloon: Balloon, pressure: ArrayLike, force: ArrayLike) -> Shapes:
    """Return the shapes at pressures (kPa) between plates that press with forces (mN).

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
    return inflate(balloon, p, _root(over, low, inflate(balloon, p).height))


def _root(over: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return the zero of a rising function between bounds (regula falsi, Illinois variant)."""
    below, above = over(low), over(high)
    for _ in range(MOST_STEPS):
        span = np.where(above == below, 1.0, above - below)
        middle = low - below * (high - low) / span
        value = over(middle)
        if (np.abs(value) < TOLERANCE).all():
            return middle
        up = value > 0
        # Of an end that stays, the value counts half, so that the next place lies nearer to it.
        below, above = np.where(up, below / 2, value), np.where(up, value, above / 2)
        low, high = np.where(up, low, middle), np.where(up, middle, high)
    raise DesignError("no such state of a balloon found; try another load")


def stresses(balloon: Balloon, shapes: Shapes) -> FilmStress:
    """Return the stress of the film's elements, from the inside outward; the hoop's is 0 in
    wrinkles.

    A rim that ripples has the mean round it: more inside, less or tension outside. Bending, which
    adds to it at neck and rim, is left out. Raises DesignError for balloons of two unlike films.
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
        (ripple,) = ripples_at((balloon,), ((shapes.r, shapes.z),))
        tilt = squared_tilt(film, balloon.edge, ripple, shapes.r)
        s2[:, balloon.edge :] += film.modulus * tilt[:, None] * ripple.relief
    along = np.hypot(np.diff(shapes.r), np.diff(shapes.z)) / film.lengths
    around = (shapes.r[:, 1:] + shapes.r[:, :-1]) / (2 * film.middles)
    power = film.order - 1
    return FilmStress(s1 * along**power / around, s2 * around**power / along)
