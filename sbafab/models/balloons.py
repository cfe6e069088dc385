"""The elastic balloons that a design's chambers are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.design.form import Discs
from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon

if TYPE_CHECKING:
    from sbafab.design.records import Design
    from sbafab.laminate.films import Film
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.figures import Factors


def balloons_of(
    design: Design, laminate: Laminate, factors: Factors | None = None
) -> list[Balloon]:
    """The balloons of one chamber, bottom to top, all taken for inner ones.

    ``factors`` may make the pockets smaller than drawn, and give another modulus than the film's.
    Raises DesignError where pockets are not round, or for films whose modulus is not known.
    """
    form = design.form
    if not isinstance(form.pockets, Discs) or form.wrap is not None:
        raise DesignError(
            f"design {design.name} has no round pockets on flat plates; only those have an elastic "
            "model: simulate the design instead"
        )
    loss = 0.0 if factors is None else factors.pocket_loss
    film = _film(laminate)
    modulus, poisson = film.elastic or (0.0, 0.0)
    if factors is not None and factors.modulus_mpa is not None:
        modulus = factors.modulus_mpa
    radii = [diameter / 2 - loss for diameter in form.pockets.diameters]
    bore = design.bore.diameter / 2 if len(radii) > 1 else 0.0
    neck = bore + design.bond.width if len(radii) > 1 else 0.0
    if min(radii) < max(1.1 * neck, 0.1):
        raise DesignError(
            f"a pocket loss of {loss:g} mm leaves a pocket of radius {min(radii):g} mm, no wider "
            f"than the neck of {neck:g} mm; give less"
        )
    ring = design.bond.width + loss
    return [
        Balloon(radius, ring, neck, bore, film.thickness, 1000 * modulus, poisson)
        for radius in radii
    ]


def _film(laminate: Laminate) -> Film:
    """The one film that balloons are made of."""
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    unknown = {film.material for film in films if film.elastic is None}
    if unknown:
        raise DesignError(
            f"no modulus of {min(unknown)} is known; add films.{min(unknown).lower()}.modulus, in "
            "MPa, and poisson, its ratio"
        )
    if len(films) > 1:
        raise DesignError(
            "the balloons' films are unlike, and the elastic model takes both for one; simulate "
            "the design instead"
        )
    return films.pop()
