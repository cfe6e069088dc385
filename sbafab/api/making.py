"""Files of a design: everything, or one part of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.api.designs import load
from sbafab.api.sources import Source, either_of, parted
from sbafab.design.reading import Change

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.dxf_write import DxfProfile
    from sbafab.output.run import Run
    from sbafab.output.simulating import Simulated
    from sbafab.progress import Progress
    from sbafab.simulators.simulator import Name


def generate(
    source: Source | Assembly,
    *changes: Change,
    out: str | Path = "out",
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Writes everything into ``out/<name>/``; the run tells whether a rule failed.

    ``progress`` is told what is done; what it raises ends the run, with the old folder whole.
    Raises DesignError, OutputError where the folder cannot be written or is another design's, and
    DefectError where what was written is not what was checked.
    """
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import generate_assembly
    from sbafab.output.run import generate as run_generate

    found = either_of(source, changes, tables)
    if isinstance(found, Assembly):
        return generate_assembly(found, Path(out), progress)
    return run_generate(found, Path(out), progress=progress)


def cut(
    source: Source,
    *changes: Change,
    out: str | Path = "out",
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Writes the cut files and film sheets, DXF R2010 in mm.

    ``dxf_profile`` is "bulges", "arcs" (LINE, ARC, CIRCLE) or "chords"; ``chord_error`` mm counts
    for the last. ``progress`` is told what is done, as in ``generate``. Raises DesignError,
    OutputError and DefectError.
    """
    from sbafab.cutting.dxf_write import Curves
    from sbafab.output.run import generate as run_generate

    design = load(source, *changes, **tables)
    curves = Curves(dxf_profile, chord_error)
    return run_generate(design, Path(out), ("cut",), progress, curves)


def press(source: Source, *changes: Change, out: str | Path = "out", **tables: Any) -> Run:
    """Writes the heat-press schedule, ``press.json`` and ``press.csv``; in C, kPa, N, mm and min.

    The steps are the paper's (Sec. 2). Raises DesignError where temperature, pad or pins do not
    suit the laminate, and OutputError.
    """
    from sbafab.output.run import generate as run_generate

    return run_generate(load(source, *changes, **tables), Path(out), ("press",))


def mesh(
    source: Source,
    *changes: Change,
    out: str | Path = "out",
    formats: Sequence[str] = ("vtu",),
    **asked: Any,
) -> Run:
    """Writes solid, cavities and conforming meshes; the latter stand in the run's ``conforming``.

    ``formats`` are of "vtu", "vtk", "msh", "inp", "stl", "obj" and "ply". ``asked`` holds fields of
    ``MeshSettings``, such as ``h`` mm, ``symmetry`` and ``fill_ul``, beside tables of the design.
    Takes the extra "mesh". Raises DesignError and OutputError.
    """
    from sbafab.meshing.conforming.settings import MeshSettings
    from sbafab.output.run import Conforming, Extras
    from sbafab.output.run import generate as run_generate

    settings, tables = parted(asked, MeshSettings)
    extras = Extras(Conforming(MeshSettings(**settings), tuple(formats)))
    return run_generate(load(source, *changes, **tables), Path(out), ("mesh",), extras=extras)


def nest(sources: Sequence[Source], name: str = "job", out: str | Path = "out") -> Run:
    """Writes several designs into ``out/<name>/``, cut from the same film sheets.

    Their films, sheets and kerf must be alike. Raises DesignError, OutputError and DefectError.
    """
    from sbafab.output.job import generate_job

    return generate_job([load(source) for source in sources], name, Path(out))


def simulate(
    source: Source,
    *changes: Change,
    simulator: Name,
    out: str | Path = "out",
    export: bool = False,
    **asked: Any,
) -> Simulated:
    """Runs a simulator that is installed into ``out/<name>/<simulator>/``.

    ``simulator`` is "calculix", "sofa" or "mujoco". ``asked`` holds fields of ``Wish``, such as
    ``pressure`` kPa, ``chambers`` kPa by name and ``minutes``, beside tables of the design.
    ``export`` writes what it reads and runs nothing. Raises DesignError for what it cannot do, and
    OutputError.
    """
    from sbafab.output.simulating import simulate as run
    from sbafab.simulators.simulator import Wish

    wish, tables = parted(asked, Wish)
    design = load(source, *changes, **tables)
    return run(design, simulator, Wish(**wish), Path(out), export=export)
