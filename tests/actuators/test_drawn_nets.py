"""Ports and nets of drawn layers: keys, what is refused, and faults that nets alone catches."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck
from sbafab.rules.finding import Finding
from tests.designs import PAPER

FEW = PAPER.with_("rules.yield_builds=100")

ROUTED = """
# Two pockets, each fed through a hole of the middle film: one from an inlet, one from a hole.
name = "routed"
family = "drawn"
layers = [
  {role = "base", shape = "film"},
  {role = "chamber-mask", shape = "routes", pieces = 2},
  {role = "wall", shape = "middle"},
  {role = "chamber-mask", shape = "pockets", pieces = 3},
  {role = "cap", shape = "top"},
]
ports = [
  {name = "left", layers = [3, 5], at = [-8, 0]},
  {name = "right", layers = [3, 5], at = [8, 0]},
  {name = "tube", layers = [3, 5], at = [0, 9], kind = "hole"},
]
chambers = [
  {name = "supply", balloons = [1], centres = [[-14, -9]], mouth = [-16, -9], angle = 180},
]

[nets]
a = ["supply", "left"]
b = ["tube", "right"]

[shapes]
film = {polygon = [[-16, -12], [16, -12], [16, 12], [-16, 12]]}
hole-a = {disc = 1, at = [-8, -5]}
hole-b = {disc = 1, at = [8, 5]}
hole-c = {disc = 1, at = [0, 9]}
under-tube = {disc = 0.7, at = [0, 9]}
middle = {difference = ["film", "hole-a", "hole-b", "hole-c"]}
top = {difference = ["film", "under-tube"]}
pad-a = {offset = "hole-a", by = 0.7}
pad-b = {offset = "hole-b", by = 0.7}
pad-c = {offset = "hole-c", by = 0.7}
to-a = {slot = [[-16.5, -9], [-7, -9]], width = 2}
up-a = {slot = [[-8, -9], [-8, -5]], width = 2}
to-b = {slot = [[0, 9], [9, 9]], width = 2}
up-b = {slot = [[8, 9], [8, 5]], width = 2}
routes = {union = ["pad-a", "to-a", "up-a", "pad-b", "to-b", "up-b", "pad-c"]}
left = {stadium = [8, 14], at = [-8, 0]}
right = {stadium = [8, 14], at = [8, 0]}
pockets = {union = ["left", "right", "pad-c"]}
"""


def tables() -> dict[str, Any]:
    return tomllib.loads(ROUTED)


def drawn(folder: Path, data: dict[str, Any]) -> Laminate:
    path = folder / "routed.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return build(load_design(path))


def failures(laminate: Laminate) -> list[Finding]:
    return [finding for finding in run_deck(laminate, FEW) if finding.verdict == "fail"]


def test_a_routed_design_passes_the_deck(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, tables())
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
    data = tables()
    spoil(data)
    failed = failures(drawn(tmp_path, data))
    assert {finding.rule for finding in failed} == {"nets"}
    assert words in failed[0].message
    x, y = failed[0].where.x, failed[0].where.y
    assert x is not None
    assert y is not None
    assert math.dist((x, y), place) <= 1


TWO_BALLOONS = """
# A chamber with a pocket in two balloons, joined by its bore, and another in the upper one.
name = "two"
family = "drawn"
layers = [
  {role = "base", shape = "film"},
  {role = "chamber-mask", shape = "low"},
  {role = "wall", shape = "bored"},
  {role = "chamber-mask", shape = "high", pieces = 2},
  {role = "cap", shape = "film"},
]
chambers = [
  {name = "a", balloons = [1, 2], centres = [[0, 0]], mouth = [-20, 0], angle = 180, width = 2.4},
  {name = "b", balloons = [2], centres = [[10, 0]], mouth = [20, 0], angle = 0, width = 2.4},
]

[nets]
a = ["a"]
b = ["b"]

[bore]
diameter = 2

[shapes]
film = {polygon = [[-20, -8], [20, -8], [20, 8], [-20, 8]]}
bore = {disc = 2}
bored = {difference = ["film", "bore"]}
pocket = {polygon = [[-4, -3], [4, -3], [4, 3], [-4, 3]]}
to-left = {slot = [[0, 0], [-21, 0]], width = 2.4}
to-right = {slot = [[10, 0], [21, 0]], width = 2.4}
low = {union = ["pocket", "to-left"]}
high = {union = ["pocket", "to-right"]}
across = {slot = [[0, 0], [21, 0]], width = 2.4}
foreign = {union = ["pocket", "across"]}
"""


def two_balloons(scale: float, by: Point) -> dict[str, Any]:
    """The chamber of two balloons, all of it so many times as large and moved."""
    data = tomllib.loads(TWO_BALLOONS)

    def placed(p: list[float]) -> list[float]:
        return [scale * p[0] + by[0], scale * p[1] + by[1]]

    for shape in data["shapes"].values():
        shape |= {
            key: [placed(p) for p in shape[key]] for key in shape.keys() & {"polygon", "slot"}
        }
        shape |= {key: scale * shape[key] for key in shape.keys() & {"disc", "width"}}
    data["shapes"]["bore"]["at"] = [*by]
    for chamber in data["chambers"]:
        chamber["centres"] = [placed(p) for p in chamber["centres"]]
        chamber |= {"mouth": placed(chamber["mouth"]), "width": scale * chamber["width"]}
    data["bore"]["diameter"] *= scale
    return data


SCALED = pytest.mark.parametrize(("scale", "by"), [(1.0, (0, 0)), (2.5, (7, -3)), (0.9, (-31, 12))])


@SCALED
def test_a_chamber_lies_in_its_net_in_each_of_its_balloons(
    tmp_path: Path, scale: float, by: Point
) -> None:
    data = two_balloons(scale, by)
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


@SCALED
def test_a_bore_counts_with_nets_too(tmp_path: Path, scale: float, by: Point) -> None:
    """Its hole is 0.3 of what the bore asks for; nets alone would pass it."""
    data = two_balloons(scale, by)
    data["shapes"]["bore"]["disc"] = 0.6 * scale
    (clear,) = failures(drawn(tmp_path, data))
    assert clear.rule == "channel-clear"
    assert clear.measured == pytest.approx(0.6 * scale)
    # Off the chamber's place it is a hole like others.
    data["shapes"]["bore"]["at"][1] += 2 * scale
    assert failures(drawn(tmp_path, data)) == []


def with_member(net: str, member: str) -> Callable[[dict[str, Any]], None]:
    return lambda data: data["nets"][net].append(member)


def port(number: int, **changes: object) -> Callable[[dict[str, Any]], None]:
    return lambda data: data["ports"][number].update(changes)


REFUSED: list[tuple[Callable[[dict[str, Any]], None], str]] = [
    (
        with_member("a", "lft"),
        "nets.a names 'lft', which is no port or chamber; did you mean left?",
    ),
    (with_member("a", "right"), "nets.b names 'right' and so does nets.a; a port belongs to one"),
    (with_member("a", "left"), "nets.a names 'left' twice; a port belongs to one net, once"),
    (port(0, name="supply"), "ports has 'supply', which is the name of another port or chamber"),
    (port(0, layers=[1, 5]), "port left: layers [1, 5] are not two films that lie next to each"),
    (port(2, kind="tube"), "ports.2.kind = 'tube' must be"),
    (port(0, at=[0]), "ports.0.at"),
]


@pytest.mark.parametrize(("spoil", "message"), REFUSED)
def test_a_net_that_cannot_be_is_refused_in_a_sentence(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], message: str
) -> None:
    data = tables()
    spoil(data)
    with pytest.raises(DesignError) as refused:
        drawn(tmp_path, data)
    assert message in str(refused.value)


def test_a_tube_goes_through_an_outer_film(tmp_path: Path) -> None:
    data = tables()
    data["layers"] += [{"role": "chamber-mask", "shape": "left"}, {"role": "cap", "shape": "film"}]
    data["ports"][2]["layers"] = [3, 5]
    data["layers"] = [
        *data["layers"][:1],
        {"role": "chamber-mask", "shape": "left"},
        {"role": "wall", "shape": "film"},
        *data["layers"][1:],
    ]
    for place in data["ports"]:
        place["layers"] = [5, 7]
    with pytest.raises(DesignError, match="is a hole between layers"):
        drawn(tmp_path, data)
