"""``sbafab picture``: the inflated actuator as picture, animation or scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import click

from sbafab.actuators import build, load_design
from sbafab.cli.options import (
    PRESSURE,
    VOLUME,
    FiniteFloat,
    OfChamber,
    by_chamber,
    refuse_options,
    set_option,
)
from sbafab.cli.printing import print_verdict, print_wrapped
from sbafab.cli.progress import shown_progress
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.models.balloons import has_balloons
from sbafab.models.drawn_pockets import model_form, near_discs
from sbafab.models.formulas import refuse_beyond_burst, refuse_pressure
from sbafab.models.intervals import factors_of
from sbafab.models.stack import MOST_PRESSURE, stack
from sbafab.reports.inflated_picture import (
    MOVING,
    WHY,
    Movement,
    PictureRequest,
    write_flat_picture,
    write_picture,
)


@click.command()
@click.argument("design", metavar="DESIGN")
@set_option
@click.option(
    "--pressure",
    "pressures",
    type=OfChamber(PRESSURE, all_chambers=True).read,
    callback=by_chamber,
    multiple=True,
    metavar="KPA|CHAMBER=KPA",
    help="Pressure in all chambers, or in one, e.g. chamber1=5. Repeatable.  [default: 5]",
)
@click.option(
    "--volume",
    "volumes",
    type=OfChamber(VOLUME, all_chambers=True).read,
    callback=by_chamber,
    multiple=True,
    metavar="UL|CHAMBER=UL",
    help="Instead of pressures: volume of a chamber, all its balloons together. Repeatable.",
)
@click.option(
    "--to",
    "path",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="A .png picture, a .gif or .webp animation, or a .glb scene.  [default: "
    "NAME-inflated.png; NAME-flat.png if no model inflates it]",
)
@click.option(
    "--motion",
    type=click.Choice(get_args(Movement)),
    default="inflate",
    help="Animation: from flat and back, or pressure circling through the chambers.",
)
@click.option(
    "--elevation",
    type=FiniteFloat(),
    default=18.0,
    help="Viewing angle above the bench, degrees.",
)
@click.option(
    "--azimuth",
    type=FiniteFloat(),
    default=-60.0,
    help="Viewing angle round the vertical axis, degrees.",
)
@click.option(
    "--width",
    type=click.IntRange(100, 4000),
    help="Pixels; the height is 4/5 of the width.  [default: 1000, animation 480]",
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
    modelled between their plates, without ears and inlet tubes. Drawn pockets that are nearly round
    are replaced by discs of equal area. No model inflates oblong and other drawn pockets: these are
    drawn flat, to NAME-flat.png.
    """
    if pressures and volumes:
        raise DesignError("give --pressure or --volume, not both")
    loaded = load_design(design, assignments)
    is_inflated = has_balloons(model_form(loaded))
    path = path or Path(f"{loaded.name}-{'inflated' if is_inflated else 'flat'}.png")
    pixels = width or (480 if path.suffix.lower() in MOVING else 1000)
    view |= {"width": pixels, "height": pixels * 4 // 5}
    wanted = PictureRequest(pressures or {"": 5.0}, volumes or None, **view)
    _refuse_unused(path.suffix.lower())
    if not is_inflated:
        refuse_options(
            f"is for inflated actuators, and {WHY}: {loaded.name} is drawn flat; leave it out",
            *("pressures", "volumes", "elevation", "azimuth"),
        )
    try:
        (_draw_inflated if is_inflated else _draw_flat)(loaded, wanted, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}") from error


def _draw_flat(design: Design, wanted: PictureRequest, path: Path) -> None:
    write_flat_picture(build(design), path, wanted.width, wanted.height)
    print_verdict(f"{design.name} drawn flat, since {WHY}. Written to {path}", path)


def _draw_inflated(design: Design, wanted: PictureRequest, path: Path) -> None:
    laminate = build(design)
    with shown_progress(False) as progress:
        pressures = wanted.pressures_kpa.values()
        refuse_pressure([*pressures])
        refuse_beyond_burst(laminate, max(pressures))
        most = max(MOST_PRESSURE, *pressures)
        inflated = stack(design, laminate, most, factors_of(design), model_form(design))
        pose = write_picture(
            laminate,
            inflated,
            wanted,
            path,
            lambda done, total: progress("frames", done, total),
        )
    discs = near_discs(design)
    if discs is not None:
        print_wrapped(
            f"(the drawn pocket is replaced by a disc of equal area, d = {discs.equal:.4g} mm; its "
            f"inscribed and circumscribed discs have {discs.inner:.4g} and {discs.outer:.4g} mm)"
        )
    for sentence in inflated.counterparts.values():
        print_wrapped(f"({sentence})")
    each = ", ".join(f"{pressure:.3g}" for pressure in pose.pressures)
    volumes = ", ".join(f"{volume:.0f}" for volume in pose.volumes)
    print_verdict(
        f"{design.name} drawn: {each} kPa, {volumes} ul, tip {pose.height:.2f} mm high, "
        f"bent {pose.bend:.1f} degrees. Written to {path}",
        path,
    )


def _refuse_unused(suffix: str) -> None:
    """Raise UsageError for options that a file with this suffix does not use."""
    if suffix not in MOVING:
        reason = f"is for an animation; give --to FILE{MOVING[0]}, or leave it out"
        refuse_options(reason, "motion")
    if suffix == ".glb":
        reason = "is for a picture, and the view of a .glb is chosen in its viewer; leave it out"
        refuse_options(reason, "elevation", "azimuth", "width")
