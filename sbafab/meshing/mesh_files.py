"""Write the flat solid and the cavities, each surface verified first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sbafab.errors import OutputError
from sbafab.laminate.laminate import Chamber, Laminate
from sbafab.meshing.formats import mesh_formats, write_stl
from sbafab.meshing.solid import TubeWrap, cavity, sealed, solid, tube_wrap, wrapped
from sbafab.meshing.surface import Surface

MeshKind = Literal["solid", "cavity", "volume", "shell", "skin"]


@dataclass(frozen=True)
class MeshFile:
    """A mesh as the manifest lists it.

    ``file`` is relative to the output folder; ``chamber`` is None except for cavities; ``elements``
    counts triangles of surfaces, elements of volume and shell meshes. ``fill_ul`` is the air per
    balloon in ul for which the shape was computed.
    """

    file: str
    kind: MeshKind
    chamber: str | None
    fill_ul: float
    volume_mm3: float
    elements: int


def write_meshes(
    laminate: Laminate, folder: Path, progress: Callable[[int, int], None] | None = None
) -> tuple[list[MeshFile], list[tuple[str, str]]]:
    """Write ``mesh/solid.stl``, ``.3mf``, ``.glb`` and ``mesh/cavity_<chamber>.stl``, all flat.

    A laminate on a tube also gets ``mesh/solid_wrapped.*``, ``mesh/cavity_<chamber>_wrapped.stl``.
    ``folder`` is the output folder. ``progress`` is called with the number of files done and the
    total. Return the files written, and the omitted ones with the reason: a surface that is open,
    or whose volume is not the sum of area x thickness.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    wrap = tube_wrap(laminate)
    written: list[MeshFile] = []
    left_out: list[tuple[str, str]] = []
    solids = {row.ending: row.solid for row in mesh_formats() if row.solid}
    shapes = [
        (chamber, wrapping) for chamber in (None, *laminate.chambers) for wrapping in (None, wrap)
    ]
    if wrap is None:
        shapes = shapes[::2]
    total = sum(len(solids) if chamber is None else 1 for chamber, _ in shapes)
    for chamber, wrapping in shapes:
        name = None if chamber is None else chamber.name
        stem = "solid" if name is None else f"cavity_{name}"
        stem += "" if wrapping is None else "_wrapped"
        writers = solids if name is None else {"stl": write_stl}
        files = {f"mesh/{stem}.{ending}": write for ending, write in writers.items()}
        try:
            surface = _surface(laminate, chamber, wrapping)
        except OutputError as error:
            left_out += [(file, str(error)) for file in files]
            continue
        kind: MeshKind = "solid" if name is None else "cavity"
        for file, write in files.items():
            write(surface, folder / file, laminate.bonded_materials)
            written.append(MeshFile(file, kind, name, 0.0, surface.volume, len(surface.faces)))
            if progress is not None:
                progress(len(written), total)
    return written, left_out


def _surface(laminate: Laminate, chamber: Chamber | None, wrap: TubeWrap | None) -> Surface:
    step = 0.0 if wrap is None else wrap.step
    surface = solid(laminate, step=step) if chamber is None else cavity(laminate, chamber, step)
    if wrap is None:
        return surface
    name = "the solid" if chamber is None else f"the cavity of chamber {chamber.name}"
    return sealed(f"{name} round its tube", wrapped(surface, wrap))
