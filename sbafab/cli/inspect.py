"""``sbafab inspect``: a scan or photograph of a cut sheet against the cut file."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from sbafab.cli.options import LENGTH, FiniteRange, folder_option, json_option
from sbafab.cli.printing import (
    print_facts,
    print_failure,
    print_json,
    print_verdict,
    print_written,
)
from sbafab.errors import DesignError
from sbafab.lab.edges import Reference
from sbafab.lab.inspection import Inspection
from sbafab.lab.picture import ScanPicture

MOST_LINES = 20
"""Pieces amiss that are printed; the files have all."""


@click.command()
@click.argument("folder", metavar="FOLDER", type=click.Path(path_type=Path))
@click.argument("picture", metavar="PICTURE", type=click.Path(path_type=Path))
@click.option("--sheet", metavar="NAME", help="Sheet or layer in the picture, e.g. TPE_1.")
@click.option(
    "--dpi",
    type=FiniteRange(50, 20000),
    metavar="N",
    help="Resolution of the scan.  [default: as the file states it]",
)
@click.option(
    "--bar", type=LENGTH.read, metavar="MM", help="Length of a bar that lies beside the parts."
)
@click.option("--pins", is_flag=True, help="Take the scale from the pins of the sheet.")
@click.option("--photo", is_flag=True, help="A camera's picture, with perspective.")
@click.option(
    "--paper",
    type=click.Choice(["dark", "light"]),
    default="dark",
    help="What the film lies on: darker or lighter than film.",
)
@folder_option("Folder of the files.", "inspection")
@json_option
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
    places without the waste, or the sheet that they fell out of. Measures the kerf and names
    missing and wrong pieces. OUT receives the picture with deviations (.svg), the result (.json),
    sizes for `sbafab kerf` (_sizes.csv) and an entry for `sbafab record --history` (_history.json).
    """
    if find_spec("skimage") is None or find_spec("scipy") is None:
        raise DesignError('sbafab inspect needs scikit-image: pip install "sbafab[scan]"')
    # An extra that may be missing, checked above.
    from sbafab.lab.cut_sheet import read_cut_sheet
    from sbafab.lab.inspection import InspectionDocument, inspect_picture
    from sbafab.lab.picture import read_picture

    cut, seen = read_cut_sheet(folder, sheet), read_picture(picture)
    scale = _reference(seen, photo, **reference)
    inspection = inspect_picture(seen, cut, scale, photo, paper == "dark")
    paths = write_inspection(inspection, out)
    if as_json:
        print_json({**InspectionDocument.of(inspection), "files": [str(path) for path in paths]})
    else:
        print_inspection(inspection, paths)
    if inspection.failed:
        click.get_current_context().exit(1)


def _reference(
    picture: ScanPicture, photo: bool, dpi: float | None, bar: float | None, pins: bool
) -> Reference:
    if bar is not None and bar <= 0:
        raise DesignError(f"--bar is {bar:g} mm; give the length of a bar, above 0")
    if bar is not None and pins:
        raise DesignError("give --bar or --pins, not both")
    stated = None if photo else picture.dpi
    resolution = stated if dpi is None else (dpi, dpi)
    if not photo and resolution is None and bar is None and not pins:
        raise DesignError(
            f"{picture.path} states no resolution; give --dpi as scanned, --bar or --pins, or "
            "--photo to take the scale from the cut edges themselves"
        )
    return Reference(resolution, bar, pins)


def write_inspection(inspection: Inspection, out: Path) -> list[Path]:
    """Write picture, result, entry and table of sizes; return their paths."""
    from sbafab.folders.swap import replace_text
    from sbafab.lab.inspection import InspectionDocument, drawing, history, sizes_csv

    out.mkdir(parents=True, exist_ok=True)
    stem = f"{inspection.sheet.name.replace('/', '_')}-{inspection.picture.path.stem}"
    result, entry = InspectionDocument.of(inspection), history(inspection)
    texts = {
        ".json": json.dumps(result, indent=1, ensure_ascii=False) + "\n",
        "_history.json": json.dumps(entry, indent=1, ensure_ascii=False) + "\n",
        ".svg": drawing(inspection),
        "_sizes.csv": sizes_csv(inspection),
    }
    paths = {out / f"{stem}{ending}": text for ending, text in texts.items()}
    for path, text in paths.items():
        replace_text(path, text)
    return list(paths)


def print_inspection(inspection: Inspection, paths: list[Path]) -> None:
    """Print kerf, scale, edges and the pieces amiss, and last the verdict."""
    kerf, scale, sheet = inspection.kerf, inspection.scale, inspection.sheet
    low, high = kerf.interval
    is_pieces = inspection.location.content == "pieces"
    seen = "pieces without waste" if is_pieces else "the sheet without its pieces"
    below = ", seen from below" if inspection.location.from_below else ""
    print_facts(
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
    (print_failure if inspection.failed else print_verdict)(verdict)
    print_written(paths[0].parent)
