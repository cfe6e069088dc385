"""The 1-DoF actuator: one chamber, its balloons stacked on one axis (paper Sec. 2)."""

from __future__ import annotations

from typing import Literal, Self

from sbafab.actuators.ears import NOTE, Ear, Ray, placed, tails
from sbafab.actuators.fits import Fits, fitted
from sbafab.actuators.panel import on_panel, roots, with_stubs
from sbafab.actuators.stacking import (
    BalloonShape,
    BalloonStack,
    RoundChamber,
    balloon_cuts,
    bonded,
    channel_pin,
    check_neck,
    free_of_round,
    layers,
    pocket_shapes,
    round_pockets,
    tab_and_strip,
)
from sbafab.design.records import Design, Form, Free, degrees_of_freedom
from sbafab.geometry.edges import unit
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, union
from sbafab.laminate.laminate import Bore, Chamber, Laminate

AXIS = (0.0, 0.0)


class OneDofDesign(Design):
    """A stack of round balloons on one axis."""

    family: Literal["1dof"]
    """Which kind of actuator this is."""
    chamber: RoundChamber = RoundChamber.model_construct()
    fits: Fits = Fits.model_construct()

    @property
    def form(self) -> Form:
        return Form(degrees_of_freedom(1), 1, round_pockets(self, self.chamber))

    @property
    def free(self) -> tuple[Free, ...]:
        return free_of_round(self.chamber, super().free)

    def fitted(self) -> Self:
        return fitted(self, self.fits, build)


def build(design: OneDofDesign) -> Laminate:
    """The laminate of a 1-DoF design. Raises DesignError where parts do not fit."""
    pockets, shape_of = pocket_shapes(design, design.chamber)
    check_neck(design, pockets, [AXIS])
    shapes = tuple(
        BalloonShape(bonded(pocket, design.bond.width), pocket, 1, 1) for pocket in pockets
    )
    first = shapes[shape_of[0]]
    tab, strip, inlet = tab_and_strip(
        design, "chamber1", first.pockets, AXIS, (1.0, 0.0), first.outline.bounds[2]
    )
    bottom = BalloonShape(
        fillet(first.outline | tab, design.fillet.radius), first.pockets | strip, 1, 1
    )
    plates = union(shape.outline for shape in shapes)
    held_by = roots(design, shapes, bottom.outline, [inlet])
    bottom, shapes = with_stubs(bottom, held_by), tuple(with_stubs(s, held_by) for s in shapes)
    # Nothing but ears and tails asks for both together.
    body = bottom.outline | plates if design.registration.method == "ears" else plates
    ears = _ears(design, body, plates)
    held = tails([inlet], body, ears, design)
    stack = BalloonStack(bottom, shapes, shape_of, (AXIS,), ears=ears, tails=held)
    balloons = design.stack.balloons
    has_bore = balloons > 1
    laminate = Laminate(
        name=design.name,
        family=design.family,
        layers=layers(balloon_cuts(stack, design), design),
        chambers=(Chamber("chamber1", (AXIS,)),),
        bores=(Bore("chamber1", AXIS, design.bore.diameter),) if has_bore else (),
        inlets=(inlet,),
        pins=(
            *((channel_pin("chamber1", AXIS, design.bore),) if has_bore else ()),
            *(ear.pin for ear in ears),
            *(pin for tail in held for pin in tail.pins),
        ),
        lumen=None,
        balloons=balloons,
        registration=design.registration.method,
        pins_in_full_bonds=design.registration.full_bond_pins == "in",
        notes=(NOTE,) if ears else (),
        outline=plates,
    )
    return on_panel(laminate, held_by, design)


def _ears(design: OneDofDesign, body: Region, plates: Region) -> tuple[Ear, ...]:
    """Two film and two mask ears in the five sixths of the circle that the tab leaves free."""
    if design.registration.method != "ears":
        return ()
    rays = [
        Ray("film1", "film", AXIS, unit(90.0), False),
        Ray("film2", "film", AXIS, unit(210.0), True),
    ]
    if design.stack.balloons > 1:
        rays += [
            Ray("mask1", "mask", AXIS, unit(150.0), False),
            Ray("mask2", "mask", AXIS, unit(270.0), True),
        ]
    return placed(rays, body, plates, design)
