"""Named parts of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError
from sbafab.meshing.conforming.crossing import check_apart
from sbafab.meshing.conforming.layup import FormedFilm, Layup, MeshedVoid
from sbafab.meshing.conforming.mesh import (
    CORNERS,
    FACES,
    ElementKind,
    Mesh,
    scaled_jacobians,
    tetrahedra,
    volumes,
)
from sbafab.meshing.conforming.round_tube import round_tube
from sbafab.meshing.conforming.sweep import (
    NONE,
    Sweep,
    faces_of_tetrahedra,
    flat_triangles,
    mouth_patch,
    mouths,
    neighbours,
    open_sides,
    sweep,
    wedges,
    wetted,
)
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


def bond_name(ply: int) -> str:
    """The bond under a film, by its interface's index counted from 1."""
    return f"bond_{ply:03d}"


def node_sets(stack: Layup, swept: Sweep) -> dict[str, NDArray[np.int64]]:
    """Bonds, base, tip and symmetry planes."""
    triangles = stack.plane.triangles
    sets = {}
    for k, ply in enumerate(stack.plies):
        if ply.bonded.any():
            nodes = np.unique(triangles[ply.bonded])
            sets[bond_name(k)] = np.unique([swept.lower[k, nodes], swept.upper[k - 1, nodes]])
    bottom, top = stack.plies[0], stack.plies[-1]
    seat = bottom.cells if bottom.layer.role == "sheet" else stack.seats & bottom.cells
    sets["base"] = np.unique(swept.lower[0, np.unique(triangles[seat])])
    sets["tip"] = np.unique(swept.upper[-1, np.unique(triangles[stack.seats & top.cells])])
    if stack.sector is not None:
        for name, on_plane in stack.sector.on_planes(stack.plane.points):
            levels = (swept.lower, swept.middle, swept.upper, swept.joints)
            numbers = np.concatenate([level[:, on_plane].ravel() for level in levels])
            sets[name] = np.unique(numbers[numbers >= 0])
    return sets


# What must hold before a mesh is written.


VOLUME_TOLERANCE = 0.001


def check_mesh(mesh: Mesh, expected: Mapping[str, float]) -> None:
    """Raises OutputError where an element is inverted, the skin is not manifold or a volume off.

    ``expected`` gives the exact volume in mm3 of cell sets.
    """
    _check_jacobians(mesh)
    if mesh.kind != "triangle6":
        _check_skin(mesh)
    if expected:
        sizes = volumes(mesh.kind, mesh.points, mesh.cells)
        for name, volume in expected.items():
            found = float(sizes[mesh.cell_sets[name]].sum())
            if not abs(found - volume) <= VOLUME_TOLERANCE * volume:
                raise OutputError(
                    f"The {mesh.name} mesh of {name} holds {found:.5f} mm3 where area x thickness "
                    f"is {volume:.5f} mm3; ask for a smaller h."
                )


def check_cavities(mesh: Mesh) -> None:
    """Raises OutputError where a cavity's surface is not closed."""
    for name, triangles in mesh.cavities.items():
        gaps = open_sides(triangles)
        if gaps:
            raise OutputError(
                f"The cavity {name} of the {mesh.name} mesh is open at {gaps} edges; move apart "
                "profiles that touch in one point."
            )


def _check_jacobians(mesh: Mesh) -> None:
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    worst = int(least.argmin())
    if least[worst] <= 0:
        x, y, z = mesh.points[mesh.cells[worst]].mean(axis=0)
        raise OutputError(
            f"{int((least <= 0).sum())} elements of the {mesh.name} mesh are inverted, the worst "
            f"at x {x:.3f}, y {y:.3f}, z {z:.3f}; ask for a smaller h or less fill."
        )


def skin(mesh: Mesh) -> NDArray[np.int64]:
    """The faces (k, 2: cell and face number) that one cell alone has."""
    size = len(mesh.points)
    keys, cells, numbers = [], [], []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = np.sort(mesh.cells[:, [n for n in local if n < CORNERS[mesh.kind]]], axis=1)
        # Three of a square's corners tell it from every other face.
        keys.append((corners[:, 0] * size + corners[:, 1]) * size + corners[:, 2])
        cells.append(np.arange(len(corners)))
        numbers.append(np.full(len(corners), number))
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    twin = np.append(False, ranked[1:] == ranked[:-1])
    alone = order[~twin & ~np.append(twin[1:], False)]
    return np.column_stack([np.concatenate(cells)[alone], np.concatenate(numbers)[alone]])


def skin_surface(mesh: Mesh) -> Surface:
    """The skin of a volume mesh, cavities included, as flat triangles through all of its nodes."""
    triangles = flat_triangles(mesh.kind, mesh.cells, skin(mesh))
    nodes, faces = np.unique(triangles, return_inverse=True)
    return Surface(mesh.points[nodes], faces.reshape(-1, 3))


def _check_skin(mesh: Mesh) -> None:
    size = len(mesh.points)
    outer = skin(mesh)
    sides = []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = [n for n in local if n < CORNERS[mesh.kind]]
        nodes = mesh.cells[outer[outer[:, 1] == number, 0]][:, list(local)]
        for place in range(len(corners)):
            a, b = nodes[:, place], nodes[:, (place + 1) % len(corners)]
            # The middle tells apart two sides between the same corners.
            middle = nodes[:, len(corners) + place]
            sides.append(np.column_stack([a * size + b, b * size + a, middle]))
    forth, back, middle = np.concatenate(sides).T
    there = np.lexsort((middle, forth))
    here = np.lexsort((middle, back))
    is_closed = np.array_equal(forth[there], back[here]) and np.array_equal(
        middle[there], middle[here]
    )
    pairs = np.column_stack([forth[there], middle[there]])
    if not is_closed or (len(pairs) > 1 and (pairs[1:] == pairs[:-1]).all(axis=1).any()):
        raise OutputError(
            f"The skin of the {mesh.name} mesh is not closed and manifold; move apart profiles "
            "that touch in one point, or change h."
        )


# The shell mesh: mid-surfaces of second order, what is bonded as one shell of all its films.


def thin(stack: Layup) -> Layup:
    """The layup with films of no thickness on each other: all mid-surfaces lie at z = 0."""
    plies = tuple(replace(ply, z=0.0, gap=0.0) for ply in stack.plies)
    return replace(stack, plies=plies, is_thick=False)


def shell_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The mid-surfaces of a thin layup, with their sets and cavities.

    A triangle where films are bonded is one for all of them and carries the sum of their
    thicknesses. Cavities leave the neck rings out, which have the same air on both sides.
    Raises OutputError where a check fails.
    """
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    triangles = stack.plane.triangles
    numbers = np.full((len(stack.plies), len(stack.plane.points)), NONE)
    cell_of = np.full((len(stack.plies), len(triangles)), NONE)
    points: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    count = made = 0
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        covered = np.unique(triangles[ply.cells])
        if k:
            bonded = np.unique(triangles[ply.bonded])
            numbers[k, bonded] = numbers[k - 1, bonded]
            cell_of[k, ply.bonded] = cell_of[k - 1, ply.bonded]
        new = covered[numbers[k, covered] < 0]
        numbers[k, new] = np.arange(count, count + len(new))
        points.append(form.base[new])
        count += len(new)
        own = np.flatnonzero(ply.cells & ~ply.bonded)
        cell_of[k, own] = np.arange(made, made + len(own))
        cells.append(numbers[k][triangles[own]])
        made += len(own)
    nothing = np.full_like(numbers, NONE)
    swept = Sweep(
        np.concatenate(points),
        np.concatenate(cells),
        numbers,
        nothing,
        numbers,
        nothing,
        cell_of,
        np.full_like(cell_of, NONE),
    )
    mesh = _with_sets(stack, swept)
    check_mesh(mesh, {})
    check_cavities(mesh)
    return mesh


def _with_sets(stack: Layup, swept: Sweep) -> Mesh:
    named_nodes = node_sets(stack, swept)
    face_sets, cavities = {}, {}
    beyond = neighbours(stack.plane)
    for name, void in stack.voids.items():
        pockets = MeshedVoid({}, void.under, void.volume)
        faces = _one_sided(wetted(stack, swept, pockets, beyond))
        face_sets[f"cavity_{name}"] = faces
        patches = [
            mouth_patch(stack, swept, ply, edges) for ply, edges in mouths(stack, pockets, beyond)
        ]
        if patches:
            named_nodes[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if stack.sector is None:
            walls = flat_triangles("triangle6", swept.prisms, faces)[:, ::-1]
            cavities[name] = np.concatenate([walls, *patches])
    films, sections, thickness = _shell_cell_sets(stack, swept)
    return Mesh(
        "shell",
        "triangle6",
        swept.points,
        swept.prisms,
        named_nodes,
        {**films, **sections},
        face_sets,
        cavities,
        thickness,
    )


def _one_sided(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces of cells that the air touches on one side only."""
    _, first, times = np.unique(faces[:, 0], return_index=True, return_counts=True)
    kept: NDArray[np.int64] = faces[np.sort(first[times == 1])]
    return kept


def _shell_cell_sets(
    stack: Layup, swept: Sweep
) -> tuple[dict[str, NDArray[np.int64]], dict[str, NDArray[np.int64]], dict[str, float]]:
    """Cells of each film, cells of each thickness, and the thicknesses in mm."""
    films = {}
    total = np.zeros(len(swept.prisms))
    for ply, numbers in zip(stack.plies, swept.prism_of, strict=True):
        films[ply.name] = np.sort(numbers[numbers >= 0])
        total[films[ply.name]] += ply.thickness
    microns = np.round(total * 1000, 3)
    sections, thickness = {}, {}
    for value in np.unique(microns).tolist():
        name = f"section_{value:g}um".replace(".", "p")
        sections[name] = np.flatnonzero(microns == value)
        thickness[name] = value / 1000
    return films, sections, thickness


# The volume mesh with its sets and cavities, checked.


def volume_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The volume mesh with its sets and cavities. Raises OutputError where a check fails."""
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    is_tet = stack.settings.element == "tet"
    kind: ElementKind = "tetra10" if is_tet else "wedge15"
    swept = sweep(stack, forms, full_middles=is_tet)
    cells = wedges(swept.prisms)
    if is_tet:
        cells = tetrahedra(swept.prisms, _corners_under(stack, swept))
    named_nodes = node_sets(stack, swept)
    face_sets, cavities = {}, {}
    beyond = neighbours(stack.plane)
    for name, void in stack.voids.items():
        faces = wetted(stack, swept, void, beyond)
        if is_tet:
            faces = faces_of_tetrahedra(swept.prisms, cells, faces)
        face_sets[f"cavity_{name}"] = faces
        patches = [
            mouth_patch(stack, swept, ply, edges) for ply, edges in mouths(stack, void, beyond)
        ]
        if patches:
            named_nodes[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if stack.sector is None:
            walls = flat_triangles(kind, cells, faces)[:, ::-1]
            cavities[name] = np.concatenate([walls, *patches])
    cell_sets, expected = _cell_sets(
        stack, swept, 3 if is_tet else 1, [form.growth for form in forms]
    )
    mesh = Mesh(
        "volume",
        kind,
        swept.points,
        cells,
        named_nodes,
        cell_sets,
        face_sets,
        cavities,
        materials={name: of for name, of in _materials(stack).items() if name in cell_sets},
    )
    check_mesh(mesh, expected)
    check_cavities(mesh)
    return mesh


def swept_points(stack: Layup, forms: Sequence[FormedFilm]) -> NDArray[np.float64]:
    """The points alone of the volume mesh that these films have."""
    return sweep(stack, forms, full_middles=stack.settings.element == "tet").points


def _materials(stack: Layup) -> dict[str, str]:
    """The material of every film and bond; a bond is of the lower film if that melts."""
    found = {ply.name: ply.layer.film.material for ply in stack.plies}
    for k, (below, above) in enumerate(pairwise(stack.plies), start=1):
        films = [ply.layer.film for ply in (below, above)]
        molten = [film for film in films if not film.stays_solid]
        found[bond_name(k)] = (molten or films)[0].material
    return found


def _corners_under(stack: Layup, swept: Sweep) -> NDArray[np.int64]:
    """The plane's corner nodes (prisms, 3) under each prism."""
    under = np.empty((len(swept.prisms), 3), dtype=np.int64)
    for numbers in (*swept.prism_of, *swept.joint_of):
        under[numbers[numbers >= 0]] = stack.plane.triangles[numbers >= 0, :3]
    return under


def _cell_sets(
    stack: Layup, swept: Sweep, parts: int, growths: Sequence[float]
) -> tuple[dict[str, NDArray[np.int64]], dict[str, float]]:
    """Cells of every film and bond, and the volume in mm3 that each must have; ``growths`` are the
    parts by which films have grown.
    """
    sets, expected = {}, {}
    for k, ply in enumerate(stack.plies):
        for name, numbers, volume in (
            (bond_name(k), swept.joint_of[k], ply.bond_area * ply.gap),
            (ply.name, swept.prism_of[k], ply.area * ply.thickness),
        ):
            prisms = np.sort(numbers[numbers >= 0])
            if len(prisms):
                sets[name] = (parts * prisms[:, None] + np.arange(parts)).ravel()
                expected[name] = volume * (1 + growths[k])
    return sets, expected
