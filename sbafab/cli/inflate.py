"""``sbafab map`` and ``picture``: inflated balloons as tables and models, and as pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, get_args

import click

from sbafab.api import inflated as api
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.errors import DesignError

MUJOCO = "xml"
"""Ending of a MuJoCo model."""
MODEL_PRESSURE = 10.0
"""kPa in each chamber of a MuJoCo model, unless others are given."""


@click.command(name="map")
@opt.design_argument()
@opt.set_option
@opt.option(
    "--to FILE",
    "Write FILE.csv or FILE.xml (MuJoCo).  [default: CSV on standard output]",
    opt.file_path(dir_okay=False),
)
@opt.option("--pressure P", "Highest pressure of the map.", opt.PRESSURE, default="110 kPa")
@opt.option(
    "--points N",
    "Number of pressures, and of heights, in CSV.",
    click.IntRange(2, 1000),
    default=31,
)
@opt.option(
    "--pressures",
    "Pressures that the .xml file is for, one a chamber.  [default: 10 kPa in each]",
    metavar="P,P,...",
)
def map_(
    source: str,
    assignments: tuple[str, ...],
    to: Path | None,
    pressure: float,
    points: int,
    pressures: str | None,
) -> None:
    """Map force and volume of the balloons.

    The map covers all pressures and heights, for use in other programs. FILE.xml is a MuJoCo model
    of the stack about its pose at the given pressures.
    """
    form = "csv" if to is None else to.suffix.removeprefix(".")
    if form not in ("csv", MUJOCO):
        raise DesignError(f"{to} must end with .csv or .{MUJOCO}, which sets the format")
    if form != MUJOCO:
        opt.refuse_options(
            "is for a MuJoCo model; give --to FILE.xml, or leave it out", "pressures"
        )
    if pressure <= 0:
        raise DesignError(f"--pressure is {pressure:g} kPa; it must be above 0 kPa")
    design = api.load_design(source, assignments, ())
    api.refuse_pressure(pressure)
    api.refuse_beyond_burst(api.build(design), pressure)
    actuator = api.stack(design, most_pressure=pressure, factors=api.factors_of(design))
    if form == MUJOCO:
        text = api.chain_text(design.name, actuator, _listed(pressures, actuator.chambers))
    else:
        text = api.map_text(actuator.maps, points)
    if to is None:
        show.result(text.removesuffix("\n"))
        return
    to.write_text(text, encoding="utf-8", newline="\n")
    show.verdict(f"{design.name} mapped up to {pressure:g} kPa. Written to {to}", to)


def _listed(pressures: str | None, chambers: int) -> tuple[float, ...]:
    """Return pressures in kPa, one per chamber. Raises BadParameter, DesignError."""
    if pressures is None:
        return (MODEL_PRESSURE,) * chambers
    each = tuple(opt.PRESSURE.convert(text, None, None) for text in pressures.split(","))
    if len(each) != chambers:
        raise DesignError(
            f"--pressures has {len(each)} of {chambers} pressures; give one per chamber, "
            "separated by commas, such as 10,0,0"
        )
    return each


@click.command()
@opt.design_argument("design")
@opt.set_option
@opt.option(
    "--pressure pressures...",
    "Pressure in all chambers, or in one, e.g. chamber1=5.  [default: 5]",
    opt.OfChamber(opt.PRESSURE, all_chambers=True),
)
@opt.option(
    "--volume volumes...",
    "Instead of pressures: volume of a chamber, all its balloons together.",
    opt.OfChamber(opt.VOLUME, all_chambers=True),
)
@opt.option(
    "--to path FILE",
    "A .png picture, a .gif or .webp animation, or a .glb scene.  [default: "
    "NAME-inflated.png; NAME-flat.png if no model inflates it]",
    opt.file_path(dir_okay=False),
)
@opt.option(
    "--motion",
    "Animation: from flat and back, or pressure circling through the chambers.",
    get_args(api.Movement),
    default=api.PictureRequest.motion,
)
@opt.option(
    "--elevation",
    "Viewing angle above the bench, degrees.",
    opt.FINITE,
    default=api.PictureRequest.elevation,
)
@opt.option(
    "--azimuth",
    "Viewing angle round the vertical axis, degrees.",
    opt.FINITE,
    default=api.PictureRequest.azimuth,
)
@opt.option(
    "--width",
    "Pixels; the height is 4/5 of the width.  [default: 1000, animation 480]",
    click.IntRange(100, 4000),
)
def picture(
    design: str,
    assignments: tuple[str, ...],
    pressures: dict[str, float],
    volumes: dict[str, float],
    path: Path | None,
    width: int | None,
    **view: Any,
) -> None:
    """Draw the inflated actuator as picture, animation or scene.

    The elastic stack computes the pose at the given pressures or volumes. Balloons are drawn as
    modelled between their plates, without ears and inlet tubes. Nearly round drawn pockets are
    replaced by discs of equal area. There is no model of oblong and other drawn pockets: these are
    drawn flat, in NAME-flat.png.
    """
    if pressures and volumes:
        raise DesignError("give --pressure or --volume, not both")
    loaded = api.load_design(design, assignments)
    is_inflated = api.has_balloons(api.model_form(loaded))
    path = path or Path(f"{loaded.name}-{'inflated' if is_inflated else 'flat'}.png")
    _refuse_unused(path.suffix.lower())
    pixels = width or (480 if path.suffix.lower() in api.MOVING else api.PictureRequest.width)
    view |= {"width": pixels, "height": pixels * 4 // 5}
    picture = api.PictureRequest(pressures or {"": 5.0}, volumes or None, **view)
    if is_inflated:
        _draw_inflated(loaded, picture, path)
        return
    opt.refuse_options(
        f"is for inflated actuators, and {api.WHY}: {loaded.name} is drawn flat; leave it out",
        *("pressures", "volumes", "elevation", "azimuth"),
    )
    api.write_flat_picture(api.build(loaded), path, picture.width, picture.height)
    show.verdict(f"{loaded.name} drawn flat, since {api.WHY}. Written to {path}", path)


def _refuse_unused(suffix: str) -> None:
    """Raise UsageError for options that a file with this suffix does not use."""
    if suffix not in api.MOVING:
        reason = f"is for an animation; give --to FILE{api.MOVING[0]}, or leave it out"
        opt.refuse_options(reason, "motion")
    if suffix == ".glb":
        reason = "is for a picture, and the view of a .glb is chosen in its viewer; leave it out"
        opt.refuse_options(reason, "elevation", "azimuth", "width")


def _draw_inflated(design: api.Design, picture: api.PictureRequest, path: Path) -> None:
    laminate, pressures = api.build(design), [*picture.pressures_kpa.values()]
    api.refuse_pressure(pressures, may_be_zero=True)
    api.refuse_beyond_burst(laminate, max(pressures))
    most = max(api.MOST_PRESSURE, *pressures)
    with show.progress(False) as progress:
        inflated = api.stack(design, laminate, most, api.factors_of(design), api.model_form(design))
        pose = api.write_picture(laminate, inflated, picture, path, partial(progress, "frames"))
    discs = api.near_discs(design)
    if discs is not None:
        show.wrapped(
            f"(the drawn pocket is replaced by a disc of equal area, d = {discs.equal:.4g} mm; its "
            f"inscribed and circumscribed discs have {discs.inner:.4g} and {discs.outer:.4g} mm)"
        )
    for sentence in inflated.counterparts.values():
        show.wrapped(f"({sentence})")
    each = ", ".join(f"{pressure:.3g}" for pressure in pose.pressures)
    volumes = ", ".join(f"{volume:.0f}" for volume in pose.volumes)
    show.verdict(
        f"{design.name} drawn: {each} kPa, {volumes} ul, tip {pose.height:.2f} mm high, "
        f"bent {pose.bend:.1f} degrees. Written to {path}",
        path,
    )
