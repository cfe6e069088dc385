"""The volume mesh with its sets and cavities, checked."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sbafab.meshing.conforming.cavities import (
    faces_of_tetrahedra,
    flat_triangles,
    mouth_patch,
    mouths,
    neighbours,
    wetted,
)
from sbafab.meshing.conforming.checks import check_cavities, check_mesh
from sbafab.meshing.conforming.crossing import check_apart
from sbafab.meshing.conforming.elements import ElementKind
from sbafab.meshing.conforming.form import FormedFilm
from sbafab.meshing.conforming.layup import Layup
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.round_tube import round_tube
from sbafab.meshing.conforming.sets import bond_name, node_sets
from sbafab.meshing.conforming.sweep import Sweep, sweep, tetrahedra, wedges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


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
