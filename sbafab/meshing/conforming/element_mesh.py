"""Volume and shell mesh of a layup: the triangulation swept through every film, with named sets.

Bonded faces share their nodes. Each mesh is checked: elements, skin, volumes and cavities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
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
from sbafab.meshing.solid import loops_of
from sbafab.meshing.surface import Surface, unpaired_edges

NumberArray = NDArray[np.int64]
Sets = dict[str, NumberArray]

# The sweep: nodes and prisms of every film.


class Sweep:
    """Nodes and cells of swept films, numbered as they are added.

    ``lower``, ``middle`` and ``upper`` (plies, plane nodes) number the nodes of each film over
    the plane's, -1 if absent; ``joints`` the nodes halfway up the bond under each film.
    ``cell_of`` and ``joint_of`` (plies, triangles) number the cells of films and bonds.
    """

    def __init__(self, stack: Layup) -> None:
        self.triangles = stack.plane.triangles
        plies = len(stack.plies)
        nodes, cells = (plies, len(stack.plane.points)), (plies, len(self.triangles))
        self.lower, self.middle, self.upper, self.joints = np.full((4, *nodes), -1)
        self.cell_of, self.joint_of = np.full((2, *cells), -1)
        self._points = [np.empty((0, 3))]
        self._cells: list[NumberArray] = []
        self._counts = [0, 0]

    @property
    def points(self) -> NDArray[np.float64]:
        """Points (n, 3) mm."""
        return np.concatenate(self._points)

    @property
    def cells(self) -> NumberArray:
        """Prisms (m, 18): six nodes of a triangle below, halfway up and above; or triangles."""
        return np.concatenate(self._cells)

    def place(self, numbers: NumberArray, nodes: NumberArray, at: NDArray[np.float64]) -> None:
        """Add points over nodes of the plane."""
        numbers[nodes] = self._counts[0] + np.arange(len(nodes))
        self._points.append(at[nodes])
        self._counts[0] += len(nodes)

    def fill(self, numbers: NumberArray, chosen: NDArray[np.bool_], *levels: NumberArray) -> None:
        """Add a cell over each chosen triangle."""
        (over,) = np.nonzero(chosen)
        numbers[over] = self._counts[1] + np.arange(len(over))
        self._cells.append(np.hstack([level[self.triangles[over]] for level in levels]))
        self._counts[1] += len(over)


def sweep(stack: Layup, forms: Sequence[FormedFilm]) -> Sweep:
    """The films as prisms, bottom to top.

    Films that lie on each other share the nodes of a bond, its edge included; if gaps are kept,
    prisms join them. Nodes halfway up over mid-edge nodes are for tetrahedra.
    """
    swept, is_tet = Sweep(stack), stack.settings.element == "tet"

    def half_up(nodes: NumberArray) -> NumberArray:
        return nodes if is_tet else nodes[nodes < stack.plane.corners]

    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        lower, middle, upper = swept.lower[k], swept.middle[k], swept.upper[k]
        covered, bonded = stack.nodes(ply.cells), stack.nodes(ply.bonded)
        if k and not ply.gap:
            lower[bonded] = swept.upper[k - 1, bonded]
        swept.place(lower, covered[lower[covered] < 0], form.at(0.0))
        if ply.gap:
            below = forms[k - 1].at(stack.plies[k - 1].thickness)
            joints = swept.joints[k]
            swept.place(joints, half_up(bonded), (below + form.at(0.0)) / 2)
            swept.fill(swept.joint_of[k], ply.bonded, swept.upper[k - 1], joints, lower)
        swept.place(middle, half_up(covered), form.at(ply.thickness / 2))
        swept.place(upper, covered, form.at(ply.thickness))
        swept.fill(swept.cell_of[k], ply.cells, lower, middle, upper)
    return swept


def swept_shell(stack: Layup, forms: Sequence[FormedFilm]) -> Sweep:
    """The films of a thin layup as triangles; bonded films share one."""
    swept = Sweep(stack)
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        numbers = swept.lower[k]
        if k:
            bonded = stack.nodes(ply.bonded)
            numbers[bonded] = swept.lower[k - 1, bonded]
            swept.cell_of[k, ply.bonded] = swept.cell_of[k - 1, ply.bonded]
        covered = stack.nodes(ply.cells)
        swept.place(numbers, covered[numbers[covered] < 0], form.base)
        swept.fill(swept.cell_of[k], ply.cells & ~ply.bonded, numbers)
    swept.upper = swept.lower
    return swept


# Cavities: the faces of a mesh that the air of a chamber presses on, and a closed surface.


BOTTOM, TOP, SIDES = 0, 1, 2
"""NumberArray of a wedge's faces; the sides follow the triangle's edges."""


def neighbours(triangles: NumberArray) -> NumberArray:
    """The triangle (m, 3) beyond each side of each triangle, -1 without a neighbour."""
    middles = triangles[:, 3:].ravel()
    order = np.argsort(middles, kind="stable")
    twins = np.flatnonzero(np.diff(middles[order]) == 0)
    beyond = np.full(len(middles), -1)
    beyond[order[twins]] = order[twins + 1] // 3
    beyond[order[twins + 1]] = order[twins] // 3
    return beyond.reshape(-1, 3)


def bordering(
    inside: NDArray[np.bool_], beside: NDArray[np.bool_], beyond: NumberArray
) -> tuple[NumberArray, NumberArray]:
    """Triangles of ``inside`` and their sides that lie against a triangle of ``beside``."""
    # The last entry, False, stands for the outside of the plane.
    cells, sides = np.nonzero(inside[:, None] & np.append(beside, False)[beyond])
    return cells, sides


def wetted(stack: Layup, swept: Sweep, void: MeshedVoid, beyond: NumberArray) -> NumberArray:
    """Cells and their faces (k, 2) that the air of a void touches."""
    parts: list[tuple[NumberArray, NumberArray | int]] = []
    for k, cells in sorted(void.under.items()):
        parts.append((swept.cell_of[k - 1][cells & stack.plies[k - 1].cells], TOP))
        parts.append((swept.cell_of[k][cells & stack.plies[k].cells], BOTTOM))
        if stack.plies[k].gap:
            bond, sides = bordering(stack.plies[k].bonded, cells, beyond)
            parts.append((swept.joint_of[k][bond], SIDES + sides))
    for k, cells in sorted(void.in_films.items()):
        film, sides = bordering(stack.plies[k].cells, cells, beyond)
        parts.append((swept.cell_of[k][film], SIDES + sides))
    return np.concatenate([np.column_stack(np.broadcast_arrays(*part)) for part in parts])


def _sides(stack: Layup, triangles: NumberArray, sides: NumberArray) -> NumberArray:
    """Nodes (k, 3) of sides of triangles: start, end, middle."""
    nodes = stack.plane.triangles[triangles]
    places = np.column_stack([sides, (sides + 1) % 3, 3 + sides])
    return np.take_along_axis(nodes, places, axis=1)


def mouths(stack: Layup, swept: Sweep, void: MeshedVoid, beyond: NumberArray) -> list[NumberArray]:
    """Triangles (k, 3) of mesh nodes over each place where a void ends without a bond."""
    points = stack.plane.points
    patches = []
    for k, cells in sorted(void.under.items()):
        closed = np.append(cells | stack.plies[k].bonded, False)
        edges = _sides(stack, *np.nonzero(cells[:, None] & ~closed[beyond]))
        if stack.sector is not None:
            on_planes = np.array([on for _, on in stack.sector.on_planes(points)])
            edges = edges[~on_planes[:, edges[:, :2]].all(axis=2).any(axis=0)]
        if len(edges):
            patches.append(_mouth_patch(stack, swept, k, edges))
    return patches


def _mouth_patch(stack: Layup, swept: Sweep, ply: int, edges: NumberArray) -> NumberArray:
    """Triangles (k, 3) between the two films at a void's mouth, out of the void."""
    low, high, half = swept.upper[ply - 1], swept.lower[ply], swept.joints[ply]
    triangles = []
    for a, b, m in edges.tolist():
        if min(low[[a, b, m]].min(), high[[a, b, m]].min()) < 0:
            x, y = stack.plane.points[m]
            raise OutputError(
                f"A pocket under layer {stack.plies[ply].layer.index} opens at x {x:.3f}, "
                f"y {y:.3f} where one film only ends; let both films end there."
            )
        ring = [low[b], half[b], high[b], high[m], high[a], half[a], low[a]]
        sides = pairwise(int(node) for node in ring if node >= 0)
        triangles += [(int(low[m]), p, q) for p, q in sides if len({int(low[m]), p, q}) == 3]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def lids(stack: Layup, swept: Sweep, void: MeshedVoid, beyond: NumberArray) -> list[NumberArray]:
    """Return triangles (k, 3) of mesh nodes over holes by which a void leaves it through a film.

    Such a hole leads to another chamber of its net, or to a tube; its rim is the lid's. Raises
    OutputError if the film ends at the hole.
    """
    covers = []
    for k, cells in sorted(void.under.items()):
        for ply, level, way in ((k - 1, swept.upper[k - 1], -1), (k, swept.lower[k], 1)):
            hole = cells & ~stack.plies[ply].cells
            hole &= ~void.in_films.get(ply, np.zeros_like(hole))
            edges = _sides(stack, *bordering(hole, ~hole, beyond))
            for rim in loops_of(np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])):
                lid = level[rim]
                if lid.min() < 0:
                    x, y = stack.plane.points[rim[int(lid.argmin())]]
                    raise OutputError(
                        f"Layer {stack.plies[ply].layer.index} ends at x {x:.3f}, y {y:.3f} beside "
                        "a pocket; let the film go on round its hole."
                    )
                fan = [(lid[0], p, q) for p, q in pairwise(lid[1:])]
                covers.append(np.array(fan)[:, ::way])
    return covers


def _air(
    stack: Layup,
    swept: Sweep,
    voids: Mapping[str, MeshedVoid],
    kind: ElementKind,
    cells: NumberArray,
    faces_of: Callable[[NumberArray], NumberArray],
) -> tuple[Sets, Sets, Sets]:
    """Node sets, face sets and cavities of a mesh; ``faces_of`` turns faces of prisms into its."""
    named, face_sets, cavities = node_sets(stack, swept), {}, {}
    beyond = neighbours(stack.plane.triangles)
    for name, void in voids.items():
        faces = faces_of(wetted(stack, swept, void, beyond))
        face_sets[f"cavity_{name}"] = faces
        patches = mouths(stack, swept, void, beyond)
        if patches:
            named[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if stack.sector is None:
            walls = flat_triangles(kind, cells, faces)[:, ::-1]
            covers = lids(stack, swept, stack.voids[name], beyond)
            cavities[name] = np.concatenate([walls, *patches, *covers])
    return named, face_sets, cavities


# Faces of elements.


SQUARE_PARTS = ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7))


def flat_triangles(kind: ElementKind, cells: NumberArray, faces: NumberArray) -> NumberArray:
    """The faces (k, 2: cell and face number) as flat triangles through all of their nodes."""
    parts_of_faces = [np.empty((0, 3), dtype=np.int64)]
    for number, local in enumerate(FACES[kind]):
        nodes = cells[faces[faces[:, 1] == number, 0]][:, list(local)]
        parts = TRIANGLE_PARTS if len(local) == 6 else SQUARE_PARTS
        parts_of_faces += [nodes[:, list(part)] for part in parts]
    return np.concatenate(parts_of_faces)


def faces_of_tetrahedra(
    prisms: NumberArray, tetrahedra: NumberArray, faces: NumberArray
) -> NumberArray:
    """Prism faces (k, 2) as the faces of the three tetrahedra of each prism that lie in them."""
    wedge_corners = [[0, 1, 2], [12, 13, 14], [0, 1, 13, 12], [1, 2, 14, 13], [2, 0, 12, 14]]
    rows_of_faces = []
    for number, local in enumerate(wedge_corners):
        owners = faces[faces[:, 1] == number, 0]
        nodes = prisms[owners][:, None, None, local]
        cells = 3 * owners[:, None] + np.arange(3)
        for face, of_tetra in enumerate(FACES["tetra10"]):
            corners = tetrahedra[cells][:, :, list(of_tetra[:3]), None]
            chosen = cells[(corners == nodes).any(axis=3).all(axis=2)]
            rows_of_faces.append(np.column_stack([chosen, np.full_like(chosen, face)]))
    rows = np.concatenate(rows_of_faces)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


def skin(mesh: Mesh) -> NumberArray:
    """The faces (k, 2: cell and face number) that belong to one cell only."""
    size, count = len(mesh.points), len(mesh.cells)
    keys = []
    for local in FACES[mesh.kind]:
        corners = np.sort(mesh.cells[:, [n for n in local if n < CORNERS[mesh.kind]]], axis=1)
        # Three corners identify a quadrilateral face.
        keys.append((corners[:, 0] * size + corners[:, 1]) * size + corners[:, 2])
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    twin = np.append(False, np.diff(key[order]) == 0)
    alone = order[~twin & ~np.append(twin[1:], False)]
    return np.column_stack([alone % count, alone // count])


def skin_surface(mesh: Mesh) -> Surface:
    """The skin of a volume mesh, cavities included, as flat triangles through all of its nodes."""
    return mesh.surface(flat_triangles(mesh.kind, mesh.cells, skin(mesh)))[0]


# Named parts of a mesh.


def bond_name(ply: int) -> str:
    """The bond under a film, by its interface's index counted from 1."""
    return f"bond_{ply:03d}"


def node_sets(stack: Layup, swept: Sweep) -> Sets:
    """Bonds, base, tip and symmetry planes."""
    sets = {}
    for k, ply in enumerate(stack.plies):
        if ply.bonded.any():
            nodes = stack.nodes(ply.bonded)
            sets[bond_name(k)] = np.unique([swept.lower[k, nodes], swept.upper[k - 1, nodes]])
    bottom, top = stack.plies[0], stack.plies[-1]
    seat = bottom.cells if bottom.layer.role == "sheet" else stack.seats & bottom.cells
    sets["base"] = np.unique(swept.lower[0, stack.nodes(seat)])
    sets["tip"] = np.unique(swept.upper[-1, stack.nodes(stack.seats & top.cells)])
    if stack.sector is not None:
        levels = np.concatenate([swept.lower, swept.middle, swept.upper, swept.joints])
        for name, on_plane in stack.sector.on_planes(stack.plane.points):
            numbers = levels[:, on_plane]
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
    sizes = volumes(mesh.kind, mesh.points, mesh.cells)
    for name, volume in expected.items():
        meshed = float(sizes[mesh.cell_sets[name]].sum())
        if not abs(meshed - volume) <= VOLUME_TOLERANCE * volume:
            raise OutputError(
                f"The {mesh.name} mesh of {name} holds {meshed:.5f} mm3 where area x thickness "
                f"is {volume:.5f} mm3; ask for a smaller h."
            )
    for name, triangles in mesh.cavities.items():
        if gaps := len(unpaired_edges(triangles)):
            raise OutputError(
                f"The cavity {name} of the {mesh.name} mesh is open at {gaps} edges; move apart "
                "profiles that touch in one point."
            )


# The shell mesh: mid-surfaces of second order, bonded films as one shell.


def thin(stack: Layup) -> Layup:
    """The layup with films of zero thickness: all mid-surfaces lie at z = 0."""
    plies = tuple(replace(ply, z=0.0, gap=0.0) for ply in stack.plies)
    return replace(stack, plies=plies, is_thick=False)


def shell_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The mid-surfaces of a thin layup, with their sets and cavities.

    Bonded films share one triangle, which carries the sum of their thicknesses. Cavities exclude
    the neck rings, which have the same air on both sides. Raises OutputError if a check fails.
    """
    check_apart(stack, forms)
    swept = swept_shell(stack, round_tube(stack, forms))
    pockets = {name: MeshedVoid({}, void.under) for name, void in stack.voids.items()}
    nodes, faces, cavities = _air(stack, swept, pockets, "triangle6", swept.cells, _one_sided)
    films, thickness = {}, np.zeros(len(swept.cells))
    for ply, numbers in zip(stack.plies, swept.cell_of, strict=True):
        films[ply.name] = np.sort(numbers[numbers >= 0])
        thickness[films[ply.name]] += ply.thickness
    microns = np.round(thickness * 1000, 3)
    names = {f"section_{um:g}um".replace(".", "p"): um for um in np.unique(microns).tolist()}
    sections = {name: np.flatnonzero(microns == um) for name, um in names.items()}
    mesh = Mesh(
        "shell",
        "triangle6",
        swept.points,
        swept.cells,
        nodes,
        {**films, **sections},
        faces,
        cavities,
        {name: um / 1000 for name, um in names.items()},
    )
    check_mesh(mesh, {})
    return mesh


def _one_sided(faces: NumberArray) -> NumberArray:
    """The faces of cells that the air touches on one side only."""
    _, first, times = np.unique(faces[:, 0], return_index=True, return_counts=True)
    one_sided: NumberArray = faces[np.sort(first[times == 1])]
    return one_sided


# The volume mesh with its sets and cavities, checked.


def volume_mesh(stack: Layup, forms: Sequence[FormedFilm]) -> Mesh:
    """The volume mesh with its sets and cavities. Raises OutputError if a check fails."""
    check_apart(stack, forms)
    forms = round_tube(stack, forms)
    swept = sweep(stack, forms)
    prisms = swept.cells
    is_tet = stack.settings.element == "tet"
    if is_tet:
        cells = tetrahedra(prisms, _corners_under(stack, swept))
    else:
        cells = prisms[:, [0, 1, 2, 12, 13, 14, 3, 4, 5, 15, 16, 17, 6, 7, 8]]

    def faces_of(faces: NumberArray) -> NumberArray:
        return faces_of_tetrahedra(prisms, cells, faces) if is_tet else faces

    kind: ElementKind = "tetra10" if is_tet else "wedge15"
    nodes, faces, cavities = _air(stack, swept, stack.voids, kind, cells, faces_of)
    cell_sets, expected, materials = {}, {}, {}
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        films = [each.layer.film for each in stack.plies[max(k - 1, 0) : k + 1]]
        # A bond takes the lower film's material if that melts.
        bond = ([film for film in films if not film.stays_solid] or films)[0]
        for name, numbers, volume, film in (
            (bond_name(k), swept.joint_of[k], ply.bond_area * ply.gap, bond),
            (ply.name, swept.cell_of[k], ply.area * ply.thickness, ply.layer.film),
        ):
            parts = 3 if is_tet else 1
            of_part = np.sort(numbers[numbers >= 0])
            if len(of_part):
                cell_sets[name] = (parts * of_part[:, None] + np.arange(parts)).ravel()
                expected[name] = volume * (1 + form.growth)
                materials[name] = film.material
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


def _corners_under(stack: Layup, swept: Sweep) -> NumberArray:
    """The plane's corner nodes (prisms, 3) under each prism."""
    under = np.empty((len(swept.cells), 3), dtype=np.int64)
    for numbers in (*swept.cell_of, *swept.joint_of):
        under[numbers[numbers >= 0]] = stack.plane.triangles[numbers >= 0, :3]
    return under
