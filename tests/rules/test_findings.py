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
from sbafab.folders.checks_json import FindingEntry
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc, rectangle, strip
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Laminate, Pin
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
POCKET = disc(AXIS, 2.5) - disc(AXIS, 0.5)
# The axes of two of the three chambers, 4.25 from the lumen's.
FIRST = (4.25, 0.0)
SECOND = (4.25 * math.cos(math.tau / 3), 4.25 * math.sin(math.tau / 3))
BRIDGE = strip(FIRST, SECOND, 0.4) - disc(FIRST, 0.5) - disc(SECOND, 0.5)
ANY: Any = object()


class Row(NamedTuple):
    """A verdict and a rule's sentence that it must say of a laminate, its value and its place."""

    says: str
    value: float | None
    laminate: Callable[[], Laminate]
    where: tuple[Any, ...] = (None,)
    settings: tuple[str, ...] = ()


def of(design: tuple[str, ...], changes: dict[int, Change] | None = None, **fields: Any) -> Any:
    return lambda: made(design, changes or {}, **fields)


def one(changes: dict[int, Change] | None = None, **fields: Any) -> Any:
    return of(ONE, changes, **fields)


def inlet(width: float, y: float = 0.0, end: float = 8.75) -> Any:
    """The bottom balloon with another strip."""
    mask = (disc(AXIS, 2.5) | strip((0.0, y), (end, y), width)) - disc(AXIS, 0.5)
    return one({2: mask})


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


def more(region: Region) -> Change:
    return lambda profile: profile | region


def less(region: Region) -> Change:
    return lambda profile: profile - region


ISLAND = disc((10.0, 2.0), 1.0)
ONE_LAYER = {"layers": made(ONE, {}).layers[:1]}
ROWS: dict[str, list[Row]] = {
    "bond-width": [
        Row("pass narrowest", 0.7495, one({4: disc(AXIS, 3.75) - disc(AXIS, 1.2495)}), (2,)),
        Row("fail narrowest-fail", 0.7485, one({4: disc(AXIS, 3.75) - disc(AXIS, 1.2485)}), (2,)),
        Row(
            "fail covered",
            0.0,
            one({10: disc(AXIS, 4.0) - disc(AXIS, 0.5)}),
            (5, (9, 10, 11), None, None),
        ),
        # The pocket's circle touches the outline from within: between them the ring ends in cusps.
        Row(
            "fail sharp-fail",
            0.0,
            one({6: disc((1, 0), 2.25) - disc(AXIS, 0.5)}),
            (3, ANY, 3.25, 0),
        ),
        Row("fail none", None, one(**ONE_LAYER)),
    ],
    "mask-overhang": [
        Row(
            "fail least-fail",
            0.3,
            one({8: disc((0, 0.2), 3.75) - disc(AXIS, 1.25)}),
            (4, (7, 8, 9), 0, -3.25),
        ),
        Row("fail outside", 0.0, one({6: disc((20, 0), 2)}), (3, (5, 6, 7), None, None)),
        Row("pass none", None, without_masks),
        Row("waived pinned", 0.0, one(), (1, (1, 2, 3), 0, 0)),
        Row("waived pinned", 0.0, of(("3dof-15mm", "stack.balloons=2")), (2, (3, 4, 5), 0, 0)),
        # The wall's bore, no longer the pin's size, bounds the pocket: nothing waives it.
        Row(
            "fail least-fail",
            0.0,
            one(
                {3: lambda wall: (wall | disc(AXIS, 1)) - disc(AXIS, 0.6), 2: less(disc(AXIS, 0.6))}
            ),
            (1,),
        ),
    ],
    "piece-count": [
        Row("pass whole", 0.0, one()),
        Row("fail fewer", 1.0, one({7: Region()}), (None, (7,), None, None)),
    ],
    "film-limits": [
        Row(
            "fail finest-fail",
            1.0,
            one(),
            (None, (2,), 0, 0),
            settings=("laser.least_feature=1.2",),
        ),
        Row(
            "fail lost",
            None,
            of((*ONE, "bore.diameter=0.95")),
            (None, (2,)),
            settings=("laser.kerf_ptfe=1",),
        ),
    ],
    "press-fit": [
        # From the base's bond at -3.25 and the separators at 3.75 to the strip's end at 8.75.
        Row("pass size", 12.5, one(), (None, (), None)),
        Row(
            "fail size-fail",
            12.5,
            one(),
            settings=("press.platen_width=12", "press.platen_length=12"),
        ),
        Row(
            "fail size-fail",
            210.0,
            one({7: rectangle((-200, -1), (10, 1))}),
            (None, (7,), 10, 3.75),
        ),
        Row(
            "fail size-fail",
            210.0,
            one({7: rectangle((-1, -10), (1, 200))}),
            (None, (7,), 8.75, 200),
        ),
        Row("warn tall", 3.0, one(), settings=("rules.validated_balloons=2",)),
        # 3 balloons of two films of 0.038 mm and a mask of 0.5, and 2 separators.
        Row("warn high", 2.728, of((*ONE, "films.ptfe.thickness=0.5"))),
        Row("warn unstated", None, one(), settings=("press.minutes_for=[]",)),
        Row("warn stiff", 20000.0, of((*ONE, 'films.tpe.modulus="20 GPa"'))),
    ],
    "registration-nominal": [
        Row("pass aligned", 0.0, one()),
        Row("pass none", None, one(**ONE_LAYER, bores=(), pins=())),
        Row(
            "fail off-axis",
            0.05,
            one({7: disc(AXIS, 3.25) - disc((0.03, 0.04), 0.5)}),
            (None, (7,), 0.03, 0.04),
        ),
        # A ring loose in a wide bore: of the two circles about the axis the inner one is the bore.
        Row(
            "fail off-axis",
            0.02,
            one({6: disc(AXIS, 2.5) - disc((-0.2, 0), 1.5) | disc(AXIS, 1) - disc((0.02, 0), 0.5)}),
            (None, (6,)),
        ),
        Row("fail off-outline", 0.3, one({11: disc((0, 0.3), 3.25)}), (None, (9, 11))),
        # Every end of the plain outline lies on the other; the nose is seen from the other side.
        Row(
            "fail off-outline",
            (4.25**2 + 0.01) ** 0.5 - 3.25,
            one({11: disc(AXIS, 3.25) | rectangle((0, -0.1), (4.25, 0.1))}),
            (None, (9, 11)),
        ),
        Row("fail off-pin", 0.05, tooled((1, 3, 5, 9, 11), _7=(2.03, 2.04)), (None, (7,), 2, 2)),
        Row("pass aligned", 0.0, tooled((5, 7, 9))),
    ],
    "channel-clear": [
        Row("pass passes", 1.0, one(), (None, (2,), 0, 0)),
        Row(
            "fail passes-fail",
            1.8,
            of(LOBED, {11: lambda cap: (cap | disc(AXIS, 1.5)) - disc(AXIS, 0.9)}),
            (None, (11,), 0, 0),
        ),
        # Neither base nor cap has a hole; the topmost mask must have one.
        Row("fail passes-fail", 0.0, one({10: disc(AXIS, 2.5)}), (None, (10,), 0, 0)),
        # An island's edge lies 0.4 from the axis: 0.05 aside it and the bores leave 0.45 each.
        Row(
            "fail passes-fail",
            0.9,
            one({6: disc(AXIS, 2.5) - disc(AXIS, 0.9) | disc((0.6, 0), 0.2)}),
            (None, ANY, -0.05),
        ),
        # Two circles of 1.0 whose centres stand 0.1 apart: the lens is 0.9 across. A slit's width.
        Row(
            "fail passes-fail",
            0.9,
            one(
                {
                    5: disc(AXIS, 3.25) - disc((0.03, 0.04), 0.5),
                    7: disc(AXIS, 3.25) - disc((-0.03, -0.04), 0.5),
                }
            ),
        ),
        Row(
            "fail passes-fail",
            0.95,
            one({7: disc(AXIS, 3.25) - rectangle((-0.45, -0.6), (0.55, 0.6))}),
        ),
        Row(
            "fail passes-fail",
            0.15,
            of(
                LOBED,
                {
                    7: lambda wall: (
                        (wall | disc(SECOND, 0.6)) - rectangle((4.15, -2), (4.3, 2)).turned(120)
                    )
                },
            ),
            (None, (7,)),
        ),
        Row("pass none", None, one(bores=())),
    ],
    "tube-fit": [
        Row("pass width", 1.3, one(), (1, (1, 2, 3), 8.25, 0)),
        Row("pass width", 1.4, one(), (1,), settings=("laser.kerf_ptfe=0.12",)),
        Row("pass width", 1.296, inlet(1.596), (1,)),
        # 0.25 off the tab's middle a strip leaves 0.1 too little bond; 0.296 too narrow is worse.
        Row("fail width-fail", 1.0, inlet(1.3, 0.25), (1,)),
        Row("fail bond-fail", 0.65, inlet(1.6, 0.1), (1,)),
        Row("fail bond-fail", 0.15, inlet(1.6, 0.6), (1, (1, 2, 3))),
        Row("fail closed-fail", 0.0, inlet(1.6, end=7.0), (None, (), 8.25, 0)),
        # Moved by 1.62, its end lies 0.82 and more from the inlet's axis, outside the tube's 0.8.
        Row("fail closed-fail", 0.0, inlet(1.6, 1.62)),
        # A slit 2.0 from the axis of an inlet in a wide tab, where 1.6 is looked at, is none of it.
        Row(
            "pass width",
            1.3,
            of(
                ONE,
                dict.fromkeys((1, 3), more(rectangle((3, -4), (8.25, 4))))
                | {2: lambda mask: mask | rectangle((4, 2), (7.75, 2.3)) | disc((6, 0.8), 0.1)},
            ),
            (1,),
        ),
        Row("fail no-inlet", None, one(inlets=())),
        # A hole of 1.0, 0.1 off on each side, and a kerf of up to 0.1.
        Row("pass covered", 1.35, tube_on(1.35, disc(AXIS, 0.5)), (None, (11,), 0, 0)),
        Row("fail covered-fail", 1.25, tube_on(1.25, disc(AXIS, 0.5))),
        Row(
            "pass covered", 1.25, tube_on(1.25, disc(AXIS, 0.5)), settings=("laser.kerf_tpe=0.12",)
        ),
        Row("fail covered-fail", 1.35, tube_on(1.35, disc((0.1, 0), 0.5))),
        Row(
            "fail film-fail", 0.7, tube_on(3.0, disc(AXIS, 0.5), rectangle((1.2, -0.5), (1.5, 0.5)))
        ),
        Row("pass film", 0.8, tube_on(3.0, disc(AXIS, 0.5), rectangle((1.3, -0.5), (1.5, 0.5)))),
        Row("pass film", 2.75, tube_on(None, disc(AXIS, 0.5))),
        Row("fail no-hole", 0.0, tube_on(3.0)),
    ],
    "sealing": [
        Row("pass sealed", 0.0, of(LOBED)),
        # Air comes down to the lowest pocket of the second chamber, through its bore.
        Row("fail foreign", 5.0, of(LOBED, {6: more(BRIDGE)}), (1, (1, 2, 3))),
        Row("fail foreign", ANY, of(LOBED, {2: more(BRIDGE)}), (1,)),
        Row("fail foreign", 3.0, one(chambers=()), (1, ANY, 2.875, 0)),
        Row(
            "fail cut-off", 4.0, one({2: POCKET | strip((3.45, 0), (8.75, 0), 1.6)}), (1, ANY, 0, 0)
        ),
        Row("fail cut-off", 1.0, of(LOBED, {9: more(disc(SECOND, 0.6))}), (5, ANY, *SECOND)),
        Row(
            "fail cut-off",
            1.0,
            of(
                LOBED,
                {9: lambda wall: wall | disc(FIRST, 0.6) | disc(SECOND, 0.6), 10: more(BRIDGE)},
            ),
            (5,),
        ),
        Row(
            "fail cut-off", 3.0, of(("1dof-5mm", "stack.balloons=5"), {7: disc(AXIS, 3.25)}), (ANY,)
        ),
        Row(
            "fail stray",
            1.0,
            one({6: disc(AXIS, 1.5) - disc(AXIS, 0.5) | disc((2.4, 0.5), 0.3)}),
            (3, ANY, 2.4, 0.5),
        ),
        Row("fail levels", 1.0, one(balloons=4), (None, ())),
        # A hole over a separator, and a separator that leaves no neck ring, leak into the slit.
        Row("fail leak", 1.0, one({7: less(disc((0, 1.7), 0.3))}), (4, (7, 8, 9))),
        Row("fail leak", ANY, one({8: disc(AXIS, 3.75) - disc(AXIS, 0.5)}), (4,)),
        Row("fail leak", 1.0, one({6: more(strip((1, 0), (4, 0), 0.4))}), (3, (5, 6, 7))),
        Row(
            "fail leak",
            1.0,
            one({11: disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)}),
            (5, (9, 10, 11), -1.5, 0.5),
        ),
        Row("fail leak", 1.0, of(LOBED, {1: less(disc((4.25, 1.5), 0.5))}), (1, ANY, 4.25, 1.5)),
        Row(
            "fail leak", 1.0, of(LOBED, {6: more(strip(AXIS, (3, 0), 0.4) - disc(AXIS, 0.9))}), (2,)
        ),
        # No inlet feeds the pockets that leak through the cap.
        Row(
            "fail leak", 3.0, one({2: POCKET, 11: disc(AXIS, 3.25) - disc((-1.5, 0.5), 0.2)}), (5,)
        ),
        Row(
            "fail leak", 1.0, one({2: more(strip((0, 1.3), (8.75, 1.3), 0.2))}), (1, ANY, 8.25, 1.3)
        ),
        Row("fail leak-past-mouth", 1.0, inlet(1.6, 0.6), (1, ANY, 8.25)),
        # The separator covers a whole lobe of the balloon above, cut off from the others.
        Row("fail loose", 1.0, one({5: more(ISLAND), 7: more(ISLAND)}), (2, (3, 4, 5), 10, 2)),
    ],
    "pin-holes": [
        Row("pass clear", 0.0, of(("radial-15mm", "inlet.manifold=true", EARS[-1]))),
        Row("pass clear", 0.0, of(("3dof-15mm", "stack.balloons=2", "chamber.count=6", EARS[-1]))),
        Row("pass no-pin", 0.0, of(("radial-15mm",))),
        # channel-clear tells a blocked bore.
        Row("pass clear", 0.0, one({6: disc(AXIS, 2.5)})),
        Row("fail idle", 1.0, idle_pin, (None, (), 30, 1)),
        Row("fail no-hole", ANY, on_ear(5, "film1", lambda p: disc(p, 0.8)), (None, (5,))),
        Row("fail blocked-laid", ANY, on_ear(3, "strip1", beside_tab), (None, (3,))),
    ],
}


CASES = [(rule, row) for rule, rows in ROWS.items() for row in rows]


@pytest.mark.parametrize(
    ("name", "row"), CASES, ids=[f"{n}-{name}-{row.says}" for n, (name, row) in enumerate(CASES)]
)
def test_a_rule_says_what_it_found_and_where(name: str, row: Row) -> None:
    verdict, says = row.says.split()
    (rule,) = (rule for rule in RULES if rule.name == name)
    findings = run_rule(rule, Measures(row.laminate(), PAPER.with_(*row.settings)))
    told = [finding for finding in findings if sentence(finding) == f"{name}.{says}"]
    assert told, [finding.id for finding in findings]
    found = next((one for one in told if one.where.interface == row.where[0]), told[0])
    assert found.verdict == verdict
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
        "and 11), x 2.925, y 0.000; it needs 0.7: increase bond.width, or move the edges "
        "apart there; limits lowered: bond_width 0.7 (paper 0.75)"
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
