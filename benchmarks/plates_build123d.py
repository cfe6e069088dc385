"""The 40-plate task with build123d: ``python -m benchmarks.plates_build123d FOLDER``.

Its own fillets and offsets fail on some of the plates, so the outline is drawn from its arcs.
"""

from __future__ import annotations

import cmath
import math
import sys
from pathlib import Path

from build123d import Circle, ExportDXF, Pos, Sketch, ThreePointArc, Unit, Wire, make_face

from benchmarks.task import FILLET, LOBES, Plate, file_name, plates


def outline(plate: Plate) -> Wire:
    """Lobe, fillet, lobe, fillet: each pair turned on by one lobe."""
    lobe = complex(plate.axis_radius)
    half_turn = cmath.exp(1j * math.pi / LOBES)
    fillet = plate.fillet_axis_radius * half_turn
    last = lobe + plate.lobe_radius * (fillet - lobe) / abs(fillet - lobe)
    first = last.conjugate()
    following = first * half_turn**2
    arcs = [
        (first, lobe + plate.lobe_radius, last),
        (last, fillet - FILLET * half_turn, following),
    ]
    turns = [half_turn ** (2 * i) for i in range(LOBES)]
    return Wire(
        [
            ThreePointArc(*((p.real, p.imag) for p in (turn * point for point in arc)))
            for turn in turns
            for arc in arcs
        ]
    )


def profile(plate: Plate) -> Sketch:
    body = make_face(outline(plate))
    for x, y in plate.axes:
        body -= Pos(x, y) * Circle(plate.bore_radius)
    return body - Circle(plate.lumen_radius)


def main(folder: Path) -> None:
    for index, plate in enumerate(plates()):
        exporter = ExportDXF(unit=Unit.MM)
        exporter.add_shape(profile(plate))
        exporter.write(folder / file_name(index))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
