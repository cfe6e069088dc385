"""Volume and shell mesh of a layup: the triangulation swept through every film, with named sets.

Bonded faces share their nodes. Each mesh is checked: elements, skin, volumes and cavities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import OutputError
from sbafab.meshing.conforming.crossing import check_apart
from sbafab.meshing.conforming.layup import FormedFilm, Layup, MeshedVoid, round_tube
from sbafab.meshing.conforming.mesh import (
    CORNERS,
    FACES,
    TRIANGLE_PARTS,
    ElementKind,
    Mesh,
    scaled_jacobians,
    tetrahedra,
    volumes,
)
from sbafab.meshing.conforming.plane import Plane
from sbafab.meshing.surface import Surface, unpaired_edges

# The sweep: nodes and prisms of every film.


NONE = -1


@dataclass(frozen=True)
class Sweep:
    """Nodes and prisms of the swept films.

    ``prisms`` (m, 18) hold the six nodes of a triangle below, halfway up and above.
    ``lower``, ``middle`` and ``upper`` (plies, plane nodes) number the nodes of each film over
    the plane's, -1 if absent; ``joints`` the nodes halfway up the bond under each film.
    ``prism_of`` and ``joint_of`` (plies, triangles) number the prisms of films and bonds.
    """

    points: NDArray[np.float64]
    prisms: NDArray[np.int64]
    lower: NDArray[np.int64]
    middle: NDArray[np.int64]
    upper: NDArray[np.int64]
    joints: NDArray[np.int64]
    prism_of: NDArray[np.int64]
    joint_of: NDArray[np.int64]


def sweep(layup: Layup, forms: Sequence[FormedFilm], full_middles: bool) -> Sweep:
    """The films as prisms, bottom to top.

    If films lie on each other, they share the nodes in the closure of a bond; if gaps are kept,
    wedges join them. ``full_middles`` adds nodes halfway up over mid-edge nodes too, as
    tetrahedra need.
    """
    triangles = layup.plane.triangles
    shape = len(layup.plies), len(layup.plane.points)
    lower, middle, upper, joints = (np.full(shape, NONE, dtype=np.int64) for _ in range(4))
    prism_of, joint_of = (np.full((shape[0], len(triangles)), NONE) for _ in range(2))
    points: list[NDArray[np.float64]] = []
    prisms: list[NDArray[np.int64]] = []
    count = prism_count = 0

    def place(
        numbers: NDArray[np.int64], nodes: NDArray[np.int64], at: NDArray[np.float64]
    ) -> None:
        nonlocal count
        numbers[nodes] = np.arange(count, count + len(nodes))
        points.append(at[nodes])
        count += len(nodes)

    def fill(of: NDArray[np.int64], cells: NDArray[np.bool_], *levels: NDArray[np.int64]) -> None:
        nonlocal prism_count
        chosen = np.flatnonzero(cells)
        of[chosen] = np.arange(prism_count, prism_count + len(chosen))
        prisms.append(np.hstack([level[triangles[chosen]] for level in levels]))
        prism_count += len(chosen)

    def half_up(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        return nodes if full_middles else nodes[nodes < layup.plane.corners]

    for k, (ply, form) in enumerate(zip(layup.plies, forms, strict=True)):
        covered = np.unique(triangles[ply.cells])
        bonded = np.unique(triangles[ply.bonded])
        if not ply.gap:
            lower[k, bonded] = upper[k - 1, bonded] if k else NONE
        place(lower[k], covered[lower[k, covered] < 0], form.at(0.0))
        if ply.gap:
            below = forms[k - 1].at(layup.plies[k - 1].thickness)
            place(joints[k], half_up(bonded), (below + form.at(0.0)) / 2)
            fill(joint_of[k], ply.bonded, upper[k - 1], joints[k], lower[k])
        place(middle[k], half_up(covered), form.at(ply.thickness / 2))
        place(upper[k], covered, form.at(ply.thickness))
        fill(prism_of[k], ply.cells, lower[k], middle[k], upper[k])
    return Sweep(
        np.concatenate(points),
        np.concatenate(prisms),
        lower,
        middle,
        upper,
        joints,
        prism_of,
        joint_of,
    )


def wedges(prisms: NDArray[np.int64]) -> NDArray[np.int64]:
    """The prisms as wedges (m, 15) of second order."""
    return prisms[:, [0, 1, 2, 12, 13, 14, 3, 4, 5, 15, 16, 17, 6, 7, 8]]


# Cavities: the faces of a mesh that the air of a chamber presses on, and a closed surface.


BOTTOM, TOP, SIDES = 0, 1, 2
"""Numbers of a wedge's faces; the sides follow the triangle's edges."""


def neighbours(plane: Plane) -> NDArray[np.int64]:
    """The triangle (m, 3) beyond each side of each triangle, -1 without a neighbour."""
    middles = plane.triangles[:, 3:].ravel()
    order = np.argsort(middles, kind="stable")
    ranked = middles[order]
    twins = np.flatnonzero(ranked[1:] == ranked[:-1])
    beyond = np.full(len(middles), -1)
    beyond[order[twins]] = order[twins + 1] // 3
    beyond[order[twins + 1]] = order[twins] // 3
    return beyond.reshape(-1, 3)


def bordering(
    inside: NDArray[np.bool_], beside: NDArray[np.bool_], beyond: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of ``inside`` and their sides that lie against a triangle of ``other``."""
    # The last entry, False, stands for the outside of the plane.
    padded = np.append(beside, False)
    cells, sides = np.nonzero(inside[:, None] & padded[beyond])
    return cells, sides


def wetted(
    layup: Layup, swept: Sweep, void: MeshedVoid, beyond: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Prisms and their faces (k, 2) that the air of a void touches."""
    faces_of_void: list[NDArray[np.int64]] = []

    def add(prisms: NDArray[np.int64], faces: NDArray[np.int64] | int) -> None:
        faces_of_void.append(np.column_stack([prisms, np.broadcast_to(faces, prisms.shape)]))

    for k, cells in sorted(void.under.items()):
        below, above = layup.plies[k - 1].cells, layup.plies[k].cells
        add(swept.prism_of[k - 1][cells & below], TOP)
        add(swept.prism_of[k][cells & above], BOTTOM)
        if layup.plies[k].gap:
            bond, sides = bordering(layup.plies[k].bonded, cells, beyond)
            add(swept.joint_of[k][bond], SIDES + sides)
    for k, cells in sorted(void.in_films.items()):
        film, sides = bordering(layup.plies[k].cells, cells, beyond)
        add(swept.prism_of[k][film], SIDES + sides)
    return np.concatenate(faces_of_void)


def _sides(
    plane: Plane, triangles: NDArray[np.int64], sides: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Nodes (k, 3) of sides of triangles: start, end, middle."""
    nodes = plane.triangles[triangles]
    rows = np.arange(len(nodes))
    return np.column_stack(
        [nodes[rows, sides], nodes[rows, (sides + 1) % 3], nodes[rows, 3 + sides]]
    )


def mouths(
    layup: Layup, void: MeshedVoid, beyond: NDArray[np.int64]
) -> list[tuple[int, NDArray[np.int64]]]:
    """Return the places where a void ends without a bond: the ply above, and sides (k, 3) there."""
    plane = layup.plane
    on_symmetry = np.zeros((0, len(plane.points)), dtype=bool)
    if layup.sector is not None:
        on_symmetry = np.array([on for _, on in layup.sector.on_planes(plane.points)])
    openings = []
    for k, cells in sorted(void.under.items()):
        closed = np.append(cells | layup.plies[k].bonded, False)
        edges = _sides(plane, *np.nonzero(cells[:, None] & ~closed[beyond]))
        edges = edges[~on_symmetry[:, edges[:, :2]].all(axis=2).any(axis=0)]
        if len(edges):
            openings.append((k, edges))
    return openings


def mouth_patch(
    layup: Layup, swept: Sweep, ply: int, edges: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Triangles (k, 3) of mesh nodes between the two films at a void's mouth, out of the void."""
    low, high, half = swept.upper[ply - 1], swept.lower[ply], swept.joints[ply]
    triangles = []
    for a, b, m in edges.tolist():
        ring = [low[b], half[b], high[b], high[m], high[a], half[a], low[a]]
        ring = [int(node) for node in ring if node >= 0]
        if min(low[[a, b, m]].min(), high[[a, b, m]].min()) < 0:
            x, y = layup.plane.points[m]
            raise OutputError(
                f"A pocket under layer {layup.plies[ply].layer.index} opens at x {x:.3f}, "
                f"y {y:.3f} where one film only ends; let both films end there."
            )
        for p, q in pairwise(ring):
            if len({int(low[m]), p, q}) == 3:
                triangles.append((int(low[m]), p, q))
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def lids(
    layup: Layup, swept: Sweep, void: MeshedVoid, beyond: NDArray[np.int64]
) -> list[NDArray[np.int64]]:
    """Return triangles (k, 3) of mesh nodes over holes by which a void leaves it through a film.

    Such a hole leads to another chamber of its net, or to a tube; its rim is the lid's. Raises
    OutputError if the film ends at the hole.
    """
    of_holes = []
    for k, cells in sorted(void.under.items()):
        for ply, level, is_above in ((k - 1, swept.upper[k - 1], False), (k, swept.lower[k], True)):
            hole = cells & ~layup.plies[ply].cells
            if ply in void.in_films:
                hole &= ~void.in_films[ply]
            edges = _sides(layup.plane, *bordering(hole, ~hole, beyond))
            after = {a: (middle, b) for a, b, middle in edges.tolist()}
            while after:
                rim = [next(iter(after))]
                while rim[-1] in after:
                    rim += after.pop(rim[-1])
                lid = level[rim[:-1]]
                if lid.min() < 0:
                    x, y = layup.plane.points[rim[int(lid.argmin())]]
                    raise OutputError(
                        f"Layer {layup.plies[ply].layer.index} ends at x {x:.3f}, y {y:.3f} beside "
                        "a pocket; let the film go on round its hole."
                    )
                fan = [(lid[0], p, q) for p, q in pairwise(lid[1:])]
                of_holes.append(np.array(fan)[:, :: 1 if is_above else -1])
    return of_holes


SQUARE_PARTS = ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7))


def flat_triangles(
    kind: ElementKind, cells: NDArray[np.int64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The faces (k, 2: cell and face number) as flat triangles through all of their nodes."""
    parts_of_faces = [np.empty((0, 3), dtype=np.int64)]
    for number, local in enumerate(FACES[kind]):
        nodes = cells[faces[faces[:, 1] == number, 0]][:, list(local)]
        parts = TRIANGLE_PARTS if len(local) == 6 else SQUARE_PARTS
        parts_of_faces += [nodes[:, list(part)] for part in parts]
    return np.concatenate(parts_of_faces)


def faces_of_tetrahedra(
    prisms: NDArray[np.int64], tetrahedra: NDArray[np.int64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Prism faces (k, 2) as the faces of the three tetrahedra of each prism that lie in them."""
    wedge_corners = [[0, 1, 2], [12, 13, 14], [0, 1, 13, 12], [1, 2, 14, 13], [2, 0, 12, 14]]
    faces_by_side = []
    for number, local in enumerate(wedge_corners):
        owners = faces[faces[:, 1] == number, 0]
        nodes = prisms[owners][:, local]
        for part in range(3):
            cells = 3 * owners + part
            for face, of_tetra in enumerate(FACES["tetra10"]):
                corners = tetrahedra[cells][:, list(of_tetra[:3])]
                lies_in = (corners[:, :, None] == nodes[:, None, :]).any(axis=2).all(axis=1)
                chosen = cells[lies_in]
                faces_by_side.append(np.column_stack([chosen, np.full_like(chosen, face)]))
    rows = np.concatenate(faces_by_side)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


# Named parts of a mesh.


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


# The checks of a mesh before it is written.


VOLUME_TOLERANCE = 0.001


def check_mesh(mesh: Mesh, expected: Mapping[str, float]) -> None:
    """Raises OutputError if an element is inverted, skin or cavities are open, or a volume is off.

    ``expected`` gives the exact volume in mm3 of cell sets.
    """
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    worst = int(least.argmin())
    if least[worst] <= 0:
        x, y, z = mesh.points[mesh.cells[worst]].mean(axis=0)
        raise OutputError(
            f"{int((least <= 0).sum())} elements of the {mesh.name} mesh are inverted, the worst "
            f"at x {x:.3f}, y {y:.3f}, z {z:.3f}; ask for a smaller h or less fill."
        )
    # Flat triangles through all nodes tell two sides between the same corners apart.
    if mesh.kind != "triangle6" and len(
        unpaired_edges(flat_triangles(mesh.kind, mesh.cells, skin(mesh)))
    ):
        raise OutputError(
            f"The skin of the {mesh.name} mesh is not closed and manifold; move apart profiles "
            "that touch in one point, or change h."
        )
    sizes = volumes(mesh.kind, mesh.points, mesh.cells) if expected else np.empty(0)
    for name, volume in expected.items():
        meshed = float(sizes[mesh.cell_sets[name]].sum())
        if not abs(meshed - volume) <= VOLUME_TOLERANCE * volume:
            raise OutputError(
                f"The {mesh.name} mesh of {name} holds {meshed:.5f} mm3 where area x thickness "
                f"is {volume:.5f} mm3; ask for a smaller h."
            )
    for name, triangles in mesh.cavities.items():
        gaps = len(unpaired_edges(triangles))
        if gaps:
            raise OutputError(
                f"The cavity {name} of the {mesh.name} mesh is open at {gaps} edges; move apart "
                "profiles that touch in one point."
            )


def skin(mesh: Mesh) -> NDArray[np.int64]:
    """The faces (k, 2: cell and face number) that belong to one cell only."""
    size = len(mesh.points)
    keys, cells, numbers = [], [], []
    for number, local in enumerate(FACES[mesh.kind]):
        corners = np.sort(mesh.cells[:, [n for n in local if n < CORNERS[mesh.kind]]], axis=1)
        # Three corners identify a quadrilateral face.
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


# The shell mesh: mid-surfaces of second order, bonded films as one shell.


def thin(stack: Layup) -> Layup:
    """The layup with films of zero thickness: all mid-surfaces lie at z = 0."""
    plies = tuple(replace(ply, z=0.0, gap=0.0) for ply in stack.plies)
    return replace(stack, plies=plies, is_thick=False)


def shell_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The mid-surfaces of a thin layup, with their sets and cavities.

    Bonded films share one triangle, which carries the sum of their thicknesses. Cavities exclude
    the neck rings, which have the same air on both sides.
    Raises OutputError if a check fails.
    """
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    triangles = stack.plane.triangles
    numbers = np.full((len(stack.plies), len(stack.plane.points)), NONE)
    cell_of = np.full((len(stack.plies), len(triangles)), NONE)
    points: list[NDArray[np.float64]] = []
    cells: list[NDArray[np.int64]] = []
    count = cell_count = 0
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
        unbonded = np.flatnonzero(ply.cells & ~ply.bonded)
        cell_of[k, unbonded] = np.arange(cell_count, cell_count + len(unbonded))
        cells.append(numbers[k][triangles[unbonded]])
        cell_count += len(unbonded)
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
    pockets = {name: MeshedVoid({}, void.under) for name, void in stack.voids.items()}
    nodes, faces, cavities = _air(stack, swept, pockets, "triangle6", swept.prisms, _one_sided)
    films, sections, thickness = _shell_cell_sets(stack, swept)
    mesh = Mesh(
        "shell",
        "triangle6",
        swept.points,
        swept.prisms,
        nodes,
        {**films, **sections},
        faces,
        cavities,
        thickness,
    )
    check_mesh(mesh, {})
    return mesh


Sets = dict[str, NDArray[np.int64]]


def _air(
    stack: Layup,
    swept: Sweep,
    voids: Mapping[str, MeshedVoid],
    kind: ElementKind,
    cells: NDArray[np.int64],
    faces_of: Callable[[NDArray[np.int64]], NDArray[np.int64]],
) -> tuple[Sets, Sets, Sets]:
    """Node sets, face sets and cavities of a mesh; ``faces_of`` turns faces of prisms into its."""
    named, face_sets, cavities = node_sets(stack, swept), {}, {}
    beyond = neighbours(stack.plane)
    for name, void in voids.items():
        faces = faces_of(wetted(stack, swept, void, beyond))
        face_sets[f"cavity_{name}"] = faces
        patches = [
            mouth_patch(stack, swept, ply, edges) for ply, edges in mouths(stack, void, beyond)
        ]
        if patches:
            named[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if stack.sector is None:
            walls = flat_triangles(kind, cells, faces)[:, ::-1]
            covers = lids(stack, swept, stack.voids[name], beyond)
            cavities[name] = np.concatenate([walls, *patches, *covers])
    return named, face_sets, cavities


def _one_sided(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces of cells that the air touches on one side only."""
    _, first, times = np.unique(faces[:, 0], return_index=True, return_counts=True)
    one_sided: NDArray[np.int64] = faces[np.sort(first[times == 1])]
    return one_sided


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
    """The volume mesh with its sets and cavities. Raises OutputError if a check fails."""
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    is_tet = stack.settings.element == "tet"
    kind: ElementKind = "tetra10" if is_tet else "wedge15"
    swept = sweep(stack, forms, full_middles=is_tet)
    cells = wedges(swept.prisms)
    if is_tet:
        cells = tetrahedra(swept.prisms, _corners_under(stack, swept))

    def faces_of(faces: NDArray[np.int64]) -> NDArray[np.int64]:
        return faces_of_tetrahedra(swept.prisms, cells, faces) if is_tet else faces

    nodes, faces, cavities = _air(stack, swept, stack.voids, kind, cells, faces_of)
    growths = [form.growth for form in forms]
    cell_sets, expected = _cell_sets(stack, swept, 3 if is_tet else 1, growths)
    materials = {name: of for name, of in _materials(stack).items() if name in cell_sets}
    mesh = Mesh(
        "volume",
        kind,
        swept.points,
        cells,
        nodes,
        cell_sets,
        faces,
        cavities,
        materials=materials,
    )
    check_mesh(mesh, expected)
    return mesh


def swept_points(stack: Layup, forms: Sequence[FormedFilm]) -> NDArray[np.float64]:
    """The points of the volume mesh of these films."""
    return sweep(stack, forms, full_middles=stack.settings.element == "tet").points


def _materials(stack: Layup) -> dict[str, str]:
    """The material of every film and bond; a bond takes the lower film's if that melts."""
    materials = {ply.name: ply.layer.film.material for ply in stack.plies}
    for k, (below, above) in enumerate(pairwise(stack.plies), start=1):
        films = [ply.layer.film for ply in (below, above)]
        molten = [film for film in films if not film.stays_solid]
        materials[bond_name(k)] = (molten or films)[0].material
    return materials


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
    relative growths of the films.
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
