"""``sbafab picture``: the actuator inflated, as picture, moving picture or scene for viewers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import (
    PRESSURE,
    VOLUME,
    OfChamber,
    by_chamber,
    finite,
    refuse_given,
    set_option,
)

if TYPE_CHECKING:
    from sbafab.reports.inflated_picture import Movement


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
    help="In place of pressures: what a chamber holds, all its balloons together. Repeatable.",
)
@click.option(
    "--to",
    "path",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="A .png, a moving .gif or .webp, or a .glb.  [default: NAME-inflated.png, or "
    "NAME-flat.png of what no model inflates]",
)
@click.option(
    "--motion",
    type=click.Choice(["inflate", "circle"]),
    default="inflate",
    show_default=True,
    help="Moving pictures: from flat and back, or pressure going round the chambers.",
)
@click.option("--elevation", type=float, callback=finite, default=18.0, show_default=True)
@click.option("--azimuth", type=float, callback=finite, default=-60.0, show_default=True)
@click.option(
    "--width",
    type=click.IntRange(100, 4000),
    help="Pixels; the height is 4/5 of it.  [default: 1000, moving 480]",
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
    """Draw the inflated actuator, still or moving.

    It stands as the elastic stack says at the given pressures or volumes. Balloons are drawn as
    they are between their plates; ears are snipped off, and inlet tubes are left out. Elevation and
    azimuth are degrees over the bench and round it. Drawn pockets that are nearly round are taken
    for discs of equal area. Other drawn pockets, and oblong ones, no model inflates: they are drawn
    flat, into NAME-flat.png.
    """
    from sbafab.actuators import build, load_design
    from sbafab.cli.printing import print_wrapped, shown_progress
    from sbafab.errors import DesignError, OutputError
    from sbafab.models.balloons import has_balloons
    from sbafab.models.drawn import model_form, near_discs
    from sbafab.models.paper import counterparts_of_pose
    from sbafab.models.stack import stack
    from sbafab.reports.inflated_picture import (
        MOVING,
        WHY,
        PictureWish,
        write_flat_picture,
        write_picture,
    )

    if pressures and volumes:
        raise DesignError("give --pressure or --volume, not both")
    loaded = load_design(design, assignments)
    form = model_form(loaded)
    is_inflated = has_balloons(form)
    path = path or Path(f"{loaded.name}-{'inflated' if is_inflated else 'flat'}.png")
    wide = width or (480 if path.suffix.lower() in MOVING else 1000)
    wish = PictureWish(
        pressures or {"": 5.0},
        volumes or None,
        elevation=elevation,
        azimuth=azimuth,
        width=wide,
        height=wide * 4 // 5,
        motion=motion,
    )
    _refuse_still(path.suffix.lower())
    laminate = build(loaded)
    if not is_inflated:
        refuse_given(
            f"is for inflated actuators, and {WHY}: {loaded.name} is drawn flat; leave it out",
            *("pressures", "volumes", "elevation", "azimuth"),
        )
        try:
            write_flat_picture(laminate, path, wish.width, wish.height)
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}") from error
        click.echo(f"written to {path}: {loaded.name}, flat, not inflated: {WHY}")
        return
    with shown_progress(False) as tell:
        try:
            shown = write_picture(
                laminate,
                stack(loaded, laminate, form=form),
                wish,
                path,
                lambda done, total: tell("frames", done, total),
            )
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}") from error
    kpa = ", ".join(f"{p:.3g}" for p in shown.pressures)
    held = ", ".join(f"{v:.0f}" for v in shown.volumes)
    click.echo(
        f"written to {path}: {kpa} kPa, {held} ul, tip {shown.height:.2f} mm high, "
        f"bent {shown.bend:.1f} degrees"
    )
    discs = near_discs(loaded)
    if discs is not None:
        print_wrapped(
            f"(the drawn pocket taken for a disc of equal area, d = {discs.equal:.4g} mm; the "
            f"discs within and round it have {discs.inner:.4g} and {discs.outer:.4g} mm)"
        )
    for row in counterparts_of_pose(len(shown.pressures)).values():
        print_wrapped(f"({row.sentence()})")


def _refuse_still(ending: str) -> None:
    """Raises UsageError for options of another kind of picture than ``ending`` says."""
    from sbafab.reports.inflated_picture import MOVING

    if ending not in MOVING:
        moving = f"a moving picture; give --to FILE{MOVING[0]}"
        refuse_given(f"is for {moving}, or leave it out", "motion")
    if ending == ".glb":
        why = "is for a picture, and a .glb is looked at from anywhere; leave it out"
        refuse_given(why, "elevation", "azimuth", "width")
