"""A mesh of second-order elements with its named sets, and the shape functions of its elements.

Node order follows Abaqus and CalculiX: corners first, then the middles of the edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.surface import Floats, Ints, Surface

ElementKind = Literal["wedge15", "tetra10", "triangle6"]

EDGES: dict[ElementKind, tuple[tuple[int, int], ...]] = {
    "triangle6": ((0, 1), (1, 2), (2, 0)),
    "tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "wedge15": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
}
"""Corners of each edge, in the order of the mid-edge nodes."""

FACES: dict[ElementKind, tuple[tuple[int, ...], ...]] = {
    "triangle6": ((0, 2, 1, 5, 4, 3), (0, 1, 2, 3, 4, 5)),
    "tetra10": (
        (0, 2, 1, 6, 5, 4),
        (0, 1, 3, 4, 8, 7),
        (1, 2, 3, 5, 9, 8),
        (0, 3, 2, 7, 9, 6),
    ),
    "wedge15": (
        (0, 2, 1, 8, 7, 6),
        (3, 4, 5, 9, 10, 11),
        (0, 1, 4, 3, 6, 13, 9, 12),
        (1, 2, 5, 4, 7, 14, 10, 13),
        (2, 0, 3, 5, 8, 12, 11, 14),
    ),
}
"""Nodes of each face, counter-clockwise seen from outside; face numbers are Abaqus's less one; a
triangle's faces are its lower side (SNEG) and its upper one (SPOS)."""

CORNERS: dict[ElementKind, int] = {"triangle6": 3, "tetra10": 4, "wedge15": 6}
VTK_TYPES = {"triangle": 5, "triangle6": 22, "tetra": 10, "tetra10": 24, "wedge15": 26}

_REFERENCE: dict[ElementKind, tuple[tuple[float, ...], ...]] = {
    "triangle6": ((0, 0), (1, 0), (0, 1)),
    "tetra10": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "wedge15": ((0, 0, -1), (1, 0, -1), (0, 1, -1), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
}
_THIRDS = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))
_TETRA = 0.1381966011250105
_GAUSS: dict[ElementKind, tuple[float, tuple[tuple[float, ...], ...]]] = {
    "triangle6": (1 / 6, _THIRDS),
    "tetra10": (
        1 / 24,
        tuple(
            tuple(1 - 3 * _TETRA if axis == place else _TETRA for axis in range(3))
            for place in range(4)
        ),
    ),
    "wedge15": (1 / 6, tuple((*p, t) for t in (-(3**-0.5), 3**-0.5) for p in _THIRDS)),
}
"""Weight and places of the integration points that integrate a Jacobian exactly."""


_PLANE = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_POWERS: dict[ElementKind, tuple[tuple[int, ...], ...]] = {
    "triangle6": _PLANE,
    "tetra10": tuple(powers for powers in product(range(3), repeat=3) if sum(powers) <= 2),
    "wedge15": (*((*p, t) for t in (0, 1) for p in _PLANE), *((*p, 2) for p in _PLANE[:3])),
}
"""Exponents of the monomials that shape functions are made of."""


@cache
def _shapes(kind: ElementKind, integration: bool) -> tuple[Floats, Floats]:
    """Return shape functions (places, nodes) and their derivatives (places, nodes, dimensions).

    Places are the element's nodes, or its integration points.
    """
    corners = np.array(_REFERENCE[kind], dtype=float)
    nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES[kind]]])
    powers = np.array(_POWERS[kind])
    shape = np.linalg.inv(np.prod(nodes[:, None, :] ** powers, axis=2))
    places = np.array(_GAUSS[kind][1]) if integration else nodes
    slopes = []
    for axis in range(powers.shape[1]):
        lowered = powers.copy()
        lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
        terms = np.prod(places[:, None, :] ** lowered, axis=2) * powers[:, axis]
        slopes.append(terms @ shape)
    return np.prod(places[:, None, :] ** powers, axis=2) @ shape, np.stack(slopes, axis=2)


def jacobians(kind: ElementKind, points: Floats, cells: Ints, integration: bool = False) -> Floats:
    """Return matrices (cells, places, space, dimensions) of the map from the reference element.

    Places are the element's nodes, or its integration points.
    """
    matrices: Floats = np.einsum(
        "cni,pnj->cpij", points[cells], _shapes(kind, integration)[1], optimize=True
    )
    return matrices


def scaled_jacobians(kind: ElementKind, points: Floats, cells: Ints) -> Floats:
    """Return the least scaled Jacobian of each cell at its nodes and integration points.

    It is the determinant over the product of the lengths of its columns: 1 for edges at right
    angles, 0.87 in an equilateral triangle, negative if the element is inverted.
    """
    least = np.full(len(cells), np.inf)
    for integration in (False, True):
        matrices = jacobians(kind, points, cells, integration)
        lengths = np.prod(np.linalg.norm(matrices, axis=2), axis=2)
        ratio = _determinant(matrices) / np.maximum(lengths, 1e-300)
        least = np.minimum(least, ratio.min(axis=1))
    return least


def volumes(kind: ElementKind, points: Floats, cells: Ints) -> Floats:
    """Return the volume of each cell in mm3, or the area in mm2 of triangles."""
    determinants = _determinant(jacobians(kind, points, cells, integration=True))
    sizes: Floats = np.sum(determinants, axis=1) * _GAUSS[kind][0]
    return sizes


def aspects(kind: ElementKind, points: Floats, cells: Ints) -> Floats:
    """Return the longest edge over the shortest of each cell, between its corners."""
    lengths = np.stack(
        [np.linalg.norm(points[cells[:, a]] - points[cells[:, b]], axis=1) for a, b in EDGES[kind]]
    )
    ratio: Floats = lengths.max(axis=0) / np.maximum(lengths.min(axis=0), 1e-300)
    return ratio


def _determinant(matrices: Floats) -> Floats:
    columns = np.moveaxis(matrices, -1, 0)
    if matrices.shape[-2:] == (2, 2):
        (a, b), (c, d) = np.moveaxis(columns, -1, 1)
        flat: Floats = a * d - b * c
        return flat
    normals = np.cross(columns[0], columns[1])
    if len(columns) == 3:
        third = columns[2]
    else:
        # A shell's normals are compared with their mean.
        third = normals.mean(axis=1, keepdims=True)
        third = third / np.linalg.norm(third, axis=2, keepdims=True)
    solid: Floats = np.sum(normals * third, axis=-1)
    return solid


def integrals(points: Floats, cells: Ints) -> tuple[Floats, Floats]:
    """Stiffness (cells, 6, 6) and load (cells, 6) of Poisson's equation on plane triangles."""
    matrices = jacobians("triangle6", points, cells, integration=True)
    sizes = _determinant(matrices) * _GAUSS["triangle6"][0]
    shapes, reference = _shapes("triangle6", integration=True)
    slopes = np.einsum("pnj,cpji->cpni", reference, np.linalg.inv(matrices), optimize=True)
    stiffness = np.einsum("cpni,cpmi,cp->cnm", slopes, slopes, sizes, optimize=True)
    return stiffness, np.einsum("pn,cp->cn", shapes, sizes)


# Prisms as tetrahedra, second-order triangles as flat ones.


TETRAHEDRA = (
    ((0, 0), (1, 0), (2, 0), (2, 2)),
    ((0, 0), (1, 2), (1, 0), (2, 2)),
    ((0, 0), (0, 2), (1, 2), (2, 2)),
)
"""Corners of the tetrahedra in a prism: its columns by rank, and the level (0 below, 2 above)."""


SIDE = (-1, 3, 5, 4)
"""The mid-edge node between two corners of a triangle, by the sum of their places."""


def tetrahedra(prisms: Ints, corners: Ints) -> Ints:
    """Return three tetrahedra (3 x m, 10) of second order for each prism, in its order.

    ``corners`` (m, 3) are the plane's nodes under each prism: the diagonal of a side starts at its
    lower corner with the smaller number, so that neighbours match.
    """
    side = np.array(SIDE)
    ranked = np.argsort(corners, axis=1)
    is_even = (ranked[:, 1] - ranked[:, 0]) % 3 == 1
    cells = np.empty((len(prisms), 3, 10), dtype=np.int64)
    rows = np.arange(len(prisms))
    for number, tetra in enumerate(TETRAHEDRA):
        # A mirrored prism swaps its first two corners.
        for turned, chosen in (((0, 1, 2, 3), is_even), ((1, 0, 2, 3), ~is_even)):
            ends = [tetra[place] for place in turned]
            pairs = [(end, end) for end in ends]
            pairs += [(ends[a], ends[b]) for a, b in EDGES["tetra10"]]
            for node, ((column, level), (second, second_level)) in enumerate(pairs):
                i, j = ranked[chosen, column], ranked[chosen, second]
                local = i if column == second else side[i + j]
                height = 3 * (level + second_level)
                cells[rows[chosen], number, node] = prisms[rows[chosen], height + local]
    return cells.reshape(-1, 10)


TRIANGLE_PARTS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""The four flat triangles through the nodes of a second-order one."""


SQUARE_PARTS = ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7))
"""The flat triangles through the nodes of a square one."""


# The mesh that every writer reads.


@dataclass(frozen=True)
class Mesh:
    """Elements of one kind, and named parts of them.

    ``points`` (n, 3) mm; ``cells`` (m, nodes) indices of points. ``node_sets`` and ``cell_sets``
    hold sorted indices; ``face_sets`` rows of cell and face number, as in ``FACES``. ``cavities``
    are closed surfaces (k, 3) of flat triangles in this mesh's nodes, counter- clockwise seen from
    outside of the air; inlets are closed by a patch. ``thickness`` is a shell's, in mm, one value
    per cell set. ``notes`` are sentences for the reader of a mesh file. ``materials`` names the
    film of each part of a volume mesh; for a bond it is the film that melts. ``rest`` (n, 3) are
    the points in the flat, stress-free laminate; None if the mesh itself is flat.
    """

    name: str
    kind: ElementKind
    points: Floats
    cells: Ints
    node_sets: Mapping[str, Ints] = field(default_factory=dict)
    cell_sets: Mapping[str, Ints] = field(default_factory=dict)
    face_sets: Mapping[str, Ints] = field(default_factory=dict)
    cavities: Mapping[str, Ints] = field(default_factory=dict)
    thickness: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    materials: Mapping[str, str] = field(default_factory=dict)
    rest: Floats | None = None

    @property
    def parts(self) -> dict[str, Ints]:
        """The cell sets that partition the cells: films and bonds, or a shell's thicknesses."""
        names = self.thickness or self.cell_sets
        return {name: self.cell_sets[name] for name in names}

    def nodes_of(self, faces: Ints) -> Iterator[Ints]:
        """Yield the nodes (n, 6 or 8) of faces (k, 2: cell and number), by their number."""
        for number, local in enumerate(FACES[self.kind]):
            yield self.cells[faces[faces[:, 1] == number, 0]][:, list(local)]

    def flat_triangles(self, faces: Ints) -> Ints:
        """Return faces (k, 2: cell and number) as flat triangles through all of their nodes."""
        triangles = [np.empty((0, 3), dtype=np.int64)]
        for nodes in self.nodes_of(faces):
            parts = TRIANGLE_PARTS if nodes.shape[1] == 6 else SQUARE_PARTS
            triangles += [nodes[:, list(part)] for part in parts]
        return np.concatenate(triangles)

    def surface(self, triangles: Ints) -> tuple[Surface, Ints]:
        """Return triangles of nodes as a separate surface, and the node of each of its points."""
        nodes, faces = np.unique(triangles, return_inverse=True)
        return Surface(self.points[nodes], faces.reshape(-1, 3)), nodes

    def cavity(self, name: str) -> tuple[Surface, Ints]:
        """Return a cavity as a separate surface, and the mesh node of each of its points."""
        return self.surface(self.cavities[name])

    def node_fields(self) -> dict[str, NDArray[np.uint8]]:
        """Return the node sets other than bonds, each as 0 or 1 per node."""
        return {
            name: _marked(len(self.points), nodes)
            for name, nodes in self.node_sets.items()
            if not name.startswith("bond_")
        }

    def cell_fields(self) -> dict[str, NDArray[np.int32] | NDArray[np.uint8]]:
        """``part``, the number of each cell's part from 1, and the face sets as 0 or 1 per cell."""
        part = np.zeros(len(self.cells), dtype=np.int32)
        for number, cells in enumerate(self.parts.values(), start=1):
            part[cells] = number
        faces = {
            name: _marked(len(self.cells), rows[:, 0]) for name, rows in self.face_sets.items()
        }
        return {"part": part, **faces}

    def linear(self) -> tuple[Floats, Ints, Ints]:
        """Return points, first-order tetrahedra or triangles through the corners, and the cell of
        each.

        Wedges become three tetrahedra each.
        """
        corners = self.cells[:, : CORNERS[self.kind]]
        owner = np.arange(len(corners))
        if self.kind == "wedge15":
            # The lower nodes' numbers decide the diagonal of a side, so that neighbours agree.
            prisms = np.repeat(corners, 3, axis=1)
            prisms[:, :3], prisms[:, 12:15] = corners[:, :3], corners[:, 3:]
            corners = tetrahedra(prisms, corners[:, :3])[:, :4]
            owner = np.repeat(owner, 3)
        nodes, cells = np.unique(corners, return_inverse=True)
        return self.points[nodes], cells.reshape(corners.shape), owner


def _marked(count: int, indices: Ints) -> NDArray[np.uint8]:
    return np.minimum(np.bincount(indices, minlength=count), 1).astype(np.uint8)
