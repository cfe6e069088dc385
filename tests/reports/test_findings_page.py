"""findings.html: what the rules found, and how the hand tells, for whoever designs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.reports.traveller.findings import Inspected, findings_html
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding, Place


def page(*given: str) -> Any:
    design = load_design("1dof-5mm", given)
    laminate, asked = build(design), design
    found = run_deck(laminate, asked)
    one = Inspected(design.name, found, laminate, asked)
    return lxml_html.fromstring(findings_html(design.name, "0" * 64, [one]))


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
    assert "Hand placement decides no limit" in tree.text_content()


def test_words_from_outside_stay_words() -> None:
    hostile = "<script>alert(1)</script>"
    found = Finding("bond-width", "warn", 1.0, None, "mm", Place(), hostile)
    text = findings_html(hostile, "0" * 64, [Inspected(hostile, [found])])
    assert text.count("alert(1)") == text.count("&gt;alert(1)")


def test_no_pin_is_offered_that_the_press_could_not_have_out() -> None:
    """A pin under loose films can neither be pushed from below nor drawn: none is offered."""
    design = load_design("3dof-15mm", ("stack.balloons=2",))
    laminate, asked = build(design), design
    one = Inspected(design.name, run_deck(laminate, asked), laminate, asked)
    text = findings_html(design.name, "0" * 64, [one])
    assert "Remedies" in text
    assert "lumen" not in text[text.index("Remedies") : text.index("Passes")]
