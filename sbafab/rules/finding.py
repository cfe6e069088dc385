"""What a rule found, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["pass", "fail", "waived", "warn"]


@dataclass(frozen=True)
class Place:
    """Where a worst value occurs: interface (from 1, or None), layer indices, x and y in mm."""

    interface: int | None = None
    layers: tuple[int, ...] = ()
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Finding:
    """A verdict with the measured worst value, its limit, unit and place.

    ``by_user`` tells a failure that the design waives by name from a waiver that the rule itself
    grants (a flush mask at a pinned bore).
    """

    rule: str
    verdict: Verdict
    limit: float | None
    measured: float | None
    unit: str
    where: Place
    message: str
    by_user: bool = False

    def as_dict(self) -> dict[str, object]:
        """The finding as ``checks.json`` holds it."""
        return {
            "rule": self.rule,
            "verdict": self.verdict,
            "limit": self.limit,
            "measured": None if self.measured is None else round(self.measured, 6),
            "unit": self.unit,
            "where": {
                "interface": self.where.interface,
                "layers": list(self.where.layers),
                "x": None if self.where.x is None else round(self.where.x, 4),
                "y": None if self.where.y is None else round(self.where.y, 4),
            },
            "message": self.message,
        }
