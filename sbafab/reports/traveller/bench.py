"""What good hands know: one line each where it happens. All of it is ours; the paper gives none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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

TAPE = "polyimide tape (silicone adhesive, rated 260 °C)"
WARM = 5.0
"""C by which a plate may be colder than the platens when the timer starts."""


def before_cutting(films: Iterable[Film]) -> list[Action]:
    """How films come clean and flat under the beam."""
    actions = [
        Action(
            "Wipe bench and film with isopropanol and a lint-free cloth, let them dry. Gloves on; "
            "hold film by its border: grease and dust keep TPE from bonding."
        )
    ]
    masks = [film for film in films if film.is_mask]
    if masks:
        thin = say.millimetres(min(film.thickness for film in masks))
        names = listed(list(dict.fromkeys(film.material for film in masks)))
        actions.append(
            Action(
                f"Lay {names} on a backing of card, smooth it flat, and hold it down all along its "
                f"border (tape, magnets or vacuum): {thin} of it lifts in the exhaust's draught."
            )
        )
    return actions


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
