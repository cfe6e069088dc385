"""The 40-plate task with sbafab: ``python -m benchmarks.plates_sbafab FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.task import FILLET, Plate, file_name, plates
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, union


def profile(plate: Plate) -> Region:
    lobes = [disc(axis, plate.lobe_radius) for axis in plate.axes]
    body = fillet(union([*lobes, disc((0.0, 0.0), plate.hub_radius)]), FILLET)
    bores = [disc(axis, plate.bore_radius) for axis in plate.axes]
    return body - union([*bores, disc((0.0, 0.0), plate.lumen_radius)])


def main(folder: Path) -> None:
    for index, plate in enumerate(plates()):
        text = dxf_text(cutting_sequence(profile(plate)), {})
        (folder / file_name(index)).write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
