"""The conforming meshes of a laminate, and the files they are written to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.elements import volumes
from sbafab.meshing.conforming.fill import Fill, filled
from sbafab.meshing.conforming.form import flat
from sbafab.meshing.conforming.layup import layup
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.settings import MeshSettings, Symmetry
from sbafab.meshing.conforming.shell_mesh import shell_mesh, thin
from sbafab.meshing.conforming.statistics import Statistics, mesh_statistics
from sbafab.meshing.conforming.volume_mesh import volume_mesh
from sbafab.meshing.conforming.write_inp import write_inp
from sbafab.meshing.conforming.write_msh import write_msh
from sbafab.meshing.conforming.write_obj import write_obj
from sbafab.meshing.conforming.write_ply import write_ply
from sbafab.meshing.conforming.write_vtk import write_vtk
from sbafab.meshing.conforming.write_vtu import write_cavity_vtu, write_vtu
from sbafab.meshing.files import MeshFile, MeshKind
from sbafab.meshing.surface import Surface
from sbafab.meshing.write_stl import write_stl

MESH_WRITERS: dict[str, Callable[[Mesh, Path], None]] = {
    "vtu": write_vtu,
    "vtk": write_vtk,
    "msh": write_msh,
    "inp": write_inp,
}
SURFACE_WRITERS: dict[str, Callable[[Surface, Path], None]] = {
    "stl": write_stl,
    "obj": write_obj,
    "ply": write_ply,
}
HEIGHTS = {
    False: "Films lie on each other: heights are sums of the TPE films, without the masks.",
    True: "Films are as far apart as the masks hold them, and bonds are as thick.",
}
PARTS: dict[Symmetry, str] = {
    "half": "Half of the actuator, on one side of its plane of symmetry.",
    "quarter": "A quarter of the actuator, away from its inlet, which is left out.",
    "sector": "One lobe of the actuator with its inlet.",
}
HEIGHT_OF_SHELL = "Mid-surfaces: films have no height of their own, and lie in one plane when flat."
FORMATS = ("vtu", "vtk", "msh", "inp", "stl", "obj", "ply")


@dataclass(frozen=True)
class ConformingMeshes:
    """Volume and shell mesh of one triangulation.

    ``flat_shell`` is the shell before it was filled (the same one without fill): a rest position
    for it. ``fill`` says what the air was asked to be and how films were moved for it. Without
    gaps all mid-surfaces of a flat shell lie at z = 0, and the volume is as high as its TPE films.
    """

    name: str
    settings: MeshSettings
    volume: Mesh
    shell: Mesh
    flat_shell: Mesh
    fill: Fill | None

    @property
    def stretch(self) -> float:
        """By what part the films over the pockets are larger in area than flat; 0 when flat.

        The fill keeps no length: 0.01 at 5 ul in the paper's 5 mm balloon.
        """
        faces = list(self.shell.face_sets.values())
        pockets = np.unique(np.concatenate(faces)[:, 0])
        raised, flat_ones = (
            float(volumes(mesh.kind, mesh.points, mesh.cells[pockets]).sum())
            for mesh in (self.shell, self.flat_shell)
        )
        return raised / flat_ones - 1

    @cached_property
    def statistics(self) -> dict[str, Statistics]:
        """The figures of both meshes, for printing and the manifest."""
        return {mesh.name: mesh_statistics(mesh) for mesh in (self.volume, self.shell)}


def conforming_meshes(laminate: Laminate, settings: MeshSettings | None = None) -> ConformingMeshes:
    """Volume and shell mesh of a laminate, checked.

    No element is inverted, skins are manifold, cavities closed, and films hold area x thickness.
    Raises DesignError where the settings do not suit the laminate or Netgen is not installed,
    OutputError where a check fails.
    """
    settings = settings or MeshSettings()
    stack = layup(laminate, settings)
    sheet = thin(stack)
    flat_shell = shell_mesh(sheet, flat(sheet))
    if settings.fill_ul is None:
        fill, volume, shell = None, volume_mesh(stack, flat(stack)), flat_shell
    else:
        fill, forms = filled(stack, settings.fill_ul)
        volume = volume_mesh(stack, forms)
        shell = shell_mesh(sheet, filled(sheet, settings.fill_ul)[1])
    return ConformingMeshes(
        laminate.name,
        settings,
        replace(volume, notes=(HEIGHTS[settings.gaps], *_notes(settings.symmetry, fill))),
        replace(shell, notes=(HEIGHT_OF_SHELL, *_notes(settings.symmetry, fill))),
        flat_shell,
        fill,
    )


def _notes(symmetry: Symmetry, fill: Fill | None) -> tuple[str, ...]:
    part = (PARTS[symmetry],) if symmetry in PARTS else ()
    if fill is None:
        return part
    amounts = ", ".join(f"{name} {ul:g} ul" for name, ul in fill.ul.items())
    note = f"Filled with air, a balloon: {amounts}. This shape is taken to be free of stress."
    return (*part, note)


def write_conforming(
    meshes: ConformingMeshes,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    formats: Collection[str] = FORMATS,
) -> list[MeshFile]:
    """Write ``mesh/volume.*``, ``mesh/shell.*`` and ``mesh/cavity_<chamber>_conforming.*``.

    ``folder`` is the output folder, ``formats`` the file endings wanted. Models of a part by
    symmetry have no closed cavities: their cavity walls are face sets of the meshes. ``progress``
    is told how many of how many files are done.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    jobs = [job for job in _jobs(meshes) if Path(job[0].file).suffix[1:] in formats]
    written = []
    for file, write in jobs:
        write(folder / file.file)
        written.append(file)
        if progress is not None:
            progress(len(written), len(jobs))
    return written


def _jobs(meshes: ConformingMeshes) -> Iterator[tuple[MeshFile, Callable[[Path], None]]]:
    """Every file there could be, and what writes it to a path."""
    fill = meshes.fill.largest if meshes.fill is not None else 0.0
    kinds: tuple[tuple[MeshKind, Mesh], ...] = (("volume", meshes.volume), ("shell", meshes.shell))
    for kind, mesh in kinds:
        size = meshes.statistics[mesh.name]["volume_mm3"]
        for suffix, write in MESH_WRITERS.items():
            file = MeshFile(f"mesh/{kind}.{suffix}", kind, None, fill, size, len(mesh.cells))
            yield file, partial(write, mesh)
    mesh = meshes.volume
    for chamber in mesh.cavities:
        surface, _ = mesh.cavity(chamber)
        described = MeshFile(
            f"mesh/cavity_{chamber}_conforming.vtu",
            "cavity",
            chamber,
            fill,
            surface.volume,
            len(surface.faces),
        )
        yield described, partial(write_cavity_vtu, mesh, chamber)
        for suffix, write_surface in SURFACE_WRITERS.items():
            name = f"mesh/cavity_{chamber}_conforming.{suffix}"
            yield replace(described, file=name), partial(write_surface, surface)
