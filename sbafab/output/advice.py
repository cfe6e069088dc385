"""The bond and overhang with which a design reaches a yield, found by search.

Every trial is built and counted like the design itself; the advised one is counted again with
another seed, so that the advice does not rest on the draws it was chosen by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from sbafab.actuators import build
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.output.checked import limits
from sbafab.process import Progress, ignore_progress
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.registration_yield import SEED, Share, simulate

STEP = 0.01
"""mm: bond and overhang are advised in whole steps."""
MOST_STEPS = 128
"""1.28 mm more than the least that the rules ask for."""
CHECK_SEED = SEED + 1


OTHERWISE = {
    "channel-pin": 'registration.method = "ears" pins every film',
    "ears": "smaller registration.hand_turn and registration.hand_placement do",
    "sheet": "a smaller panel.sheet_error does",
}
"""What reaches a yield that bond and overhang do not, by registration method."""


@dataclass(frozen=True)
class Advice:
    """The least ``bond`` and ``overhang`` (mm) that reach ``target``, and the share of good builds
    that another seed gives them; None where none does.
    """

    target: float
    method: str
    bond: float | None = None
    overhang: float | None = None
    share: Share | None = None

    @property
    def sentence(self) -> str:
        if self.share is None:
            remedy = OTHERWISE.get(self.method, OTHERWISE["ears"])
            return (
                f"No bond and overhang up to {MOST_STEPS * STEP:g} mm above the rules' limits "
                f"reach a yield of {self.target:.4g} with registration.method = "
                f'"{self.method}": {remedy}.'
            )
        low, high = self.share.interval
        return (
            f"A yield of {self.target:.4g} needs bond.width = {self.bond:.2f} and mask.overhang = "
            f"{self.overhang:.2f} at least; built so, another seed gives {self.share.value:.2%} "
            f"good builds of {self.share.builds} (95 % interval {low:.2%} to {high:.2%})."
        )

    def as_dict(self) -> dict[str, object]:
        return {
            "target_yield": self.target,
            "bond_width": self.bond,
            "mask_overhang": self.overhang,
            "measured": None if self.share is None else self.share.value,
            "interval": None if self.share is None else list(self.share.interval),
            "message": self.sentence,
        }


def advise(design: Design, target: float, progress: Progress = ignore_progress) -> Advice:
    """The smallest bond and overhang whose interval of 95 % lies at or above ``target``.

    First both grow by the same amount above the rules' limits until the target is reached; then
    the overhang, and after it the bond, is taken back as far as the target allows. Neither can
    then be smaller by itself. Where the other seed falls short, both grow by one step more.
    """
    trial = _Trial(design, target, progress)
    both = _least(lambda steps: trial.verdict(steps, steps))
    if both is None:
        return Advice(target, design.registration.method)
    overhang = _least(lambda steps: trial.verdict(both, steps), both) or 0
    bond = _least(lambda steps: trial.verdict(steps, overhang), both) or 0
    while bond <= MOST_STEPS:
        share = trial.share(bond, overhang, CHECK_SEED)
        if share is None:
            break
        if share.interval[0] >= target and trial.holds(bond, overhang):
            wide, over = trial.lengths(bond, overhang)
            return Advice(target, design.registration.method, wide, over, share)
        bond, overhang = bond + 1, overhang + 1
    return Advice(target, design.registration.method)


Outcome = Literal["short", "reached", "impossible"]


class _Trial:
    """Builds the design with steps more of bond and overhang than the rules ask for."""

    def __init__(self, design: Design, target: float, progress: Progress) -> None:
        self.design = design
        self.target = target
        self.progress = progress
        self.verdicts: dict[tuple[int, int], Outcome] = {}

    def lengths(self, bond: int, overhang: int) -> tuple[float, float]:
        rules = self.design.rules
        return round(rules.bond_width + bond * STEP, 6), round(
            rules.mask_overhang + overhang * STEP, 6
        )

    def _changed(self, bond: int, overhang: int) -> Design:
        width, reach = self.lengths(bond, overhang)
        return self.design.model_copy(
            update={
                "bond": self.design.bond.model_copy(update={"width": width}),
                "mask": self.design.mask.model_copy(update={"overhang": reach}),
            }
        )

    def share(self, bond: int, overhang: int, seed: int) -> Share | None:
        """The share of good builds; None where such a design cannot be built."""
        try:
            laminate = build(self._changed(bond, overhang))
        except DesignError:
            return None
        return simulate(laminate, limits(self.design), seed).whole

    def holds(self, bond: int, overhang: int) -> bool:
        """True if the design passes every rule but the one that limits the yield."""
        untargeted = replace(limits(self.design), target_yield=None)
        return not has_failed(run_deck(build(self._changed(bond, overhang)), untargeted))

    def verdict(self, bond: int, overhang: int) -> Outcome:
        key = bond, overhang
        if key not in self.verdicts:
            # How many it takes nobody knows.
            self.progress(
                f"bond and overhang that reach the yield, trial {len(self.verdicts) + 1}", 0, 0
            )
            share = self.share(bond, overhang, SEED)
            if share is None:
                self.verdicts[key] = "impossible"
            else:
                self.verdicts[key] = "reached" if share.interval[0] >= self.target else "short"
        return self.verdicts[key]


def _least(verdict: Callable[[int], Outcome], sufficient: int | None = None) -> int | None:
    """The fewest steps that are not short, if they reach; ``known`` steps are known to reach.

    With more steps a design goes from short to reached, and may become impossible.
    """
    if verdict(0) == "reached":
        return 0
    short, enough = 0, sufficient if sufficient is not None else 8
    while sufficient is None and enough <= MOST_STEPS and verdict(enough) == "short":
        short, enough = enough, 2 * enough
    if enough > MOST_STEPS:
        return None
    while enough - short > 1:
        middle = (short + enough) // 2
        if verdict(middle) == "short":
            short = middle
        else:
            enough = middle
    return enough if verdict(enough) == "reached" else None
