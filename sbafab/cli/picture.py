"""``sbafab picture``: the inflated actuator as picture, animation or scene."""

from __future__ import annotations

from pathlib import Path

import click

from sbafab.actuators import build, load_design
from sbafab.cli.options import (
    PRESSURE,
    VOLUME,
    OfChamber,
    by_chamber,
    finite,
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
    type=click.Choice(["inflate", "circle"]),
    default="inflate",
    show_default=True,
    help="Animation: from flat and back, or pressure circling through the chambers.",
)
@click.option(
    "--elevation",
    type=float,
    callback=finite,
    default=18.0,
    show_default=True,
    help="Viewing angle above the bench, degrees.",
)
@click.option(
    "--azimuth",
    type=float,
    callback=finite,
    default=-60.0,
    show_default=True,
    help="Viewing angle round the vertical axis, degrees.",
)
@click.option(
    "--width",
    type=click.IntRange(100, 4000),
    help="Pixels; the height is 4/5 of the width.  [default: 1000, animation 480]",
)
def picture(  # noqa: PLR0913, PLR0917 - one an option
    design: str,
    assignments: tuple[str, ...],
    pressures: dict[str, float],
    volumes: dict[str, float],
    path: Path | None,
    motion: Movement,
    width: int | None,
    elevation: float,
    azimuth: float,
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
    wish = PictureRequest(
        pressures or {"": 5.0},
        volumes or None,
        elevation=elevation,
        azimuth=azimuth,
        width=pixels,
        height=pixels * 4 // 5,
        motion=motion,
    )
    _refuse_unused(path.suffix.lower())
    if not is_inflated:
        refuse_options(
            f"is for inflated actuators, and {WHY}: {loaded.name} is drawn flat; leave it out",
            *("pressures", "volumes", "elevation", "azimuth"),
        )
    try:
        (_draw_inflated if is_inflated else _draw_flat)(loaded, wish, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}") from error


def _draw_flat(design: Design, wish: PictureRequest, path: Path) -> None:
    write_flat_picture(build(design), path, wish.width, wish.height)
    print_verdict(f"{design.name} drawn flat, since {WHY}. Written to {path}", path)


def _draw_inflated(design: Design, wish: PictureRequest, path: Path) -> None:
    laminate = build(design)
    with shown_progress(False) as progress:
        pressures = wish.pressures_kpa.values()
        refuse_pressure([*pressures])
        refuse_beyond_burst(laminate, max(pressures))
        most = max(MOST_PRESSURE, *pressures)
        inflated = stack(design, laminate, most, factors_of(design), model_form(design))
        pose = write_picture(
            laminate,
            inflated,
            wish,
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
