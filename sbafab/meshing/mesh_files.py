"""Write the flat solid and the cavities, each surface verified first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from sbafab.errors import OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import MESH_FORMATS, write_stl
from sbafab.meshing.solid import SAGITTA, cavity, sealed, solid
from sbafab.meshing.surface import Surface
from sbafab.meshing.wrap import TubeWrap, tube_wrap, wrapped

MeshKind = Literal["solid", "cavity", "volume", "shell", "skin"]
Writer = Callable[[Surface, Path, str], None]
_SurfaceFiles = tuple[list[tuple[str, Writer]], MeshKind, str | None, Callable[[], Surface]]


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
    laminate: Laminate,
    folder: Path,
    sagitta: float = SAGITTA,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[MeshFile], list[tuple[str, str]]]:
    """Write ``mesh/solid.stl``, ``.3mf``, ``.glb`` and ``mesh/cavity_<chamber>.stl``, all flat.

    A laminate on a tube also gets ``mesh/solid_wrapped.*``, ``mesh/cavity_<chamber>_wrapped.stl``.
    ``folder`` is the output folder, ``sagitta`` the height in mm of an arc over its chord.
    ``progress`` is called with the number of files done and the total. Return the files written,
    and the omitted ones with the reason: a surface that is open, or whose volume is not the sum of
    area x thickness.
    """
    (folder / "mesh").mkdir(parents=True, exist_ok=True)
    surfaces = _surfaces(laminate, sagitta)
    written: list[MeshFile] = []
    left_out: list[tuple[str, str]] = []
    total = sum(len(rows) for rows, *_ in surfaces)
    for rows, kind, chamber, make in surfaces:
        try:
            surface = make()
        except OutputError as error:
            left_out += [(file, str(error)) for file, _ in rows]
            continue
        for file, write in rows:
            write(surface, folder / file, laminate.bonded_materials)
            written.append(MeshFile(file, kind, chamber, 0.0, surface.volume, len(surface.faces)))
            if progress is not None:
                progress(len(written), total)
    return written, left_out


def _surfaces(laminate: Laminate, sagitta: float) -> list[_SurfaceFiles]:
    """Return each surface's files with their writers, its kind and chamber, and its maker."""
    wrap = tube_wrap(laminate)

    def of_solid(suffix: str) -> list[tuple[str, Writer]]:
        rows = ((row.ending, row.solid) for row in MESH_FORMATS)
        return [(f"mesh/solid{suffix}.{ending}", write) for ending, write in rows if write]

    def round_tube(name: str, flat: Callable[..., Surface], wrap: TubeWrap) -> Surface:
        return sealed(f"{name} round its tube", wrapped(flat(sagitta, wrap.cuts), wrap))

    shapes: dict[str | None, tuple[str, Callable[..., Surface]]] = {
        None: ("the solid", partial(solid, laminate))
    }
    for chamber in laminate.chambers:
        name = f"the cavity of chamber {chamber.name}"
        shapes[chamber.name] = (name, partial(cavity, laminate, chamber))
    found: list[_SurfaceFiles] = []
    for chamber_name, (name, flat) in shapes.items():
        kind: MeshKind = "solid" if chamber_name is None else "cavity"
        ways: dict[str, Callable[[], Surface]] = {"": partial(flat, sagitta)}
        if wrap is not None:
            ways["_wrapped"] = partial(round_tube, name, flat, wrap)
        for suffix, make in ways.items():
            rows = of_solid(suffix)
            if chamber_name is not None:
                rows = [(f"mesh/cavity_{chamber_name}{suffix}.stl", write_stl)]
            found.append((rows, kind, chamber_name, make))
    return found
