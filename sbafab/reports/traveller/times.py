"""How long it takes, next to the paper's figure, and what that is made of."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.pressing.cycles import batch_times
from sbafab.reports.traveller import job as say
from sbafab.reports.traveller.job import Work

PAPER_MINUTES = 105.0
"""1.75 h for a 1-DoF or 3-DoF actuator (paper Sec. 4)."""


class Time(NamedTuple):
    what: str
    took: str
    made_of: str


def laser_minutes(work: Work) -> float:
    return sum(sheet.minutes for sheet in work.sheets)


def laser_basis(work: Work) -> str:
    """The speeds that the estimate of the laser's time assumes."""
    laser = work.design.laser
    cut = sum(sheet.cut_length for sheet in work.sheets)
    travel = sum(sheet.travel for sheet in work.sheets)
    contours = sum(sheet.contours for sheet in work.sheets)
    return (
        f"{cut / 1000:.2f} m of cut at {laser.cut_speed:g} mm/s, {travel / 1000:.2f} m of travel "
        f"at {laser.travel_speed:g} mm/s, {say.count(contours, 'contour')} with "
        f"{laser.pierce_seconds:g} s each to pierce, without labels; not a setting of your machine"
    )


def _batch(work: Work) -> list[Time]:
    """The whole batch, for a design of several copies."""
    runs, plan = work.runs, work.schedule
    if runs.copies == 1:
        return []
    took = batch_times(runs, plan)
    made_of = (
        f"{say.count(runs.count, 'press cycle')} of {say.plain(plan.total_press_minutes)} min, "
        f"{runs.copies} times the handling below, one after the other; copies pressed singly: "
        f"{say.minutes(say.product(runs.copies, plan.estimated_build_minutes))}"
    )
    row = f"All {runs.copies} copies"
    return [Time(row, say.whole_minutes(took.total), made_of)]


def times(work: Work) -> list[Time]:
    """Rows of the time table, the total last but for the paper's."""
    plan = work.schedule
    handling = plan.hands_minutes
    steps = " + ".join(say.plain(step.minutes) for step in plan.steps)
    rows = [
        Time("In the press", say.minutes(plan.total_press_minutes), f"{steps} min, one actuator")
    ]
    if work.sheets:
        copies = say.count(work.job.copies, "copy", "copies")
        rows.append(
            Time(
                "Laser (within handling)",
                say.minutes(laser_minutes(work)),
                f"{laser_basis(work)}; all sheets, {copies}",
            )
        )
    return [
        *rows,
        *_batch(work),
        Time(
            "Handling",
            say.minutes(handling),
            "cutting, lay-up, pins, tubes: the paper's total less its 45 min in the press, assumed "
            "equal for every design",
        ),
        Time(
            "Total, one actuator",
            say.whole_minutes(plan.estimated_build_minutes),
            "not included: heating the press, warming the plate before each clock starts, curing "
            "the adhesive, leak and proof tests",
        ),
        Time("The paper", f"{PAPER_MINUTES:g} min = {say.hours(PAPER_MINUTES)}", "1-DoF or 3-DoF"),
    ]
