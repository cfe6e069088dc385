"""Stress of a balloon's film by Hooke's law, from the strains of its shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.models.balloon import Balloon, Shapes, ripples_at, squared_tilt
from sbafab.models.film_elements import strain

if TYPE_CHECKING:
    from sbafab.models.film_elements import Array


class FilmStress(NamedTuple):
    """Stress by element, kPa: force over the deformed width times the flat film's thickness."""

    meridian: Array
    hoop: Array


def stresses(balloon: Balloon, shapes: Shapes) -> FilmStress:
    """Return the stress of the film's elements, from the inside outward; the hoop's is 0 in
    wrinkles.

    A rim that ripples has the mean round it: more inside, less or tension outside. Bending, which
    adds to it at neck and rim, is left out.
    """
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
