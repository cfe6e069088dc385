"""The program from Python: a function for each command.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")

A design is given as a template's name, a TOML file, or a ``Design``. Keys are changed by texts,
``"stack.balloons=6"``, by dicts, ``{"stack.balloons": 6}``, or by keywords, ``stack={"balloons":
6}``. Bad input raises ``sbafab.errors.DesignError``, a folder that cannot be written
``OutputError``, each with one sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.files import Change, template_names, template_text
from sbafab.design.records import Design
from sbafab.errors import DesignError

if TYPE_CHECKING:
    from ezdxf.document import Drawing

    from sbafab.assemblies.build import Assembled, PlacedPart
    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.calibration import Calibration
    from sbafab.cutting.properties import DxfProfile
    from sbafab.laminate.laminate import Laminate, Layer
    from sbafab.meshing.surface import Surface
    from sbafab.models.figures import Prediction
    from sbafab.models.stack import Motion, Stack
    from sbafab.process import Progress
    from sbafab.reports.assembly_prediction import AssemblyPrediction, Grip
    from sbafab.reports.drawing import Dimension
    from sbafab.results.records import Record
    from sbafab.results.report import Report
    from sbafab.rules.finding import Findings
    from sbafab.runs.run import Run, Simulated
    from sbafab.search.find import FoundDesign
    from sbafab.search.sweep import SweptDesigns
    from sbafab.simulators.simulator import Name

__all__ = [
    "Source",
    "assemble",
    "build",
    "check",
    "check_folder",
    "checking",
    "cut",
    "dimensions",
    "drawing",
    "find",
    "generate",
    "grip",
    "kerf",
    "load",
    "loads",
    "mesh",
    "motion",
    "nest",
    "predict",
    "predict_assembly",
    "press",
    "record",
    "report",
    "resolved",
    "schema",
    "simulate",
    "solid",
    "stack",
    "sweep",
    "template",
    "templates",
]

Source = Design | str | Path
"""A design: itself, a template's name, or a TOML file."""


def design_of(source: Source, changes: Sequence[Change], tables: Mapping[str, Any]) -> Design:
    """Return the design with its keys changed. Raises DesignError."""
    if isinstance(source, Design):
        return source.with_(*changes, **tables) if changes or tables else source
    return actuators.load_design(source, [*changes, tables])


def either_of(
    source: Source | Assembly, changes: Sequence[Change], tables: Mapping[str, Any]
) -> Design | Assembly:
    """Return the design or the assembly with its keys changed. Raises DesignError."""
    from sbafab.assemblies.files import load
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return design_of(source, changes, tables)
    return load(source, [*changes, tables])


def parted(options: Mapping[str, Any], record: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split keywords into fields of the record and tables of a design."""
    names = {field.name for field in fields(record)}
    return (
        {name: value for name, value in options.items() if name in names},
        {name: value for name, value in options.items() if name not in names},
    )


# A design from its file to its laminate, findings and shapes.


def templates() -> list[str]:
    """Return the names of the designs and assemblies that ship, in alphabetical order."""
    return template_names()


def template(name: str) -> str:
    """Return the text (TOML) of a design that ships. Raises DesignError for another name."""
    return template_text(name)


def schema() -> dict[str, Any]:
    """Return the JSON schema (2020-12) of a design file: every key, its default and meaning."""
    from sbafab.assemblies.records import Assembly

    return actuators.schema(Assembly)


def load(source: Source, *changes: Change, **tables: Any) -> Design:
    """Return a design, with keys changed and checked like those of a file.

    Lengths are mm, or texts with a unit such as ``"0.75 mm"`` and ``"6 in"``. Raises DesignError
    with field, value and what is allowed.
    """
    return design_of(source, changes, tables)


def loads(text: str, path: str | Path = "design.toml") -> Design | Assembly:
    """Return a design or an assembly from the text of a file. Raises DesignError.

    Relative paths in it start beside ``path``.
    """
    from sbafab.assemblies.files import load_text

    return load_text(text, Path(path))


def resolved(design: Design | Assembly) -> dict[str, Any]:
    """Return the tables of a design or assembly with every default written out; lengths are mm."""
    from sbafab.assemblies.files import plain_tables
    from sbafab.design.records import resolved as written_out

    return written_out(design) if isinstance(design, Design) else plain_tables(design)


def build(source: Source, *changes: Change, **tables: Any) -> Laminate:
    """Return the laminate of a design: its layers bottom to top, lengths in mm, the axis at (0, 0).

    In a notebook it shows itself as a picture. Raises DesignError. The lay-up is the paper's
    (Sec. 2).
    """
    return actuators.build(load(source, *changes, **tables))


def assemble(source: str | Path | Assembly, *changes: Change, **tables: Any) -> Assembled:
    """An assembly from a template's name, a TOML file or its record: parts, designs and places.

    Places are mm and degrees in the frame of the part that stands on nothing. Raises DesignError
    where a part cannot sit where it should. The templates are the paper's (Sec. 2.1).
    """
    from sbafab.assemblies.build import assemble as put_together
    from sbafab.assemblies.files import load_assembly
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return put_together(source)
    return put_together(load_assembly(source, [*changes, tables]))


def check(
    source: Source | Assembly,
    *changes: Change,
    progress: Progress | None = None,
    **tables: Any,
) -> Findings:
    """Check a design with the rule deck; an assembly also between its parts.

    Each finding has its limit and worst measured value in its own ``unit``. ``progress`` is told
    each rule; what it raises ends the check. Raises DesignError for what cannot be built. Limits
    are the paper's (Sec. 2) where it gives one, else ours.
    """
    from sbafab.output.job import check_job
    from sbafab.rules.finding import Findings

    return Findings(check_job(either_of(source, changes, tables), progress=progress).findings)


def checking(
    source: Source, laminate: Laminate | None = None, pause: Callable[[], None] | None = None
) -> Iterator[tuple[str, Findings]]:
    """Yield every rule's name and its findings in a design, as they are measured.

    Iteration may stop at any rule; registration-yield, which draws builds, comes last.
    ``laminate`` is the design's, where it is built already; ``pause`` is called between parts of
    long rules, and what it raises ends the deck. Raises DesignError.
    """
    from sbafab.output.checked import limits
    from sbafab.rules.deck import RULES, run_rule
    from sbafab.rules.finding import Findings
    from sbafab.rules.measures import Measures

    design = load(source)
    measures = Measures(laminate or build(design), limits(design), pause or (lambda: None))
    for rule in RULES:
        findings = run_rule(rule, measures.laminate, measures.limits, measures)
        yield rule.name, Findings(findings)


def check_folder(folder: str | Path) -> Findings:
    """Check the cut files of an output folder as they lie on disk with the rule deck.

    Also whether the folder is what its ``design.toml`` makes (findings ``manifest-claims``,
    ``as-designed``, ``file-integrity``). Raises OutputError where none can be read there.
    """
    from sbafab.rules.finding import Findings
    from sbafab.runs.check_folder import check_folder as read_and_check

    return Findings(read_and_check(Path(folder)))


def solid(source: Source | Laminate | PlacedPart, *changes: Change, **tables: Any) -> Surface:
    """Return the closed surface of the flat actuator in mm, as for ``solid(...).trimesh()``.

    Films have their nominal thickness, pockets that of their mask. Of an assembly's part it is the
    outside, in the part's own frame and bent round its tube; ``part.pose`` places it. Raises
    DesignError.
    """
    from sbafab.assemblies.build import PlacedPart
    from sbafab.assemblies.shapes import bent_surface
    from sbafab.laminate.laminate import Laminate
    from sbafab.meshing.solid import solid as surface_of

    if isinstance(source, PlacedPart):
        return bent_surface(source, filled=True)
    flat = source if isinstance(source, Laminate) else build(source, *changes, **tables)
    return surface_of(flat)


def drawing(layer: Layer) -> Drawing:
    """Return a layer as an ezdxf document in mm: nominal edges as in its cut file, without kerf.

    It is DXF R2010: a closed LWPOLYLINE with bulges a contour, CIRCLE for a full circle.
    """
    from io import StringIO

    from ezdxf.filemanagement import read

    from sbafab.cutting.dxf_write import dxf_text
    from sbafab.cutting.order import cutting_order

    text = dxf_text(cutting_order(layer.profile), {"PATTERN": layer.pattern, "UNITS": "mm"})
    return read(StringIO(text))


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """Return the dimensions on a layer's drawing: circles, radii and widths in mm, with labels."""
    from sbafab.reports.drawing import dimensions as measured

    return measured(laminate, layer)


# Files of a design: everything, or one part of it.


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
    from sbafab.runs.run import RunRequest
    from sbafab.runs.run import generate as run

    return run(RunRequest(either_of(source, changes, tables), Path(out)), progress)


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
    from sbafab.runs.run import RunRequest
    from sbafab.runs.run import generate as run

    design = load(source, *changes, **tables)
    curves = Curves(dxf_profile, chord_error)
    return run(RunRequest(design, Path(out), ("cut",), curves), progress)


def press(source: Source, *changes: Change, out: str | Path = "out", **tables: Any) -> Run:
    """Writes the heat-press schedule, ``press.json`` and ``press.csv``; in C, kPa, N, mm and min.

    The steps are the paper's (Sec. 2). Raises DesignError where temperature, pad or pins do not
    suit the laminate, and OutputError.
    """
    from sbafab.runs.run import RunRequest
    from sbafab.runs.run import generate as run

    return run(RunRequest(load(source, *changes, **tables), Path(out), ("press",)))


def mesh(
    source: Source,
    *changes: Change,
    out: str | Path = "out",
    formats: Sequence[str] = ("vtu",),
    **options: Any,
) -> Run:
    """Writes solid, cavities and conforming meshes; the latter stand in the run's ``conforming``.

    ``formats`` are of "vtu", "vtk", "msh", "inp", "stl", "obj" and "ply". ``options`` holds
    fields of ``MeshSettings``, such as ``h`` mm, ``symmetry`` and ``fill_ul``, beside tables of the
    design. Takes the extra "mesh". Raises DesignError and OutputError.
    """
    from sbafab.meshing.conforming.layup import MeshSettings
    from sbafab.runs.run import Conforming, RunRequest
    from sbafab.runs.run import generate as run

    settings, tables = parted(options, MeshSettings)
    conforming = Conforming(MeshSettings(**settings), tuple(formats))
    design = load(source, *changes, **tables)
    return run(RunRequest(design, Path(out), ("mesh",), conforming=conforming))


def nest(sources: Sequence[Source], name: str = "job", out: str | Path = "out") -> Run:
    """Writes several designs into ``out/<name>/``, cut from the same film sheets.

    Their films, sheets and kerf must be alike. Raises DesignError, OutputError and DefectError.
    """
    from sbafab.runs.run import RunRequest
    from sbafab.runs.run import generate as run

    return run(RunRequest([load(source) for source in sources], Path(out), name=name))


def simulate(
    source: Source,
    *changes: Change,
    simulator: Name,
    out: str | Path = "out",
    export: bool = False,
    **options: Any,
) -> Simulated:
    """Runs a simulator that is installed into ``out/<name>/<simulator>/``.

    ``simulator`` is "calculix", "sofa" or "mujoco". ``options`` holds fields of ``Wish``, such as
    ``pressure`` kPa, ``chambers`` kPa by name and ``minutes``, beside tables of the design.
    ``export`` writes what it reads and runs nothing. Raises DesignError for what it cannot do, and
    OutputError.
    """
    from sbafab.runs.run import simulate as run
    from sbafab.simulators.simulator import SimulationRequest

    wish, tables = parted(options, SimulationRequest)
    design = load(source, *changes, **tables)
    return run(design, simulator, SimulationRequest(**wish), Path(out), export=export)


# Measurements of a lab: the kerf of its laser, results of its actuators.


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
    **values: Any,
) -> list[Record]:
    """Record results of a design or an assembly in the lab's file; return the records added.

    ``values`` holds ``serial``, ``leak`` ("pass" or "fail"), ``operator``, ``kit``, ``note``, and
    what was measured: ``proof_kpa``, ``burst_kpa``, ``stroke_mm``, ``force_n``, ``height_mm``,
    ``mass_g``, one or several of ``offset_mm``, ``turn_deg``, ``cut_mm``; beside tables of the
    design. A ``table`` (CSV) says it of a batch instead. ``again`` records new attempts of
    actuators that were mended and tested again. Raises DesignError, OutputError.
    """
    from sbafab.results import recording
    from sbafab.results.store import Lab

    results_by_name = {
        name: value for name, value in values.items() if name in recording.RESULT_NAMES
    }
    tables = {name: value for name, value in values.items() if name not in recording.RESULT_NAMES}
    results = recording.results_of(results_by_name, table)
    built = recording.built_from(source, [*changes, tables] if tables else changes)
    return recording.record(Lab(Path(lab)), built, results, again)


def report(lab: str | Path = "lab.sqlite") -> Report:
    """Evaluate all records of a lab's file: success, figures, tolerances.

    Units stand in the names and in ``unit``; shares come with their interval of 95 %. Raises
    OutputError where the file cannot be read.
    """
    from sbafab.results.report import report as report_of
    from sbafab.results.store import Lab

    return report_of(*Lab(Path(lab)).contents())


# Predictions by models, and designs found or swept by them.


def predict(
    source: Source,
    *changes: Change,
    pressures_kpa: Sequence[float] = (10.0, 100.0),
    flow_ml_min: float = 35.0,
    volumes_ul: Sequence[float] = (),
    quick: bool = False,
    laminate: Laminate | None = None,
    **options: Any,
) -> Prediction:
    """Predict what a design will do; each figure has a unit and names its model and its trust.

    Forces and works are at ``pressures_kpa``, times at ``flow_ml_min`` into each chamber, strokes
    with ``volumes_ul`` in each balloon. ``quick`` leaves out the curves and the figures of the
    elastic stack, which take seconds; ``laminate`` is the design's, where it is built already.
    ``options`` holds fields of ``Factors``: ``press_factor``, ``contact_factor``, ``pocket_loss``
    mm and ``modulus_mpa``, beside tables of the design. Raises DesignError for what is out of every
    model's range. Models: the paper's Eqs. 1-4 (Sec. 3), and elastic balloons of axisymmetric film
    in balance.
    """
    from sbafab.models.figures import Factors, PredictionRequest
    from sbafab.models.prediction import predict as model_predict

    factors, tables = parted(options, Factors)
    wish = PredictionRequest(
        tuple(pressures_kpa), flow_ml_min, tuple(volumes_ul), Factors(**factors)
    )
    return model_predict(load(source, *changes, **tables), wish, laminate, quick)


def predict_assembly(
    source: str | Path | Assembly | Assembled,
    *changes: Change,
    pressure_kpa: float = 10.0,
    load_g: float = 1.2,
    pause: Callable[[], None] | None = None,
    **tables: Any,
) -> AssemblyPrediction:
    """Predict the inflated parts of an assembly: reach, load, grip, and what they then touch.

    All actuators are at ``pressure_kpa``, and ``load_g`` g hangs across their tips; the paper's
    marble by default (Sec. 5). ``pause`` is called between parts of the work, which takes seconds;
    what it raises ends it. Raises DesignError for pressures that the models do not reach.
    """
    from sbafab.assemblies.build import Assembled
    from sbafab.reports.assembly_prediction import predict_assembly as model_predict

    assembled = source if isinstance(source, Assembled) else assemble(source, *changes, **tables)
    return model_predict(assembled, pressure_kpa, load_g, pause or (lambda: None))


def grip(assembled: Assembled, part: str) -> tuple[Grip, Surface] | None:
    """Return the grip of a radial part of an assembly and its inflated balloons; None for others.

    The surface is in mm in the part's own frame, as high as the lumen leaves room, free without
    one: lenses of two arcs of film that does not stretch (as for the paper's Sec. 5). Raises
    DesignError where the assembly has no such part.
    """
    from sbafab.assemblies.build import PlacedSba
    from sbafab.reports.assembly_prediction import grip as grip_of
    from sbafab.reports.inflated import gripping

    names = [placed.name for placed in assembled.parts]
    if part not in names:
        raise DesignError(f"no part is named {part!r}; there are {', '.join(names)}")
    placed = assembled[part]
    outcome = grip_of(assembled, placed) if isinstance(placed, PlacedSba) else None
    if outcome is None or not isinstance(placed, PlacedSba):
        return None
    free = (outcome.free - outcome.deflated) / 2 / placed.made.laminate.balloons
    return outcome, gripping(placed, outcome.room or free)


def stack(source: Source, *changes: Change, most_pressure: float = 110.0, **options: Any) -> Stack:
    """The actuator as plates joined by balloons, for poses in real time: ``stack.pose((5, 5, 0))``.

    ``most_pressure`` kPa is the most that it may be asked for; ``options`` holds fields of
    ``Factors`` beside tables of the design. Raises DesignError for pockets that are not round.
    Balloons lengthen and tilt and carry no shear (paper, Sec. 4.4).
    """
    from sbafab.models.figures import Factors
    from sbafab.models.stack import stack as stack_of

    factors, tables = parted(options, Factors)
    design = load(source, *changes, **tables)
    return stack_of(design, most_pressure=most_pressure, factors=Factors(**factors))


def motion(
    stack: Stack,
    length: float = 150.0,
    diameter: float = 0.635,
    *,
    fluid: str = "air",
    dead_volume: float = 0.0,
    delay: float = 0.0,
    pressures: Sequence[float] | None = None,
    **load: Any,
) -> Motion:
    """A stack that is fed through tubes, to call ``motion.step(dt, pressures=...)`` with pressures
    (kPa) at the valves, or ``motion.step(dt, flows=...)`` with flows (ul/s) of the pumps.

    ``length`` and inner ``diameter`` of each chamber's tube are mm (the default is the paper's
    tube, Sec. 2); ``fluid`` is air or water; ``dead_volume`` are ul between pump and tube
    (syringe, valve, fittings), ``delay`` s until they act; ``pressures`` (kPa, by default 0) are
    those to begin with; ``load`` is what ``stack.pose`` takes beside pressures. Flow is laminar
    (Poiseuille) or turbulent (Blasius), air isothermal. Raises DesignError.
    """
    from sbafab.models.pneumatics import FLUIDS, Line

    if fluid not in FLUIDS:
        raise DesignError(f'fluid = "{fluid}" must be one of {", ".join(sorted(FLUIDS))}')
    line = Line(FLUIDS[fluid], length, diameter, dead_volume, delay)
    return stack.motion(pressures, line, **load)


def find(
    source: Source,
    *changes: Change,
    least: Mapping[str, float] | None = None,
    most: Mapping[str, float] | None = None,
    best: str = "mass",
    **options: Any,
) -> FoundDesign:
    """The design that meets requirements and is best in one thing, or the nearest miss.

    ``find("3dof-15mm", least={"lumen": 3, "force@12.5mm@50kPa": 3}, most={"outline_diameter":
    20})``: ``least`` and ``most`` are in mm, N, g and kPa. ``options`` holds fields of
    ``FindRequest``, such as ``tries``, beside tables of the design; ``found.best.values`` are the
    found keys. Raises DesignError for a quantity that it does not know, with those it does.
    """
    from sbafab.search.find import FindRequest
    from sbafab.search.find import find as run_find
    from sbafab.search.trial import read_all

    settings, tables = parted(options, FindRequest)
    at_least = [f"{name}={value!r}" for name, value in (least or {}).items()]
    at_most = [f"{name}={value!r}" for name, value in (most or {}).items()]
    requirements, goal = read_all(at_least, at_most, best)
    return run_find(FindRequest(load(source, *changes, **tables), requirements, goal, **settings))


def sweep(
    source: Source,
    *changes: Change,
    vary: Sequence[str],
    out: str | Path = "out",
    **options: Any,
) -> SweptDesigns:
    """Checks and predicts a design with keys varied into ``out/<name>-sweep/``; a row a design.

    ``vary`` holds texts such as ``"chamber.diameter=4:8:0.5"`` (mm) and
    ``"stack.balloons=3,6,9"``. ``options`` holds fields of ``SweepRequest``, such as ``samples``,
    ``pressures_kpa``, ``workers`` and ``dask``, beside tables of the design. Raises DesignError for
    a key that is not there, and OutputError.
    """
    from sbafab.search.sweep import SweepRequest
    from sbafab.search.sweep import sweep as run_sweep
    from sbafab.search.vary import read_varied

    settings, tables = parted(options, SweepRequest)
    design = load(source, *changes, **tables)
    varied = tuple(read_varied(text) for text in vary)
    return run_sweep(SweepRequest(design, varied, **settings), Path(out))
