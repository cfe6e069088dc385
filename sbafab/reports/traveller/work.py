"""The work behind a design's pages: its laminate, schedule, sheets and what the rules found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.sheets import SheetFile
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import Runs, design_runs
from sbafab.pressing.schedule import Schedule
from sbafab.reports.prints import NAME as UNDERLAY
from sbafab.reports.prints import guides
from sbafab.rules.finding import Finding
from sbafab.rules.limits import lowered


@dataclass(frozen=True)
class Work:
    """A design with its laminate, its schedule, the ``sheets`` for all copies, and findings.

    ``folder`` is the path from the page to the design's files, ``solid_png`` the bytes of the
    solid's picture.
    """

    design: Design
    laminate: Laminate
    schedule: Schedule
    sheets: Sequence[SheetFile]
    findings: Sequence[Finding] = ()
    folder: str = ""
    solid_png: bytes | None = None

    @property
    def sha256(self) -> str:
        return design_sha256(self.design)

    @property
    def waived(self) -> list[str]:
        """The rules that fail and that the design waives by name."""
        return list(dict.fromkeys(finding.rule for finding in self.findings if finding.by_user))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits below the defaults."""
        return lowered(self.design)

    @property
    def copies(self) -> int:
        """Number of actuators to make."""
        return self.design.order.quantity

    @cached_property
    def runs(self) -> Runs:
        """The press cycles of all copies."""
        return design_runs(self.design, self.laminate)

    @cached_property
    def films(self) -> list[Film]:
        """Every film once, in the order of the layers."""
        return list(dict.fromkeys(layer.film for layer in self.laminate.layers))

    @property
    def fixture(self) -> str | None:
        """The path of the base plate's cut file; None if no pins are used."""
        return f"{self.folder}{FIXTURE}" if self.laminate.pins else None

    @cached_property
    def underlay(self) -> str | None:
        """The path of the page to lay up on; None if pins hold every part in every step."""
        return f"{self.folder}{UNDERLAY}" if guides(self.laminate) else None
