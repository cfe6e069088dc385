"""The cut files of a laminate: one per layer, each distinct pattern verified once, and those of its
seams.

A seam's file has only the path of the tool's centre, on the layer SEAM; the tool bonds half of its
width on both sides. Coordinates are in mm, as in the layer files. If a tool is mounted beside its
machine's head, the file is for the head: shifted by minus the tool's offset, which the file states.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from sbafab.cutting.cut_settings import (
    FOLDER,
    REFERENCE,
    SEAM,
    CutSettings,
    file_properties,
    layer_path,
)
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text, seam_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import TOLERANCE, deviation, verify_file
from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.offset import shifted
from sbafab.geometry.region import Region
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate
from sbafab.runtime import Counted


def write_layer_files(
    laminate: Laminate,
    paths: Mapping[str, Region],
    folder: Path,
    settings: CutSettings,
    progress: Counted | None = None,
) -> dict[str, str]:
    """Write ``layers/<layer name>.dxf`` under ``folder`` for every layer.

    ``paths`` holds the beam's path for every pattern. The name of a compensated file ends in its
    kerf: ``layers/001_TPE_base_kerf0.12.dxf``. A folded film has one file, its lowest layer's.
    Returns the SHA-256 of each file by its path in ``folder``. Raises OutputError if a file does
    not read back as its path, OSError if it cannot be written.
    """
    written: dict[str, str] = {}
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    for pattern, layers in laminate.patterns.items():
        if laminate.cut_with(layers[0]) != layers[0].index:
            continue
        material, path = layers[0].film.material, paths[pattern]
        properties = file_properties(settings, material, pattern)
        contours = cutting_sequence(path)
        data = dxf_text(contours, properties, settings.curves.profile).encode()
        files = [layer_path(layer.name, settings.kerf_width(material)) for layer in layers]
        for file in files:
            (folder / file).write_bytes(data)
            written[file] = hashlib.sha256(data).hexdigest()
            if progress is not None:
                progress(len(written), len(laminate.layers))
        verify_file(folder / files[0], path, properties)
    return written


# Paths of seams.


WIDTH = "TOOL_WIDTH"
CENTRED: Point = (0.0, 0.0)
"""Offset of a tool in the place of its machine's head."""

Chains = Sequence[Sequence[Edge]]


def seam_path(seam: Seam) -> str:
    """Return the path in an output folder of a seam's file."""
    return f"{FOLDER}/seam_{seam.order:03d}_{seam.name}.dxf"


def seam_properties(seam: Seam, settings: CutSettings) -> dict[str, str]:
    """Return the custom properties of a seam's file."""
    offset = settings.seam_offsets.get(seam.tool)
    return {
        "DESIGN": settings.design,
        "DESIGN_SHA256": settings.design_sha256,
        "SEAM": seam.name,
        "ORDER": str(seam.order),
        "LAYERS": f"{seam.below}, {seam.above}",
        "TOOL": seam.tool,
        WIDTH: f"{seam.width:g}",
        "KIND": seam.kind,
        **({} if offset is None else {"TOOL_OFFSET": f"{offset[0]:.9g}, {offset[1]:.9g}"}),
        "UNITS": "mm",
        "GENERATOR": settings.generator,
    }


def write_seam_files(laminate: Laminate, folder: Path, settings: CutSettings) -> None:
    """Write the path of every seam under ``folder``.

    Raises OutputError if a file does not match its path when read back, OSError if it cannot be
    written.
    """
    for seam in laminate.seams:
        path = folder / seam_path(seam)
        path.parent.mkdir(parents=True, exist_ok=True)
        properties = seam_properties(seam, settings)
        x, y = settings.seam_offsets.get(seam.tool, CENTRED)
        text = seam_text(moved(seam.path, (-x, -y)), properties)
        path.write_text(text, encoding="utf-8", newline="\n")
        chains, written = read_seam(path)
        off = path_difference(moved(chains, (x, y)), seam.path)
        if off is not None or written != properties:
            raise OutputError(f"{path.name}: {off or 'its properties differ'}; regenerate it.")


def moved(chains: Chains, by: Point) -> tuple[tuple[Edge, ...], ...]:
    """Return chains moved by an offset in mm along x and y; the same chains for a zero offset."""
    if by == CENTRED:
        return tuple(map(tuple, chains))
    return tuple(tuple(shifted(edge, by) for edge in chain) for chain in chains)


def shift_words(tool: str, offset: Point) -> str:
    """Return the sentence about the shift of a tool's files, with the distance."""
    x, y = offset
    return f"files of the {tool} are shifted by {0.0 - x:.2f}, {0.0 - y:.2f} mm"


def read_seam(path: Path) -> tuple[tuple[tuple[Edge, ...], ...], dict[str, str]]:
    """Return the chains of a seam's file and its custom properties.

    Raises OutputError if the file holds anything else, or no path.
    """
    drawing = read_profile(path)
    strangers = [layer for layer, _ in drawing.strokes if layer not in (SEAM, REFERENCE)]
    if strangers or not drawing.region.is_empty:
        raise OutputError(
            f"{path.name}: it holds more than a path on {SEAM}; remove the content of "
            f"{strangers[0] if strangers else 'the layers of cuts'}, or regenerate it"
        )
    chains = tuple(edges for layer, edges in drawing.strokes if layer == SEAM)
    if not chains:
        raise OutputError(f"{path.name}: it has no path on {SEAM}; regenerate it")
    return chains, drawing.properties


def path_difference(chains: Chains, expected: Chains) -> str | None:
    """A description of a path's deviation from the expected one; None within a micrometre."""
    if len(chains) != len(expected):
        return f"it has {len(chains)} paths, not {len(expected)}"
    worst: tuple[float, Point] = (0.0, (0.0, 0.0))
    for ours, theirs in zip(expected, chains, strict=True):
        worst = max(worst, deviation(ours, theirs, TOLERANCE), deviation(theirs, ours, TOLERANCE))
        ends = (ours[0].start, theirs[0].start), (ours[-1].end, theirs[-1].end)
        worst = max(worst, *((math.dist(a, b), a) for a, b in ends))
    off, (x, y) = worst
    return None if off <= TOLERANCE else f"its path is {off:.3f} mm off at x {x:.3f}, y {y:.3f}"


def stated_width(properties: Mapping[str, str]) -> float | None:
    """Return the tool width stated in a seam's file, mm, or None."""
    try:
        width = float(properties.get(WIDTH, ""))
    except ValueError:
        return None
    return width if 0 < width < math.inf else None
