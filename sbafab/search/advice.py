"""Changes of a design that reach a yield: bond, overhang, order of stacking, plate, registration.

Every trial is built and counted like the design itself; the result is counted again with another
seed, so that it does not rest on the draws it was chosen by.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, get_args

from sbafab.actuators import build
from sbafab.design.records import REGISTRATIONS, Design
from sbafab.errors import DesignError
from sbafab.laminate.base_plate import PlateMachine
from sbafab.rules.deck import run_deck
from sbafab.rules.registration_yield import SEED, Share, simulate
from sbafab.runtime import Progress, ignore_progress
from sbafab.search.vary import KeyDifference

if TYPE_CHECKING:
    from sbafab.search.compare import DesignComparison, FigurePair

STEP = 0.01
"""mm: bond and overhang are advised in whole steps."""
MOST_STEPS = 128
"""1.28 mm more than the least that the rules ask for."""
FEW_STEPS = 10
"""0.1 mm, a cutting error: by so much bond and overhang grow before plate or pins change."""
CHECK_SEED = SEED + 1
MOST_CHECKED = 5
"""Best trials whose other rules are checked, where none reaches the target."""
BOND, OVERHANG = "bond.width", "mask.overhang"
METHOD, SEQUENCE = "registration.method", "registration.sequence"
PLATE, PIN_ERROR = "registration.plate_made_by", "registration.pin_error"
TARGET = "rules.target_yield"
WORST_CASE, PIN_FIT = "registration-worst-case", "pin-fit"
"""Other rules that may be mended: by more steps, by a better plate."""


def _good(share: Share) -> str:
    low, high = share.interval
    return (
        f"{share.value:.2%} of {share.builds} random builds are good (95 % interval {low:.2%} to "
        f"{high:.2%})"
    )


@dataclass(frozen=True)
class YieldDesign:
    """A design for a yield: ``design`` is ``given`` with the ``changes``, None if no change reaches
    the share ``target``, and the given one if that suffices.

    ``changes`` are keys with their old and new value. ``share`` is counted with another seed
    on the changed design, or on the given one if it suffices; None if that fails other rules. If no
    change suffices, both describe the best design reached. ``fixed``: keys that were not changed
    although a change might have helped.
    """

    target: float
    given: Design
    design: Design | None
    changes: tuple[KeyDifference, ...] = ()
    share: Share | None = None
    fixed: tuple[str, ...] = ()

    @cached_property
    def comparison(self) -> DesignComparison | None:
        """Keys, rules and figures of both designs, if one was changed."""
        if self.design is None or not self.changes:
            return None
        # A check asks for none, and loads no model.
        from sbafab.search.compare import DESIGNS, compare

        return compare(self.given, self.design, DESIGNS)

    @property
    def figures(self) -> list[FigurePair]:
        """The main figures of both designs, if one was changed."""
        return [pair for pair in self.comparison.figures if pair.main] if self.comparison else []

    @property
    def sentence(self) -> str:
        """The changes and the resulting yield, or the reason why no change reaches the target."""
        if self.design is not None and self.share is None:
            return f"{self.given.name} fails other rules, so that nothing was changed for its yield"
        changes = ", ".join(f"{change.key} = {change.values[1]}" for change in self.changes)
        if self.design is not None and self.share is not None:
            needs = f"needs {changes or 'no change'}"
            return f"A yield of {self.target:.4g} {needs}: {_good(self.share)}"
        reached = "no change that was tried can be built and passes the other rules"
        if self.share is not None:
            by = f"with {changes}" if changes else "as it is"
            reached = f"at best, {by}, {_good(self.share)}"
        free = f", or do not --set {', '.join(self.fixed)}" if self.fixed else ""
        return (
            f"{self.given.name} does not reach a yield of {self.target:.4g}, and nothing was "
            f"written: {reached}; ask for less, cut or place more exactly "
            f"(registration.cutting_error, registration.hand_placement){free}"
        )


def _value_of(design: Design, key: str) -> Any:
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
    """Return the design with the changes needed for a yield of ``target``, except keys that are
    ``fixed``.
    """
    targeted = design.with_({TARGET: target})
    free = (key for key in (BOND, OVERHANG) if key not in fixed and targeted.uses(key))
    trials = _Trials(targeted, {key: _value_of(targeted, key) for key in free}, target, progress)
    broken = trials.broken((), AS_GIVEN)
    if broken - {WORST_CASE, PIN_FIT}:
        return YieldDesign(target, design, targeted)
    if trials.is_enough((), AS_GIVEN) and not broken:
        return YieldDesign(target, design, targeted, share=trials.share((), AS_GIVEN))
    for way, most in _ways(targeted, fixed):
        steps = _smallest(trials, way, most if trials.start else 0)
        if steps is not None:
            changes, share = trials.changes(way, steps), trials.share(way, steps, CHECK_SEED)
            return YieldDesign(target, design, trials.changed(way, steps), changes, share)
    useful = tuple(key for key in (BOND, OVERHANG, METHOD, SEQUENCE, PLATE) if key in fixed)
    return YieldDesign(target, design, None, *trials.best(), useful)


Way = tuple[tuple[str, str], ...]
"""Words for keys."""
Steps = tuple[int, int]
"""Steps by which bond and overhang are wider than at the start."""
AS_GIVEN = (0, 0)


def _ways(design: Design, fixed: Collection[str]) -> Iterator[tuple[Way, int]]:
    """Yield words for keys, and by how many steps bond and overhang may grow with them."""
    registration = design.registration
    orders: list[Way] = [()]
    if SEQUENCE not in fixed:
        orders += [((SEQUENCE, word),) for word in REGISTRATIONS["sequence"][1:]]
    plates: list[Way] = [()]
    if registration.pin_error is None and not {PLATE, PIN_ERROR} & set(fixed):
        machines = get_args(PlateMachine)
        better = machines[: machines.index(registration.plate_made_by)]
        plates += [((PLATE, machine),) for machine in reversed(better)]
    groups = [[plate + order for order in orders] for plate in plates]
    if registration.method == "channel-pin" and METHOD not in fixed:
        groups += [[((METHOD, "ears"), *plate)] for plate in plates]
    yield from ((way, most) for group in groups for most in (0, FEW_STEPS) for way in group)
    yield from ((way, MOST_STEPS) for group in groups for way in group)


@dataclass(frozen=True)
class _Trials:
    """A design in other ways and with wider bond and overhang, of which those without a ``start``
    stay.

    ``shares`` of good builds by way, steps and seed; None if the design cannot be built.
    """

    design: Design
    start: Mapping[str, float]
    target: float
    progress: Progress
    shares: dict[tuple[Way, Steps, int], Share | None] = field(default_factory=dict)

    def values(self, way: Way, steps: Steps) -> dict[str, Any]:
        """Return bond and overhang in mm, and the words, by key."""
        by_key = dict(zip((BOND, OVERHANG), steps, strict=True))
        lengths = {key: round(mm + by_key[key] * STEP, 6) for key, mm in self.start.items()}
        return {**lengths, **dict(way)}

    def changed(self, way: Way, steps: Steps) -> Design:
        """Return the changed design. Raises DesignError."""
        return self.design.with_(self.values(way, steps))

    def changes(self, way: Way, steps: Steps) -> tuple[KeyDifference, ...]:
        """Return the keys whose values the design does not have."""
        values = self.values(way, steps).items()
        both = {key: (_value_of(self.design, key), value) for key, value in values}
        return tuple(KeyDifference(key, two) for key, two in both.items() if two[0] != two[1])

    def share(self, way: Way, steps: Steps, seed: int = SEED) -> Share | None:
        """Return the share of good builds, counted once."""
        steps = steps[0] * (BOND in self.start), steps[1] * (OVERHANG in self.start)
        if (way, steps, seed) not in self.shares:
            # The number of trials is not known in advance.
            trial = f"bond and overhang that reach the yield, trial {len(self.shares) + 1}"
            self.progress(trial, 0, 0)
            try:
                design = self.changed(way, steps)
                share = simulate(build(design), design, seed).whole
            except DesignError:
                share = None
            self.shares[way, steps, seed] = share
        return self.shares[way, steps, seed]

    def is_enough(self, way: Way, steps: Steps, seed: int = SEED) -> bool:
        share = self.share(way, steps, seed)
        return share is not None and share.interval[0] >= self.target

    def broken(self, way: Way, steps: Steps) -> set[str]:
        """Return the rules that the design fails, except the one that limits the yield."""
        design = self.changed(way, steps)
        rules = design.rules.model_copy(update={"target_yield": None})
        findings = run_deck(build(design), design.model_copy(update={"rules": rules}))
        return {finding.rule for finding in findings if finding.verdict == "fail"}

    def best(self) -> tuple[tuple[KeyDifference, ...], Share | None]:
        """Return the changes of the best share that passes the other rules, and the share; of equal
        ones the first.
        """
        items = self.shares.items()
        every = [(s, way, steps) for (way, steps, seed), s in items if s and seed == SEED]
        counted = sorted(every, key=lambda row: -row[0].value)
        for share, way, steps in counted[:MOST_CHECKED]:
            if not self.broken(way, steps):
                return self.changes(way, steps), share
        return (), None


def _smallest(trials: _Trials, way: Way, most: int) -> Steps | None:
    """Return the least bond and overhang, up to ``most`` steps, whose interval lies above the
    target.

    First both grow by the same amount until the target is reached; then the overhang, and after it
    the bond, is taken back as far as the target allows. Neither can then be smaller by itself.
    Where the other seed falls short, or the worst case does, both grow by one step more.
    """

    def is_short(bond: int, overhang: int) -> bool:
        """Return True if the design can be built but does not reach the target."""
        steps = bond, overhang
        return trials.share(way, steps) is not None and not trials.is_enough(way, steps)

    both = _least(lambda steps: is_short(steps, steps), most)
    if both is None or not trials.is_enough(way, (both, both)):
        return None
    overhang = _least(lambda steps: is_short(both, steps), both) or 0
    bond = _least(lambda steps: is_short(steps, overhang), both) or 0
    for more in range(most - max(bond, overhang) + 1):
        steps = bond + more, overhang + more
        if trials.share(way, steps, CHECK_SEED) is None:
            return None
        is_enough = trials.is_enough(way, steps, CHECK_SEED)
        broken = trials.broken(way, steps) if is_enough else {WORST_CASE}
        if broken != {WORST_CASE}:
            return None if broken else steps
    return None


def _least(is_short: Callable[[int], bool], most: int) -> int | None:
    """Return the fewest steps, at most ``most``, that suffice; None if none do."""
    short, enough = -1, 0
    while is_short(enough):
        if enough >= most:
            return None
        short, enough = enough, min(max(8, 2 * enough), most)
    return short + 1 + bisect_left(range(short + 1, enough), True, key=lambda n: not is_short(n))
