"""Whole findings of the rules on the laminate as a whole: press, tooling holes, outlines, kerf."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from sbafab.geometry.region import disc, rectangle
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.output.checked import FindingEntry
from sbafab.rules import press_fit, registration_nominal
from sbafab.rules.deck import run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule
from tests.designs import PAPER

AXIS = (0.0, 0.0)
LIMITS = PAPER
ONE = ("1dof-5mm", "stack.balloons=3")
FILM = disc(AXIS, 3.25) - disc(AXIS, 0.5)
Good = Callable[..., Laminate]
Spoil = Callable[..., Laminate]


def only(findings: list[Finding]) -> Finding:
    (finding,) = findings
    return finding


def test_a_laminate_that_lies_on_the_platen(good: Good) -> None:
    # From the base's bond at -3.25 and the separators at 3.75 to the strip's end at 8.75.
    assert press_fit.check(Measures(good(*ONE), LIMITS)) == [
        Finding(
            "press-fit",
            "pass",
            152.4,
            12.5,
            "mm",
            Place(),
            "the laminate measures 12.500 x 7.500 mm and lies within the heated area of "
            "152.4 x 152.4 mm",
        )
    ]


@pytest.mark.parametrize(
    ("low", "high", "size"),
    [
        ((-200.0, -1.0), (10.0, 1.0), "210.000 x 7.500"),
        ((-1.0, -1.0), (206.25, 1.0), "210.000 x 7.500"),
        ((-1.0, -200.0), (1.0, 10.0), "12.500 x 210.000"),
        ((-1.0, -10.0), (1.0, 200.0), "12.500 x 210.000"),
    ],
)
def test_a_layer_that_is_too_large(
    low: tuple[float, float], high: tuple[float, float], size: str, good: Good, spoil: Spoil
) -> None:
    found = only(press_fit.check(Measures(spoil(good(*ONE), 7, rectangle(low, high)), LIMITS)))
    assert (found.verdict, found.limit, found.measured) == ("fail", 152.4, pytest.approx(210.0))
    assert found.where == Place(None, (7,), max(high[0], 8.75), max(high[1], 3.75))
    width, length = size.split(" x ")
    assert found.message == (
        f"the laminate measures {width} x {length} mm and does not fit the heated area of "
        "152.4 x 152.4 mm; make it smaller"
    )


def test_more_balloons_than_were_ever_built(good: Good) -> None:
    _, warning = press_fit.check(
        Measures(good("1dof-5mm", "stack.balloons=3"), PAPER.with_("rules.validated_balloons=2"))
    )
    assert warning == Finding(
        "press-fit",
        "warn",
        2.0,
        3.0,
        "balloons",
        Place(),
        "press a test piece of this height first: 3 balloons are more than the 2 that have been "
        "built and tested; heat may not reach the middle of the stack",
        remedy="press a test piece of this height first",
    )


def test_minutes_that_nobody_stated_have_no_limit(good: Good) -> None:
    """A share of films "<= 0 films" would be no limit that a reader can keep."""
    _, warning = press_fit.check(Measures(good(*ONE), PAPER.with_(press={"minutes_for": []})))
    assert (warning.rule, warning.verdict) == ("press-fit", "warn")
    assert (warning.limit, warning.measured, warning.unit) == (None, None, "")
    assert "nobody stated press minutes for" in warning.message


@pytest.mark.parametrize(("modulus", "is_warned"), [("20 GPa", True), ("900 MPa", False)])
def test_a_film_that_is_no_elastomer_is_told_with_its_modulus(
    modulus: str, is_warned: bool, good: Good
) -> None:
    findings = press_fit.check(Measures(good(*ONE, f'films.tpe.modulus="{modulus}"'), LIMITS))
    warned = [(found.measured, found.unit) for found in findings if found.verdict == "warn"]
    assert warned == ([(20000.0, "MPa")] if is_warned else [])
    assert not is_warned or "films.tpe.modulus = 20000 MPa" in findings[-1].remedy


def test_holes_on_their_axes(good: Good) -> None:
    found = only(registration_nominal.check(Measures(good(*ONE), LIMITS)))
    assert (found.verdict, found.limit, found.unit) == ("pass", 0.001, "mm")
    assert found.measured == pytest.approx(0.0, abs=1e-9)
    assert found.message == "bores are coaxial and outlines congruent to 0.000001 mm"


def test_a_bore_off_its_axis(good: Good, spoil: Spoil) -> None:
    off = disc(AXIS, 3.25) - disc((0.03, 0.04), 0.5)
    assert only(registration_nominal.check(Measures(spoil(good(*ONE), 7, off), LIMITS))) == Finding(
        "registration-nominal",
        "fail",
        0.001,
        pytest.approx(0.05),
        "mm",
        Place(None, (7,), 0.03, 0.04),
        "the hole in layer 7 (007_TPE_wall) misses the axis of the bore of chamber1 by "
        "0.0500 mm, x 0.030, y 0.040; 0.001 is allowed: draw both from the same edge",
    )


def test_a_smaller_hole_in_a_larger_one_decides(good: Good, spoil: Spoil) -> None:
    # A ring loose in a wide bore: of the two circles about the axis the inner one is the bore,
    # though the outer one lies farther off and comes first along x.
    mask = (disc(AXIS, 2.5) - disc((-0.2, 0.0), 1.5)) | (disc(AXIS, 1.0) - disc((0.02, 0.0), 0.5))
    found = only(registration_nominal.check(Measures(spoil(good(*ONE), 6, mask), LIMITS)))
    assert found.measured == pytest.approx(0.02)


def test_outlines_of_one_balloon_that_differ(good: Good, spoil: Spoil) -> None:
    cap = disc((0.0, 0.3), 3.25)
    found = only(registration_nominal.check(Measures(spoil(good(*ONE), 11, cap), LIMITS)))
    assert (found.measured, found.where.layers) == (pytest.approx(0.3), (9, 11))
    assert found.message.startswith(
        "the outlines of layers 9 and 11, one balloon, depart from each other by 0.3000 mm, x 0.000"
    )


def test_an_outline_with_a_nose_departs_by_its_length(good: Good, spoil: Spoil) -> None:
    # Every end of the plain outline lies on the other; the nose is seen from the other side only.
    cap = disc(AXIS, 3.25) | rectangle((0.0, -0.1), (4.25, 0.1))
    found = only(registration_nominal.check(Measures(spoil(good(*ONE), 11, cap), LIMITS)))
    # Its corners: sqrt(4.25^2 + 0.1^2) - 3.25.
    assert found.measured == pytest.approx((4.25**2 + 0.1**2) ** 0.5 - 3.25)


TOOL = Pin("tool", (2.0, 2.0), 0.5)


def tooled(good: Good, spoil: Spoil, holes: dict[int, tuple[float, float]]) -> Laminate:
    """The films (1, 3, 5, 7, 9, 11) with a hole each at the places, for the tooling pin."""
    laminate = good(*ONE)
    for index, place in holes.items():
        laminate = spoil(laminate, index, laminate.layer(index).profile - disc(place, 0.25))
    return replace(laminate, pins=(*laminate.pins, TOOL))


def test_a_tooling_hole_off_its_pin(good: Good, spoil: Spoil) -> None:
    places = dict.fromkeys((1, 3, 5, 7, 9, 11), (2.0, 2.0)) | {7: (2.03, 2.04)}
    assert only(
        registration_nominal.check(Measures(tooled(good, spoil, places), LIMITS))
    ) == Finding(
        "registration-nominal",
        "fail",
        0.001,
        pytest.approx(0.05),
        "mm",
        Place(None, (7,), 2.0, 2.0),
        "layer 7 (007_TPE_wall) misses the pin tool by 0.0500 mm, x 2.000, y 2.000; 0.001 is "
        "allowed: draw both from the same edge",
    )


def test_a_tooling_hole_left_out_is_off_by_the_pins_diameter(good: Good, spoil: Spoil) -> None:
    places = dict.fromkeys((1, 3, 5, 7, 9), (2.0, 2.0))
    found = only(registration_nominal.check(Measures(tooled(good, spoil, places), LIMITS)))
    assert (found.measured, found.where.layers) == (0.5, (11,))


@pytest.mark.parametrize("holed", [(), (5,), (5, 7, 9)])
def test_a_pin_that_half_the_films_lack_is_not_theirs(
    holed: tuple[int, ...], good: Good, spoil: Spoil
) -> None:
    laminate = tooled(good, spoil, dict.fromkeys(holed, (2.0, 2.0)))
    assert only(registration_nominal.check(Measures(laminate, LIMITS))).verdict == "pass"


def test_a_laminate_without_twins_has_nothing_to_register(good: Good) -> None:
    sheet = replace(good(*ONE), layers=good(*ONE).layers[:1], bores=(), pins=())
    assert registration_nominal.check(Measures(sheet, LIMITS)) == [
        Finding(
            "registration-nominal",
            "pass",
            0.001,
            None,
            "mm",
            Place(),
            "no two layers have to lie over each other",
        )
    ]


def test_a_failure_that_the_user_waives_is_marked_as_the_users() -> None:
    failure = Finding("sealing", "fail", 0.0, 2.0, "voids", Place(3, (5, 6, 7)), "two pockets leak")
    rule = Rule("sealing", lambda _: [failure], Explanation("", "", ""))
    waived = PAPER.with_(rules={"waive": ["sealing"]})
    assert run_rule(rule, Measures(None, waived)) == [  # type: ignore[arg-type]
        replace(
            failure,
            verdict="waived",
            by_user=True,
            message="waived by the design: two pockets leak",
        )
    ]


def test_a_finding_as_a_record_is_rounded() -> None:
    found = Finding(
        "bond-width", "fail", 0.75, 0.123456789, "mm", Place(3, (5, 6), 1.23456, -2.00004), "short"
    )
    assert FindingEntry.of(found) == {
        "rule": "bond-width",
        "verdict": "fail",
        "limit": 0.75,
        "measured": 0.123457,
        "unit": "mm",
        "where": {"interface": 3, "layers": [5, 6], "x": 1.2346, "y": -2.0},
        "message": "short",
    }


def test_a_finding_without_value_and_place_as_a_record() -> None:
    record = FindingEntry.of(Finding("tube-fit", "pass", None, None, "mm", Place(), "nothing"))
    assert record["measured"] is None
    assert record["where"] == {"interface": None, "layers": [], "x": None, "y": None}
