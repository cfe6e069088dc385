"""The order behind a traveller, values shared by its pages, and a box to tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.geometry.offset import Kerf
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import Runs, design_runs
from sbafab.pressing.schedule import Schedule
from sbafab.reports.traveller import units
from sbafab.rules.finding import Finding

HERE = Path(__file__).parent
STYLE = "traveller.css"
SHORT_HASH = 12


def frame(title: str, sha256: str, generator: str) -> dict[str, Any]:
    """Return the values common to all pages: style, head and foot."""
    short = sha256[:SHORT_HASH]
    return {
        "title": title,
        "short_hash": short,
        "generator": generator,
        "running_head": css_string(f"{title}  {short}"),
        "style": (HERE / STYLE).read_text(encoding="utf-8"),
        "units": units,
    }


def css_string(words: str) -> str:
    """Return a text as a CSS string that cannot end early or leave the style element."""
    return '"' + "".join(c if c.isalnum() or c in " .-_" else f"\\{ord(c):x} " for c in words) + '"'


@dataclass(frozen=True)
class Job:
    """The order behind a traveller.

    ``kerf`` is by material, None if it was not measured; ``fixture`` is the path of the base
    plate's cut file, ``underlay`` of the page to lay up on, ``solid_png`` the bytes of the solid's
    picture. ``lowered`` are limits below the defaults.
    """

    design_sha256: str
    generator: str
    waived: Sequence[str] = ()
    lowered: Sequence[str] = ()
    findings: Sequence[Finding] = ()
    fixture: str | None = None
    underlay: str | None = None
    kerf: Mapping[str, Kerf | None] = field(default_factory=dict)
    solid_png: bytes | None = None


@dataclass(frozen=True)
class Work:
    """A design with its laminate, its schedule, the ``sheets`` for all copies, and its order: the
    input of its pages.
    """

    design: Design
    laminate: Laminate
    schedule: Schedule
    sheets: Sequence[SheetFile]
    job: Job

    @property
    def copies(self) -> int:
        """Number of actuators to make."""
        return self.design.order.quantity

    @property
    def runs(self) -> Runs:
        """The press cycles of all copies."""
        return design_runs(self.design, self.laminate)


@dataclass(frozen=True)
class Action:
    """An action. ``layers`` are laid in it; ``ticks`` label one box each; without them there is one
    box.
    """

    text: str
    layers: tuple[int, ...] = ()
    ticks: tuple[str, ...] = ()
