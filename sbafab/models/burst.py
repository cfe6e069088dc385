"""Burst pressure, scaled from the paper's three actuators: for a proof test, not to design with.

The paper burst three actuators with pockets of 5 mm in its film of 0.038 mm, at 367 +- 18 kPa
(Sec. 4, 7). A thin film of radius r and thickness t under p carries p r / 2 t where it is a
sphere's and p r / t where it is a cylinder's. Taken in proportion, nothing else is known.
"""

from __future__ import annotations

import math

from sbafab.design.form import Discs, Form, Slots
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS
from sbafab.laminate.laminate import Laminate
from sbafab.models.paper import BURST

RADIUS = 2.5
"""mm, of the pockets that burst."""


def burst_pressure(form: Form, laminate: Laminate) -> float | None:
    """Return an estimate in kPa of the pressure at which the widest pocket bursts.

    An oblong pocket of width w becomes a cylinder of radius w / pi, whose film carries twice what
    a sphere's does. None for a film of another product, or a drawn pocket: nothing was measured.
    """
    films = {layer.film for layer in laminate.layers if not layer.is_mask}
    if any(film.product != PAPER_PRODUCT for film in films):
        return None
    if isinstance(form.pockets, Discs):
        radius = max(form.pockets.diameters) / 2
    elif isinstance(form.pockets, Slots):
        radius = 2 * form.pockets.width / math.pi
    else:
        return None
    thickness = min(film.thickness for film in films)
    return BURST.value * RADIUS / radius * thickness / PAPER_THICKNESS
