"""How a laminate that goes round a tube is fixed there, with its supply tubes."""

from __future__ import annotations

from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.job import Work


def wrapping(work: Work) -> list[Action]:
    """Some laminates go round a tube in the end; empty for others."""
    wrap = work.design.form.wrap
    if wrap is None:
        return []
    closed = (
        f"overlapping by {say.millimetres(wrap.overlap)}"
        if wrap.overlap
        else "meeting edge to edge"
    )
    return [
        Action("Wipe the tube and the sheet's under side with isopropanol, let them dry."),
        Action(
            f"Try it dry. Wrap the sheet round its tube, outer diameter "
            f"{say.millimetres(wrap.tube_diameter)}, balloons outward, its straight edges "
            f"along the tube, {closed}."
        ),
        Action(
            f"Glue: {wrap.glue}, a thin, even film on the tube below the sheet. Keep it off "
            "inlets, tabs and balloons. What holds the sheet is ours: the paper does not say."
        ),
        Action(
            "Wrap it again, stroke it on from the middle to both edges, and bind it with tape over "
            "release film, the balloons empty, until the adhesive has cured as its package says."
        ),
        Action(
            "Lead the supply tubes along the tube, the way the tabs point, and tie them to it with "
            "a turn of thread behind the tabs, so that no pull reaches them."
        ),
        Action(
            f"Raise each chamber to {work.design.acceptance.leak_pressure_kpa:g} kPa once more: "
            "balloons open evenly round the tube, and no edge of the sheet lifts."
        ),
    ]
