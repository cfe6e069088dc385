"""Files of a design: everything, or one part of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.api.designs import Source, either_of, load, parted
from sbafab.design.files import Change

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.calibration import Calibration
    from sbafab.cutting.properties import DxfProfile
    from sbafab.output.run import Run, Simulated
    from sbafab.process import Progress
    from sbafab.results.records import Record
    from sbafab.results.report import Report
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
    from sbafab.cutting.properties import Curves
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
    from sbafab.meshing.conforming.layup import MeshSettings
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
    from sbafab.output.run import simulate as run
    from sbafab.simulators.simulator import Wish

    wish, tables = parted(asked, Wish)
    design = load(source, *changes, **tables)
    return run(design, simulator, Wish(**wish), Path(out), export=export)


# What a lab measures: the kerf of its laser, and what came out of the press.


def kerf(
    measurements: str | Path, resolution: float | None = None, instrument: str = ""
) -> Calibration:
    """The kerf in mm from a filled ``coupon.csv``, over all and along x and y.

    ``instrument`` is "calliper", "scanner" or "microscope" where the table has no column of that
    name; ``resolution`` mm is its least step, by default 0.01, 0.0106 (2400 dpi) or 0.001. A
    constant reading error and a scale are fitted with the kerf. Uncertainties follow the usual
    guide to their expression (JCGM 100:2008), intervals hold 95 %. Raises DesignError for a table
    that can be read in two ways, for a slip in it, and for what no beam cuts.
    """
    from sbafab.cutting.calibration import calibrated, read_measurements

    return calibrated(read_measurements(Path(measurements), instrument), resolution)


def record(
    source: Source,
    *changes: Change,
    lab: str | Path = "lab.sqlite",
    table: str | Path | None = None,
    again: bool = False,
    **said: Any,
) -> list[Record]:
    """Records what came out of a design or an assembly in the lab's file; the records added.

    ``said`` holds ``serial``, ``leak`` ("pass" or "fail"), ``operator``, ``kit``, ``note``, and
    what was measured: ``proof_kpa``, ``burst_kpa``, ``stroke_mm``, ``force_n``, ``height_mm``,
    ``mass_g``, one or several of ``offset_mm``, ``turn_deg``, ``cut_mm``; beside tables of the
    design. A ``table`` (CSV) says it of a batch instead. ``again`` records new attempts of
    actuators that were mended and tested again. Raises DesignError, OutputError.
    """
    from sbafab.results import recording
    from sbafab.results.store import Lab

    told = {name: value for name, value in said.items() if name in recording.SAID}
    tables = {name: value for name, value in said.items() if name not in recording.SAID}
    results = recording.results_of(told, table)
    built = recording.built_from(source, [*changes, tables] if tables else changes)
    return recording.record(Lab(Path(lab)), built, results, again)


def report(lab: str | Path = "lab.sqlite") -> Report:
    """What all records of a lab's file say together: success, figures, tolerances.

    Units stand in the names and in ``unit``; shares come with their interval of 95 %. Raises
    OutputError where the file cannot be read.
    """
    from sbafab.results.report import report as report_of
    from sbafab.results.store import Lab

    return report_of(*Lab(Path(lab)).contents())
