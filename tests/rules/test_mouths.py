"""Mouths: what opens past their ends leaks, and what opens into one of them is joined.

A film of 40 x 16 mm with channels to its left edge; scaled, turned and moved.
"""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.region import Region, disc, rectangle, strip, union
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Chamber, Inlet, Laminate
from sbafab.rules import sealing, tube_fit
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.nets import connectivity
from tests.designs import PAPER

FILM = rectangle((-20.0, -8.0), (20.0, 8.0))
PLACES = pytest.mark.parametrize(
    ("scale", "turn", "by"),
    [(1.0, 0.0, (0.0, 0.0)), (0.4, 33.0, (9.0, -4.0)), (3.0, 180.0, (1, 2))],
)


def channel(low: float, high: float) -> Region:
    """A channel to the left edge that opens from one y to another, and a pocket behind it."""
    y = (low + high) / 2
    return strip((-21.0, y), (5.0, y), high - low) | disc(
        (5.0, y), max(1.0, (high - low) / 2 + 0.2)
    )


class Drawn:
    """Laminates of a film, a mask and a film, placed by a scale, a turn and a move."""

    def __init__(self, scale: float, turn: float, by: Point) -> None:
        self.scale, self.turn, self.by = scale, turn, by

    def at(self, x: float, y: float) -> Point:
        u, v = unit(self.turn)
        s, (dx, dy) = self.scale, self.by
        return s * (x * u - y * v) + dx, s * (x * v + y * u) + dy

    def region(self, region: Region) -> Region:
        return region.scaled(self.scale).turned(self.turn).moved(*self.by)

    def laminate(self, voids: Region, mouths: dict[str, tuple[float, float]]) -> Laminate:
        """With a chamber for every mouth: where its middle lies along the edge, and its width."""
        pouch = build(load_design("pouch"))
        film, mask = self.region(FILM), self.region(voids)
        profiles = (film, mask, film)
        layers = tuple(
            replace(layer, profile=profile, pattern=f"P{number % 2}")
            for number, (layer, profile) in enumerate(zip(pouch.layers, profiles, strict=True))
        )
        inlets = tuple(
            Inlet(name, self.at(-20, y), unit(self.turn + 180), self.scale * width, self.scale, 0.3)
            for name, (y, width) in mouths.items()
        )
        chambers = tuple(Chamber(name, (self.at(5, y),)) for name, (y, _) in mouths.items())
        return replace(
            pouch, layers=layers, chambers=chambers, inlets=inlets, bores=(), ports=(), nets=()
        )


def sealed(laminate: Laminate) -> Finding:
    (finding,) = sealing.check(Measures(laminate, PAPER))
    return finding


def with_nets(laminate: Laminate) -> Laminate:
    return replace(laminate, nets=tuple(Net(c.name, (c.name,)) for c in laminate.chambers))


@PLACES
@pytest.mark.parametrize(
    ("low", "high"), [(-6.0, 6.0), (-1.0, 6.0), (-6.0, 1.0), (0.0, 2.0), (0.9, 3.0), (-1.1, 1.1)]
)
def test_an_opening_past_its_mouth_leaks(
    low: float, high: float, scale: float, turn: float, by: Point
) -> None:
    """The mouth goes from -1 to 1."""
    place = Drawn(scale, turn, by)
    laminate = place.laminate(channel(low, high), {"a": (0.0, 2.0)})
    laminate = replace(laminate, chambers=(Chamber("a", (place.at(5, (low + high) / 2),)),))
    words = (
        f"the opening there is {scale * (high - low):.3f} mm wide and reaches "
        f"{scale * (max(high, -low) - 1):.3f} mm past the end of the mouth of a, which is "
        f"{scale * 2:.3f} mm wide"
    )
    leak = sealed(laminate)
    assert (leak.verdict, leak.where.interface) == ("fail", 1)
    assert words in leak.message
    (fault,) = connectivity(with_nets(laminate), PAPER).faults
    assert (fault.kind, fault.nets) == ("leak", ("a",))
    assert words in fault.message
    # It is named on the edge, past the mouth's end.
    x, y = fault.at
    u, v = unit(turn)
    along = ((y - by[1]) * u - (x - by[0]) * v) / scale
    assert low <= along <= high
    assert abs(along) > 1


@PLACES
@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.6, 0.9), (0.2, 1.0)])
def test_an_opening_within_its_mouth_is_sealed(
    low: float, high: float, scale: float, turn: float, by: Point
) -> None:
    place = Drawn(scale, turn, by)
    laminate = place.laminate(channel(low, high), {"a": (0.0, 2.0)})
    laminate = replace(laminate, chambers=(Chamber("a", (place.at(5, (low + high) / 2),)),))
    assert sealed(laminate).verdict == "pass"
    assert connectivity(with_nets(laminate), PAPER).faults == ()


@PLACES
def test_what_opens_into_one_mouth_is_joined(scale: float, turn: float, by: Point) -> None:
    """The mouth goes from -4 to 4, a port's channel opens from 2 to 3.5, another's from 5."""
    place = Drawn(scale, turn, by)
    voids = union([channel(-1.0, 1.0), channel(2.0, 3.5), channel(5.0, 6.5)])
    wide = place.laminate(voids, {"a": (0.0, 8.0), "c": (5.75, 1.5)})
    port = Port("b", 1, 3, place.at(5, 2.75))
    nets = (Net("a", ("a",)), Net("b", ("b",)), Net("c", ("c",)))
    (short,) = connectivity(replace(wide, ports=(port,), nets=nets), PAPER).faults
    assert (short.kind, short.nets, short.interface) == ("short", ("a", "b"), 1)
    assert ": both open into the mouth of a; " in short.message
    assert short.at == pytest.approx(place.at(-20, 2.75), abs=1e-6)
    # In a mouth of its own it is joined to none.
    own = place.laminate(voids, {"a": (0.0, 3.0), "b": (2.75, 2.0), "c": (5.75, 1.5)})
    assert connectivity(with_nets(own), PAPER).faults == ()
    assert sealed(own).verdict == "pass"
    # A mouth that takes in the next one's feeds its pocket.
    foreign = place.laminate(voids, {"a": (0.0, 8.0), "b": (2.75, 2.0), "c": (5.75, 1.5)})
    finding = sealed(foreign)
    assert finding.verdict == "fail"
    assert re.match("the inlet of [ab] feeds a pocket of [ab] at chamber", finding.message)


@PLACES
def test_a_tube_goes_into_one_opening(scale: float, turn: float, by: Point) -> None:
    """Two openings of 3 and 2 mm in one mouth take what goes into the wider one."""
    voids = channel(-3.0, 0.0) | channel(1.0, 3.0)
    laminate = Drawn(scale, turn, by).laminate(voids, {"a": (0.0, 8.0)})
    inlet = replace(laminate.inlets[0], length=0.0)
    finding, *_ = tube_fit.check(Measures(replace(laminate, inlets=(inlet,)), PAPER))
    # Both edges may be cut 0.1 off, and a kerf of 0.1 is not measured.
    assert finding.measured == pytest.approx(3 * scale - 0.3)
