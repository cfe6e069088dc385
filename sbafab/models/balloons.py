"""The elastic balloons of a design's chambers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from sbafab.design.records import Discs, Form
from sbafab.errors import DesignError
from sbafab.models.film_elements import Balloon

if TYPE_CHECKING:
    from sbafab.design.records import Design
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.figures import Factors

LEAST_RATIO, LEAST_RADIUS = 1.1, 0.1
"""Least pocket radius: in neck radii, and in mm."""


def has_balloons(form: Form) -> bool:
    """Return True if the elastic model covers such pockets: round pockets on flat plates."""
    return isinstance(form.pockets, Discs) and form.wrap is None


def balloons_of(
    design: Design,
    laminate: Laminate,
    factors: Factors | None = None,
    form: Form | None = None,
) -> list[Balloon]:
    """Return the balloons of one chamber, bottom to top, all treated as inner ones.

    ``form`` replaces the design's. ``factors`` may reduce the pockets from their drawn size, and
    replace the film's modulus. Raises DesignError if pockets are not round, or for films of unknown
    modulus.
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
        has = f"a pocket loss of {loss:.3g} mm leaves {smallest:.4g}"
        if not loss:
            has = f"this one has {smallest:.4g}"
        of = f", {LEAST_RATIO:g} times the neck's {neck:.4g}" if least > LEAST_RADIUS else ""
        raise DesignError(
            f"the elastic balloon's pocket must be at least {least:.4g} mm in radius{of}, and "
            f"{has}; make the chamber wider"
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
    unknown = sorted((film for film in films if film.elastic is None), key=lambda film: film.table)
    if unknown:
        raise DesignError(
            f"modulus or Poisson's ratio of {unknown[0].product} is not known; give both, "
            f"{unknown[0].table}.modulus, in MPa, and {unknown[0].table}.poisson"
        )
    ratio = 1.0 if factors is None else factors.modulus_ratio
    properties = {}
    for film in films:
        modulus, poisson = film.elastic or (0.0, 0.0)
        properties[film] = film.thickness, 1000 * ratio * modulus, poisson
    row = [properties[layer.film] for layer in laminate.tpe_layers]
    return [row[i : i + 2] for i in range(0, len(row), 2)]
