"""Table of mesh formats."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from sbafab.meshing.conforming.mesh import Mesh
from sbafab.meshing.formats.inp import write_inp
from sbafab.meshing.formats.msh import write_msh
from sbafab.meshing.formats.surfaces import write_glb, write_obj, write_ply, write_stl
from sbafab.meshing.formats.three_mf import write_3mf
from sbafab.meshing.formats.vtk import write_vtk
from sbafab.meshing.formats.vtu import write_cavity_vtu, write_vtu
from sbafab.meshing.surface import Surface


class MeshFormat(NamedTuple):
    """A file ending, with the writing function for each content that the format can hold.

    ``solid``: the flat solid, its film's material named. ``elements``: volume and shell meshes.
    ``surface``: skins and cavities. ``cavity``: a chamber's cavity with the numbers of its nodes
    in the mesh; written instead of ``surface``.
    """

    ending: str
    solid: Callable[[Surface, Path, str], None] | None = None
    elements: Callable[[Mesh, Path], None] | None = None
    surface: Callable[[Surface, Path], None] | None = None
    cavity: Callable[[Mesh, str, Path], None] | None = None


MESH_FORMATS = (
    MeshFormat("vtu", elements=write_vtu, cavity=write_cavity_vtu),
    MeshFormat("vtk", elements=write_vtk),
    MeshFormat("msh", elements=write_msh),
    MeshFormat("inp", elements=write_inp),
    MeshFormat("stl", solid=write_stl, surface=write_stl),
    MeshFormat("obj", surface=write_obj),
    MeshFormat("ply", surface=write_ply),
    MeshFormat("3mf", solid=write_3mf),
    MeshFormat("glb", solid=write_glb),
)
"""Formats in the order in which files are written and listed."""

CONFORMING_ENDINGS = tuple(
    row.ending for row in MESH_FORMATS if row.elements or row.surface or row.cavity
)
"""File endings selectable by ``sbafab mesh --format``."""
