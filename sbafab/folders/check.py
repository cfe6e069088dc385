"""``sbafab check FOLDER``: an output folder read, and made again from its design to be compared.

Hashes and the manifest are compared, the layers are read and the rules run on them as cut, and
every other file is compared with its like in a folder made again from ``design.toml``; parts take
their places on film sheets from ``nest.json``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import TypeAdapter

from sbafab.actuators import load_design
from sbafab.assemblies.build import assemble
from sbafab.assemblies.checks import run_checks
from sbafab.assemblies.files import DESIGN_FILE, load_assembly
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.properties import FOLDER as LAYERS
from sbafab.cutting.properties import curves_of
from sbafab.cutting.sheets import SheetFile
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.folders.artefacts import (
    ARTEFACTS,
    EVERYTHING,
    PAGES,
    PICTURES,
    TRAVELLER,
    DesignFolder,
    RunPart,
    write_artefacts,
    write_nested_sheets,
    write_plates,
)
from sbafab.folders.as_cut import (
    ExpectedLaminate,
    LayerFile,
    chords_for_arc,
    expected_laminate,
    laminate_as_cut,
    layer_departures,
    path_in_folder,
    read_layers,
    read_seams,
)
from sbafab.folders.build import Build, make_build
from sbafab.folders.carry_over import MESH, PREDICTION, PRESS
from sbafab.folders.differences import (
    CLAIMS,
    DESIGNED,
    INTEGRITY,
    Problem,
    bodies,
    file_difference,
    findings_of,
    has_lost_properties,
    index_difference,
    unreadable,
)
from sbafab.folders.folder import write_design, write_folder
from sbafab.folders.manifest import (
    JobManifest,
    Manifest,
    as_json,
    file_hashes,
    file_names,
    is_assembly,
    is_job,
    read_claims,
    read_job,
)
from sbafab.folders.order import SCHEMA, Order, of_assembly
from sbafab.folders.swap import is_among_cut_files
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.netlist import read_netlist
from sbafab.models.figures import PredictionRequest
from sbafab.models.prediction import predict
from sbafab.process import ignore_progress
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.measures import Measures
from sbafab.rules.nets import NAME as NETS
from sbafab.rules.nets import NETLIST, netlist_findings
from sbafab.rules.rule import Rule
from sbafab.simulators.simulator import NAMES as SIMULATORS
from sbafab.version import GENERATOR

INDEX = "manifest.json"
AS_DESIGNED = "all files match design.toml"
CUT_ENDINGS = (
    *(".dxf", ".dwg", ".ai", ".cdr", ".eps", ".lbrn", ENDING),
    *(".rd", ".plt", ".hpgl", ".gcode", ".nc", ".ngc", ".tap"),
)
"""Suffixes of CAD and laser files; pictures and pages are not cut by mistake."""
DESIGN_ERRORS = (DesignError, OutputError, GeometryError, ArithmeticError, LookupError)
"""Errors of a doctored design."""
BY_OTHER_COMMANDS = (*MESH, *PREDICTION, *SIMULATORS)
"""Folders and files of other commands, which are not made again."""
NOT_COMPARED = ("files", "mesh_statistics", "meshes")
"""Keys of a manifest that hold hashes, or meshes of several commands."""
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
    if is_job(folder):
        if nets is not None:
            raise DesignError(
                f"{folder} holds several designs, and a netlist is one design's; check the folder "
                "of that one"
            )
        return _check_job(folder, read_job(folder))
    claims = read_claims(folder)
    try:
        built = read_folder(folder)
    except DesignError as error:
        return _by_hashes(folder, claims, [str(error)])
    findings = _findings(built, [*built.problems, *remade_problems(folder, built)])
    if netlist is None or nets is None:
        return findings
    if built.laminate is None:
        message = f"{nets.name} was not compared: not all layers could be read"
        return (*findings, Finding(NETLIST, "fail", None, None, "", Place(), message))
    return (*findings, *netlist_findings(built.laminate, built.design, netlist, nets.name))


# The layers of a design's folder.


@dataclass(frozen=True)
class AsBuiltFolder:
    """The folder of a design read back.

    ``build`` is the design with the findings on it, ``expected`` its laminate and paths.
    ``laminate`` has the layers as cut; None if one could not be read.
    """

    claims: Manifest
    build: Build
    expected: ExpectedLaminate
    files: tuple[LayerFile, ...]
    laminate: Laminate | None
    problems: tuple[Problem, ...]

    @property
    def design(self) -> Design:
        return self.build.design


def read_folder(folder: Path) -> AsBuiltFolder:
    """Read the layers of a design's folder, with the problems of its files.

    Raises OutputError for a folder without a sound manifest or without cut files, and DesignError
    if ``design.toml`` is missing or does not make a laminate.
    """
    claims = read_claims(folder)
    if all(layer.file is None for layer in claims.layers):
        raise OutputError(f"{folder} holds no cut files; write them with sbafab cut or generate")
    design = _design(folder)
    try:
        build = make_build(design, curves=curves_of(claims.curves))
        expected = expected_laminate(build)
    except DESIGN_ERRORS as error:
        raise DesignError(f"design.toml makes no laminate: {error}") from None
    problems = file_problems(folder, claims)
    files, errors = read_layers(folder, expected, build.settings, _has_chords(design))
    seams, seam_errors = read_seams(folder, expected.laminate.seams, build.settings)
    problems += [*errors, *seam_errors, *layer_departures(files, expected)]
    laminate: Laminate | None = None
    if all(file.part is not None for file in files):
        try:
            laminate = laminate_as_cut(files, expected.laminate)
            laminate = laminate if seams == laminate.seams else replace(laminate, seams=seams)
        except UNMEASURED as error:
            message = f"the layers do not lie over each other as films of one stack ({error})"
            problems.append(Problem(INTEGRITY, message))
    return AsBuiltFolder(claims, build, expected, tuple(files), laminate, tuple(problems))


def _design(folder: Path) -> Design:
    """Return the folder's design. Raises DesignError for one that cannot be used."""
    path = folder / "design.toml"
    if not path.exists():
        raise DesignError("design.toml is missing")
    try:
        return load_design(path)
    except (DesignError, OSError) as error:
        raise DesignError(f"design.toml cannot be used: {error or type(error).__name__}") from None


def _has_chords(design: Design) -> bool:
    """Return True if an outline of the user's has chords in place of arcs."""
    try:
        return any(chords_for_arc(outline) is not None for outline in design.outlines())
    except (DesignError, OSError):
        return False


def _findings(built: AsBuiltFolder, problems: Sequence[Problem]) -> tuple[Finding, ...]:
    """Return the findings on a design's folder, in the order of the report."""
    count = len(built.files)
    return (
        *findings_of(
            INTEGRITY, problems, f"{count} cut files read back: closed contours in millimetres"
        ),
        *findings_of(CLAIMS, problems, "hashes and manifest match the files and the design"),
        *rules_as_cut(built),
        *findings_of(DESIGNED, problems, AS_DESIGNED),
    )


def rules_as_cut(built: AsBuiltFolder) -> tuple[Finding, ...]:
    """Return the findings of the rules on the layers as cut."""
    if built.laminate is None:
        lost = tuple(file.layer.index for file in built.files if file.part is None)
        message = "not run: it needs every layer, and not all could be read"
        return tuple(
            Finding(rule.name, "warn", None, None, "", Place(None, lost), message)
            for rule in RULES
            if rule.name != NETS or built.design.has_nets
        )
    if built.laminate is built.expected.laminate and not built.build.curves.in_chords:
        return built.build.findings
    measures = Measures(built.laminate, built.design)
    return tuple(finding for rule in RULES for finding in _findings_as_cut(rule, measures))


def _findings_as_cut(rule: Rule, measures: Measures) -> list[Finding]:
    """Return the findings of a rule; a shape that the rule cannot measure fails it."""
    try:
        return run_rule(rule, measures)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); regenerate them"
        return [Finding(rule.name, "fail", None, None, "", Place(), message)]


# The folder of several designs, of a job or an assembly.


def _check_job(folder: Path, job: JobManifest) -> tuple[Finding, ...]:
    """Return the findings on the designs of a job, its sheets, and between an assembly's parts."""
    built: list[AsBuiltFolder] = []
    unusable: list[str] = []
    for entry in job.designs:
        try:
            built.append(read_folder(path_in_folder(folder, entry.folder)))
        except DesignError as error:
            unusable.append(f"{entry.name}: {error}")
    between: tuple[Finding, ...] = ()
    whole = Order(job.schema_name, job.name, tuple(each.build for each in built))
    if is_assembly(job) and not unusable:
        try:
            assembled = assemble(load_assembly(folder / DESIGN_FILE))
            between = run_checks(assembled)
            whole = of_assembly(assembled, whole.builds)
        except (DesignError, OSError) as error:
            unusable.append(f"the parts were not put together, for {error or type(error).__name__}")
    if unusable:
        return _by_hashes(folder, job, unusable)
    problems = [*file_problems(folder, job), *_remade_job_problems(folder, job, whole)]
    findings = [
        replace(finding, design=each.design.name)
        for each in built
        for finding in _findings(each, each.problems)
        if finding.rule != DESIGNED or finding.verdict == "fail"
    ]
    count = len(job.sheets)
    return (
        *findings,
        *between,
        *findings_of(INTEGRITY, problems, f"{count} sheets read back"),
        *findings_of(CLAIMS, problems, "hashes and manifest match the files and the designs"),
        *findings_of(DESIGNED, problems, AS_DESIGNED),
    )


# Files against the hashes of the manifest.


def file_problems(folder: Path, claims: Manifest | JobManifest) -> list[Problem]:
    """Return files that are missing, changed or not in the manifest.

    An unlisted file that could be cut by mistake fails; any other is a warning. Raises OutputError
    if the folder cannot be read.
    """
    try:
        hashes = file_hashes(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be read: {error.strerror or error}") from None
    hashes.pop(INDEX, None)
    layers = claims.layers if isinstance(claims, Manifest) else ()
    layer_of = {layer.file: (number,) for number, layer in enumerate(layers, start=1)}
    problems = []
    for path, digest in claims.files.items():
        message = ""
        if path not in hashes:
            message = f"{path} is in the manifest and not in the folder"
        elif hashes[path] != digest:
            message = (
                f"{path} was changed: its sha256 is {hashes[path][:12]}..., the manifest's "
                f"{digest[:12]}..."
            )
        if message:
            problems.append(Problem(CLAIMS, message, layer_of.get(path, ())))
    for path in (*hashes, *_links(folder)):
        if path not in claims.files:
            message = f"{path} lies in the folder and is not in the manifest; remove it"
            verdict: Verdict = "fail" if _could_be_cut(path) else "warn"
            problems.append(Problem(CLAIMS, message, verdict=verdict))
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
    unusable = [
        Problem(DESIGNED, f"{reason}; only the hashes of the files were compared")
        for reason in reasons
    ]
    passed = "every file has the hash that the manifest lists"
    return (*findings_of(CLAIMS, problems, passed), *findings_of(DESIGNED, unusable, ""))


# The folder made again, and compared.


def remade_problems(folder: Path, built: AsBuiltFolder) -> list[Problem]:
    """Return the files of a design, but a job's sheets, that differ from those made again."""
    claims, of_job = built.claims, is_job(folder.absolute().parent)
    if of_job and not claims.sheets:
        message = "the film sheets are those of the job, and were not compared; check the folder "
        sheets = [Problem(CLAIMS, f"{message}above this one", verdict="warn")]
    else:
        sheets = []
    with _temporary_folder(folder) as (fresh, problems):
        index = _remake(folder, fresh, built, of_job)
        remade = {*file_names(fresh), *(layer["file"] for layer in index["layers"])}
        # The pages of a job's design show the sheets of the job, and are compared there.
        excluded = (*BY_OTHER_COMMANDS, *PAGES) if of_job else BY_OTHER_COMMANDS
        problems.extend(_foreign_problems(claims, remade, excluded))
        problems.extend(_compared(folder, fresh, claims.files, claims.generator))
        if claims.generator == GENERATOR:
            left_out = (*NOT_COMPARED, "sheets", "films") if of_job else NOT_COMPARED
            problems.extend(_index_problems(folder, index, left_out))
            problems.extend(_prediction_problems(folder, fresh, built))
    return [*sheets, *problems, *_version_problems(claims.generator)]


def _remade_job_problems(folder: Path, job: JobManifest, whole: Order) -> list[Problem]:
    """Return the files of a job and of its designs' folders that differ from those made again."""
    with _temporary_folder(folder) as (fresh, problems):
        parts = PICTURES if is_assembly(job) and whole.failed else EVERYTHING
        nests = whole.nests(folder, ignore_progress) if "cut" in parts else ()
        index = write_folder(whole, parts, nests, fresh, ignore_progress).index
        problems.extend(_foreign_problems(job, file_names(fresh)))
        problems.extend(_compared(folder, fresh, job.files, job.generator))
        if job.generator == GENERATOR:
            problems.extend(_index_problems(folder, index, ("files",)))
    return [*problems, *_version_problems(job.generator)]


@contextmanager
def _temporary_folder(folder: Path) -> Iterator[tuple[Path, list[Problem]]]:
    """Yield an empty folder and a list of problems; an error of the design is added to it."""
    problems: list[Problem] = []
    with TemporaryDirectory() as name:
        try:
            yield Path(name), problems
        except DESIGN_ERRORS as error:
            message = f"{folder.name} could not be made again to be compared: {error}"
            problems.append(Problem(DESIGNED, message))


def _remake(folder: Path, fresh: Path, built: AsBuiltFolder, of_job: bool) -> dict[str, Any]:
    """Write the files of a run beside the layers to ``fresh``; return its manifest without hashes.

    A design ``of_job`` has no film sheets and no pages in its own folder.
    """
    claims, build = built.claims, built.build
    parts = _parts(claims.files)
    # Pictures come with a run that makes everything: then there is a page as well.
    if not of_job and (TRAVELLER in claims.files or {"press", "preview"} <= parts):
        parts |= {"press", "preview"}
    sheets: list[SheetFile] = []
    if not of_job:
        order = Order(SCHEMA, build.design.name, (build,))
        nests = order.nests(folder, ignore_progress)
        sheets = write_nested_sheets(nests, build.design, fresh, build.settings, ignore_progress)
    write_plates(build, fresh)
    remade = DesignFolder(build, frozenset(parts), sheets, fresh, ignore_progress, not of_job)
    # The layers' files were read, and are compared as regions.
    return write_design(remade, [row for row in ARTEFACTS if row.path != LAYERS])


def _parts(files: Collection[str]) -> set[RunPart]:
    """Return the parts of a run that wrote these files."""
    parts: set[RunPart] = {"cut"}
    if any(path in files for path in PRESS):
        parts.add("press")
    if any(path.startswith("preview/") for path in files):
        parts.add("preview")
    if any(path.startswith(("mesh/solid.", "mesh/cavity_")) for path in files):
        parts.add("mesh")
    return parts


def _foreign_problems(
    claims: Manifest | JobManifest, remade: Collection[str], excluded: Collection[str] = ()
) -> list[Problem]:
    """Return the files that a manifest lists and its design does not make.

    ``excluded``: folders and files of other commands, except files that could be cut.
    """
    return [
        Problem(DESIGNED, f"{path} is listed and is no file of this design; regenerate the folder")
        for path in claims.files
        if path not in remade
        and (_could_be_cut(path) or path.partition("/")[0] not in excluded)
        and _is_compared(path, claims.generator)
    ]


def _compared(folder: Path, fresh: Path, listed: Collection[str], generator: str) -> list[Problem]:
    """Return the files that differ from those made again; those in ``layers`` were read before."""
    problems: list[Problem] = []
    bare: list[str] = []
    for path in sorted(path for path in fresh.rglob("*") if path.is_file()):
        name = path.relative_to(fresh).as_posix()
        is_layer = path.parent.name == LAYERS and path.suffix == ".dxf"
        if name == INDEX or is_layer or not _is_compared(name, generator):
            continue
        rule, found = DESIGNED, folder / name
        if name not in listed or not os.path.lexists(found):
            difference = f"{name} is missing"
        elif not found.is_file():
            rule, difference = INTEGRITY, f"{name}: not a plain file"
        elif _are_equal(found, path):
            continue
        elif name.endswith(f"/{INDEX}"):
            rule = CLAIMS
            difference = index_difference(_read_index(found), _read_index(path), ("files",))
            difference = f"{name}: {difference}" if difference else ""
        elif unsound := unreadable(found):
            rule, difference = INTEGRITY, f"{name}: {unsound}"
        else:
            difference = file_difference(found, path, name)
            bare += [name] if has_lost_properties(found) else []
        if difference:
            problems.append(Problem(rule, f"{difference}; regenerate the folder"))
    if bare:
        message = (
            f"{', '.join(bare)}: no custom properties; save as DXF R2004 or later to keep them"
        )
        problems.append(Problem(CLAIMS, message, verdict="warn"))
    return problems


def _are_equal(found: Path, expected: Path) -> bool:
    """Return True if two files have the same bytes; one of another size is not read."""
    sizes = found.stat().st_size, expected.stat().st_size
    return sizes[0] == sizes[1] and found.read_bytes() == expected.read_bytes()


def _is_compared(path: str, generator: str) -> bool:
    """Return True for a file of this version, and for one of any version that is cut or pressed."""
    return generator == GENERATOR or path.lower().endswith((*PRESS, *CUT_ENDINGS))


def _version_problems(generator: str) -> list[Problem]:
    if generator == GENERATOR:
        return []
    message = (
        f"the folder was made by {generator}, and this is {GENERATOR}: only what is cut and "
        "pressed was compared; regenerate the folder"
    )
    return [Problem(DESIGNED, message)]


def _read_index(path: Path) -> dict[str, Any]:
    index: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return index


def _index_problems(
    folder: Path, index: Mapping[str, Any], left_out: Collection[str]
) -> list[Problem]:
    """Return the first difference of the manifest from the one made again."""
    actual, expected = _read_index(folder / INDEX), json.loads(as_json(index))
    difference = index_difference(actual, expected, left_out)
    if not difference and "meshes" in left_out:
        difference = _mesh_difference(folder, actual, expected)
    return [Problem(CLAIMS, f"{INDEX}: {difference}; regenerate the folder")] if difference else []


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
            count = sum(len(body.surface.faces) for body in bodies(folder / mesh["file"]))
        difference = index_difference(listed_mesh, {**mesh, "elements": count}, ())
        if difference:
            return f"{mesh['file']}: {difference}"
    return ""


def _prediction_problems(folder: Path, fresh: Path, built: AsBuiltFolder) -> list[Problem]:
    """Return differences of the prediction from one for the same request."""
    claims = built.claims
    if "predict.json" not in claims.files:
        return []
    try:
        said = json.loads((folder / "predict.json").read_bytes())["asked"]
        factors = None if said["calibration"] else said
        asked = TypeAdapter(PredictionRequest).validate_python({**said, "calibration": factors})
        written = fresh / "prediction"
        written.mkdir()
        prediction = predict(built.design, asked)
        wanted: frozenset[RunPart] = frozenset(("predict",))
        again = DesignFolder(built.build, wanted, (), written, ignore_progress)
        again.prediction = prediction
        write_artefacts(again, [row for row in ARTEFACTS if row.part == "predict"])
    except (ValueError, LookupError, TypeError, OSError):
        message = "predict.json does not say what was asked for; regenerate the folder"
        return [Problem(DESIGNED, message)]
    return _compared(folder, written, claims.files, claims.generator)
