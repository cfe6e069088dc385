"""findings.html: what the rules found, and how the hand tells, for whoever designs."""

from __future__ import annotations

from itertools import pairwise

from sbafab.folders.build import make_build
from sbafab.reports.traveller.findings import findings_html, other_hands
from sbafab.rules.finding import Finding, Place
from tests.reports.pages import EARS, built


def test_a_rougher_hand_has_fewer_good_builds() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=2")
    hands = other_hands(laminate, design)
    assert [hand.placement for hand in hands] == [0.04, 0.12, 0.16, 0.2]
    assert all(one.share > other.share for one, other in pairwise(hands))
    # What warns stands before what holds; no pin is offered that could not be had out again.
    text = findings_html(design.name, "0" * 64, [make_build(design)])
    assert text.index("<td>warn</td>") < text.index("Remedies") < text.index("<td>pass</td>")
    assert "lumen" not in text[text.index("Remedies") : text.index("Passes")]


def test_with_ears_no_hand_decides() -> None:
    design, laminate = built("1dof-5mm", "stack.balloons=2", EARS)
    assert other_hands(laminate, design) == ()


def test_words_from_outside_stay_words() -> None:
    hostile = "<script>alert(1)</script>"
    found = Finding("bond-width", "warn", 1.0, None, "mm", Place(), hostile)
    text = findings_html(hostile, "0" * 64, [], [found])
    assert text.count("alert(1)") == text.count("&gt;alert(1)")
