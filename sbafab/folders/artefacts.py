"""The files of a design's folder: one table with a row for each file or folder.

Adding an output file takes one row of the table below and the function that renders it. Rows name
the functions of pictures and pages, which are loaded when a run first needs them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from sbafab import plugins
from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.files import DESIGN_FILE, assembly_sha256, assembly_toml, part_entry
from sbafab.assemblies.records import Cup
from sbafab.assemblies.shapes import colours, cup_mould, linear, placed_surface
from sbafab.cutting.cut_settings import CutSettings
from sbafab.cutting.fixture import write_fixture
from sbafab.cutting.layer_files import write_layer_files, write_seam_files
from sbafab.cutting.nesting import PLACES, as_dict
from sbafab.cutting.placements import Nest
from sbafab.cutting.sheets import SheetFile, write_sheets
from sbafab.design.files import kit_names
from sbafab.design.identity import design_sha256, kit_of
from sbafab.design.kits import FILE as KIT_FILE
from sbafab.design.laminate_file import FILE as LAMINATE_FILE
from sbafab.design.laminate_file import SCHEMA as LAMINATE_SCHEMA
from sbafab.design.laminate_file import laminate_json
from sbafab.design.records import Design, design_toml
from sbafab.errors import DefectError, DesignError, OutputError
from sbafab.folders.build import Build, hole_notes
from sbafab.folders.checks_json import Checks, checks
from sbafab.folders.manifest import as_json, file_hashes, job_manifest, manifest
from sbafab.folders.order import Order
from sbafab.folders.swap import SCHEMA
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.formats import MeshFile, Node, write_meshes, write_scene, write_stl
from sbafab.models.calibration import FILE as CALIBRATION_FILE
from sbafab.models.calibration import NONE, PAPER, load_calibration
from sbafab.models.figures import Prediction, PredictionDocument
from sbafab.pressing.cycles import batch_entry
from sbafab.pressing.schedule_files import PressDocument, press_csv, press_json
from sbafab.rules.finding import Finding
from sbafab.runtime import Progress
from sbafab.simulators.simulator import NAMES as SIMULATORS
from sbafab.simulators.simulator import (
    Result,
    SimulationRequest,
    simulator,
    under_vacuum,
)
from sbafab.version import GENERATOR

if TYPE_CHECKING:
    from sbafab.meshing.conforming.meshes import ConformingMeshes

TRAVELLER = "traveller.html"
BENCH = "bench.html"
FINDINGS = "findings.html"
PREDICT = "predict"
"""Folder of a prediction's plots."""


RunPart = str
"""Parts of a design's folder: by rules and geometry, by models, or for a simulator."""
EVERYTHING: tuple[RunPart, ...] = ("cut", "press", "mesh", "preview")
PICTURES: tuple[RunPart, ...] = ("preview",)
"""Parts of a design that must not be cut, beside the findings."""


@dataclass
class DesignFolder:
    """The folder of a build while its ``wanted`` parts are written.

    ``sheets`` are the film sheets of its pieces; ``has_pages``: it includes findings and a
    traveller. ``conforming`` is written in the ``formats`` of these file suffixes; ``simulated`` is
    the folder of a finished simulation. Writers add written ``meshes``, add to ``verified`` the
    sha256 of each cut file read back, and to ``left_out`` the meshes and simulator inputs that
    could not be written, with the reason.
    """

    build: Build
    wanted: frozenset[RunPart]
    sheets: Sequence[SheetFile]
    path: Path
    progress: Progress
    has_pages: bool = True
    conforming: ConformingMeshes | None = None
    formats: tuple[str, ...] = ()
    prediction: Prediction | None = None
    simulated: Path | None = None
    meshes: list[MeshFile] = field(default_factory=list)
    verified: dict[str, str] = field(default_factory=dict)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    @property
    def design(self) -> Design:
        return self.build.design

    @property
    def laminate(self) -> Laminate:
        return self.build.laminate

    @cached_property
    def marked(self) -> Laminate:
        """The laminate with notes for its pictures: failed and waived rules, lowered limits."""
        laminate, lowered = self.build.laminate, self.build.lowered
        notes = _remarks(self.build.findings)
        notes += [f"limits lowered: {', '.join(lowered)}"] if lowered else []
        return replace(laminate, notes=(*laminate.notes, *notes)) if notes else laminate

    @cached_property
    def work(self) -> Any:
        """The ``Work`` for the bench pages."""
        return work_of(self.build, self.sheets)

    @cached_property
    def solid_png(self) -> bytes:
        """The picture of the solid, which also appears in the traveller."""
        picture: bytes = plugins.load("sbafab.reports.solid_pictures:solid_png")(self.marked)
        return picture


def _remarks(findings: Sequence[Finding]) -> list[str]:
    """Return what a picture says of the rules that failed, and of those that were waived."""
    failed = dict.fromkeys(f.rule for f in findings if f.verdict == "fail")
    waived = dict.fromkeys(f.rule for f in findings if f.by_user)
    notes = [f"must not be built; failed: {', '.join(failed)}"] if failed else []
    return notes + ([f"waived: {', '.join(waived)}"] if waived else [])


@dataclass(frozen=True)
class Artefact:
    """A file or folder of a design's folder.

    ``part`` is the part of a run that writes it, "" for every run; it is omitted unless the parts
    ``needs`` are present. ``render`` returns the file's contents, or writes a folder itself and
    returns None; without it the file is written for all designs of a job together. ``schema``: the
    id of its format, if programs may rely on it. ``is_page``: an assembly has one for all its
    designs.
    """

    path: str
    part: RunPart
    about: str
    render: Callable[[DesignFolder], str | bytes | None] | None = None
    schema: str = ""
    needs: frozenset[RunPart] = frozenset()
    is_page: bool = False

    @property
    def top(self) -> str:
        """The top-level file or folder in the design's folder."""
        return self.path.partition("/")[0]

    def belongs_in(self, folder: DesignFolder) -> bool:
        """Return True if the folder's plan includes it."""
        is_wanted = not self.part or (self.part in folder.wanted and self.needs <= folder.wanted)
        return is_wanted and (folder.has_pages or not self.is_page)


Parameters = Callable[[DesignFolder], tuple[Any, ...]]


def made_by(
    entry: str,
    parameters: Parameters,
    is_made: Callable[[DesignFolder], bool] = lambda folder: True,
) -> Callable[[DesignFolder], str | bytes | None]:
    """Return a row's ``render``: the function that an entry names, ``module:function``, called with
    the folder's values; None for a folder that does not need the file.
    """

    def render(folder: DesignFolder) -> str | bytes | None:
        if not is_made(folder):
            return None
        contents: str | bytes | None = plugins.load(entry)(*parameters(folder))
        return contents

    return render


def _print(name: str, about: str, *of: Any) -> Artefact:
    """Return the row of a print at 1:1; ``of`` as in ``made_by``."""
    return Artefact(
        f"{name}.pdf", "press", about, made_by(f"sbafab.reports.prints:{name}_pdf", *of)
    )


def _drawing(name: str, about: str) -> Artefact:
    """Return the row of a drawing of the laminate."""
    entry = f"sbafab.reports.{name}_svg:{name}_svg"
    return Artefact(
        f"preview/{name}.svg", "preview", about, made_by(entry, lambda of: (of.marked,))
    )


def _page(path: str, about: str, entry: str, parameters: Parameters) -> Artefact:
    """Return the row of a page for the bench, with a function of ``reports/traveller``."""
    render = made_by(f"sbafab.reports.traveller.{entry}", parameters)
    needs = frozenset(("press", "preview"))
    return Artefact(path, "cut", about, render, needs=needs, is_page=True)


def write_artefacts(folder: DesignFolder, rows: Iterable[Artefact] | None = None) -> None:
    """Write the artefacts (by default all) that belong in the folder."""
    every = artefacts() if rows is None else rows
    rows_wanted = [row for row in every if row.belongs_in(folder)]
    drawn = [row.path for row in rows_wanted if row.top == "preview"]
    for artefact in rows_wanted:
        contents = None if artefact.render is None else artefact.render(folder)
        if contents is not None:
            path = folder.path / artefact.path
            path.parent.mkdir(exist_ok=True)
            data = contents.encode() if isinstance(contents, str) else contents
            path.write_bytes(data)
        if artefact.path in drawn:
            folder.progress("pictures", drawn.index(artefact.path) + 1, len(drawn))


def tops_of(*parts: RunPart) -> tuple[str, ...]:
    """Return the files and folders that runs of these parts write, except pictures."""
    return tuple(dict.fromkeys(row.top for row in artefacts() if row.part in parts))


def write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


# Cutting: layer files, base plate, film sheets.


def _write_layers(folder: DesignFolder) -> None:
    """Write the layer files, the paths of seams and the base plate."""
    build, path, progress = folder.build, folder.path, partial(folder.progress, "cut files")
    design, laminate, settings = build.design, build.laminate, build.settings
    folder.verified |= write_layer_files(laminate, build.paths, path, settings, progress)
    write_seam_files(laminate, path, settings)
    places, notes = build.cycles.places, hole_notes(design, laminate)
    write_fixture(laminate, path, settings, design.press.platen, places, notes)


def write_nested_sheets(
    nests: Sequence[Nest], design: Design, folder: Path, settings: CutSettings, progress: Progress
) -> list[SheetFile]:
    """Write the film sheets, and their placements for a later run; nothing for no nest."""
    if not nests:
        return []
    count = partial(progress, "sheets")
    sheets = write_sheets(nests, folder, settings, design.laser, design.sheets, count)
    write_text(folder / PLACES, json.dumps(as_dict(nests), indent=1) + "\n")
    return sheets


# Pressing and meshes.


def _press_json(folder: DesignFolder) -> str:
    schedule, more = folder.build.schedule, {}
    if folder.build.cycles.copies > 1:
        more = {"batch": batch_entry(folder.design, folder.laminate, schedule)}
    return as_json(press_json(schedule, **more))


def _has_tray(folder: DesignFolder) -> bool:
    """Return True for a batch, unless its design specifies otherwise."""
    has_tray = folder.design.order.tray
    return folder.build.cycles.copies > 1 if has_tray is None else has_tray


def _write_meshes(folder: DesignFolder) -> None:
    progress = partial(folder.progress, "meshes")
    written, left_out = write_meshes(folder.laminate, folder.path, progress=progress)
    folder.meshes += written
    folder.left_out += left_out
    if folder.conforming is not None:
        progress = partial(folder.progress, "conforming meshes")
        write = plugins.load("sbafab.meshing.conforming.meshes:write_conforming")
        folder.meshes += write(folder.conforming, folder.path, progress, folder.formats)


# Predictions and simulations.


class PredictDocument(PredictionDocument, schema="sbafab/predict@1"):
    """The contents of ``predict.json``."""

    name: str
    family: str
    design_sha256: str
    generator: str


def prediction_json(design: Design, prediction: Prediction) -> dict[str, Any]:
    """Return the contents of ``predict.json``; ``plot`` of a relation is its file in the folder."""
    table = prediction.as_dict()
    for relation in table["relations"]:
        relation["plot"] = f"{PREDICT}/{relation['name']}.svg"
    return {
        "schema": PredictDocument.SCHEMA,
        "name": design.name,
        "family": design.family,
        "design_sha256": design_sha256(design),
        "generator": GENERATOR,
        **table,
    }


def _write_plots(folder: DesignFolder) -> None:
    assert folder.prediction is not None
    relations = folder.prediction.relations
    if relations:
        (folder.path / PREDICT).mkdir()
    for relation in relations:
        plot = plugins.load("sbafab.reports.charts:relation_svg")(folder.design.name, relation)
        write_text(folder.path / PREDICT / f"{relation.name}.svg", plot)


def _write_simulation(name: str, folder: DesignFolder) -> None:
    """Copy a simulator's folder if it has run, otherwise write its input."""
    simulated = folder.simulated
    if simulated is not None:
        shutil.copytree(simulated, folder.path / name)
        return
    reason = simulator(name).why_not(folder.laminate)
    if reason is None:
        try:
            request = SimulationRequest()
            if folder.design.form.works_under_vacuum:
                request = under_vacuum(name, request)
            simulator(name).export(folder.laminate, request, folder.path / name)
        except (DesignError, OutputError) as error:
            # The meshes of CalculiX take an extra, which may be missing.
            reason = str(error)
    if reason is not None:
        folder.left_out.append((f"input files for {name}", reason))


# Pages, findings and the design.


def work_of(build: Build, sheets: Sequence[SheetFile], folder: str = "") -> Any:
    """Return the ``Work`` for the bench pages; ``folder`` has the design's files."""
    work = plugins.load("sbafab.reports.traveller.work:Work")
    return work(build.design, build.laminate, build.findings, build.curves, sheets, folder)


def _design(folder: DesignFolder) -> str:
    """Return the design as a file; copy the user's drawings and kit beside it."""
    design = folder.design
    names: dict[Path, str] = {}
    for key, file in design.drawings.items():
        # Several shapes may be layers of one drawing.
        if file not in names:
            names[file] = f"{'-'.join(key.split('.')[1:])}{file.suffix.lower()}"
            shutil.copyfile(file, folder.path / names[file])
        design = design.drawn_from(key, names[file])
    if design.kit not in kit_names():
        (folder.path / KIT_FILE).write_bytes(kit_of(design).text)
        design = design.model_copy(update={"kit": KIT_FILE})
    calibration = design.models.calibration
    if calibration not in (NONE, PAPER):
        load_calibration(calibration, design.folder)  # Says what is wrong with it, if anything.
        shutil.copyfile(design.folder / calibration, folder.path / CALIBRATION_FILE)
        models = design.models.model_copy(update={"calibration": CALIBRATION_FILE})
        design = design.model_copy(update={"models": models})
    return design_toml(design)


_OWN: tuple[Artefact, ...] = (
    Artefact("layers", "cut", "a DXF a layer, and the base plate", _write_layers),
    Artefact("sheets", "cut", "film sheets with all parts, nested"),
    Artefact(
        "press.json",
        "press",
        "the press schedule; minutes and totals are `null` where nobody stated any for the film",
        _press_json,
        PressDocument.SCHEMA,
    ),
    Artefact(
        "press.csv",
        "press",
        "the press schedule as a table",
        lambda folder: press_csv(folder.build.schedule),
    ),
    _print(
        "tray",
        "of a batch: a place for every part, 1:1",
        lambda of: (of.laminate, of.build.cycles, of.build.sha256, of.design.order.batch),
        _has_tray,
    ),
    _print(
        "underlay",
        "guides for placing parts by hand, 1:1",
        lambda of: (of.laminate, of.build.sha256, of.build.cycles.places, of.design.press.platen),
    ),
    _print(
        "seams",
        "paths of seams on the films in hand, 1:1",
        lambda of: (of.laminate, of.build.sha256, of.design.seam_offsets),
    ),
    Artefact("mesh", "mesh", "solid, cavities, and meshes for simulation", _write_meshes),
    _drawing("layers", "every pattern"),
    _drawing("stack", "the layers in section"),
    Artefact("preview/solid.png", "preview", "the actuator, flat", lambda of: of.solid_png),
    Artefact(
        "predict.json",
        "predict",
        "from `sbafab predict`: every figure with model and trust",
        lambda of: as_json(prediction_json(of.design, cast(Prediction, of.prediction))),
        PredictDocument.SCHEMA,
    ),
    Artefact("predict", "predict", "its plots", _write_plots),
    *(
        Artefact(
            name,
            name,
            f"from `sbafab simulate --with {name}`: what it reads; `result.json` what it found",
            partial(_write_simulation, name),
            Result.SCHEMA,
        )
        for name in SIMULATORS
    ),
    _page(
        "bill.csv",
        "of a batch: the bill of materials",
        "work:bill_csv",
        lambda of: (of.work,),
    ),
    _page(
        TRAVELLER,
        "the pages that go with each actuator: steps, cut list, press steps with pictures, tests",
        "page:traveller_html",
        lambda of: (replace(of.work, solid_png=of.solid_png),),
    ),
    _page(
        BENCH,
        "what is made, measured and read once for a bench: base plate, press, laser",
        "bench:bench_html",
        lambda of: (of.design.name, of.build.sha256, [of.work]),
    ),
    Artefact(
        FINDINGS,
        "preview",
        "the page for the designer",
        made_by(
            "sbafab.reports.traveller.findings:findings_html",
            lambda of: (of.design.name, of.build.sha256, [of.build]),
        ),
        is_page=True,
    ),
    Artefact(
        "checks.json",
        "",
        "what the rules found",
        lambda of: as_json(checks(of.build.findings, "design", of.design.name, [of.design])),
        Checks.SCHEMA,
    ),
    Artefact(
        LAMINATE_FILE,
        "",
        "the layers with exact edges, for other programs",
        lambda folder: laminate_json(folder.marked),
        LAMINATE_SCHEMA,
    ),
    Artefact(
        "design.toml",
        "",
        "the design with every default written out; it makes the folder again",
        _design,
    ),
)
"""Our files of a design's folder, in the order of writing, without its index."""


@cache
def artefacts() -> tuple[Artefact, ...]:
    """Return all files of a design's folder except its index, those of other packages last."""
    own_paths = [row.path for row in _OWN]
    return _OWN + plugins.added(plugins.ARTEFACTS, "output file", Artefact, own_paths)


PAGES = tuple(row.path for row in _OWN if row.is_page)
"""Pages; an assembly has one of each for all its designs."""


# A planned folder written: film sheets, each design's artefacts, the whole of an assembly.


SOLID = "mesh/assembled.glb"
PICTURE = "preview/assembled.png"


def write_folder(
    order: Order,
    wanted: Collection[RunPart],
    nests: Sequence[Nest],
    path: Path,
    progress: Progress,
    **extras: Any,
) -> tuple[dict[str, Any], dict[str, str], tuple[tuple[str, str], ...]]:
    """Write film sheets and designs; several designs get a folder each, named after it.

    ``extras`` are fields of the ``DesignFolder`` of a single design. Return the manifest without
    its files' hashes; the sha256 of each cut file that was read back; and the meshes and simulator
    inputs that could not be written, with the reason.
    """
    parts, first = frozenset(wanted), order.builds[0]
    sheets = write_nested_sheets(nests, first.design, path, order.settings, progress)
    verified = {sheet.path: sheet.sha256 for sheet in sheets}
    if order.schema == SCHEMA:
        folder = DesignFolder(first, parts, sheets, path, progress, **extras)
        index = write_design(folder)
        return index, verified | folder.verified, tuple(folder.left_out)
    from_below = _from_below(sheets)
    left_out: list[tuple[str, str]] = []
    for build in order.builds:
        subfolder = path / build.design.name
        subfolder.mkdir()
        # An assembly has one page for all designs.
        has_pages = order.assembled is None
        folder = DesignFolder(build, parts, from_below, subfolder, progress, has_pages)
        # Sheets are stored in the parent folder only.
        close_folder(subfolder, {**write_design(folder), "sheets": []}, {})
        verified |= {f"{subfolder.name}/{name}": file for name, file in folder.verified.items()}
        left_out += [(f"{subfolder.name}/{name}", reason) for name, reason in folder.left_out]
    designs = [build.design for build in order.builds]
    more = None
    if order.assembled is not None:
        more = _write_assembly(order, order.assembled, sheets, path, progress)
    index = job_manifest(order.name, order.settings, designs, sheets, more)
    return index, verified, tuple(left_out)


def write_design(folder: DesignFolder) -> dict[str, Any]:
    """Write a design's artefacts; return its manifest, without the files' hashes."""
    write_artefacts(folder)
    conforming = folder.conforming
    statistics = None if conforming is None else conforming.statistics
    is_cut = "cut" in folder.wanted
    return manifest(folder.build, is_cut, folder.sheets, folder.meshes, statistics)


def close_folder(folder: Path, index: dict[str, Any], verified: Mapping[str, str]) -> None:
    """Write the manifest, with the hashes of all files in the folder.

    Raises DefectError if a ``verified`` file has changed since it was read back.
    """
    index.pop("files", None)
    index["files"] = file_hashes(folder)
    changed = [path for path, digest in verified.items() if index["files"].get(path) != digest]
    if changed:
        raise DefectError(
            f"{changed[0]} was changed after its verification; this is a defect of sbafab and "
            "nothing was written: please report this sentence with the design file"
        )
    write_text(folder / "manifest.json", as_json(index))


def _from_below(sheets: Sequence[SheetFile]) -> list[SheetFile]:
    """Return the shared sheets with paths relative to a design's own folder."""
    return [
        replace(
            sheet,
            path=f"../{sheet.path}",
            picture=f"../{sheet.picture}",
            project=f"../{sheet.project}",
            machine_file=sheet.machine_file and f"../{sheet.machine_file}",
        )
        for sheet in sheets
    ]


# The whole of an assembly: picture, solid, pages, design.


def _write_assembly(
    order: Order,
    assembled: Assembled,
    sheets: Sequence[SheetFile],
    path: Path,
    progress: Progress,
) -> dict[str, Any]:
    """Write an assembly's own files besides its designs; return the keys that its manifest adds to
    a job's.
    """
    progress("assembled", 0, 1)
    (path / "preview").mkdir()
    draw = plugins.load("sbafab.reports.solid_pictures:assembly_pngs")
    picture, bare = draw(assembled, "".join(f"; {each}" for each in _remarks(order.findings)))
    (path / PICTURE).write_bytes(picture)
    meshes = []
    if sheets:
        (path / "mesh").mkdir()
        meshes.append(_write_solid(assembled, path))
        _write_moulds(assembled, path)
        traveller, bench = _bench_pages(order, assembled, sheets, bare)
        write_text(path / TRAVELLER, traveller)
        write_text(path / BENCH, bench)
    sha256 = assembly_sha256(assembled)
    findings_html = plugins.load("sbafab.reports.traveller.findings:findings_html")
    page = findings_html(order.name, sha256, order.builds, order.between or ())
    write_text(path / FINDINGS, page)
    designs = [build.design for build in order.builds]
    document = checks(order.findings, "design", order.name, designs)
    write_text(path / "checks.json", as_json(document))
    write_text(path / DESIGN_FILE, assembly_toml(assembled))
    return {
        "family": assembled.assembly.family,
        "design_sha256": sha256,
        "copies": assembled.assembly.order.copies,
        "parts": [part_entry(placed) for placed in assembled.parts],
        "meshes": meshes,
    }


def _write_solid(assembled: Assembled, folder: Path) -> dict[str, Any]:
    """Write ``mesh/assembled.glb``, one node per part, and return its manifest entry."""
    paints = colours(assembled)
    nodes = [
        Node(placed.name, placed_surface(placed), _material(placed), linear(paints[placed.name]))
        for placed in assembled.parts
    ]
    write_scene(nodes, folder / SOLID)
    return {
        "file": SOLID,
        "kind": "assembly",
        "nodes": [
            {
                "name": node.name,
                "volume_mm3": round(node.surface.volume, 6),
                "elements": len(node.surface.faces),
            }
            for node in nodes
        ],
    }


def _write_moulds(assembled: Assembled, folder: Path) -> None:
    """Write both halves of the mould of every cast part, for printing."""
    for placed in assembled.parts:
        if isinstance(placed.part, Cup):
            for half, surface in zip(("lower", "upper"), cup_mould(placed.part), strict=True):
                write_stl(surface, folder / f"mesh/mould_{placed.name}_{half}.stl")


def _material(placed: PlacedPart) -> str:
    if placed.made is not None:
        return placed.made.laminate.bonded_materials
    return str(getattr(placed.part, "material", placed.part.kind))


def _bench_pages(
    order: Order, assembled: Assembled, sheets: Sequence[SheetFile], picture: bytes
) -> tuple[str, str]:
    """Return the traveller and the page of the bench."""
    bench_html = plugins.load("sbafab.reports.traveller.bench:bench_html")
    page = "sbafab.reports.traveller.assembly_page"
    works = [work_of(build, sheets, f"{build.design.name}/") for build in order.builds]
    sha256 = assembly_sha256(assembled)
    between, lowered = order.between or (), order.settings.lowered
    work = plugins.load(f"{page}:AssemblyWork")(
        assembled, sha256, works, sheets, between, order.waived, lowered, picture
    )
    traveller = plugins.load(f"{page}:assembly_html")(work)
    return traveller, bench_html(assembled.assembly.name, sha256, works, assembled)
