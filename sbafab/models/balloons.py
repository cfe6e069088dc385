"""The elastic balloons that a design's chambers are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab.design.form import Discs
from sbafab.errors import DesignError
from sbafab.models.balloon import Balloon

if TYPE_CHECKING:
    from sbafab.design.records import Design
    from sbafab.laminate.laminate import Laminate


def balloons_of(design: Design, laminate: Laminate) -> list[Balloon]:
    """The balloons of one chamber, bottom to top, all taken for inner ones.

    Raises DesignError where pockets are not round, or for films whose modulus is not known.
    """
    form = design.form
    if not isinstance(form.pockets, Discs) or form.wrap is not None:
        raise DesignError(
            f"design {design.name} has no round pockets on flat plates; only those have an elastic "
            "model: simulate the design instead"
        )
    films = [layer.film for layer in laminate.layers if not layer.is_mask]
    others = {film.material for film in films if film.material != "TPE"}
    if others:
        raise DesignError(f"no modulus of {min(others)} is known; only films of TPE have one")
    radii = [diameter / 2 for diameter in form.pockets.diameters]
    bore = design.bore.diameter / 2 if len(radii) > 1 else 0.0
    neck = bore + design.bond.width if len(radii) > 1 else 0.0
    return [Balloon(radius, design.bond.width, neck, bore, films[0].thickness) for radius in radii]
