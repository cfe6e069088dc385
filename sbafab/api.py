"""The program from Python: the commands' names, each a function.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")

A design is given as a template's name, a TOML file, or a ``Design``. Keys are changed by texts,
``"stack.balloons=6"``, by dicts, ``{"stack.balloons": 6}``, or by keywords, ``stack={"balloons":
6}``. Bad input raises ``sbafab.errors.DesignError``, a folder that cannot be written
``OutputError``, each with one sentence.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.reading import Change
from sbafab.design.records import Design
from sbafab.design.templates import template_names, template_text

if TYPE_CHECKING:
    from ezdxf.document import Drawing

    from sbafab.assemblies.build import Assembled
    from sbafab.assemblies.records import Assembly
    from sbafab.cutting.calibration import Calibration
    from sbafab.cutting.dxf_write import DxfProfile
    from sbafab.laminate.laminate import Laminate, Layer
    from sbafab.meshing.surface import Surface
    from sbafab.models.figures import Prediction
    from sbafab.models.motion import Motion
    from sbafab.models.stack import Stack
    from sbafab.output.run import Run
    from sbafab.output.simulating import Simulated
    from sbafab.progress import Progress
    from sbafab.reports.features import Dimension
    from sbafab.results.records import Record
    from sbafab.results.report import Report
    from sbafab.rules.finding import Findings
    from sbafab.search.find import FoundDesign
    from sbafab.search.sweep import SweptDesigns
    from sbafab.simulators.simulator import Name

Source = Design | str | Path


def templates() -> list[str]:
    """Names of the designs that ship."""
    return template_names()


def load(source: Source, *changes: Change, **tables: Any) -> Design:
    """A design, with keys changed. Raises DesignError."""
    if isinstance(source, Design):
        return source.with_(*changes, **tables) if changes or tables else source
    return actuators.load_design(source, [*changes, tables])


def loads(text: str, path: str | Path = "design.toml") -> Design | Assembly:
    """A design or an assembly from the text of a file; relative paths in it start beside ``path``.

    Raises DesignError.
    """
    from sbafab.assemblies.reading import load_text

    return load_text(text, Path(path))


def template(name: str) -> str:
    """The commented text of a design that ships. Raises DesignError."""
    return template_text(name)


def resolved(design: Design) -> dict[str, Any]:
    """The design's tables with every default written out."""
    from sbafab.design.writing import resolved as written_out

    return written_out(design)


def build(source: Source, *changes: Change, **tables: Any) -> Laminate:
    """The laminate of a design; in a notebook it shows itself as a picture."""
    return actuators.build(load(source, *changes, **tables))


def assemble(source: str | Path, *changes: Change, **tables: Any) -> Assembled:
    """An assembly from a template's name or a TOML file: its parts with designs and places."""
    from sbafab.assemblies.build import assemble as put_together
    from sbafab.assemblies.reading import load_assembly

    return put_together(load_assembly(source, [*changes, tables]))


def check(source: Source | Assembly, *changes: Change, **tables: Any) -> Findings:
    """What the rule deck finds in a design; of an assembly, also what is found between parts."""
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import check_assembly
    from sbafab.output.checking import check as run_check
    from sbafab.rules.finding import Findings

    found = _loaded(source, changes, tables)
    if isinstance(found, Assembly):
        return Findings(check_assembly(found).findings)
    return Findings(run_check(found)[1])


def checking(source: Source, laminate: Laminate | None = None) -> Iterator[tuple[str, Findings]]:
    """Every rule's name and what it finds in a design, one after the other, as they are measured.

    Who stops asking stops the deck; registration-yield, which draws builds, comes last.
    ``laminate`` is the design's, where it is built already.
    """
    from sbafab.output.settings import limits
    from sbafab.rules.deck import RULES, run_rule
    from sbafab.rules.finding import Findings
    from sbafab.rules.measures import Measures

    design = load(source)
    measures = Measures(laminate or build(design), limits(design))
    for rule in RULES:
        found = run_rule(rule, measures.laminate, measures.limits, measures)
        yield rule.name, Findings(found)


def check_folder(folder: str | Path) -> Findings:
    """What the rule deck finds in the cut files of an output folder as they lie on disk."""
    from sbafab.as_built.check import check_folder as read_and_check
    from sbafab.rules.finding import Findings

    return Findings(read_and_check(Path(folder)))


def generate(
    source: Source | Assembly,
    *changes: Change,
    out: str | Path = "out",
    progress: Progress | None = None,
    **tables: Any,
) -> Run:
    """Writes everything into ``out/<name>/``; the run tells whether a rule failed.

    ``progress`` is told what is done; what it raises ends the run, with the old folder whole.
    """
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import generate_assembly
    from sbafab.output.run import generate as run_generate

    found = _loaded(source, changes, tables)
    if isinstance(found, Assembly):
        return generate_assembly(found, Path(out), progress)
    return run_generate(found, Path(out), progress=progress)


def _loaded(
    source: Source | Assembly, changes: Sequence[Change], tables: Mapping[str, Any]
) -> Design | Assembly:
    from sbafab.assemblies.reading import load as load_either
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return load(source, *changes, **tables)
    return load_either(source, [*changes, tables])


def cut(
    source: Source,
    *changes: Change,
    out: str | Path = "out",
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
    **tables: Any,
) -> Run:
    """Writes the cut files and film sheets; ``chord_error`` mm counts for the profile "chords"."""
    from sbafab.cutting.dxf_write import Curves
    from sbafab.output.run import generate as run_generate

    design = load(source, *changes, **tables)
    return run_generate(design, Path(out), ("cut",), None, Curves(dxf_profile, chord_error))


def press(source: Source, *changes: Change, out: str | Path = "out", **tables: Any) -> Run:
    """Writes the heat-press schedule, ``press.json`` and ``press.csv``."""
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

    ``asked`` holds fields of ``MeshSettings``, such as ``h`` mm, ``symmetry`` and ``fill_ul``,
    beside tables of the design. Takes the extra "mesh".
    """
    from sbafab.meshing.conforming.settings import MeshSettings
    from sbafab.output.run import Conforming, Extras
    from sbafab.output.run import generate as run_generate

    settings, tables = _parted(asked, MeshSettings)
    extras = Extras(Conforming(MeshSettings(**settings), tuple(formats)))
    return run_generate(load(source, *changes, **tables), Path(out), ("mesh",), extras=extras)


def _parted(asked: Mapping[str, Any], record: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """What of the keywords are fields of the record, and what are tables of a design."""
    names = {field.name for field in fields(record)}
    return (
        {name: value for name, value in asked.items() if name in names},
        {name: value for name, value in asked.items() if name not in names},
    )


def nest(sources: Sequence[Source], name: str = "job", out: str | Path = "out") -> Run:
    """Writes several designs into ``out/<name>/``, cut from the same film sheets."""
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

    ``asked`` holds fields of ``simulators.simulator.Wish``, such as ``pressure`` kPa, ``chambers``
    and ``minutes``, beside tables of the design. ``export`` writes what it reads and runs nothing.
    """
    from sbafab.output.simulating import simulate as run
    from sbafab.simulators.simulator import Wish

    wish, tables = _parted(asked, Wish)
    design = load(source, *changes, **tables)
    return run(design, simulator, Wish(**wish), Path(out), export=export)


def predict(
    source: Source,
    *changes: Change,
    pressures_kpa: Sequence[float] = (10.0, 100.0),
    flow_ml_min: float = 35.0,
    volumes_ul: Sequence[float] = (),
    quick: bool = False,
    **asked: Any,
) -> Prediction:
    """What a design will do; each figure names its model and its trust.

    ``quick`` leaves out the figures of the elastic stack, which take seconds. ``asked`` holds
    fields of ``models.figures.Factors``, which are ``press_factor``, ``contact_factor``,
    ``pocket_loss`` mm and ``modulus_mpa``, beside tables of the design. Raises DesignError for what
    is out of every model's range.
    """
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.prediction import predict as model_predict

    factors, tables = _parted(asked, Factors)
    wish = Asked(tuple(pressures_kpa), flow_ml_min, tuple(volumes_ul), Factors(**factors))
    return model_predict(load(source, *changes, **tables), wish, quick=quick)


def stack(source: Source, *changes: Change, most_pressure: float = 110.0, **asked: Any) -> Stack:
    """The actuator as plates joined by balloons, for poses in real time: ``stack.pose((5, 5, 0))``.

    ``most_pressure`` kPa is the most that it may be asked for; ``asked`` holds fields of
    ``models.figures.Factors`` beside tables of the design. Raises DesignError for pockets that are
    not round.
    """
    from sbafab.models.figures import Factors
    from sbafab.models.stack import stack as stack_of

    factors, tables = _parted(asked, Factors)
    design = load(source, *changes, **tables)
    return stack_of(design, most_pressure=most_pressure, factors=Factors(**factors))


def find(
    source: Source,
    *changes: Change,
    least: Mapping[str, float] | None = None,
    most: Mapping[str, float] | None = None,
    best: str = "mass",
    **asked: Any,
) -> FoundDesign:
    """The design that meets requirements and is best in one thing, or the nearest miss.

    ``find("3dof-15mm", least={"lumen": 3, "force@12.5mm@50kPa": 3}, most={"outline_diameter":
    20})``; quantities in mm, N, g and kPa. ``asked`` holds fields of ``search.find.FindRequest``,
    such as ``tries``, beside tables of the design; ``found.best.values`` are the found keys.
    """
    from sbafab.search.find import FindRequest
    from sbafab.search.find import find as run_find
    from sbafab.search.requirements import read_all

    settings, tables = _parted(asked, FindRequest)
    at_least = [f"{name}={value!r}" for name, value in (least or {}).items()]
    at_most = [f"{name}={value!r}" for name, value in (most or {}).items()]
    requirements, goal = read_all(at_least, at_most, best)
    return run_find(FindRequest(load(source, *changes, **tables), requirements, goal, **settings))


def motion(stack: Stack, length: float = 150.0, diameter: float = 0.635, **load: Any) -> Motion:
    """A stack that is fed with air through tubes, to call ``motion.step(dt, pressures=...)``.

    ``length`` and inner ``diameter`` of each chamber's tube are mm; ``load`` is what ``stack.pose``
    takes beside pressures. Raises DesignError.
    """
    from sbafab.models.pneumatics import AIR, Line

    return stack.motion(line=Line(AIR, length, diameter), **load)


def sweep(
    source: Source,
    *changes: Change,
    vary: Sequence[str],
    out: str | Path = "out",
    **asked: Any,
) -> SweptDesigns:
    """Checks and predicts a design with keys varied into ``out/<name>-sweep/``; a row a design.

    ``vary`` holds texts such as ``"chamber.diameter=4:8:0.5"`` and ``"stack.balloons=3,6,9"``.
    ``asked`` holds fields of ``search.sweep.SweepRequest``, such as ``samples``, ``pressures_kpa``,
    ``workers`` and ``dask``, beside tables of the design.
    """
    from sbafab.search.sweep import SweepRequest
    from sbafab.search.sweep import sweep as run_sweep
    from sbafab.search.vary import read_varied

    settings, tables = _parted(asked, SweepRequest)
    design = load(source, *changes, **tables)
    varied = tuple(read_varied(text) for text in vary)
    return run_sweep(SweepRequest(design, varied, **settings), Path(out))


def kerf(measurements: str | Path, resolution: float = 0.01) -> Calibration:
    """The kerf from a filled ``coupon.csv``; ``resolution`` mm is the least step measured."""
    from sbafab.cutting.calibration import calibrated
    from sbafab.cutting.measured_table import read_measurements

    return calibrated(read_measurements(Path(measurements)), resolution)


def record(
    source: Source,
    *changes: Change,
    lab: str | Path = "lab.sqlite",
    table: str | Path | None = None,
    **said: Any,
) -> list[Record]:
    """Records what came out of a design or an assembly in the lab's file; the records added.

    ``said`` holds ``serial``, ``leak`` ("pass" or "fail"), ``operator``, ``kit``, ``note``, and
    what was measured: ``burst_kpa``, ``stroke_mm``, ``force_n``, ``height_mm``, ``mass_g``, one
    or several of ``offset_mm``, ``turn_deg``, ``cut_mm``; beside tables of the design. A
    ``table`` (CSV) says it of a batch instead. Raises DesignError, OutputError.
    """
    from sbafab.results import recording
    from sbafab.results.store import Lab

    told = {name: value for name, value in said.items() if name in recording.SAID}
    tables = {name: value for name, value in said.items() if name not in recording.SAID}
    results = recording.results_of(told, table)
    built = recording.built_from(source, [*changes, tables] if tables else changes)
    return recording.record(Lab(Path(lab)), built, results)


def report(lab: str | Path = "lab.sqlite") -> Report:
    """What all records of a lab's file say together: success, figures, tolerances."""
    from sbafab.results.report import report as report_of
    from sbafab.results.store import Lab

    return report_of(*Lab(Path(lab)).contents())


def solid(source: Source | Laminate, *changes: Change, **tables: Any) -> Surface:
    """The closed surface of the flat actuator, for example for ``solid(...).trimesh()``."""
    from sbafab.laminate.laminate import Laminate
    from sbafab.meshing.solid import solid as surface_of

    flat = source if isinstance(source, Laminate) else build(source, *changes, **tables)
    return surface_of(flat)


def drawing(layer: Layer) -> Drawing:
    """A layer as an ezdxf document: nominal edges as in its cut file, no kerf taken off."""
    from io import StringIO

    from ezdxf.filemanagement import read

    from sbafab.cutting.dxf_write import dxf_text
    from sbafab.cutting.order import cutting_order

    text = dxf_text(cutting_order(layer.profile), {"PATTERN": layer.pattern, "UNITS": "mm"})
    return read(StringIO(text))


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """What a drawing of a layer gives the size of: circles, radii and widths, with their words."""
    from sbafab.reports.features import dimensions as measured

    return measured(laminate, layer)


def schema() -> dict[str, Any]:
    """JSON schema of a design or assembly file."""
    from sbafab.assemblies.records import Assembly

    return actuators.schema(Assembly)
