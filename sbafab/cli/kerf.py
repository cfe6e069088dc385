"""``sbafab kerf``: the kerf from what was measured on the coupon."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import finite, json_option

if TYPE_CHECKING:
    from sbafab.cutting.calibration import Calibration, Estimate, Value


@click.command()
@click.argument("measurements", type=click.Path(path_type=Path))
@click.option(
    "--material",
    callback=lambda context, option, name: _film(name),
    default="tpe",
    show_default=True,
    metavar="FILM",
    help="The film that the coupon was cut from: tpe, ptfe or a further one of a kit.",
)
@click.option(
    "--resolution",
    type=click.FloatRange(0, 1),
    callback=finite,
    default=0.01,
    show_default=True,
    metavar="MM",
    help="The least step that the instrument shows.",
)
@click.option("--split-xy", is_flag=True, help="Give the kerf along x and along y apart.")
@json_option
def kerf(
    measurements: Path, material: str, resolution: float, split_xy: bool, as_json: bool
) -> None:
    """Compute the kerf from a filled coupon.csv (see: sbafab new coupon)."""
    from sbafab.cli.printing import print_json
    from sbafab.cutting.calibration import calibrated
    from sbafab.cutting.measured_table import read_measurements
    from sbafab.errors import DesignError

    found = calibrated(read_measurements(measurements), resolution)
    if split_xy and (found.x is None or found.y is None):
        raise DesignError("--split-xy needs two sizes along x and two along y; fill in more rows")
    section, key = _place_in_design(material)
    line = f"{key} = {_setting(found, split_xy)}"
    if as_json:
        print_json(
            {
                "all": _as_dict(found.overall),
                "x": _as_dict(found.x),
                "y": _as_dict(found.y),
                "difference": found.difference and found.difference._asdict(),
                "differs": found.differs,
                "toml": f"{section}\n{line}\n",
            }
        )
        return
    for name, estimate in (("all", found.overall), ("along x", found.x), ("along y", found.y)):
        if estimate is not None:
            click.echo(f"{name:8} kerf {_told(estimate.kerf)}, from {estimate.count} sizes")
    for remark in _remarks(found, split_xy):
        click.echo(remark)
    click.echo(f"\nPaste into the design file:\n\n{section}\n{line}")


def _film(name: str) -> str:
    from sbafab.design.films import FILM_NAME

    if not FILM_NAME.fullmatch(name):
        raise click.BadParameter(f"{name!r} names no film; give tpe, ptfe or another's table")
    return name


def _place_in_design(film: str) -> tuple[str, str]:
    """Table and key of a film's kerf."""
    return ("[laser]", f"kerf_{film}") if film in ("tpe", "ptfe") else (f"[films.{film}]", "kerf")


def _as_dict(estimate: Estimate | None) -> dict[str, object] | None:
    if estimate is None:
        return None
    return {
        "kerf": estimate.kerf._asdict(),
        "scale": estimate.scale and estimate.scale._asdict(),
        "scaled": estimate.is_scaled,
        "count": estimate.count,
    }


def _setting(found: Calibration, split_xy: bool) -> str:
    if split_xy and found.x is not None and found.y is not None:
        return f"[{found.x.kerf.value:.3f}, {found.y.kerf.value:.3f}]"
    return f"{found.overall.kerf.value:.3f}"


def _told(value: Value, unit: str = " mm") -> str:
    low, high = value.value - value.half_width, value.value + value.half_width
    return (
        f"{value.value:.4f}{unit}, standard uncertainty {value.uncertainty:.4f}, "
        f"95 % interval {low:.4f} to {high:.4f}"
    )


def _remarks(found: Calibration, split_xy: bool) -> list[str]:
    remarks = []
    if found.difference is None:
        remarks.append("x and y cannot be told apart: measure two sizes along each")
    elif found.differs:
        advice = "" if split_xy else "; --split-xy gives both"
        remarks.append(f"x and y differ by {_told(found.difference)}{advice}")
    else:
        remarks.append("x and y do not differ significantly")
    named: tuple[tuple[str, Estimate | None], ...] = (
        ("", found.overall),
        (" along x", found.x),
        (" along y", found.y),
    )
    for where, estimate in named:
        if estimate is not None and estimate.is_scaled and estimate.scale is not None:
            remarks.append(
                f"warning: outers and windows disagree{where}, which kerf does not explain: sizes "
                f"scale by {_told(estimate.scale, '')}; the machine's or the instrument's scale is "
                "off, or the film shrank. The kerf above is fitted apart from it"
            )
    return remarks
