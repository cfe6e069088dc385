"""Write the flat solid and the cavities, each surface verified first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats.registry import MESH_FORMATS
from sbafab.meshing.formats.surfaces import write_stl
from sbafab.meshing.solid import SAGITTA, cavity, sealed, solid
from sbafab.meshing.surface import Surface
from sbafab.meshing.wrap import tube_wrap, wrapped

MeshKind = Literal["solid", "cavity", "volume", "shell", "skin"]
Writer = Callable[[Surface, Path, str], None]


@dataclass(frozen=True)
class MeshFile:
    """A mesh as the manifest lists it.

    ``file`` is relative to the output folder; ``chamber`` is None but for cavities; ``elements``
    counts triangles of surfaces, elements of volume and shell meshes. ``fill_ul`` is the volume of
    air in a balloon that the shape is for.
    """

    file: str
    kind: MeshKind
    chamber: str | None
    fill_ul: float
    volume_mm3: float
    elements: int


def write_meshes(
    laminate: Laminate,
    folder: Path,
    sagitta: float = SAGITTA,
    progress: Callable[[int, int], None] | None = None,
) -> list[MeshFile]:
    """Write ``mesh/solid.stl``, ``.3mf``, ``.glb`` and ``mesh/cavity_<chamber>.stl``, all flat.

    A laminate on a tube also gets ``mesh/solid_wrapped.*``, ``mesh/cavity_<chamber>_wrapped.stl``.
    ``folder`` is the output folder, ``sagitta`` the height in mm of an arc over its chord.
    ``progress`` is called with the numbers of files done and of all files. Raises OutputError if a
    surface is open or its volume is not the sum of area x thickness.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    shapes = 1 if laminate.tube is None else 2
    total = shapes * (sum(bool(row.solid) for row in MESH_FORMATS) + len(laminate.chambers))
    written: list[MeshFile] = []
    for mesh, surface, write in _meshes(laminate, sagitta):
        write(surface, folder / mesh.file, laminate.bonded_materials)
        written.append(mesh)
        if progress is not None:
            progress(len(written), total)
    return written


def _meshes(laminate: Laminate, sagitta: float) -> Iterator[tuple[MeshFile, Surface, Writer]]:
    wrap = tube_wrap(laminate)
    shapes = {"": solid(laminate, sagitta)}
    if wrap is not None:
        around = wrapped(solid(laminate, sagitta, wrap.cuts), wrap)
        shapes["_wrapped"] = sealed("the solid round its tube", around)
    for row in MESH_FORMATS:
        if row.solid is not None:
            for suffix, surface in shapes.items():
                file = f"mesh/solid{suffix}.{row.ending}"
                yield _described(file, "solid", None, surface), surface, row.solid
    for chamber in laminate.chambers:
        file = f"mesh/cavity_{chamber.name}.stl"
        surface = cavity(laminate, chamber, sagitta)
        yield _described(file, "cavity", chamber.name, surface), surface, write_stl
        if wrap is not None:
            file = f"mesh/cavity_{chamber.name}_wrapped.stl"
            around = wrapped(cavity(laminate, chamber, sagitta, wrap.cuts), wrap)
            sealed(f"the cavity of {chamber.name} round its tube", around)
            yield _described(file, "cavity", chamber.name, around), around, write_stl


def _described(file: str, kind: MeshKind, chamber: str | None, surface: Surface) -> MeshFile:
    return MeshFile(file, kind, chamber, 0.0, surface.volume, len(surface.faces))
