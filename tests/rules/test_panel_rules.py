"""Registered sheets: every rule on them has a fault that it alone catches; good ones pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import Region, disc, strip
from sbafab.laminate.laminate import Laminate, Layer, SheetPanel
from sbafab.rules import bridges, scrap
from sbafab.rules.deck import run_deck
from sbafab.rules.freedoms import Part, freedoms
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.measures import Measures
from sbafab.rules.registration_yield import simulate
from tests.faults.panels import narrowed, over_the_tab, torn
from tests.rules.conftest import built

FEW = Limits(yield_builds=100)
Change = Callable[[Region, Laminate], Region]


def good(*changes: str) -> Laminate:
    return built(
        "1dof-5mm",
        'registration.method="sheet"',
        "registration.experimental=true",
        "stack.balloons=2",
        "order.copies=2",
        *changes,
    )


def failing(laminate: Laminate) -> dict[str, float | None]:
    findings = run_deck(laminate, FEW)
    return {found.rule: found.measured for found in findings if found.verdict == "fail"}


def with_sheet(laminate: Laminate, index: int, change: Change) -> Laminate:
    assert laminate.panel is not None
    sheets = list(laminate.panel.sheets)
    sheets[index - 1] = change(sheets[index - 1], laminate)
    return replace(laminate, panel=replace(laminate.panel, sheets=tuple(sheets)))


def with_second(laminate: Laminate, second: Region) -> Laminate:
    assert laminate.panel is not None
    return replace(laminate, panel=replace(laminate.panel, second=second))


@pytest.mark.parametrize(
    ("index", "change", "found"),
    [
        (1, narrowed, {"bridges": pytest.approx(0.4)}),
        (5, torn, {"bridges": None}),
        (5, over_the_tab, {"scrap": pytest.approx(2.0)}),
        (3, lambda sheet, own: sheet | disc(own.pins[3].centre, 2.0), {"pin-holes": 1.0}),
        (4, lambda sheet, own: sheet - disc(own.pins[0].centre, 0.9), {"pin-holes": 1.0}),
    ],
)
def test_a_faulty_sheet_fails_its_own_rule_alone(
    index: int, change: Change, found: dict[str, object]
) -> None:
    assert failing(with_sheet(good(), index, change)) == found


def test_a_second_cut_nearer_to_a_pocket_than_its_error_allows_fails_bridges_alone() -> None:
    laminate = good("panel.stub=0.1")
    assert failing(laminate) == {"bridges": None}
    assert failing(good()) == {}


def test_a_second_cut_that_leaves_welded_bridges_is_refused() -> None:
    for error, verdict in ((0.45, "pass"), (0.6, "fail")):
        limits = replace(FEW, tolerances=Tolerances(second_cut=error))
        (found,) = bridges.check(Measures(good("panel.stub=0.7"), limits))
        assert found.verdict == verdict
    assert "weld together" in found.message


def test_a_bridge_that_is_not_severed_holds_its_part() -> None:
    laminate = good()
    assert laminate.panel is not None
    (found,) = bridges.check(
        Measures(with_second(laminate, Region(laminate.panel.second.contours[1:])), FEW)
    )
    assert found.verdict == "fail"
    assert "still held" in found.message


def test_scrap_between_two_parts_is_locked_in() -> None:
    laminate = good()
    # Without window the wall of the first balloon is all sheet in the copy at the origin.
    shut = with_sheet(laminate, 3, lambda sheet, own: sheet | disc((0.0, 0.0), 9.0))
    (found,) = scrap.check(Measures(shut, FEW))
    assert found.verdict == "fail"


def test_parts_of_a_sheet_move_together_and_a_mask_with_the_film_below() -> None:
    laminate = good()
    moves = freedoms(laminate, Tolerances(cutting=0.1, pin=0.004, sheet=0.05))
    film, mask = moves[Part(1, 0)], moves[Part(2, 0)]
    assert [one.most for one in film] == [0.004, 0.05]
    assert mask[:2] == film
    assert len(mask) == 4
    assert not set(moves[Part(3, 0)]) & set(mask)


def test_stretch_of_the_sheets_lowers_the_yield() -> None:
    shares = [
        simulate(good(), Limits(yield_builds=400, tolerances=Tolerances(sheet=error))).whole.value
        for error in (0.0, 0.05, 0.15)
    ]
    assert shares[0] == 1.0
    assert shares == sorted(shares, reverse=True)
    assert shares[2] < 0.7


def test_of_bridges_that_are_equal_but_for_rounding_the_first_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Another order of summing moves a width by less than a nanometre."""
    exact = bridges._bridges

    def noisy(panel: SheetPanel, layer: Layer) -> list[bridges._Bridge]:
        width = 1.0 - layer.index * 1e-9
        return [bridge._replace(width=width) for bridge in exact(panel, layer)]

    monkeypatch.setattr(bridges, "_bridges", noisy)
    [found] = bridges.check(Measures(good(), FEW))
    assert found.measured == pytest.approx(1.0, abs=1e-6)
    assert found.where.layers == (1,)


@pytest.mark.parametrize("reach", [0.02, 0.2])
def test_a_tongue_of_scrap_far_smaller_than_a_tab_is_found(reach: float) -> None:
    """0.2 wide and so far over the side of an inlet tab (held), or in front of it (closed)."""
    laminate = good()
    inlet = laminate.inlets[0]
    (x, y), (dx, dy) = inlet.mouth, inlet.direction
    tab = 0.75 + inlet.width / 2

    def aside(along: float, off: float) -> tuple[float, float]:
        return x + along * dx - off * dy, y + along * dy + off * dx

    # Two copies, which no scrap but the first one's is at.
    held = strip(aside(-1.5, tab - reach), aside(-1.5, tab + 4.0), 0.2)
    closing = strip(aside(scrap.AHEAD - reach, 0.0), aside(5.0, 0.0), 0.2)
    for tongue, said in ((held, "bonds to the part of layer 3"), (closing, "closes the inlet")):
        (found,) = scrap.check(
            Measures(with_sheet(laminate, 5, lambda sheet, _, tongue=tongue: sheet | tongue), FEW)
        )
        assert found.measured == 1.0
        assert said in found.message
    # In front of the inlet the tongue leaves a rectangle; the place is on one of its sides, in the
    # middle, and not at a corner.
    sides = [(-reach / 2, 0.1), (-reach / 2, -0.1), (-reach, 0.0), (0.0, 0.0)]
    at = [aside(scrap.AHEAD + along, off) for along, off in sides]
    assert any((found.where.x, found.where.y) == pytest.approx(place, abs=1e-6) for place in at)
    # A mask sheet that reaches between the tongue and the tab keeps them apart.
    shut = with_sheet(laminate, 5, lambda sheet, _: sheet | held)
    cover = strip(aside(-1.5, tab - 1.0), aside(-1.5, tab + 4.0), 1.0)
    (found,) = scrap.check(Measures(with_sheet(shut, 4, lambda sheet, _: sheet | cover), FEW))
    assert found.verdict == "pass"
