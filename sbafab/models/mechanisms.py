"""Figures of drawn pockets by the closed forms of their mechanism: pouch motor, hinge, inflated
beam, jammed sheets, or a pouch that pushes.

Lengths and widths are measured on the laminate itself: a pocket is the open region round its
chamber's centre without the inlet strips. None of these designs is calibrated, so their figures
have no interval. Lengths mm, pressures kPa.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.design.records import Mechanism, MechanismKind
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region, strip
from sbafab.laminate.laminate import Chamber, Interface, Laminate
from sbafab.models import pouch
from sbafab.models.figures import Figure, FigureItem, LeftOut, Model
from sbafab.models.quantity import Conditions, ModelId, Quantity

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
    """A pocket as models take it: ``length`` along the mechanism and ``width`` across it, mm;
    ``area`` in mm2, the ``share`` of its bounding box that it fills, and its interface.
    """

    region: Region
    interface: Interface
    length: float
    width: float
    share: float

    @property
    def area(self) -> float:
        return self.region.area

    @property
    def is_rectangular(self) -> bool:
        return self.share >= RECTANGULAR

    @property
    def film_stiffness(self) -> float | None:
        """Young's modulus times thickness of the weaker film in N/mm; None if one is unknown."""
        films = self.interface.below.film, self.interface.above.film
        known = [film.elastic[0] * film.thickness for film in films if film.elastic is not None]
        return min(known) if len(known) == len(films) else None


@dataclass(frozen=True)
class FilledChamber:
    """A chamber with its pockets, all of one size, at the ``pressures`` asked for in kPa.

    ``of`` names the chamber in a figure's name, if there are several.
    """

    mechanism: Mechanism
    laminate: Laminate
    chamber: Chamber
    pockets: Sequence[MeasuredPocket]
    pressures: Sequence[float]
    of: str

    @property
    def rows(self) -> tuple[int, int]:
        """Numbers of pockets one after the other along the direction, and side by side."""
        x, y = unit(self.mechanism.direction)
        centres = self.chamber.centres
        places = {round((px * x + py * y) / SEPARATE) for px, py in centres}
        return len(places), len(centres) // len(places)


def pockets_of(
    laminate: Laminate, chamber: Chamber, direction: float
) -> list[MeasuredPocket] | None:
    """Return the pockets at a chamber's centres; None if one has no room beside its strips."""
    strips = [inlet.width for inlet in laminate.inlets if inlet.chamber == chamber.name]
    back = max(strips, default=0.0) / 2 + SEPARATE
    found = [_pocket(laminate, centre, back, direction) for centre in chamber.centres]
    return [pocket for pocket in found if pocket] if all(found) else None


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

    With a step, the median of it and the chords that far off on both sides, to skip strips' mouths.
    """
    return sorted(_span(region, centre, axis, off) for off in (-step, 0.0, step))[1]


def _span(region: Region, centre: Point, axis: int, off: float) -> float:
    low, high = region.bounds[axis] - 1.0, region.bounds[2 + axis] + 1.0
    at = centre[1 - axis] + off
    start, end = ((low, at), (high, at)) if axis == 0 else ((at, low), (at, high))
    pieces = (region & strip(start, end, SEPARATE)).pieces
    spans = [(piece.bounds[axis], piece.bounds[2 + axis]) for piece in pieces]
    return sum(b - a for a, b in spans if a <= centre[axis] <= b)


def mechanism_figures(
    mechanism: Mechanism, laminate: Laminate, pressures: Sequence[float]
) -> Iterator[FigureItem]:
    """Yield the figures of a mechanism, chamber by chamber, and those left out with the reason."""
    several = len(laminate.chambers) > 1
    for chamber in laminate.chambers:
        of = chamber.name if several else ""
        pockets = pockets_of(laminate, chamber, mechanism.direction)
        if not pockets:
            yield LeftOut(
                f"what chamber {chamber.name} does", "it has no pocket wider than a strip"
            )
            continue
        if max(p.area for p in pockets) > (1 + UNLIKE) * min(p.area for p in pockets):
            reason = "its pockets are of different sizes, and the model is of equal ones"
            yield LeftOut(f"what chamber {chamber.name} does", reason)
            continue
        filled = FilledChamber(mechanism, laminate, chamber, pockets, pressures, of)
        yield from FIGURES[mechanism.kind](filled)


def _not_straight(
    pocket: MeasuredPocket, name: str, of: str, quantities: tuple[Quantity, ...]
) -> LeftOut:
    return LeftOut(
        f"{name}{_of(of)}",
        f"the model is of straight seams, and the pocket fills {100 * pocket.share:.0f} % of the "
        f"rectangle round it, less than {100 * RECTANGULAR:g} %",
        quantities,
    )


def _of(chamber: str) -> str:
    return f" of {chamber}" if chamber else ""


class Limit(NamedTuple):
    """Pressure in kPa up to which a model holds, what happens beyond, and what would raise it."""

    most: float
    beyond: str
    remedy: str


def _stretch(stiffness: float | None, tension_at_1_kpa: float) -> Limit:
    """Return the pressure at which the film is stretched by ``MOST_STRETCH``."""
    return Limit(
        math.inf if stiffness is None else MOST_STRETCH * stiffness / tension_at_1_kpa,
        f"the film would stretch by more than {100 * MOST_STRETCH:g} %",
        "a film of more modulus x thickness",
    )


def _plate_bend(laminate: Laminate, length: float) -> Limit:
    """Return the pressure at which the plates' ends turn by ``MOST_TURN``: p a^3 / 6 D."""
    films = [layer.film for layer in laminate.tpe_layers]
    stiffest = max((f.elastic[0] * f.thickness**3 / 12 for f in films if f.elastic), default=0.0)
    return Limit(
        1000 * MOST_TURN * 6 * stiffest / (length / 2) ** 3,
        f"the plates themselves would bend by more than {math.degrees(MOST_TURN):.0f} deg",
        "a thicker layer under them",
    )


def _while_it_holds(
    quantity: Quantity,
    at: Conditions,
    model: Model,
    limit: Limit,
    pressures: Sequence[float],
    value: Callable[[float], float],
) -> Iterator[FigureItem]:
    """Yield a figure at each pressure up to the limit, and at the limit if that is below all;
    ``value`` gives it by the pressure.
    """
    most = limit.most
    for pressure in pressures:
        here = at._replace(kpa=pressure)
        if pressure <= most:
            yield Figure(quantity, value(pressure), model, here)
        else:
            yield LeftOut(
                quantity.named(here),
                f"{limit.beyond}: the model holds to {most:.3g} kPa, and further with "
                f"{limit.remedy}",
                (quantity,),
            )
    if pressures and most < min(pressures):
        last = float(f"{most * 0.999:.3g}")
        yield Figure(quantity, value(last), model, at._replace(kpa=last))


def _stretch_note(stiffness: float | None) -> str:
    if stiffness is None:
        return "films are taken not to stretch, and the modulus of one is not known"
    return f"films that stretch less than {100 * MOST_STRETCH:g} %"


def _motor(filled: FilledChamber) -> Iterator[FigureItem]:
    of = filled.of
    pocket = filled.pockets[0]
    if not pocket.is_rectangular:
        quantities = Quantity.CONTRACTION, Quantity.PULL
        yield _not_straight(pocket, "contraction and pull", of, quantities)
        return
    series, beside = filled.rows
    length, width = pocket.length, pocket.width
    model = Model(
        ModelId.POUCH_MOTOR,
        "Niiyama et al., Soft Robotics 2 (2015) 59",
        f"two arcs of constant length, {length:.4g} long and {width:.4g} mm wide: contraction 0 to "
        f"36.3 %; seams do not hold it back, {_stretch_note(pocket.film_stiffness)}; "
        f"{NOT_CALIBRATED}",
    )
    most = pouch.LARGEST_CONTRACTION
    at = Conditions(of=of)
    yield Figure(Quantity.CONTRACTION, series * length * most, model, at)
    yield Figure(Quantity.CONTRACTION_SHARE, 100 * most, model, at)
    for share in SHARES:
        angle = float(pouch.half_angle(share))
        limit = _stretch(pocket.film_stiffness, float(pouch.tension(1.0, angle, length)))

        def pull(pressure: float, share: float = share) -> float:
            return beside * float(pouch.pull(pressure, share, length, width))

        shorter = at._replace(share=share)
        yield from _while_it_holds(Quantity.PULL, shorter, model, limit, filled.pressures, pull)
    content = len(filled.pockets) * float(pouch.volume(most, length, width))
    yield Figure(Quantity.CONTRACTION_VOLUME, content, model, at)


def _hinge(filled: FilledChamber) -> Iterator[FigureItem]:
    of = filled.of
    pocket = filled.pockets[0]
    if not pocket.is_rectangular:
        quantities = Quantity.FREE_BEND, Quantity.MOMENT
        yield _not_straight(pocket, "bend and moment", of, quantities)
        return
    length, width = pocket.length, pocket.width
    model = Model(
        ModelId.POUCH_HINGE,
        "statics of an arc over two stiff plates; the angular pouch motor of Niiyama et al., Soft "
        "Robotics 2 (2015) 59",
        f"a pouch {length:.4g} long and {width:.4g} mm wide, its joint in the middle: 0 to "
        f"{math.degrees(pouch.free_bend()):.1f} deg; plates that do not bend, a joint that does "
        f"not resist, {_stretch_note(pocket.film_stiffness)}; an upper bound; {NOT_CALIBRATED}",
    )
    count = len(filled.pockets)
    each = math.degrees(pouch.free_bend())
    at = Conditions(of=of, hinges=count if count > 1 else None)
    yield Figure(Quantity.FREE_BEND, count * each, model, at)
    angle = float(pouch.half_angle(1 - math.cos(pouch.free_bend() / 4)))
    limit = _stretch(pocket.film_stiffness, float(pouch.tension(1.0, angle, length)))
    plates = _plate_bend(filled.laminate, length)
    if plates.most < LEAST_PLATE_KPA:
        yield LeftOut(
            f"moment{_of(of)}",
            "it has no stiff plate: the stiffest of its films would itself bend by more than "
            f"{math.degrees(MOST_TURN):.0f} deg over half the pouch at {plates.most:.2g} kPa; lay "
            "a thicker or stiffer layer under it",
            (Quantity.MOMENT,),
        )
        return
    limit = min(limit, plates)
    for share in (0.0, 0.5):

        def moment(pressure: float, share: float = share) -> float:
            return float(pouch.moment(pressure, share * pouch.free_bend(), length, width))

        bent = Conditions(of=of, share=share)
        yield from _while_it_holds(Quantity.MOMENT, bent, model, limit, filled.pressures, moment)


def _beam(filled: FilledChamber) -> Iterator[FigureItem]:
    of = filled.of
    pocket = filled.pockets[0]
    length, width = pocket.length, pocket.width
    across = 2 * pouch.tube_radius(width)
    if length < pouch.SLENDER * across:
        reason = (
            f"{length:.4g} mm is less than {pouch.SLENDER:g} times the inflated diameter, "
            f"{across:.3g} mm: no beam"
        )
        yield LeftOut(f"inflated beam{_of(of)}", reason)
        return
    model = Model(
        ModelId.INFLATED_BEAM,
        "Comer and Levy, AIAA J. 1 (1963) 1652",
        f"a tube {length:.4g} long of flat width {width:.4g} mm, held at one end, its load at the "
        f"other; {_stretch_note(pocket.film_stiffness)}; {NOT_CALIBRATED}",
    )
    at = Conditions(of=of)
    yield Figure(Quantity.BEAM_DIAMETER, across, model, at)
    limit = _stretch(pocket.film_stiffness, pouch.hoop_tension(1.0, width))
    for quantity, law in (
        (Quantity.WRINKLING_LOAD, pouch.wrinkling_moment),
        (Quantity.COLLAPSE_LOAD, pouch.collapse_moment),
    ):

        def load(pressure: float, law: Callable[[float, float], float] = law) -> float:
            return law(pressure, width) / length

        yield from _while_it_holds(quantity, at, model, limit, filled.pressures, load)


def _jammed(filled: FilledChamber) -> Iterator[FigureItem]:
    of = filled.of
    pocket = filled.pockets[0]
    sheets = pocket.interface.masks
    films = {sheet.film for sheet in sheets}
    if len(films) != 1 or len(sheets) < 2:
        yield LeftOut(
            f"stiffness{_of(of)}", f"jamming needs two sheets of one film; it has {len(sheets)}"
        )
        return
    (film,) = films
    assert filled.mechanism.friction is not None
    count, width, length, thick = len(sheets), pocket.width, pocket.length, film.thickness
    model = Model(
        ModelId.LAMINAR_JAMMING,
        "Narang, Vlassak and Howe, Adv. Funct. Mater. 28 (2018) 1707136",
        f"{count} sheets of {thick:g} mm as one cantilever {length:.4g} x {width:.4g} mm until "
        f"they slip, friction {filled.mechanism.friction:g} as given; the bag's films not "
        f"counted; {NOT_CALIBRATED}",
    )
    at = Conditions(of=of)
    yield Figure(Quantity.JAMMING_RATIO, float(count**2), model, at)
    if film.elastic is None:
        reason = f"the modulus of {film.material} is not known"
        both = Quantity.LOOSE_STIFFNESS, Quantity.JAMMED_STIFFNESS
        yield LeftOut(f"bending stiffness{_of(of)}", reason, both)
    else:
        for quantity, law in (
            (Quantity.LOOSE_STIFFNESS, pouch.loose_stiffness),
            (Quantity.JAMMED_STIFFNESS, pouch.jammed_stiffness),
        ):
            yield Figure(quantity, law(film.elastic[0], width, thick, count), model, at)
    for pressure in filled.pressures:
        value = pouch.slip_force(-pressure, filled.mechanism.friction, width, thick, count)
        yield Figure(Quantity.SLIP_LOAD, value, model, at._replace(kpa=pressure))


PUSH = Model(
    ModelId.TEXTILE_POUCHES,
    "statics of a stiff plate",
    "an upper bound, for a plate that lies flat on the whole pocket and for a wall without "
    "stiffness. Pouches of coated textile, 8 mm at 1 mm gaps, pushed with 2.1 N at 230 kPa (arXiv "
    "2602.18992): 0.18 of this bound, 0.27 of Eq. 4, which is of thin film that bends and folds "
    f"freely; {NOT_CALIBRATED}",
)


def _push(filled: FilledChamber) -> Iterator[FigureItem]:
    of = filled.of
    each = "pouch" if len(filled.pockets) > 1 else ""
    for pressure in filled.pressures:
        value = pressure * filled.pockets[0].area / 1000
        yield Figure(Quantity.FORCE_BOUND, value, PUSH, Conditions(pressure, of=of, each=each))


FIGURES: Mapping[MechanismKind, Callable[[FilledChamber], Iterator[FigureItem]]] = {
    "pouch-motor": _motor,
    "hinge": _hinge,
    "beam": _beam,
    "jamming": _jammed,
    "push": _push,
}


class MechanismQuantity(NamedTuple):
    """A quantity that requirements name for a mechanism, and its figure in ``predict``."""

    kind: MechanismKind
    figure: Quantity
    share: float | None = None


ASKED: Mapping[str, MechanismQuantity] = {
    "contraction": MechanismQuantity("pouch-motor", Quantity.CONTRACTION),
    "pull": MechanismQuantity("pouch-motor", Quantity.PULL, 0.1),
    "free_bend": MechanismQuantity("hinge", Quantity.FREE_BEND),
    "moment": MechanismQuantity("hinge", Quantity.MOMENT, 0.0),
    "load": MechanismQuantity("beam", Quantity.WRINKLING_LOAD),
    "slip": MechanismQuantity("jamming", Quantity.SLIP_LOAD),
    "push": MechanismQuantity("push", Quantity.FORCE_BOUND),
}
"""Quantities by their names in requirements."""


def mechanism_value(
    mechanism: Mechanism | None, laminate: Laminate, quantity: str, kpa: float
) -> float:
    """Return a quantity of ``ASKED`` at a pressure, the least of several chambers: the figure in
    ``predict``.

    Raises DesignError if the mechanism is another one, or its model does not hold.
    """
    asked = ASKED[quantity]
    if mechanism is None or mechanism.kind != asked.kind:
        has = "no mechanism" if mechanism is None else f"a mechanism of {mechanism.kind}"
        raise DesignError(f"{quantity} is of a {asked.kind}, and the design has {has}")
    values = []
    for item in mechanism_figures(mechanism, laminate, (kpa,)):
        if isinstance(item, LeftOut):
            if not item.quantities or asked.figure in item.quantities:
                raise DesignError(f"{item.name}: {item.reason}")
        elif item.is_of(asked.figure, Conditions(share=asked.share)):
            values.append(item.value)
    if not values:
        raise DesignError(f"no model gives {quantity} of this design at {kpa:g} kPa")
    return min(values)


LEFT_OUT: Mapping[MechanismKind, tuple[str, ...]] = {
    "pouch-motor": ("bending", "folded diameter"),
    "hinge": ("stroke", "folded diameter"),
    "beam": ("stroke", "bending", "folded diameter"),
    "jamming": ("stroke", "bending", "folded diameter"),
    "push": ("stroke", "bending", "folded diameter"),
}
"""Quantities that a mechanism has no figure for."""
