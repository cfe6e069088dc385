"""A build: a design with its laminate, findings, cut settings, beam paths and press schedule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sbafab.actuators import build
from sbafab.actuators.stacking import used_films
from sbafab.cutting.cut_settings import TRUE_ARCS, Curves, CutSettings, LeadIns, Recipes
from sbafab.cutting.kerf import compensated_paths
from sbafab.cutting.nesting import refuse_unfit
from sbafab.cutting.placements import TURNS, NestPart, Stock, parts_of
from sbafab.design.films import Sheet, material, recipes_for
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError
from sbafab.geometry.offset import widths
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate
from sbafab.pressing import dowels
from sbafab.pressing.cycles import Runs, design_runs
from sbafab.pressing.schedule import Schedule, plate_holes, schedule
from sbafab.rules.deck import CHECKED_AGAINST, has_failed, lowered, run_deck
from sbafab.rules.finding import Finding
from sbafab.runtime import Progress
from sbafab.version import GENERATOR


@dataclass(frozen=True, eq=False)
class Build:
    """A design with its laminate and the findings of the rules; derived values are computed on
    demand and cached.

    ``curves`` is the representation of arcs in its cut files.
    """

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]
    curves: Curves = TRUE_ARCS

    @property
    def failed(self) -> bool:
        """True if a rule failed without a waiver of the design."""
        return has_failed(self.findings)

    @property
    def waived(self) -> tuple[str, ...]:
        """The rules that fail and that the design waives by name."""
        return tuple(dict.fromkeys(finding.rule for finding in self.findings if finding.by_user))

    @property
    def lowered(self) -> tuple[str, ...]:
        """The limits that the design sets below their defaults."""
        return lowered(self.design)

    @cached_property
    def sha256(self) -> str:
        """The hash of the design."""
        return design_sha256(self.design)

    @cached_property
    def settings(self) -> CutSettings:
        """The settings of the cut files."""
        return cut_settings(self.design, self.waived, self.curves)

    @cached_property
    def paths(self) -> Mapping[str, Region]:
        """The beam's path for every pattern. Raises DesignError if the kerf leaves none."""
        return compensated_paths(self.laminate, self.settings)

    @cached_property
    def pieces(self) -> tuple[NestPart, ...]:
        """The pieces for film sheets, with copies and spares."""
        order = self.design.order
        return parts_of(self.laminate, self.paths, order.quantity, order.spare_parts)

    @cached_property
    def cycles(self) -> Runs:
        """The press cycles that make all copies."""
        return design_runs(self.design, self.laminate)

    @cached_property
    def schedule(self) -> Schedule:
        """The press schedule; first step and warnings name waived rules and lowered limits.

        Raises DesignError if the press is unsuitable.
        """
        plain = schedule(self.laminate, self.design, self.cycles.cycles)
        remarks = []
        if self.waived:
            rules = ", ".join(self.waived)
            remarks.append(f"made although it breaks rules that the design waives: {rules}")
        if self.lowered:
            remarks.append(f"{CHECKED_AGAINST}{', '.join(self.lowered)}")
        if not remarks:
            return plain
        if not plain.steps:
            return replace(plain, remarks=tuple(remarks))
        first, *later = plain.steps
        words = " ".join(f"{remark[:1].upper()}{remark[1:]}." for remark in remarks)
        marked = replace(first, instructions=f"{words} {first.instructions}")
        return replace(plain, steps=(marked, *later), remarks=tuple(remarks))


def make_build(
    design: Design, progress: Progress | None = None, curves: Curves = TRUE_ARCS
) -> Build:
    """Build the laminate of a design and run the rule deck on it. Raises DesignError."""
    try:
        laminate = build(design)
        return Build(design, laminate, run_deck(laminate, design, progress), curves)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None


def refuse_undoable(builds: Sequence[Build]) -> None:
    """Raises DesignError if press, kerf or film sheets cannot do designs that pass the rules."""
    for each in builds:
        # Computing it refuses what the press cannot do.
        _ = each.schedule
        refuse_unfit(each.pieces, stocks(each.design))


# A design's sections as the settings that rules, cutting and pressing take.


def warnings(design: Design) -> dict[Material, str]:
    """Return the warning required in cut files of a film, by material."""
    return {name: film.warning for name, film in used_films(design).items() if film.warning}


def cut_settings(
    design: Design, waived: tuple[str, ...], curves: Curves = TRUE_ARCS
) -> CutSettings:
    return CutSettings(
        design=design.name,
        design_sha256=design_sha256(design),
        kerf_widths=design.kerf_widths,
        waived=waived,
        lowered=lowered(design),
        curves=curves,
        generator=GENERATOR,
        warnings=warnings(design),
        machine=design.laser.machine,
        recipes=recipes(design),
        lead_ins=lead_ins(design),
        seam_offsets=design.seam_offsets,
    )


def recipes(design: Design) -> dict[Material, Recipes]:
    """Return the recipes of each film on the design's machine; films without one are omitted."""
    laser = design.laser
    by_film = {
        name: recipes_for(laser.recipe or (), film, laser.machine)
        for name, film in used_films(design).items()
    }
    return {name: film_recipes for name, film_recipes in by_film.items() if film_recipes}


def hole_notes(design: Design, laminate: Laminate) -> tuple[str, ...]:
    """Return notes for the workshop on the base plate's holes, line by line; none without pins.

    Raises DesignError if no standard pin or plate fits.
    """
    if not laminate.pins:
        return ()
    holes = plate_holes(laminate, design)
    return dowels.hole_notes(laminate.pins, holes, design.registration.plate_made_by)


def stocks(design: Design) -> dict[Material, Stock]:
    """Return the film sheets by material."""
    sheets = _sheets(design)
    return {
        name: Stock.model_construct(
            **dict(sheets[name][1]), turns=(0, 2) if isinstance(kerf, tuple) else TURNS
        )
        for name, kerf in design.kerf_widths.items()
    }


def _sheets(design: Design) -> dict[Material, tuple[str, Sheet]]:
    """Return the sheet of every film, by material, and its table in the design."""
    sheets = {"TPE": ("sheets.tpe", design.sheets.tpe), "PTFE": ("sheets.ptfe", design.sheets.ptfe)}
    named_films = design.films.by_name.items()
    return sheets | {
        material(name): (f"films.{name}.sheet", film.sheet) for name, film in named_films
    }


USUAL_TABS = 3


def lead_ins(design: Design) -> dict[Material, LeadIns]:
    """Return lead-ins, overcuts and tabs of the films that have any."""
    kerfs, lead_ins_by_film = design.kerf_widths, {}
    for name, (key, sheet) in _sheets(design).items():
        if sheet.lead_in is sheet.overcut is sheet.tab_width is None:
            continue
        kerf = kerfs.get(name)
        width = max(widths(kerf)) if kerf is not None else 0.0
        lead_ins_by_film[name] = LeadIns(
            lead_in=sheet.lead_in or 0.0,
            overcut=sheet.overcut or 0.0,
            tab_width=sheet.tab_width or 0.0,
            tabs=(sheet.tabs or USUAL_TABS) if sheet.tab_width else 0,
            kerf=width,
            # Two cuts that keep two kerfs apart leave one of film between them.
            clearance=2 * (width or design.laser.unknown_kerf),
            key=key,
        )
    return lead_ins_by_film
