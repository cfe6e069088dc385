"""``checks.json``: the findings of the rules, for programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from sbafab.design.identity import citation
from sbafab.design.records import Design
from sbafab.documents import Document, PlainNumber, attribute
from sbafab.rules.finding import Finding, Verdict, summary

Micrometres = Annotated[float, AfterValidator(lambda value: round(value, 4))]


class PlaceEntry(Document):
    """The place of a value."""

    interface: int | None
    """counted from 1, bottom to top"""
    layers: list[int]
    x: Micrometres | None
    """mm"""
    y: Micrometres | None
    """mm"""


class FindingEntry(Document):
    """A finding."""

    rule: str
    verdict: Verdict
    limit: PlainNumber | None
    measured: PlainNumber | None
    unit: str
    where: PlaceEntry
    message: str


class Summary(Document):
    """The overall verdict, and the number of rules by verdict."""

    holds: bool
    passed: int = Field(alias="pass")
    warn: int
    waived: int
    fail: int


class AdviceEntry(Document):
    """What reaches a yield, as in ``message``; bond and overhang then, mm, and the share."""

    target_yield: PlainNumber = attribute("target")
    bond_width: float | None = attribute("design.bond.width")
    mask_overhang: float | None = attribute("design.mask.overhang")
    measured: float | None = attribute("share.value")
    interval: tuple[float, float] | None = attribute("share.interval")
    message: str = attribute("sentence")


class Checks(Document, schema="sbafab/checks@1"):
    """The findings, as in ``checks.json``."""

    design: str
    """name of the design or assembly, or the folder's path"""
    source: Literal["design", "as-built"]
    summary: Summary
    kits: list[dict[str, Any]]
    findings: list[FindingEntry]
    sizes: Mapping[str, Mapping[str, float]] = {}
    """mm by name, of each design by its name"""
    notes: Sequence[str] = ()
    advice: AdviceEntry | None = None
    """of --target-yield"""


def checks(
    findings: Sequence[Finding],
    source: str,
    name: str,
    designs: Sequence[Design] = (),
    **printed: object,
) -> dict[str, Any]:
    """Return the contents of ``checks.json`` for the design, assembly or folder ``name``.

    ``source`` is "design" or "as-built"; ``designs`` are the checked designs.
    """
    return Checks.of(
        None,
        design=name,
        source=source,
        summary=summary(findings),
        kits=[{"design": design.name, **citation(design)} for design in designs],
        findings=findings,
        **printed,
    )
