"""Contours that files draw alike made one: what lies within 1 um of what was meant is as meant.

Programs that save a file anew round its coordinates, and not alike in every layer. Rules would
take what is left between two such edges for a bond, or for a leak.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from sbafab.actuators import build
from sbafab.as_built.kerf_removed import uncut
from sbafab.cutting.chaining import check_clear
from sbafab.cutting.files import compensated_paths
from sbafab.cutting.properties import CutSettings, curves_of
from sbafab.cutting.verify import check_contours
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Edge, edge_from_bulge
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.laminate import Laminate
from sbafab.output.checked import cut_settings
from sbafab.rules import registration_yield
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.limits import TOLERANCE, Limits
from sbafab.rules.measures import Measures

AGREED = 2 * TOLERANCE
"""mm between two contours that are each within TOLERANCE of the one that was meant."""
SAME = 1e-8
"""mm: coordinates that differ by less were written as one."""


def with_circles(region: Region) -> Region:
    """The region with every contour that stays within TOLERANCE of a circle as that circle."""
    return Region(tuple(map(_rounded, region.contours)))


def _rounded(contour: Contour) -> Contour:
    low_x, low_y, high_x, high_y = contour.bounds
    if contour.circle is not None or abs(high_x - low_x - high_y + low_y) > 2 * AGREED:
        return contour
    centre = centroid(Region((contour,)))
    least = min(math.dist(edge.nearest(centre), centre) for edge in contour.edges)
    most = max(edge.farthest_from(centre) for edge in contour.edges)
    if most - least > 2 * TOLERANCE:
        return contour
    whole = circle(centre, (least + most) / 2)
    return whole.reversed() if contour.is_hole else whole


def without_specks(region: Region) -> Region:
    """The region without edges shorter than AGREED, which rounded corners leave when uncut."""
    return Region(tuple(map(_unspecked, region.contours)))


def _unspecked(contour: Contour) -> Contour:
    kept = [edge for edge in contour.edges if math.dist(edge.start, edge.end) >= AGREED]
    if len(kept) == len(contour.edges) or len(kept) < 3:
        return contour
    ends = [edge.start for edge in (*kept[1:], kept[0])]
    return Contour(
        tuple(
            edge if edge.end == end else edge_from_bulge(edge.start, end, edge.bulge)
            for edge, end in zip(kept, ends, strict=True)
        )
    )


@dataclass
class _Alike:
    """Contours that agree with the ``first``; ``members`` are drawn like it, edge by edge."""

    first: Contour
    members: list[Contour] = field(default_factory=list)

    def takes(self, contour: Contour) -> bool:
        """Whether a contour agrees; it is then counted."""
        apart = zip(contour.bounds, self.first.bounds, strict=True)
        if contour.is_hole != self.first.is_hole or any(abs(a - b) > 2 * AGREED for a, b in apart):
            return False
        member = _drawn_like(self.first, contour)
        if member is not None:
            self.members.append(member)
        return member is not None or _lies_on(self.first, contour)

    @cached_property
    def agreed(self) -> Contour:
        """The median of the members; the first where all are written alike."""
        if self.first.circle is not None:
            found = [c.circle for c in self.members if c.circle is not None]
            x, y, radius = (_median([(*p, r)[i] for p, r in found]) for i in range(3))
            whole = circle((x, y), radius)
            return whole.reversed() if self.first.is_hole else whole
        rows = [contour.vertices for contour in self.members]
        if max(_off(rows[0], row) for row in rows) < SAME:
            return self.first
        corners = [
            tuple(_median([row[i][j] for row in rows]) for j in range(3))
            for i in range(len(rows[0]))
        ]
        edges: list[Edge] = [
            edge_from_bulge((x, y), (u, v), bulge)
            for (x, y, bulge), (u, v, _) in zip(corners, (*corners[1:], corners[0]), strict=True)
        ]
        return Contour(tuple(edges))


def _median(values: Sequence[float]) -> float:
    if max(values) - min(values) < SAME:
        return values[0]
    from statistics import median

    return median(values)


def _off(
    one: Sequence[tuple[float, float, float]], other: Sequence[tuple[float, float, float]]
) -> float:
    return max(
        abs(a - b) for p, q in zip(one, other, strict=True) for a, b in zip(p, q, strict=True)
    )


def _drawn_like(first: Contour, other: Contour) -> Contour | None:
    """The other contour from where the first one starts, if each of its edges agrees with one."""
    if first.circle is not None and other.circle is not None:
        (p, r), (q, s) = first.circle, other.circle
        return other if math.dist(p, q) + abs(r - s) <= AGREED else None
    if len(first.edges) != len(other.edges):
        return None
    start = first.edges[0].start
    ways = [math.dist(edge.start, start) for edge in other.edges]
    offset = ways.index(min(ways))
    edges = (*other.edges[offset:], *other.edges[:offset])
    agree = all(
        math.dist(a.start, b.start) <= AGREED and math.dist(a.at(0.5), b.at(0.5)) <= AGREED
        for a, b in zip(first.edges, edges, strict=True)
    )
    return Contour(edges) if agree else None


def _lies_on(first: Contour, other: Contour) -> bool:
    """Whether two contours that are drawn by other edges run along each other."""
    try:
        check_contours(Region((other,)), Region((first,)), AGREED)
    except OutputError:
        return False
    return True


def in_agreement(regions: Sequence[Region]) -> list[Region]:
    """The regions with all contours that agree, within AGREED mm, replaced by their median."""
    groups: list[_Alike] = []
    homes: list[list[_Alike]] = []
    for region in regions:
        own = []
        for contour in region.contours:
            home = next((group for group in groups if group.takes(contour)), None)
            if home is None:
                home = _Alike(contour, [contour])
                groups.append(home)
            own.append(home)
        homes.append(own)
    return [Region(tuple(home.agreed for home in own)) for own in homes]


# Whether a laminate still holds its limits where chords stand for its arcs.


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


# What a folder's design makes: the laminate that every cut file is held against.


class Expected(NamedTuple):
    """A layer's profile, and the path on which the beam leaves it."""

    profile: Region
    path: Region


class Meant(NamedTuple):
    """A design's laminate, and the path of the beam for each of its patterns."""

    laminate: Laminate
    paths: Mapping[str, Region]

    def layers(self, count: int) -> Sequence[Expected | None]:
        """What ``count`` layers, bottom to top, should be; None where the design has not so many.

        A layer too many or too few may be missing anywhere, so that none has its place then.
        """
        layers = self.laminate.layers
        if len(layers) != count:
            return [None] * count
        return [Expected(layer.profile, self.paths[layer.pattern]) for layer in layers]


class RunWork(NamedTuple):
    """What a run that has just written a folder knows of it: its design's part and findings."""

    meant: Meant
    findings: tuple[Finding, ...]


def meant_by(design: Design, curves: str | None) -> Meant | None:
    """The laminate of a design, drawn with such ``curves``; None where it cannot be built or cut.

    Of one in chords, the laminate that these cut.
    """
    try:
        settings = drawn_settings(design, (), curves)
        laminate = build(design)
        paths = compensated_paths(laminate, settings)
        if settings.curves.in_chords:
            laminate = as_cut(laminate, paths, settings)
        return Meant(laminate, paths)
    except (DesignError, GeometryError, OutputError, ArithmeticError):
        return None


def drawn_settings(design: Design, waived: tuple[str, ...], curves: str | None) -> CutSettings:
    """How a design's files are drawn with what the manifest says of their ``curves``."""
    return cut_settings(design, waived, curves_of(curves))


def departure(path: Region, expected: Region) -> str:
    """Where a path that was read back is not the expected one; empty where they agree.

    They agree where no edge is further off than the cut files promise (1 um).
    """
    try:
        check_contours(path, expected, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    return ""
