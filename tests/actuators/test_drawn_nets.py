"""Ports and nets of drawn layers: keys, what is refused, and faults that nets alone catches."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.geometry.edges import Point
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding
from tests.designs import FEW, drawn, tables


def failures(laminate: Laminate) -> list[Finding]:
    return [finding for finding in run_deck(laminate, FEW) if finding.verdict == "fail"]


def test_a_routed_design_passes_the_deck(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, tables("routed"))
    assert laminate.ports[2] == Port("tube", 3, 5, (0.0, 9.0), "hole", 1.016)
    assert laminate.nets == (Net("a", ("supply", "left")), Net("b", ("tube", "right")))
    assert laminate.bores == ()
    assert failures(laminate) == []


def without_hole(data: dict[str, Any]) -> None:
    data["shapes"]["middle"]["difference"].remove("hole-a")


def with_bridge(data: dict[str, Any]) -> None:
    data["shapes"]["bridge"] = {"slot": [[-8, 0], [8, 0]], "width": 2}
    data["shapes"]["pockets"]["union"].append("bridge")
    data["layers"][3]["pieces"] = 2


def with_stub(data: dict[str, Any]) -> None:
    data["shapes"]["stub"] = {"slot": [[-12, -9], [-12, -1]], "width": 2}
    data["shapes"]["routes"]["union"].append("stub")


def with_second_hole(data: dict[str, Any]) -> None:
    data["shapes"]["leak"] = {"disc": 1, "at": [8, -3]}
    data["shapes"]["top"]["difference"].append("leak")


def without_route(data: dict[str, Any]) -> None:
    data["shapes"]["routes"]["union"].remove("up-a")
    data["layers"][1]["pieces"] = 3


def too_narrow(data: dict[str, Any]) -> None:
    data["shapes"]["up-a"]["width"] = 0.25


FAULTS: list[tuple[Callable[[dict[str, Any]], None], str, Point]] = [
    (without_hole, "net a is open: left is not joined to supply; they come nearest at", (-8, -5.5)),
    (with_bridge, "nets a and b are joined at interface 2", (0, 0)),
    (with_stub, "net a has a dead end at interface 1", (-12, -2)),
    (with_second_hole, "net b reaches the outside at layer 5", (8, -3)),
    (without_route, "net a is open: left is not joined to supply; they come nearest", (-8, -7.1)),
    (
        too_narrow,
        "of net a that is hardest to open is drawn 0.250 mm wide, at interface 1",
        (-8, -7.5),
    ),
]


@pytest.mark.parametrize(("spoil", "words", "place"), FAULTS)
def test_nets_alone_catches_it(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], words: str, place: Point
) -> None:
    data = tables("routed")
    spoil(data)
    failed = failures(drawn(tmp_path, data))
    assert {finding.rule for finding in failed} == {"nets"}
    assert words in failed[0].message
    x, y = failed[0].where.x, failed[0].where.y
    assert x is not None
    assert y is not None
    assert math.dist((x, y), place) <= 1


def test_a_chamber_lies_in_its_net_in_each_of_its_balloons(tmp_path: Path) -> None:
    data = tables("two")
    data["layers"][3] = {"role": "chamber-mask", "shape": "foreign"}
    data["layers"][2]["shape"] = "film"
    failed = failures(drawn(tmp_path, data))
    opened, shorted = (finding for finding in failed if finding.rule == "nets")
    assert opened.message.startswith("net a is open: the pocket of a in balloon 2 is not joined to")
    assert shorted.message.startswith("nets a and b are joined at interface 2")
    # With no pocket at all there it is an open alone.
    data["layers"][3]["shape"] = "to-right"
    messages = [f.message for f in failures(drawn(tmp_path, data)) if f.rule == "nets"]
    assert [message.split(" (")[0] for message in messages] == [
        "net a is open: the pocket of a in balloon 2 lies in no void"
    ]


def test_a_bore_counts_with_nets_too(tmp_path: Path) -> None:
    """Its hole is 0.3 of what the bore asks for; nets alone would pass it."""
    data = tables("two")
    data["shapes"]["bore"] = {"disc": 0.6, "at": [0, 0]}
    (clear,) = failures(drawn(tmp_path, data))
    assert clear.rule == "channel-clear"
    assert clear.measured == pytest.approx(0.6)
    # Off the chamber's place it is a hole like others.
    data["shapes"]["bore"]["at"][1] += 2
    assert failures(drawn(tmp_path, data)) == []
