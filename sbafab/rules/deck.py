"""The rule deck: all rules in the order they are reported, and the functions that run them.

A rule is a file in this folder with a ``RULE`` and a table in ``sentences.toml``, in order, or an
entry point of an installed package. A rule that fails to load is an error, since no design may skip
it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from sbafab import catalogue, plugins
from sbafab.design.records import Design, Form
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.plugins import Plugins
from sbafab.rules.finding import Finding, marked
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import Explanation, explained
from sbafab.runtime import Progress

OWN = {name: f"sbafab.rules.{name.replace('-', '_')}:RULE" for name in catalogue.names("rules")}


RULES: tuple[Rule, ...] = ()
for _name, _rule in Plugins(plugins.RULES, "rule", Rule, OWN).items():
    if _rule.name != _name:
        raise DesignError(f"rule {_name} from an installed package names itself {_rule.name}")
    RULES += (_rule,)


def run_deck(
    laminate: Laminate, design: Design, progress: Progress | None = None
) -> tuple[Finding, ...]:
    """Return the findings of all rules, in deck order, with the user's waivers applied."""
    findings: list[Finding] = []
    measures = Measures(laminate, design)
    for number, rule in enumerate(RULES):
        if progress is not None:
            progress(rule.name, number, len(RULES))
        findings += run_rule(rule, measures)
    return tuple(findings)


def run_rule(rule: Rule, measures: Measures) -> list[Finding]:
    """Return the findings of a rule, with waived failures and lowered limits marked."""
    weak, waived = lowered(measures.design, rule.name), rule.name in measures.design.rules.waive
    return [
        marked(finding, weak, "the design" if waived else "") for finding in rule.check(measures)
    ]


def has_failed(findings: Iterable[Finding]) -> bool:
    """Return True if a rule failed without a waiver; cutting is then blocked."""
    return any(finding.verdict == "fail" for finding in findings)


EXPLAINED: Mapping[str, Explanation] = {rule.name: rule.explanation for rule in RULES} | {
    name: explained(name)
    for group in ("assemblies", "folders", "netlists")
    for name in catalogue.names(group)
}
"""Explanations of all rules and checks by name, for ``sbafab explain`` and the reference pages."""

AT_MOST = frozenset(
    (
        *(rule.name for rule in RULES if rule.at_most),
        *(name for name, explanation in EXPLAINED.items() if explanation.at_most),
    )
)
"""Rules and checks whose limit is the largest value allowed."""


# Limits that a design lowers below the usual ones. No waiver, but stated in every file like one.


class _Usual(Design):
    """A design that sets no limits and has no form."""

    @property
    def form(self) -> Form:
        raise NotImplementedError


USUAL = _Usual.model_construct(name="usual")
CHECKED_AGAINST = "checked against limits below the usual ones: "
"""Introduces the lowered limits in a sentence."""
WORST = ("registration-worst-case", "registration-yield")


class _Key(NamedTuple):
    """A design key, the rules that it relaxes, and the source of its default value."""

    name: str
    rules: tuple[str, ...]
    value: Callable[[Design], float]
    source: str = "paper"
    is_weaker_above: bool = False


# Left out, as none of them lets a worse design pass: target_yield (none by default), yield_builds
# (the finding states its interval), speeds and heat_distance (no rule reads them), kerf (measured,
# and written in KERF_WIDTH), platen (the size of a press, printed at every step).
KEYS = (
    _Key("bond_width", ("bond-width", "tube-fit"), lambda d: d.rules.bond_width),
    _Key("mask_overhang", ("mask-overhang",), lambda d: d.rules.mask_overhang),
    _Key("worst_bond_width", WORST, lambda d: d.rules.worst_bond_width, "default"),
    _Key("worst_mask_overhang", WORST, lambda d: d.rules.worst_mask_overhang, "default"),
    _Key("validated_balloons", ("press-fit",), lambda d: d.rules.validated_balloons, "paper", True),
    _Key("least_feature", ("film-limits",), lambda d: d.laser.least_feature, "default"),
    _Key("unknown_kerf", ("tube-fit", "nets"), lambda d: d.laser.unknown_kerf, "default"),
    _Key("pin_stretch", ("pin-fit",), lambda d: d.registration.pin_stretch, "default", True),
    _Key(
        "cutting_error",
        (*WORST, "pin-fit", "tube-fit", "nets"),
        lambda d: d.registration.cutting_error,
    ),
    _Key("pin_error", WORST, lambda d: d.pin_error),
    _Key("hand_placement", WORST, lambda d: d.registration.hand_placement, "default"),
    _Key("hand_turn", WORST, lambda d: d.registration.hand_turn, "default"),
    _Key(
        "seam_error",
        (*WORST, "sealing", "nets", "tube-fit"),
        lambda d: d.registration.error_of_seam("hot-tip"),
        "default",
    ),
    _Key(
        "opening_pressure_kpa", ("nets",), lambda d: d.rules.channels_open_at_kpa, "default", True
    ),
    _Key("dead_end", ("nets",), lambda d: d.rules.longest_dead_end, "default", True),
    _Key("safety_factor", ("pressure-rating",), lambda d: d.acceptance.safety_factor, "default"),
)
"""Smaller tolerances assume a better shop than is usual, so they weaken the rules as well."""


def lowered(design: Design, rule: str | None = None) -> tuple[str, ...]:
    """Return each lowered limit (of one rule) and its value: "bond_width 0.3 (paper 0.75)"."""
    return tuple(
        weakened(key.name, key.value(design), key.value(USUAL), key.source)
        for key in KEYS
        if rule is None or rule in key.rules
        if (key.value(design) - key.value(USUAL)) * (1 if key.is_weaker_above else -1) > 0
    )


def weakened(name: str, value: float, usual: float, source: str) -> str:
    """Return one lowered limit in the wording of every file."""
    return f"{name} {value:g} ({source} {usual:g})"
