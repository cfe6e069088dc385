"""What is required of a design, and by how much one keeps it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sbafab.design.messages import shown
from sbafab.errors import DesignError
from sbafab.search.quantities import (
    AskedQuantity,
    named_pressure,
    read_limit,
    read_quantity,
    safer,
)

CLOSE = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A quantity that must be at least, or at most, so much."""

    quantity: AskedQuantity
    limit: float
    at_least: bool

    def margin(self, value: float) -> float:
        """By what share of the limit a value keeps it; below 0 it does not."""
        more = value - self.limit if self.at_least else self.limit - value
        return more / (abs(self.limit) or 1.0)

    def holds(self, value: float) -> bool:
        return self.margin(value) >= -CLOSE

    @property
    def bound(self) -> str:
        """For example "at least 3 N"."""
        most = "at least" if self.at_least else "at most"
        return f"{most} {self.limit:.10g} {self.quantity.unit}".strip()

    @property
    def said(self) -> str:
        return f"{self.quantity.said} {self.bound}"


@dataclass(frozen=True)
class Goal:
    """The quantity to be best in: as much of it as can be, or as little."""

    quantity: AskedQuantity
    more: bool

    def cost(self, value: float) -> float:
        return -value if self.more else value

    @property
    def said(self) -> str:
        return f"{'most' if self.more else 'least'} {self.quantity.said}"


GOOD_IF_MORE = ("stroke", "bend", "force", "yield", "lumen")
"""Of these as much as can be is best, of all others as little."""


def read_all(
    least: Sequence[str], most: Sequence[str], best: str
) -> tuple[tuple[Requirement, ...], Goal]:
    """The requirements of ``QUANTITY=VALUE`` texts, and the goal. Raises DesignError.

    A bend or a force without a pressure is one at the highest that any of them names; a stroke
    without one is the full stroke.
    """
    pairs = [(text, True) for text in least] + [(text, False) for text in most]
    kpa = named_pressure([text.partition("=")[0] for text, _ in pairs] + [best])
    found = tuple(_read(text, at_least, kpa) for text, at_least in pairs)
    _refuse_contradictions(found, [text for text, _ in pairs])
    quantity = read_quantity(best, kpa)
    return found, Goal(quantity, quantity.name in GOOD_IF_MORE)


def _read(text: str, at_least: bool, kpa: float | None) -> Requirement:
    option = "--min" if at_least else "--max"
    name, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise DesignError(
            f"{option} {shown(text)} is not QUANTITY=VALUE; write for example {option} "
            f"{'stroke@50kPa=25' if at_least else 'overall_diameter=20'}"
        )
    quantity = safer(read_quantity(name, kpa), at_least)
    try:
        limit = read_limit(quantity, value)
    except ValueError as error:
        raise DesignError(f"{option} {shown(text)}: the value {error}") from None
    return Requirement(quantity, limit, at_least)


def _refuse_contradictions(found: Sequence[Requirement], texts: Sequence[str]) -> None:
    """Raises DesignError where one quantity must be more than it may be."""
    for least, said in zip(found, texts, strict=True):
        for most, other in zip(found, texts, strict=True):
            if not least.at_least or most.at_least or least.limit <= most.limit:
                continue
            # The inflated diameter that must reach is never more than the one that must not touch.
            if least.quantity == safer(most.quantity, at_least=True):
                raise DesignError(
                    f"--min {shown(said)} and --max {shown(other)} contradict each other; no "
                    "design can meet both, so change one"
                )
