"""The first and second cut of registered sheets as LightBurn projects.

One project a pattern, for layers that share it have equal files. Each sheet's lower left corner
lies at (0, 0), in the first cut as in the second, so that both stand alike on the laser's bed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.lightburn import ENDING, project_text
from sbafab.cutting.lightburn_verify import verify_project
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, file_properties, kerf_suffix
from sbafab.cutting.second_cut import PATH, laser_path, marks, properties_of
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer

FOLDER = "sheets"
ADVICE = (
    "Powers are 0: set power and speed of each layer for this film. Leave kerf offset 0 and "
    "REFERENCE without output. The sheet's cut corner must be at the upper {side}"
)


def projects(laminate: Laminate, settings: CutSettings) -> Iterator[str]:
    """Paths of all projects; none where films are not cut as registered sheets."""
    if laminate.panel is not None:
        for layers in laminate.patterns.values():
            yield _path(layers[0], settings)
        yield Path(PATH).with_suffix(ENDING).as_posix()


def write_projects(
    laminate: Laminate, paths: Mapping[str, Region], folder: Path, settings: CutSettings
) -> None:
    """Writes and reads back ``sheets/<pattern>_<material>.lbrn2`` and ``second_cut.lbrn2``.

    ``paths`` holds the beam's path of every pattern's sheet. Raises OutputError, OSError.
    """
    panel = laminate.panel
    if panel is None:
        return
    x0, y0, x1, _ = panel.outline.bounds
    for pattern, layers in laminate.patterns.items():
        first = layers[0]
        # Mask sheets are drawn turned over.
        left, side = (-x1, "left") if first.is_mask else (x0, "right")
        said = file_properties(settings, first.film.material, pattern)
        target = folder / _path(first, settings)
        _write(target, paths[pattern].moved(-left, -y0), Surroundings(), said, side)
    drawn = marks(panel)
    moved = tuple(tuple((x - x0, y - y0) for x, y in run) for run in drawn.marks)
    path = laser_path(laminate, settings).moved(-x0, -y0)
    target = (folder / PATH).with_suffix(ENDING)
    _write(target, path, Surroundings(marks=moved), properties_of(laminate, settings), "right")


def _path(layer: Layer, settings: CutSettings) -> str:
    suffix = kerf_suffix(settings.kerf_width(layer.film.material))
    return f"{FOLDER}/{layer.pattern}_{layer.film.material}{suffix}{ENDING}"


def _write(
    target: Path, path: Region, around: Surroundings, properties: Mapping[str, str], side: str
) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    contours = cutting_order(path)
    text = project_text(contours, around, properties, ADVICE.format(side=side))
    target.write_bytes(text.encode())
    verify_project(target, contours, around)
