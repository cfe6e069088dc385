"""What an actuator must stand before it is handed on, and what the tests are made with.

The paper looks for leaks under water and bursts three actuators (Sec. 2, 7). Pressures, times and
fitting are ours: keys of ``acceptance``, which a kit gives.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sbafab.design.kits import kit_of
from sbafab.models.burst import burst_pressure
from sbafab.models.paper import BURST, FORCE_KPA
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.job import Work

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
    asked = work.design.acceptance.proof_pressure_kpa
    burst = burst_pressure(work.design.form, work.laminate)
    forces = (
        f"the paper gives forces at {FORCE_KPA:g} kPa and burst three actuators with pockets of "
        f"5 mm at {BURST.value:g} ± {BURST.error:g} kPa"
    )
    if burst is None:
        return Proof(
            None,
            f"{forces}; nobody burst this film or this pocket. Burst one actuator, write down the "
            f"pressure, ________ kPa, and prove the others at {SHARE:.0%} of it",
        )
    most = math.floor(SHARE * burst / STEP) * STEP
    if asked <= most:
        return Proof(asked, f"{forces}; about {burst:.0f} kPa are estimated for this one")
    return Proof(
        most,
        f"{forces}; this one is estimated to burst at about {burst:.0f} kPa (film stress in "
        f"proportion, ours), so it is proved at {SHARE:.0%} of that and not at {asked:g} kPa"
        + ("" if most >= FORCE_KPA else f"; do not count on forces at {FORCE_KPA:g} kPa"),
    )


def leak_words(work: Work) -> str:
    """Return pressure and time of the leak test: "5 kPa for 60 s"."""
    own = work.design.acceptance
    return f"{own.leak_pressure_kpa:g} kPa for {own.leak_seconds:g} s"


def proof_words(work: Work) -> str:
    """Return pressure and time of the proof test, a blank where nobody can say."""
    return (
        f"{say.plain(proof(work).kilopascals)} kPa for {work.design.acceptance.proof_seconds:g} s"
    )


def fitting(work: Work) -> str:
    """Return what joins tube and supply, with the bore of the tube where the kit knows it."""
    tube = kit_of(work.design).tubes.get(work.design.inlet.tube)
    bore = None if tube is None else tube.inner_diameter
    of = "" if bore is None else f" of {say.millimetres(bore)}"
    return f"{work.design.acceptance.fitting}, in the tube's bore{of}"


def proof_test(work: Work, names: tuple[str, ...], where: str) -> list[Action]:
    """Return the proof test's actions, ``names`` the chambers that have a box each."""
    seconds = work.design.acceptance.proof_seconds
    found = proof(work)
    return [
        Action(
            "Proof test, behind a shield, the actuator free to move and dry or full of water: "
            f"raise each chamber in {RAMP} s to {say.plain(found.kilopascals)} kPa, hold for "
            f"{seconds:g} s, the other chambers open ({found.basis}).",
            (),
            names,
        ),
        Action("It holds: no bang, no hiss, no balloon that swells more than its neighbours."),
        Action(
            f"Leak test again, as above, at {work.design.acceptance.leak_pressure_kpa:g} kPa: a "
            "bond that began to peel shows now.",
            (),
            names,
        ),
        Action(
            f"Accepted: no leak at {leak_words(work)}, {proof_words(work)} held, no leak after "
            f"it. Write both results {where}; what fails one is not handed on."
        ),
    ]
