"""A rule of the deck: its name, its check, the sense of its limit, and its explanation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sbafab.rules.sentences import Explanation

if TYPE_CHECKING:
    from sbafab.rules.finding import Finding
    from sbafab.rules.measures import Measures

__all__ = ["Explanation", "Rule"]


class Rule(NamedTuple):
    """A rule: its stable name, the function that checks it, and its explanation.

    ``at_most``: its limit is the largest value allowed, otherwise the least.
    """

    name: str
    check: Callable[[Measures], list[Finding]]
    explanation: Explanation
    at_most: bool = False
