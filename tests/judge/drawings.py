"""Random drawings of pockets, as people make them: the file's text, and the polygon it means.

Curves of the polygon are followed in chords of 0.001 mm error or less; y points up.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import ezdxf
import numpy as np
from scipy.interpolate import BSpline
from shapely import Polygon

from tests.judge.reading import bulged

CHORDS = 160
Point = tuple[float, float]


class Drawing(NamedTuple):
    """A drawn pocket: file name, text, and what it means in mm."""

    name: str
    text: str
    pocket: Polygon


def drawing(rng: Random, least: float, most: float) -> Drawing | None:
    """A closed path round (0, 0) that leaves ``least`` free there, if it can; None where not."""
    made = rng.choice(KINDS)(rng, least, most)
    return made if made.pocket.is_valid and made.pocket.area > 0 else None


def _svg(rng: Random, path: str, corners: list[Point]) -> Drawing:
    """As it is, or in a page with a size and a viewBox that scale it."""
    points = [(x, -y) for x, y in corners]
    pocket = Polygon(points)
    if rng.random() < 0.6:
        text = f'<svg xmlns="http://www.w3.org/2000/svg"><path d="{path}"/></svg>'
        return Drawing("pocket.svg", text, pocket)
    scale = rng.choice([0.5, 2.0, 10.0])
    unit, mm = rng.choice([("mm", 1.0), ("cm", 10.0)])
    size = 100.0
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size / mm:g}{unit}" '
        f'height="{size / mm:g}{unit}" viewBox="0 0 {size * scale:g} {size * scale:g}">'
        f'<g transform="scale({scale:g})"><path d="{path}"/></g></svg>'
    )
    return Drawing("pocket.svg", text, pocket)


def _n(*values: float) -> str:
    return " ".join(f"{value:.6f}" for value in values)


def blob(rng: Random, least: float, most: float) -> Drawing:
    """A smooth closed curve of Béziers through points at random distances."""
    count = rng.randint(4, 9)
    mean = rng.uniform(least * 1.1, most)
    wild = rng.choice([0.08, 0.2, 0.35])
    radii = [mean * rng.uniform(1 - wild, 1 + wild) for _ in range(count)]
    start = rng.uniform(0, 2 * math.pi)
    knots = [
        (
            round(r * math.cos(start + 2 * math.pi * i / count), 6),
            round(r * math.sin(start + 2 * math.pi * i / count), 6),
        )
        for i, r in enumerate(radii)
    ]
    path, corners = f"M{_n(*knots[0])}", []
    for i in range(count):
        a, b, c, d = (knots[(i + k) % count] for k in (-1, 0, 1, 2))
        one = (round(b[0] + (c[0] - a[0]) / 6, 6), round(b[1] + (c[1] - a[1]) / 6, 6))
        two = (round(c[0] - (d[0] - b[0]) / 6, 6), round(c[1] - (d[1] - b[1]) / 6, 6))
        path += f" C{_n(*one)} {_n(*two)} {_n(*c)}"
        corners += [_cubic(b, one, two, c, k / CHORDS) for k in range(CHORDS)]
    return _svg(rng, path + " Z", corners)


def _cubic(a: Point, b: Point, c: Point, d: Point, t: float) -> Point:
    u = 1 - t
    wa, wb, wc, wd = u**3, 3 * u * u * t, 3 * u * t * t, t**3
    return (
        wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0],
        wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1],
    )


def slot(rng: Random, least: float, most: float) -> Drawing:
    """A slot with round ends, lying at any angle, off its middle."""
    radius = rng.uniform(least * 1.02, max(most * 0.7, least * 1.1))
    half = rng.uniform(0.2, max(0.4, most - radius))
    angle = rng.uniform(0, math.pi)
    shift = rng.uniform(-0.3, 0.3) * half
    ux, uy = math.cos(angle), math.sin(angle)

    def at(along: float, across: float) -> Point:
        return (
            round(ux * (along + shift) - uy * across, 6),
            round(uy * (along + shift) + ux * across, 6),
        )

    a, b, c, d = at(-half, -radius), at(half, -radius), at(half, radius), at(-half, radius)
    path = (
        f"M{_n(*a)} L{_n(*b)} A{_n(radius, radius)} 0 0 1 {_n(*c)} "
        f"L{_n(*d)} A{_n(radius, radius)} 0 0 1 {_n(*a)} Z"
    )
    corners = [a, *bulged(b, c, 1.0), c, *bulged(d, a, 1.0)]
    return _svg(rng, path, corners)


def star(rng: Random, least: float, most: float) -> Drawing:
    """A star with sharp or cut tips: concave, of straight lines."""
    tips = rng.randint(3, 8)
    inner = rng.uniform(least * 1.05, max(least * 1.1, most * 0.8))
    outer = inner * rng.uniform(1.1, 1.9)
    start = rng.uniform(0, 2 * math.pi)
    corners = []
    for i in range(2 * tips):
        r, angle = (outer if i % 2 else inner), start + math.pi * i / tips
        corners.append((round(r * math.cos(angle), 4), round(r * math.sin(angle), 4)))
    return _straight(rng, corners)


def _straight(rng: Random, corners: list[Point]) -> Drawing:
    if rng.random() < 0.5:
        path = "M" + " L".join(_n(*corner) for corner in corners) + " Z"
        return _svg(rng, path, corners)
    return _dxf(lambda space: space.add_lwpolyline(corners, close=True), corners)


def _dxf(add: Callable[[Any], object], corners: list[Point]) -> Drawing:
    document = ezdxf.new(units=4)
    add(document.modelspace())
    stream = io.StringIO()
    document.write(stream)
    return Drawing("pocket.dxf", stream.getvalue(), Polygon(corners))


def spline(rng: Random, least: float, most: float) -> Drawing:
    """A closed cubic B-spline of a DXF file."""
    count = rng.randint(5, 10)
    mean = rng.uniform(least * 1.3, max(least * 1.4, most * 1.1))
    wild = rng.choice([0.05, 0.2, 0.4])
    start = rng.uniform(0, 2 * math.pi)
    control = [
        (
            mean * rng.uniform(1 - wild, 1 + wild) * math.cos(start + 2 * math.pi * i / count),
            mean * rng.uniform(1 - wild, 1 + wild) * math.sin(start + 2 * math.pi * i / count),
        )
        for i in range(count)
    ]
    wrapped = control + control[:3]
    knots = [float(k) for k in range(len(wrapped) + 4)]
    curve = BSpline(np.array(knots), np.array(wrapped), 3)
    ends = np.linspace(knots[3], knots[len(wrapped)], count * CHORDS, endpoint=False)
    corners = [(float(x), float(y)) for x, y in curve(ends)]

    def add(space: Any) -> None:
        made = space.add_spline(degree=3)
        made.control_points = [(x, y, 0.0) for x, y in wrapped]
        made.knots = knots
        made.closed = False

    return _dxf(add, corners)


def bulges(rng: Random, least: float, most: float) -> Drawing:
    """A polygon whose sides bulge in or out: bones, cushions, lenses."""
    count = rng.randint(2, 7)
    start = rng.uniform(0, 2 * math.pi)
    radius = rng.uniform(least * 1.2, max(least * 1.3, most))
    corners = []
    for i in range(count):
        r, angle = radius * rng.uniform(0.9, 1.1), start + 2 * math.pi * i / count
        low = 0.4 if count < 4 else -0.15
        bulge = rng.choice([0.0, rng.uniform(low, 0.9)]) if count > 3 else rng.uniform(low, 1.0)
        corners.append((r * math.cos(angle), r * math.sin(angle), bulge))
    points = [
        point
        for i, corner in enumerate(corners)
        for point in bulged(corner, corners[(i + 1) % count], corner[2])
    ]
    return _dxf(
        lambda space: space.add_lwpolyline(corners, format="xyb", close=True),
        points,
    )


def ellipse(rng: Random, least: float, most: float) -> Drawing:
    """An ellipse of a DXF file."""
    short = rng.uniform(least * 1.05, max(least * 1.1, most * 0.7))
    long = short * rng.uniform(1.02, 1.8)
    turn = rng.uniform(0, math.pi)
    ux, uy = math.cos(turn), math.sin(turn)
    corners = []
    for k in range(6 * CHORDS):
        t = 2 * math.pi * k / (6 * CHORDS)
        a, b = long * math.cos(t), short * math.sin(t)
        corners.append((ux * a - uy * b, uy * a + ux * b))
    axis = (long * ux, long * uy)
    return _dxf(lambda space: space.add_ellipse((0, 0), axis, short / long), corners)


def corner_piece(rng: Random, least: float, most: float) -> Drawing:
    """An L, T or C of straight lines round the axis: far from convex."""
    w = rng.uniform(least * 1.05, max(least * 1.1, most * 0.6))
    arm = w + rng.uniform(0.5, max(0.6, 1.5 * (most - w)))
    thick = rng.uniform(1.0, 2 * w)
    kind = rng.randint(0, 2)
    if kind == 0:
        corners = [(-w, -w), (arm, -w), (arm, -w + thick), (w, w), (-w, w)]
    elif kind == 1:
        corners = [(-w, -w), (w, -w), (w, w), (arm, w), (arm, w + thick), (-arm, w + thick)]
        corners += [(-arm, w), (-w, w)]
    else:
        corners = [(-w, -arm), (arm, -arm), (arm, -arm + thick), (w, -arm + thick), (w, arm)]
        corners += [(arm, arm), (arm, arm + thick), (-w, arm + thick)]
    turn = rng.choice([0.0, math.pi / 2, math.pi, rng.uniform(0, 6.28)])
    c, s = math.cos(turn), math.sin(turn)
    corners = [(round(c * x - s * y, 5), round(s * x + c * y, 5)) for x, y in corners]
    return _straight(rng, corners)


KINDS = (blob, blob, slot, star, spline, bulges, ellipse, corner_piece)
