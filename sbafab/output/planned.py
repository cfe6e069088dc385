"""A design on its way to its folder: checked by the rules, then planned, before it is written."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from sbafab.cutting.dxf_write import TRUE_ARCS, Curves
from sbafab.cutting.files import compensated_paths
from sbafab.cutting.properties import CutSettings
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.parts import parts_of
from sbafab.nesting.records import NestPart
from sbafab.output.settings import cut_settings, limits, press_settings
from sbafab.pressing.schedule import Schedule, schedule
from sbafab.pressing.together import design_runs
from sbafab.rules.deck import has_failed
from sbafab.rules.finding import Finding
from sbafab.rules.lowered import CHECKED_AGAINST, lowered

if TYPE_CHECKING:
    from sbafab.meshing.conforming.meshes import ConformingMeshes

RunPart = Literal["cut", "press", "mesh", "preview"]
EVERYTHING: tuple[RunPart, ...] = ("cut", "press", "mesh", "preview")
PICTURES: tuple[RunPart, ...] = ("preview",)
"""What is left, beside the findings, of a design that is not to be cut."""


@dataclass(frozen=True)
class Checked:
    """A design, its laminate, and what the rules found in it."""

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive."""
        return has_failed(self.findings)

    @property
    def waived(self) -> tuple[str, ...]:
        """The rules that fail and that the design waives by name."""
        return tuple(dict.fromkeys(finding.rule for finding in self.findings if finding.by_user))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits that the design sets below the usual ones."""
        return lowered(limits(self.design))


@dataclass(frozen=True)
class Planned:
    """What of a design is ``wanted``, and all that is worked out before its folder is begun.

    ``paths``: the beam's path for every pattern, ``parts``: what goes on film sheets; both empty
    where nothing is cut. ``conforming`` is written in the ``formats`` of these file endings.
    """

    checked: Checked
    wanted: frozenset[RunPart]
    settings: CutSettings
    pressing: Schedule | None = None
    paths: Mapping[str, Region] = field(default_factory=dict)
    parts: tuple[NestPart, ...] = ()
    conforming: ConformingMeshes | None = None
    formats: tuple[str, ...] = ()


def plan(checked: Checked, wanted: Collection[RunPart], curves: Curves = TRUE_ARCS) -> Planned:
    """The plan of a design. Raises DesignError where press, kerf or chords cannot do it."""
    design, laminate = checked.design, checked.laminate
    settings = cut_settings(design, checked.waived, curves)
    pressing = schedule_of(checked) if "press" in wanted else None
    planned = Planned(checked, frozenset(wanted), settings, pressing)
    if "cut" not in wanted:
        return planned
    if laminate.panel is not None and curves.in_chords:
        raise DesignError(
            'registered sheets (registration.method = "sheet") are not drawn in chords; write '
            "bulges or arcs"
        )
    paths = compensated_paths(laminate, settings)
    if curves.in_chords:
        from sbafab.as_built.coarse import refuse_coarse

        refuse_coarse(laminate, paths, settings, limits(design))
    parts = parts_of(laminate, paths, design.order.quantity, design.order.spare_parts)
    return replace(planned, paths=paths, parts=parts)


def schedule_of(checked: Checked) -> Schedule:
    """The press schedule; its first step and its warnings name waived rules and lowered limits."""
    cycles = design_runs(checked.design, checked.laminate).cycles
    made = schedule(checked.laminate, press_settings(checked.design), cycles)
    said = []
    if checked.waived:
        rules = ", ".join(checked.waived)
        said.append(f"made although it breaks rules that the design waives: {rules}")
    if checked.lowered:
        said.append(f"{CHECKED_AGAINST}{', '.join(checked.lowered)}")
    if not said:
        return made
    first, *others = made.steps
    words = " ".join(f"{one[:1].upper()}{one[1:]}." for one in said)
    marked = replace(first, instructions=f"{words} {first.instructions}")
    return replace(made, steps=(marked, *others), warnings=(*said, *made.warnings))
