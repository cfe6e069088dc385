"""The conforming meshes of a laminate, and the files they are written to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.element_mesh import (
    shell_mesh,
    skin_surface,
    sweep,
    thin,
    volume_mesh,
)
from sbafab.meshing.conforming.fill import Fill, filled, formed, pockets
from sbafab.meshing.conforming.layup import FormedFilm, Layup, MeshSettings, Symmetry, flat, layup
from sbafab.meshing.conforming.mesh import Mesh, aspects, jacobians, scaled_jacobians, volumes
from sbafab.meshing.formats import conforming_endings, mesh_formats
from sbafab.meshing.mesh_files import MeshFile, MeshKind
from sbafab.meshing.surface import Surface

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
    "Filled with air, a balloon: {}. A start shape, not an equilibrium: films over the pockets are "
    "{:.1%} larger than flat, {:.1%} at the steepest place, and as much thinner: {:.4f} mm there."
)
REST = "Films are free of stress when flat: the point field rest of the .vtu holds those places."
HEIGHT_OF_SHELL = "Mid-surfaces: films have no height of their own, and lie in one plane when flat."
ROUNDS = 2


@dataclass(frozen=True)
class ConformingMeshes:
    """Volume and shell mesh of one triangulation.

    ``flat_shell`` is the shell before it was filled (the same one without fill): its rest
    position. ``fill`` holds the air in ul per balloon by chamber, if asked for. Without
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
        """Relative growth in area of the films over the pockets; 0 when flat.

        The fill does not preserve lengths: 0.01 at 5 ul in the paper's 5 mm balloon.
        """
        return thinning(self.shell, self.flat_shell).mean

    def holds_air(self, chamber: str) -> bool:
        """Return True if the pockets of a chamber are open: filled, or kept open by gaps."""
        return self.settings.gaps or (self.fill is not None and self.fill[chamber] > 0)

    @cached_property
    def statistics(self) -> dict[str, Statistics]:
        """The figures of both meshes, for printing and the manifest."""
        thin_mm = thinning(self.shell, self.flat_shell).thinnest_mm
        return {mesh.name: mesh_statistics(mesh, thin_mm) for mesh in (self.volume, self.shell)}


def conforming_meshes(laminate: Laminate, settings: MeshSettings | None = None) -> ConformingMeshes:
    """Volume and shell mesh of a laminate, checked.

    No element is inverted, skins are manifold, cavities closed, and films hold area x thickness.
    Raises DesignError if the settings do not suit the laminate or Netgen is not installed,
    OutputError if a check fails.
    """
    if not laminate.chambers:
        raise DesignError(
            f"{laminate.name} has no chamber, and these meshes hold the faces of chambers; the "
            "solid in mesh/ of sbafab generate needs none"
        )
    settings = settings or MeshSettings()
    stack = layup(laminate, settings)
    sheet = thin(stack)
    as_cut = replace(sheet, settings=replace(settings, wrapped=False))
    flat_shell = shell_mesh(as_cut, flat(sheet))
    fill = None if settings.fill_ul is None else filled(stack, settings.fill_ul)[0]
    thick = _filled(stack, fill, volume_mesh)
    shell = _filled(sheet, fill, shell_mesh)
    notes = tuple(_notes(laminate, settings, fill, thinning(shell, flat_shell)))
    rests = sweep(stack, flat(stack)).points, flat_shell.points
    heights = HEIGHTS[settings.gaps], HEIGHT_OF_SHELL
    volume, shell = (
        replace(
            mesh,
            notes=(height, *notes),
            rest=None if np.array_equal(mesh.points, rest) else rest,
        )
        for mesh, rest, height in zip((thick, shell), rests, heights, strict=True)
    )
    return ConformingMeshes(laminate.name, settings, volume, shell, flat_shell, fill)


def _filled(
    stack: Layup, fill: Fill | None, make: Callable[[Layup, Sequence[FormedFilm]], Mesh]
) -> Mesh:
    """The mesh whose balloons hold a fill, round a tube as well as flat."""
    if fill is None:
        return make(stack, flat(stack))
    all_pockets = pockets(stack)
    mesh = make(stack, formed(stack, fill, all_pockets))
    if stack.laminate.tube is None or not stack.settings.wrapped or stack.sector is not None:
        return mesh
    # Balloons bent round the tube hold a little more than flat ones.
    amounts, sizes = dict(fill), stack.plane.areas()
    for _ in range(ROUNDS):
        for chamber in stack.laminate.chambers:
            name = chamber.name
            if fill[name]:
                films = stack.voids[name].in_films.items() if stack.is_thick else ()
                bores = sum(sizes[cells].sum() * stack.plies[k].thickness for k, cells in films)
                balloons = stack.laminate.balloons * len(chamber.centres)
                volume = (mesh.cavity(name)[0].volume - bores) / balloons
                amounts[name] *= fill[name] / volume
        mesh = make(stack, formed(stack, amounts, all_pockets))
    return mesh


def _notes(
    laminate: Laminate, settings: MeshSettings, fill: Fill | None, thin_films: Thinning
) -> Iterator[str]:
    if settings.symmetry in PARTS:
        yield PARTS[settings.symmetry]
    if laminate.tube is not None and settings.wrapped:
        yield WRAPPED.format(laminate.tube)
    if fill is not None:
        amounts = ", ".join(f"{name} {ul:g} ul" for name, ul in fill.items())
        yield FILLED.format(amounts, *thin_films)
        yield REST


def write_conforming(
    meshes: ConformingMeshes,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    formats: Collection[str] = (),
) -> list[MeshFile]:
    """Write ``mesh/volume.*``, ``mesh/shell.*``, and for open pockets ``mesh/skin.*`` and
    ``mesh/cavity_<chamber>_conforming.*``.

    ``folder`` is the output folder, ``formats`` the requested file endings, by default all.
    Symmetry models have no closed cavities: their cavity walls are face sets of the meshes.
    ``progress`` is called with the number of files done and the total.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    endings = formats or conforming_endings()
    jobs = [job for job in _jobs(meshes) if Path(job[0].file).suffix[1:] in endings]
    written = []
    for file, write in jobs:
        write(folder / file.file)
        written.append(file)
        if progress is not None:
            progress(len(written), len(jobs))
    return written


def _jobs(meshes: ConformingMeshes) -> Iterator[tuple[MeshFile, Callable[[Path], None]]]:
    """Every possible file, with the function that writes it to a path."""
    fill = max(meshes.fill.values()) if meshes.fill is not None else 0.0
    kinds: tuple[tuple[MeshKind, Mesh], ...] = (("volume", meshes.volume), ("shell", meshes.shell))
    for kind, mesh in kinds:
        size = meshes.statistics[mesh.name]["volume_mm3"]
        for row in mesh_formats():
            if row.elements:
                file = f"mesh/{kind}.{row.ending}"
                file_entry = MeshFile(file, kind, None, fill, size, len(mesh.cells))
                yield file_entry, partial(row.elements, mesh)
    mesh = meshes.volume
    # Films that lie on each other enclose nothing: the surface would have no inside.
    air = [chamber for chamber in mesh.cavities if meshes.holds_air(chamber)]
    surfaces: list[tuple[MeshKind, str | None, Surface]] = []
    surfaces += [("skin", None, skin_surface(mesh))] if air else []
    surfaces += [("cavity", chamber, mesh.cavity(chamber)[0]) for chamber in air]
    for kind, chamber, surface in surfaces:
        stem = kind if chamber is None else f"{kind}_{chamber}_conforming"
        for row in mesh_formats():
            file = f"mesh/{stem}.{row.ending}"
            file_entry = MeshFile(file, kind, chamber, fill, surface.volume, len(surface.faces))
            if row.cavity and chamber is not None:
                yield file_entry, partial(row.cavity, mesh, chamber)
            elif row.surface:
                yield file_entry, partial(row.surface, surface)


# Size and quality of a mesh.


class Statistics(TypedDict):
    """Size and quality of a mesh. Aspect is longest edge over shortest.

    ``thinnest_film_mm`` is the least thickness of a film that air has lifted.
    """

    nodes: int
    elements: int
    element: str
    least_scaled_jacobian: float
    worst_aspect: float
    volume_mm3: float
    height_mm: float
    thinnest_film_mm: float


class Thinning(NamedTuple):
    """Relative growth in area of films over the pockets, mean and largest, and their least
    thickness in mm there: no film changes its volume.
    """

    mean: float
    most: float
    thinnest_mm: float


def thinning(shell: Mesh, flat: Mesh) -> Thinning:
    """Return the thinning of a shell's films against the same shell when flat."""
    pockets = np.unique(np.concatenate([faces[:, 0] for faces in shell.face_sets.values()]))
    thickness = np.zeros(len(shell.cells))
    for name, value in shell.thickness.items():
        thickness[shell.cell_sets[name]] = value

    def areas(mesh: Mesh) -> NDArray[np.float64]:
        slopes = jacobians(mesh.kind, mesh.points, mesh.cells[pockets], integration=True)
        sizes: NDArray[np.float64] = np.linalg.norm(
            np.cross(slopes[..., 0], slopes[..., 1]), axis=2
        )
        return sizes

    raised, before = areas(shell), areas(flat)
    growth = np.maximum((raised / before).max(axis=1), 1.0)
    return Thinning(
        float(raised.sum() / before.sum()) - 1,
        float(growth.max()) - 1,
        float((thickness[pockets] / growth).min()),
    )


def mesh_statistics(mesh: Mesh, thinnest_film_mm: float) -> Statistics:
    """Counts, quality and volume of a mesh; a shell's volume is area x thickness."""
    sizes = volumes(mesh.kind, mesh.points, mesh.cells)
    for name, thickness in mesh.thickness.items():
        sizes[mesh.cell_sets[name]] *= thickness
    least = scaled_jacobians(mesh.kind, mesh.points, mesh.cells)
    heights = mesh.points[:, 2]
    return Statistics(
        nodes=len(mesh.points),
        elements=len(mesh.cells),
        element=mesh.kind,
        least_scaled_jacobian=float(least.min()),
        worst_aspect=float(aspects(mesh.kind, mesh.points, mesh.cells).max()),
        volume_mm3=float(sizes.sum()),
        height_mm=float(heights.max() - heights.min()),
        thinnest_film_mm=thinnest_film_mm,
    )
