"""Elements of second order: where their nodes stand, and how well formed they are.

Node order is that of Abaqus and CalculiX: corners first, then the middles of the edges.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

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
"""Nodes of each face, counter-clockwise seen from outside; face numbers are those of Abaqus, less
one; a triangle's are its lower side (SNEG) and its upper one (SPOS)."""

CORNERS: dict[ElementKind, int] = {"triangle6": 3, "tetra10": 4, "wedge15": 6}

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


def _monomials(kind: ElementKind) -> tuple[tuple[int, ...], ...]:
    plane = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    if kind == "triangle6":
        return plane
    if kind == "wedge15":
        flat = tuple((*p, t) for t in (0, 1) for p in plane)
        return (*flat, *((*p, 2) for p in plane[:3]))
    space = [(i, j, k) for i in range(3) for j in range(3) for k in range(3)]
    return tuple(powers for powers in space if sum(powers) <= 2)


@cache
def _slopes(kind: ElementKind, integration: bool) -> NDArray[np.float64]:
    """Derivatives (places, nodes, dimensions) of the shape functions, at nodes or Gauss points."""
    import numpy as np

    corners = np.array(_REFERENCE[kind], dtype=float)
    nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES[kind]]])
    powers = np.array(_monomials(kind))
    shape = np.linalg.inv(np.prod(nodes[:, None, :] ** powers, axis=2))
    places = np.array(_GAUSS[kind][1]) if integration else nodes
    slopes = []
    for axis in range(powers.shape[1]):
        lowered = powers.copy()
        lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
        terms = np.prod(places[:, None, :] ** lowered, axis=2) * powers[:, axis]
        slopes.append(terms @ shape)
    return np.stack(slopes, axis=2)


def jacobians(
    kind: ElementKind,
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    integration: bool = False,
) -> NDArray[np.float64]:
    """Matrices (cells, places, space, dimensions) of the map from the reference element.

    Places are the element's nodes, or its integration points.
    """
    import numpy as np

    found: NDArray[np.float64] = np.einsum(
        "cni,pnj->cpij", points[cells], _slopes(kind, integration), optimize=True
    )
    return found


def scaled_jacobians(
    kind: ElementKind, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Least scaled Jacobian of each cell at its nodes and integration points.

    Determinant over the product of the lengths of its columns: 1 where edges are at right
    angles, 0.87 in an equilateral triangle, negative where the element is inverted.
    """
    import numpy as np

    least = np.full(len(cells), np.inf)
    for integration in (False, True):
        matrices = jacobians(kind, points, cells, integration)
        lengths = np.prod(np.linalg.norm(matrices, axis=2), axis=2)
        ratio = _determinant(matrices) / np.maximum(lengths, 1e-300)
        least = np.minimum(least, ratio.min(axis=1))
    return least


def volumes(
    kind: ElementKind, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Volume of each cell in mm3, or area in mm2 of triangles."""
    import numpy as np

    determinants = _determinant(jacobians(kind, points, cells, integration=True))
    found: NDArray[np.float64] = np.sum(determinants, axis=1) * _GAUSS[kind][0]
    return found


def aspects(
    kind: ElementKind, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Longest edge over shortest of each cell, between its corners."""
    import numpy as np

    lengths = np.stack(
        [np.linalg.norm(points[cells[:, a]] - points[cells[:, b]], axis=1) for a, b in EDGES[kind]]
    )
    ratio: NDArray[np.float64] = lengths.max(axis=0) / np.maximum(lengths.min(axis=0), 1e-300)
    return ratio


def _determinant(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    import numpy as np

    m = matrices
    if m.shape[-2:] == (2, 2):
        flat: NDArray[np.float64] = m[..., 0, 0] * m[..., 1, 1] - m[..., 0, 1] * m[..., 1, 0]
        return flat
    if m.shape[-2:] == (3, 2):
        normals = np.cross(m[..., 0], m[..., 1])
        mean = normals.mean(axis=1, keepdims=True)
        mean = mean / np.linalg.norm(mean, axis=2, keepdims=True)
        along: NDArray[np.float64] = np.sum(normals * mean, axis=2)
        return along
    solid: NDArray[np.float64] = np.einsum(
        "...i,...i->...", np.cross(m[..., 0], m[..., 1]), m[..., 2]
    )
    return solid


def integrals(
    points: NDArray[np.float64], cells: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness (cells, 6, 6) and load (cells, 6) of Poisson's equation on plane triangles."""
    import numpy as np

    matrices = jacobians("triangle6", points, cells, integration=True)
    sizes = _determinant(matrices) * _GAUSS["triangle6"][0]
    inverse = np.linalg.inv(matrices)
    slopes = np.einsum(
        "pnj,cpji->cpni", _slopes("triangle6", integration=True), inverse, optimize=True
    )
    stiffness = np.einsum("cpni,cpmi,cp->cnm", slopes, slopes, sizes, optimize=True)
    load = np.einsum("pn,cp->cn", _values(), sizes)
    return stiffness, load


def _values() -> NDArray[np.float64]:
    """Shape functions (places, 6) of the triangle at its integration points."""
    import numpy as np

    r, s = np.array(_GAUSS["triangle6"][1]).T
    q = 1 - r - s
    corners = [q * (2 * q - 1), r * (2 * r - 1), s * (2 * s - 1)]
    return np.column_stack([*corners, 4 * q * r, 4 * r * s, 4 * s * q])
