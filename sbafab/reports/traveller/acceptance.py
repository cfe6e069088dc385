"""What follows the last joint: trimming, tubes, leak and proof tests, and wrapping round a tube."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.design.identity import adhesive_for, cure_hours, kit_of, tube_name
from sbafab.design.records import Design
from sbafab.laminate.burst import burst
from sbafab.laminate.laminate import Laminate
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.pressing.cycles import serial
from sbafab.pressing.schedule import joined_words
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.shapes import STATION, straight_run

MOST_COPIES = 36
"""Copies up to which each has a box."""


def finishing(work: Work) -> list[Action]:
    """Return the trimming after the last press step; empty where nothing is to be cut off."""
    if work.laminate.registration != "ears":
        return []
    return [
        Action("Snip off every ear along the outline, not into the bond."),
        Action("Cut the tails of the inlet strips flush with the tab's end."),
        Action("Leave the masks in their pockets."),
    ]


def tubing(work: Work) -> list[Action]:
    """Return the paper's step 5, one box an inlet where it is done for each of them.

    Tubes on holes of an outer film are glued on after that, which the paper has not.
    """
    return [*_in_inlets(work), *_on_holes(work)]


def adhesive_words(work: Work) -> str:
    """Return the adhesive of the tubes; a blank, and what it must bond, if none is stated."""
    films = work.laminate.glued_films
    adhesive = adhesive_for(work.design, films)
    if adhesive is not None:
        return adhesive
    names = joined_words(list(dict.fromkeys(film.product for film in films)))
    return f"{units.BLANK} (nobody stated an adhesive for {names}: try one on scrap, with the tube)"


def _on_holes(work: Work) -> list[Action]:
    """Return the gluing of tubes on holes of an outer film; empty without one."""
    holes = work.laminate.tube_holes
    if not holes:
        return []
    names = _boxes([port.name for port in holes])
    diameter = units.millimetres(work.design.inlet.tube_outer_diameter)
    at = f"the {'hole' if len(holes) == 1 else 'holes'} of {joined_words([p.name for p in holes])}"
    return [
        *_each_copy(work, "Glue the tubes on their holes"),
        Action(f"Mark {at} with a pen beside each, on the face that it opens to."),
        Action(
            f"Cut {units.count(len(holes), 'piece')} of {tube_name(work.design)}, outer diameter "
            f"{diameter}, square and without burr, as long as your rig needs."
        ),
        Action("Wipe the film round the hole with isopropanol and let it dry.", (), names),
        Action(
            f"Stand the tube, or a flange with the tube in it, on the hole, its bore over the "
            f"opening, and seal its foot all round with {adhesive_words(work)}, at least "
            f"{units.millimetres(work.design.rules.bond_width)} wide on the film; keep it out of "
            "the hole.",
            (),
            names,
        ),
        _cure(work.design),
    ]


def _cure(design: Design) -> Action:
    hours = cure_hours(design)
    how = "as its package says" if hours is None else f"for {hours:g} h"
    return Action(f"Let the adhesive cure {how} before you pressurise anything.")


def _in_inlets(work: Work) -> list[Action]:
    """Return the fitting of tubes between two films; empty without an inlet."""
    inlets = work.laminate.inlets
    if not inlets:
        return []
    names = _boxes([inlet.chamber for inlet in inlets])
    diameter = units.millimetres(inlets[0].tube_diameter)
    deep = f"up to {units.millimetres(min(inlet.length for inlet in inlets))} deep: "
    deep += "the length of the tab's straight run"
    if work.design.form.is_drawn:
        deep = _depth(work.laminate)
    masks = [mask for gap in work.laminate.interfaces for mask in gap.masks]
    strip = f"the {masks[-1].film.material} strip lies" if masks else "nothing lies"
    end = [Action("Snip the strip off flush with the tab's end.", (), names)] if masks else []
    beside = " beside the strip" if masks else " between them"
    first = f"the tab of {inlets[0].chamber}" if len(inlets) > 1 else "the tab"
    return [
        *_each_copy(work, "Fit the tubes"),
        Action(f"Mark {first} with a pen, on {_upper_side(work)}."),
        Action(
            f"Cut {units.count(len(inlets), 'piece')} of {tube_name(work.design)}, outer diameter "
            f"{diameter}, square and without burr, as long as your rig needs."
        ),
        Action(
            f"Part the two films at the tab's end{_tab_films(work)}; {strip} between them.",
            (),
            names,
        ),
        Action(f"Push the tube in{beside}, {deep}.", (), names),
        *end,
        Action(
            f"Seal the mouth all round with a small drop of {adhesive_words(work)}; keep it out of "
            "the tube.",
            (),
            names,
        ),
        _cure(work.design),
    ]


def _tab_films(work: Work) -> str:
    """Return the two films that each tube of drawn layers goes between; empty where a tab has no
    others.
    """
    laminate = work.laminate
    if not work.design.form.is_drawn or len(laminate.interfaces) == 1:
        return ""
    pairs: dict[tuple[int, int], list[str]] = {}
    for inlet in laminate.inlets:
        gap = laminate.mouth_gap(inlet)
        if gap is not None:
            pairs.setdefault((gap.below.index, gap.above.index), []).append(inlet.chamber)
    words = [
        f"layers {below} and {above}" + (f" for {joined_words(names)}" if len(pairs) > 1 else "")
        for (below, above), names in pairs.items()
    ]
    return f", {joined_words(words)}" if words else ""


def _upper_side(work: Work) -> str:
    """Return words for the side of a tab that is marked."""
    if not work.schedule.steps:
        return "the upper side, on which the highest layer lies"
    below = "the base is below"
    if work.design.form.is_drawn:
        below = f"layer {work.laminate.layers[0].index} is below"
    return f"the side that faced up in the press: {below}"


def _depth(laminate: Laminate) -> str:
    """Return how deep a tube goes into drawn tabs, and how far the shortest runs straight."""
    length = min(inlet.length for inlet in laminate.inlets)
    run = math.floor(min(straight_run(laminate, inlet) for inlet in laminate.inlets) + STATION)
    if run < length:
        return f"up to {units.millimetres(length)} deep, the inlet's length in the design"
    return (
        f"up to {units.millimetres(length)} deep, the inlet's length in the design; the channel "
        f"runs straight for {run} mm"
    )


def _each_copy(work: Work, task: str) -> list[Action]:
    """Return a box for each copy of a batch; empty for one copy."""
    count = work.job.copies
    if count == 1 or work.laminate.panel is not None:
        return []
    copies = range(1, count + 1) if count <= MOST_COPIES else ()
    numbers = tuple(serial(work.runs, copy, work.design.order.batch) for copy in copies)
    return [Action(f"{task} of all {count} copies, one after the other, as follows.", (), numbers)]


def _boxes(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of boxes for each of several; a single one needs no name."""
    return tuple(names) if len(names) > 1 else ()


def _each(names: Sequence[str]) -> str:
    return "each chamber" if names else "the chamber"


def leak_test(work: Work) -> list[Action]:
    """Return the paper's way to find leaks, then the proof test; pressures and times are ours."""
    holes = [port.name for port in work.laminate.tube_holes]
    filled = _filled(work)
    names = _boxes(filled)
    lumen = ["lumen"] if work.laminate.lumen else []
    tab = ["tab"] if work.laminate.inlets or not holes else []
    alone = work.job.copies == 1
    where = "at the head of this traveller" if alone else "beside its serial number"
    places = joined_words(["outline", *tab, "tube", "cap", *lumen])
    several = (
        [
            Action(
                "While one chamber is full, watch the open tubes of the others: bubbles there mean "
                "a leak between chambers.",
            )
        ]
        if len(filled) > 1
        else []
    )
    return [
        *_each_copy(work, "Test the chambers"),
        Action(
            f"Fit to each tube: {fitting(work)}; push it in by 5 mm or more. Connect a "
            "regulator or a syringe with a gauge. Wear eye protection."
        ),
        *_joined_tubes(work),
        Action(
            f"Under water, or brushed with soapy water, raise {_each(names)} slowly to "
            f"{leak_words(work).replace(' for ', ' and hold for ')}.",
            (),
            names,
        ),
        Action("All balloons open evenly. One that stays shut was over-melted."),
        Action(f"No stream of bubbles anywhere; look at {places}."),
        *several,
        Action("Release the pressure; dry the actuator."),
        *_vacuum_test(work, names),
        *proof_test(work, names, where),
    ]


def _vacuum_test(work: Work, names: tuple[str, ...]) -> Iterator[Action]:
    """Yield the test of a design that works under a vacuum; ours, as nobody has built one."""
    mechanism = work.design.form.mechanism
    if mechanism is not None and mechanism.kind == "jamming":
        yield Action(
            f"It works under a vacuum: draw {_each(names)} to the vacuum of use, shut the valve "
            "and hold for 60 s. A gauge that goes back shows a leak; the stack is stiff all over, "
            "and no film is drawn into the inlet. (Ours, not tried.)",
            (),
            names,
        )


def _joined(work: Work) -> dict[str, list[str]]:
    """Return the names of chambers with an inlet and of tubes on holes, by net."""
    laminate = work.laminate
    tubes = {port.name for port in laminate.tube_holes} | {one.chamber for one in laminate.inlets}
    return {net.name: [name for name in net.ports if name in tubes] for net in laminate.nets}


def _filled(work: Work) -> list[str]:
    """Return the chambers and tubes on holes that are filled one by one, a net's by its first."""
    names = [chamber.name for chamber in work.laminate.chambers]
    names += [port.name for port in work.laminate.tube_holes]
    closed = {name for joined in _joined(work).values() for name in joined[1:]}
    return [name for name in names if name not in closed]


def _joined_tubes(work: Work) -> Iterator[Action]:
    """Yield which tubes to close, for each net with several."""
    for net, joined in _joined(work).items():
        if len(joined) > 1:
            yield Action(
                f"Tubes of {joined_words(joined)} lead into the same channels (net {net}): fill by "
                f"{joined[0]}, and keep {joined_words(joined[1:])} closed in every test below."
            )


# Acceptance: leak test and proof test.
#
# The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
# fitting are ours: keys of ``acceptance``, which a kit gives.


SHARE = 0.6
"""Of the estimated burst pressure, above which nothing is proved: ours."""
STEP = 5.0
"""kPa to which a lowered proof pressure is rounded down."""
RAMP = 10
"""Seconds in which the proof pressure is raised: ours."""


class Proof(NamedTuple):
    """The proof test's pressure in kPa (None: nobody can say), and where it comes from."""

    kilopascals: float | None
    basis: str


def proof(work: Work) -> Proof:
    """Return the pressure of the proof test: the kit's, or less for what would burst near it."""
    kit_pressure = work.design.acceptance.proof_pressure_kpa
    estimate = burst(work.laminate)
    forces = (
        f"the paper gives forces at {FORCE_KPA:g} kPa and burst three actuators with pockets of "
        f"5 mm at {BURST.value:g} ± {BURST.error:g} kPa"
    )
    if estimate is None:
        return Proof(
            None,
            f"{forces}; nobody has burst this film. Burst one actuator, write down "
            f"the pressure, ________ kPa, and proof test the others at {SHARE:.0%} of it",
        )
    most = math.floor(SHARE * estimate.kpa / STEP) * STEP
    if kit_pressure <= most:
        return Proof(
            kit_pressure,
            f"{forces}; this one is estimated to burst at about {estimate.kpa:.0f} kPa",
        )
    return Proof(
        most,
        f"{forces}; this one is estimated to burst at about {estimate.kpa:.0f} kPa (film stress in "
        f"proportion, ours), so its proof pressure is {SHARE:.0%} of that and not {kit_pressure:g} "
        "kPa" + ("" if most >= FORCE_KPA else f"; do not count on forces at {FORCE_KPA:g} kPa"),
    )


def leak_words(work: Work) -> str:
    """Return pressure and time of the leak test: "5 kPa for 60 s"."""
    acceptance = work.design.acceptance
    return f"{acceptance.leak_pressure_kpa:g} kPa for {acceptance.leak_seconds:g} s"


def proof_words(work: Work) -> str:
    """Return pressure and time of the proof test, a blank where nobody can say."""
    return (
        f"{units.plain(proof(work).kilopascals)} kPa for {work.design.acceptance.proof_seconds:g} s"
    )


def fitting(work: Work) -> str:
    """Return what joins tube and supply, with the bore of the tube where the kit knows it."""
    tube = kit_of(work.design).tubes.get(tube_name(work.design))
    bore = None if tube is None else tube.inner_diameter
    of = "" if bore is None else f" of {units.millimetres(bore)}"
    return f"{work.design.acceptance.fitting}, in the tube's bore{of}"


def proof_test(work: Work, names: tuple[str, ...], where: str) -> list[Action]:
    """Return the proof test's actions, ``names`` the chambers that have a box each."""
    seconds = work.design.acceptance.proof_seconds
    target = proof(work)
    others = ", the other chambers open" if names else ""
    return [
        Action(
            "Proof test, behind a shield, the actuator free to move and dry or full of water: "
            f"raise {_each(names)} in {RAMP} s to {units.plain(target.kilopascals)} kPa, hold for "
            f"{seconds:g} s{others} ({target.basis}).",
            (),
            names,
        ),
        Action("Passed: no bang, no hiss, no balloon that swells more than its neighbours."),
        Action(
            f"Leak test again, as above, at {work.design.acceptance.leak_pressure_kpa:g} kPa: a "
            "bond that began to peel shows now.",
            (),
            names,
        ),
        Action(
            f"Accepted: no leak at {leak_words(work)}, {proof_words(work)} held, no leak after "
            f"it. Write both results {where}; reject an actuator that fails either."
        ),
    ]


def wrapping(work: Work) -> list[Action]:
    """Return the wrapping of a laminate round its tube; empty for others."""
    wrap = work.design.form.wrap
    if wrap is None:
        return []
    closed = (
        f"overlapping by {units.millimetres(wrap.overlap)}"
        if wrap.overlap
        else "meeting edge to edge"
    )
    return [
        Action("Wipe the tube and the sheet's under side with isopropanol, let them dry."),
        Action(
            f"Try it dry. Wrap the sheet round its tube, outer diameter "
            f"{units.millimetres(wrap.tube_diameter)}, balloons outward, its straight edges "
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
