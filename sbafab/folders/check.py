"""``sbafab check FOLDER``: an output folder read, and made again from its design to be compared.

Hashes and the manifest are compared, the layers are read and the rules run on them as cut, and
every other file is compared with its like in a folder made again from ``design.toml``; parts take
their places on film sheets from ``nest.json``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Sequence
from dataclasses import replace
from filecmp import cmp
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from pydantic import TypeAdapter

from sbafab.actuators import load_design
from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import DESIGN_FILE, load_assembly
from sbafab.cutting.cut_settings import FOLDER as LAYERS
from sbafab.cutting.cut_settings import curves_of
from sbafab.cutting.laser_programs import ENDING
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.folders.artefacts import (
    EVERYTHING,
    PAGES,
    PICTURES,
    TRAVELLER,
    DesignFolder,
    RunPart,
    artefacts,
    tops_of,
    write_artefacts,
    write_folder,
    write_text,
)
from sbafab.folders.as_cut import (
    expected_laminate,
    laminate_as_cut,
    path_in_folder,
    read_layers,
    read_seams,
)
from sbafab.folders.build import Build, make_build
from sbafab.folders.differences import (
    CLAIMS,
    DESIGNED,
    INTEGRITY,
    bodies,
    file_difference,
    findings_of,
    has_lost_properties,
    is_saved_anew,
    problem,
    saved_anew,
    unreadable,
    value_difference,
)
from sbafab.folders.manifest import (
    AssemblyManifest,
    JobManifest,
    Manifest,
    as_json,
    file_hashes,
    file_names,
    is_job,
    read_design_index,
    read_index,
)
from sbafab.folders.order import Order, of_assembly
from sbafab.folders.swap import JOB_SCHEMA, MANIFEST, SCHEMA, is_among_cut_files
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.netlist import read_netlist
from sbafab.models.figures import PredictionRequest
from sbafab.models.prediction import predict
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding, Verdict
from sbafab.rules.measures import Measures
from sbafab.rules.nets import NAME as NETS
from sbafab.rules.nets import NETLIST, netlist_findings
from sbafab.rules.rule import Rule
from sbafab.runtime import ignore_progress
from sbafab.simulators.simulator import NAMES as SIMULATORS
from sbafab.version import GENERATOR

AS_DESIGNED = "all files match design.toml"
CUT_ENDINGS = (
    *(".dxf", ".dwg", ".ai", ".cdr", ".eps", ".lbrn", ENDING),
    *(".rd", ".plt", ".hpgl", ".gcode", ".nc", ".ngc", ".tap"),
)
"""Suffixes of CAD and laser files; pictures and pages are not cut by mistake."""
DESIGN_ERRORS = (DesignError, OutputError, GeometryError, ArithmeticError, LookupError)
"""Errors of a doctored design."""
UNMEASURED = (ArithmeticError, ValueError, LookupError, StopIteration)
"""Errors that rules raise on shapes no design makes; programming errors are not included."""


def check_folder(folder: Path, nets: Path | None = None) -> tuple[Finding, ...]:
    """Return the findings on an output folder: files, manifest, the rules on the layers as cut, and
    whether all files are what the design makes; with ``nets``, a file, also whether the layers join
    what that netlist lists.

    In a job's folder all designs are checked, and the film sheets they share. Raises OutputError
    for a folder without a sound manifest or without cut files, DesignError for a netlist that
    cannot be read, or one of a job.
    """
    netlist = None if nets is None else read_netlist(nets)
    index = read_index(folder)
    if isinstance(index, JobManifest):
        if nets is not None:
            raise DesignError(
                f"{folder} holds several designs, and a netlist is one design's; check the folder "
                "of that one"
            )
        return _check_job(folder, index)
    try:
        built = read_folder(folder)
    except DesignError as error:
        return _by_hashes(folder, index, [str(error)])
    order = Order(SCHEMA, built.design.name, (built.build,))
    remade, equal = _remade_problems(folder, index, order)
    findings = _findings(built, [*file_problems(folder, index, equal), *built.problems, *remade])
    if netlist is None or nets is None:
        return findings
    if built.laminate is None:
        message = f"{nets.name} was not compared: not all layers could be read"
        return (*findings, problem(NETLIST, message))
    return (*findings, *netlist_findings(built.laminate, built.design, netlist, nets.name))


def _check_job(folder: Path, job: JobManifest) -> tuple[Finding, ...]:
    """Return the findings on the designs of a job, its sheets, and between an assembly's parts."""
    built: list[AsBuiltFolder] = []
    unusable: list[str] = []
    for entry in job.designs:
        try:
            built.append(read_folder(path_in_folder(folder, entry.folder)))
        except DesignError as error:
            unusable.append(f"{entry.name}: {error}")
    order = Order(JOB_SCHEMA, job.name, tuple(each.build for each in built))
    if isinstance(job, AssemblyManifest) and not unusable:
        try:
            order = of_assembly(assemble(load_assembly(folder / DESIGN_FILE)), order.builds)
        except (DesignError, OSError) as error:
            unusable.append(f"the parts were not put together, for {error or type(error).__name__}")
    if unusable:
        return _by_hashes(folder, job, unusable)
    remade, equal = _remade_problems(folder, job, order)
    problems = [*file_problems(folder, job, equal), *remade]
    findings = []
    for entry, each in zip(job.designs, built, strict=True):
        own = {name.removeprefix(f"{entry.folder}/") for name in equal}
        of_files = file_problems(folder / entry.folder, each.claims, own)
        findings += [
            replace(finding, design=each.design.name)
            for finding in _findings(each, [*of_files, *each.problems])
            if finding.rule != DESIGNED or finding.verdict == "fail"
        ]
    passed = f"{len(job.sheets)} sheets read back", "designs"
    return (*findings, *(order.between or ()), *_of_files(problems, *passed))


def _of_files(
    problems: Sequence[Finding], sound: str, designs: str, rules: Sequence[Finding] = ()
) -> tuple[Finding, ...]:
    """Return the findings on the files of a folder, those of ``rules`` between them."""
    return (
        *findings_of(INTEGRITY, problems, sound),
        *findings_of(CLAIMS, problems, f"hashes and manifest match the files and the {designs}"),
        *rules,
        *findings_of(DESIGNED, problems, AS_DESIGNED),
    )


# The layers of a design's folder.


class AsBuiltFolder(NamedTuple):
    """The folder of a design read back.

    ``build`` is the design with the findings on it, ``expected`` its laminate. ``lost`` are layers
    that could not be read; ``laminate`` has the layers as cut, None if one is lost. ``problems``
    are those of the layers and seams.
    """

    claims: Manifest
    build: Build
    expected: Laminate
    lost: tuple[int, ...]
    laminate: Laminate | None
    problems: tuple[Finding, ...]

    @property
    def design(self) -> Design:
        return self.build.design


def read_folder(folder: Path) -> AsBuiltFolder:
    """Read the layers and seams of a design's folder.

    Raises OutputError for a folder without a sound manifest or without cut files, and DesignError
    if ``design.toml`` is missing or does not make a laminate.
    """
    claims = read_design_index(folder)
    if all(layer.file is None for layer in claims.layers):
        raise OutputError(f"{folder} holds no cut files; write them with sbafab cut or generate")
    path = folder / "design.toml"
    if not path.exists():
        raise DesignError("design.toml is missing")
    try:
        design = load_design(path)
    except (DesignError, OSError) as error:
        raise DesignError(f"design.toml cannot be used: {error or type(error).__name__}") from None
    try:
        build = make_build(design, curves=curves_of(claims.curves))
        expected = expected_laminate(build)
    except DESIGN_ERRORS as error:
        raise DesignError(f"design.toml makes no laminate: {error}") from None
    parts, errors = read_layers(folder, build, expected)
    seams, seam_errors = read_seams(folder, expected.seams, build.settings)
    problems = [*errors, *seam_errors]
    lost = tuple(layer.index for layer in expected.layers if layer.index not in parts)
    laminate: Laminate | None = None
    if not lost:
        try:
            laminate = laminate_as_cut(parts, expected)
            laminate = laminate if seams == laminate.seams else replace(laminate, seams=seams)
        except UNMEASURED as error:
            message = f"the layers do not lie over each other as films of one stack ({error})"
            problems.append(problem(INTEGRITY, message))
    return AsBuiltFolder(claims, build, expected, lost, laminate, tuple(problems))


def _findings(built: AsBuiltFolder, problems: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings on a design's folder, in the order of the report."""
    count = len(built.expected.layers)
    sound = f"{count} cut files read back: closed contours in millimetres"
    return _of_files(problems, sound, "design", rules_as_cut(built))


def rules_as_cut(built: AsBuiltFolder) -> tuple[Finding, ...]:
    """Return the findings of the rules on the layers as cut."""
    if built.laminate is None:
        message = "not run: it needs every layer, and not all could be read"
        return tuple(
            problem(rule.name, message, built.lost, "warn")
            for rule in RULES
            if rule.name != NETS or built.design.has_nets
        )
    if built.laminate is built.expected and not built.build.curves.in_chords:
        return built.build.findings
    measures = Measures(built.laminate, built.design)
    return tuple(finding for rule in RULES for finding in _findings_as_cut(rule, measures))


def _findings_as_cut(rule: Rule, measures: Measures) -> list[Finding]:
    """Return the findings of a rule; a shape that the rule cannot measure fails it."""
    try:
        return run_rule(rule, measures)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); regenerate them"
        return [problem(rule.name, message)]


# Files against the hashes of the manifest.


def file_problems(
    folder: Path, claims: Manifest | JobManifest, equal: Collection[str] = ()
) -> list[Finding]:
    """Return files that are missing, changed or not in the manifest.

    A changed file that is ``equal`` to that of the design is a warning, and so is an unlisted one
    that could not be cut by mistake. Raises OutputError if the folder cannot be read.
    """
    try:
        hashes = file_hashes(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be read: {error.strerror or error}") from None
    hashes.pop(MANIFEST, None)
    layers = claims.layers if isinstance(claims, Manifest) else ()
    layer_of = {layer.file: number for number, layer in enumerate(layers, start=1)}
    problems: list[Finding] = []
    resaved: dict[str, int | None] = {}
    for path, digest in claims.files.items():
        actual = hashes.get(path)
        if actual is not None and actual != digest and path in equal:
            resaved[path] = layer_of.get(path)
        elif actual != digest:
            message = (
                f"{path} is in the manifest and not in the folder"
                if actual is None
                else f"{path} was changed: its sha256 is {actual[:12]}..., the manifest's "
                f"{digest[:12]}..."
            )
            index = layer_of.get(path)
            problems.append(problem(CLAIMS, message, () if index is None else (index,)))
    problems += saved_anew(resaved)
    for path in (*hashes, *_links(folder)):
        if path not in claims.files:
            message = f"{path} lies in the folder and is not in the manifest; remove it"
            verdict: Verdict = "fail" if _could_be_cut(path) else "warn"
            problems.append(problem(CLAIMS, message, verdict=verdict))
    return problems


def _could_be_cut(path: str) -> bool:
    """Return True if a file, by its folder or suffix, may be taken for a cut file.

    Any file among the cut files may: laser programs also open pictures, pages and files without a
    suffix.
    """
    return is_among_cut_files(PurePosixPath(path)) or path.lower().endswith(CUT_ENDINGS)


def _links(folder: Path) -> list[str]:
    """Return links to folders, and everything else without a hash of its contents."""
    return [
        path.relative_to(folder).as_posix()
        for path in sorted(folder.rglob("*"))
        if not path.is_file() and (path.is_symlink() or not path.is_dir())
    ]


def _by_hashes(
    folder: Path, claims: Manifest | JobManifest, reasons: Sequence[str]
) -> tuple[Finding, ...]:
    """Compare the files of a folder, whose design cannot be used, with the manifest's hashes."""
    problems = file_problems(folder, claims)
    said = (f"{reason}; only the hashes of the files were compared" for reason in reasons)
    unusable = [problem(DESIGNED, message) for message in said]
    passed = "every file has the hash that the manifest lists"
    return (*findings_of(CLAIMS, problems, passed), *findings_of(DESIGNED, unusable, ""))


# The folder made again, and compared.


def _remade_problems(
    folder: Path, index: Manifest | JobManifest, order: Order
) -> tuple[list[Finding], set[str]]:
    """Return the files of a folder that differ from those made again, and those that were saved
    anew and are equal; differences of layers are told before.
    """
    is_of_job = isinstance(index, Manifest) and is_job(folder.absolute().parent)
    problems: list[Finding] = []
    equal: set[str] = set()
    if is_of_job:
        message = "the film sheets are those of the job, and were not compared; check the folder "
        problems.append(problem(CLAIMS, f"{message}above this one", verdict="warn"))
    with TemporaryDirectory() as name:
        fresh = Path(name)
        try:
            _remake(folder, index, order, is_of_job, fresh)
            problems += _foreign_problems(index, file_names(fresh), is_of_job)
            differing, equal = _compared(folder, fresh, index.files, index.generator, is_of_job)
            problems += differing
            if index.generator == GENERATOR:
                problems += _prediction_problems(folder, index, order.builds[0], fresh)
        except DESIGN_ERRORS as error:
            message = f"{folder.name} could not be made again to be compared: {error}"
            problems.append(problem(DESIGNED, message))
    if index.generator != GENERATOR:
        message = (
            f"the folder was made by {index.generator}, and this is {GENERATOR}: only what is cut "
            "and pressed was compared; regenerate the folder"
        )
        problems.append(problem(DESIGNED, message))
    return problems, equal


def _remake(
    folder: Path, index: Manifest | JobManifest, order: Order, is_of_job: bool, fresh: Path
) -> None:
    """Write the files of a run to ``fresh``, its manifest without hashes.

    A design of a job has no film sheets and no pages in its own folder.
    """
    if isinstance(index, JobManifest):
        parts = {*(PICTURES if order.assembled is not None and order.failed else EVERYTHING)}
    else:
        parts = _parts(index.files)
        # Pictures come with a run that makes everything: then there is a page as well.
        if not is_of_job and (TRAVELLER in index.files or {"press", "preview"} <= parts):
            parts |= {"press", "preview"}
    nests = order.nests(folder, ignore_progress) if "cut" in parts and not is_of_job else ()
    extras = {"has_pages": not is_of_job} if order.schema == SCHEMA else {}
    remade, *_ = write_folder(order, parts, nests, fresh, ignore_progress, **extras)
    write_text(fresh / MANIFEST, as_json(remade))


def _parts(files: Collection[str]) -> set[RunPart]:
    """Return the parts of a run that wrote these files."""
    parts: set[RunPart] = {"cut"}
    if any(path in files for path in tops_of("press")):
        parts.add("press")
    if any(path.startswith("preview/") for path in files):
        parts.add("preview")
    if any(path.startswith(("mesh/solid.", "mesh/cavity_")) for path in files):
        parts.add("mesh")
    return parts


def _foreign_problems(
    index: Manifest | JobManifest, remade: Collection[str], is_of_job: bool
) -> list[Finding]:
    """Return the files that a manifest lists and its design does not make.

    Files of other commands may be there, except those that could be cut.
    """
    # What other commands write is not made again.
    excluded = tops_of("mesh", "predict", *SIMULATORS)
    if isinstance(index, JobManifest):
        excluded = ()
    # The pages of a job's design show the sheets of the job, and are compared there.
    excluded = (*excluded, *PAGES) if is_of_job else excluded
    return [
        problem(
            DESIGNED, f"{path} is listed, but is not a file of this design; regenerate the folder"
        )
        for path in index.files
        if path not in remade
        and (_could_be_cut(path) or path.partition("/")[0] not in excluded)
        and _is_compared(path, index.generator)
    ]


def _compared(
    folder: Path, fresh: Path, listed: Collection[str], generator: str, is_of_job: bool = False
) -> tuple[list[Finding], set[str]]:
    """Return the files that differ from those made again, and those that were saved anew.

    Differences of the files in ``layers`` were told when they were read.
    """
    problems: list[Finding] = []
    equal: set[str] = set()
    bare: list[str] = []
    for name in file_names(fresh):
        path, actual = fresh / name, folder / name
        is_layer = path.parent.name == LAYERS and path.suffix == ".dxf"
        if not _is_compared(name, generator):
            continue
        rule = DESIGNED
        if name != MANIFEST and (name not in listed or not os.path.lexists(actual)):
            difference = f"{name} is missing"
        elif not actual.is_file():
            rule, difference = INTEGRITY, f"{name}: not a plain file"
        elif cmp(actual, path, shallow=False):
            continue
        elif path.name == MANIFEST:
            rule, difference = CLAIMS, _index_difference(folder, fresh, name, is_of_job)
            difference = difference and f"{name}: {difference}"
        elif unsound := unreadable(actual):
            rule, difference = INTEGRITY, f"{name}: {unsound}"
        else:
            difference = file_difference(actual, path, name)
            bare += [name] if not is_layer and has_lost_properties(actual) else []
            equal |= {name} if not difference and is_saved_anew(actual, path) else set()
        if difference and not is_layer:
            problems.append(problem(rule, f"{difference}; regenerate the folder"))
    if bare:
        message = (
            f"{', '.join(bare)}: no custom properties; save as DXF R2004 or later to keep them"
        )
        problems.append(problem(CLAIMS, message, verdict="warn"))
    return problems, equal


def _is_compared(path: str, generator: str) -> bool:
    """Return True for a file of this version, and for one of any version that is cut or pressed."""
    return generator == GENERATOR or path.lower().endswith((*tops_of("press"), *CUT_ENDINGS))


def _read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _index_difference(folder: Path, fresh: Path, name: str, is_of_job: bool) -> str:
    """Return the first difference of a manifest from the one made again; "" if none."""
    actual, expected = _read_json(folder / name), _read_json(fresh / name)
    if not isinstance(actual, dict):
        return "it is not an index"
    # Meshes may be of several commands, and sheets those of the job.
    is_design = name == MANIFEST and expected["schema"] == SCHEMA
    left_out = {"files"} | ({"mesh_statistics", "meshes"} if is_design else set())
    left_out |= {"sheets", "films"} if is_of_job else set()
    here, there = (
        {key: value for key, value in index.items() if key not in left_out}
        for index in (actual, expected)
    )
    difference = value_difference(here, there)
    if difference or not is_design:
        return difference
    return _mesh_difference(folder, actual, expected)


def _mesh_difference(folder: Path, actual: dict[str, Any], expected: dict[str, Any]) -> str:
    """Return a difference of the listed surfaces; numbers of triangles may depend on libraries."""
    meshes = [entry for entry in actual.get("meshes", []) if isinstance(entry, dict)]
    listed = [entry for entry in meshes if entry.get("kind") in ("solid", "cavity")]
    if len(listed) != len(expected["meshes"]):
        return f"it lists {len(listed)} surfaces, not {len(expected['meshes'])}"
    for mesh in expected["meshes"]:
        listed_mesh: dict[str, Any] = next((m for m in listed if m.get("file") == mesh["file"]), {})
        count = mesh["elements"]
        if listed_mesh.get("elements") != count:
            count = sum(len(surface.faces) for surface, _ in bodies(folder / mesh["file"]))
        difference = value_difference(listed_mesh, {**mesh, "elements": count})
        if difference:
            return f"{mesh['file']}: {difference}"
    return ""


def _prediction_problems(
    folder: Path, index: Manifest | JobManifest, build: Build, fresh: Path
) -> list[Finding]:
    """Return differences of the prediction from one for the same request."""
    if "predict.json" not in index.files:
        return []
    try:
        stated = _read_json(folder / "predict.json")["asked"]
        factors = None if stated["calibration"] else stated
        request = TypeAdapter(PredictionRequest).validate_python({**stated, "calibration": factors})
        written = fresh / "prediction"
        written.mkdir()
        parts: frozenset[RunPart] = frozenset(("predict",))
        again = DesignFolder(build, parts, (), written, ignore_progress)
        again.prediction = predict(build.design, request)
        write_artefacts(again, [row for row in artefacts() if row.part == "predict"])
    except (ValueError, LookupError, TypeError, OSError):
        message = "predict.json does not say what was asked for; regenerate the folder"
        return [problem(DESIGNED, message)]
    return _compared(folder, written, index.files, index.generator)[0]
