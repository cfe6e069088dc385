"""Volume and shell meshes: what they hold, what they share, and what is refused."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.mesh import Mesh, volumes
from sbafab.meshing.conforming.meshes import ConformingMeshes, check_mesh, conforming_meshes
from sbafab.meshing.solid import cavity_slabs

FILM = 0.038


@pytest.fixture(scope="module")
def meshes(two_balloons: Laminate) -> ConformingMeshes:
    return conforming_meshes(two_balloons, MeshSettings(h=0.5))


@pytest.fixture(scope="module")
def with_gaps(two_balloons: Laminate) -> ConformingMeshes:
    return conforming_meshes(two_balloons, MeshSettings(h=0.5, gaps=True))


def held(mesh: Mesh, name: str) -> float:
    return float(volumes(mesh.kind, mesh.points, mesh.cells)[mesh.cell_sets[name]].sum())


def test_films_and_bonds_hold_area_times_thickness(
    meshes: ConformingMeshes, with_gaps: ConformingMeshes
) -> None:
    assert meshes.volume.points[:, 2].max() == pytest.approx(4 * FILM)
    assert with_gaps.volume.points[:, 2].max() == pytest.approx(4 * FILM + 3 * 0.025)
    wall = math.pi * (3.25**2 - 0.5**2) * FILM
    assert held(meshes.volume, "film_005_TPE_wall") == pytest.approx(wall, rel=5e-4)
    ring = math.pi * (3.25**2 - 2.5**2) * 0.025
    neck = math.pi * (1.25**2 - 0.5**2) * 0.025
    assert held(with_gaps.volume, "bond_002") == pytest.approx(neck, rel=1e-3)
    assert held(with_gaps.volume, "bond_003") == pytest.approx(ring, rel=1e-3)


def test_films_share_the_nodes_of_their_bond_and_no_other(meshes: ConformingMeshes) -> None:
    mesh = meshes.volume
    below, above = (
        np.unique(mesh.cells[mesh.cell_sets[name]])
        for name in ("film_005_TPE_wall", "film_007_TPE_cap")
    )
    shared = np.intersect1d(below, above)
    assert np.array_equal(shared, mesh.node_sets["bond_003"])
    radii = np.hypot(*mesh.points[shared, :2].T)
    assert radii.min() == pytest.approx(2.5, abs=1e-6)
    assert radii.max() == pytest.approx(3.25, abs=1e-6)
    inside = np.hypot(*mesh.points[above, :2].T) < 2.5 - 1e-6
    assert np.isclose(mesh.points[above[inside], 2], 3 * FILM).any()


def test_cavities_hold_pockets_and_bores(
    two_balloons: Laminate, with_gaps: ConformingMeshes
) -> None:
    (chamber,) = two_balloons.chambers
    exact = sum(slab.volume for slab in cavity_slabs(two_balloons, chamber))
    surface, nodes = with_gaps.volume.cavity("A")
    assert surface.volume == pytest.approx(exact, rel=5e-3)
    assert np.array_equal(with_gaps.volume.points[nodes], surface.points)


def test_shells_carry_the_films_that_are_bonded(meshes: ConformingMeshes) -> None:
    shell = meshes.shell
    assert shell.thickness == {"section_38um": 0.038, "section_76um": 0.076}
    total = sum(held(shell, name) * value for name, value in shell.thickness.items())
    films = [name for name in meshes.volume.cell_sets if name.startswith("film_")]
    assert total == pytest.approx(sum(held(meshes.volume, name) for name in films), rel=1e-9)
    neck = math.pi * (1.25**2 - 0.5**2)
    walls = [set(shell.cell_sets[name].tolist()) for name in shell.cell_sets if "wall" in name]
    common = np.array(sorted(walls[0] & walls[1]))
    assert volumes(shell.kind, shell.points, shell.cells)[common].sum() == pytest.approx(
        neck, rel=1e-3
    )
    # The neck's lamina has the same air on both sides.
    assert not np.isin(common, shell.face_sets["cavity_A"][:, 0]).any()


def test_base_tip_and_inlet_are_where_they_belong(meshes: ConformingMeshes) -> None:
    mesh = meshes.volume
    for name, height in (("base", 0.0), ("tip", 4 * FILM)):
        places = mesh.points[mesh.node_sets[name]]
        assert places[:, 2] == pytest.approx(height)
        assert np.hypot(*places[:, :2].T).max() == pytest.approx(1.25, abs=1e-6)

    places = meshes.volume.points[meshes.volume.node_sets["inlet_A"]]
    assert places[:, 0] == pytest.approx(8.25)
    assert np.ptp(places[:, 1]) == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (MeshSettings(h=0.8), "use at most 0.750 mm"),
        (MeshSettings(h=0.0), "not a valid mesh size"),
        (MeshSettings(h=0.002), "more than 3,000,000"),
        (MeshSettings(h=0.5, symmetry="sector"), "lacks the mesh symmetry sector"),
    ],
)
def test_what_cannot_be_meshed_is_refused(
    two_balloons: Laminate, settings: MeshSettings, message: str
) -> None:
    with pytest.raises(DesignError, match=message):
        conforming_meshes(two_balloons, settings)


def test_faulty_meshes_are_found(meshes: ConformingMeshes) -> None:
    cells = meshes.volume.cells.copy()
    cells[7] = cells[7][[0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]]
    with pytest.raises(OutputError, match="1 elements of the volume mesh are inverted"):
        check_mesh(replace(meshes.volume, cells=cells), {})
    mesh = meshes.volume
    name = "film_007_TPE_cap"
    with pytest.raises(OutputError, match="use a smaller h"):
        check_mesh(mesh, {name: held(mesh, name) * 1.002})
    # Two wedges that meet along one edge only.
    fan = mesh.cells[mesh.cell_sets[name]]
    hub = fan[(fan[:, :3] == np.bincount(fan[:, :3].ravel()).argmax()).any(axis=1)]
    lonely = next(
        pair
        for pair in ((hub[0], other) for other in hub[1:])
        if len(np.intersect1d(pair[0][:6], pair[1][:6])) == 2
    )
    with pytest.raises(OutputError, match="not closed and manifold"):
        check_mesh(replace(mesh, cells=np.array(lonely)), {})
    holed = replace(mesh, cavities={"A": mesh.cavities["A"][1:]})
    with pytest.raises(OutputError, match="open at 3 edges"):
        check_mesh(holed, {})


def test_without_netgen_the_extra_is_named(
    two_balloons: Laminate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "netgen.geom2d", None)
    with pytest.raises(DesignError, match=r'need Netgen; install it with: pip install "sbafab'):
        conforming_meshes(two_balloons, MeshSettings(h=0.5))


def test_tetrahedra_fill_the_same_space(two_balloons: Laminate, meshes: ConformingMeshes) -> None:
    tets = conforming_meshes(two_balloons, MeshSettings(h=0.5, element="tet")).volume
    assert tets.cells.shape == (3 * len(meshes.volume.cells), 10)
    for name in meshes.volume.cell_sets:
        assert held(tets, name) == pytest.approx(held(meshes.volume, name), rel=1e-9)
    assert len(tets.face_sets["cavity_A"]) > 0
