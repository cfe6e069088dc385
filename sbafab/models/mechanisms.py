"""Figures of drawn pockets by the closed forms of their mechanism: pouch motor, hinge, inflated
beam, jammed sheets, or a pushing pouch.

Lengths and widths are measured on the laminate: a pocket is the open region around its chamber's
centre without the inlet strips. None of these designs is calibrated, so their figures have no
interval. All forces and moments are proportional to the pressure. Lengths mm, pressures kPa.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from sbafab.design.records import Mechanism, MechanismKind
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, strip
from sbafab.laminate.laminate import Chamber, Interface, Laminate
from sbafab.models import pouch
from sbafab.models.figures import MODELS, Figure, FigureItem, LeftOut, Model
from sbafab.models.quantity import Conditions, Quantity

NOT_CALIBRATED = "not calibrated: no interval"
SHARES = (0.1, 0.2, 0.3)
"""Contractions at which a pull is given."""
MOST_STRETCH = 0.05
"""Strain of the film up to which it is taken not to stretch; ours."""
MOST_TURN = 0.1
"""rad by which pressure may bend a plate that counts as stiff; ours."""
RECTANGULAR = 0.9
"""Least share of its bounding box that a pocket fills for models of straight seams; ours."""
LEAST_PLATE_KPA = 1.0
"""kPa that plates must withstand to count as stiff, as a hinge requires; ours."""
UNLIKE = 0.05
"""Share by which pockets of one chamber may differ in area, for the mouths of strips; ours."""
SEPARATE = 1e-3
"""mm between places that count as different."""


class MeasuredPocket(NamedTuple):
    """A pocket for the models: ``length`` along the mechanism and ``width`` across it, mm; the
    ``share`` of its bounding box that it fills, and its interface.
    """

    region: Region
    interface: Interface
    length: float
    width: float
    share: float

    @property
    def film_stiffness(self) -> float | None:
        """Young's modulus times thickness of the less stiff film, N/mm; None if one is unknown."""
        films = self.interface.below.film, self.interface.above.film
        modulus = [film.elastic[0] * film.thickness for film in films if film.elastic is not None]
        return min(modulus) if len(modulus) == len(films) else None


def pockets_of(
    laminate: Laminate, chamber: Chamber, direction: float
) -> list[MeasuredPocket] | None:
    """Return the pockets at a chamber's centres; None if one has no room beside its strips."""
    strips = [inlet.width for inlet in laminate.inlets if inlet.chamber == chamber.name]
    back = max(strips, default=0.0) / 2 + SEPARATE
    pockets = [_pocket(laminate, centre, back, direction) for centre in chamber.centres]
    return [pocket for pocket in pockets if pocket] if all(pockets) else None


def _pocket(
    laminate: Laminate, centre: Point, back: float, direction: float
) -> MeasuredPocket | None:
    for interface in laminate.interfaces:
        # A via or bore at the centre is part of the pocket.
        void = Region(
            tuple(c for c in interface.unbonded.contours if not (c.is_hole and c.winding(centre)))
        )
        if void.contains(centre):
            cores = [piece for piece in grow(void, -back).pieces if piece.contains(centre)]
            if cores:
                region = grow(cores[0], back)
                lying, (x, y) = region.turned(-direction), unit(-direction)
                middle = centre[0] * x - centre[1] * y, centre[0] * y + centre[1] * x
                low_x, low_y, high_x, high_y = lying.bounds
                share = region.area / ((high_x - low_x) * (high_y - low_y))
                length = _chord(lying, middle, 0, _chord(lying, middle, 1) / 4)
                width = _chord(lying, middle, 1, length / 4)
                return MeasuredPocket(region, interface, length, width, share)
    return None


def _chord(region: Region, centre: Point, axis: int, step: float = 0.0) -> float:
    """Return the chord of a region along x (``axis`` 0) or y through its centre.

    With a step, it is the median of this chord and those at that distance on both sides, to skip
    the mouths of strips.
    """
    return sorted(_span(region, centre, axis, off) for off in (-step, 0.0, step))[1]


def _span(region: Region, centre: Point, axis: int, off: float) -> float:
    low, high = region.bounds[axis] - 1.0, region.bounds[2 + axis] + 1.0
    at = centre[1 - axis] + off
    start, end = ((low, at), (high, at)) if axis == 0 else ((at, low), (at, high))
    pieces = (region & strip(start, end, SEPARATE)).pieces
    spans = [(piece.bounds[axis], piece.bounds[2 + axis]) for piece in pieces]
    return sum(b - a for a, b in spans if a <= centre[axis] <= b)


class Limit(NamedTuple):
    """The pressure limit of a model in kPa, the failure beyond it, and a way to raise it."""

    most: float
    beyond: str
    remedy: str


UNLIMITED = Limit(math.inf, "", "")


class FilledChamber(NamedTuple):
    """A chamber with its ``pockets``, all of one size, at ``pressures`` in kPa; ``of`` names it in
    a figure's name if there are several.
    """

    mechanism: Mechanism
    laminate: Laminate
    chamber: Chamber
    pockets: Sequence[MeasuredPocket]
    pressures: Sequence[float]
    of: str

    @property
    def sizes(self) -> tuple[float, float]:
        """The length and width of a pocket in mm."""
        return self.pockets[0].length, self.pockets[0].width

    @property
    def rows(self) -> tuple[int, int]:
        """The numbers of pockets in series along the direction, and side by side."""
        x, y = unit(self.mechanism.direction)
        centres = self.chamber.centres
        places = {round((px * x + py * y) / SEPARATE) for px, py in centres}
        return len(places), len(centres) // len(places)

    def model(self, name: str, **facts: object) -> Model:
        """Return a model with the pocket's facts in its validity."""
        length, width = self.sizes
        films = f"films that stretch less than {100 * MOST_STRETCH:g} %"
        if self.pockets[0].film_stiffness is None:
            films = "films are taken not to stretch, and the modulus of one is not known"
        bend = math.degrees(pouch.free_bend())
        model = MODELS[name].filled(length=length, width=width, films=films, bend=bend, **facts)
        return replace(model, trust=f"{model.trust}; {NOT_CALIBRATED}")

    def left_out(self, name: str, reason: str, *quantities: Quantity) -> LeftOut:
        of = f" of {self.of}" if self.of else ""
        return LeftOut(f"{name}{of}", reason, quantities)

    def not_straight(self, name: str, *quantities: Quantity) -> LeftOut | None:
        """Return why models of straight seams are invalid; None if they are valid."""
        share = self.pockets[0].share
        if share >= RECTANGULAR:
            return None
        reason = (
            f"the model is of straight seams, and the pocket fills {100 * share:.0f} % of the "
            f"rectangle round it, less than {100 * RECTANGULAR:g} %"
        )
        return self.left_out(name, reason, *quantities)

    def stretch(self, tension_at_1_kpa: float) -> Limit:
        """Return the pressure at which the film is stretched by ``MOST_STRETCH``."""
        stiffness = self.pockets[0].film_stiffness
        return Limit(
            math.inf if stiffness is None else MOST_STRETCH * stiffness / tension_at_1_kpa,
            f"the film would stretch by more than {100 * MOST_STRETCH:g} %",
            "a film of more modulus x thickness",
        )

    def by_pressure(
        self,
        quantity: Quantity,
        at_1_kpa: float,
        model: Model,
        at: Conditions,
        limit: Limit = UNLIMITED,
    ) -> Iterator[FigureItem]:
        """Yield a figure at each pressure up to the limit, and at the limit if that is below all
        pressures.
        """
        for pressure in self.pressures:
            here = at._replace(kpa=pressure)
            if pressure <= limit.most:
                yield Figure(quantity, pressure * at_1_kpa, model, here)
                continue
            reason = (
                f"{limit.beyond}: the model holds to {limit.most:.3g} kPa, and further with "
                f"{limit.remedy}"
            )
            yield LeftOut(quantity.named(here), reason, (quantity,))
        if self.pressures and limit.most < min(self.pressures):
            last = float(f"{limit.most * 0.999:.3g}")
            yield Figure(quantity, last * at_1_kpa, model, at._replace(kpa=last))


def mechanism_figures(
    mechanism: Mechanism, laminate: Laminate, pressures: Sequence[float]
) -> Iterator[FigureItem]:
    """Yield the figures of a mechanism by chamber, and the omitted ones with the reason."""
    for chamber in laminate.chambers:
        pockets = pockets_of(laminate, chamber, mechanism.direction) or []
        areas = [pocket.region.area for pocket in pockets]
        reason = "" if pockets else "it has no pocket wider than a strip"
        if pockets and max(areas) > (1 + UNLIKE) * min(areas):
            reason = "its pockets are of different sizes, and the model is of equal ones"
        if reason:
            yield LeftOut(f"what chamber {chamber.name} does", reason)
            continue
        of = chamber.name if len(laminate.chambers) > 1 else ""
        filled = FilledChamber(mechanism, laminate, chamber, pockets, pressures, of)
        yield from FIGURES[mechanism.kind](filled)


def _motor(filled: FilledChamber) -> Iterator[FigureItem]:
    curved = filled.not_straight("contraction and pull", Quantity.CONTRACTION, Quantity.PULL)
    if curved:
        yield curved
        return
    (series, beside), (length, width) = filled.rows, filled.sizes
    model, at = filled.model("pouch-motor"), Conditions(of=filled.of)
    most = pouch.LARGEST_CONTRACTION
    yield Figure(Quantity.CONTRACTION, series * length * most, model, at)
    yield Figure(Quantity.CONTRACTION_SHARE, 100 * most, model, at)
    for share in SHARES:
        angle = float(pouch.half_angle(share))
        limit = filled.stretch(float(pouch.tension(1.0, angle, length)))
        pull = beside * float(pouch.pull(1.0, share, length, width))
        shorter = at._replace(share=share)
        yield from filled.by_pressure(Quantity.PULL, pull, model, shorter, limit)
    content = len(filled.pockets) * float(pouch.volume(most, length, width))
    yield Figure(Quantity.CONTRACTION_VOLUME, content, model, at)


def _hinge(filled: FilledChamber) -> Iterator[FigureItem]:
    curved = filled.not_straight("bend and moment", Quantity.FREE_BEND, Quantity.MOMENT)
    if curved:
        yield curved
        return
    length, width = filled.sizes
    model, count, bend = filled.model("pouch-hinge"), len(filled.pockets), pouch.free_bend()
    at = Conditions(of=filled.of, hinges=count if count > 1 else None)
    yield Figure(Quantity.FREE_BEND, count * math.degrees(bend), model, at)
    angle = float(pouch.half_angle(1 - math.cos(bend / 4)))
    limit = filled.stretch(float(pouch.tension(1.0, angle, length)))
    plates = _plate_bend(filled.laminate, length)
    if plates.most < LEAST_PLATE_KPA:
        reason = (
            "it has no stiff plate: the stiffest of its films would itself bend by more than "
            f"{math.degrees(MOST_TURN):.0f} deg over half the pouch at {plates.most:.2g} kPa; lay "
            "a thicker or stiffer layer under it"
        )
        yield filled.left_out("moment", reason, Quantity.MOMENT)
        return
    for share in (0.0, 0.5):
        moment = float(pouch.moment(1.0, share * bend, length, width))
        bent = Conditions(of=filled.of, share=share)
        yield from filled.by_pressure(Quantity.MOMENT, moment, model, bent, min(limit, plates))


def _plate_bend(laminate: Laminate, length: float) -> Limit:
    """Return the pressure at which the plates' ends rotate by ``MOST_TURN``: p a^3 / 6 D."""
    films = [layer.film for layer in laminate.tpe_layers]
    stiffest = max((f.elastic[0] * f.thickness**3 / 12 for f in films if f.elastic), default=0.0)
    return Limit(
        1000 * MOST_TURN * 6 * stiffest / (length / 2) ** 3,
        f"the plates themselves would bend by more than {math.degrees(MOST_TURN):.0f} deg",
        "a thicker layer under them",
    )


def _beam(filled: FilledChamber) -> Iterator[FigureItem]:
    length, width = filled.sizes
    across = 2 * pouch.tube_radius(width)
    if length < pouch.SLENDER * across:
        reason = (
            f"{length:.4g} mm is less than {pouch.SLENDER:g} times the inflated diameter, "
            f"{across:.3g} mm: no beam"
        )
        yield filled.left_out("inflated beam", reason)
        return
    model, at = filled.model("inflated-beam"), Conditions(of=filled.of)
    yield Figure(Quantity.BEAM_DIAMETER, across, model, at)
    limit = filled.stretch(pouch.hoop_tension(1.0, width))
    for quantity, law in (
        (Quantity.WRINKLING_LOAD, pouch.wrinkling_moment),
        (Quantity.COLLAPSE_LOAD, pouch.collapse_moment),
    ):
        yield from filled.by_pressure(quantity, law(1.0, width) / length, model, at, limit)


def _jammed(filled: FilledChamber) -> Iterator[FigureItem]:
    sheets, (_, width) = filled.pockets[0].interface.masks, filled.sizes
    films = {sheet.film for sheet in sheets}
    if len(films) != 1 or len(sheets) < 2:
        reason = f"jamming needs two sheets of one film; it has {len(sheets)}"
        yield filled.left_out("stiffness", reason)
        return
    (film,), friction = films, filled.mechanism.friction
    assert friction is not None
    count, thick = len(sheets), film.thickness
    model = filled.model("laminar-jamming", count=count, thick=thick, friction=friction)
    at = Conditions(of=filled.of)
    yield Figure(Quantity.JAMMING_RATIO, float(count**2), model, at)
    both = Quantity.LOOSE_STIFFNESS, Quantity.JAMMED_STIFFNESS
    if film.elastic is None:
        reason = f"the modulus of {film.material} is not known"
        yield filled.left_out("bending stiffness", reason, *both)
    else:
        for quantity, law in zip(
            both, (pouch.loose_stiffness, pouch.jammed_stiffness), strict=True
        ):
            yield Figure(quantity, law(film.elastic[0], width, thick, count), model, at)
    slip = -pouch.slip_force(1.0, friction, width, thick, count)
    yield from filled.by_pressure(Quantity.SLIP_LOAD, slip, model, at)


def _push(filled: FilledChamber) -> Iterator[FigureItem]:
    at = Conditions(of=filled.of, each="pouch" if len(filled.pockets) > 1 else "")
    model, push = filled.model("textile-pouches"), filled.pockets[0].region.area / 1000
    yield from filled.by_pressure(Quantity.FORCE_BOUND, push, model, at)


FIGURES: Mapping[MechanismKind, Callable[[FilledChamber], Iterator[FigureItem]]] = {
    "pouch-motor": _motor,
    "hinge": _hinge,
    "beam": _beam,
    "jamming": _jammed,
    "push": _push,
}
LEFT_OUT: Mapping[MechanismKind, tuple[str, ...]] = {
    "pouch-motor": ("bending", "folded diameter"),
    "hinge": ("stroke", "folded diameter"),
    **dict.fromkeys(("beam", "jamming", "push"), ("stroke", "bending", "folded diameter")),
}
"""Quantities that a mechanism has no figure for."""
