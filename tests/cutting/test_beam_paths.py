"""Lead-ins, overcuts and tabs: by closed formulas and by shapely."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
import shapely

from sbafab.cutting.beam_paths import BeamRun, beam_runs
from sbafab.cutting.cut_settings import CUT_INNER, CUT_OUTER, LeadIns
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.sequence import cutting_sequence
from sbafab.errors import DesignError
from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.region import Region, disc, rectangle

AROUND = Surroundings(frame=(80.0, 60.0))
RING = disc((20.0, 20.0), 10.0) - disc((20.0, 20.0), 4.0)
PLATE = rectangle((40.0, 10.0), (60.0, 40.0)) - rectangle((45.0, 15.0), (55.0, 25.0))
PARTS = Region((*RING.contours, *PLATE.contours))
ASKED = LeadIns(lead_in=1.0, overcut=0.5, tab_width=0.6, tabs=2, kerf=0.2, clearance=0.4)


def runs_of(region: Region, lead_ins: LeadIns) -> list[BeamRun]:
    runs = beam_runs(cutting_sequence(region), lead_ins, AROUND)
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


def on_a_contour(p: Point) -> bool:
    return any(line(c.edges).distance(shapely.Point(p)) < 0.01 for c in PARTS.contours)


@pytest.mark.parametrize(
    "lead_ins",
    [
        LeadIns(lead_in=1.0),
        LeadIns(overcut=2.0),
        LeadIns(tab_width=1.0, tabs=5),
        LeadIns(lead_in=0.3, tab_width=0.2, tabs=1, kerf=0.1),
    ],
)
def test_each_is_there_alone(lead_ins: LeadIns) -> None:
    more = 4 * (lead_ins.lead_in + lead_ins.overcut) - 2 * lead_ins.tabs * lead_ins.gap
    plain = sum(contour.length for contour in PARTS.contours)
    for asked, expected in ((LeadIns(), plain), (lead_ins, plain + more)):
        assert sum(map(length, runs_of(PARTS, asked))) == pytest.approx(expected)


# Lead-ins find room, or are refused.


@pytest.mark.parametrize(
    ("region", "lead_ins", "says"),
    [
        (RING, LeadIns(lead_in=9.0), r"sheets.tpe.lead_in = 9 has no room at the hole about x 20"),
        (
            rectangle((0.5, 0.5), (79.5, 59.5)),
            LeadIns(lead_in=1.0),
            "no room at the outline about x 40.0, y 30.0 of the sheet",
        ),
        (
            rectangle((10.0, 10.0), (12.0, 12.0)),
            LeadIns(tab_width=1.0, tabs=2),
            r"sheets.tpe.tabs = 2 of 1 mm do not fit on the outline about x 11.0, y 11.0",
        ),
        (RING, LeadIns(tab_width=8.0, tabs=5), "use fewer or narrower tabs"),
    ],
)
def test_what_has_no_room_is_refused_with_its_place(
    region: Region, lead_ins: LeadIns, says: str
) -> None:
    with pytest.raises(DesignError, match=says):
        runs_of(region, lead_ins)


def test_lead_ins_keep_off_pins_and_engraving() -> None:
    """A bar whose long sides have a pin beside one middle and a stroke beside the other."""
    bar = rectangle((10.0, 20.0), (50.0, 30.0))
    lead_ins = LeadIns(lead_in=1.0, clearance=0.2)
    engraved = Surroundings(engraved=(((29.0, 19.5), (31.0, 19.5)),), frame=(80.0, 60.0))
    contours = cutting_sequence(bar)
    [plain] = beam_runs(contours, lead_ins, AROUND)
    assert plain.edges[0].start == pytest.approx((30.0, 19.0))
    [other] = beam_runs(contours, lead_ins, engraved)
    assert other.edges[0].start == pytest.approx((30.0, 31.0))
    [third] = beam_runs(contours, lead_ins, engraved, [(30.0, 31.5, 2.0)])
    assert third.edges[0].start not in (plain.edges[0].start, other.edges[0].start)
    far = shapely.LineString([third.edges[0].start, third.edges[0].end])
    assert far.distance(shapely.Point(30.0, 31.5)) >= 1.2 - 1e-9
