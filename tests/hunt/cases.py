"""Hard cases for booleans and offsets, each drawn from a seed and a number.

Shapes are built edge by edge, not by the booleans under test. Their features are 1 um or more; what
lies between two shapes may be anything from nothing to millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random

from shapely import Polygon

from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Arc, Edge, Line, Point, edge_from_bulge
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium, strip

Pair = tuple[Region, Region]
ANGLES = [0.0, 0.0, 30.0, 45.0, 90.0, 17.3, 211.123]


def size(random: Random, low: float, high: float) -> float:
    """A length spread evenly over the decades."""
    return low * (high / low) ** random.random()


def nudge(random: Random) -> float:
    """Nothing, or 1 pm to 1 um either way."""
    return random.choice([0.0, 1.0, 1.0, -1.0]) * size(random, 1e-9, 1e-3)


def angle(random: Random) -> float:
    return random.choice([*ANGLES, random.uniform(0, 360)])


def segment(width: float, height: float) -> Region:
    """A line ``width`` long along x and the arc over it."""
    bulge = 2 * height / width
    a, b = (-width / 2, 0.0), (width / 2, 0.0)
    return Region((Contour((Line(a, b), edge_from_bulge(b, a, bulge))),))


def digon(width: float, left: float, right: float) -> Region:
    """Two arcs with two common ends: a lens, or a crescent where ``left`` is negative."""
    a, b = (-width / 2, 0.0), (width / 2, 0.0)
    there = edge_from_bulge(a, b, 2 * right / width)
    return Region((Contour((there, edge_from_bulge(b, a, 2 * left / width))),))


def comb(random: Random, teeth: int) -> Region:
    tooth, gap, deep = size(random, 1e-3, 1), size(random, 1e-3, 1), size(random, 0.01, 20)
    points: list[Point] = [(0.0, -1.0), ((teeth * (tooth + gap) - gap), -1.0)]
    for i in reversed(range(teeth)):
        x = i * (tooth + gap)
        points += [(x + tooth, deep), (x, deep)]
        if i:
            points += [(x, 0.0), (x - gap, 0.0)]
    return polygon(points)


def blob(random: Random) -> Region:
    """An outline of lines and arcs round the origin."""
    while True:
        count = random.randint(3, 12)
        turns = sorted(random.uniform(0, math.tau) for _ in range(count))
        points = [(random.uniform(2, 6), t) for t in turns]
        corners = [(round(r * math.cos(t), 3), round(r * math.sin(t), 3)) for r, t in points]
        edges: list[Edge] = [
            edge_from_bulge(a, b, random.choice([0.0, 0.0, 1.0]) * random.uniform(-0.3, 0.4))
            for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
            if a != b
        ]
        contour = Contour(tuple(edges))
        drawn = Polygon(contour.polygon(1e-5))
        # Clear of itself by 1 um.
        if drawn.is_valid and drawn.buffer(-5e-4).geom_type == "Polygon" and contour.area > 0.1:
            return Region((contour,))


def ring(random: Random) -> Region:
    """Two circles, about one centre, 1 um to 1 mm apart."""
    radius = random.choice([1.0, 2.5, 3.25, 7.5])
    gap = size(random, 1e-3, 0.9)
    off = random.uniform(0, 0.5) * (gap - 1e-3)
    return Region((circle((0, 0), radius), circle((off, 0), radius - gap).reversed()))


def plate(random: Random) -> Region:
    """A plate with a chain of holes, each of which touches the next or all but touches it."""
    holes = [circle((0, 0), 1.0)]
    x = 1.0
    for _ in range(random.randint(1, 4)):
        r = random.choice([0.25, 0.5, size(random, 0.01, 1.0)])
        x += r + max(0.0, random.choice([0.0, abs(nudge(random)) + 1e-3]))
        holes.append(circle((x, 0), r))
        x += r
    outline = rectangle((-3, -3), (x + 2, 3)).contours[0]
    return Region((outline, *(hole.reversed() for hole in holes)))


def simple(random: Random) -> Region:
    number = random.choice([0.5, 1.0, 2.0, 3.25, random.uniform(0.2, 5)])
    other = number + random.choice([0.5, 1.5, 4.0, random.uniform(0.2, 5)])
    kind = random.randrange(5)
    if kind == 0:
        return disc((0, 0), number)
    if kind == 1:
        return rectangle((-number, -other), (number, other))
    if kind == 2:
        return stadium((0, 0), 2 * number, 2 * other)
    if kind == 3:
        return strip((0, 0), (other, number), number)
    return Region((circle((0, 0), other), circle((0, 0), number).reversed()))


def sliver(random: Random) -> Region:
    kind = random.randrange(6)
    wide, thin = size(random, 0.1, 44), size(random, 1e-3, 0.4)
    if kind == 0:
        return segment(wide, min(thin, wide / 3))
    if kind == 1:
        return digon(wide, min(thin, wide / 3), min(size(random, 1e-3, 0.4), wide / 3))
    if kind == 2:
        low = size(random, 1e-3, 0.3) * wide / 44
        return digon(wide, low + min(thin, wide / 4), -low)
    if kind == 3:
        return polygon([(0, 0), (wide, 0), (random.uniform(0, wide), thin)])
    if kind == 4:
        return rectangle((0, 0), (wide, thin))
    return horn(random)


def horn(random: Random) -> Region:
    """What lies between a circle and the tangent that touches it: a cusp."""
    r, x = random.uniform(0.5, 8), size(random, 0.2, 1)
    x *= r
    y = r - math.sqrt(r * r - x * x)
    arc = Arc((x, y), (0.0, 0.0), (0.0, r), r, False)
    return Region((Contour((Line((0.0, 0.0), (x, 0.0)), Line((x, 0.0), (x, y)), arc)),))


SHAPES = [simple, simple, blob, sliver, ring, plate, lambda random: comb(random, 4)]


def shape(random: Random) -> Region:
    return random.choice(SHAPES)(random).turned(angle(random))


def shifted(random: Random) -> Pair:
    """A shape, and the same one moved or turned by a hair."""
    a = shape(random)
    b = a.moved(nudge(random), nudge(random))
    return a, b.turned(random.choice([0.0, 0.0, nudge(random)]))


def tangent(random: Random) -> Pair:
    """Two circles that touch, or all but touch, from outside or inside."""
    r = random.choice([1.0, 3.25, random.uniform(0.1, 8)])
    s = random.choice([1.0, 0.5, random.uniform(0.01, 8)])
    gap = nudge(random)
    away = r + s + gap if random.random() < 0.5 else abs(r - s) + gap
    turn = angle(random)
    return disc((0, 0), r), disc((away, 0), s).turned(turn)


def tangent_line(random: Random) -> Pair:
    r = random.choice([1.0, 3.25, random.uniform(0.1, 8)])
    low = random.choice([r, -r]) + nudge(random)
    box = rectangle((random.uniform(-9, -1), low), (random.uniform(1, 9), low + 2.0))
    turn = angle(random)
    return disc((0, 0), r).turned(turn), box.turned(turn)


def concentric(random: Random) -> Pair:
    """Circles or rings 1 nm to 1 um apart."""
    r = random.choice([1.0, 3.25, 7.5])
    gap = size(random, 1e-6, 1e-3) * random.choice([1, -1])
    a, b = disc((0, 0), r), disc((nudge(random) * random.choice([0, 1]), 0), r + gap)
    if random.random() < 0.5:
        a = Region((*a.contours, circle((0, 0), r / 2).reversed()))
    return a, b.turned(angle(random))


def shared(random: Random) -> Pair:
    """Two shapes side by side with an edge in common, or nearly."""
    width, height = random.choice([1.0, 2.0, random.uniform(0.1, 5)]), random.uniform(0.1, 5)
    a = rectangle((-width, 0), (0, height))
    b = rectangle((nudge(random), random.choice([0.0, nudge(random), 0.3 * height])), (2, height))
    if random.random() < 0.4:
        bulge = random.uniform(0.05, 0.9)
        p, q = (0.0, 0.0), (0.0, height)
        a = Region((Contour((Line(q, (-width, height)), Line((-width, height), (-width, 0.0)),
                             Line((-width, 0.0), p), edge_from_bulge(p, q, bulge))),))  # fmt: skip
        far = (height * bulge / 2 + 3.0, 0.0)
        top = (far[0], height)
        b = Region((Contour((edge_from_bulge(q, p, -bulge), Line(p, far), Line(far, top),
                             Line(top, q))),)).moved(nudge(random), nudge(random))  # fmt: skip
    turn = angle(random)
    return a.turned(turn), b.turned(turn)


def through_a_point(random: Random) -> Pair:
    """Circles and straight edges that all pass through the origin, or a hair beside it."""
    from sbafab.geometry.region import union

    parts = []
    for _ in range(random.randint(2, 6)):
        r, turn = random.uniform(0.3, 4), angle(random)
        if random.random() < 0.7:
            part = disc((r, 0), r)
        else:
            part = polygon([(0, 0), (3, -random.uniform(0.1, 2)), (3, random.uniform(0.1, 2))])
        parts.append(part.turned(turn).moved(nudge(random), 0))
    return union(parts[1:]), parts[0]


def combs(random: Random) -> Pair:
    a = comb(random, random.randint(2, 12))
    return a, random.choice([a, comb(random, 5)]).turned(
        random.choice([0.0, 90.0, 180.0, nudge(random), random.uniform(0, 360)])
    ).moved(random.choice([0.0, nudge(random), random.uniform(-1, 1)]), nudge(random))


def holes(random: Random) -> Pair:
    """A plate with touching holes, and a disc in one of them, of its size or nearly."""
    a = plate(random)
    hole = random.choice(a.contours[1:]).circle
    assert hole is not None
    (x, y), r = hole
    b = disc((x + nudge(random), y), max(r + nudge(random), r / 2))
    turn = angle(random)
    return a.turned(turn), b.turned(turn)


def chords(random: Random) -> Pair:
    """A circle, and chords that stand for it, inside or outside, as a file of 9 digits has them."""
    r, sides = random.choice([1.0, 3.25, random.uniform(0.1, 8)]), 4 * random.randint(1, 20)
    step = math.tau / sides
    reach = random.choice([r, r / math.cos(step / 2)])
    turn = random.choice([0.0, step / 2, random.uniform(0, step)])
    x, y = round(random.uniform(-20, 20), 3), round(random.uniform(-20, 20), 3)
    angles = [turn + k * step for k in range(sides)]
    corners = [
        (round(x + reach * math.cos(t), 9), round(y + reach * math.sin(t), 9)) for t in angles
    ]
    round_one = disc((0, 0), r).turned(angle(random)).moved(x, y)
    return random.choice([(polygon(corners), round_one), (round_one, polygon(corners))])


def anyhow(random: Random) -> Pair:
    a, b = shape(random), shape(random)
    return a, b.moved(random.choice([0, 1, 2.5, random.uniform(-3, 3)]), random.uniform(-3, 3))


def ends_meet(random: Random) -> Pair:
    """The corner of one shape on an edge of the other, or a hair beside it."""
    a, b = shape(random), shape(random)
    edge, corner = random.choice(a.edges), random.choice(b.edges).start
    x, y = edge.at(random.choice([0.0, 0.5, random.random()]))
    return a, b.moved(x - corner[0] + nudge(random), y - corner[1] + nudge(random))


PAIRS: dict[str, Callable[[Random], Pair]] = {
    kind.__name__: kind
    for kind in (
        shifted,
        tangent,
        tangent_line,
        concentric,
        shared,
        through_a_point,
        combs,
        holes,
        chords,
        anyhow,
        ends_meet,
    )
}


def kind_of(number: int) -> str:
    return list(PAIRS)[number % len(PAIRS)]


def pair(seed: int, number: int) -> Pair:
    """Two regions for a boolean."""
    return PAIRS[kind_of(number)](Random(f"{seed} {number}"))


def offset_case(seed: int, number: int) -> tuple[Region, float]:
    """A region, and a distance to move its edges by: shrunk if negative."""
    random = Random(f"{seed} offset {number}")
    region = sliver(random) if number % 3 == 0 else shape(random)
    if number % 3 == 1 and number % 2:
        first, second = random.choice(list(PAIRS.values()))(random)
        from sbafab.geometry.region import union

        region = union([first, second])
    distance = random.choice([0.05, 0.1, 0.25, 0.5, 0.75, size(random, 1e-3, 2)])
    return region.turned(angle(random)), distance * random.choice([1, 1, -1])
