"""MSH 2.2 as text for Gmsh and the solvers around it, sets as physical groups."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.conforming.mesh import FACES, Mesh

NODE = "%d %.12g %.12g %.12g\n"
POINT, TRIANGLE6, SQUARE8 = 15, 9, 16
TYPES = {"triangle6": TRIANGLE6, "tetra10": 11, "wedge15": 18}
ORDER = {
    "triangle6": [0, 1, 2, 3, 4, 5],
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "wedge15": [0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10],
}
"""Our nodes in the order of Gmsh's."""


class Block(NamedTuple):
    """Elements of one type and physical group."""

    kind: int
    group: int
    cells: NDArray[np.int64]


def write_msh(mesh: Mesh, path: Path) -> None:
    """Write a mesh: films and bonds or sections, cavity walls of a volume, and node sets.

    Bonds of films that lie on each other have no group: their nodes are shared.
    """
    names: list[tuple[int, str]] = []
    blocks: list[Block] = []
    dimension = 2 if mesh.kind == "triangle6" else 3
    for name, cells in mesh.parts.items():
        names.append((dimension, name))
        nodes = mesh.cells[cells][:, ORDER[mesh.kind]]
        blocks.append(Block(TYPES[mesh.kind], len(names), nodes))
    if dimension == 3:
        for name, faces in mesh.face_sets.items():
            names.append((2, name))
            blocks += _walls(mesh, faces, len(names))
    for name, chosen in mesh.node_sets.items():
        if not name.startswith("bond_"):
            names.append((0, name))
            blocks.append(Block(POINT, len(names), chosen[:, None]))
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(names)}\n")
        for number, (of_dimension, name) in enumerate(names, start=1):
            file.write(f'{of_dimension} {number} "{name}"\n')
        file.write(f"$EndPhysicalNames\n$Nodes\n{len(mesh.points)}\n")
        rows = zip(range(1, len(mesh.points) + 1), *mesh.points.T.tolist(), strict=True)
        file.write("".join([NODE % row for row in rows]))
        file.write(f"$EndNodes\n$Elements\n{sum(len(block.cells) for block in blocks)}\n")
        first = 1
        for block in blocks:
            file.write(_elements(block, first))
            first += len(block.cells)
        file.write("$EndElements\n")


def _elements(block: Block, first: int) -> str:
    nodes = (block.cells + 1).T.tolist()
    pattern = f"%d {block.kind} 2 {block.group} {block.group}" + " %d" * len(nodes) + "\n"
    numbers = range(first, first + len(block.cells))
    return "".join([pattern % row for row in zip(numbers, *nodes, strict=True)])


def _walls(mesh: Mesh, faces: NDArray[np.int64], group: int) -> list[Block]:
    kinds: dict[int, list[NDArray[np.int64]]] = {}
    for number, local in enumerate(FACES[mesh.kind]):
        nodes = mesh.cells[faces[faces[:, 1] == number, 0]][:, list(local)]
        kinds.setdefault(TRIANGLE6 if len(local) == 6 else SQUARE8, []).append(nodes)
    return [Block(kind, group, np.concatenate(faces)) for kind, faces in kinds.items()]
