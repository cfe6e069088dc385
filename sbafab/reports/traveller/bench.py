"""What good hands know: one line each where it happens. All of it is ours; the paper gives none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sbafab.design.records import HoldDown
from sbafab.laminate.assembly import AssemblyStep, distinct_layers
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import Step
from sbafab.pressing.words import listed
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.job import Work
from sbafab.reports.underlay import guides
from sbafab.rules.pin_fit import NAME as PIN_FIT
from sbafab.rules.pin_fit import most_on_a_pin

WIPE = (
    "Wipe bench and film with isopropanol and a lint-free cloth, let them dry. Gloves on; hold "
    "film by its border: grease and dust keep TPE from bonding."
)
AIR = (
    "Air assist off, or as low as the machine's owner allows; exhaust drawn off below the bed "
    "where the machine has it, and the lid opened slowly: a draught takes parts of a few "
    "milligrams with it."
)
HOLDING: Mapping[HoldDown, str] = {
    "border": (
        "lay it flat on smooth card, without stretching it, and hold it down all along its border "
        "with tape or magnets. Parts stay where they were cut, on the card."
    ),
    "carrier": (
        "stick it without bubbles on a carrier sheet of low tack, of paper or polyester and never "
        "of vinyl (PVC gives off hydrogen chloride). Cut through the film and not through the "
        "carrier (try power and speed on a corner). Parts stay on the carrier until they are laid: "
        "bend it away from the part, and wipe the face that was stuck on."
    ),
    "vacuum": (
        "lay it on the vacuum bed over a porous sheet, such as filter paper, as large as the film. "
        "The vacuum stays on until the last part is picked up."
    ),
}
"""What holds a film under the beam, by ``laser.hold_tpe`` and ``laser.hold_ptfe``."""
SILICONE = " PTFE hardly sticks to acrylic or rubber adhesives: the carrier's must be silicone."
RIM = 10.0
"""mm of film round a registered sheet, by which it is held down."""
TAPE = "polyimide tape (silicone adhesive, rated 260 °C)"
WARM = 5.0
"""C by which a plate may be colder than the platens when the timer starts."""


def before_first_cut() -> list[Action]:
    """The same of registered sheets, whose parts hang on bridges or lie on the transfer film."""
    return [
        Action(WIPE),
        Action(
            f"Each registered sheet is cut whole, edge and all, out of film that reaches {RIM:g} "
            "mm past it all round. Lay the film flat on smooth card, without stretching it, and "
            "hold it down all along that rim with tape or magnets; a mask sheet is held by the rim "
            "of its transfer film. Parts of the films hang on their bridges. (Our proposal, not "
            "tried.)"
        ),
        Action(AIR),
    ]


def before_cutting(works: Sequence[Work]) -> list[Action]:
    """How films come clean and flat under the beam, and what holds their parts once they are cut.

    None of it was tried, and the actions say so.
    """
    return [Action(WIPE), *(_held(works, film) for film in _films(works)), Action(AIR)]


def _films(works: Sequence[Work]) -> list[Film]:
    return list(dict.fromkeys(layer.film for work in works for layer in work.laminate.layers))


def hold_down(work: Work, film: Film) -> HoldDown:
    """Return how a film is held under the beam: masks as PTFE is, the others as TPE."""
    laser = work.design.laser
    return laser.hold_ptfe if film.is_mask else laser.hold_tpe


def _held(works: Sequence[Work], film: Film) -> Action:
    """How one film is held: on sheets of which each part comes free, for nothing bridges it."""
    count, lightest = 0, math.inf
    for work in works:
        for layers in work.laminate.patterns.values():
            if layers[0].film == film:
                pieces = layers[0].profile.pieces
                needed = len(layers) * work.job.copies
                count += len(pieces) * (needed + work.design.order.spare_parts(needed))
                lightest = min(lightest, *(piece.area for piece in pieces))
    mass = lightest * film.thickness * film.density / 1000
    thin = say.millimetres(film.thickness)
    how = HOLDING[hold_down(works[0], film)]
    sticks = SILICONE if film.is_mask and hold_down(works[0], film) == "carrier" else ""
    return Action(
        f"{film.material}, {thin} thick: {how}{sticks} No tab holds a part: {count} come free, the "
        f"lightest of {mass:.2g} mg. (Our proposal, not tried.)"
    )


def after_cutting(works: Sequence[Work]) -> list[Action]:
    """How parts leave the sheet: clean, and none lost."""
    actions = [
        Action(
            "Wipe the soot off both faces of every part with isopropanol, let it dry: soot in a "
            "bond is a leak."
        )
    ]
    actions += _threading(works)
    loose = sum(_loose(work.laminate) * work.job.copies for work in works)
    if loose:
        actions.append(
            Action(
                f"{say.count(loose, 'loose mask piece')}: pick them up with antistatic tweezers on "
                "an earthed mat, keep them in a dish with a lid. PTFE charges itself and flies."
            )
        )
    return actions


def _threading(works: Sequence[Work]) -> list[Action]:
    """What the rule pin-fit means at the bench, for the design whose films stretch most."""
    tight = [
        (finding.measured, finding.limit or 0.0, work)
        for work in works
        for finding in work.job.findings
        if finding.rule == PIN_FIT and finding.measured
    ]
    if not tight:
        return []
    stretch, allowed, work = max(tight, key=lambda one: one[0])
    error = say.millimetres(work.design.registration.cutting_error)
    return [
        Action(
            "Try one part of every pattern on its pins before you lay up. With edges off by "
            f"{error}, the worst that is reckoned with, a film must stretch by {stretch:.0%} over "
            f"its pin ({allowed:.0%} is allowed; nobody has tried it), and up to "
            f"{say.count(most_on_a_pin(work.laminate), 'film')} go on one pin. If one tears or "
            "wrinkles, stop: the designer takes a thinner pin or a wider bore."
        )
    ]


def _loose(laminate: Laminate) -> int:
    """Pieces of masks that fall into several."""
    pieces = (len(layer.profile.pieces) for layer in laminate.layers if layer.is_mask)
    return sum(count for count in pieces if count > 1)


def underlay(work: Work, part: AssemblyStep) -> list[Action]:
    """The printed page below the release film, in steps in which it has a line to lay by.

    One print lies in one hot cycle: paper dries and shrinks, and a worn line is no line.
    """
    patterns = [
        pattern
        for guide in guides(work.laminate)
        if part.number in guide.steps
        for pattern in guide.patterns
    ]
    if work.job.underlay is None or not patterns:
        return []
    film, over = "a see-through release film", "flush with the plate's edges"
    eye = ": lay by eye along them, as each line says"
    if part.pins:
        film, over, eye = f"{film}, pricked likewise", "pricked at its grey rings over the pins", ""
    return [
        Action(
            f"Tape a fresh print of {work.job.underlay} to the plate, {over}, cut corner at the "
            f"back right; over it {film}. It has the edges of {listed(patterns)}{eye}."
        )
    ]


def reseat(laminate: Laminate, adds: Sequence[int], pinned: bool) -> list[Action]:
    """What to do with a mask that has slipped; empty for a step that lays none."""
    if not any(layer.is_mask for layer in distinct_layers(laminate, adds)):
        return []
    home = "down on its pin" if pinned else "to its edge"
    return [
        Action(
            f"Has a mask slipped? Lift what lies over it with tweezers, push it {home}, lay the "
            "rest back and stroke it flat. After the flash bond it cannot be moved: cut a new one."
        )
    ]


def closing(step: Step, cycles: tuple[str, ...] = ()) -> Action:
    """When the timer starts, as the plate goes in cold; a box for each of the ``cycles``."""
    return Action(
        f"Close the press. The plate goes in cold: start the timer, {say.minutes(step.minutes)}, "
        f"when a thermocouple at its edge reads {step.temperature_c - WARM:g} °C, not before. How "
        "long it warms is not known: measure it.",
        (),
        cycles,
    )
