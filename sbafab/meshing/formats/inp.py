"""INP for Abaqus and CalculiX, every set written out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.conforming.mesh import ElementKind, Mesh

TYPES: dict[ElementKind, str] = {"wedge15": "C3D15", "tetra10": "C3D10", "triangle6": "STRI65"}
"""Abaqus's names, also known to meshio; CalculiX uses them too, except S6 for STRI65."""
SHELL = "CalculiX calls the element STRI65 S6: change that word on the *ELEMENT lines for it."
SIDES = {0: "SNEG", 1: "SPOS"}
NODE = "%d, %.10g, %.10g, %.10g\n"
PER_LINE = 16


def write_inp(mesh: Mesh, path: Path) -> None:
    """Write nodes, elements, NSET, ELSET and SURFACE; numbers count from 1, lengths are mm."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        for line in _lines(mesh):
            file.write(line)


def _lines(mesh: Mesh) -> Iterator[str]:
    notes = [f"{mesh.name} mesh in mm", *mesh.notes]
    notes += [SHELL] if mesh.kind == "triangle6" else []
    yield "".join(f"** {note}\n" for note in notes)
    yield "*NODE, NSET=all_nodes\n"
    rows = zip(range(1, len(mesh.points) + 1), *mesh.points.T.tolist(), strict=True)
    yield "".join([NODE % row for row in rows])
    pattern = ", ".join(["%d"] * (mesh.cells.shape[1] + 1)) + "\n"
    for name, cells in mesh.parts.items():
        yield f"*ELEMENT, TYPE={TYPES[mesh.kind]}, ELSET={name}\n"
        nodes = (mesh.cells[cells] + 1).T.tolist()
        yield "".join(pattern % row for row in zip((cells + 1).tolist(), *nodes, strict=True))
    for name, cells in mesh.cell_sets.items():
        if name not in mesh.parts:
            yield f"*ELSET, ELSET={name}\n"
            yield from _listed(cells)
    yield "*ELSET, ELSET=all_elements\n"
    yield from (f"{name}\n" for name in mesh.parts)
    for name, nodes_of in mesh.node_sets.items():
        yield f"*NSET, NSET={name}\n"
        yield from _listed(nodes_of)
    for name, faces in mesh.face_sets.items():
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT\n"
        yield "".join(_faces(mesh.kind, faces.tolist()))


def _listed(numbers: NDArray[np.int64]) -> Iterator[str]:
    texts = [str(number + 1) for number in numbers.tolist()]
    for first in range(0, len(texts), PER_LINE):
        yield ", ".join(texts[first : first + PER_LINE]) + "\n"


def _faces(kind: ElementKind, faces: Iterable[tuple[int, int]]) -> Iterator[str]:
    for cell, face in faces:
        side = SIDES[face] if kind == "triangle6" else f"S{face + 1}"
        yield f"{cell + 1}, {side}\n"
