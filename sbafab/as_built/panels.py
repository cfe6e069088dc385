"""Registered sheets as they lie on disk: what the second cut frees from the sheets of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sbafab.as_built.cut_files import LayerFile, check_sequence, sound_digest
from sbafab.as_built.meant import Meant, departure
from sbafab.as_built.records import INTEGRITY, Problem
from sbafab.as_built.uncut import uncut
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.second_cut import PATH, ROOM, marks, second_path, severed, stack_kerf
from sbafab.cutting.verify import check_surroundings
from sbafab.errors import OutputError
from sbafab.geometry.beam import Kerf
from sbafab.geometry.nearby import widened
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import rectangle
from sbafab.laminate.laminate import Layer
from sbafab.laminate.panel import SheetPanel, freed
from sbafab.output.manifest_records import Manifest
from sbafab.rules.bridges import apart


def read_panel(
    folder: Path, claims: Manifest, files: Sequence[LayerFile], meant: Meant | None
) -> tuple[SheetPanel | None, list[LayerFile], list[Problem]]:
    """The panel of a folder's files, each layer's file with the part that it frees.

    The panel is the design's own where all files are what it makes. Of copies that differ, the
    one that departs most from what the design makes stands for its layer.
    """
    panel = meant.laminate.panel if meant is not None else None
    if meant is None or panel is None or len(files) != len(panel.sheets):
        return panel, list(files), []
    kerfs = {material: kerf.width for material, kerf in claims.kerf.items()}
    kerf = stack_kerf(kerfs, severed(meant.laminate))
    second, problems = _second(folder, kerf or 0.0, panel)
    parts = [file.part for file in files]
    if second is panel.second and all(part is None or part.is_meant for part in parts):
        return panel, list(files), problems
    sheets = tuple(
        own if part is None or part.is_meant else _upward(part.region, layer)
        for own, part, layer in zip(panel.sheets, parts, meant.laminate.layers, strict=True)
    )
    found = replace(panel, sheets=sheets, second=second)
    layers = meant.laminate.layers
    return (
        found,
        [_with_part(f, found, one) for f, one in zip(files, layers, strict=True)],
        problems,
    )


def _upward(sheet: Region, layer: Layer) -> Region:
    """A sheet as it is seen from above: those of masks are cut turned over."""
    return sheet.mirrored() if layer.is_mask else sheet


def _with_part(file: LayerFile, panel: SheetPanel, layer: Layer) -> LayerFile:
    if file.part is None or file.part.is_meant:
        return file
    parts = [part for part in freed(panel, layer).parts if not part.is_empty]
    # What is not freed at all is told by the rule bridges.
    region = max(parts, key=lambda part: apart(part, layer.profile), default=layer.profile)
    return replace(file, part=replace(file.part, region=region))


def _second(folder: Path, width: Kerf, panel: SheetPanel) -> tuple[Region, list[Problem]]:
    """The slots of the second cut's file, the panel's own where they agree."""
    try:
        sound_digest(folder / PATH)
        found = read_profile(folder / PATH)
        check_sequence(found)
        check_surroundings(found, marks(panel))
    except (OutputError, ArithmeticError, ValueError, LookupError) as error:
        said = str(error).removeprefix(f"{Path(PATH).name}: ")
        return panel.second, [Problem(INTEGRITY, f"{PATH}: {said}")]
    if not departure(found.region, second_path(panel, width)):
        return panel.second, []
    return _slots(found.region, width), []


def _slots(path: Region, kerf: Kerf) -> Region:
    """What a beam takes out that is led round inside slots."""
    x0, y0, x1, y1 = widened(path.bounds, ROOM)
    inner = [contour.reversed() for contour in path.contours]
    left = uncut(Region((*rectangle((x0, y0), (x1, y1)).contours, *inner)), kerf).region
    return Region(tuple(hole.reversed() for hole in left.holes))
