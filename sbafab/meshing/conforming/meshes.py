"""Volume and shell mesh: the triangulation extruded through every film, with named sets; and files.

Bonded faces share their nodes. Each mesh is checked: elements, skin, volumes and cavities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.fill import filled, pockets
from sbafab.meshing.conforming.layup import (
    FormedFilm,
    Layup,
    MeshedVoid,
    MeshSettings,
    Symmetry,
    formed,
    layup,
)
from sbafab.meshing.conforming.mesh import (
    CORNERS,
    FACES,
    ElementKind,
    Mesh,
    aspects,
    jacobians,
    scaled_jacobians,
    tetrahedra,
    volumes,
)
from sbafab.meshing.formats import MeshFile, MeshFormat, conforming_endings, mesh_formats
from sbafab.meshing.solid import loops_of
from sbafab.meshing.surface import Flags, Floats, Ints, unpaired_edges

Sets = dict[str, Ints]

# The sweep: nodes and prisms, or the triangles of a shell, of every film.


class Sweep:
    """Nodes and cells of the films of a layup, bottom to top.

    Films that touch share the nodes of a bond, including its edge; if gaps are kept, prisms join
    them. Films of a thin layup are triangles; bonded films share one.

    ``forms`` are the films at ``heights`` over the plane, by default flat. ``lower``, ``middle``
    and ``upper`` (plies, plane nodes) number the nodes of each film over the plane's, -1 if absent;
    ``joints`` the nodes halfway up the bond under each film.
    ``cell_of`` and ``joint_of`` (plies, triangles) number the cells of films and bonds.
    """

    def __init__(self, stack: Layup, heights: Floats | None = None) -> None:
        self.stack, self.forms = stack, formed(stack, heights)
        plies = len(stack.plies)
        nodes, cells = (plies, len(stack.plane.points)), (plies, len(stack.plane.triangles))
        self.lower, self.middle, self.upper, self.joints = np.full((4, *nodes), -1)
        self.cell_of, self.joint_of = np.full((2, *cells), -1)
        self._points = [np.empty((0, 3))]
        self._cells: list[Ints] = []
        self._counts = [0, 0]
        for k in range(plies):
            self._add(k, self.forms[k], self.forms[k - 1])

    @cached_property
    def beyond(self) -> Ints:
        """The triangle (m, 3) beyond each side of each triangle, -1 if there is none."""
        middles = self.stack.plane.triangles[:, 3:].ravel()
        order = np.argsort(middles, kind="stable")
        twins = np.flatnonzero(np.diff(middles[order]) == 0)
        beyond = np.full(len(middles), -1)
        beyond[order[twins]] = order[twins + 1] // 3
        beyond[order[twins + 1]] = order[twins] // 3
        return beyond.reshape(-1, 3)

    @property
    def points(self) -> Floats:
        """Points (n, 3) mm."""
        return np.concatenate(self._points)

    @property
    def cells(self) -> Ints:
        """Prisms (m, 18): the six nodes of a triangle below, halfway up and above; or triangles."""
        return np.concatenate(self._cells)

    def _add(self, k: int, form: FormedFilm, below: FormedFilm) -> None:
        stack, ply = self.stack, self.stack.plies[k]
        covered, bonded = stack.nodes(ply.cells), stack.nodes(ply.bonded)
        lower, middle, upper, joints = self.lower[k], self.middle[k], self.upper[k], self.joints[k]
        if not ply.gap:
            lower[bonded] = self.upper[k - 1, bonded]
        self._place(lower, covered[lower[covered] < 0], form.base)
        if not stack.is_thick:
            self.cell_of[k, ply.bonded] = self.cell_of[k - 1, ply.bonded]
            self._fill(self.cell_of[k], ply.cells & ~ply.bonded, lower)
            upper[:] = lower
            return
        if ply.gap:
            top = below.at(stack.plies[k - 1].thickness)
            self._place(joints, self._half_up(bonded), (top + form.base) / 2)
            self._fill(self.joint_of[k], ply.bonded, self.upper[k - 1], joints, lower)
        self._place(middle, self._half_up(covered), form.at(ply.thickness / 2))
        self._place(upper, covered, form.at(ply.thickness))
        self._fill(self.cell_of[k], ply.cells, lower, middle, upper)

    def _half_up(self, nodes: Ints) -> Ints:
        """Return those with a node halfway up: mid-edge nodes have one for tetrahedra only."""
        is_tet = self.stack.settings.element == "tet"
        return nodes if is_tet else nodes[nodes < self.stack.plane.corners]

    def _place(self, numbers: Ints, nodes: Ints, at: Floats) -> None:
        """Add points over nodes of the plane."""
        numbers[nodes] = self._counts[0] + np.arange(len(nodes))
        self._points.append(at[nodes])
        self._counts[0] += len(nodes)

    def _fill(self, numbers: Ints, chosen: Flags, *levels: Ints) -> None:
        """Add a cell over each chosen triangle."""
        (over,) = np.nonzero(chosen)
        numbers[over] = self._counts[1] + np.arange(len(over))
        triangles = self.stack.plane.triangles[over]
        self._cells.append(np.hstack([level[triangles] for level in levels]))
        self._counts[1] += len(over)


# Cavities: the faces of a mesh that the air of a chamber presses on, and a closed surface.


BOTTOM, TOP, SIDES = 0, 1, 2
"""Numbers of a wedge's faces; the sides follow the triangle's edges."""


def _bordering(swept: Sweep, inside: Flags, beside: Flags) -> tuple[Ints, Ints]:
    """Return triangles of ``inside`` and their sides that adjoin a triangle of ``beside``."""
    # The last entry, False, stands for the outside of the plane.
    cells, sides = np.nonzero(inside[:, None] & np.append(beside, False)[swept.beyond])
    return cells, sides


def _edges(swept: Sweep, triangles: Ints, sides: Ints) -> Ints:
    """Return nodes (k, 3) of the plane on sides of triangles: start, end, middle."""
    places = np.column_stack([sides, (sides + 1) % 3, 3 + sides])
    return np.take_along_axis(swept.stack.plane.triangles[triangles], places, axis=1)


def wetted(swept: Sweep, void: MeshedVoid) -> Ints:
    """Return cells and their faces (k, 2) in contact with the air of a void."""
    parts: list[tuple[Ints, Ints | int]] = []
    plies = swept.stack.plies
    for k, cells in sorted(void.under.items()):
        parts.append((swept.cell_of[k - 1][cells & plies[k - 1].cells], TOP))
        parts.append((swept.cell_of[k][cells & plies[k].cells], BOTTOM))
        if plies[k].gap:
            bond, sides = _bordering(swept, plies[k].bonded, cells)
            parts.append((swept.joint_of[k][bond], SIDES + sides))
    for k, cells in sorted(void.in_films.items()) if swept.stack.is_thick else ():
        film, sides = _bordering(swept, plies[k].cells, cells)
        parts.append((swept.cell_of[k][film], SIDES + sides))
    return np.concatenate([np.column_stack(np.broadcast_arrays(*part)) for part in parts])


def mouths(swept: Sweep, void: MeshedVoid) -> list[Ints]:
    """Return triangles (k, 3) of mesh nodes over each place where a void ends without a bond."""
    stack, patches = swept.stack, []
    for k, cells in sorted(void.under.items()):
        closed = np.append(cells | stack.plies[k].bonded, False)
        edges = _edges(swept, *np.nonzero(cells[:, None] & ~closed[swept.beyond]))
        if stack.sector is not None:
            on_planes = np.array([on for _, on in stack.sector.on_planes(stack.plane.points)])
            edges = edges[~on_planes[:, edges[:, :2]].all(axis=2).any(axis=0)]
        if len(edges):
            patches.append(_mouth_patch(swept, k, edges))
    return patches


def _mouth_patch(swept: Sweep, ply: int, edges: Ints) -> Ints:
    """Return triangles (k, 3) between the two films at a void's mouth, facing outward."""
    low, high, half = swept.upper[ply - 1], swept.lower[ply], swept.joints[ply]
    for k, level in ((ply - 1, low), (ply, high)):
        _check_covered(swept, k, level, edges.ravel())
    triangles = []
    for a, b, m in edges.tolist():
        ring = [low[b], half[b], high[b], high[m], high[a], half[a], low[a]]
        sides = pairwise(int(node) for node in ring if node >= 0)
        triangles += [(int(low[m]), p, q) for p, q in sides if len({int(low[m]), p, q}) == 3]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def lids(swept: Sweep, void: MeshedVoid) -> list[Ints]:
    """Return triangles (k, 3) of mesh nodes over film holes through which a void continues.

    Such a hole leads to another chamber of its net, or to a tube; its rim is the lid's.
    """
    covers = []
    for k, cells in sorted(void.under.items()):
        for ply, level, way in ((k - 1, swept.upper[k - 1], -1), (k, swept.lower[k], 1)):
            hole = cells & ~swept.stack.plies[ply].cells
            hole &= ~void.in_films.get(ply, np.zeros_like(hole))
            edges = _edges(swept, *_bordering(swept, hole, ~hole))
            for rim in loops_of(np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])):
                _check_covered(swept, ply, level, rim)
                first, *rest = level[rim]
                covers.append(np.array([(first, p, q)[::way] for p, q in pairwise(rest)]))
    return covers


def _check_covered(swept: Sweep, ply: int, level: Ints, nodes: Ints) -> None:
    """Raise OutputError if a film ends at nodes of the plane around the opening of a pocket."""
    if level[nodes].min() < 0:
        x, y = swept.stack.plane.points[nodes[int(level[nodes].argmin())]]
        raise OutputError(
            f"Layer {swept.stack.plies[ply].layer.index} ends at x {x:.3f}, y {y:.3f}, beside an "
            "open pocket; continue the film around its hole, and end both films at a mouth."
        )


def _with_air(mesh: Mesh, swept: Sweep, faces_of: Callable[[Ints], Ints]) -> Mesh:
    """The mesh with its sets and cavities; ``faces_of`` converts faces of prisms into its own."""
    named, face_sets, cavities = node_sets(swept), {}, {}
    for name, void in swept.stack.voids.items():
        faces = faces_of(wetted(swept, void))
        face_sets[f"cavity_{name}"] = faces
        patches = mouths(swept, void)
        if patches:
            named[f"inlet_{name}"] = np.unique(np.concatenate(patches))
        if swept.stack.sector is None:
            walls = mesh.flat_triangles(faces)[:, ::-1]
            cavities[name] = np.concatenate([walls, *patches, *lids(swept, void)])
    return replace(mesh, node_sets=named, face_sets=face_sets, cavities=cavities)


# Faces of elements.


def faces_of_tetrahedra(prisms: Ints, tetrahedra: Ints, faces: Ints) -> Ints:
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


def skin(mesh: Mesh) -> Ints:
    """Return the faces (k, 2: cell and face number) that belong to one cell only."""
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


# Named parts of a mesh.


def bond_name(ply: int) -> str:
    """Return the name of the bond under a film, by its interface's index from 1."""
    return f"bond_{ply:03d}"


def node_sets(swept: Sweep) -> Sets:
    """Return the node sets of bonds, base, tip and symmetry planes."""
    sets, stack = {}, swept.stack
    for k, ply in enumerate(stack.plies):
        if ply.bonded.any():
            nodes = stack.nodes(ply.bonded)
            sets[bond_name(k)] = np.unique([swept.lower[k, nodes], swept.upper[k - 1, nodes]])
    bottom, top = stack.plies[0], stack.plies[-1]
    seat = bottom.cells if bottom.is_sheet else stack.seats & bottom.cells
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
    """Raise OutputError if an element is inverted, skin or cavities are open, or a volume deviates.

    ``expected`` gives the exact volume in mm3 of cell sets.
    """
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    worst = int(least.argmin())
    if least[worst] <= 0:
        x, y, z = mesh.points[mesh.cells[worst]].mean(axis=0)
        raise OutputError(
            f"{int((least <= 0).sum())} elements of the {mesh.name} mesh are inverted, the worst "
            f"at x {x:.3f}, y {y:.3f}, z {z:.3f}; use a smaller h or less fill."
        )
    # Flat triangles through all nodes tell two sides between the same corners apart.
    if mesh.kind != "triangle6" and len(unpaired_edges(mesh.flat_triangles(skin(mesh)))):
        raise OutputError(
            f"The skin of the {mesh.name} mesh is not closed and manifold; move apart profiles "
            "that touch in one point, or change h."
        )
    sizes = volumes(mesh.kind, mesh.points, mesh.cells)
    for name, volume in expected.items():
        meshed = float(sizes[mesh.cell_sets[name]].sum())
        if not abs(meshed - volume) <= VOLUME_TOLERANCE * volume:
            raise OutputError(
                f"The {mesh.name} mesh of {name} holds {meshed:.5f} mm3, but area x thickness is "
                f"{volume:.5f} mm3; use a smaller h."
            )
    for name, triangles in mesh.cavities.items():
        if gaps := len(unpaired_edges(triangles)):
            raise OutputError(
                f"The cavity {name} of the {mesh.name} mesh is open at {gaps} edges; move apart "
                "profiles that touch in one point."
            )


# The shell mesh: mid-surfaces of second order, bonded films as one shell.


def thin(stack: Layup) -> Layup:
    """Return the layup with films of zero thickness: all mid-surfaces lie at z = 0."""
    plies = tuple(ply._replace(z=0.0, gap=0.0) for ply in stack.plies)
    return replace(stack, plies=plies, is_thick=False)


def shell_mesh(stack: Layup, heights: Floats | None = None) -> Mesh:
    """Return the mid-surfaces of a thin layup at ``heights``, by default flat, with sets and
    cavities.

    Bonded films share one triangle, which carries the sum of their thicknesses. Cavities exclude
    the neck rings, which have the same air on both sides. Raises OutputError if a check fails.
    """
    swept = Sweep(stack, heights)
    films, thickness = {}, np.zeros(len(swept.cells))
    for ply, numbers in zip(stack.plies, swept.cell_of, strict=True):
        films[ply.name] = np.sort(numbers[numbers >= 0])
        thickness[films[ply.name]] += ply.thickness
    microns = np.round(thickness * 1000, 3)
    names = {f"section_{um:g}um".replace(".", "p"): um for um in np.unique(microns).tolist()}
    films |= {name: np.flatnonzero(microns == um) for name, um in names.items()}
    parts = {name: um / 1000 for name, um in names.items()}
    bare = Mesh("shell", "triangle6", swept.points, swept.cells, cell_sets=films, thickness=parts)
    mesh = _with_air(bare, swept, _one_sided)
    check_mesh(mesh, {})
    return mesh


def _one_sided(faces: Ints) -> Ints:
    """Return the faces of cells with air on one side only."""
    _, first, times = np.unique(faces[:, 0], return_index=True, return_counts=True)
    one_sided: Ints = faces[np.sort(first[times == 1])]
    return one_sided


# The volume mesh with its sets and cavities, checked.


def volume_mesh(stack: Layup, heights: Floats | None = None) -> Mesh:
    """Return the volume mesh of films at ``heights``, by default flat, with its sets and cavities.

    Raises OutputError if a check fails.
    """
    swept = Sweep(stack, heights)
    prisms = swept.cells
    is_tet = stack.settings.element == "tet"
    if is_tet:
        cells = tetrahedra(prisms, _corners_under(swept))
    else:
        cells = prisms[:, [0, 1, 2, 12, 13, 14, 3, 4, 5, 15, 16, 17, 6, 7, 8]]

    def faces_of(faces: Ints) -> Ints:
        return faces_of_tetrahedra(prisms, cells, faces) if is_tet else faces

    cell_sets, expected, materials = {}, {}, {}
    for k, (ply, form) in enumerate(zip(stack.plies, swept.forms, strict=True)):
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
    kind: ElementKind = "tetra10" if is_tet else "wedge15"
    bare = Mesh("volume", kind, swept.points, cells, cell_sets=cell_sets, materials=materials)
    mesh = _with_air(bare, swept, faces_of)
    check_mesh(mesh, expected)
    return mesh


def _corners_under(swept: Sweep) -> Ints:
    """Return the plane's corner nodes (prisms, 3) under each prism."""
    under = np.empty((len(swept.cells), 3), dtype=np.int64)
    for numbers in (*swept.cell_of, *swept.joint_of):
        under[numbers[numbers >= 0]] = swept.stack.plane.triangles[numbers >= 0, :3]
    return under


# Both meshes of a laminate, and their files.


HEIGHTS = {
    False: "Films lie on each other: heights are sums of the TPE films, without the masks.",
    True: "Films are as far apart as the masks hold them, and bonds are as thick.",
}
PARTS: dict[Symmetry, str] = {
    "half": "Half of the actuator, on one side of its plane of symmetry.",
    "quarter": "A quarter of the actuator, away from its inlet, which is left out.",
    "sector": "One lobe of the actuator with its inlet.",
}
WRAPPED = (
    "Wrapped round a tube of {:g} mm, its axis z: lengths in the middle of the sheet are kept, and "
    "filled balloons straighten."
)
FILLED = (
    "Filled with {:g} ul of air a balloon. A start shape, not an equilibrium: films over the "
    "pockets are {:.1%} larger than flat, {:.1%} at the steepest place, and as much thinner: "
    "{:.4f} mm there."
)
REST = "Films are free of stress when flat: the point field rest of the .vtu holds those places."
HEIGHT_OF_SHELL = "Mid-surfaces: films have no height of their own, and lie in one plane when flat."
ROUNDS = 2


@dataclass(frozen=True)
class ConformingMeshes:
    """Volume and shell mesh of one triangulation.

    Without gaps all mid-surfaces of a flat shell lie at z = 0, and the volume is as high as its TPE
    films.
    """

    settings: MeshSettings
    volume: Mesh
    shell: Mesh

    @cached_property
    def statistics(self) -> dict[str, dict[str, Any]]:
        """The figures of both meshes, for printing and the manifest."""
        thin_mm = thinning(self.shell)[2]
        return {mesh.name: mesh_statistics(mesh, thin_mm) for mesh in (self.volume, self.shell)}


def conforming_meshes(laminate: Laminate, settings: MeshSettings | None = None) -> ConformingMeshes:
    """Return the checked volume and shell mesh of a laminate.

    No element is inverted, skins are manifold, cavities are closed, and films have the volume area
    x thickness. Raises DesignError if the settings do not suit the laminate or Netgen is not
    installed, OutputError if a check fails.
    """
    if not laminate.chambers:
        raise DesignError(
            f"{laminate.name} has no chamber, which these meshes need; the solid in mesh/ of "
            "sbafab generate does not"
        )
    settings = settings or MeshSettings()
    stack = layup(laminate, settings)
    volume, shell = _filled(stack, volume_mesh), _filled(thin(stack), shell_mesh)
    notes = tuple(_notes(laminate, settings, thinning(shell)))
    volume = replace(volume, notes=(HEIGHTS[settings.gaps], *notes))
    shell = replace(shell, notes=(HEIGHT_OF_SHELL, *notes))
    return ConformingMeshes(settings, volume, shell)


def _filled(stack: Layup, make: Callable[[Layup, Floats | None], Mesh]) -> Mesh:
    """The mesh whose balloons hold the fill, round a tube as well as flat, with its rest."""
    mesh = _lifted(stack, make)
    flat_stack = replace(stack, settings=replace(stack.settings, wrapped=False))
    rest = Sweep(flat_stack).points
    return mesh if np.array_equal(mesh.points, rest) else replace(mesh, rest=rest)


def _lifted(stack: Layup, make: Callable[[Layup, Floats | None], Mesh]) -> Mesh:
    fill, laminate = stack.settings.fill_ul, stack.laminate
    if fill is None:
        return make(stack, None)
    if not 0 <= fill < math.inf:
        raise DesignError(f"fill = {fill:g} ul must be 0 ul or more")
    all_pockets = pockets(stack)
    amounts = {chamber.name: fill for chamber in laminate.chambers}
    mesh = make(stack, filled(stack, amounts, all_pockets))
    if not fill or laminate.tube is None or not stack.settings.wrapped or stack.sector is not None:
        return mesh
    # Balloons bent round the tube hold a little more than flat ones.
    sizes = stack.plane.areas()
    for _ in range(ROUNDS):
        for chamber in laminate.chambers:
            films = stack.voids[chamber.name].in_films.items() if stack.is_thick else ()
            bores = sum(sizes[cells].sum() * stack.plies[k].thickness for k, cells in films)
            balloons = laminate.balloons * len(chamber.centres)
            volume = (mesh.cavity(chamber.name)[0].volume - bores) / balloons
            amounts[chamber.name] *= fill / volume
        mesh = make(stack, filled(stack, amounts, all_pockets))
    return mesh


def _notes(
    laminate: Laminate, settings: MeshSettings, thin_films: tuple[float, ...]
) -> Iterator[str]:
    if settings.symmetry in PARTS:
        yield PARTS[settings.symmetry]
    if laminate.tube is not None and settings.wrapped:
        yield WRAPPED.format(laminate.tube)
    if settings.fill_ul is not None:
        yield FILLED.format(settings.fill_ul, *thin_films)
        yield REST


def write_conforming(
    meshes: ConformingMeshes,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    formats: Collection[str] = (),
) -> list[MeshFile]:
    """Write ``mesh/volume.*``, ``mesh/shell.*``, and for open pockets ``mesh/skin.*`` and
    ``mesh/cavity_<chamber>_conforming.*``.

    ``folder`` is the output folder, ``formats`` the requested file suffixes, by default all.
    Symmetry models have no closed cavities: their cavity walls are face sets of the meshes.
    ``progress`` is called with the number of files done and the total.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    endings = formats or conforming_endings()
    jobs = [job for job in _jobs(meshes) if Path(job[0].file).suffix[1:] in endings]
    for number, (file, write) in enumerate(jobs, start=1):
        write(folder / file.file)
        if progress is not None:
            progress(number, len(jobs))
    return [file for file, _ in jobs]


def _jobs(meshes: ConformingMeshes) -> Iterator[tuple[MeshFile, Callable[[Path], None]]]:
    """Yield every possible file, with the function that writes it to a path."""
    fill = meshes.settings.fill_ul or 0.0

    def file(stem: str, row: MeshFormat, volume: float, count: int, **facts: Any) -> MeshFile:
        name = f"mesh/{stem}.{row.ending}"
        return MeshFile(file=name, fill_ul=fill, volume_mm3=volume, elements=count, **facts)

    for mesh in (meshes.volume, meshes.shell):
        size, count = meshes.statistics[mesh.name]["volume_mm3"], len(mesh.cells)
        for row in mesh_formats():
            if row.elements:
                listed = file(mesh.name, row, size, count, kind=mesh.name, chamber=None)
                yield listed, partial(row.elements, mesh)
    mesh = meshes.volume
    # Films that lie on each other enclose nothing: the surface would have no inside.
    air = mesh.cavities if fill > 0 or meshes.settings.gaps else ()
    surfaces = {chamber: mesh.cavity(chamber)[0] for chamber in air}
    skins = [mesh.surface(mesh.flat_triangles(skin(mesh)))[0]] if air else []
    for chamber, surface in [*((None, each) for each in skins), *surfaces.items()]:
        kind = "skin" if chamber is None else "cavity"
        stem = "skin" if chamber is None else f"cavity_{chamber}_conforming"
        size, count = surface.volume, len(surface.faces)
        for row in mesh_formats():
            listed = file(stem, row, size, count, kind=kind, chamber=chamber)
            if row.cavity and chamber is not None:
                yield listed, partial(row.cavity, mesh, chamber)
            elif row.surface:
                yield listed, partial(row.surface, surface)


# Size and quality of a mesh.


def thinning(shell: Mesh) -> tuple[float, float, float]:
    """Return the relative growth in area of a shell's films over the pockets since they were flat,
    mean and largest, and their least thickness in mm there: no film changes its volume.

    The fill does not preserve lengths: the mean is 0.01 at 5 ul in the paper's 5 mm balloon.
    """
    pockets = np.unique(np.concatenate([faces[:, 0] for faces in shell.face_sets.values()]))
    thickness = np.zeros(len(shell.cells))
    for name, value in shell.thickness.items():
        thickness[shell.cell_sets[name]] = value
    slopes = (
        jacobians(shell.kind, points, shell.cells[pockets], integration=True)
        for points in (shell.points, shell.points if shell.rest is None else shell.rest)
    )
    raised, before = (np.linalg.norm(np.cross(s[..., 0], s[..., 1]), axis=2) for s in slopes)
    growth = np.maximum((raised / before).max(axis=1), 1.0)
    mean = float(raised.sum() / before.sum()) - 1
    return mean, float(growth.max()) - 1, float((thickness[pockets] / growth).min())


def mesh_statistics(mesh: Mesh, thinnest_film_mm: float) -> dict[str, Any]:
    """Return counts, quality and volume of a mesh; a shell's volume is area x thickness.

    Aspect is longest edge over shortest, ``thinnest_film_mm`` the least thickness of a film lifted
    by air.
    """
    sizes = volumes(mesh.kind, mesh.points, mesh.cells)
    for name, thickness in mesh.thickness.items():
        sizes[mesh.cell_sets[name]] *= thickness
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    heights = mesh.points[:, 2]
    return {
        "nodes": len(mesh.points),
        "elements": len(mesh.cells),
        "element": mesh.kind,
        "least_scaled_jacobian": float(least.min()),
        "worst_aspect": float(aspects(mesh.kind, mesh.points, mesh.cells).max()),
        "volume_mm3": float(sizes.sum()),
        "height_mm": float(heights.max() - heights.min()),
        "thinnest_film_mm": thinnest_film_mm,
    }
