"""``sbafab kerf``: the kerf from measurements of the coupon."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import click

from sbafab.cli.options import FiniteRange, json_option
from sbafab.cli.printing import print_json, print_verdict, several
from sbafab.design.films import FILM_NAME, is_kerf
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.lab.coupon import (
    Calibration,
    Estimate,
    Measurement,
    Value,
    calibrated,
    read_measurements,
)


class KerfEstimate(Document):
    """Fit of ``count`` sizes: kerf in mm and scale as a ratio, with 95 % half widths."""

    kerf: Value
    scale: Value | None
    scaled: bool = attribute("is_scaled")
    offsets: Mapping[str, Value]
    """excess of each instrument's readings, mm; empty if the sizes do not determine it"""
    count: int


class KerfDocument(Document, schema="sbafab/kerf@1"):
    """Output of ``kerf --json``."""

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


def _film(context: click.Context, option: click.Parameter, name: str) -> str:
    """Return the name of a film; raises BadParameter for one that no film can have."""
    if not re.fullmatch(FILM_NAME, name):
        raise click.BadParameter(
            f"{name!r} is not the name of a film; give tpe, ptfe or a table of [films]"
        )
    return name


@click.command()
@click.argument("measurements", type=click.Path(path_type=Path))
@click.option(
    "--material",
    callback=_film,
    default="tpe",
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
    type=FiniteRange(0, 1),
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
    pair = [estimate for estimate in (calibration.x, calibration.y) if estimate is not None]
    if split_xy and len(pair) < 2:
        raise DesignError("--split-xy needs two sizes along x and two along y; fill in more rows")
    is_split = calibration.differs if split_xy is None else split_xy
    widths = pair if is_split and len(pair) == 2 else [calibration.overall]
    warnings = [*_warnings(calibration, widths)]
    remarks = [*_remarks(calibration, widths, sizes)]
    block = _toml_block(material, widths, warnings)
    if as_json:
        sentences = {"warnings": warnings, "remarks": remarks, "toml": block}
        print_json(KerfDocument.of(calibration, **sentences))
        return
    names = {"all": calibration.overall, "along x": calibration.x, "along y": calibration.y}
    for name, estimate in names.items():
        if estimate is not None:
            kerf_text = _with_interval(estimate.kerf)
            click.echo(f"{name:8} kerf {kerf_text}, from {estimate.count} sizes")
    for line in (*remarks, *(f"warning: {warning}" for warning in warnings)):
        click.echo(line)
    read_first = "Read the warnings before you paste" if warnings else "Paste into the design file"
    click.echo(f"\n{read_first}:\n\n{block}")
    values = ", ".join(f"{estimate.kerf.value:.3f}" for estimate in widths)
    count = f", {several(len(warnings), 'warning')}" if warnings else ""
    # A comment, so that all from the table on may be pasted.
    print_verdict(f"# {material} kerf: {values} mm from {calibration.overall.count} sizes{count}")


def _toml_block(film: str, widths: Sequence[Estimate], warnings: Sequence[str]) -> str:
    """Return the lines for the design file, with the warnings as comments."""
    is_usual = film in ("tpe", "ptfe")
    table, key = ("[laser]", f"kerf_{film}") if is_usual else (f"[films.{film}]", "kerf")
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


def _remarks(
    calibration: Calibration, widths: Sequence[Estimate], sizes: Sequence[Measurement]
) -> Iterator[str]:
    """Yield sentences on x and y, on significant reading errors, and on calliper jaws, whose effect
    no fit detects.
    """
    if calibration.difference is None:
        yield "x and y cannot be compared: measure two sizes along each"
    elif not calibration.differs:
        yield "x and y do not differ significantly"
    else:
        advice = "" if len(widths) == 2 else "; a common kerf does not correct this"
        yield f"x and y differ by {_with_interval(calibration.difference)}{advice}"
    for name, offset in calibration.overall.offsets.items():
        if offset.differs_from(0.0):
            low, high = offset.interval
            yield (
                f"the {name or 'instrument'} reads {abs(offset.value):.4f} mm too "
                f"{'much' if offset.value > 0 else 'little'} (95 % interval {low:+.4f} to "
                f"{high:+.4f}); the kerf is corrected for it"
            )
    if {size.instrument for size in sizes} & {"", "calliper"}:
        yield (
            "the jaws of a calliper compress thin film: outsides read small and windows large, "
            "which cannot be separated from the kerf; a scanner or a microscope avoids this "
            "(--instrument)"
        )


def _warnings(calibration: Calibration, widths: Sequence[Estimate]) -> Iterator[str]:
    """Yield sentences on doubts about these widths: intervals, reading errors, scale."""
    is_pair = len(widths) == 2
    for estimate, place in zip(widths, (" along x", " along y") if is_pair else ("",), strict=True):
        low, high = estimate.kerf.interval
        if estimate.is_vague:
            yield (
                f"the kerf{place} {'may be zero' if low <= 0 else 'is too uncertain'}: its 95 % "
                f"interval is {low:.3f} to {high:.3f} mm from {estimate.count} sizes; measure more "
                "sizes, or repeat each, before you cut with it"
            )
    if not is_kerf(widths[0].kerf.value, widths[-1].kerf.value):
        yield (
            "one kerf is over ten times the other, which no design may have; measure again, or use "
            "--no-split-xy"
        )
    if not all(estimate.offsets for estimate in widths):
        yield (
            "a constant reading error cannot be separated from the kerf and is assumed to be zero; "
            f"measure outsides and windows, three sizes or more{' along each axis' * is_pair}"
        )
    # Along x or y if the scale is significant there, else overall.
    axes = {" along x": calibration.x, " along y": calibration.y}
    scaled = {where: each for where, each in axes.items() if each and each.is_scaled}
    if not scaled and calibration.overall.is_scaled:
        scaled = {"": calibration.overall}
    for where, estimate in scaled.items():
        assert estimate.scale is not None
        low, high = estimate.scale.interval
        yield (
            f"sizes{where} are {estimate.scale.value:.4f} times the drawn ones, 95 % interval "
            f"{low:.4f} to {high:.4f}, after correction of kerf and constant reading error. The "
            "laser, the film or the instrument may cause it; cut files do not correct it. Check "
            "the instrument with a gauge of known length and cut a second coupon before you adjust "
            "the laser"
        )
