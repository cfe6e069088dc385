"""Films of filled meshes do not pass through each other, judged as solids by manifold3d too."""

from __future__ import annotations

from itertools import combinations

import manifold3d
import numpy as np
import pytest

from sbafab.api import build
from sbafab.errors import DesignError, OutputError
from sbafab.meshing.conforming.fill import filled, pockets
from sbafab.meshing.conforming.layup import Layup, MeshSettings, check_apart, flat, layup
from sbafab.meshing.conforming.mesh import FACES, Mesh
from sbafab.meshing.conforming.meshes import conforming_meshes, skin, volume_mesh
from sbafab.meshing.surface import Floats

SETTINGS = MeshSettings(h=0.75)


def films(mesh: Mesh) -> list[manifold3d.Manifold]:
    """Each film as a solid of flat triangles through the corners of its wedges."""
    found = []
    for cells in (cells for name, cells in mesh.cell_sets.items() if name.startswith("film")):
        part = Mesh("film", mesh.kind, mesh.points, mesh.cells[cells])
        outer, triangles = skin(part), []
        for number, local in enumerate(FACES["wedge15"]):
            corners = [node for node in local if node < 6]
            nodes = part.cells[outer[outer[:, 1] == number, 0]][:, corners]
            triangles += [nodes[:, [0, 1, 2]]]
            triangles += [nodes[:, [0, 2, 3]]] if len(corners) == 4 else []
        nodes, faces = np.unique(np.concatenate(triangles), return_inverse=True)
        surface = manifold3d.Mesh64(mesh.points[nodes], faces.reshape(-1, 3).astype(np.uint64))
        found.append(manifold3d.Manifold(surface))
        assert found[-1].status() == manifold3d.Error.NoError
    return found


def heights(stack: Layup, ul: float) -> Floats:
    return filled(stack, {chamber.name: ul for chamber in stack.laminate.chambers}, pockets(stack))


def test_filled_films_do_not_cross() -> None:
    laminate = build("3dof-15mm", "stack.balloons=2")
    mesh = conforming_meshes(laminate, MeshSettings(h=0.75, fill_ul=8.0)).volume
    # Chords of the corner nodes overlap a little; films are 6 mm3 and more.
    assert max((a ^ b).volume() for a, b in combinations(films(mesh), 2)) < 0.01


def test_films_that_cross_are_found_before_a_mesh_is_written() -> None:
    stack = layup(build("3dof-15mm", "stack.balloons=2"), SETTINGS)
    lifted = heights(stack, 5.0)
    check_apart(stack, lifted)
    check_apart(stack, flat(stack))
    # The upper balloon set down by 0.3 mm lies in the lower one.
    sunk = lifted - np.array([0, 0, 0.3, 0.3])[:, None]
    with pytest.raises(OutputError, match=r"film 5 would pass through one below it by 0\.30"):
        volume_mesh(stack, sunk)


def test_a_film_that_pierces_one_far_from_it_is_found() -> None:
    stack = layup(build("1dof-5mm", "stack.balloons=2"), SETTINGS)
    pierced = heights(stack, 3.0)
    # The cap falls through the base beside its axis, past the two films between them.
    pierced[1:3] -= 40.0
    pierced[3] = np.where(stack.plane.points[:, 0] > 1.0, -1.0, 2.0)
    with pytest.raises(OutputError, match="film 3 would pass through one below it by 40"):
        check_apart(stack, pierced)
    pierced[1:3] = [[0.1], [0.2]]
    with pytest.raises(OutputError, match="film 7 would pass through one below it by 1"):
        check_apart(stack, pierced)


def test_chambers_of_unlike_pockets_are_not_filled() -> None:
    stack = layup(build("3dof-15mm", "stack.balloons=2"), SETTINGS)
    unlike = [
        pocket._replace(meshed=1.2) if pocket.chamber == "chamber2" else pocket
        for pocket in pockets(stack)
    ]
    fills = {chamber.name: 3.0 for chamber in stack.laminate.chambers}
    with pytest.raises(
        DesignError, match=r"lifts the chambers by heights that differ by 0\.\d+ mm"
    ):
        filled(stack, fills, unlike)


def test_what_a_film_loses_in_thickness_is_said() -> None:
    laminate = build("1dof-5mm", "stack.balloons=1")
    meshes = conforming_meshes(laminate, MeshSettings(h=0.5, symmetry="quarter", fill_ul=16.9))
    # Two paraboloids over radius 2.5 hold pi 2.5^2 a: the slope at their edge is 2 a / 2.5.
    slope = 2 * 16.9 / (np.pi * 2.5**2) / 2.5
    thinnest = 0.038 / np.hypot(1, slope)
    for figures in meshes.statistics.values():
        assert figures["thinnest_film_mm"] == pytest.approx(thinnest, rel=0.02)
    said = " ".join(meshes.volume.notes)
    assert f"{meshes.statistics['volume']['thinnest_film_mm']:.4f} mm there" in said
    assert "free of stress when flat" in said
    # The nodes' places when flat are given: the film that they make is as thick as it was cut.
    rest = meshes.volume.rest
    assert rest is not None
    assert rest[:, 2].max() == pytest.approx(2 * 0.038)
    assert np.linalg.norm(rest - meshes.volume.points, axis=1).max() > 0.8
