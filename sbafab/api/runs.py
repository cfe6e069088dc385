"""Files of a design: all or one part of them; and the simulators that read them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab import plugins
from sbafab.api.designs import Source, command, either_of, load
from sbafab.assemblies.records import Assembly
from sbafab.cutting.cut_settings import TRUE_ARCS, Curves, DxfProfile
from sbafab.design.files import Change
from sbafab.design.records import Design
from sbafab.documents import Document, attribute
from sbafab.errors import DesignError
from sbafab.folders.artefacts import EVERYTHING
from sbafab.folders.checks_json import FindingEntry, checks
from sbafab.folders.run import Run, RunRequest, Simulated, result_json
from sbafab.folders.run import generate as run
from sbafab.folders.run import simulate as run_simulator
from sbafab.meshing.conforming.layup import Element, MeshSettings, Symmetry
from sbafab.meshing.formats import conforming_endings
from sbafab.models.balloons import has_balloons
from sbafab.models.calibration import factors_of
from sbafab.pressing.cycles import batch_times
from sbafab.runtime import Progress
from sbafab.simulators.simulator import CHOICES, NAMES, Result, SimulationRequest


class RunDocument(Document, schema="sbafab/run@1"):
    """The output of a command that writes a folder."""

    folder: Path
    failed: bool
    findings: list[FindingEntry]
    notes: list[str] = attribute("order.notes")
    files: list[str]
    """contents of the folder"""


class NestedDesign(Document):
    """One of the designs."""

    name: str = attribute("design.name")
    failed: bool
    findings: list[FindingEntry]
    notes: tuple[str, ...] = attribute("laminate.notes")


class NestedDocument(Document, schema="sbafab/nested@1"):
    """The output of ``nest --json``."""

    folder: Path
    failed: bool
    designs: list[NestedDesign] = attribute("builds")
    files: list[str]
    """contents of the folder"""


def run_document(run: Run) -> dict[str, Any]:
    """Return the outcome of a run for programs."""
    files = [] if run.kept else sorted(run.manifest["files"])
    return (NestedDocument if run.order.is_job else RunDocument).of(run, files=files)


def import_design(source: str | Path, out: str | Path | None = None) -> Design:
    """Import files of another program, or of a run: a design of drawn layers, with its files.

    ``source`` is any source that ``sbafab import`` reads; ``out`` is the design file to write, by
    default its name in this folder, with drawings in a folder beside it. A ``UserWarning`` names
    each item that is not imported. Raises DesignError if the source cannot be imported, OutputError
    if a file is in the way.
    """
    # Its formats load by name: a run imports nothing.
    import_to = plugins.load("sbafab.importing.sources:import_to")
    _, remarks, written = import_to(Path(source), None if out is None else Path(out))
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    design: Design = written.design
    return design


@command
def generate(
    source: Source | Assembly,
    *changes: Change,
    out: str | Path = RunRequest.out,
    decks: bool = False,
    dxf_profile: DxfProfile = TRUE_ARCS.profile,
    chord_error: float = TRUE_ARCS.chord_error,
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Write everything into ``out/<name>/``; the run tells whether a rule failed.

    ``decks`` adds the simulators' input; ``dxf_profile`` and ``chord_error`` mm are as in ``cut``.
    ``progress`` is called with each step; an exception in it stops the run and leaves the old
    folder intact. Raises DesignError, OutputError if the folder cannot be written or belongs to
    another design, and DefectError if the written files differ from the checked design.
    """
    either = either_of(source, [*changes, tables])
    if decks and isinstance(either, Assembly):
        raise DesignError(
            f"decks need a single design, but {either.name} is an assembly; omit them"
        )
    parts = (*EVERYTHING, *NAMES) if decks else EVERYTHING
    return run(RunRequest(either, Path(out), parts, Curves(dxf_profile, chord_error)), progress)


@command
def cut(
    source: Source,
    *changes: Change,
    out: str | Path = RunRequest.out,
    dxf_profile: DxfProfile = TRUE_ARCS.profile,
    chord_error: float = TRUE_ARCS.chord_error,
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Write the cut files and film sheets, DXF R2010 in mm.

    ``dxf_profile`` is "bulges", "arcs" (LINE, ARC, CIRCLE) or "chords"; ``chord_error`` mm applies
    to the last. ``progress`` is called with each step, as in ``generate``. Raises DesignError,
    OutputError and DefectError.
    """
    design = load(source, *changes, **tables)
    curves = Curves(dxf_profile, chord_error)
    return run(RunRequest(design, Path(out), ("cut",), curves), progress)


@command
def press(
    source: Source,
    *changes: Change,
    out: str | Path = RunRequest.out,
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Write the heat-press schedule, ``press.json`` and ``press.csv``; in C, kPa, N, mm and min.

    The steps follow the paper (Sec. 2). Raises DesignError if temperature, pad or pins do not suit
    the laminate, and OutputError.
    """
    return run(RunRequest(load(source, *changes, **tables), Path(out), ("press",)), progress)


@command
def mesh(
    source: Source,
    *changes: Change,
    out: str | Path = RunRequest.out,
    formats: str | Sequence[str] = ("vtu",),
    h: float = MeshSettings.h,
    element: Element = MeshSettings.element,
    symmetry: Symmetry = MeshSettings.symmetry,
    fill_ul: float | None = MeshSettings.fill_ul,
    gaps: bool = MeshSettings.gaps,
    wrapped: bool = MeshSettings.wrapped,
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Write solid, cavities and conforming meshes; the run's ``conforming`` lists the latter.

    ``formats`` are any of "vtu", "vtk", "msh", "inp", "stl", "obj" and "ply". ``h`` mm and the
    arguments after it are the fields of ``MeshSettings``; ``tables`` override tables of the design.
    Needs the extra "mesh". Raises DesignError and OutputError.
    """
    settings = MeshSettings(h, element, symmetry, fill_ul, gaps, wrapped)
    each = (formats,) if isinstance(formats, str) else tuple(formats)
    design = load(source, *changes, **tables)
    request = RunRequest(design, Path(out), ("mesh",), meshes=settings, formats=each)
    return run(request, progress)


def nest(
    sources: Sequence[Source],
    name: str = RunRequest.name,
    out: str | Path = RunRequest.out,
    dxf_profile: DxfProfile = TRUE_ARCS.profile,
    chord_error: float = TRUE_ARCS.chord_error,
    progress: Progress | None = None,
) -> Run:
    """Write several designs into ``out/<name>/``, cut from the same film sheets.

    Their films, sheets and kerf must be equal; ``dxf_profile`` and ``chord_error`` mm are as in
    ``cut``. Raises DesignError, OutputError and DefectError.
    """
    designs, curves = [load(source) for source in sources], Curves(dxf_profile, chord_error)
    return run(RunRequest(designs, Path(out), curves=curves, name=name), progress)


@command
def simulate(
    source: Source,
    *changes: Change,
    simulator: str,
    out: str | Path = RunRequest.out,
    export: bool = False,
    pressure: float | None = None,
    chambers: Mapping[str, float] | None = None,
    minutes: float = SimulationRequest.minutes,
    h: float | None = None,
    symmetry: str | None = None,
    procedure: str | None = None,
    scene: str | None = None,
    seconds: float | None = None,
    volumes: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    **tables: Any,
) -> Simulated:
    """Run an installed simulator and write to ``out/<name>/<simulator>/``.

    ``simulator`` is "calculix", "sofa" or "mujoco"; ``export`` writes its input and does not run
    it. ``pressure`` kPa (a vacuum is negative), ``chambers`` kPa by name and the arguments after
    them are the fields of ``SimulationRequest``: ``h`` in mm, ``seconds`` of simulated time,
    ``volumes`` in ul by chamber; ``tables`` override tables of the design. Raises DesignError for
    an unknown simulator or argument and for an impossible request, OutputError, and VoidError if
    the result is impossible.
    """
    request = SimulationRequest(
        pressure, chambers or {}, minutes, h, symmetry, procedure, scene, seconds, volumes or {}
    )
    design = load(source, *changes, **tables)
    return run_simulator(design, simulator, request, Path(out), progress, export)
