"""Checks of the whole against its way: through an aperture, into a lumen, against the wall."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.assemblies.fits import WHOLE, found
from sbafab.assemblies.records import Base, Cup, Line, Magnet, Tube
from sbafab.assemblies.supply import folded_diameter_with_tubes, reach
from sbafab.design.form import Discs
from sbafab.laminate.extent import outline_diameter
from sbafab.models.folded import LOBES, folded_diameter
from sbafab.models.sizes import deflated_diameter, reached_diameter
from sbafab.rules.finding import Finding
from sbafab.rules.limits import holds

PRESSED = 0.95 / 1.865
"""Measured over nominal thickness of the paper's 15-balloon 3-DoF actuator (Sec. 4)."""


class _Passage(NamedTuple):
    """What a part needs of a hole: as nominal films add up, and as the paper's pressed ones do."""

    name: str
    nominal: float
    pressed: float
    how: str


def aperture(assembled: Assembled) -> Iterator[Finding]:
    """Whether each part passes the aperture, lobes folded and all else as it is.

    Folded sizes are predicted: where only the thinner, pressed laminate passes, or the paper says
    nothing of how a part folds, the verdict is a warning.
    """
    hole = assembled.assembly.deploy.aperture_diameter
    if hole is None:
        return
    needs = [_passage(placed) for placed in assembled.parts]
    worst = max(needs, key=lambda need: (need.pressed > hole, need.nominal))
    message = f"{worst.name} {worst.how} needs {worst.nominal:.2f} of the aperture's {hole:g}"
    if holds(hole, worst.nominal):
        yield found("aperture", True, hole, worst.nominal, message)
    elif holds(hole, worst.pressed):
        remedy = "try it in the aperture first"
        message = (
            f"{remedy}: {message}, or {worst.pressed:.2f} if pressed as thin as the paper's, which "
            "passed 9.25"
        )
        yield Finding("aperture", "warn", hole, worst.nominal, "mm", WHOLE, message, remedy=remedy)
    else:
        message += "; use fewer balloons, smaller chambers or a smaller part"
        yield found("aperture", False, hole, worst.pressed, message)


def _passage(placed: PlacedPart) -> _Passage:
    part = placed.part
    if not isinstance(placed, PlacedSba):
        size = _girth(placed)
        soft = isinstance(part, Cup)
        return _Passage(
            placed.name, size, 0.0 if soft else size, "squeezed" if soft else "as it is"
        )
    form, laminate = placed.made.design.form, placed.made.laminate
    if form.wrap is not None:
        size = deflated_diameter(form.wrap, laminate)
        return _Passage(placed.name, size, size, "deflated")
    lobe = _lobe_width(placed)
    if lobe is not None:
        return _Passage(
            placed.name,
            folded_diameter(lobe, laminate.thickness),
            folded_diameter(lobe, PRESSED * laminate.thickness),
            "folded",
        )
    return _Passage(placed.name, _flat_diameter(placed), 0.0, "unfolded")


def _lobe_width(placed: PlacedSba) -> float | None:
    """Width in mm of a lobe of a three-lobed actuator; None for others."""
    design = placed.made.design
    form = design.form
    if not form.is_parallel or form.stacks != LOBES or not isinstance(form.pockets, Discs):
        return None
    return max(form.pockets.diameters) + 2 * design.bond.width


def _flat_diameter(placed: PlacedSba) -> float:
    """Circle round an SBA's axis that holds its widest film, tabs and ears taken off, mm."""
    return outline_diameter(placed.made.laminate)


def _girth(placed: PlacedPart) -> float:
    """Diameter of the smallest round hole that a bought part passes, mm."""
    part = placed.part
    if isinstance(part, Tube | Line):
        return part.outer_diameter
    if isinstance(part, Magnet | Cup):
        return part.diameter
    assert isinstance(part, Base)
    short, middle, _ = sorted((part.width, part.length, part.thickness))
    return float((short**2 + middle**2) ** 0.5)


def lumen_pass(assembled: Assembled) -> Iterator[Finding]:
    """Whether the deflated assembly passes the lumen, tabs folded back with a tube in each."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [(_deflated(placed, assembled), placed, "") for placed in assembled.parts]
    sizes += [
        (folded, placed, "tabs folded back with their tubes")
        for placed in assembled.parts
        if (folded := folded_diameter_with_tubes(placed, assembled)) is not None
    ]
    widest, part, how = max(sizes, key=lambda entry: (round(entry[0], 6), entry[1].radius is None))
    good = widest < lumen
    message = f"deflated, {part.name} is the widest part, {widest:.2f} in a lumen of {lumen:g}"
    if how:
        message += f", {how}"
        if part.radius is None and reach(part) > lumen:
            message += f" (unfolded they reach {reach(part):.2f}: tie them before it goes in)"
    if not good:
        message += "; make it narrower or its laminate thinner"
        message += ", or take thinner supply tubes" if how else ""
    yield found("lumen-pass", good, lumen, widest, message)


def _deflated(placed: PlacedPart, assembled: Assembled) -> float:
    if not isinstance(placed, PlacedSba):
        return _girth(placed)
    wrap, laminate = placed.made.design.form.wrap, placed.made.laminate
    if wrap is not None:
        return deflated_diameter(wrap, laminate)
    if placed.radius is not None:
        return 2 * (placed.radius + laminate.thickness)
    return _flat_diameter(placed)


def lumen_brace(assembled: Assembled) -> Iterator[Finding]:
    """Whether inflated radial parts reach the lumen's wall."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [
        (reached, placed.name)
        for placed in assembled.parts
        if placed.made is not None
        and (reached := reached_diameter(placed.made.design.form, placed.made.laminate))
    ]
    if not sizes:
        message = (
            f"no part expands against a lumen of {lumen:g}; add a radial design, or leave out "
            "deploy.lumen_diameter"
        )
        yield found("lumen-brace", False, lumen, None, message)
        return
    widest, name = max(sizes)
    good = holds(widest, lumen)
    message = f"inflated, {name} reaches {widest:.2f} free (lens of two arcs), and the lumen is "
    message += f"{lumen:g}"
    if not good:
        message += "; use wider or longer chambers, more balloons or a thicker tube"
    yield found("lumen-brace", good, lumen, widest, message)
