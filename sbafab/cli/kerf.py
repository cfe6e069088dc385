"""``sbafab kerf``: the kerf from measurements of the coupon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from sbafab.cli.options import finite, json_option
from sbafab.cli.printing import print_json, print_verdict
from sbafab.cutting.calibration import (
    Calibration,
    Estimate,
    Measurement,
    Value,
    calibrated,
    read_measurements,
)
from sbafab.design.films import FILM_NAME, is_kerf
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError


class KerfEstimate(Document):
    """Of ``count`` sizes: kerf in mm and scale as a ratio, with 95 % half widths."""

    kerf: Value
    scale: Value | None
    scaled: bool = attribute("is_scaled")
    offsets: Mapping[str, Value]
    """mm that each instrument reads too much; empty where it cannot be told"""
    count: int


class KerfDocument(Document, schema="sbafab/kerf@1"):
    """What ``kerf --json`` prints."""

    all: KerfEstimate = attribute("overall")
    x: KerfEstimate | None
    y: KerfEstimate | None
    difference: Value | None
    """kerf along x less that along y, mm"""
    differs: bool
    warnings: list[str]
    remarks: list[str]
    toml: str
    """lines for the design file"""


@click.command()
@click.argument("measurements", type=click.Path(path_type=Path))
@click.option(
    "--material",
    callback=lambda context, option, name: _film(name),
    default="tpe",
    show_default=True,
    metavar="FILM",
    help="Film of the coupon: tpe, ptfe or another film of a kit.",
)
@click.option(
    "--instrument",
    type=click.Choice(["calliper", "scanner", "microscope"]),
    help="Instrument of the measurements, unless the table has a column of that name.",
)
@click.option(
    "--resolution",
    type=click.FloatRange(0, 1),
    callback=finite,
    metavar="MM",
    help="Resolution of the instrument.  [default: calliper 0.01, scanner 0.0106 (2400 "
    "dpi), microscope 0.001]",
)
@click.option(
    "--split-xy/--no-split-xy",
    default=None,
    help="Compute two kerfs, along x and along y, or one.  [default: two if they differ]",
)
@json_option
def kerf(
    measurements: Path,
    material: str,
    instrument: str | None,
    resolution: float | None,
    split_xy: bool | None,
    as_json: bool,
) -> None:
    """Compute the kerf from a filled coupon.csv.

    `sbafab new coupon` writes the piece to cut and the table to fill in. Measure thin film with a
    scanner or a microscope rather than a calliper, which bends it. A constant reading error and a
    scale error are separated from the kerf.
    """
    sizes = read_measurements(measurements, instrument or "")
    calibration = calibrated(sizes, resolution)
    if split_xy and (calibration.x is None or calibration.y is None):
        raise DesignError("--split-xy needs two sizes along x and two along y; fill in more rows")
    widths = _widths(calibration, split_xy)
    warnings = _warnings(calibration, widths)
    remarks = [
        _remark(calibration, widths),
        *_offset_remarks(calibration.overall),
        *_contact_remark(sizes),
    ]
    block = _toml_block(*_place_in_design(material), widths, warnings)
    if as_json:
        sentences = {"warnings": warnings, "remarks": remarks, "toml": block}
        print_json(KerfDocument.of(calibration, **sentences))
        return
    for name, estimate in (
        ("all", calibration.overall),
        ("along x", calibration.x),
        ("along y", calibration.y),
    ):
        if estimate is not None:
            click.echo(
                f"{name:8} kerf {_with_interval(estimate.kerf)}, from {estimate.count} sizes"
            )
    for remark in remarks:
        click.echo(remark)
    for warning in warnings:
        click.echo(f"warning: {warning}")
    read_first = "Read the warnings before you paste" if warnings else "Paste into the design file"
    click.echo(f"\n{read_first}:\n\n{block}")
    values = ", ".join(f"{estimate.kerf.value:.3f}" for estimate in widths)
    count = f", {len(warnings)} warning{'s' if len(warnings) > 1 else ''}" if warnings else ""
    # A comment, so that all from the table on may be pasted.
    print_verdict(f"# {material} kerf: {values} mm from {calibration.overall.count} sizes{count}")


def _film(name: str) -> str:
    """Return the name of a film; raises BadParameter for one that no film can have."""
    if not FILM_NAME.fullmatch(name):
        raise click.BadParameter(
            f"{name!r} is not the name of a film; give tpe, ptfe or a table of [films]"
        )
    return name


def _place_in_design(film: str) -> tuple[str, str]:
    """Return table and key of a film's kerf in a design file."""
    return ("[laser]", f"kerf_{film}") if film in ("tpe", "ptfe") else (f"[films.{film}]", "kerf")


Widths = tuple["Estimate"] | tuple["Estimate", "Estimate"]
"""The kerf, or those along x and along y."""


def _widths(calibration: Calibration, split_xy: bool | None) -> Widths:
    """Return a pair if ``split_xy``, or if it is None and x and y differ; else the common kerf."""
    is_split = calibration.differs if split_xy is None else split_xy
    if is_split and calibration.x is not None and calibration.y is not None:
        return calibration.x, calibration.y
    return (calibration.overall,)


def _toml_block(table: str, key: str, widths: Widths, warnings: list[str]) -> str:
    """Return the lines for the design file, with the warnings as comments."""
    values = [f"{estimate.kerf.value:.3f}" for estimate in widths]
    value = values[0] if len(values) == 1 else f"[{', '.join(values)}]"
    doubts = "".join(f"# warning: {warning}\n" for warning in warnings)
    return f"{table}\n{doubts}{key} = {value}\n"


def _with_interval(value: Value) -> str:
    low, high = value.interval
    return (
        f"{value.value:.4f} mm, standard uncertainty {value.uncertainty:.4f}, "
        f"95 % interval {low:.4f} to {high:.4f}"
    )


def _remark(calibration: Calibration, widths: Widths) -> str:
    if calibration.difference is None:
        return "x and y cannot be compared: measure two sizes along each"
    if not calibration.differs:
        return "x and y do not differ significantly"
    advice = "" if len(widths) == 2 else "; a common kerf does not correct this"
    return f"x and y differ by {_with_interval(calibration.difference)}{advice}"


def _warnings(calibration: Calibration, widths: Widths) -> list[str]:
    """Return sentences on doubts about these widths."""
    places = ("",) if len(widths) == 1 else (" along x", " along y")
    warnings = [
        _interval_warning(estimate, place)
        for estimate, place in zip(widths, places, strict=True)
        if estimate.is_vague
    ]
    if not is_kerf(widths[0].kerf.value, widths[-1].kerf.value):
        warnings.append(
            "one kerf is over ten times the other, which no design may have; measure again, or use "
            "--no-split-xy"
        )
    return [*warnings, *_offset_warning(calibration, widths), *_scale_warnings(calibration)]


def _interval_warning(estimate: Estimate, place: str) -> str:
    low, high = estimate.kerf.interval
    why = "may be zero" if low <= 0 else "is too uncertain"
    return (
        f"the kerf{place} {why}: its 95 % interval is {low:.3f} to {high:.3f} mm from "
        f"{estimate.count} sizes; measure more sizes, or repeat each, before you cut with it"
    )


def _offset_warning(calibration: Calibration, widths: Widths) -> list[str]:
    """Return a warning if the sizes do not separate a constant reading error from the kerf."""
    if all(estimate.offsets for estimate in widths):
        return []
    along = " along each axis" if len(widths) == 2 else ""
    return [
        f"a constant reading error cannot be separated from the kerf and is assumed to be zero; "
        f"measure outsides and windows, three sizes or more{along}"
    ]


def _scale_warnings(calibration: Calibration) -> list[str]:
    """Return warnings of a scale error: along x or y if it is significant there, else overall."""
    axes = [(" along x", calibration.x), (" along y", calibration.y)]
    along = [
        _scale_warning(estimate, where)
        for where, estimate in axes
        if estimate and estimate.is_scaled
    ]
    if along or not calibration.overall.is_scaled:
        return along
    return [_scale_warning(calibration.overall, "")]


def _scale_warning(estimate: Estimate, where: str) -> str:
    assert estimate.scale is not None
    scale = estimate.scale.value
    low, high = estimate.scale.interval
    return (
        f"sizes{where} are {scale:.4f} times the drawn ones, 95 % interval {low:.4f} to "
        f"{high:.4f}, after correction of kerf and constant reading error. The laser, the film or "
        "the instrument may cause it; cut files do not correct it. Check the instrument with a "
        "gauge of known length and cut a second coupon before you adjust the laser"
    )


def _offset_remarks(estimate: Estimate) -> list[str]:
    """Return sentences on significant reading errors of the instruments."""
    return [
        f"the {name or 'instrument'} reads {abs(offset.value):.4f} mm too "
        f"{'much' if offset.value > 0 else 'little'} (95 % interval {offset.interval[0]:+.4f} to "
        f"{offset.interval[1]:+.4f}); the kerf is corrected for it"
        for name, offset in estimate.offsets.items()
        if offset.differs_from(0.0)
    ]


def _contact_remark(sizes: Sequence[Measurement]) -> list[str]:
    """Return a remark on calliper jaws if one was used, since no fit detects their effect."""
    if not {size.instrument for size in sizes} & {"", "calliper"}:
        return []
    return [
        "the jaws of a calliper compress thin film: outsides read small and windows large, which "
        "cannot be separated from the kerf; a scanner or a microscope avoids this (--instrument)"
    ]
