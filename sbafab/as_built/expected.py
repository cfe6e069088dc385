"""The expected laminate of a folder, and agreement of contours with it.

Contours within 1 um of each other become one: programs that save a file again round its coordinates
differently in every layer, and rules would take the gap between two such edges for a bond or a
leak.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from sbafab.as_built.kerf_removed import remove_kerf
from sbafab.cutting.chaining import check_clear
from sbafab.cutting.kerf import compensated_paths
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.verify import check_contours
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Edge, edge_from_bulge
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.laminate import Laminate
from sbafab.rules import registration_yield
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures

AGREEMENT = 2 * TOLERANCE
"""Largest distance of two contours that are each within TOLERANCE of the expected one, mm."""
SAME = 1e-8
"""Coordinates that differ by less are equal, mm."""


def with_circles(region: Region) -> Region:
    """Return the region with circles for contours that stay within TOLERANCE of one."""
    return Region(tuple(map(_rounded, region.contours)))


def _rounded(contour: Contour) -> Contour:
    low_x, low_y, high_x, high_y = contour.bounds
    if contour.circle is not None or abs(high_x - low_x - high_y + low_y) > 2 * AGREEMENT:
        return contour
    centre = centroid(Region((contour,)))
    least = min(math.dist(edge.nearest(centre), centre) for edge in contour.edges)
    most = max(edge.farthest_from(centre) for edge in contour.edges)
    if most - least > 2 * TOLERANCE:
        return contour
    whole = circle(centre, (least + most) / 2)
    return whole.reversed() if contour.is_hole else whole


def without_specks(region: Region) -> Region:
    """Return the region without edges shorter than AGREEMENT, which rounded corners leave."""
    return Region(tuple(map(_without_specks, region.contours)))


def _without_specks(contour: Contour) -> Contour:
    edges = [edge for edge in contour.edges if math.dist(edge.start, edge.end) >= AGREEMENT]
    if len(edges) == len(contour.edges) or len(edges) < 3:
        return contour
    ends = [edge.start for edge in (*edges[1:], edges[0])]
    return Contour(
        tuple(
            edge if edge.end == end else edge_from_bulge(edge.start, end, edge.bulge)
            for edge, end in zip(edges, ends, strict=True)
        )
    )


@dataclass
class _ContourGroup:
    """Contours that agree with the ``first``; ``members`` agree with it edge by edge."""

    first: Contour
    members: list[Contour] = field(default_factory=list)

    def takes(self, contour: Contour) -> bool:
        """Return True if a contour agrees with the first; it may become a member."""
        bounds = zip(contour.bounds, self.first.bounds, strict=True)
        if contour.is_hole != self.first.is_hole or any(
            abs(a - b) > 2 * AGREEMENT for a, b in bounds
        ):
            return False
        member = _matching_edges(self.first, contour)
        if member is not None:
            self.members.append(member)
        return member is not None or _lies_on(self.first, contour)

    @cached_property
    def agreed(self) -> Contour:
        """The median of the members, or the first contour if all have equal coordinates."""
        if self.first.circle is not None:
            circles = [c.circle for c in self.members if c.circle is not None]
            x, y, radius = (_median([(*p, r)[i] for p, r in circles]) for i in range(3))
            whole = circle((x, y), radius)
            return whole.reversed() if self.first.is_hole else whole
        rows = [contour.vertices for contour in self.members]
        if max(_largest_difference(rows[0], row) for row in rows) < SAME:
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


def _largest_difference(
    first: Sequence[tuple[float, float, float]], second: Sequence[tuple[float, float, float]]
) -> float:
    return max(
        abs(a - b) for p, q in zip(first, second, strict=True) for a, b in zip(p, q, strict=True)
    )


def _matching_edges(first: Contour, contour: Contour) -> Contour | None:
    """Return the contour from the first one's start if all edges agree, else None."""
    if first.circle is not None and contour.circle is not None:
        (p, r), (q, s) = first.circle, contour.circle
        return contour if math.dist(p, q) + abs(r - s) <= AGREEMENT else None
    if len(first.edges) != len(contour.edges):
        return None
    start = first.edges[0].start
    ways = [math.dist(edge.start, start) for edge in contour.edges]
    offset = ways.index(min(ways))
    edges = (*contour.edges[offset:], *contour.edges[:offset])
    agree = all(
        math.dist(a.start, b.start) <= AGREEMENT and math.dist(a.at(0.5), b.at(0.5)) <= AGREEMENT
        for a, b in zip(first.edges, edges, strict=True)
    )
    return Contour(edges) if agree else None


def _lies_on(first: Contour, contour: Contour) -> bool:
    """Return True if two contours with different edges run along each other."""
    try:
        check_contours(Region((contour,)), Region((first,)), AGREEMENT)
    except OutputError:
        return False
    return True


def in_agreement(regions: Sequence[Region]) -> list[Region]:
    """Return the regions with contours that agree within AGREEMENT replaced by their median."""
    groups: list[_ContourGroup] = []
    homes: list[list[_ContourGroup]] = []
    for region in regions:
        region_groups = []
        for contour in region.contours:
            home = next((group for group in groups if group.takes(contour)), None)
            if home is None:
                home = _ContourGroup(contour, [contour])
                groups.append(home)
            region_groups.append(home)
        homes.append(region_groups)
    return [Region(tuple(home.agreed for home in region_groups)) for region_groups in homes]


# Check of laminates cut in chords against their limits.


def refuse_coarse(
    laminate: Laminate, paths: Mapping[str, Region], settings: CutSettings, design: Design
) -> None:
    """Raise DesignError if a passing laminate fails a rule when its ``paths`` are cut in chords."""
    error = settings.curves.chord_error
    try:
        failed = _first_failure(as_cut(laminate, paths, settings), design)
    except (OutputError, GeometryError) as failure:
        raise DesignError(_refusal(error, f"leave no sound contours: {failure}")) from failure
    if failed is not None:
        raise DesignError(_refusal(error, f"break {failed.rule}: {failed.message}"))


def _refusal(error: float, why: str) -> str:
    return (
        f"chords within {error:g} mm {why}; take a smaller --chord-error, or true arcs with "
        "--dxf-profile bulges or arcs"
    )


def as_cut(laminate: Laminate, paths: Mapping[str, Region], settings: CutSettings) -> Laminate:
    """Return the laminate of the parts that a beam along the paths leaves."""
    cut = []
    for pattern, path in paths.items():
        check_clear(path.contours)
        material = laminate.patterns[pattern][0].film.material
        part = remove_kerf(with_circles(path), settings.kerf_width(material) or 0.0)
        cut.append(with_circles(part))
    profiles = dict(zip(paths, in_agreement(cut), strict=True))
    return replace(
        laminate,
        layers=tuple(replace(layer, profile=profiles[layer.pattern]) for layer in laminate.layers),
    )


def _first_failure(laminate: Laminate, design: Design) -> Finding | None:
    """Return the first failure that is not waived, without the yield, or None."""
    measures = Measures(laminate, design)
    return next(
        (
            finding
            for rule in RULES
            if rule.name != registration_yield.NAME
            for finding in run_rule(rule, measures)
            if finding.verdict == "fail"
        ),
        None,
    )


# The expected laminate of a folder's design.


class Expected(NamedTuple):
    """A layer's profile and the beam's path for it."""

    profile: Region
    path: Region


class ExpectedLaminate(NamedTuple):
    """A design's laminate, and the beam's path for each of its patterns."""

    laminate: Laminate
    paths: Mapping[str, Region]

    @property
    def layers(self) -> list[Expected]:
        """The expected layers, bottom to top."""
        layers = self.laminate.layers
        return [Expected(layer.profile, self.paths[layer.pattern]) for layer in layers]


def expected_laminate(laminate: Laminate, settings: CutSettings) -> ExpectedLaminate:
    """Return a laminate and its paths as drawn by the settings; with chords, the laminate that
    these cut.
    """
    paths = compensated_paths(laminate, settings)
    if settings.curves.in_chords:
        laminate = as_cut(laminate, paths, settings)
    return ExpectedLaminate(laminate, paths)


def departure(path: Region, expected: Region) -> str:
    """Return the difference of a path read back from the expected one; "" within 1 um."""
    try:
        check_contours(path, expected, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    return ""
