"""Pictures of assemblies: nearer hides farther, and what is seen has the right size."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from PIL import Image

from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import load_assembly
from sbafab.assemblies.shapes import BOUGHT, FILMS, linear
from sbafab.geometry.region import disc, rectangle
from sbafab.meshing.solid import Slab, fuse
from sbafab.reports.assembly_png import assembly_png
from sbafab.reports.canvas import View, rasterize

DOWN = View(np.eye(3), 10.0, (200.0, 150.0))
"""From straight above, 10 pixels a mm."""


def test_a_body_covers_its_area_and_hides_what_lies_below() -> None:
    plate = fuse([Slab(rectangle((-15, -10), (15, 10)), 0, 1)], 0.01)
    pillar = fuse([Slab(disc((3, 2), 4), 1, 5)], 0.001)
    for order in ([plate, pillar], [pillar, plate]):
        buffer = rasterize(order, DOWN, 400, 300, (0, 0, 1))
        pixels = [int((buffer.body == number).sum()) for number in (0, 1)]
        areas = dict(zip(map(id, order), pixels, strict=True))
        circle = math.pi * 16 * 100
        assert areas[id(pillar)] == pytest.approx(circle, rel=0.03)
        assert areas[id(plate)] == pytest.approx(600 * 100 - circle, rel=0.03)
        # x runs to the right and y up: the pillar stands right of the middle and above it.
        row, column = (int(values.mean()) for values in np.nonzero(buffer.depth > 4.5))
        assert (column, row) == (pytest.approx(230, abs=1), pytest.approx(130, abs=1))


def test_no_pixel_of_a_body_is_missed() -> None:
    sliver = fuse([Slab(rectangle((-15, -0.5), (15, 0.5)), 0, 1)], 0.01)
    body = rasterize([sliver], DOWN, 400, 300, (0, 0, 1)).body
    assert (body[146:154, 52:348] == 0).all()
    assert (body[:143] == -1).all()


def test_light_falls_from_the_lamp() -> None:
    plate = fuse([Slab(rectangle((-5, -5), (5, 5)), 0, 1)], 0.01)
    bright = rasterize([plate], DOWN, 400, 300, (0, 0, 1)).light.max()
    dim = rasterize([plate], DOWN, 400, 300, (1, 0, 0)).light.max()
    assert bright == pytest.approx(1)
    assert dim < 0.7


def test_every_part_outside_is_seen_in_its_colour() -> None:
    made = assemble(load_assembly("brace", ["parts.arm.set.stack.balloons=2"]))
    picture = assembly_png(made, width=400, height=300)
    assert picture == assembly_png(made, width=400, height=300)
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    upper = pixels[: round(300 * 0.8)].reshape(-1, 3)
    share = upper / np.maximum(upper.max(axis=1, keepdims=True), 1)
    for colour in (BOUGHT["tube"], BOUGHT["cup"], BOUGHT["line"], *FILMS[:2]):
        wanted = np.array(colour) / max(colour)
        assert (np.abs(share - wanted).max(axis=1) < 0.04).sum() > 5, colour


def test_colours_of_a_screen_as_light() -> None:
    assert linear((0, 255, 188)) == pytest.approx((0, 1, 0.5029), abs=1e-3)
