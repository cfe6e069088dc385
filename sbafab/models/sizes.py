"""Overall sizes of a laminate."""

from __future__ import annotations

from sbafab.design.records import Design, Discs, Form, Slots, Wrap
from sbafab.laminate.burst import RADIUS
from sbafab.laminate.laminate import (
    Laminate,
    beyond_the_outline,
    outline_diameter,
    overall_diameter,
)
from sbafab.models.calibration import factors_of
from sbafab.models.closed_forms import LOBES, cylinder_height, lens
from sbafab.models.figures import Factors
from sbafab.models.paper import BALLOONS, counterpart
from sbafab.models.quantity import ANYWHERE, ModelId, Quantity


def is_the_papers_3dof(form: Form, laminate: Laminate) -> bool:
    """Return True for the actuator whose heights and bends the paper measured."""
    return (
        form.wrap is None
        and form.stacks == LOBES
        and form.pockets == Discs((2 * RADIUS,) * BALLOONS)
        and all(layer.film.is_the_papers for layer in laminate.tpe_layers)
    )


def sizes(design: Design, laminate: Laminate, factors: Factors | None = None) -> dict[str, float]:
    """Return sizes in mm by name: of the flat laminate and, for radial designs, around the tube.

    Width, length and overall diameter include masks, inlet tabs and ears. The outline diameter is
    measured on the films without tabs and ears. The thickness is the sum of the films as bought,
    the folded height the sum after the press, which diameters round the tube contain twice. The
    default ``factors`` come from the design's calibration. Raises DesignError if it is unknown.

    For oblong pockets around a tube, the reached diameter is that of lenses at their largest
    volume, the size to rely on, and the inflated one that of cylinders, the clearance to provide:
    27.29 and 28.06 for the paper's with films as bought, where the paper states about 28 (Sec.
    2.1).
    """
    height = (factors or factors_of(design)).folded(laminate).height
    low_x, low_y, high_x, high_y = laminate.bounds
    sizes_mm = {
        "thickness": laminate.thickness,
        "folded_height": height,
        "width": high_x - low_x,
        "length": high_y - low_y,
    }
    wrap, pockets = design.form.wrap, design.form.pockets
    if wrap is None:
        if not laminate.outline.is_empty:
            sizes_mm["outline_diameter"] = outline_diameter(laminate)
        sizes_mm["overall_diameter"] = overall_diameter(laminate)
        return sizes_mm
    flat = deflated_diameter(wrap, height)
    sizes_mm |= {"pitch": wrap.pitch, "deflated_diameter": flat}
    if isinstance(pockets, Slots):
        count, width = laminate.balloons, pockets.width
        sizes_mm["reached_diameter"] = flat + 2 * lens(width, pockets.run, count).largest_stroke
        sizes_mm["inflated_diameter"] = flat + 2 * count * cylinder_height(width)
    return sizes_mm


def deflated_diameter(wrap: Wrap, height: float) -> float:
    """Return the diameter in mm of a tube with a flat laminate of a height in mm; with films as
    bought the paper's is 15.33 (Sec. 2.1).
    """
    return wrap.outer_diameter + 2 * height


def size_phrases(
    design: Design, laminate: Laminate, factors: Factors | None = None
) -> tuple[str, ...]:
    """Return the size in phrases: overall diameter, outline diameter, flat extent, and height;
    ``factors`` as in ``sizes``. For the paper's actuator the measured height follows the sum of the
    films.
    """
    factors = factors or factors_of(design)
    sizes_mm = sizes(design, laminate, factors)
    phrases = []
    if "overall_diameter" in sizes_mm:
        over = beyond_the_outline(laminate)
        phrases.append(f"{sizes_mm['overall_diameter']:.2f} mm overall diameter with {over}")
    if "outline_diameter" in sizes_mm:
        phrases.append(f"{sizes_mm['outline_diameter']:.2f} without")
    if "deflated_diameter" in sizes_mm:
        phrases.append(f"{sizes_mm['deflated_diameter']:.2f} mm round its tube")
    form = design.form
    flat = "flat, " if form.wrap is not None else ""
    phrases.append(f"{flat}{sizes_mm['width']:.2f} x {sizes_mm['length']:.2f} mm")
    folded = factors.folded(laminate)
    height = f"folded height {folded.height:.3f} mm"
    row = None
    if factors.press_factor == 1 and is_the_papers_3dof(form, laminate):
        height_of = Quantity.FOLDED_HEIGHT, ANYWHERE, ModelId.FILMS
        row = counterpart(form, *height_of, of_papers=True)
    remark = row.brief if row else f"({folded.remark})" if folded.remark else ""
    return (*phrases, f"{height} {remark}".rstrip())
