"""After the last joint: trimming, tubes, leak and proof tests, and wrapping around a tube."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from sbafab.design.identity import adhesive_for, cure_hours, kit_of, tube_name
from sbafab.design.records import Discs
from sbafab.design.sections import Acceptance
from sbafab.laminate.burst import RADIUS, burst
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.pressing.cycles import serial
from sbafab.pressing.schedule import joined_words
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Work
from sbafab.reports.traveller.shapes import STATION, straight_run

MOST_COPIES = 36
"""Up to this many copies each has a box."""


def values(work: Work) -> dict[str, Any]:
    """Return the values for ``acceptance.html.j2``."""
    design, laminate = work.design, work.laminate
    masks = [mask for gap in laminate.interfaces for mask in gap.masks]
    filled, hours = _filled(work), cure_hours(design)
    lumen = ["lumen"] if laminate.lumen else []
    tab = ["tab"] if laminate.inlets or not laminate.tube_holes else []
    mechanism = design.form.mechanism
    return {
        "is_eared": laminate.registration == "ears",
        "serials": _serials(work),
        "inlets": _boxes([inlet.chamber for inlet in laminate.inlets]),
        "holes": _boxes([port.name for port in laminate.tube_holes]),
        "tube": tube_name(design),
        "deep": _depth(work) if laminate.inlets else "",
        "tab_films": _tab_films(work),
        "strip": masks[-1].film.material if masks else "",
        "upper_side": _upper_side(work),
        "adhesive": adhesive_words(work),
        "cure": "as its package says" if hours is None else f"for {hours:g} h",
        "fitting": fitting(work),
        "shared": {net: names for net, names in _joined(work).items() if len(names) > 1},
        "filled": _boxes(filled),
        "is_several": len(filled) > 1,
        "leaks_at": joined_words(["outline", *tab, "tube", "cap", *lumen]),
        "is_jamming": mechanism is not None and mechanism.kind == "jamming",
        "proof": proof(work),
        "ramp": RAMP,
        "unfolds_as_measured": design.form.pockets == Discs((2 * RADIUS,) * laminate.balloons)
        and all(layer.film.is_the_papers for layer in laminate.tpe_layers),
        "leak_words": leak_words(work),
        "proof_words": proof_words(work),
        "wrap": design.form.wrap,
        "joined_words": joined_words,
    }


def adhesive_words(work: Work) -> str:
    """Return the adhesive of the tubes; if none is stated, a blank and what it must bond."""
    films = work.laminate.glued_films
    adhesive = adhesive_for(work.design, films)
    if adhesive is not None:
        return adhesive
    names = joined_words(list(dict.fromkeys(film.product for film in films)))
    return f"{units.BLANK} (nobody stated an adhesive for {names}: try one on scrap, with the tube)"


def _tab_films(work: Work) -> str:
    """Return the two films around each tube of drawn layers; empty if a tab has no others."""
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
    """Return the name of the marked side of a tab."""
    if not work.schedule.steps:
        return "the upper side, on which the highest layer lies"
    below = "the base is below"
    if work.design.form.is_drawn:
        below = f"layer {work.laminate.layers[0].index} is below"
    return f"the side that faced up in the press: {below}"


def _depth(work: Work) -> str:
    """Return how deep a tube goes into a tab, and the straight run of the shortest drawn one."""
    laminate = work.laminate
    length = min(inlet.length for inlet in laminate.inlets)
    if not work.design.form.is_drawn:
        return f"up to {units.millimetres(length)} deep: the length of the tab's straight run"
    run = math.floor(min(straight_run(laminate, inlet) for inlet in laminate.inlets) + STATION)
    if run < length:
        return f"up to {units.millimetres(length)} deep, the inlet's length in the design"
    return (
        f"up to {units.millimetres(length)} deep, the inlet's length in the design; the channel "
        f"runs straight for {run} mm"
    )


def _serials(work: Work) -> tuple[str, ...]:
    """Return the serial of each copy of a batch, one box each; none for one copy, or for many."""
    count = work.copies
    if not 1 < count <= MOST_COPIES:
        return ()
    return tuple(serial(work.runs, n, work.design.order.batch) for n in range(1, count + 1))


def _boxes(names: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of boxes, one for each of several; a single one needs none."""
    return tuple(names) if len(names) > 1 else ()


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


# Acceptance: leak test and proof test.
#
# The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
# fitting are ours: keys of ``acceptance``, which a kit gives.


SHARE = 0.6
"""Share of the estimated burst pressure that no proof test exceeds: ours."""
USUAL_PROOF = Acceptance().proof_pressure_kpa
"""kPa, below the burst pressure of the paper's film; it does not apply to other films."""
STEP = 5.0
"""Step in kPa for rounding down a lowered proof pressure."""
RAMP = 10
"""Time for raising the proof pressure, s: ours."""


class Proof(NamedTuple):
    """The proof test's pressure in kPa (None if unknown), and its source."""

    kilopascals: float | None
    basis: str


def proof(work: Work) -> Proof:
    """Return the pressure of the proof test: the kit's, or less for an actuator that would burst
    near it. For a film without a burst test it is the kit's or the design's own value, not the
    default.
    """
    kit_pressure = work.design.acceptance.proof_pressure_kpa
    estimate = burst(work.laminate)
    forces = (
        f"the paper gives forces at {FORCE_KPA:g} kPa and burst three actuators with pockets of "
        f"5 mm at {BURST.value:g} ± {BURST.error:g} kPa"
    )
    if estimate is None and kit_pressure != USUAL_PROOF:
        return Proof(
            kit_pressure,
            f"{forces}; no burst test of this film is known, and {kit_pressure:g} kPa is what "
            "acceptance.proof_pressure_kpa states",
        )
    if estimate is None:
        return Proof(
            None,
            f"{forces}; no burst test of this film is known. Burst one actuator, write down "
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
    """Return pressure and time of the proof test; a blank if unknown."""
    return (
        f"{units.plain(proof(work).kilopascals)} kPa for {work.design.acceptance.proof_seconds:g} s"
    )


def fitting(work: Work) -> str:
    """Return the connector between tube and supply, with the bore of the tube if the kit states
    it.
    """
    tube = kit_of(work.design).tubes.get(tube_name(work.design))
    bore = None if tube is None else tube.inner_diameter
    of = "" if bore is None else f" of {units.millimetres(bore)}"
    return f"{work.design.acceptance.fitting}, in the tube's bore{of}"
