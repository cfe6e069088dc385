"""What rules find in faulty laminates, a row each: the sentence, verdict, value and place."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from string import Formatter
from typing import Any, NamedTuple

import pytest

import sbafab
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc, rectangle, strip
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Laminate, Pin
from sbafab.output.checks import FindingEntry
from sbafab.rules import bond_width, mask_overhang, press_fit
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule
from sbafab.rules.sentences import FAIL, REMEDY, catalogue
from tests.designs import PAPER
from tests.rules.conftest import Build, Change, made

AXIS = (0.0, 0.0)
ONE = ("1dof-5mm", "stack.balloons=3")
LOBED = ("3dof-15mm", "stack.balloons=3")
EARS = (*ONE, 'registration.method="ears"')
FILM = disc(AXIS, 3.25) - disc(AXIS, 0.5)
POCKET = disc(AXIS, 2.5) - disc(AXIS, 0.5)
FILMS = (1, 3, 5, 7, 9, 11)
NEEDED = math.pi / 2 * (0.8 + 0.025)
"""mm: a tube of 0.8 and the strip of 0.025 beside it, opened flat."""
# The axes of two of the three chambers, 4.25 from the lumen's.
FIRST = (4.25, 0.0)
SECOND = (4.25 * math.cos(math.tau / 3), 4.25 * math.sin(math.tau / 3))
BRIDGE = strip(FIRST, SECOND, 0.4) - disc(FIRST, 0.5) - disc(SECOND, 0.5)
ANY: Any = object()


class Row(NamedTuple):
    """A sentence that a rule must say, of which laminate, and with which settings."""

    says: str
    verdict: str
    value: float | None
    where: tuple[Any, ...]
    laminate: Callable[[], Laminate]
    settings: tuple[str, ...] = ()


def of(design: tuple[str, ...], changes: dict[int, Change] | None = None, **fields: Any) -> Any:
    return lambda: made(design, changes or {}, **fields)


def inlet(width: float, y: float = 0.0, end: float = 8.75) -> Any:
    """The bottom balloon with another strip."""
    mask = (disc(AXIS, 2.5) | strip((0.0, y), (end, y), width)) - disc(AXIS, 0.5)
    return of(ONE, {2: mask})


def tooled(holes: Iterable[int], **moved: Point) -> Any:
    """Films with a hole each for a tooling pin."""
    off = {int(name[1:]): place for name, place in moved.items()}
    holed = {i: _holed(off.get(i, (2.0, 2.0))) for i in (*holes, *off)}
    return lambda: made(ONE, holed, pins=(*made(ONE, {}).pins, Pin("tool", (2.0, 2.0), 0.5)))


def _holed(place: Point) -> Change:
    return lambda profile: profile - disc(place, 0.25)


def tube_on(tube: float | None, *cut: Region) -> Any:
    """A balloon without an inlet, and a tube on the cap, from which regions are cut."""

    def laminate() -> Laminate:
        gap, cap = made(ONE, {}).interfaces[-1], made(ONE, {}).layer(11).profile
        for region in cut:
            cap = cap - region
        port = Port("supply", gap.below.index, gap.above.index, AXIS, "hole", tube)
        return made(ONE, {11: cap}, inlets=(), ports=(port,))

    return laminate


def idle_pin() -> Laminate:
    return made(EARS, {}, pins=(*made(EARS, {}).pins, Pin("film3", (30.0, 1.0), 1.5)))


def on_ear(index: int, pin: str, shape: Callable[[Point], Region]) -> Any:
    """Ears with more film in a layer, beside a pin."""

    def laminate() -> Laminate:
        (centre,) = (p.centre for p in made(EARS, {}).pins if p.name == pin)
        return made(EARS, {index: lambda profile: profile | shape(centre)})

    return laminate


def beside_tab(p: Point) -> Region:
    return rectangle((p[0] - 6, p[1] + 0.6), (p[0] + 6, p[1] + 3))


def without_masks() -> Laminate:
    return made(ONE, {}, layers=tuple(layer for layer in made(ONE, {}).layers if not layer.is_mask))


def notched(half: float, low: float, high: float) -> Change:
    return lambda mask: mask - rectangle((low, half), (high, 1.0))


def more(region: Region) -> Change:
    return lambda profile: profile | region


def less(region: Region) -> Change:
    return lambda profile: profile - region


ISLAND = disc((10.0, 2.0), 1.0)
CAP_HOLE = FILM | disc(AXIS, 1.0)
ONE_LAYER = {"layers": made(ONE, {}).layers[:1]}
ROWS = [
    Row(
        "bond-width.narrowest",
        "pass",
        0.7495,
        (2,),
        of(ONE, {4: disc(AXIS, 3.75) - disc(AXIS, 1.2495)}),
    ),
    Row(
        "bond-width.narrowest-fail",
        "fail",
        0.7485,
        (2,),
        of(ONE, {4: disc(AXIS, 3.75) - disc(AXIS, 1.2485)}),
    ),
    Row(
        "bond-width.covered",
        "fail",
        0.0,
        (5, (9, 10, 11), None, None),
        of(ONE, {10: disc(AXIS, 4.0) - disc(AXIS, 0.5)}),
    ),
    # The pocket's circle touches the outline from within: between them the ring ends in cusps.
    Row(
        "bond-width.sharp-fail",
        "fail",
        0.0,
        (3, ANY, 3.25, 0),
        of(ONE, {6: disc((1, 0), 2.25) - disc(AXIS, 0.5)}),
    ),
    Row("bond-width.none", "fail", None, (None,), of(ONE, **ONE_LAYER)),
    Row(
        "mask-overhang.least-fail",
        "fail",
        0.3,
        (4, (7, 8, 9), 0, -3.25),
        of(ONE, {8: disc((0, 0.2), 3.75) - disc(AXIS, 1.25)}),
    ),
    Row(
        "mask-overhang.outside",
        "fail",
        0.0,
        (3, (5, 6, 7), None, None),
        of(ONE, {6: disc((20, 0), 2)}),
    ),
    Row("mask-overhang.none", "pass", None, (None,), without_masks),
    Row("mask-overhang.pinned", "waived", 0.0, (1, (1, 2, 3), 0, 0), of(ONE)),
    Row(
        "mask-overhang.pinned",
        "waived",
        0.0,
        (2, (3, 4, 5), 0, 0),
        of(("3dof-15mm", "stack.balloons=2")),
    ),
    # The wall's bore, no longer the pin's size, bounds the pocket: nothing waives it.
    Row(
        "mask-overhang.least-fail",
        "fail",
        0.0,
        (1,),
        of(
            ONE,
            {3: lambda wall: (wall | disc(AXIS, 1)) - disc(AXIS, 0.6), 2: less(disc(AXIS, 0.6))},
        ),
    ),
    Row("piece-count.whole", "pass", 0.0, (None,), of(ONE)),
    Row("piece-count.fewer", "fail", 1.0, (None, (7,), None, None), of(ONE, {7: Region()})),
    Row(
        "film-limits.finest-fail",
        "fail",
        1.0,
        (None, (2,), 0, 0),
        of(ONE),
        ("laser.least_feature=1.2",),
    ),
    Row(
        "film-limits.lost",
        "fail",
        None,
        (None, (2,)),
        of((*ONE, "bore.diameter=0.95")),
        ("laser.kerf_ptfe=1",),
    ),
    # From the base's bond at -3.25 and the separators at 3.75 to the strip's end at 8.75.
    Row("press-fit.size", "pass", 12.5, (None, (), None), of(ONE)),
    Row(
        "press-fit.size-fail",
        "fail",
        12.5,
        (None,),
        of(ONE),
        ("press.platen_width=12", "press.platen_length=12"),
    ),
    Row(
        "press-fit.size-fail",
        "fail",
        210.0,
        (None, (7,), 10, 3.75),
        of(ONE, {7: rectangle((-200, -1), (10, 1))}),
    ),
    Row(
        "press-fit.size-fail",
        "fail",
        210.0,
        (None, (7,), 8.75, 200),
        of(ONE, {7: rectangle((-1, -10), (1, 200))}),
    ),
    Row("press-fit.tall", "warn", 3.0, (None,), of(ONE), ("rules.validated_balloons=2",)),
    Row("press-fit.unstated", "warn", None, (None,), of(ONE), ("press.minutes_for=[]",)),
    Row("press-fit.stiff", "warn", 20000.0, (None,), of((*ONE, 'films.tpe.modulus="20 GPa"'))),
    Row("registration-nominal.aligned", "pass", 0.0, (None,), of(ONE)),
    Row(
        "registration-nominal.none", "pass", None, (None,), of(ONE, **ONE_LAYER, bores=(), pins=())
    ),
    Row(
        "registration-nominal.off-axis",
        "fail",
        0.05,
        (None, (7,), 0.03, 0.04),
        of(ONE, {7: disc(AXIS, 3.25) - disc((0.03, 0.04), 0.5)}),
    ),
    # A ring loose in a wide bore: of the two circles about the axis the inner one is the bore.
    Row(
        "registration-nominal.off-axis",
        "fail",
        0.02,
        (None, (6,)),
        of(
            ONE,
            {6: (disc(AXIS, 2.5) - disc((-0.2, 0), 1.5)) | (disc(AXIS, 1) - disc((0.02, 0), 0.5))},
        ),
    ),
    Row(
        "registration-nominal.off-outline",
        "fail",
        0.3,
        (None, (9, 11)),
        of(ONE, {11: disc((0, 0.3), 3.25)}),
    ),
    # Every end of the plain outline lies on the other; the nose is seen from the other side only.
    Row(
        "registration-nominal.off-outline",
        "fail",
        (4.25**2 + 0.01) ** 0.5 - 3.25,
        (None, (9, 11)),
        of(ONE, {11: disc(AXIS, 3.25) | rectangle((0, -0.1), (4.25, 0.1))}),
    ),
    Row(
        "registration-nominal.off-pin",
        "fail",
        0.05,
        (None, (7,), 2, 2),
        tooled((1, 3, 5, 9, 11), _7=(2.03, 2.04)),
    ),
    Row("registration-nominal.aligned", "pass", 0.0, (None,), tooled((5, 7, 9))),
    Row("channel-clear.passes", "pass", 1.0, (None, (2,), 0, 0), of(ONE)),
    Row(
        "channel-clear.passes-fail",
        "fail",
        1.8,
        (None, (11,), 0, 0),
        of(LOBED, {11: lambda cap: (cap | disc(AXIS, 1.5)) - disc(AXIS, 0.9)}),
    ),
    # Neither base nor cap has a hole; the topmost mask must have one.
    Row(
        "channel-clear.passes-fail",
        "fail",
        0.0,
        (None, (10,), 0, 0),
        of(ONE, {10: disc(AXIS, 2.5)}),
    ),
    # An island's edge lies 0.4 from the axis: 0.05 aside it and the bores leave 0.45 each.
    Row(
        "channel-clear.passes-fail",
        "fail",
        0.9,
        (None, ANY, -0.05),
        of(ONE, {6: (disc(AXIS, 2.5) - disc(AXIS, 0.9)) | disc((0.6, 0), 0.2)}),
    ),
    # Two circles of 1.0 whose centres stand 0.1 apart: the lens is 0.9 across. A slit's width.
    Row(
        "channel-clear.passes-fail",
        "fail",
        0.9,
        (None,),
        of(
            ONE,
            {
                5: disc(AXIS, 3.25) - disc((0.03, 0.04), 0.5),
                7: disc(AXIS, 3.25) - disc((-0.03, -0.04), 0.5),
            },
        ),
    ),
    Row(
        "channel-clear.passes-fail",
        "fail",
        0.95,
        (None,),
        of(ONE, {7: disc(AXIS, 3.25) - rectangle((-0.45, -0.6), (0.55, 0.6))}),
    ),
    Row(
        "channel-clear.passes-fail",
        "fail",
        0.15,
        (None, (7,)),
        of(
            LOBED,
            {
                7: lambda wall: (
                    (wall | disc(SECOND, 0.6)) - rectangle((4.15, -2), (4.3, 2)).turned(120)
                )
            },
        ),
    ),
    Row("channel-clear.none", "pass", None, (None,), of(ONE, bores=())),
    Row("tube-fit.width", "pass", 1.3, (1, (1, 2, 3), 8.25, 0), of(ONE)),
    Row("tube-fit.width", "pass", 1.4, (1,), of(ONE), ("laser.kerf_ptfe=0.12",)),
    Row("tube-fit.width", "pass", 1.296, (1,), inlet(1.596)),
    # 0.25 off the tab's middle a strip leaves 0.1 too little bond; 0.296 too narrow is worse.
    Row("tube-fit.width-fail", "fail", 1.0, (1,), inlet(1.3, 0.25)),
    Row("tube-fit.bond-fail", "fail", 0.65, (1,), inlet(1.6, 0.1)),
    Row("tube-fit.bond-fail", "fail", 0.15, (1, (1, 2, 3)), inlet(1.6, 0.6)),
    Row("tube-fit.closed-fail", "fail", 0.0, (None, (), 8.25, 0), inlet(1.6, end=7.0)),
    # Moved by 1.62, its end lies 0.82 and more from the inlet's axis, outside the tube's 0.8.
    Row("tube-fit.closed-fail", "fail", 0.0, (None,), inlet(1.6, 1.62)),
    # A slit 2.0 from the axis of an inlet in a wide tab, where 1.6 is looked at, is no side of it.
    Row(
        "tube-fit.width",
        "pass",
        1.3,
        (1,),
        of(
            ONE,
            dict.fromkeys((1, 3), more(rectangle((3, -4), (8.25, 4))))
            | {2: lambda mask: mask | rectangle((4, 2), (7.75, 2.3)) | disc((6, 0.8), 0.1)},
        ),
    ),
    Row("tube-fit.no-inlet", "fail", None, (None,), of(ONE, inlets=())),
    # A hole of 1.0, 0.1 off on each side, and a kerf of up to 0.1.
    Row("tube-fit.covered", "pass", 1.35, (None, (11,), 0, 0), tube_on(1.35, disc(AXIS, 0.5))),
    Row("tube-fit.covered-fail", "fail", 1.25, (None,), tube_on(1.25, disc(AXIS, 0.5))),
    Row(
        "tube-fit.covered",
        "pass",
        1.25,
        (None,),
        tube_on(1.25, disc(AXIS, 0.5)),
        ("laser.kerf_tpe=0.12",),
    ),
    Row("tube-fit.covered-fail", "fail", 1.35, (None,), tube_on(1.35, disc((0.1, 0), 0.5))),
    Row(
        "tube-fit.film-fail",
        "fail",
        0.7,
        (None,),
        tube_on(3.0, disc(AXIS, 0.5), rectangle((1.2, -0.5), (1.5, 0.5))),
    ),
    Row(
        "tube-fit.film",
        "pass",
        0.8,
        (None,),
        tube_on(3.0, disc(AXIS, 0.5), rectangle((1.3, -0.5), (1.5, 0.5))),
    ),
    Row("tube-fit.film", "pass", 2.75, (None,), tube_on(None, disc(AXIS, 0.5))),
    Row("tube-fit.no-hole", "fail", 0.0, (None,), tube_on(3.0)),
    Row("sealing.sealed", "pass", 0.0, (None,), of(LOBED)),
    # Air comes down to the lowest pocket of the second chamber, through its bore.
    Row("sealing.foreign", "fail", 5.0, (1, (1, 2, 3)), of(LOBED, {6: more(BRIDGE)})),
    Row("sealing.foreign", "fail", ANY, (1,), of(LOBED, {2: more(BRIDGE)})),
    Row("sealing.foreign", "fail", 3.0, (1, ANY, 2.875, 0), of(ONE, chambers=())),
    Row(
        "sealing.cut-off",
        "fail",
        4.0,
        (1, ANY, 0, 0),
        of(ONE, {2: POCKET | strip((3.45, 0), (8.75, 0), 1.6)}),
    ),
    Row("sealing.cut-off", "fail", 1.0, (5, ANY, *SECOND), of(LOBED, {9: more(disc(SECOND, 0.6))})),
    Row(
        "sealing.cut-off",
        "fail",
        1.0,
        (5,),
        of(LOBED, {9: lambda wall: wall | disc(FIRST, 0.6) | disc(SECOND, 0.6), 10: more(BRIDGE)}),
    ),
    Row(
        "sealing.cut-off",
        "fail",
        3.0,
        (ANY,),
        of(("1dof-5mm", "stack.balloons=5"), {7: disc(AXIS, 3.25)}),
    ),
    Row(
        "sealing.stray",
        "fail",
        1.0,
        (3, ANY, 2.4, 0.5),
        of(ONE, {6: (disc(AXIS, 1.5) - disc(AXIS, 0.5)) | disc((2.4, 0.5), 0.3)}),
    ),
    Row("sealing.levels", "fail", 1.0, (None, ()), of(ONE, balloons=4)),
    # A hole over a separator, and a separator that leaves no neck ring, leak into the slit.
    Row("sealing.leak", "fail", 1.0, (4, (7, 8, 9)), of(ONE, {7: less(disc((0, 1.7), 0.3))})),
    Row("sealing.leak", "fail", ANY, (4,), of(ONE, {8: disc(AXIS, 3.75) - disc(AXIS, 0.5)})),
    Row(
        "sealing.leak", "fail", 1.0, (3, (5, 6, 7)), of(ONE, {6: more(strip((1, 0), (4, 0), 0.4))})
    ),
    Row(
        "sealing.leak",
        "fail",
        1.0,
        (5, (9, 10, 11), -1.5, 0.5),
        of(ONE, {11: disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)}),
    ),
    Row(
        "sealing.leak",
        "fail",
        1.0,
        (1, ANY, 4.25, 1.5),
        of(LOBED, {1: less(disc((4.25, 1.5), 0.5))}),
    ),
    Row(
        "sealing.leak",
        "fail",
        1.0,
        (2,),
        of(LOBED, {6: more(strip(AXIS, (3, 0), 0.4) - disc(AXIS, 0.9))}),
    ),
    # No inlet feeds the pockets that leak through the cap.
    Row(
        "sealing.leak",
        "fail",
        3.0,
        (5,),
        of(ONE, {2: POCKET, 11: disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)}),
    ),
    Row(
        "sealing.leak",
        "fail",
        1.0,
        (1, ANY, 8.25, 1.3),
        of(ONE, {2: more(strip((0, 1.3), (8.75, 1.3), 0.2))}),
    ),
    Row("sealing.leak-past-mouth", "fail", 1.0, (1, ANY, 8.25), inlet(1.6, 0.6)),
    # The separator covers a whole lobe of the balloon above, cut off from the others.
    Row(
        "sealing.loose",
        "fail",
        1.0,
        (2, (3, 4, 5), 10, 2),
        of(ONE, {5: more(ISLAND), 7: more(ISLAND)}),
    ),
    Row(
        "pin-holes.clear",
        "pass",
        0.0,
        (None,),
        of(("radial-15mm", "inlet.manifold=true", EARS[-1])),
    ),
    Row(
        "pin-holes.clear",
        "pass",
        0.0,
        (None,),
        of(("3dof-15mm", "stack.balloons=2", "chamber.count=6", EARS[-1])),
    ),
    Row("pin-holes.no-pin", "pass", 0.0, (None,), of(("radial-15mm",))),
    # channel-clear tells a blocked bore.
    Row("pin-holes.clear", "pass", 0.0, (None,), of(ONE, {6: disc(AXIS, 2.5)})),
    Row("pin-holes.idle", "fail", 1.0, (None, (), 30, 1), idle_pin),
    Row("pin-holes.no-hole", "fail", ANY, (None, (5,)), on_ear(5, "film1", lambda p: disc(p, 0.8))),
    Row("pin-holes.blocked-laid", "fail", ANY, (None, (3,)), on_ear(3, "strip1", beside_tab)),
    # A hole of 0.94 at worst; pins of 0.6 and 0.99 to m6 are up to 0.608 and 0.998 thick.
    Row(
        "pin-fit.fit",
        "pass",
        0.0,
        (None,),
        of(("1dof-5mm", "bore.pin_diameter=0.6")),
        ("registration.cutting_error=0.01", "registration.pin_error=0.02"),
    ),
    Row(
        "pin-fit.fit",
        "pass",
        0.998 / 0.94 - 1,
        (None,),
        of(("1dof-5mm", "bore.pin_diameter=0.99")),
        ("registration.cutting_error=0.01", "registration.pin_error=0.02"),
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[f"{n}-{row.says}" for n, row in enumerate(ROWS)])
def test_a_rule_says_what_it_found_and_where(row: Row) -> None:
    (rule,) = (rule for rule in RULES if rule.name == row.says.split(".")[0])
    findings = run_rule(rule, Measures(row.laminate(), PAPER.with_(*row.settings)))
    told = [finding for finding in findings if sentence(finding) == row.says]
    assert told, [finding.id for finding in findings]
    found = next((one for one in told if one.where.interface == row.where[0]), told[0])
    assert found.verdict == row.verdict
    assert row.value is ANY or found.measured == pytest.approx(row.value, abs=1e-4)
    place = found.where.interface, found.where.layers, found.where.x, found.where.y
    for here, expected in zip(place, row.where, strict=False):
        assert expected is ANY or here == pytest.approx(expected, abs=1e-3), found
    assert "{" not in found.message
    assert found.message.startswith(found.remedy)


def sentence(finding: Finding) -> str:
    """The id of a finding's sentence; of several faults the first's."""
    first = dict(finding.says.facts).get("first") if finding.id == "sealing.more" else None
    return first.id if first else finding.id


def test_a_finding_in_words(good: Build) -> None:
    """Facts, a sentence within a sentence, a count, a remedy first, a lowered limit, a waiver."""
    off = made(ONE, {10: disc((0.1, 0.0), 2.5) - disc(AXIS, 0.5)})
    settings = "rules.bond_width=0.7", 'rules.waive=["bond-width"]'
    (found,) = run_rule(bond_width.RULE, Measures(off, PAPER.with_(*settings)))
    assert (found.id, found.verdict, found.by_user) == ("bond-width.narrowest-fail", "waived", True)
    assert found.message == (
        "waived by the design: the narrowest bond is 0.650 mm, at chamber interface 5 (layers 9 "
        "and 11), x 2.925, y 0.000; it needs 0.7: raise bond.width, or move the edges on either "
        "side apart there; limits lowered: bond_width 0.7 (paper 0.75)"
    )
    pinned = mask_overhang.check(Measures(good(*ONE), PAPER))[-1]
    assert pinned.message == (
        "the dowel pin chamber1 holds the layers by this opening, so at 3 interfaces the mask may "
        "end 0.000 mm past its edge"
    )
    tall = PAPER.with_("rules.validated_balloons=2")
    _, warning = press_fit.check(Measures(good(*ONE), tall))
    assert warning.remedy == "press a test piece of this height first"
    assert replace(warning, design="tip").message == (
        "tip: press a test piece of this height first: 3 balloons are more than the 2 that have "
        "been built and tested; heat may not reach the middle of the stack"
    )


def test_a_finding_of_another_package_says_its_own_text() -> None:
    failure = Finding("sealing", "fail", 0.0, 2.0, "voids", Place(3, (5, 6, 7)), "two pockets leak")
    rule = Rule("sealing", lambda _: [failure], Explanation("", "", ""))
    waived = PAPER.with_(rules={"waive": ["sealing"]})
    (found,) = run_rule(rule, Measures(None, waived))  # type: ignore[arg-type]
    assert (found.id, found.verdict, found.by_user) == ("sealing", "waived", True)
    assert (found.message, found.remedy) == ("waived by the design: two pockets leak", "")


def test_a_finding_as_a_record_is_rounded() -> None:
    place = Place(3, (5, 6), 1.23456, -2.00004)
    found = Finding("bond-width", "fail", 0.75, 0.123456789, "mm", place, "short")
    assert FindingEntry.of(found) == {
        "rule": "bond-width",
        "verdict": "fail",
        "limit": 0.75,
        "measured": 0.123457,
        "unit": "mm",
        "where": {"interface": 3, "layers": [5, 6], "x": 1.2346, "y": -2.0},
        "message": "short",
    }


def test_every_sentence_is_said_and_filled_from_facts_and_sentences() -> None:
    rooms = (Path(sbafab.__file__).parent / room for room in ("rules", "assemblies"))
    code = "".join(file.read_text("utf-8") for room in rooms for file in room.glob("*.py"))
    strings = {*re.findall(r"[\w-]+(?=[\"'}=])", code)}
    tables = {rule: table["says"] for rule, table in catalogue().items() if "says" in table}
    texts = [text for table in tables.values() for text in table.values()]
    within = {field for text in texts for _, field, _, _ in Formatter().parse(text) if field}
    for rule, table in tables.items():
        for name, text in table.items():
            stem = name.removesuffix(FAIL).removesuffix(REMEDY).removesuffix("-seamed")
            is_said = stem in strings or name in within
            # The quantity of a margin ends a name.
            assert is_said or stem.endswith(("-bond", "-overhang")), f"{rule}.{name}"
            for field in {field for _, field, _, _ in Formatter().parse(text) if field}:
                own = {*table, *tables["words"], "measured", "limit", "at"}
                assert field in own or field in strings, (name, field)
