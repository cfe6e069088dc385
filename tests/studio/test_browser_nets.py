"""Nets in Chromium: coloured through the stack, and a short, an open and their places.

These start a server, its workers and a browser, and so run at length (``long``).
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from sbafab import api
from tests.studio.browsing import BROWSED, Watched, colours, picture

pytestmark = BROWSED
# Two nets, each from a pocket of the lower gap through a hole of the middle film into the upper.
FILE, VIEW = "routed.toml", {"viewport": {"width": 1280, "height": 800}}
DESIGN = """
name = "routed"
family = "drawn"
layers = [
  {role = "base", shape = "film"},
  {role = "chamber-mask", shape = "low", pieces = 2},
  {role = "wall", shape = "middle"},
  {role = "chamber-mask", shape = "high", pieces = 2},
  {role = "cap", shape = "film"},
]
chambers = [
  {name = "left", centres = [[-8, 0]], balloons = [1], mouth = [-20, 0], angle = 180, width = 2},
  {name = "right", centres = [[8, 0]], balloons = [1], mouth = [20, 0], angle = 0, width = 2},
]
ports = [
  {name = "a-end", layers = [3, 5], at = [-8, 8]},
  {name = "b-end", layers = [3, 5], at = [8, 8]},
]

[nets]
a = ["left", "a-end"]
b = ["right", "b-end"]

[shapes]
film = {polygon = [[-20, -14], [20, -14], [20, 14], [-20, 14]]}
pocket-a = {disc = 8, at = [-8, 0]}
pocket-b = {disc = 8, at = [8, 0]}
strip-a = {slot = [[-20.5, 0], [-8, 0]], width = 2}
strip-b = {slot = [[8, 0], [20.5, 0]], width = 2}
link = {slot = [[-8, -2], [8, -2]], width = 1}
low = {union = ["pocket-a", "pocket-b", "strip-a", "strip-b"]}
via-a = {disc = 1, at = [-8, 0]}
via-b = {disc = 1, at = [8, 0]}
middle = {difference = ["film", "via-a", "via-b"]}
way-a = {slot = [[-8, -1.5], [-8, 9.5]], width = 3}
way-b = {slot = [[8, -1.5], [8, 9.5]], width = 3}
high = {union = ["way-a", "way-b"]}
"""
LOW = 'low = {union = ["pocket-a", "pocket-b", "strip-a", "strip-b"'


@pytest.fixture
def nets(tab: Watched, link: str) -> Iterator[Watched]:
    """The routed laminate in the view Nets."""
    tab.load(link)
    tab.ready()
    tab.page.get_by_role("tab", name="Nets").click()
    opened(tab, DESIGN)
    yield tab
    assert tab.complaints == []


def opened(nets: Watched, text: str) -> None:
    nets.page.evaluate("text => studio.open(text)", text)
    nets.until("studio.nets && studio.nets.laminate === studio.laminate && !studio.flight")


def fills(nets: Watched) -> list[tuple[str, str]]:
    """The nets and the fill of every void that is drawn."""
    rows = nets.say(
        "[...document.querySelectorAll('#view-nets .void')].map(e =>"
        " [e.dataset.nets, e.getAttribute('fill')])"
    )
    return [(row[0], row[1]) for row in rows]


def test_nets_are_coloured_through_the_stack(nets: Watched) -> None:
    drawn = fills(nets)
    assert sorted(owner for owner, _ in drawn) == ["a", "a", "b", "b"]
    assert len(set(drawn)) == 2
    assert dict(drawn)["a"] != dict(drawn)["b"]
    # One hole of the middle film a net leads on.
    assert nets.page.locator("#view-nets .via").count() == 2
    # Two ports, and the pockets of two chambers.
    assert nets.page.locator("#view-nets .port").count() == 4
    assert "Voids join what the nets name" in nets.page.locator(".faults").inner_text()
    assert nets.page.locator("#view-nets .fault-place").count() == 0
    stack = picture(nets, "#view-nets .surface")
    assert colours(stack) > 4
    # One net alone: the other is pale.
    nets.page.get_by_role("button", name="b", exact=True).click()
    opacity = "[...document.querySelectorAll('#view-nets .void[data-nets=a]')]" + (
        ".map(e => Number(e.getAttribute('fill-opacity')))"
    )
    assert max(nets.say(opacity)) < 0.3
    nets.page.get_by_role("button", name="Gap 2").click()
    assert len(fills(nets)) == 2
    gap = nets.page.locator("#view-nets svg[role=img]")
    assert "between layers 3 and 5" in (gap.text_content() or "")


def test_a_short_is_striped_marked_and_led_to_from_the_rules(nets: Watched) -> None:
    opened(nets, DESIGN.replace(LOW, LOW + ', "link"'))
    assert {owner for owner, _ in fills(nets)} == {"a b"}
    assert all(fill.startswith("url(#short-") for _, fill in fills(nets))
    assert nets.page.locator("#view-nets .fault-place[data-kind=short]").count() == 1
    nets.ready()
    nets.page.get_by_role("tab", name="Layers").click()
    nets.page.locator(".finding[data-rule=nets][data-verdict=fail]").first.click()
    assert nets.page.locator("#tab-nets").get_attribute("aria-selected") == "true"
    mark = nets.page.locator("#view-nets .fault-place")
    mark.wait_for()
    place = nets.say(
        """(() => { const mark = document.querySelector('#view-nets .fault-place');
        return studio.netMap.eye.at(mark.cx.baseVal.value, mark.cy.baseVal.value); })()"""
    )
    # Within the channel that joins the two: 1 mm wide round y = -2, between the pockets.
    assert place[1] == pytest.approx(-2, abs=0.5)
    assert abs(place[0]) < 8
    box = nets.page.locator("#view-nets .surface").bounding_box()
    spot = mark.bounding_box()
    assert box is not None
    assert spot is not None
    assert box["x"] < spot["x"] < box["x"] + box["width"]
    assert box["y"] < spot["y"] < box["y"] + box["height"]


def test_an_open_is_named_where_the_hole_is_missing(nets: Watched) -> None:
    opened(nets, DESIGN.replace('["film", "via-a", "via-b"]', '["film", "via-a"]'))
    faults = nets.say("studio.nets.faults")
    assert "open" in {fault["kind"] for fault in faults}
    assert all(fault["nets"] in ([], ["b"]) for fault in faults)
    line = nets.page.locator(".faults .finding[data-kind=open]").first
    assert "Open: b" in line.inner_text()
    line.click()
    assert nets.page.locator("#view-nets .fault-place[data-kind=open]").count() >= 1


def test_a_design_without_nets_shows_its_chambers(nets: Watched) -> None:
    opened(nets, api.template("3dof-15mm"))
    names = nets.say("Object.keys(studio.nets.colours)")
    assert names == ["chamber1", "chamber2", "chamber3"]
    # A pocket of each chamber in every balloon, and a neck between each two.
    chambers = [owner for owner, _ in fills(nets) if owner]
    assert {name: chambers.count(name) for name in names} == dict.fromkeys(names, 15 + 14)
    assert "declares no nets" in nets.page.locator(".faults").inner_text()
    opened_text = api.template("aperture")
    nets.page.evaluate("text => studio.open(text)", opened_text)
    nets.until("studio.family === 'assembly'")
    assert not nets.page.get_by_role("tab", name="Nets").is_visible()
