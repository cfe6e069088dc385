"""Findings of rules and checks as data: verdict, value, limit, place and message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from sbafab.markup import data_frame, table_html
from sbafab.rules.sentences import FAIL, REMEDY, Clause, is_said, say, tell

if TYPE_CHECKING:
    from pandas import DataFrame

Verdict = Literal["pass", "fail", "waived", "warn"]


class Place(NamedTuple):
    """The place of a worst value: interface (from 1, or None), layer indices, x and y in mm."""

    interface: int | None = None
    layers: tuple[int, ...] = ()
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Finding:
    """A verdict with the measured worst value, its limit, unit and place, and its message ``says``.

    ``says`` is a catalogue sentence with its facts, or the text of another package's rule.
    ``waived_by`` is the design or assembly that waives a failure by name; a rule may also grant a
    waiver (a flush mask at a pinned bore). ``lowered`` lists the limits that the design lowers.
    ``interval`` is the 95 % interval of a sampled share; ``parts`` are the assembly parts
    concerned; ``design`` is the design's name if there are several.
    """

    rule: str
    verdict: Verdict
    limit: float | None
    measured: float | None
    unit: str
    where: Place
    says: Clause | str
    waived_by: str = ""
    lowered: tuple[str, ...] = ()
    interval: tuple[float, float] | None = None
    parts: tuple[str, ...] = ()
    design: str = ""

    def __post_init__(self) -> None:
        # Limits are in um: what arithmetic leaves below 1 nm says nothing.
        if isinstance(self.measured, float):
            object.__setattr__(self, "measured", round(self.measured, 6))

    @property
    def id(self) -> str:
        """The rule and the id of its sentence: "bond-width.narrowest"."""
        return self.rule if isinstance(self.says, str) else self.says.id

    @property
    def by_user(self) -> bool:
        """True for a failure that the design or the assembly waives by name."""
        return bool(self.waived_by)

    @property
    def remedy(self) -> str:
        """The action that a warning recommends, at the start of its message."""
        if isinstance(self.says, str) or self.verdict != "warn":
            return ""
        remedy = self.says._replace(id=self.says.id + REMEDY)
        return tell(remedy, self._facts) if is_said(remedy.id) else ""

    @property
    def message(self) -> str:
        """The finding as one sentence."""
        sentence = self.says if isinstance(self.says, str) else tell(self.says, self._facts)
        text = ": ".join(filter(None, (self.remedy, sentence)))
        if self.lowered:
            text += f"; limits lowered: {', '.join(self.lowered)}"
        waived = f"waived by {self.waived_by}" if self.waived_by else ""
        return ": ".join(filter(None, (self.design, waived, text)))

    @property
    def _facts(self) -> dict[str, Any]:
        place = self.where.x, self.where.y
        return {"measured": self.measured, "limit": self.limit, "at": place}


def judged(
    rule: str,
    verdict: Verdict | bool,
    limit: float | None,
    measured: float | None,
    unit: str,
    where: Place,
    sentence: str,
    /,
    **facts: Any,
) -> Finding:
    """Return a finding with a sentence of its rule, or that sentence's "-fail" form if it fails."""
    if isinstance(verdict, bool):
        verdict = "pass" if verdict else "fail"
    name = f"{rule}.{sentence}"
    if verdict == "fail" and is_said(name + FAIL):
        name += FAIL
    return Finding(
        rule, verdict, limit, measured, unit, where, say(name, **{"measured": measured, **facts})
    )


def marked(finding: Finding, lowered: tuple[str, ...], waived_by: str) -> Finding:
    """Return a finding with the lowered limits that apply, waived by a user if it failed.

    A waiver granted by the rule states no lowered limits.
    """
    if lowered and finding.verdict != "waived":
        finding = replace(finding, lowered=lowered)
    if waived_by and finding.verdict == "fail":
        finding = replace(finding, verdict="waived", waived_by=waived_by)
    return finding


def decisive(findings: Iterable[Finding]) -> dict[str, Finding]:
    """Return the finding that decides each rule's verdict, in the order of the rules.

    The order of precedence is failure, warning, user waiver, pass, rule waiver.
    """
    deciding: dict[str, Finding] = {}
    for finding in findings:
        current = deciding.get(finding.rule)
        if current is None or _gravity(finding) > _gravity(current):
            deciding[finding.rule] = finding
    return deciding


def summary(findings: Iterable[Finding]) -> dict[str, int]:
    """Return the overall verdict and the number of rules by verdict, as in ``checks.json``."""
    counts = Counter(finding.verdict for finding in decisive(findings).values())
    verdicts: tuple[Verdict, ...] = ("pass", "warn", "waived", "fail")
    return {"holds": counts["fail"] == 0, **{name: counts[name] for name in verdicts}}


def counted(*groups: Iterable[Finding]) -> str:
    """Return the numbers of rules, warnings, waivers and failures in groups of findings."""
    counts: Counter[str] = Counter()
    for findings in groups:
        counts.update(finding.verdict for finding in decisive(findings).values())
    words = [
        "1 rule" if counts.total() == 1 else f"{counts.total()} rules",
        f"{counts['warn']} warning{'s' if counts['warn'] > 1 else ''}" if counts["warn"] else "",
        f"{counts['waived']} waived" if counts["waived"] else "",
        f"{counts['fail']} failed" if counts["fail"] else "",
    ]
    return ", ".join(word for word in words if word)


def _gravity(finding: Finding) -> int:
    if finding.verdict == "waived":
        return 2 if finding.by_user else 0
    return {"pass": 1, "warn": 3, "fail": 4}[finding.verdict]


class Findings(tuple[Finding, ...]):
    """The deck's findings in order: a tuple that displays as a table and is true if ok."""

    __slots__ = ()

    @property
    def ok(self) -> bool:
        """True if every failure is waived, so that the design may be cut."""
        return not self.failed

    def __bool__(self) -> bool:
        return self.ok

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The failures without a waiver."""
        return tuple(finding for finding in self if finding.verdict == "fail")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Return one flat row for each finding."""
        return [
            {
                "rule": f.rule,
                "verdict": f.verdict,
                "measured": f.measured,
                "limit": f.limit,
                "unit": f.unit,
                "interface": f.where.interface,
                "layers": list(f.where.layers),
                "x": f.where.x,
                "y": f.where.y,
                "message": f.message,
            }
            for f in self
        ]

    def frame(self) -> DataFrame:
        """Return ``rows`` as a pandas DataFrame. Raises DesignError without pandas."""
        return data_frame(self.rows)

    def __repr__(self) -> str:
        return f"Findings({counted(self)})"

    def _repr_html_(self) -> str:
        rows = [(f.rule, f.verdict, f.measured, f.limit, f.unit, f.message) for f in self]
        return table_html(("rule", "verdict", "measured", "limit", "", ""), rows)
