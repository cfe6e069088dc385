"""findings.html: what the rules found, and how the hand tells, for whoever designs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.laminate.assembly import assembly, laying_pins
from sbafab.output.settings import limits
from sbafab.reports.traveller.findings import Inspected, findings_html
from sbafab.reports.traveller.hand import at_roughest, on_laying_pins
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding, Place
from sbafab.rules.registration_yield import simulate


def page(*given: str) -> Any:
    design = load_design("1dof-5mm", given)
    laminate, asked = build(design), limits(design)
    found = run_deck(laminate, asked)
    one = Inspected(design.name, found, laminate, asked)
    return lxml_html.fromstring(findings_html(design.name, "0" * 64, "sbafab 1", [one]))


def table(tree: Any, kind: str) -> list[list[str]]:
    rows = tree.findall(f".//table[@class='{kind}']/tbody/tr")
    return [[" ".join(cell.text_content().split()) for cell in row] for row in rows]


def test_a_rougher_hand_has_fewer_good_builds() -> None:
    tree = page("stack.balloons=2")
    rows = table(tree, "hands")
    shifts = [float(row[0].split()[0]) for row in rows]
    shares = [float(row[2].split()[0]) for row in rows]
    assert shifts == sorted(shifts) == [0.04, 0.08, 0.12, 0.16, 0.2]
    assert all(one > other for one, other in pairwise(shares))
    assert [row[3] for row in rows].count("this design's hand") == 1
    words = tree.text_content()
    for help_ in ("underlay.pdf", "--target-yield 0.99", 'registration.method = "ears"'):
        assert help_ in words
    verdicts = [row[1] for row in table(tree, "findings")]
    # What warns stands before what holds.
    assert verdicts == sorted(verdicts, key=lambda verdict: verdict != "warn")
    assert {"warn", "pass"} <= set(verdicts)


def test_with_ears_no_hand_decides() -> None:
    tree = page("stack.balloons=2", 'registration.method="ears"', "rules.yield_builds=100")
    assert table(tree, "hands") == []
    assert "No hand decides a limit" in tree.text_content()


def test_words_from_outside_stay_words() -> None:
    hostile = "<script>alert(1)</script>"
    found = Finding("bond-width", "warn", 1.0, None, "mm", Place(), hostile)
    text = findings_html(hostile, "0" * 64, "sbafab 1", [Inspected(hostile, [found])])
    assert text.count("alert(1)") == text.count("&gt;alert(1)")


def test_the_lumens_pin_is_offered_where_it_passes_every_film() -> None:
    for template, steps in (("3dof-15mm", [2, 4]), ("1dof-5mm", []), ("radial-15mm", [])):
        laminate = build(load_design(template, ("stack.balloons=2",)[: template != "radial-15mm"]))
        found = [step.number for step in assembly(laminate) if laying_pins(laminate, step)]
        assert found == steps
    lobed = load_design("3dof-15mm", ("stack.balloons=2",))
    laminate, asked = build(lobed), limits(lobed)
    on_pin = on_laying_pins(at_roughest(laminate, asked), asked)
    assert on_pin is not None
    by_eye = simulate(laminate, replace(asked, yield_builds=1000)).whole.value
    assert on_pin.share > by_eye + 0.03
