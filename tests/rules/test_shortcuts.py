"""What the rules leave out, because a bound decides it, is what would not have counted."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Line
from sbafab.geometry.region import Region, disc, divided, polygon, rectangle, strip, union
from sbafab.laminate.laminate import Inlet, Laminate
from sbafab.rules import boundary, freedoms, margins, tube_fit, voids
from sbafab.rules.boundary import facing_films, outward_reach
from sbafab.rules.freedoms import Freedom
from sbafab.rules.limits import TOLERANCE, Limits, Tolerances
from sbafab.rules.margins import linear_forms, pushes
from sbafab.rules.measures import Measures
from sbafab.rules.registration_worst_case import least_remaining
from sbafab.rules.registration_yield import (
    CutContour,
    MarginRows,
    RowKind,
    rows_by_error,
    rows_of,
    short_builds,
    simulate,
)
from sbafab.rules.voids import _around, _gap

Good = Callable[..., Laminate]
BUILDS = 400
SHIFT = Freedom(1, 1, 1, 1, 0, 0.2)
OTHER = Freedom(2, 2, 3, 3, 0, 0.1)
TURN = Freedom(2, 2, 3, 3, 0, math.radians(1), (0.0, 0.0))
CUT, AGAIN = CutContour(1, 0), CutContour(2, 0)
DESIGNS = [("1dof-5mm", "stack.balloons=3"), ("3dof-15mm", "stack.balloons=2"), ("radial-15mm",)]


def rows(number: int, least: float, seed: int) -> MarginRows:
    """Rows of random normals, rooms and levers that feel two cuts, two shifts and a turn; and as
    many of another kind, which never come short.
    """
    generator = np.random.default_rng(seed)
    angle = generator.uniform(-math.pi, math.pi, number)
    moves = SHIFT, OTHER, TURN
    kind = RowKind(0, "bond", (CUT, AGAIN, *moves), (1.0, -1.0))
    room = generator.uniform(least, least + 0.1, number)
    turned = generator.uniform(-9, 9, number)
    return MarginRows(
        [kind, kind],
        np.array([0, number, 2 * number]),
        np.concatenate([room, room + 1.0]),
        np.tile([np.cos(angle), np.sin(angle)], 2),
        np.tile([0 * turned, 0 * turned, turned], 2),
        shift=np.array([[SHIFT.most] * 2, [OTHER.most] * 2, [0, 0]]),
        turn=np.array([[0, 0], [0, 0], [TURN.most] * 2]),
        sign=np.array([[-1.0] * 2, [1.0] * 2, [1.0] * 2]),
    )


@pytest.mark.parametrize("least", [0.05, 0.15, 0.25])
@pytest.mark.parametrize("number", [1, 7, 8, 30])
def test_builds_that_come_short_are_those_of_plain_sums(number: int, least: float) -> None:
    asked = rows(number, least, number)
    errors = asked.kinds[0].errors
    first, count = rows_by_error(errors)
    # Two interfaces, of which the second one's errors are drawn after the first one's.
    drawn = np.random.default_rng(5).random((2 * count, BUILDS))
    every = np.array(
        [[count * interface + first[error] for interface in (0, 1)] for error in errors]
    )
    good = np.ones((2, 2, BUILDS), dtype=bool)
    for kind in (0, 1):
        interfaces, builds = short_builds(asked, kind, every, 0.1, drawn)
        good[kind, interfaces, builds] = False
    assert good[1].all()
    room, levers = asked.room[:number], asked.levers[2, :number]
    for interface in (0, 1):
        own = {error: drawn[count * interface + row :] for error, row in first.items()}
        cut, again = (-0.1 + 0.2 * own[error][0] for error in (CUT, AGAIN))
        turn = TURN.most * (2 * own[TURN][0] - 1)
        shift, other = (
            one.most
            * np.sqrt(own[one][0])
            * np.array([np.cos(math.tau * own[one][1]), np.sin(math.tau * own[one][1])])
            for one in (SHIFT, OTHER)
        )
        (nx, ny), moved = asked.normal[:, :number], other - shift
        left = room[:, None] + cut - again + levers[:, None] * turn
        left = left + nx[:, None] * moved[0] + ny[:, None] * moved[1]
        assert list(good[0, interface]) == list((left >= -TOLERANCE).all(axis=0))
    assert 0 < good[0].sum() < 2 * BUILDS


def test_forms_lose_what_their_pushes_cost(good: Good) -> None:
    laminate = good("3dof-15mm", "stack.balloons=2")
    measures = Measures(laminate, Limits())
    forms = linear_forms(measures.margins, measures.moves)
    assert len(forms.loss) == sum(len(group) for group in measures.margins)
    for number, (whole, pinned) in enumerate(zip(forms.loss, forms.pinned_loss, strict=True)):
        run = forms.runs[forms.run[number]]
        group = measures.margins[run.group]
        margin = group[number - int(forms.begins[forms.run[number]]) + run.first]
        assert margin.quantity == run.quantity
        found = pushes(margin, group.first, measures.moves)
        assert whole == pytest.approx(sum(push.cost for push in found))
        held = [push.cost for push in found if not push.freedom.by_hand]
        assert pinned == pytest.approx(sum(held))


def test_a_laminate_without_margins_has_neither_forms_nor_rows() -> None:
    forms = linear_forms([], freedoms.Freedoms({}))
    asked = rows_of(forms, [], Limits())
    assert (forms.loss.shape, asked.room.shape, len(asked.kinds)) == ((0,), (0,), 0)


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize(
    "limits",
    [
        Limits(yield_builds=500),
        # Short as drawn; a limit under the errors above what is drawn; a turn that reaches far.
        Limits(bond_width=2.0, mask_overhang=0.7, yield_builds=500),
        Limits(worst_bond_width=0.9, worst_mask_overhang=0.6, yield_builds=500),
        Limits(tolerances=Tolerances(turn=4.0), yield_builds=500),
    ],
)
def test_places_left_out_are_neither_the_worst_nor_short(
    design: tuple[str, ...], limits: Limits, good: Good, monkeypatch: pytest.MonkeyPatch
) -> None:
    laminate = good(*design)

    def told() -> tuple[object, ...]:
        found = least_remaining(Measures(laminate, limits))
        return (
            [(round(one.worst, 9), round(one.pinned, 9), one.interfaces) for one in found],
            simulate(laminate, limits),
        )

    few = told()
    monkeypatch.setattr(margins._Loss, "slack", lambda self, *_: self.all)
    assert told() == few


def test_edges_aside_of_a_band_or_farther_off_are_none_of_the_nearest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    draw, heights = random.Random(4), boundary._heights
    for _ in range(20):
        region = union(
            disc((draw.uniform(-3, 3), draw.uniform(-3, 3)), draw.uniform(0.05, 2))
            for _ in range(8)
        )
        for edge in region.edges:
            for one in (edge, edge.reversed()):
                band = (
                    boundary._line_band(one) if isinstance(one, Line) else boundary._arc_band(one)
                )
                found = outward_reach(one, region.index)
                monkeypatch.setattr(boundary, "_heights", lambda *_: (-math.inf, math.inf))
                plain = boundary._nearest(band, region.edges)
                monkeypatch.setattr(boundary, "_heights", heights)
                assert found == plain


@pytest.mark.parametrize("design", DESIGNS)
def test_voids_beside_one_circle_are_those_beside_each_of_its_arcs(
    design: tuple[str, ...], good: Good, monkeypatch: pytest.MonkeyPatch
) -> None:
    laminate = good(*design)
    frame = rectangle((-50, -50), (50, 50))
    gaps = [(one.unbonded, one.contact, frame, ()) for one in laminate.interfaces]
    gap = voids._gap.__wrapped__  # type: ignore[attr-defined]
    found = [gap(*one) for one in gaps]
    monkeypatch.setattr(voids, "_follows", lambda *_: False)
    assert [gap(*one) for one in gaps] == found
    assert any(len(one.touching) > 3 for one in found)


TAPERED = ("1dof-5mm", "stack.balloons=4", "chamber.diameter=[5, 8, 6, 8]")


@pytest.mark.parametrize("design", [*DESIGNS, TAPERED])
@pytest.mark.parametrize("hole", [None, disc((0.0, 0.0), 1.5)])
def test_films_outside_an_outline_face_nothing_within_it(
    design: tuple[str, ...],
    hole: Region | None,
    good: Good,
    spoil: Good,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laminate = good(*design)
    if hole is not None:
        # A film with a wide opening, through which others face each other.
        layer = laminate.tpe_layers[1]
        laminate = spoil(laminate, layer.index, layer.profile - hole)
    asked: list[bool] = []

    def fits_in(film: Region, outlines: tuple[Contour, ...]) -> bool:
        asked.append(plain(film, outlines))
        return asked[-1]

    plain = boundary._fits_in
    monkeypatch.setattr(boundary, "_fits_in", fits_in)
    found = facing_films(laminate)
    assert any(asked) or len(laminate.tpe_layers) < 4
    monkeypatch.setattr(boundary, "_fits_in", lambda *_: False)
    assert facing_films(laminate) == found


RUN = Inlet("chamber1", (9.0, 0.5), (1.0, 0.0), 1.6, 3.0, 0.8)
STRIP = rectangle((0.0, -0.3), (9.0, 1.3))
"""A strip that opens at the inlet of that run."""


@pytest.mark.parametrize("degrees", [0, 90, 120, 263])
def test_a_straight_run_is_what_a_boolean_leaves_of_it(degrees: float) -> None:
    pocket = (STRIP | disc((0.0, 0.5), 2.5)).turned(degrees)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    mouth = 9.0 * c - 0.5 * s, 9.0 * s + 0.5 * c
    inlet = replace(RUN, mouth=mouth, direction=(c, s))
    inner = mouth[0] - 3.0 * c, mouth[1] - 3.0 * s
    beside = strip(inner, mouth, 2 * inlet.width)
    run = tube_fit._straight_run(pocket, inlet, beside)
    assert run is not None
    assert run.area == pytest.approx(3.0 * 1.6)
    assert [edge.start for edge in run.edges] == [
        pytest.approx(edge.start) for edge in (pocket & beside).edges
    ]


@pytest.mark.parametrize(
    "unbonded",
    [
        # A hole in the run, a waist, sides aslant, a shape beside it, wider than is looked at.
        STRIP - disc((7.5, 0.5), 0.1),
        STRIP - rectangle((7.0, -1.0), (7.5, 0.0)),
        polygon([(0, -0.3), (9, -0.2), (9, 1.3), (0, 1.3)]),
        STRIP | rectangle((7.0, 1.5), (7.5, 2.0)),
        rectangle((0.0, -1.2), (9.0, 2.2)),
        # It ends before the mouth, goes on past it, or begins after the run does.
        rectangle((0.0, -0.3), (8.9, 1.3)),
        rectangle((0.0, -0.3), (9.5, 1.3)),
        rectangle((6.5, -0.3), (9.0, 1.3)),
    ],
)
def test_any_other_run_is_left_to_the_boolean(unbonded: Region) -> None:
    beside = strip((6.0, 0.5), (9.0, 0.5), 3.2)
    assert tube_fit._straight_run(STRIP, RUN, beside) is not None
    assert tube_fit._straight_run(unbonded, RUN, beside) is None


FRAME = rectangle((-20, -20), (20, 20))
NOTCHED = rectangle((-4, -3), (4, 3)) - disc((0, 0), 1) - disc((4, 0), 1.5)


@pytest.mark.parametrize(
    "region",
    [
        Region(),
        disc((1, 2), 3),
        NOTCHED,
        union([NOTCHED, disc((9, 9), 2)]),
        # Two squares that touch at a corner, and a hole that touches its outline.
        union([rectangle((0, 0), (2, 2)), rectangle((2, 2), (4, 4))]),
        rectangle((0, 0), (6, 6)) - rectangle((0, 2), (2, 4)).turned(45, (0, 2)),
    ],
)
def test_what_is_round_a_region_is_what_a_boolean_leaves(region: Region) -> None:
    assert _around(region, FRAME).contours == (FRAME - region).contours


def test_voids_that_touch_at_a_point_are_told_apart_along_one_circle() -> None:
    """A pocket round a hole of radius 2. A square of film stands in the hole on its corners and
    leaves four voids; or two wedges of bond reach the hole's edge and leave two pockets.
    """
    hole, frame = disc((0, 0), 2), disc((0, 0), 9)
    ring, film = disc((0, 0), 3) - hole, disc((0, 0), 5) - hole
    square = polygon([(2, 0), (0, 2), (-2, 0), (0, -2)])
    gap = _gap(ring, film | square, frame, ())
    # Four segments of 4 (pi / 4 - 1 / 2) each, and what is round the film.
    segments = [number for number, void in enumerate(gap.missing) if void.area < 2]
    assert [gap.missing[n].area for n in segments] == [pytest.approx(math.pi - 2)] * 4
    assert sorted({(pocket, void) for pocket, void, _ in gap.touching}) == [
        (0, number) for number in segments
    ]
    wedges = union(polygon([(way * 2, 0), (way * 4, 1), (way * 4, -1)]) for way in (1, -1))
    gap = _gap(ring - wedges, film, frame, ())
    assert len(gap.unbonded) == 2
    joined = {(pocket, gap.missing[void].area) for pocket, void, _ in gap.touching}
    assert sorted(joined) == [(0, pytest.approx(4 * math.pi)), (1, pytest.approx(4 * math.pi))]


@pytest.mark.parametrize("by", [Region(), disc((0, 0), 2), NOTCHED, disc((4, 0), 1.5), FRAME])
def test_a_region_is_divided_as_two_booleans_would(by: Region) -> None:
    outside, inside = divided(NOTCHED, by)
    assert outside == NOTCHED - by
    assert inside == NOTCHED & by


@pytest.mark.parametrize("gap", [-3.0, -0.2, -0.01, -1e-4, 1e-4, 0.01, 3.0])
def test_shapes_that_plainly_meet_have_a_common_area(gap: float) -> None:
    ring = disc((0, 0), 5) - disc((0, 0), 2)
    beside = rectangle((5 + gap, -1), (12, 1))
    plainly = freedoms._plainly_meet(ring, beside)
    assert plainly == (gap < -0.1)
    assert not plainly or (ring & beside).area > math.pi * (freedoms.INSIDE / 2) ** 2


def test_what_is_measured_once_is_measured_of_that_laminate(good: Good) -> None:
    one = Measures(good("1dof-5mm", "stack.balloons=2"), Limits())
    more = Measures(good("1dof-5mm", "stack.balloons=4"), Limits())
    assert len(one.moves) < len(more.moves)
    assert one.moves is one.moves
    wide = replace(Limits(), tolerances=Tolerances(placement=0.4))
    assert Measures(one.laminate, wide).moves != one.moves
