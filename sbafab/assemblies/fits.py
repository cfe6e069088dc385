"""Checks between two parts: tubes that are wrapped, lines in lumens and inlets, glued faces."""

from __future__ import annotations

import math
from collections.abc import Iterator

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba, inlet_of
from sbafab.assemblies.records import Line, Tube
from sbafab.assemblies.shapes import face
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import rectangle
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import holds

WHOLE = Place()


def found(
    rule: str,
    good: bool,
    limit: float | None,
    measured: float | None,
    message: str,
    unit: str = "mm",
) -> Finding:
    return Finding(rule, "pass" if good else "fail", limit, measured, unit, WHOLE, message)


def joints(assembled: Assembled) -> Iterator[tuple[PlacedPart, PlacedPart]]:
    """Each part that hangs on another, with that other."""
    for placed in assembled.parts:
        other = assembled.on(placed)
        if other is not None:
            yield placed, other


def tube_match(assembled: Assembled) -> Iterator[Finding]:
    """What is bent round a tube was made for it, or at least goes round it once."""
    tolerance = assembled.assembly.rules.tube_tolerance
    for placed, other in joints(assembled):
        if not isinstance(placed, PlacedSba) or not isinstance(other.part, Tube):
            continue
        if placed.radius is None:
            continue
        outer = other.part.outer_diameter
        wrap = placed.made.design.form.wrap
        if wrap is not None:
            own = wrap.tube_diameter
            off = abs(own - outer)
            good = holds(tolerance, off)
            message = (
                f"{placed.name}, made for a tube of {own:g}, goes round {other.name} of {outer:g}"
            )
            if not good:
                message += (
                    f"; set tube.outer_diameter = {outer:g} in its design, or change the tube"
                )
            yield found("tube-match", good, tolerance, off, message)
            continue
        walls = placed.made.laminate.layers[0].profile.turned(placed.turn)
        width, room = walls.bounds[2] - walls.bounds[0], math.pi * outer
        yield found(
            "tube-match",
            holds(room, width),
            room,
            width,
            f"{placed.name} takes {width:.2f} of the {room:.2f} round {other.name}, tabs included"
            + ("" if holds(room, width) else "; take a thicker tube or a smaller actuator"),
        )


def inlet_match(assembled: Assembled) -> Iterator[Finding]:
    """A line in an inlet goes into the strip that is opened to it."""
    for placed, other in joints(assembled):
        if placed.part.at != "inlet" or not isinstance(placed.part, Line):
            continue
        if not isinstance(other, PlacedSba):
            continue
        inlet = inlet_of(placed.name, placed.part, other)
        limit = 2 * inlet.width / math.pi
        outer = placed.part.outer_diameter
        yield found(
            "inlet-match",
            holds(limit, outer),
            limit,
            outer,
            f"{placed.name} has an outer diameter of {outer:g}, and the inlet of {inlet.chamber} "
            f"in {other.name}, {inlet.width:g} wide, opens to {limit:.3f}"
            + ("" if holds(limit, outer) else "; set inlet.tube_outer_diameter in its design"),
        )


def line_clearance(assembled: Assembled) -> Iterator[Finding]:
    """What is left round a line in the lumen or tube that it runs through."""
    limit = assembled.assembly.rules.line_clearance
    for placed, other in joints(assembled):
        if placed.part.at != "lumen" or not isinstance(placed.part, Line):
            continue
        lumen = _opening(other)
        if lumen is None:
            continue
        left = lumen - placed.part.outer_diameter
        good = holds(left, limit)
        yield found(
            "line-clearance",
            good,
            limit,
            left,
            f"{placed.name} of {placed.part.outer_diameter:g} in the lumen of {other.name}, "
            f"{lumen:g}, leaves {left:.3f} in diameter"
            + ("" if good else f"; take a line of at most {lumen - limit:g} or a wider lumen"),
        )


def _opening(placed: PlacedPart) -> float | None:
    """Diameter of what a line runs through, mm; None for a part without lumen."""
    if isinstance(placed.part, Tube):
        return placed.part.inner_diameter
    return placed.made.laminate.lumen if placed.made is not None else None


def seat(assembled: Assembled) -> Iterator[Finding]:
    """How much of the smaller of two glued faces lies on the other.

    What is laid round a tube must lie on it, and a line in a lumen must run through it; a line in
    an inlet is held by its strip.
    """
    limit = assembled.assembly.rules.seat_share
    for placed, other in joints(assembled):
        if placed.part.at == "lumen":
            yield _through(placed, other, limit)
        elif placed.part.at == "outside":
            yield _around(placed, other, limit)
        elif placed.part.at != "inlet":
            own, under = _lower_face(placed), _face_of(other, placed.part.at)
            share = (own & under).area / min(own.area, under.area)
            good = holds(share, limit)
            message = f"{share:.0%} of the smaller face of {placed.name} on {other.name} is glued"
            if not good:
                message += "; move it with offset, or use a larger part: an opening lies under it"
            yield found("seat", good, limit, share, message, "")


def _through(placed: PlacedPart, other: PlacedPart, limit: float) -> Finding:
    """A line in the lumen of another part, both along that part's axis."""
    start, end = placed.part.along, placed.part.along + placed.height
    inside = max(0.0, min(end, other.height) - max(start, 0.0))
    share = inside / min(placed.height, other.height)
    good = holds(share, limit)
    message = f"{inside:.3f} of {placed.name} lie in the lumen of {other.name}"
    if not good:
        message += (
            f", which reaches from 0 to {other.height:.3f}; along = {start:g} puts the line from "
            f"{start:g} to {end:g}"
        )
    return found("seat", good, limit, share, message, "")


def _around(placed: PlacedPart, other: PlacedPart, limit: float) -> Finding:
    """A part on the side of a tube, whose face lies from ``along`` both ways."""
    own = _face_of(placed, "bottom").turned(placed.turn)
    x0, y0, x1, y1 = own.bounds
    along, length = placed.part.along, other.height
    low, high = max(y0, -along), min(y1, length - along)
    share = (own & rectangle((x0, low), (x1, high))).area / own.area if low < high else 0.0
    if not holds(share, limit):
        message = (
            f"{share:.0%} of {placed.name} lies on {other.name}, which is {length:g} long; "
            f"along = {along:g} puts it from {along + y0:.2f} to {along + y1:.2f}"
        )
        return found("seat", False, limit, share, message, "")
    if placed.radius is None:
        remedy = f"build the joint of {placed.name} up with adhesive"
        message = f"{remedy}: it is stiff and touches the round {other.name} in a line only"
        return Finding("seat", "warn", limit, 0.0, "", WHOLE, message, remedy=remedy)
    message = f"{share:.0%} of {placed.name} lies on {other.name}"
    if holds(share, 1.0):
        return found("seat", True, limit, share, message, "")
    remedy = f"move {placed.name} along {other.name}, or glue well what lies on it"
    message = (
        f"{remedy}: {message}, the rest hangs past its end; along = {along:g} puts it from "
        f"{along + y0:.2f} to {along + y1:.2f} of {length:g}"
    )
    return Finding("seat", "warn", limit, share, "", WHOLE, message, remedy=remedy)


def _lower_face(placed: PlacedPart) -> Region:
    """The face that is glued on, as it lies on the other part's."""
    part = placed.part
    own = _face_of(placed, "bottom").turned(part.turn)
    if part.at in ("bottom", "start"):
        own = own.mirrored()
    return own.moved(*part.offset)


def _face_of(placed: PlacedPart, at: str | None) -> Region:
    if placed.made is None:
        return face(placed.part)
    layers = placed.made.laminate.layers
    return layers[-1 if at == "top" else 0].profile
