"""The mesh folder: every file written, each surface verified first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

from sbafab.laminate.laminate import Laminate
from sbafab.meshing.solid import SAGITTA, cavity, sealed, solid
from sbafab.meshing.surface import Surface
from sbafab.meshing.wrap import tube_wrap, wrapped
from sbafab.meshing.write_3mf import write_3mf
from sbafab.meshing.write_glb import write_glb
from sbafab.meshing.write_stl import write_stl

MeshKind = Literal["solid", "cavity", "volume", "shell", "skin"]
Writer = Callable[[Surface, Path], None]

SOLID_WRITERS: dict[str, Writer] = {
    "stl": write_stl,
    "3mf": write_3mf,
    "glb": write_glb,
}


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
    ``progress`` is told how many of how many files are done. Raises OutputError if a surface is
    open or its volume is not the sum of area x thickness.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    total = len(SOLID_WRITERS) + len(laminate.chambers)
    total *= 1 if laminate.tube is None else 2
    written: list[MeshFile] = []
    for mesh, surface, write in _meshes(laminate, sagitta):
        write(surface, folder / mesh.file)
        written.append(mesh)
        if progress is not None:
            progress(len(written), total)
    return written


def _meshes(laminate: Laminate, sagitta: float) -> Iterator[tuple[MeshFile, Surface, Writer]]:
    wrap = tube_wrap(laminate)
    surface = solid(laminate, sagitta)
    around = None
    if wrap is not None:
        around = wrapped(solid(laminate, sagitta, wrap.cuts), wrap)
        sealed("the solid round its tube", around)
    films = laminate.bonded_materials
    named: dict[str, Writer] = {
        "3mf": partial(write_3mf, material=films),
        "glb": partial(write_glb, material=films),
    }
    told = _described("", "solid", None, surface)
    for suffix, write in {**SOLID_WRITERS, **named}.items():
        yield replace(told, file=f"mesh/solid.{suffix}"), surface, write
        if around is not None:
            yield _described(f"mesh/solid_wrapped.{suffix}", "solid", None, around), around, write
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
