"""Changes of a design that reach a yield: bond, overhang, order of stacking, plate, registration.

``advise`` says the least bond and overhang, ``reach_yield`` changes a design as little as it needs.
Every trial is built and counted like the design itself; the result is counted again with another
seed, so that it does not rest on the draws it was chosen by.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, get_args

from sbafab.actuators import build
from sbafab.design.records import REGISTRATIONS, Design
from sbafab.errors import DesignError
from sbafab.laminate.base_plate import PlateMachine
from sbafab.process import Progress, ignore_progress
from sbafab.rules.deck import run_deck
from sbafab.rules.registration_yield import SEED, Share, simulate

STEP = 0.01
"""mm: bond and overhang are advised in whole steps."""
MOST_STEPS = 128
"""1.28 mm more than the least that the rules ask for."""
FEW_STEPS = 10
"""0.1 mm, a cutting error: by so much bond and overhang grow before plate or pins change."""
CHECK_SEED = SEED + 1
BOND, OVERHANG = "bond.width", "mask.overhang"
METHOD, SEQUENCE = "registration.method", "registration.sequence"
PLATE, PIN_ERROR = "registration.plate_made_by", "registration.pin_error"
TARGET = "rules.target_yield"


OTHERWISE = {
    "channel-pin": 'registration.method = "ears" pins every film',
    "ears": "smaller registration.hand_turn and registration.hand_placement do",
}
"""The remedy if bond and overhang reach no yield, by registration method."""


@dataclass(frozen=True)
class Advice:
    """The least ``bond`` and ``overhang`` (mm) that reach ``target``, and the share of good builds
    that another seed gives them; None if none reaches it.

    A design whose bonds and overhangs are drawn takes neither: its share is counted as drawn.
    """

    target: float
    method: str
    bond: float | None = None
    overhang: float | None = None
    share: Share | None = None

    @property
    def sentence(self) -> str:
        if self.share is not None and self.bond is None:
            return self._as_drawn(self.share)
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

    def _as_drawn(self, share: Share) -> str:
        low, high = share.interval
        reached = "reaches" if low >= self.target else "does not reach"
        text = (
            f"As drawn it {reached} a yield of {self.target:.4g}: {share.value:.2%} of "
            f"{share.builds} random builds are good (95 % interval {low:.2%} to {high:.2%})"
        )
        if low >= self.target:
            return f"{text}."
        return (
            f"{text}. Its layers are drawn, so no key makes bonds and overhangs wider: draw them "
            "wider where registration-worst-case finds the least, or place and cut more exactly "
            "(registration.plate_made_by, registration.hand_placement, registration.seam_error)."
        )


def advise(design: Design, target: float, progress: Progress = ignore_progress) -> Advice:
    """The smallest bond and overhang whose interval of 95 % lies at or above ``target``, from the
    rules' limits on.
    """
    if not design.uses(BOND):
        share = simulate(build(design), design, CHECK_SEED).whole
        return Advice(target, design.registration.method, share=share)
    rules = design.rules
    start = {BOND: rules.bond_width, OVERHANG: rules.mask_overhang}
    trials = _Trials(design, start, target, progress)
    least = _smallest(trials, MOST_STEPS)
    if least is None:
        return Advice(target, design.registration.method)
    lengths = trials.lengths(least.steps)
    return Advice(target, design.registration.method, lengths[BOND], lengths[OVERHANG], least.share)


# A design changed as little as a yield needs.


@dataclass(frozen=True)
class YieldDesign:
    """A design for a yield: ``design`` is ``given`` with the ``changes``, by key; None if no
    change reaches the share ``target``.

    ``share`` is counted on the changed design by another seed, or on the given one if that is
    enough; ``best`` and ``best_changes`` are the best that was reached where nothing is enough.
    ``fixed``: keys that were not changed although a change might have helped.
    """

    target: float
    given: Design
    design: Design | None
    changes: Mapping[str, Any] = field(default_factory=dict)
    share: Share | None = None
    best: Share | None = None
    best_changes: Mapping[str, Any] = field(default_factory=dict)
    fixed: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The changes and the yield they reach, or why no change reaches the target."""
        if self.design is None:
            return self._too_high()
        if self.share is None:
            return f"{self.given.name} fails other rules, so that nothing was changed for its yield"
        low, high = self.share.interval
        reached = (
            f"{self.share.value:.2%} of {self.share.builds} random builds are good (95 % interval "
            f"{low:.2%} to {high:.2%})"
        )
        if not self.changes:
            return f"Nothing to change for a yield of {self.target:.4g}: {reached}"
        return f"Changed for a yield of {self.target:.4g}: {_said(self.changes)}; {reached}"

    def _too_high(self) -> str:
        reached = "no change that was tried can be built and passes the other rules"
        if self.best is not None:
            low, high = self.best.interval
            by = f" with {_said(self.best_changes)}" if self.best_changes else " as it is"
            reached = (
                f"the best reached is {self.best.value:.2%} of {self.best.builds} random builds "
                f"(95 % interval {low:.2%} to {high:.2%}){by}"
            )
        free = f", or do not --set {', '.join(self.fixed)}" if self.fixed else ""
        return (
            f"{self.given.name} does not reach a yield of {self.target:.4g}, and nothing was "
            f"written: {reached}; ask for less, cut or place more exactly "
            f"(registration.cutting_error, registration.hand_placement){free}"
        )


def _said(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in changes.items())


def value_of(design: Design, key: str) -> Any:
    """Return the value of a dotted key."""
    value: Any = design
    for name in key.split("."):
        value = getattr(value, name)
    # The default has a name.
    return REGISTRATIONS["sequence"][0] if key == SEQUENCE and value is None else value


def reach_yield(
    design: Design,
    target: float,
    fixed: Collection[str] = (),
    progress: Progress = ignore_progress,
) -> YieldDesign:
    """Return the design with what a yield of ``target`` needs, but for the keys that are ``fixed``.

    In this order, until a change is enough: the order of stacking, which changes no film; bond and
    overhang, up to 0.1 mm wider; a more exact base plate; pins in ears; and all of these with bond
    and overhang up to 1.28 mm wider. Of bond and overhang the least that is enough. The design
    passes every other rule; one that fails another rule as it is given is returned unchanged.
    """
    asked = design.with_({TARGET: target})
    free = (key for key in (BOND, OVERHANG) if key not in fixed and asked.uses(key))
    start = {key: value_of(asked, key) for key in free}
    as_given = _Trials(asked, start, target, progress)
    if as_given.broken(AS_GIVEN) - {WORST_CASE, PIN_FIT}:
        return YieldDesign(target, design, asked)
    share = as_given.share(AS_GIVEN)
    enough = share is not None and share.interval[0] >= target
    if enough and not as_given.broken(AS_GIVEN):
        return YieldDesign(target, design, asked, share=share)
    tried: dict[tuple[str, ...], _Trials] = {}
    for words, most in _ways(asked, fixed):
        name = tuple(words.values())
        if name not in tried:
            try:
                changed = asked.with_(words)
            except DesignError:
                continue
            tried[name] = _Trials(changed, start, target, progress)
        least = _smallest(tried[name], most if start else 0)
        if least is not None:
            changes = _changes(asked, {**tried[name].lengths(least.steps), **words})
            return YieldDesign(target, design, asked.with_(changes), changes, least.share)
    best, best_changes = _best(asked, tried.values())
    useful = tuple(key for key in (BOND, OVERHANG, METHOD, SEQUENCE, PLATE) if key in fixed)
    return YieldDesign(target, design, None, best=best, best_changes=best_changes, fixed=useful)


def _changes(design: Design, values: Mapping[str, Any]) -> dict[str, Any]:
    """The values that a design does not have."""
    return {key: value for key, value in values.items() if value != value_of(design, key)}


def _ways(design: Design, fixed: Collection[str]) -> Iterator[tuple[dict[str, str], int]]:
    """Yield words for keys, and by how many steps bond and overhang may grow with them."""
    registration = design.registration
    orders: list[dict[str, str]] = [{}]
    if SEQUENCE not in fixed:
        orders += [{SEQUENCE: word} for word in REGISTRATIONS["sequence"][1:]]
    plates: list[dict[str, str]] = [{}]
    if registration.pin_error is None and not {PLATE, PIN_ERROR} & set(fixed):
        machines = get_args(PlateMachine)
        better = machines[: machines.index(registration.plate_made_by)]
        plates += [{PLATE: machine} for machine in reversed(better)]
    ears: list[dict[str, str]] = []
    if registration.method == "channel-pin" and METHOD not in fixed:
        ears = [{METHOD: "ears", **plate} for plate in plates]
    with_pins = [[{**plate, **order} for order in orders] for plate in plates]
    for group in (*with_pins, *([way] for way in ears)):
        for most in (0, FEW_STEPS):
            yield from ((way, most) for way in group)
    for group in (*with_pins, ears):
        yield from ((way, MOST_STEPS) for way in group)


def _best(design: Design, tried: Iterable[_Trials]) -> tuple[Share | None, Mapping[str, Any]]:
    """The best share that passes the other rules, with its changes; of equal ones the first."""
    every = [
        (share, trials, steps)
        for trials in tried
        for steps, share in trials.shares.items()
        if share is not None
    ]
    every.sort(key=lambda entry: -entry[0].value)
    for share, trials, steps in every[:MOST_CHECKED]:
        if not trials.broken(steps):
            words = {key: value_of(trials.design, key) for key in (METHOD, SEQUENCE, PLATE)}
            return share, _changes(design, {**trials.lengths(steps), **words})
    return None, {}


# Bond and overhang by steps, each tried once.


MOST_CHECKED = 5
"""Best trials whose other rules are checked, where none reaches the target."""
Outcome = Literal["short", "reached", "impossible"]


class Steps(NamedTuple):
    """Steps by which bond and overhang are wider than at the start."""

    bond: int
    overhang: int


AS_GIVEN = Steps(0, 0)
WORST_CASE = "registration-worst-case"
"""The only other rule that more steps may mend."""
PIN_FIT = "pin-fit"
"""A rule that a better plate may mend."""


class _Least(NamedTuple):
    """The least steps that are enough, and their share by another seed."""

    steps: Steps
    share: Share


class _Trials:
    """A design with steps more of bond and overhang; of lengths without a ``start`` none."""

    def __init__(
        self, design: Design, start: Mapping[str, float], target: float, progress: Progress
    ) -> None:
        self.design = design
        self.start = start
        self.target = target
        self.progress = progress
        self.shares: dict[Steps, Share | None] = {}

    def lengths(self, steps: Steps) -> dict[str, float]:
        """Bond and overhang in mm, by key."""
        by_key = {BOND: steps.bond, OVERHANG: steps.overhang}
        return {key: round(length + by_key[key] * STEP, 6) for key, length in self.start.items()}

    def _changed(self, steps: Steps) -> Design:
        return self.design.with_(self.lengths(steps))

    def counted(self, steps: Steps, seed: int) -> Share | None:
        """The share of good builds; None if such a design cannot be built."""
        try:
            design = self._changed(steps)
            laminate = build(design)
        except DesignError:
            return None
        return simulate(laminate, design, seed).whole

    def share(self, steps: Steps) -> Share | None:
        """The share by the seed of the rule, counted once."""
        if steps not in self.shares:
            # The number of trials is not known in advance.
            self.progress(
                f"bond and overhang that reach the yield, trial {len(self.shares) + 1}", 0, 0
            )
            self.shares[steps] = self.counted(steps, SEED)
        return self.shares[steps]

    def broken(self, steps: Steps) -> set[str]:
        """The rules that the design fails, but for the one that limits the yield."""
        design = self._changed(steps)
        rules = design.rules.model_copy(update={"target_yield": None})
        untargeted = design.model_copy(update={"rules": rules})
        findings = run_deck(build(design), untargeted)
        return {finding.rule for finding in findings if finding.verdict == "fail"}

    def outcome(self, bond: int, overhang: int) -> Outcome:
        steps = Steps(bond * (BOND in self.start), overhang * (OVERHANG in self.start))
        share = self.share(steps)
        if share is None:
            return "impossible"
        return "reached" if share.interval[0] >= self.target else "short"


def _smallest(trials: _Trials, most: int) -> _Least | None:
    """The least bond and overhang, up to ``most`` steps, whose interval lies above the target.

    First both grow by the same amount until the target is reached; then the overhang, and after it
    the bond, is taken back as far as the target allows. Neither can then be smaller by itself.
    Where the other seed falls short, or the worst case does, both grow by one step more.
    """
    both = _least(lambda steps: trials.outcome(steps, steps), most)
    if both is None:
        return None
    overhang = _least(lambda steps: trials.outcome(both, steps), most, both) or 0
    bond = _least(lambda steps: trials.outcome(steps, overhang), most, both) or 0
    for more in range(most - max(bond, overhang) + 1):
        steps = Steps(bond + more, overhang + more)
        share = trials.counted(steps, CHECK_SEED)
        if share is None:
            return None
        broken = trials.broken(steps) if share.interval[0] >= trials.target else {WORST_CASE}
        if not broken:
            return _Least(steps, share)
        if broken != {WORST_CASE}:
            return None
    return None


def _least(
    outcome: Callable[[int], Outcome], most: int, sufficient: int | None = None
) -> int | None:
    """The fewest steps that are not short, if they reach; ``sufficient`` steps are known to.

    With more steps a design goes from short to reached, and may become impossible.
    """
    if outcome(0) == "reached":
        return 0
    short, enough = 0, min(8, most) if sufficient is None else sufficient
    while sufficient is None and outcome(enough) == "short":
        if enough >= most:
            return None
        short, enough = enough, min(2 * enough, most)
    while enough - short > 1:
        middle = (short + enough) // 2
        if outcome(middle) == "short":
            short = middle
        else:
            enough = middle
    return enough if outcome(enough) == "reached" else None
