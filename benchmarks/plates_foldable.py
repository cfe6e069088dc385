"""The 40-plate task with foldable-robotics: ``python -m benchmarks.plates_foldable FOLDER``.

The library flattens circles; 64 chords a quadrant keep the area within 0.01 %. Its own
``export_dxf`` writes neither units nor closed polylines, so the paths go through ezdxf here.
"""

from __future__ import annotations

import sys
from pathlib import Path

import ezdxf
from foldable_robotics.layer import Layer
from shapely.geometry import Point

from benchmarks.task import FILLET, Plate, file_name, plates

CHORDS = 64


def disc(centre: tuple[float, float], radius: float) -> Layer:
    return Layer(Point(*centre)).dilate(radius, resolution=CHORDS)


def profile(plate: Plate) -> Layer:
    body = disc((0.0, 0.0), plate.hub_radius)
    for axis in plate.axes:
        body = body | disc(axis, plate.lobe_radius)
    body = body.dilate(FILLET, resolution=CHORDS).erode(FILLET, resolution=CHORDS)
    for axis in plate.axes:
        body = body - disc(axis, plate.bore_radius)
    return body - disc((0.0, 0.0), plate.lumen_radius)


def main(folder: Path) -> None:
    for index, plate in enumerate(plates()):
        document = ezdxf.new("R2010", units=ezdxf.units.MM)
        for path in profile(plate).get_paths():
            document.modelspace().add_lwpolyline(path[:-1], close=True)
        document.saveas(folder / file_name(index))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
