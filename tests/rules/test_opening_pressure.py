"""Opening pressures: at the place of a channel that is hardest to open, whatever lies behind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from random import Random

import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc, rectangle, strip
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Laminate
from sbafab.rules.nets import NarrowPlace, connectivity
from tests.designs import PAPER
from tests.quick import few
from tests.rules.routed import Routes, laminate_of, routed, xy

AS_DRAWN = PAPER.with_("registration.cutting_error=0", "laser.unknown_kerf=0")


def plate(films: Sequence[tuple[float, float]], width: float) -> float:
    """The kPa that lift bonded films, of a thickness and E / (1 - nu^2) each, off a clamped width.

    Timoshenko: d = p w^4 / 384 D with D = E t^3 / 12 (1 - nu^2); the membrane is longer by
    8 d^2 / 3 w^2 and carries p = 8 T d / w^2. Here d is the thickness of the first film.
    """
    total = sum(thickness for thickness, _ in films)
    stiff, lift = max(plane for _, plane in films), films[0][0]
    bending = 384 * stiff * total**3 / 12 * lift / width**4
    return bending + 8 * stiff * total * 8 / 3 * lift**3 / width**4


def stacked(below: Region, middle: Region, above: Region) -> Laminate:
    """Four films of one kind with these voids between them."""
    routes = Routes((9, 3), 3, 1.0, 0.6, 1.6)
    routes.more += [(0, below), (1, middle), (2, above)]
    return laminate_of(routes)


def film_of(laminate: Laminate) -> tuple[float, float]:
    film = laminate.tpe_layers[0].film
    assert film.elastic is not None
    modulus, poisson = film.elastic
    return film.thickness, 1000 * modulus / (1 - poisson**2)


def hardest(laminate: Laminate, at: Point) -> NarrowPlace:
    """The place of the void between the middle films that is hardest to open."""
    gap = laminate.interfaces[1]
    port = Port("p", gap.below.index, gap.above.index, at)
    declared = replace(laminate, ports=(port,), nets=(Net("n", ("p",)),))
    (place,) = (p for p in connectivity(declared, AS_DRAWN).narrow if p.interface == 2)
    return place


@pytest.mark.parametrize("width", [0.3, 0.45, 1.1])
@pytest.mark.parametrize(
    "soft", [(-1.0, 12.0), (12.0, 33.0), (-1.0, 30.0), (3.0, 33.0), (9.0, 14.0)]
)
def test_the_stiff_part_of_a_uniform_channel_is_hardest(
    width: float, soft: tuple[float, float]
) -> None:
    """Two bonded films lie above and below it but between ``soft``, where one of each does."""
    void = strip((0.0, 4.0), (32.0, 4.0), width) | disc((32.0, 4.0), 1.5)
    cover = rectangle((soft[0], 1.0), (soft[1], 7.0))
    laminate = stacked(cover, void, cover)
    film = film_of(laminate)
    place = hardest(laminate, (32.0, 4.0))
    assert place.pressure == pytest.approx(plate([film, film], width), rel=1e-6)
    assert not soft[0] + 1e-3 < place.width.middle[0] < soft[1] - 1e-3
    # Where one side is soft all along, that side lifts.
    half = stacked(cover, void, rectangle((-2.0, 1.0), (34.0, 7.0)))
    assert hardest(half, (32.0, 4.0)).pressure == pytest.approx(plate([film], width), rel=1e-6)
    # Where it is twice as wide in the stiff part it opens there at a 16th.
    for x in (0.0, 31.0):
        if not soft[0] < x < soft[1]:
            wide = void | rectangle((x - 1.0, 4.0 - width), (x + 1.0, 4.0 + width))
            wider = hardest(stacked(cover, wide, cover), (32.0, 4.0))
            assert wider.pressure == pytest.approx(place.pressure, rel=1e-9)


@pytest.mark.parametrize("turn", [0.0, 37.0])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.8])
def test_a_film_bonded_along_one_wall_lifts_by_the_rest(share: float, turn: float) -> None:
    """The soft part of the width, between a wall and the stiffer part, or all at its stiffest."""
    width = 0.6
    void = rectangle((2.0, 4.0), (30.0, 4.0 + width))
    soft = rectangle((-2.0, 4.0 - 1.0), (34.0, 4.0 + share * width))
    nowhere = Region()
    middle = (16.0, 4.0)
    laminate = stacked(soft.turned(turn, middle), void.turned(turn, middle), nowhere)
    film = film_of(laminate)
    upper = plate([film, film], width)
    lower = min(upper, plate([film], share * width))
    place = hardest(laminate, (middle[0], middle[1] + 0.1))
    assert place.pressure == pytest.approx(min(upper, lower), rel=1e-6)


def test_a_bond_in_the_middle_of_a_wide_pocket_is_no_narrow_piece() -> None:
    """Neck rings of 0.75 mm on a pocket of 6 mm: it lifts over all of it, not over 0.75 mm."""
    void = disc((16.0, 4.0), 3.0)
    ring = disc((16.0, 4.0), 1.5) - disc((16.0, 4.0), 0.75)
    apart = rectangle((8.0, 0.0), (24.0, 8.0)) - ring
    laminate = stacked(apart, void, apart)
    film = film_of(laminate)
    most = plate([film, film], 6.0)
    assert hardest(laminate, (14.0, 4.0)).pressure == pytest.approx(most, rel=1e-6)


# Random laminates, held against sections of their channels, sampled on shapely's regions.


def with_films(laminate: Laminate, random: Random) -> Laminate:
    """The laminate with films of other thickness and modulus."""
    layers = []
    for layer in laminate.layers:
        elastic = (random.uniform(0.5, 20.0), random.uniform(0.3, 0.49))
        film = replace(layer.film, thickness=random.uniform(0.02, 0.2), elastic=elastic)
        layers.append(layer if layer.is_mask else replace(layer, film=film))
    return replace(laminate, layers=tuple(layers))


class Stack:
    """Films and bonds of a laminate as shapely has them."""

    def __init__(self, laminate: Laminate) -> None:
        self.films = []
        for layer in laminate.tpe_layers:
            assert layer.film.elastic is not None
            modulus, poisson = layer.film.elastic
            self.films.append((layer.film.thickness, 1000 * modulus / (1 - poisson**2)))
        films = [layer.profile.shapely() for layer in laminate.tpe_layers]
        self.bonds: list[BaseGeometry] = [
            films[n]
            .intersection(films[n + 1])
            .difference(shapely.union_all([mask.profile.shapely() for mask in gap.masks]))
            for n, gap in enumerate(laminate.interfaces)
        ]

    def section(self, gap: int, p: Point, q: Point, samples: int = 200) -> float:
        """The kPa that lift either side over a section."""
        length = math.dist(p, q)
        shares = [(i + 0.5) / samples for i in range(samples)]
        points = shapely.points(
            [(p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])) for t in shares]
        )
        sides = []
        for outward in (range(gap + 1, len(self.bonds)), range(gap - 1, -1, -1)):
            counts = [1] * len(shares)
            bonded = [True] * len(shares)
            for behind in outward:
                inside = shapely.contains(self.bonds[behind], points)
                bonded = [a and bool(b) for a, b in zip(bonded, inside, strict=True)]
                counts = [n + is_on for n, is_on in zip(counts, bonded, strict=True)]
            first = gap + 1 if outward.step > 0 else gap
            films = self.films[first:] if outward.step > 0 else self.films[first::-1]
            loads = [plate(films[: max(counts)], length)]
            for count, run in groupby(counts):
                loads.append(plate(films[:count], length * len(list(run)) / len(shares)))
            sides.append(min(loads))
        return min(sides)


def sections(routes: Routes, stack: Stack) -> Iterator[tuple[int, Point, Point]]:
    """Sections of channels, where bond begins at both walls: gap and both ends."""
    half = routes.width / 2
    for a, b in routes.segments:
        (ax, ay), (bx, by) = xy(a), xy(b)
        bond = stack.bonds[a[0]]
        for i in range(20):
            x, y = ax + (i + 0.5) / 20 * (bx - ax), ay + (i + 0.5) / 20 * (by - ay)
            nx, ny = (0.0, half) if ay == by else (half, 0.0)
            beyond = [shapely.Point(x + s * 1.001 * nx, y + s * 1.001 * ny) for s in (-1, 1)]
            if all(map(bond.contains, beyond)):
                yield a[0], (x - nx, y - ny), (x + nx, y + ny)


@pytest.mark.parametrize("seed", few(range(120), 6, long=30))
def test_no_section_of_a_random_laminate_is_harder_to_open(seed: int) -> None:
    random = Random(seed)
    routes = routed(seed)
    # Pockets over and under channels, in no net, soften parts of them.
    for _ in range(6):
        x, y = random.uniform(0, 24), random.uniform(0, 20)
        level = random.randrange(routes.interfaces)
        pad = rectangle((x, y), (x + random.uniform(1, 8), y + random.uniform(0.3, 5)))
        free = all(
            not (pad & strip(xy(a), xy(b), routes.width + 1)).contours
            for a, b in routes.segments
            if a[0] == level
        )
        routes.more += [(level, pad)] if free else []
    laminate = with_films(laminate_of(routes), random)
    stack = Stack(laminate)
    found = connectivity(laminate, AS_DRAWN)
    assert found.narrow
    worst: dict[int, float] = {}
    for place in found.narrow:
        assert place.pressure is not None
        assert_true(place, stack)
        worst[place.interface] = max(place.pressure, worst.get(place.interface, 0.0))
    for gap, p, q in sections(routes, stack):
        assert stack.section(gap, p, q) <= worst[gap + 1] * 1.05


def assert_true(place: NarrowPlace, stack: Stack) -> None:
    """The place lies between bond at both ends, and opens at what a section by it takes.

    By it, for shapely's arcs are chords, and bonds behind the void may end at the place.
    """
    (x, y), (u, v) = place.width.start, place.width.end
    bond = stack.bonds[place.interface - 1].buffer(-0.005)
    assert shapely.LineString([(x, y), (u, v)]).intersection(bond).length < 0.01
    unit_x, unit_y = (y - v) / place.width.value, (u - x) / place.width.value
    loads = []
    for off in (-2e-3, -1e-5, 1e-5, 2e-3):
        p, q = (x + off * unit_x, y + off * unit_y), (u + off * unit_x, v + off * unit_y)
        loads.append(stack.section(place.interface - 1, p, q, 4000))
    assert place.pressure is not None
    assert 0.98 * min(loads) <= place.pressure <= 1.02 * max(loads)
