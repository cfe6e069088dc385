"""nets: opens, shorts, leaks, dead ends and stray voids of routed channels, at their place."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sbafab.geometry.region import Region, rectangle, strip, union
from sbafab.laminate.joints import Fold, Net
from sbafab.laminate.laminate import Chamber, Laminate
from sbafab.laminate.netlist import Netlist
from sbafab.rules import sealing
from sbafab.rules.measures import Measures
from sbafab.rules.nets import check, connectivity, netlist_findings
from sbafab.rules.void_axes import Terminal, axis_of, blind_ends
from tests.designs import PAPER
from tests.quick import few
from tests.rules import routed
from tests.rules.conftest import built
from tests.rules.routed import (
    FAULTS,
    cut_through,
    groups_by_raster,
    laminate_of,
    line_of,
    planted,
    straight,
    xy,
)

LIMITS = PAPER.with_("registration.cutting_error=0", "laser.unknown_kerf=0")
"""Channels are cut as they are drawn."""
NEAR = 1.0
"""Furthest in mm that a fault may be named from its place."""


@pytest.mark.parametrize("seed", few(range(300), 12, long=40))
def test_random_laminates_give_no_false_alarm(seed: int) -> None:
    laminate = laminate_of(routed.routed(seed))
    found = connectivity(laminate, LIMITS)
    assert found.faults == ()
    assert set(found.groups) == {frozenset(net.ports) for net in laminate.nets}
    assert groups_by_raster(laminate) == (set(found.groups), set())


@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("seed", few(range(25), 2, long=4))
def test_planted_faults_are_named_at_their_place(kind: str, seed: int) -> None:
    fault = planted(kind, 1000 + seed)
    laminate = laminate_of(fault.routes)
    found = connectivity(laminate, LIMITS)
    named = [
        fault.distance(each.at)
        for each in found.faults
        if each.kind == fault.kind and each.interface in fault.interfaces
    ]
    assert min(named, default=math.inf) <= NEAR
    joined, outlets = groups_by_raster(laminate)
    assert set(found.groups) == joined
    assert bool(outlets) == any(each.kind == "leak" for each in found.faults)


def test_a_cut_channel_is_one_open() -> None:
    findings = check(Measures(laminate_of(cut_through()), LIMITS))
    first = findings[0]
    assert (first.verdict, first.where.interface, first.where.layers) == ("fail", 1, (1, 2, 3))
    assert (first.where.x, first.where.y) == pytest.approx((10.0, 4.0), abs=0.5)
    assert first.message.startswith("net a is open: q is not joined to p; they are nearest at ")
    assert "1.000 mm of bond separates them; join them there" in first.message
    # Each half is a void with a port at its end, and no branch of another.
    assert len(findings) == 2


def test_a_channel_too_narrow_to_open_fails_at_its_neck() -> None:
    routes = straight()
    routes.less += [
        (0, rectangle((9.0, 4.1), (11.0, 5.0))),
        (0, rectangle((9.0, 3.0), (11.0, 3.9))),
    ]
    joined, opening = check(Measures(laminate_of(routes), LIMITS))
    assert joined.verdict == "pass"
    assert (opening.verdict, opening.where.interface) == ("fail", 1)
    assert (opening.where.x, opening.where.y) == pytest.approx((10.0, 4.0), abs=1.0)
    assert "is 0.200 mm wide as drawn" in opening.message
    wider = LIMITS.with_("rules.opening_pressure_kpa=10000")
    assert check(Measures(laminate_of(routes), wider))[1].verdict == "pass"


def test_films_without_a_modulus_are_not_judged() -> None:
    laminate = laminate_of(straight())
    layers = tuple(
        replace(layer, film=replace(layer.film, elastic=None)) for layer in laminate.layers
    )
    joined, opening = check(Measures(replace(laminate, layers=layers), LIMITS))
    assert (joined.verdict, opening.verdict) == ("pass", "warn")
    assert opening.message.startswith("State modulus and poisson of the films")


def test_a_pocket_with_a_port_is_no_dead_end() -> None:
    """Fed in the middle of its long side, with its port off the middle: its halves are 3 times as
    long as wide and hold none.
    """
    routes = straight()
    routes.ports["q"] = (0, 5, 1)
    pouch = rectangle((8.0, -1.0), (22.0, 1.0))
    feed = strip((14.0, 0.0), (14.0, 4.0), 0.5)
    routes.more += [(0, pouch), (0, feed)]
    routes.ports["t"] = (0, 5, 0)
    routes.nets["a"] = ["p", "q", "t"]
    found = connectivity(laminate_of(routes), LIMITS)
    assert found.faults == ()
    # Without its port it is one.
    del routes.ports["t"]
    routes.nets["a"] = ["p", "q"]
    (fault,) = connectivity(laminate_of(routes), LIMITS).faults
    assert fault.kind == "dead-end"


def test_a_port_in_a_bond_is_open_at_its_place() -> None:
    laminate = laminate_of(straight())
    moved = tuple(
        replace(port, at=(2.0, 6.0)) if port.name == "q" else port for port in laminate.ports
    )
    faults = connectivity(replace(laminate, ports=moved), LIMITS).faults
    assert [(fault.kind, fault.at) for fault in faults if fault.kind == "open"] == [
        ("open", (2.0, 6.0))
    ]


def test_laminates_without_nets_get_no_finding() -> None:
    assert check(Measures(built("1dof-5mm", "stack.balloons=3"), LIMITS)) == []


@pytest.mark.parametrize("design", [("1dof-5mm",), ("3dof-15mm",), ("pouch",)])
def test_a_familys_chambers_are_nets(design: tuple[str, ...]) -> None:
    """Each chamber is the net of its inlet and its pockets, and the good ones have no fault."""
    laminate = built(*design, *(("stack.balloons=3",) if design != ("pouch",) else ()))
    nets = tuple(Net(chamber.name, (chamber.name,)) for chamber in laminate.chambers)
    found = connectivity(replace(laminate, nets=nets), LIMITS)
    assert found.faults == ()
    assert set(found.groups) == {frozenset({chamber.name}) for chamber in laminate.chambers}


def pouch_with(laminate: Laminate, mask: Region, **changes: object) -> Laminate:
    layers = list(laminate.layers)
    layers[1] = replace(layers[1], profile=mask, pattern=f"mask-{mask.key}")
    return replace(laminate, layers=tuple(layers), **changes)  # type: ignore[arg-type]


def test_a_fold_is_a_barrier() -> None:
    """A channel along the folded edge of a film does not leak there, and does at any other edge."""
    laminate = laminate_of(straight())
    low_y = laminate.layers[0].profile.bounds[1]
    mask = union([laminate.layers[1].profile, strip((2.0, 4.0), (2.0, low_y), 2.0)])
    open_edge = pouch_with(laminate, mask)
    assert [f.kind for f in connectivity(open_edge, LIMITS).faults] == ["leak"]
    fold = Fold(1, 3, ((-10.0, low_y), (40.0, low_y)))
    folded = connectivity(replace(open_edge, folds=(fold,)), LIMITS)
    assert "leak" not in [f.kind for f in folded.faults]


def test_a_tube_in_a_hole_is_a_port_and_another_hole_leaks() -> None:
    routes = straight()
    routes.ports |= {"r": (1, 0, 2)}
    routes.tubes.append("r")
    laminate = laminate_of(routes)
    assert connectivity(laminate, LIMITS).faults == ()
    routes.holes.append((2, xy((2, 2))))
    (fault,) = connectivity(laminate_of(routes), LIMITS).faults
    assert (fault.kind, fault.interface, fault.layers) == ("leak", None, (5,))
    assert math.dist(fault.at, xy((2, 2))) < 0.01


def test_sealing_leaves_the_voids_to_nets() -> None:
    routes = routed.routed(3)
    laminate = laminate_of(routes)
    (finding,) = sealing.check(Measures(laminate, LIMITS))
    assert (finding.verdict, finding.message) == (
        "pass",
        "no film is loose; the rule nets checks what the voids connect",
    )


def test_a_chamber_of_no_net_must_reach_its_own_pocket() -> None:
    laminate = laminate_of(straight())
    lost = Chamber("lost", ((2.0, 6.0),), (1,))
    faults = connectivity(replace(laminate, chambers=(lost,)), LIMITS).faults
    assert [(fault.kind, fault.nets) for fault in faults] == [("open", ("lost",))]


def test_ends_one_above_the_other_come_before_a_crossing() -> None:
    """Two halves of a net end above each other at x = 16, and cross at x = 8 in a narrow channel:
    the hole was forgotten at the ends.
    """
    ports = {"p": (0, 0, 1), "q": (1, 5, 1)}
    routes = line_of(ports)
    routes.nets["a"] = ["p", "q"]
    routes.nodes |= {(0, x, 1): "a" for x in range(5)} | {(1, 4, 1): "a", (1, 5, 1): "a"}
    routes.segments |= {((0, x, 1), (0, x + 1, 1)): "a" for x in range(4)}
    routes.segments[(1, 4, 1), (1, 5, 1)] = "a"
    ways = ((16, 4), (16, 8)), ((16, 8), (8, 8)), ((8, 8), (8, 0))
    routes.more += [(1, strip(*way, 0.3)) for way in ways]
    faults = connectivity(laminate_of(routes), LIMITS).faults
    (fault,) = [each for each in faults if each.kind == "open"]
    assert math.dist(fault.at, (16, 4)) < NEAR
    assert "layer 3 has no hole;" in fault.message


def test_an_inlet_that_is_cut_off_is_told_from_its_pocket() -> None:
    laminate = built("1dof-5mm", "stack.balloons=3")
    (x, y), (dx, dy) = laminate.inlets[0].mouth, laminate.inlets[0].direction
    middle = (x - 4 * dx, y - 4 * dy)
    ends = [(middle[0] - side * dy, middle[1] + side * dx) for side in (-2, 2)]
    mask = laminate.layer(2)
    assert mask.profile.contains(middle)
    layers = list(laminate.layers)
    layers[1] = replace(mask, profile=mask.profile - strip(*ends, 0.5), pattern="cut")
    nets = (Net("chamber1", ("chamber1",)),)
    cut = replace(laminate, layers=tuple(layers), nets=nets)
    (fault,) = [each for each in connectivity(cut, LIMITS).faults if each.kind == "open"]
    assert fault.message.startswith(
        "net chamber1 is open: the inlet of chamber1 is not joined to the pocket of chamber1 in "
        "balloon 1 and the pocket of chamber1 in balloon 2 and "
    )


def test_a_pocket_with_a_hole_at_its_edge_has_no_port_of_its_own() -> None:
    """A pocket of 14 x 2 mm, fed in the middle of its long side. With its port alone neither half
    is blind; a hole that opens into it, however far to the side, leaves one half without a port.
    """
    pocket = rectangle((0.0, -1.0), (14.0, 1.0)) | strip((7.0, 0.0), (7.0, 5.0), 0.5)
    axis = axis_of(pocket, 0.0)
    ways = [Terminal((12.0, 0.0), 0.0, True), Terminal((7.0, 5.0), 0.5, False)]
    assert blind_ends(axis, ways, 2.0) == []
    (end,) = blind_ends(axis, [*ways, Terminal((7.0, 1.0), 0.6, False)], 2.0)
    assert end.at[0] < 3.0
    # Further up the channel it opens into the channel alone.
    assert blind_ends(axis, [*ways, Terminal((7.0, 2.2), 0.6, False)], 2.0) == []


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("longer", [0, 1])
def test_two_blind_ends_beside_each_other_are_both_named(side: int, longer: int) -> None:
    """A channel between two ports with two branches 0.5 mm wide, 1.5 mm apart, 6 and 4 mm long."""
    lengths = (6.0, 4.0) if longer == 0 else (4.0, 6.0)
    void = strip((0.0, 0.0), (10.0, 0.0), 0.5)
    for x, length in zip((4.0, 5.5), lengths, strict=True):
        void |= strip((x, 0.0), (x, side * length), 0.5)
    ways = [Terminal((0.2, 0.0), 0.0, True), Terminal((9.8, 0.0), 0.0, True)]
    ends = blind_ends(axis_of(void, 0.5), ways, 2.0)
    assert sorted(end.at[0] for end in ends) == pytest.approx([4.0, 5.5], abs=0.2)
    for end in ends:
        assert end.width == pytest.approx(0.5, abs=0.05)
        # From the channel's edge, by half of the way round it.
        assert end.depth == pytest.approx(lengths[end.at[0] > 4.75] - 0.25, abs=0.2)


def test_a_name_that_the_design_lacks_gets_the_nearest_or_what_to_give() -> None:
    netlist = Netlist({"a": ("p", "q"), "b": ("r", "ss"), "c": ("outlet",)})
    findings = netlist_findings(laminate_of(straight()), LIMITS, netlist, "nets.json")
    lacking = [each.message for each in findings if "is not a port" in each.message]
    where = "which is not a port or chamber of the design"
    assert lacking == [
        f"nets.json names ss, {where}; did you mean s?",
        f"nets.json names outlet, {where}; give its layers and its position, or correct it",
    ]
