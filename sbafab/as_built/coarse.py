"""Whether a laminate still holds its limits where chords stand for its arcs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sbafab.as_built.agreement import in_agreement, with_circles
from sbafab.as_built.uncut import uncut
from sbafab.cutting.chaining import check_clear
from sbafab.cutting.properties import CutSettings
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.rules import registration_yield
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.limits import Limits
from sbafab.rules.measures import Measures


def refuse_coarse(
    laminate: Laminate, paths: Mapping[str, Region], settings: CutSettings, limits: Limits
) -> None:
    """Raises DesignError where the laminate holds and what its ``paths`` in chords cut does not."""
    error = settings.curves.chord_error
    try:
        found = _first_failure(as_cut(laminate, paths, settings), limits)
    except (OutputError, GeometryError) as failure:
        raise DesignError(_refused(error, f"leave no sound contours: {failure}")) from failure
    if found is not None:
        raise DesignError(_refused(error, f"break {found.rule}: {found.message}"))


def _refused(error: float, why: str) -> str:
    return (
        f"chords within {error:g} mm {why}; take a smaller --chord-error, or true arcs with "
        "--dxf-profile bulges or arcs"
    )


def as_cut(laminate: Laminate, paths: Mapping[str, Region], settings: CutSettings) -> Laminate:
    """The laminate of the parts that a beam leaves which is led along the paths."""
    cut = []
    for pattern, path in paths.items():
        check_clear(path.contours)
        material = laminate.patterns[pattern][0].film.material
        part = uncut(with_circles(path), settings.kerf_width(material) or 0.0)
        cut.append(with_circles(part.region))
    profiles = dict(zip(paths, in_agreement(cut), strict=True))
    return replace(
        laminate,
        layers=tuple(replace(one, profile=profiles[one.pattern]) for one in laminate.layers),
    )


def _first_failure(laminate: Laminate, limits: Limits) -> Finding | None:
    """The first failure that is not waived; how many random builds hold is not counted again."""
    measures = Measures(laminate, limits)
    return next(
        (
            finding
            for rule in RULES
            if rule.name != registration_yield.NAME
            for finding in run_rule(rule, laminate, limits, measures)
            if finding.verdict == "fail"
        ),
        None,
    )
