"""Lead-ins, overcuts and tabs: by closed formulas, by shapely, and faults that are told."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
import shapely

from sbafab.cutting.beam_check import BeamRun, check_beam_runs
from sbafab.cutting.beam_paths import beam_runs
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.entries import Entries
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CUT_INNER, CUT_OUTER
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region, disc, rectangle

AROUND = Surroundings(frame=(80.0, 60.0))
RING = disc((20.0, 20.0), 10.0) - disc((20.0, 20.0), 4.0)
PLATE = rectangle((40.0, 10.0), (60.0, 40.0)) - rectangle((45.0, 15.0), (55.0, 25.0))
PARTS = Region((*RING.contours, *PLATE.contours))
ASKED = Entries(lead_in=1.0, overcut=0.5, tab_width=0.6, tabs=2, kerf=0.2, clearance=0.4)


def runs_of(region: Region, entries: Entries) -> list[BeamRun]:
    runs = beam_runs(cutting_order(region), entries, AROUND)
    return [BeamRun(run.layer, run.edges) for run in runs]


def line(edges: Sequence[Edge]) -> shapely.LineString:
    """Edges as a line of chords so short that they leave a circle of 10 mm by 1 um at most."""
    points = [edges[0].start, *(e.at(k / 64) for e in edges for k in range(1, 65))]
    return shapely.LineString(points)


def film(region: Region) -> shapely.Polygon:
    """A region as a polygon of short chords."""
    rings = [shapely.Polygon(line(c.edges).coords) for c in region.outers]
    holes = [shapely.Polygon(line(c.edges).coords) for c in region.holes]
    return shapely.union_all(rings).difference(shapely.union_all(holes))


def length(run: BeamRun) -> float:
    return sum(edge.length for edge in run.curves)  # type: ignore[attr-defined]


def test_the_lengths_of_a_ring_are_those_of_its_circles() -> None:
    """Hole: 2 pi r + lead-in + overcut; outline: the same less two gaps of tab and kerf."""
    hole, *outline = runs_of(RING, ASKED)
    assert (hole.layer, [run.layer for run in outline]) == (CUT_INNER, [CUT_OUTER] * 3)
    assert length(hole) == pytest.approx(8 * math.pi + 1.5)
    assert sum(map(length, outline)) == pytest.approx(20 * math.pi + 1.5 - 2 * 0.8)
    for run, radius, side in ((hole, 4.0, -1), (outline[0], 10.0, 1)):
        first = run.curves[0]
        assert math.dist(first.start, (20.0, 20.0)) == pytest.approx(radius + side * 1.0)
        assert math.dist(first.end, (20.0, 20.0)) == pytest.approx(radius)
    # What is left out between one cut and the next, as an angle of the circle.
    ends = [math.atan2(run.curves[-1].end[1] - 20, run.curves[-1].end[0] - 20) for run in outline]
    starts = [
        math.atan2(run.curves[0].start[1] - 20, run.curves[0].start[0] - 20) for run in outline
    ]
    gaps = [10 * ((b - a) % math.tau) for a, b in zip(ends[:2], starts[1:], strict=True)]
    assert gaps == pytest.approx([0.8, 0.8])
    # Past the start: from the lead-in's end on.
    begun = outline[0].curves[0].end
    over = (ends[2] - math.atan2(begun[1] - 20, begun[0] - 20)) % math.tau
    assert 10 * over == pytest.approx(0.5)


def test_shapely_finds_lead_ins_in_the_waste_and_the_tabs_as_wide_as_asked() -> None:
    runs = runs_of(PARTS, ASKED)
    solid = film(PARTS)
    cut = shapely.union_all([line(run.curves) for run in runs]).buffer(2e-3)  # type: ignore[arg-type]
    for contour in PARTS.contours:
        left = line(contour.edges).difference(cut)
        pieces = [part for part in getattr(left, "geoms", [left]) if part.length > 0.01]
        assert len(pieces) == (0 if contour.is_hole else 2)
        for piece in pieces:
            assert piece.length == pytest.approx(0.8 - 2 * 2e-3, abs=2e-3)
            # Straight, or of the ring's radius: no corner of the plate lies in it or near to it.
            corners = shapely.MultiPoint([(x, y) for x in (40, 60) for y in (10, 40)])
            assert piece.distance(corners) >= 0.79
    leads = [run.curves[0] for run in runs if not on_a_contour(run.curves[0].start)]
    assert len(leads) == 4
    for lead in leads:
        drawn = shapely.LineString([lead.start, lead.end])
        assert drawn.intersection(solid).length < 2e-3
        assert drawn.length == pytest.approx(1.0)
    check_beam_runs(runs, PARTS, ASKED)


def on_a_contour(p: Point) -> bool:
    return any(line(c.edges).distance(shapely.Point(p)) < 0.01 for c in PARTS.contours)


@pytest.mark.parametrize(
    "entries",
    [
        Entries(lead_in=1.0),
        Entries(overcut=2.0),
        Entries(tab_width=1.0, tabs=5),
        Entries(lead_in=0.3, tab_width=0.2, tabs=1, kerf=0.1),
    ],
)
def test_each_is_there_alone_and_the_check_finds_it(entries: Entries) -> None:
    runs = runs_of(PARTS, entries)
    check_beam_runs(runs, PARTS, entries)
    plain = runs_of(PARTS, Entries())
    assert sum(map(length, plain)) == pytest.approx(sum(c.length for c in PARTS.contours))
    outlines = len(PARTS.outers)
    more = 4 * (entries.lead_in + entries.overcut) - outlines * entries.tabs * entries.gap
    assert sum(map(length, runs)) == pytest.approx(sum(map(length, plain)) + more)
    with pytest.raises(OutputError):
        check_beam_runs(plain, PARTS, entries)
    with pytest.raises(OutputError):
        check_beam_runs(runs, PARTS, Entries())


# Lead-ins find room, or are refused.


@pytest.mark.parametrize(
    ("region", "entries", "says"),
    [
        (RING, Entries(lead_in=9.0), r"sheets.tpe.lead_in = 9 has no room at the hole about x 20"),
        (
            rectangle((0.5, 0.5), (79.5, 59.5)),
            Entries(lead_in=1.0),
            "no room at the outline about x 40.0, y 30.0 of the sheet",
        ),
        (
            rectangle((10.0, 10.0), (12.0, 12.0)),
            Entries(tab_width=1.0, tabs=2),
            r"sheets.tpe.tabs = 2 of 1 mm have no room on the outline about x 11.0, y 11.0",
        ),
        (RING, Entries(tab_width=8.0, tabs=5), "ask for fewer or narrower tabs"),
    ],
)
def test_what_has_no_room_is_refused_with_its_place(
    region: Region, entries: Entries, says: str
) -> None:
    with pytest.raises(DesignError, match=says):
        runs_of(region, entries)


def test_lead_ins_keep_off_pins_and_engraving() -> None:
    """A bar whose long sides have a pin beside one middle and a stroke beside the other."""
    bar = rectangle((10.0, 20.0), (50.0, 30.0))
    entries = Entries(lead_in=1.0, clearance=0.2)
    engraved = Surroundings(engraved=(((29.0, 19.5), (31.0, 19.5)),), frame=(80.0, 60.0))
    contours = cutting_order(bar)
    [plain] = beam_runs(contours, entries, AROUND)
    assert plain.edges[0].start == pytest.approx((30.0, 19.0))
    [other] = beam_runs(contours, entries, engraved)
    assert other.edges[0].start == pytest.approx((30.0, 31.0))
    [third] = beam_runs(contours, entries, engraved, [(30.0, 31.5, 2.0)])
    assert third.edges[0].start not in (plain.edges[0].start, other.edges[0].start)
    far = shapely.LineString([third.edges[0].start, third.edges[0].end])
    assert far.distance(shapely.Point(30.0, 31.5)) >= 1.2 - 1e-9


# Faults that only the check of what was read back can tell.


def moved(edge: Edge, start: Point) -> Line:
    return Line(start, edge.end)


def lead_into_the_part(runs: list[BeamRun]) -> list[BeamRun]:
    run = next(run for run in runs if run.layer == CUT_OUTER)
    (x, y), (u, v) = run.curves[0].start, run.curves[0].end
    return swapped(runs, run, [Line((2 * u - x, 2 * v - y), (u, v)), *run.curves[1:]])


def swapped(runs: list[BeamRun], run: BeamRun, curves: Sequence[object]) -> list[BeamRun]:
    return [BeamRun(run.layer, curves) if other is run else other for other in runs]  # type: ignore[arg-type]


def with_first(change: Callable[[Line], Line]) -> Callable[[list[BeamRun]], list[BeamRun]]:
    def changed(runs: list[BeamRun]) -> list[BeamRun]:
        first = runs[0].curves[0]
        assert isinstance(first, Line)
        return swapped(runs, runs[0], [change(first), *runs[0].curves[1:]])

    return changed


def without_a_tab(runs: list[BeamRun]) -> list[BeamRun]:
    """The first two cuts of an outline made one, through the tab."""
    number = next(i for i, run in enumerate(runs) if run.layer == CUT_OUTER)
    first, second = runs[number : number + 2]
    # On the ring, the way through the tab is an arc of its circle; 0.8 mm of a chord is 8 um off.
    [ring] = [c for c in PARTS.outers if c.circle or len(c.edges) > 4 or c.area < 400]
    whole = next(run for run in runs_of(Region((ring,)), replace(ASKED, tabs=0)))
    lapped = [run for run in runs if run not in (first, second)]
    mine = [
        run
        for run in lapped
        if run.layer == CUT_OUTER and math.dist(run.curves[-1].end, (20.0, 20.0)) < 11
    ]
    return [run for run in lapped if run not in mine] + [whole]


FAULTS: dict[str, tuple[Callable[[list[BeamRun]], list[BeamRun]], str]] = {
    "a lead-in through the part": (lead_into_the_part, "the lead-in at .* lies in a part"),
    "a lead-in too short": (
        with_first(lambda lead: Line(lead.at(0.5), lead.end)),
        "is 0.500 mm long, not 1",
    ),
    "a lead-in across the hole": (
        with_first(lambda lead: Line(lead.at(-8.0), lead.end)),
        "mm long, not 1",
    ),
    "no lead-in": (
        lambda runs: swapped(runs, runs[0], runs[0].curves[1:]),
        "has lead-ins at 0 of its 1 cuts",
    ),
    "a bent lead-in": (
        lambda runs: swapped(runs, runs[0], [*[Bent(runs[0].curves[0])], *runs[0].curves[1:]]),
        "is bent",
    ),
    "a tab missing": (without_a_tab, "has 0 tabs, not 2"),
    "a hole missing": (lambda runs: runs[1:], "the hole at .* is not cut"),
    "an outline cut twice": (
        lambda runs: [*runs, *runs[-3:]],
        "lead-ins come too near to each other",
    ),
    "a cut missing": (lambda runs: [*runs[:3], *runs[4:]], "has 1 tabs, not 2"),
    "no overcut": (
        lambda runs: swapped(runs, runs[0], shortened(runs[0].curves, 0.5)),
        r"is cut 0.000 mm past its start, not 0.5",
    ),
    "a gap at the end": (
        lambda runs: swapped(runs, runs[0], shortened(runs[0].curves, 0.6)),
        r"is cut -0.100 mm past its start, not 0.5",
    ),
    "holes after outlines": (lambda runs: [*runs[2:], *runs[:2]], "is cut after an outline"),
    "a hole among the outlines": (
        lambda runs: [BeamRun(CUT_OUTER, runs[0].curves), *runs[1:]],
        "is on CUT_OUTER, not CUT_INNER",
    ),
    "a cut in the waste": (
        lambda runs: [*runs, BeamRun(CUT_OUTER, [Line((70.0, 5.0), (75.0, 5.0))])],
        "where nothing is to be cut",
    ),
    "a cut that jumps": (
        lambda runs: swapped(runs, runs[0], [*runs[0].curves[:2], *runs[0].curves[3:]]),
        "jumps to",
    ),
    "a cut that runs backwards": (
        lambda runs: swapped(
            runs,
            runs[3],
            [edge.reversed() for edge in reversed(runs[3].curves)],  # type: ignore[attr-defined]
        ),
        "runs backwards",
    ),
    "a cut 2 um off": (
        lambda runs: swapped(runs, runs[3], [shifted(edge) for edge in runs[3].curves]),
        "where nothing is to be cut",
    ),
}


class Bent:
    """A curve with the ends of another and its middle aside."""

    def __init__(self, curve: object) -> None:
        self.start: Point = curve.start  # type: ignore[attr-defined]
        self.end: Point = curve.end  # type: ignore[attr-defined]

    def at(self, t: float) -> Point:
        x, y = Line(self.start, self.end).at(t)
        return x + 0.1 * t * (1 - t), y


def shortened(curves: Sequence[object], by: float) -> list[Edge]:
    """Edges without their last ``by`` mm."""
    edges: list[Edge] = list(curves)  # type: ignore[arg-type]
    while edges[-1].length <= by + 1e-9:
        by -= edges.pop().length
    last = edges.pop()
    return (
        [*edges, last.part(last.start, last.at(1 - by / last.length))]
        if by > 1e-9
        else [*edges, last]
    )


def shifted(edge: object) -> Line:
    (x, y), (u, v) = edge.start, edge.end  # type: ignore[attr-defined]
    return Line((x + 0.002, y + 0.002), (u + 0.002, v + 0.002))


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told(name: str) -> None:
    change, says = FAULTS[name]
    runs = runs_of(PARTS, ASKED)
    check_beam_runs(runs, PARTS, ASKED)
    with pytest.raises(OutputError, match=says):
        check_beam_runs(change(runs), PARTS, ASKED)


def test_a_lead_in_that_meets_its_own_contour_is_told() -> None:
    """In a slot 1 mm wide a lead-in of 0.95 mm begins 0.05 mm from the other side."""
    slot = rectangle((0.0, 0.0), (20.0, 20.0)) - rectangle((5.0, 9.5), (15.0, 10.5))
    entries = Entries(lead_in=0.95, clearance=0.2)
    [hole] = slot.holes
    lower = next(i for i, e in enumerate(hole.edges) if e.start[1] == e.end[1] == 9.5)
    start = hole.edges[lower].at(0.5)
    edges = [*hole.edges[lower + 1 :], *hole.edges[:lower]]
    first, last = Line(start, hole.edges[lower].end), Line(hole.edges[lower].start, start)
    run = BeamRun(CUT_INNER, [Line((start[0], 10.45), start), first, *edges, last])
    [outline] = slot.outers
    around = BeamRun(CUT_OUTER, [Line((-0.95, 0.0), outline.edges[0].start), *outline.edges])
    assert outline.edges[0].start == (0.0, 0.0)
    check_beam_runs([run, around], slot, replace(entries, clearance=0.05))
    with pytest.raises(OutputError, match="meets its own contour before its end"):
        check_beam_runs([run, around], slot, entries)


def test_a_tab_over_a_corner_is_told() -> None:
    square = rectangle((10.0, 10.0), (20.0, 20.0))
    entries = Entries(tab_width=2.0, tabs=1)
    over = (
        [Line((10.0, 10.0), (19.0, 10.0))],
        [
            *[Line((20.0, 11.0), (20.0, 20.0)), Line((20.0, 20.0), (10.0, 20.0))],
            Line((10.0, 20.0), (10.0, 10.0)),
        ],
    )
    with pytest.raises(OutputError, match="lies over a corner"):
        check_beam_runs([BeamRun(CUT_OUTER, edges) for edges in over], square, entries)
    beside = (
        [Line((10.0, 10.0), (14.0, 10.0))],
        [
            *[Line((16.0, 10.0), (20.0, 10.0)), Line((20.0, 10.0), (20.0, 20.0))],
            *[Line((20.0, 20.0), (10.0, 20.0)), Line((10.0, 20.0), (10.0, 10.0))],
        ],
    )
    check_beam_runs([BeamRun(CUT_OUTER, edges) for edges in beside], square, entries)
    with pytest.raises(OutputError, match=r"is 2.000 mm of it uncut, not 2.1"):
        check_beam_runs(
            [BeamRun(CUT_OUTER, edges) for edges in beside],
            square,
            replace(entries, tab_width=2.1),
        )
