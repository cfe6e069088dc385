"""Change a design as little as a target yield needs, and compare it with the original."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from pydantic import AliasPath, Field

from sbafab.design.records import Design
from sbafab.documents import Document, PlainNumber, attribute
from sbafab.output import advice
from sbafab.output.advice import YieldDesign, value_of
from sbafab.process import Progress, ignore_progress
from sbafab.search.compare import (
    DesignComparison,
    FigureEntry,
    KeyDifference,
    compare,
    figure_entry,
)

DESIGNS = "as given", "changed"


@dataclass(frozen=True)
class ReachedYield:
    """The ``design`` for a yield, None if none reaches it; ``found`` describes the changes.

    ``comparison`` holds both designs with their figures; None if nothing was changed.
    """

    found: YieldDesign
    comparison: DesignComparison | None

    @property
    def design(self) -> Design | None:
        """The changed design; the original if it suffices, None if no change does."""
        return self.found.design

    @property
    def sentence(self) -> str:
        """The changes and the share they reach, or why there are none."""
        return self.found.sentence

    @property
    def changes(self) -> tuple[KeyDifference, ...]:
        """Each changed key, with its old and new value."""
        return tuple(
            KeyDifference(key, (value_of(self.found.given, key), value))
            for key, value in self.found.changes.items()
        )

    @property
    def figures(self) -> list[FigureEntry]:
        """The main figures of both designs."""
        pairs = self.comparison.figures if self.comparison is not None else ()
        return [figure_entry(pair) for pair in pairs if pair.is_main]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry ``yield`` of ``generate --json``."""
        return YieldEntry.of(self)


class ChangeEntry(Document):
    """A key, and its values as given and as changed."""

    key: str
    given: Any = Field(validation_alias=AliasPath("values", 0), serialization_alias="from")
    changed: Any = Field(validation_alias=AliasPath("values", 1), serialization_alias="to")


class YieldEntry(Document):
    """Of --target-yield; figures as given and as changed."""

    target_yield: PlainNumber = attribute("found.target")
    changes: list[ChangeEntry]
    measured: float | None = attribute("found.share.value")
    interval: tuple[float, float] | None = attribute("found.share.interval")
    message: str = attribute("sentence")
    figures: list[FigureEntry]


def reach_yield(
    design: Design,
    target: float,
    fixed: Collection[str] = (),
    progress: Progress = ignore_progress,
) -> ReachedYield:
    """Return the design that reaches a yield of ``target`` by few changes, and what they cost.

    Keys in ``fixed`` do not change. Raises DesignError for a share that is not between 0 and 1.
    """
    found = advice.reach_yield(design, target, fixed, progress)
    if found.design is None or not found.changes:
        return ReachedYield(found, None)
    return ReachedYield(found, compare(design, found.design, DESIGNS, progress=progress))
