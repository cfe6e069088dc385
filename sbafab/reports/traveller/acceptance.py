"""After the last joint: tubes, leak and proof tests, by the facts that the page's words need.

The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
fitting are ours: keys of ``acceptance``, which a kit gives.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sbafab.design.identity import cure_hours, kit_of, tube_name
from sbafab.design.records import Discs
from sbafab.design.sections import Acceptance
from sbafab.geometry.edges import Point
from sbafab.laminate.burst import RADIUS, burst
from sbafab.laminate.laminate import Inlet, Laminate
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.pressing.cycles import serial
from sbafab.reports.traveller.materials import adhesive_words
from sbafab.reports.traveller.work import Work

MOST_COPIES = 36
"""Up to this many copies each has a box."""
SHARE = 0.6
"""Share of the estimated burst pressure that no proof test exceeds: ours."""
USUAL_PROOF = Acceptance().proof_pressure_kpa
"""kPa, below the burst pressure of the paper's film; it does not apply to other films."""
STEP = 5.0
"""Step in kPa for rounding down a lowered proof pressure."""
RAMP = 10
"""Time for raising the proof pressure, s: ours."""
STATION = 0.1
"""Steps in depth at which a channel's walls are searched, mm."""


def values(work: Work) -> dict[str, Any]:
    """Return the values for ``acceptance.html.j2``."""
    design, laminate = work.design, work.laminate
    masks = [mask for gap in laminate.interfaces for mask in gap.masks]
    tube = kit_of(design).tubes.get(tube_name(design))
    mechanism = design.form.mechanism
    shared = _shared(laminate)
    # A net's chambers are filled by its first tube.
    closed = {name for names in shared.values() for name in names[1:]}
    ports = [port.name for port in laminate.tube_holes]
    names = [*(chamber.name for chamber in laminate.chambers), *ports]
    is_batch = 1 < work.copies <= MOST_COPIES
    copies = range(1, work.copies + 1) if is_batch else ()
    return {
        "is_eared": laminate.registration == "ears",
        "serials": [serial(work.cycles, n, design.order.batch) for n in copies],
        "inlets": _boxes([inlet.chamber for inlet in laminate.inlets]),
        "holes": _boxes(ports),
        "tube": tube_name(design),
        "depth": min((inlet.length for inlet in laminate.inlets), default=0.0),
        "run": _run(work),
        "tab_films": _tab_films(work),
        "strip": masks[-1].film.material if masks else "",
        "adhesive": adhesive_words(work),
        "cure_hours": cure_hours(design),
        "bore": None if tube is None else tube.inner_diameter,
        "shared": shared,
        "filled": _boxes([name for name in names if name not in closed]),
        "is_jamming": mechanism is not None and mechanism.kind == "jamming",
        "proof": proof(work),
        "ramp": RAMP,
        "unfolds_as_measured": design.form.pockets == Discs((2 * RADIUS,) * laminate.balloons)
        and all(layer.film.is_the_papers for layer in laminate.tpe_layers),
        "wrap": design.form.wrap,
    }


def _boxes(names: list[str]) -> list[str]:
    """Return the labels of boxes, one for each of several; a single one needs none."""
    return names if len(names) > 1 else []


def _shared(laminate: Laminate) -> dict[str, list[str]]:
    """Return the chambers with an inlet and the tubes on holes of each net that joins several."""
    tubes = {port.name for port in laminate.tube_holes} | {
        inlet.chamber for inlet in laminate.inlets
    }
    nets = {net.name: [name for name in net.ports if name in tubes] for net in laminate.nets}
    return {net: names for net, names in nets.items() if len(names) > 1}


def _tab_films(work: Work) -> dict[tuple[int, int], list[str]]:
    """Return the chambers of drawn layers by the two films around their tube; empty if a tab has no
    others.
    """
    laminate = work.laminate
    if not work.design.form.is_drawn or len(laminate.interfaces) == 1:
        return {}
    pairs: dict[tuple[int, int], list[str]] = {}
    for inlet in laminate.inlets:
        gap = laminate.mouth_gap(inlet)
        if gap is not None:
            pairs.setdefault((gap.below.index, gap.above.index), []).append(inlet.chamber)
    return pairs


def _run(work: Work) -> int:
    """Return the straight run of the shortest inlet of drawn layers in whole mm; 0 for others."""
    if not work.design.form.is_drawn or not work.laminate.inlets:
        return 0
    runs = (straight_run(work.laminate, inlet) for inlet in work.laminate.inlets)
    return math.floor(min(runs) + STATION)


def straight_run(laminate: Laminate, inlet: Inlet) -> float:
    """Return the straight run of an inlet's channel inward from its mouth at constant width, mm; 0
    without a channel there.
    """
    (x, y), (u, v) = inlet.mouth, inlet.direction

    def at(depth: float, aside: float) -> Point:
        return x - depth * u - aside * v, y - depth * v + aside * u

    within, beyond = inlet.width / 2 - STATION / 2, inlet.width / 2 + STATION / 2
    gap = laminate.mouth_gap(inlet)
    void = None if gap is None else gap.unbonded
    depth = 0.0
    while void is not None:
        here = depth + STATION
        inside = all(void.contains(at(here, wall)) for wall in (-within, within))
        if not inside or any(void.contains(at(here, wall)) for wall in (-beyond, beyond)):
            break
        depth = here
    return depth


class Proof(NamedTuple):
    """The proof test's pressure in kPa, None if unknown; the estimated burst pressure, None without
    a burst test of the film; and the pressure that the design or its kit states.
    """

    kilopascals: float | None
    burst_kpa: float | None
    stated: float
    share: float = SHARE
    force_kpa: float = FORCE_KPA
    paper_kpa: float = BURST.value
    paper_error: float = BURST.error


def proof(work: Work) -> Proof:
    """Return the pressure of the proof test: the kit's, or less for an actuator that would burst
    near it. For a film without a burst test it is the kit's or the design's own value, not the
    default.
    """
    stated = work.design.acceptance.proof_pressure_kpa
    estimate = burst(work.laminate)
    if estimate is None:
        return Proof(None if stated == USUAL_PROOF else stated, None, stated)
    most = math.floor(SHARE * estimate.kpa / STEP) * STEP
    return Proof(min(stated, most), estimate.kpa, stated)
