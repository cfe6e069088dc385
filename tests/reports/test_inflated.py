"""The inflated actuator as drawn: what it holds, where it stands, and what the pictures show."""

from __future__ import annotations

import math
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image

import sbafab
from sbafab.cli import app
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, outline_diameter
from sbafab.models.stack import Stack
from sbafab.reports.inflated import InflatedPart, inflated, pressed
from sbafab.reports.inflated_picture import PictureRequest, picture_png, pose_of, write_picture

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
CHANGES = ("stack.balloons=4",)
TWO = {"chamber1": 5.0, "chamber2": 5.0}
SMALL = PictureRequest(TWO, width=160, height=128, frames=4)


@pytest.fixture(scope="module")
def laminate() -> Laminate:
    return sbafab.build("3dof-15mm", *CHANGES)


@pytest.fixture(scope="module")
def stack() -> Stack:
    return sbafab.stack("3dof-15mm", *CHANGES)


def solid(part: InflatedPart) -> trimesh.Trimesh:
    return trimesh.Trimesh(part.surface.points, part.surface.faces, process=False)


@pytest.mark.parametrize("pressures", [(5.0, 5.0, 5.0), (5.0, 5.0, 0.0), (3.0, 1.0, 0.0)])
def test_drawn_balloons_hold_the_air_of_their_pose(
    laminate: Laminate, stack: Stack, pressures: tuple[float, ...]
) -> None:
    pose = stack.pose(pressures)
    for part in inflated(laminate, stack, pose):
        body = solid(part)
        assert body.is_watertight
        if part.chamber is None:
            continue
        # Between its plates a balloon takes its films and masks along: pitch over the pocket.
        films = stack.pitch * math.pi * 2.3**2 * 4
        assert body.volume - films == pytest.approx(pose.volumes[part.chamber], abs=7.0)


def test_ears_are_snipped_off_and_tabs_stay() -> None:
    changes = (*CHANGES, "registration.method=ears")
    eared = sbafab.build("3dof-15mm", *changes)
    own = sbafab.stack("3dof-15mm", *changes)
    parts = inflated(eared, own, own.pose((5.0, 5.0, 5.0)))
    points = np.concatenate([part.surface.points for part in parts])
    # Above the bottom balloon nothing stands out of the circle that the films fit.
    above = points[points[:, 2] > 0.5 * points[:, 2].max()]
    assert np.hypot(*above[:, :2].T).max() <= outline_diameter(eared) / 2 + 0.1
    # Ears would reach beyond the tabs, whose ends are where the inlets' mouths are.
    mouth = max(math.hypot(*inlet.mouth) for inlet in eared.inlets)
    half = max(inlet.width for inlet in eared.inlets)
    farthest = np.hypot(*points[:, :2].T).max()
    assert mouth - 0.1 <= farthest <= math.hypot(mouth, half) + 0.1


def test_it_stands_on_its_base_and_ends_at_the_tip(laminate: Laminate, stack: Stack) -> None:
    pose = stack.pose((5.0, 5.0, 5.0))
    parts = inflated(laminate, stack, pose)
    points = np.concatenate([part.surface.points for part in parts])
    assert points[:, 2].min() == pytest.approx(0.0, abs=0.01)
    assert points[:, 2].max() == pytest.approx(pose.height, abs=0.02)
    bent = stack.pose((5.0, 0.0, 0.0))
    axes = bent.frames[1]
    for part in inflated(laminate, stack, bent):
        if part.chamber is not None:
            # The topmost neck lies in the tip's plate.
            across = (part.surface.points - bent.tip) @ axes[-1][:, 2]
            assert across.max() == pytest.approx(0.0, abs=0.05)


def test_films_of_a_chamber_do_not_pass_through_each_other(
    laminate: Laminate, stack: Stack
) -> None:
    import manifold3d

    pose = stack.pose((5.0, 5.0, 0.0))
    chamber = next(part for part in inflated(laminate, stack, pose) if part.chamber == 0)
    balloons = solid(chamber).split()
    assert len(balloons) == 4
    bodies = [
        manifold3d.Manifold(manifold3d.Mesh64(b.vertices, b.faces.astype(np.uint64)))
        for b in balloons
    ]
    for k, one in enumerate(bodies):
        for other in bodies[k + 1 :]:
            assert (one ^ other).volume() < 0.02 * one.volume()


def test_chambers_can_be_given_volumes(stack: Stack) -> None:
    assert pressed(stack, (50.0, 40.0, 40.0)).volumes == pytest.approx([50, 40, 40], rel=2e-3)
    with pytest.raises(DesignError, match="no pressures give the volumes 900, 0, 0 ul"):
        pressed(stack, (900.0, 0.0, 0.0))
    with pytest.raises(DesignError, match=r"no pressures give the volumes 1e\+09, .*; give less$"):
        pressed(stack, (1e9,) * 3)


def test_chambers_that_no_volume_names_are_said_to_be_empty(
    laminate: Laminate, stack: Stack
) -> None:
    with pytest.raises(DesignError, match=r"empty: name chamber2 and chamber3$"):
        pose_of(laminate, stack, PictureRequest({}, {"chamber1": 900.0}))
    every = {f"chamber{number}": 900.0 * (number == 1) for number in (1, 2, 3)}
    with pytest.raises(DesignError, match=r"nearer together$"):
        pose_of(laminate, stack, PictureRequest({}, every))


def test_the_picture_shows_full_chambers_and_is_the_same_again(
    laminate: Laminate, stack: Stack
) -> None:
    pose = stack.pose((5.0, 5.0, 0.0))
    first = picture_png(laminate, stack, pose, SMALL)
    assert picture_png(laminate, stack, pose, SMALL) == first
    image = np.asarray(Image.open(BytesIO(first)).convert("RGB")).astype(int)
    red, _, blue = image.reshape(-1, 3).T
    assert (red - blue > 60).sum() > 200
    flat = np.asarray(
        Image.open(BytesIO(picture_png(laminate, stack, stack.pose((0.0,) * 3), SMALL)))
    ).astype(int)
    assert (flat[..., 0] - flat[..., 2] > 60).sum() == 0
    # No light leaks: the body's outline encloses no paper but the lumen and what lies behind it.
    assert (image.sum(axis=2) < 700).mean() > 0.1


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


def test_the_command_says_what_it_drew_and_refuses_in_a_sentence(tmp_path: Path) -> None:
    run = CliRunner().invoke
    asked = ["picture", "1dof-5mm", "--set", "stack.balloons=2", "--width", "120"]
    done = run(app, [*asked, "--pressure", "5", "--to", str(tmp_path / "a.png")])
    assert done.exit_code == 0, done.output
    assert "5 kPa" in done.output
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (120, 96)
    for extra, said in (
        (["--pressure", "arm=5"], "chamber arm is not there; the chambers are chamber1"),
        (["--pressure", "5", "--volume", "5"], "give --pressure or --volume, not both"),
        (["--to", str(tmp_path / "no" / "a.png")], "cannot be written"),
        (["--motion", "circle", "--to", "a.png"], "--motion is for an animation"),
    ):
        refused = run(app, [*asked, *extra])
        assert refused.exit_code != 0
        assert said in refused.output


@pytest.mark.parametrize("name", ["oval", "radial-15mm"])
def test_what_no_model_inflates_is_drawn_flat_and_said_to_be(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    design = str(GALLERY / f"{name}.toml") if name == "oval" else name
    arguments = ["picture", design, "--set", "stack.balloons=1", "--to"]
    for ending, wide in ((".png", ["--width", "160"]), (".glb", [])):
        path = tmp_path / f"shown{ending}"
        result = CliRunner().invoke(app, [*arguments, str(path), *wide])
        assert result.exit_code == 0, result.output
        assert f"{name} drawn flat, since no model inflates pockets" in result.output
    with Image.open(tmp_path / "shown.png") as image:
        assert image.size == (160, 128)
    # Unnamed, it is named as what it is.
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert CliRunner().invoke(app, [*arguments[:-1], "--width", "160"]).exit_code == 0
    assert [file.name for file in Path().iterdir()] == [f"{name}-flat.png"]
    mesh = trimesh.load(tmp_path / "shown.glb", force="mesh")
    laminate = sbafab.build(design, "stack.balloons=1")
    assert isinstance(mesh, trimesh.Trimesh)
    # Metres, and y is up.
    assert mesh.extents[1] == pytest.approx(laminate.thickness / 1000, rel=1e-5)
    glb = [*arguments, str(tmp_path / "other.glb")]
    for extra in (["--width", "160"], ["--azimuth", "3"], ["--pressure", "5"], ["--volume", "5"]):
        refused = CliRunner().invoke(app, [*glb, *extra])
        assert refused.exit_code == 2
        assert f"{extra[0]} is for " in refused.output
    assert not (tmp_path / "other.glb").exists()
    moving = CliRunner().invoke(app, [*arguments, str(tmp_path / "shown.webp")])
    assert moving.exit_code == 2
    assert "a .png or .glb shows it flat" in moving.output
    assert not (tmp_path / "shown.webp").exists()


def test_a_picture_goes_to_the_pressures_of_predict(tmp_path: Path) -> None:
    """A film without a burst test to 1000 kPa, the paper's to its burst pressure."""
    film = ["product=TPU 85A", "thickness=0.1", "modulus=20", "poisson=0.45"]
    tpu = [part for word in film for part in ("--set", f"films.tpe.{word}")]
    drawn = ["--set", "stack.balloons=2", "--width", "100", "--to", str(tmp_path / "a.png")]
    runner = CliRunner()
    ended = runner.invoke(app, ["picture", "1dof-5mm", *tpu, *drawn, "--pressure", "300"])
    assert ended.exit_code == 0, ended.output
    assert "300 kPa" in ended.output
    for more, pressure, said in ((tpu, "1200", "0 to 1000 kPa"), ([], "400", "burst pressure")):
        ended = runner.invoke(app, ["picture", "1dof-5mm", *more, *drawn, "--pressure", pressure])
        assert ended.exit_code == 2
        assert said in " ".join(ended.output.split())
