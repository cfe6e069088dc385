"""Raster pictures: what a depth buffer shows, the cut solid, and the inflated actuator as drawn."""

from __future__ import annotations

import math
from dataclasses import replace
from io import BytesIO
from itertools import combinations
from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image, ImageDraw
from shapely.geometry import Polygon

import sbafab
from sbafab.assemblies.shapes import BOUGHT, FILMS, linear
from sbafab.cli import app
from sbafab.errors import DesignError
from sbafab.geometry.region import disc, rectangle
from sbafab.laminate.laminate import Laminate, outline_diameter
from sbafab.meshing.solid import Slab, fuse
from sbafab.models.stack import Stack
from sbafab.reports.canvas import COLOURS, View, rasterize
from sbafab.reports.inflated import InflatedPart, inflated, pressed
from sbafab.reports.solid_pictures import (
    PictureRequest,
    assembly_pngs,
    cutaway,
    keyhole,
    pictures_at_one_scale,
    pose_of,
    solid_png,
    write_picture,
)

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
CHANGES = ("stack.balloons=4",)
TWO = {"chamber1": 5.0, "chamber2": 5.0}
SMALL = PictureRequest(TWO, width=160, height=128, frames=4)
DOWN = View(np.eye(3), 10.0, (200.0, 150.0))
"""From straight above, 10 pixels a mm."""


def image_of(data: bytes) -> Image.Image:
    return Image.open(BytesIO(data)).convert("RGB")


def test_a_body_covers_its_area_without_gaps_and_hides_what_lies_below() -> None:
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
    sliver = fuse([Slab(rectangle((-15, -0.5), (15, 0.5)), 0, 1)], 0.01)
    bright, dim = (rasterize([sliver], DOWN, 400, 300, lamp) for lamp in ((0, 0, 1), (1, 0, 0)))
    assert (bright.body[146:154, 52:348] == 0).all()
    assert (bright.body[:143] == -1).all()
    assert bright.light.max() == pytest.approx(1)
    assert dim.light.max() < 0.7


@pytest.mark.parametrize("template", ["3dof-15mm", "radial-15mm"])
def test_the_solid_shows_film_cut_film_bonds_and_gaps(template: str) -> None:
    laminate = sbafab.build(template)
    data = solid_png(laminate, 480, 360)
    assert data == solid_png(laminate, 480, 360)
    image = image_of(data)
    assert image.size == (480, 360)
    body = image.crop((0, 0, 480, round(0.88 * 360)))
    colours = {colour: count for count, colour in body.getcolors(1 << 20) or []}
    painted = sum(colours.values()) - colours.get((255, 255, 255), 0)
    assert 0.15 < painted / (body.width * body.height) < 0.9
    assert colours[COLOURS["film"]] > 3000
    assert colours.get(COLOURS["shade"], 0) > 20
    assert all(min(image.getpixel((x, y))) > 250 for x in (0, 479) for y in (0, 359))


@pytest.mark.parametrize(
    ("template", "assignments", "share"),
    [
        ("1dof-5mm", [], 1 / 4),
        ("3dof-15mm", [], 1 / 6),
        ("3dof-15mm", ["chamber.count=2"], 1 / 4),
        ("3dof-15mm", ["chamber.count=8"], 3 / 16),
        # A quarter of one oblong chamber only.
        ("radial-15mm", ["stack.balloons=2"], 1 / 12),
    ],
)
def test_the_cut_takes_its_share_of_a_symmetric_cap(
    template: str, assignments: list[str], share: float
) -> None:
    laminate = sbafab.build(template, *assignments)
    cap = laminate.layers[-1].profile
    left = cap - cutaway(laminate).removed
    assert left.area == pytest.approx((1 - share) * cap.area, rel=1e-6)


@pytest.fixture(scope="module")
def laminate() -> Laminate:
    return sbafab.build("3dof-15mm", *CHANGES)


@pytest.fixture(scope="module")
def stack() -> Stack:
    return sbafab.stack("3dof-15mm", *CHANGES)


def points_of(parts: list[InflatedPart]) -> np.ndarray:
    return np.concatenate([part.surface.points for part in parts])


@pytest.mark.parametrize("pressures", [(5.0, 5.0, 5.0), (5.0, 5.0, 0.0), (3.0, 1.0, 0.0)])
def test_drawn_balloons_hold_the_air_of_their_pose_apart_from_each_other(
    laminate: Laminate, stack: Stack, pressures: tuple[float, ...]
) -> None:
    pose = stack.pose(pressures)
    parts = inflated(laminate, stack, pose)
    for part in parts:
        body = part.surface.manifold()
        assert body.status() == manifold3d.Error.NoError
        if part.chamber is None:
            continue
        # Between its plates a balloon takes its films and masks along: pitch over the pocket.
        films = stack.pitch * math.pi * 2.3**2 * 4
        assert body.volume() - films == pytest.approx(pose.volumes[part.chamber], abs=7.0)
        balloons = body.decompose()
        assert len(balloons) == 4
        for one, other in combinations(balloons, 2):
            assert (one ^ other).volume() < 0.02 * one.volume()
        # The topmost neck lies in the tip's plate.
        across = (part.surface.points - pose.tip) @ pose.frames[1][-1][:, 2]
        assert across.max() == pytest.approx(0.0, abs=0.05)
    if len(set(pressures)) == 1:
        z = points_of(parts)[:, 2]
        assert (z.min(), z.max()) == (pytest.approx(0, abs=0.01), pytest.approx(pose.height, 2e-3))


def test_ears_are_snipped_off_and_tabs_stay() -> None:
    changes = (*CHANGES, "registration.method=ears")
    eared, own = sbafab.build("3dof-15mm", *changes), sbafab.stack("3dof-15mm", *changes)
    points = points_of(inflated(eared, own, own.pose((5.0, 5.0, 5.0))))
    # Above the bottom balloon nothing stands out of the circle that the films fit.
    above = points[points[:, 2] > 0.5 * points[:, 2].max()]
    assert np.hypot(*above[:, :2].T).max() <= outline_diameter(eared) / 2 + 0.1
    # Ears would reach beyond the tabs, whose ends are where the inlets' mouths are.
    mouth = max(math.hypot(*inlet.mouth) for inlet in eared.inlets)
    half = max(inlet.width for inlet in eared.inlets)
    assert mouth - 0.1 <= np.hypot(*points[:, :2].T).max() <= math.hypot(mouth, half) + 0.1


def test_chambers_can_be_given_volumes(laminate: Laminate, stack: Stack) -> None:
    assert pressed(stack, (50.0, 40.0, 40.0)).volumes == pytest.approx([50, 40, 40], rel=2e-3)
    for volumes, words in (
        ((900.0, 0.0, 0.0), r"the volumes 900, 0, 0 ul.*; give less, or .*"),
        ((1e9,) * 3, r"the volumes 1e\+09, .*more than 110 kPa; give less$"),
        # Beyond 1 kPa of suction a film holds exp(-10) of its volume: how far beyond is rounding.
        ((10.0, 0.0, 0.0), r" -[12]\.\d+, -[12]\.\d+ kPa; give volumes that lie nearer together$"),
        ((0.01,) * 3, "give more$"),
    ):
        with pytest.raises(DesignError, match=words):
            pressed(stack, volumes)
    with pytest.raises(DesignError, match=r"empty: name chamber2 and chamber3$"):
        pose_of(laminate, stack, PictureRequest({}, {"chamber1": 900.0}))


def test_the_picture_shows_full_chambers_and_is_the_same_again(
    laminate: Laminate, stack: Stack
) -> None:
    pose, flat = stack.pose((5.0, 5.0, 0.0)), stack.pose((0.0,) * 3)
    first, again, unpressed = (
        pictures_at_one_scale([(laminate, stack, shown)], SMALL)[0] for shown in (pose, pose, flat)
    )
    assert first == again
    full, empty = (np.asarray(image_of(data)).astype(int) for data in (first, unpressed))
    assert (full[..., 0] - full[..., 2] > 60).sum() > 200
    assert (empty[..., 0] - empty[..., 2] > 60).sum() == 0


def test_moving_pictures_and_scenes_are_read_by_others(
    laminate: Laminate, stack: Stack, tmp_path: Path
) -> None:
    write_picture(laminate, stack, replace(SMALL, motion="circle"), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as moving:
        assert getattr(moving, "n_frames", 1) == 4
    pose = write_picture(laminate, stack, SMALL, tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb")
    assert isinstance(scene, trimesh.Scene)
    assert set(scene.graph.nodes_geometry) == {"web", "chamber1", "chamber2", "chamber3"}
    # Metres, y up.
    assert scene.bounds[1, 1] * 1000 > pose.height
    with pytest.raises(DesignError, match=r"must end in \.png, \.gif, \.webp or \.glb"):
        write_picture(laminate, stack, SMALL, tmp_path / "a.jpg")


def run(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["picture", *arguments])
    return done.exit_code, " ".join(done.output.split())


def test_the_command_says_what_it_drew_and_refuses_in_a_sentence(tmp_path: Path) -> None:
    asked = ["1dof-5mm", "--set", "stack.balloons=2", "--width", "120"]
    code, said = run(*asked, "--pressure", "5", "--to", str(tmp_path / "a.png"))
    assert code == 0
    assert "5 kPa" in said
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (120, 96)
    for extra, sentence in (
        (["--pressure", "arm=5"], "chamber arm does not exist; the chambers are chamber1"),
        (["--pressure", "5", "--volume", "5"], "give --pressure or --volume, not both"),
        (["--pressure", "400", "--to", str(tmp_path / "b.png")], "burst pressure"),
        (["--to", str(tmp_path / "no" / "a.png")], "no such file or directory"),
        (["--motion", "circle", "--to", "a.png"], "--motion is for an animation"),
    ):
        code, said = run(*asked, *extra)
        assert code != 0
        assert sentence in said


@pytest.mark.parametrize("name", ["oval", "radial-15mm"])
def test_what_no_model_inflates_is_drawn_flat_and_said_to_be(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    design = str(GALLERY / f"{name}.toml") if name == "oval" else name
    flat = [design, "--set", "stack.balloons=1"]
    monkeypatch.chdir(tmp_path)
    for more in (["--width", "160"], ["--to", "shown.glb"]):
        code, said = run(*flat, *more)
        assert code == 0
        assert f"{name} drawn flat, since no model inflates pockets" in said
    with Image.open(f"{name}-flat.png") as image:
        assert image.size == (160, 128)
    mesh = trimesh.load("shown.glb", force="mesh")
    assert isinstance(mesh, trimesh.Trimesh)
    # Metres, and y is up.
    thickness = sbafab.build(design, "stack.balloons=1").thickness
    assert mesh.extents[1] == pytest.approx(thickness / 1000, rel=1e-5)
    code, said = run(*flat, "--to", "other.glb", "--pressure", "5")
    assert (code, "--pressure is for " in said) == (2, True)
    code, said = run(*flat, "--to", "other.webp")
    assert (code, "write a .png or .glb of the flat solid" in said) == (2, True)
    assert not list(Path().glob("other.*"))


def test_every_part_outside_is_seen_in_its_colour() -> None:
    made = sbafab.assemble("brace", "parts.arm.set.stack.balloons=2")
    picture = assembly_pngs(made, width=400, height=300)[0]
    assert picture == assembly_pngs(made, width=400, height=300)[0]
    upper = np.asarray(image_of(picture), dtype=float)[: round(300 * 0.8)].reshape(-1, 3)
    share = upper / np.maximum(upper.max(axis=1, keepdims=True), 1)
    for colour in (BOUGHT["tube"], BOUGHT["cup"], BOUGHT["line"], *FILMS[:2]):
        wanted = np.array(colour) / max(colour)
        assert (np.abs(share - wanted).max(axis=1) < 0.04).sum() > 5, colour
    assert linear((0, 255, 188)) == pytest.approx((0, 1, 0.5029), abs=1e-3)


def test_a_keyhole_encloses_and_paints_a_piece_with_its_holes_open() -> None:
    plate = disc((0.0, 0.0), 10.0) - disc((4.0, 0.0), 1.0) - disc((-4.0, 0.0), 1.0)
    [rings] = (plate - disc((0.0, 0.0), 2.0) - disc((0.0, 6.0), 1.5)).polygons(0.01)
    ring = keyhole(rings)
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    shoelace = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2
    assert shoelace == pytest.approx(Polygon(rings[0], rings[1:]).area, rel=1e-9)
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
    assert image.getpixel((5, 50)) == image.getpixel((95, 50)) == 0
