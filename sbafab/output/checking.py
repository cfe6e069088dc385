"""A design checked: its laminate, what the rules find, and whether shop and press can do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sbafab.actuators import build
from sbafab.design.kits import citation
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.nest import refuse_unfit
from sbafab.output.planned import Checked, plan
from sbafab.output.settings import limits, stocks
from sbafab.progress import Progress
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding, summary

CHECKS_SCHEMA = "sbafab/checks@1"


def check(design: Design, progress: Progress | None = None) -> tuple[Laminate, tuple[Finding, ...]]:
    """The laminate of a design and what the rule deck finds in it."""
    try:
        laminate = build(design)
        return laminate, run_deck(laminate, limits(design), progress)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None


def refuse_undoable(checked: Sequence[Checked]) -> None:
    """Raises DesignError where press, kerf or film sheets cannot do designs that hold."""
    for one in checked:
        refuse_unfit(plan(one, ("press", "cut")).parts, stocks(one.design))


def checks(
    findings: Sequence[Finding], source: str, name: str, designs: Sequence[Design] = ()
) -> dict[str, Any]:
    """``checks.json``: of the design, assembly or folder called ``name``.

    ``source`` is "design" or "as-built", ``designs`` are what was checked.
    """
    return {
        "schema": CHECKS_SCHEMA,
        "design": name,
        "source": source,
        "summary": summary(findings),
        "kits": [{"design": design.name, **citation(design)} for design in designs],
        "findings": [finding.as_dict() for finding in findings],
    }
