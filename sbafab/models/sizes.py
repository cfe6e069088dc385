"""Overall sizes in closed form, each with the paper's figure it answers to."""

from __future__ import annotations

import math

from sbafab.design.form import Form, Slots, Wrap
from sbafab.design.records import Design
from sbafab.laminate.extent import beyond_the_outline, outline_diameter, overall_diameter
from sbafab.laminate.laminate import Laminate
from sbafab.models.counterparts import FLAT_HEIGHT_OF_FILMS, counterpart


def sizes(design: Design, laminate: Laminate) -> dict[str, float]:
    """Sizes in mm by name: of the flat laminate and, for radial designs, round the tube.

    Width, length and overall diameter are those of all that is cut: masks, inlet tabs and ears
    belong to them. The outline diameter is that of the films without tabs and ears.
    """
    low_x, low_y, high_x, high_y = laminate.bounds
    found = {
        "thickness": laminate.thickness,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    form = design.form
    if form.wrap is not None:
        found["pitch"] = form.wrap.pitch
        found["deflated_diameter"] = deflated_diameter(form.wrap, laminate)
        reached, inflated = reached_diameter(form, laminate), inflated_diameter(form, laminate)
        if reached is not None and inflated is not None:
            found["reached_diameter"] = reached
            found["inflated_diameter"] = inflated
    else:
        if not laminate.outline.is_empty:
            found["outline_diameter"] = outline_diameter(laminate)
        found["overall_diameter"] = overall_diameter(laminate)
    return found


def deflated_diameter(wrap: Wrap, laminate: Laminate) -> float:
    """Tube plus the flat laminate on both sides; the paper gives 15.33 (Sec. 2.1)."""
    return wrap.tube_diameter + 2 * laminate.thickness


def reached_diameter(form: Form, laminate: Laminate) -> float | None:
    """Tube plus SBAs that hold the most their films let them: what they must reach lies within it.

    None without a tube, or for pockets of another shape. Balloons are lenses of two arcs
    (``models.lens``); the paper's reach 27.29, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots):
        return None
    from sbafab.models.lens import fullest

    return _round_the_tube(form, laminate, fullest(form.pockets.width, form.pockets.run).stroke)


def inflated_diameter(form: Form, laminate: Laminate) -> float | None:
    """Tube plus SBAs as wide as can be: what they must not touch lies outside.

    None without a tube, or for pockets of another shape. A flat pocket of width w whose films do
    not stretch becomes a cylinder of diameter 2 w / pi where its ends do not hold it back: 28.06
    for the paper's, about 28 (Sec. 2.1).
    """
    if not isinstance(form.pockets, Slots):
        return None
    return _round_the_tube(form, laminate, 2 * form.pockets.width / math.pi)


def _round_the_tube(form: Form, laminate: Laminate, rise: float) -> float | None:
    """Diameter with every balloon ``rise`` mm high."""
    if form.wrap is None:
        return None
    return form.wrap.tube_diameter + 2 * (laminate.balloons * rise + laminate.thickness)


def size_said(design: Design, laminate: Laminate) -> tuple[str, ...]:
    """The size in phrases: across with what stands out of it, without, flat, and its height.

    Films flow in the press: beside the height stands what the paper measured of its own.
    """
    found = sizes(design, laminate)
    said = []
    if "overall_diameter" in found:
        over = beyond_the_outline(laminate)
        said.append(f"{found['overall_diameter']:.2f} mm overall diameter with {over}")
    if "outline_diameter" in found:
        said.append(f"{found['outline_diameter']:.2f} without")
    if "deflated_diameter" in found:
        said.append(f"{found['deflated_diameter']:.2f} mm round its tube")
    form = design.form
    flat = "flat, " if form.wrap is not None else ""
    said.append(f"{flat}{found['width']:.2f} x {found['length']:.2f} mm")
    row = counterpart(form, "deflated height", FLAT_HEIGHT_OF_FILMS)
    height = f"folded height {laminate.thickness:.3f} mm"
    return (*said, f"{height} {row.brief}" if row else height)
