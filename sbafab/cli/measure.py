"""``sbafab kerf`` and ``inspect``: the kerf from a coupon; the inspection of a cut sheet."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from sbafab.api import lab as api
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError

MOST_LINES = 20
"""Pieces amiss that are printed; the files have all."""


class KerfEstimate(Document):
    """A fit of ``count`` sizes: kerf in mm and scale as a ratio, with 95 % half widths."""

    kerf: api.Value
    scale: api.Value | None
    scaled: bool = attribute("is_scaled")
    offsets: Mapping[str, api.Value]
    """excess of each instrument's readings, mm; empty if the sizes do not determine it"""
    count: int


class KerfDocument(Document, schema="sbafab/kerf@1"):
    """The output of ``kerf --json``."""

    all: KerfEstimate = attribute("overall")
    x: KerfEstimate | None
    y: KerfEstimate | None
    difference: api.Value | None
    """kerf along x less that along y, mm"""
    differs: bool
    warnings: list[str]
    remarks: list[str]
    toml: str
    """lines for the design file"""


def _film(context: click.Context, option: click.Parameter, name: str) -> str:
    """Return the name of a film. Raises BadParameter for an invalid name."""
    if not re.fullmatch(api.FILM_NAME, name):
        raise click.BadParameter(
            f"{name!r} is not the name of a film; give tpe, ptfe or the name of a table in [films]"
        )
    return name


@click.command()
@click.argument("measurements", type=opt.file_path())
@opt.option(
    "--material FILM",
    "Film of the coupon: tpe, ptfe or another film of a kit.",
    callback=_film,
    default="tpe",
)
@opt.option(
    "--instrument",
    "Instrument of the measurements, unless the table has a column of that name.",
    tuple(api.RESOLUTIONS),
)
@opt.option(
    "--resolution MM",
    "Resolution of the instrument.  [default: "
    + ", ".join(f"{name} {least:.3g}" for name, least in api.RESOLUTIONS.items())
    + "]",
    opt.FiniteRange(0, 1),
)
@opt.option(
    "--split-xy/--no-split-xy",
    "Compute two kerfs, along x and along y, or one.  [default: two if they differ]",
    default=None,
)
@opt.json_option
def kerf(
    measurements: Path,
    material: str,
    instrument: str | None,
    resolution: float | None,
    split_xy: bool | None,
    as_json: bool,
) -> None:
    """Compute the kerf from a filled coupon.csv.

    `sbafab new coupon` writes the coupon to cut and the table to fill in. Measure thin film with a
    scanner or a microscope, since a calliper bends it. A constant reading error and a scale error
    are separated from the kerf.
    """
    sizes = api.read_measurements(measurements, instrument or "")
    calibration = api.calibrated(sizes, resolution)
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
        show.document(KerfDocument.of(calibration, **sentences))
        return
    estimates = {"all": calibration.overall, "along x": calibration.x, "along y": calibration.y}
    for name, estimate in estimates.items():
        if estimate is not None:
            kerf_text = _with_interval(estimate.kerf)
            click.echo(f"{name:8} kerf {kerf_text}, from {estimate.count} sizes")
    for line in (*remarks, *(f"warning: {warning}" for warning in warnings)):
        click.echo(line)
    read_first = "Read the warnings before you paste" if warnings else "Paste into the design file"
    click.echo(f"\n{read_first}:\n\n{block}")
    values = ", ".join(f"{estimate.kerf.value:.3f}" for estimate in widths)
    count = f", {show.several(len(warnings), 'warning')}" if warnings else ""
    # A comment, so that all from the table on may be pasted.
    show.verdict(f"# {material} kerf: {values} mm from {calibration.overall.count} sizes{count}")


def _toml_block(film: str, widths: Sequence[api.Estimate], warnings: Sequence[str]) -> str:
    """Return the lines for the design file, with the warnings as comments."""
    is_usual = film in ("tpe", "ptfe")
    table, key = ("[laser]", f"kerf_{film}") if is_usual else (f"[films.{film}]", "kerf")
    values = [f"{estimate.kerf.value:.3f}" for estimate in widths]
    value = values[0] if len(values) == 1 else f"[{', '.join(values)}]"
    doubts = "".join(f"# warning: {warning}\n" for warning in warnings)
    return f"{table}\n{doubts}{key} = {value}\n"


def _with_interval(value: api.Value) -> str:
    low, high = value.interval
    return (
        f"{value.value:.4f} mm, standard uncertainty {value.uncertainty:.4f}, "
        f"95 % interval {low:.4f} to {high:.4f}"
    )


def _remarks(
    calibration: api.Calibration, widths: Sequence[api.Estimate], sizes: Sequence[api.Measurement]
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


def _warnings(calibration: api.Calibration, widths: Sequence[api.Estimate]) -> Iterator[str]:
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
    if not api.is_kerf(widths[0].kerf.value, widths[-1].kerf.value):
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


# Pictures of cut sheets.


@click.command()
@click.argument("folder", metavar="FOLDER", type=opt.file_path())
@click.argument("picture", metavar="PICTURE", type=opt.file_path())
@opt.option("--sheet NAME", "Sheet or layer in the picture, e.g. TPE_1.")
@opt.option(
    "--dpi N",
    "Resolution of the scan.  [default: as the file states it]",
    opt.FiniteRange(50, 20000),
)
@opt.option("--bar MM", "Length of a bar that lies beside the parts.", opt.POSITIVE_LENGTH)
@opt.option("--pins", "Take the scale from the pins of the sheet.", bool)
@opt.option("--photo", "A camera's picture, with perspective.", bool)
@opt.option(
    "--paper",
    "What the film lies on: darker or lighter than film.",
    ("dark", "light"),
    default="dark",
)
@opt.folder_option("Folder of the files.", "inspection")
@opt.json_option
def inspect(
    folder: Path,
    picture: Path,
    sheet: str | None,
    photo: bool,
    paper: str,
    out: Path,
    as_json: bool,
    **reference: Any,
) -> None:
    """Compare a scan or photograph of a cut sheet with its cut file.

    FOLDER is an output folder, or a cut file such as coupon.dxf. PICTURE shows the pieces in their
    places without the waste, or the sheet without the pieces. Measures the kerf and lists missing
    and wrong pieces. OUT receives the picture with deviations (.svg), the result (.json), sizes for
    `sbafab kerf` (_sizes.csv) and an entry for `sbafab record --history` (_history.json).
    """
    if find_spec("skimage") is None or find_spec("scipy") is None:
        raise DesignError('sbafab inspect needs scikit-image: pip install "sbafab[scan]"')
    cut, photographed = api.read_cut_sheet(folder, sheet), api.read_picture(picture)
    scale = _reference(photographed, photo, **reference)
    inspection = api.Inspection(api.Scan(photographed, cut, scale, photo, paper == "dark"))
    paths = _write_inspection(inspection, out)
    if as_json:
        show.document(
            {**api.InspectionDocument.of(inspection), "files": [str(path) for path in paths]}
        )
    else:
        _print_inspection(inspection, paths)
    if inspection.failed:
        show.end_failed()


def _reference(
    picture: api.ScanPicture, photo: bool, dpi: float | None, bar: float | None, pins: bool
) -> api.Reference:
    if bar is not None and pins:
        raise DesignError("give --bar or --pins, not both")
    stated = None if photo else picture.dpi
    resolution = stated if dpi is None else (dpi, dpi)
    if not photo and resolution is None and bar is None and not pins:
        raise DesignError(
            f"{picture.path} states no resolution; give the --dpi of the scan, --bar or --pins, "
            "or --photo to take the scale from the cut edges"
        )
    return api.Reference(resolution, bar, pins)


def _write_inspection(inspection: api.Inspection, out: Path) -> list[Path]:
    """Write picture, result, entry and table of sizes; return their paths."""
    out.mkdir(parents=True, exist_ok=True)
    stem = f"{inspection.sheet.name.replace('/', '_')}-{inspection.picture.path.stem}"
    texts = {
        ".json": json.dumps(api.InspectionDocument.of(inspection), indent=1, ensure_ascii=False)
        + "\n",
        "_history.json": json.dumps(api.history(inspection), indent=1, ensure_ascii=False) + "\n",
        ".svg": api.drawing(inspection),
        "_sizes.csv": api.sizes_csv(inspection),
    }
    for ending, text in texts.items():
        api.replace_text(out / f"{stem}{ending}", text)
    return [out / f"{stem}{ending}" for ending in texts]


def _print_inspection(inspection: api.Inspection, paths: list[Path]) -> None:
    """Print kerf, scale, edges and the faulty pieces, and last the verdict."""
    kerf, scale, sheet = inspection.kerf, inspection.scale, inspection.sheet
    low, high = kerf.interval
    is_pieces = inspection.location.content == "pieces"
    seen = "pieces without waste" if is_pieces else "the sheet without its pieces"
    below = ", seen from below" if inspection.location.from_below else ""
    show.facts(
        [
            ("picture", f"{seen}{below}; {inspection.pixel:.4f} mm a pixel"),
            ("kerf", f"{kerf.value:.4f} mm, 95 % interval {low:.4f} to {high:.4f}"),
            ("in file", f"kerf {sheet.kerf}"),
            ("scale", f"x {scale.x:.5f}, y {scale.y:.5f}, by {scale.reference}"),
            ("edges", f"rms {inspection.rms:.4f} mm, 95 % within {inspection.within_95:.4f} mm"),
        ]
    )
    click.echo(
        "The interval leaves out how film and paper reflect: half way in grey may lie beside the "
        "edge, which reads as kerf"
    )
    for piece in inspection.amiss[:MOST_LINES]:
        click.echo(f"{piece.name} at x {piece.x:.1f}, y {piece.y:.1f}: {piece.message}")
    rest = len(inspection.amiss) - MOST_LINES
    if rest > 0:
        click.echo(f"and {rest} more")
    click.echo(f"files: {', '.join(map(str, paths))}")
    sound = len(inspection.pieces) - len(inspection.amiss)
    verdict = f"{sheet.name}: {sound} of {len(inspection.pieces)} pieces as drawn"
    (show.failure if inspection.failed else show.verdict)(verdict)
    show.written(paths[0].parent)
