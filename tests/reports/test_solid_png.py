"""preview/solid.png: the shaded picture, its cut, and how pieces with holes are painted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO

import pytest
from PIL import Image, ImageDraw
from shapely.geometry import Polygon

from sbafab.actuators import build, load_design
from sbafab.geometry.edges import Point
from sbafab.geometry.region import disc
from sbafab.laminate.laminate import Laminate
from sbafab.reports.canvas import COLOURS, keyhole
from sbafab.reports.solid_png import cutaway, solid_png

SIZE = (480, 360)


def laminate_of(template: str, *assignments: str) -> Laminate:
    return build(load_design(template, assignments))


def picture(laminate: Laminate) -> Image.Image:
    return Image.open(BytesIO(solid_png(laminate, *SIZE))).convert("RGB")


@pytest.mark.parametrize("template", ["1dof-5mm", "3dof-15mm", "radial-15mm"])
def test_the_picture_shows_film_cut_film_bonds_and_gaps(template: str) -> None:
    image = picture(laminate_of(template))
    assert image.size == SIZE
    body = image.crop((0, 0, SIZE[0], round(0.88 * SIZE[1])))
    colours = {colour: count for count, colour in body.getcolors(1 << 20) or []}
    painted = sum(colours.values()) - colours.get((255, 255, 255), 0)
    assert 0.15 < painted / (body.width * body.height) < 0.9
    assert colours[COLOURS["film"]] > 3000
    assert colours.get(COLOURS["shade"], 0) > 20
    corners = [(0, 0), (SIZE[0] - 1, 0), (0, SIZE[1] - 1), (SIZE[0] - 1, SIZE[1] - 1)]
    assert all(min(image.getpixel(corner)) > 250 for corner in corners)


def test_two_runs_give_the_same_bytes() -> None:
    laminate = laminate_of("1dof-5mm")
    again = laminate_of("1dof-5mm")
    assert solid_png(laminate, *SIZE) == solid_png(again, *SIZE)


@pytest.mark.parametrize(
    ("template", "assignments", "share"),
    [
        ("1dof-5mm", [], 1 / 4),
        ("3dof-15mm", [], 1 / 6),
        ("3dof-15mm", ["chamber.count=2"], 1 / 4),
        ("3dof-15mm", ["chamber.count=8"], 3 / 16),
    ],
)
def test_the_cut_takes_its_share_of_a_symmetric_cap(
    template: str, assignments: list[str], share: float
) -> None:
    laminate = laminate_of(template, *assignments)
    cap = laminate.layers[-1].profile
    left = cap - cutaway(laminate).removed
    assert left.area == pytest.approx((1 - share) * cap.area, rel=1e-6)


def test_the_cut_takes_a_quarter_of_one_oblong_chamber_only() -> None:
    laminate = laminate_of("radial-15mm", "stack.balloons=2")
    cap = laminate.layers[-1].profile
    left = cap - cutaway(laminate).removed
    assert left.area == pytest.approx(cap.area * 11 / 12, rel=1e-6)


def shoelace(ring: Sequence[Point]) -> float:
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2


def test_a_keyhole_ring_encloses_the_piece_without_its_holes() -> None:
    plate = disc((0.0, 0.0), 10.0) - disc((4.0, 0.0), 1.0) - disc((-4.0, 0.0), 1.0)
    plate = plate - disc((0.0, 0.0), 2.0) - disc((0.0, 6.0), 1.5)
    [rings] = plate.polygons(0.01)
    expected = Polygon(rings[0], rings[1:]).area
    assert shoelace(keyhole(rings)) == pytest.approx(expected, rel=1e-9)


def test_a_keyhole_is_painted_with_its_holes_open() -> None:
    square = [(10.0, 10.0), (90.0, 10.0), (90.0, 90.0), (10.0, 90.0)]
    holes = [
        [(x + 8 * math.cos(-t), y + 8 * math.sin(-t)) for t in (0.1, 1.7, 3.2, 4.8)]
        for x, y in [(30.0, 50.0), (50.0, 50.0), (70.0, 50.0)]
    ]
    image = Image.new("L", (100, 100))
    ImageDraw.Draw(image).polygon(keyhole([square, *holes]), fill=255)
    # A slit led through another hole would leave a line of film across it.
    assert {image.getpixel((x, y)) for x in (30, 50, 70) for y in range(46, 55)} == {0}
    assert [image.getpixel((x, 30)) for x in (30, 50, 70)] == [255, 255, 255]
    assert image.getpixel((5, 50)) == 0
    assert image.getpixel((95, 50)) == 0
