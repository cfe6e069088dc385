"""``sbafab check FOLDER``: an output folder compared with one regenerated from its design.

Hashes and the manifest are compared, the layers are read and the rules run on them as cut, and
every other file is compared with its counterpart in a folder regenerated from ``design.toml``;
placements of parts on film sheets come from ``nest.json``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from filecmp import cmp
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

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
    PICTURES,
    TRAVELLER,
    RunPart,
    tops_of,
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
from sbafab.folders.swap import JOB_SCHEMA, MANIFEST, SCHEMA, Schema, is_among_cut_files
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.netlist import read_netlist
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
    whether all files match the design; with ``nets``, a file, also whether the layers match that
    netlist.

    In a job's folder all designs are checked, and the film sheets they share. Raises OutputError
    for a folder without a sound manifest or without cut files, and for one inside a job's,
    DesignError for a netlist that cannot be read, or one of a job.
    """
    netlist = None if nets is None else read_netlist(nets)
    index = read_index(folder)
    if is_job(folder.absolute().parent):
        raise OutputError(
            f"{folder} is cut from the film sheets of a job; check the folder above it"
        )
    if isinstance(index, JobManifest) and nets is not None:
        raise DesignError(
            f"{folder} holds several designs, but a netlist belongs to one; check that design's "
            "folder"
        )
    places = {"": folder}
    if isinstance(index, JobManifest):
        places = {f"{each.name}: ": path_in_folder(folder, each.folder) for each in index.designs}
    built: list[AsBuiltFolder] = []
    unusable: list[str] = []
    for name, place in places.items():
        try:
            built.append(read_folder(place))
        except DesignError as error:
            unusable.append(f"{name}{error}")
    schema: Schema = JOB_SCHEMA if isinstance(index, JobManifest) else SCHEMA
    order = Order(schema, index.name, tuple(each.build for each in built))
    if isinstance(index, AssemblyManifest) and not unusable:
        try:
            order = of_assembly(assemble(load_assembly(folder / DESIGN_FILE)), order.builds)
        except (DesignError, OSError) as error:
            unusable.append(f"the parts were not put together, for {error or type(error).__name__}")
    if unusable:
        return _by_hashes(folder, index, unusable)
    remade, equal = _remade_problems(folder, index, order)
    problems = file_problems(folder, index, equal)
    if isinstance(index, JobManifest):
        passed = f"{len(index.sheets)} sheets read back", "designs"
        of_designs = _findings_of_designs(folder, index, built, equal)
        return (*of_designs, *(order.between or ()), *_of_files([*problems, *remade], *passed))
    [own] = built
    findings = _findings(own, [*problems, *own.problems, *remade])
    if netlist is None or nets is None:
        return findings
    if own.laminate is None:
        message = f"{nets.name} was not compared: not all layers could be read"
        return (*findings, problem(NETLIST, message))
    return (*findings, *netlist_findings(own.laminate, own.design, netlist, nets.name))


def _findings_of_designs(
    folder: Path, job: JobManifest, built: Sequence[AsBuiltFolder], equal: Collection[str]
) -> Iterator[Finding]:
    """Yield the findings on the designs of a job, each with its design's name."""
    for entry, each in zip(job.designs, built, strict=True):
        own = {name.removeprefix(f"{entry.folder}/") for name in equal}
        of_files = file_problems(folder / entry.folder, each.claims, own)
        for finding in _findings(each, [*of_files, *each.problems]):
            if finding.rule != DESIGNED or finding.verdict == "fail":
                yield replace(finding, design=each.design.name)


def _of_files(
    problems: Sequence[Finding], sound: str, designs: str, rules: Sequence[Finding] = ()
) -> tuple[Finding, ...]:
    """Return the findings on the files of a folder, with those of ``rules`` between them."""
    return (
        *findings_of(INTEGRITY, problems, sound),
        *findings_of(CLAIMS, problems, f"hashes and manifest match the files and the {designs}"),
        *rules,
        *findings_of(DESIGNED, problems, AS_DESIGNED),
    )


# The layers of a design's folder.


class AsBuiltFolder(NamedTuple):
    """The folder of a design read back.

    ``build`` is the design with its findings, ``expected`` its laminate. ``lost`` are unreadable
    layers; ``laminate`` has the layers as cut, None if one is lost. ``problems`` are those of the
    layers and seams.
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

    Raises OutputError for a folder without a valid manifest or without cut files, and DesignError
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
        raise DesignError(f"design.toml does not make a laminate: {error}") from None
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
    """Return the findings of a rule; a shape that the rule cannot measure fails."""
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

    A changed file that is ``equal`` to the design's is a warning, as is an unlisted one that could
    not be cut by mistake. Raises OutputError if the folder cannot be read.
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
    """Return True if a file's folder or suffix may identify it as a cut file.

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
    """Compare the files of a folder with an unusable design with the manifest's hashes."""
    problems = file_problems(folder, claims)
    said = (f"{reason}; only the hashes of the files were compared" for reason in reasons)
    unusable = [problem(DESIGNED, message) for message in said]
    passed = "every file has the hash that the manifest lists"
    return (*findings_of(CLAIMS, problems, passed), *findings_of(DESIGNED, unusable, ""))


# The folder made again, and compared.


def _remade_problems(
    folder: Path, index: Manifest | JobManifest, order: Order
) -> tuple[list[Finding], set[str]]:
    """Return the files of a folder that differ from regenerated ones, and equal files that were
    saved again.

    Differences of layers were reported before.
    """
    if index.generator != GENERATOR:
        message = (
            f"the folder was made by {index.generator}, and this is {GENERATOR}: only its layers "
            "were compared; regenerate the folder"
        )
        return [problem(DESIGNED, message)], set()
    with TemporaryDirectory() as name:
        fresh = Path(name)
        try:
            _remake(folder, index, order, fresh)
            foreign = _foreign_problems(index, file_names(fresh))
            problems, equal = _compared(folder, fresh, index)
            return [*foreign, *problems], equal
        except DESIGN_ERRORS as error:
            message = f"{folder.name} could not be made again to be compared: {error}"
            return [problem(DESIGNED, message)], set()


def _remake(folder: Path, index: Manifest | JobManifest, order: Order, fresh: Path) -> None:
    """Write the files of a run to ``fresh``, its manifest without hashes."""
    parts = {*EVERYTHING}
    if isinstance(index, Manifest):
        parts = _parts(index.files)
    elif order.assembled is not None and order.failed:
        parts = {*PICTURES}
    nests = order.nests(folder, ignore_progress) if "cut" in parts else ()
    remade, *_ = write_folder(order, parts, nests, fresh, ignore_progress)
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
    # Pictures come with a run that makes everything: then there is a page as well.
    return parts | {"press", "preview"} if TRAVELLER in files else parts


def _foreign_problems(index: Manifest | JobManifest, remade: Collection[str]) -> Iterator[Finding]:
    """Yield the files that a manifest lists and its design does not make.

    Files of other commands, which are not made again, may be there if they cannot be cut.
    """
    is_design = isinstance(index, Manifest)
    excluded = tops_of("mesh", "predict", *SIMULATORS) if is_design else ()
    for path in index.files:
        is_excluded = path.partition("/")[0] in excluded and not _could_be_cut(path)
        if path not in remade and not is_excluded:
            message = f"{path} is listed, but is not a file of this design; regenerate the folder"
            yield problem(DESIGNED, message)


def _compared(
    folder: Path, fresh: Path, index: Manifest | JobManifest
) -> tuple[list[Finding], set[str]]:
    """Return the files that differ from those made again, and those that were saved anew."""
    problems: list[Finding] = []
    equal: set[str] = set()
    bare: list[str] = []
    for name in file_names(fresh):
        path, actual = fresh / name, folder / name
        is_layer = path.parent.name == LAYERS and path.suffix == ".dxf"
        rule = DESIGNED
        if name != MANIFEST and (name not in index.files or not os.path.lexists(actual)):
            difference = f"{name} is missing"
        elif not actual.is_file():
            rule, difference = INTEGRITY, f"{name}: not a regular file"
        elif cmp(actual, path, shallow=False):
            continue
        elif path.name == MANIFEST:
            rule, difference = CLAIMS, _index_difference(folder, fresh, name)
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


def _index_difference(folder: Path, fresh: Path, name: str) -> str:
    """Return the first difference of a manifest from the regenerated one; "" if there is none."""
    actual, expected = (
        json.loads((root / name).read_text(encoding="utf-8")) for root in (folder, fresh)
    )
    if not isinstance(actual, dict):
        return "it is not an index"
    # Meshes may be of several commands.
    is_design = name == MANIFEST and expected["schema"] == SCHEMA
    left_out = {"files"} | ({"mesh_statistics", "meshes"} if is_design else set())
    here, there = (
        {key: value for key, value in index.items() if key not in left_out}
        for index in (actual, expected)
    )
    difference = value_difference(here, there)
    if difference or not is_design:
        return difference
    return _mesh_difference(folder, actual, expected)


def _mesh_difference(folder: Path, actual: dict[str, Any], expected: dict[str, Any]) -> str:
    """Return a difference of the listed surfaces; numbers of triangles may depend on libraries, and
    conforming meshes are of another command.
    """
    meshes = [entry for entry in actual.get("meshes", []) if isinstance(entry, dict)]
    listed: dict[str, dict[str, Any]] = {str(entry.get("file")): entry for entry in meshes}
    for mesh in expected["meshes"]:
        entry, count = listed.get(mesh["file"], {}), mesh["elements"]
        if entry.get("elements") != count:
            count = sum(len(surface.faces) for surface, _ in bodies(folder / mesh["file"]))
        difference = value_difference(entry, {**mesh, "elements": count})
        if difference:
            return f"{mesh['file']}: {difference}"
    stray = next((file for file in listed if file not in actual["files"]), "")
    return f"meshes lists {stray}, which is not in files" if stray else ""
