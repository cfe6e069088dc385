"""Findings of rules and checks as data: verdict, value, limit, place and message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from sbafab.notebook import data_frame, table_html

if TYPE_CHECKING:
    from pandas import DataFrame

Verdict = Literal["pass", "fail", "waived", "warn"]


@dataclass(frozen=True)
class Place:
    """Place of a worst value: interface (from 1, or None), layer indices, x and y in mm."""

    interface: int | None = None
    layers: tuple[int, ...] = ()
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Finding:
    """A verdict with the measured worst value, its limit, unit and place.

    ``by_user`` distinguishes a failure that the design waives by name from a waiver that the rule
    grants (a flush mask at a pinned bore). ``remedy`` is the action that a warning asks for; the
    message begins with it. ``interval`` is the 95 % interval of a counted share.
    """

    rule: str
    verdict: Verdict
    limit: float | None
    measured: float | None
    unit: str
    where: Place
    message: str
    by_user: bool = False
    remedy: str = ""
    interval: tuple[float, float] | None = None
    design: str = ""
    """The design's name if there are several designs; the message begins with it."""

    def __post_init__(self) -> None:
        # Limits are in um: what arithmetic leaves below 1 nm says nothing.
        if isinstance(self.measured, float):
            object.__setattr__(self, "measured", round(self.measured, 6))


def decisive(findings: Iterable[Finding]) -> dict[str, Finding]:
    """Return the finding that decides each rule's verdict, in the order of the rules.

    A failure precedes a warning, then a waiver by the user, then a pass; a waiver by the rule is
    last.
    """
    deciding: dict[str, Finding] = {}
    for finding in findings:
        current = deciding.get(finding.rule)
        if current is None or _gravity(finding) > _gravity(current):
            deciding[finding.rule] = finding
    return deciding


def summary(findings: Iterable[Finding]) -> dict[str, int]:
    """The overall verdict and the number of rules by verdict, as ``checks.json`` holds it."""
    counts = Counter(finding.verdict for finding in decisive(findings).values())
    verdicts: tuple[Verdict, ...] = ("pass", "warn", "waived", "fail")
    return {"holds": counts["fail"] == 0, **{name: counts[name] for name in verdicts}}


def counted(*groups: Iterable[Finding]) -> str:
    """Return the number of rules in groups of findings, and of warnings, waived and failed ones."""
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
    """Findings of the deck in its order: a tuple that displays as a table, and is true if ok."""

    __slots__ = ()

    @property
    def ok(self) -> bool:
        """True if no rule failed that the design does not waive: it may be cut."""
        return not self.failed

    def __bool__(self) -> bool:
        return self.ok

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Failures that are not waived."""
        return tuple(finding for finding in self if finding.verdict == "fail")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One flat row for each finding."""
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
