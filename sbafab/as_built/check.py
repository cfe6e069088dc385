"""Checks of an output folder as it is on disk: file integrity, claims, rules, design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sbafab.actuators import build, load_design
from sbafab.as_built.claims import (
    claim,
    design_problems,
    file_problems,
    height_problems,
    lowered_problems,
    order_problems,
    property_problems,
)
from sbafab.as_built.cut_files import (
    CutPart,
    LayerFile,
    path_in_folder,
    read_layers,
    read_seams,
    seam_departures,
    stacked_layers,
)
from sbafab.as_built.expected import ExpectedLaminate, WrittenDesign, departure, expected_laminate
from sbafab.as_built.kerf_removed import chords_for_arc
from sbafab.as_built.measures import (
    batch_problems,
    fixture_problems,
    interface_problems,
    layer_problems,
    pattern_problems,
    place_problems,
    size_problems,
    with_plate_pins,
)
from sbafab.as_built.records import (
    CLAIMS,
    DESIGNED,
    INTEGRITY,
    Problem,
    findings_of,
    is_assembly,
    is_job,
    read_assembly,
    read_claims,
    read_job,
)
from sbafab.as_built.sheets import DesignLot, SheetOrder, sheet_problems
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.files import DESIGN_FILE, assembly_sha256, load_assembly, part_entry
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.laminate.folding import halves
from sbafab.laminate.laminate import Laminate
from sbafab.models.formulas import sizes
from sbafab.output.checked import Checked
from sbafab.output.manifest import AssemblyManifest, JobManifest, Manifest
from sbafab.rules import film_limits, nets
from sbafab.rules.deck import RULES, run_deck, run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, lowered
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule

AS_DESIGNED = "all that lies here is what design.toml makes"


@dataclass(frozen=True)
class AsBuiltFolder:
    """A folder read back; ``expected`` is the laminate of its design.

    ``laminate`` is None if the file of a layer could not be read, or the design has other layers.
    """

    claims: Manifest
    design: Design
    files: tuple[LayerFile, ...]
    laminate: Laminate | None
    problems: tuple[Problem, ...]
    expected: ExpectedLaminate
    design_findings: tuple[Finding, ...] | None = None
    """The findings of the design check of a run that has just written the folder."""
    measured: tuple[Finding, ...] = ()
    """The findings of the rules on the layers as cut."""

    @property
    def is_expected(self) -> bool:
        """True if every layer file cuts the design's layer; ``laminate`` is then the design's."""
        laminate = self.laminate
        has_same_seams = laminate is None or laminate.seams == self.expected.laminate.seams
        return has_same_seams and all(
            file.part is not None and file.part.is_expected for file in self.files
        )


@dataclass(frozen=True)
class FolderReadBack:
    """An output folder read back and measured, without regenerating any of it.

    ``findings`` are on files, claims, rules, and on the layers of each design of a job;
    ``problems``: layers of a one-design folder that differ from its ``design.toml``.
    ``designs`` is empty if a ``design.toml`` cannot be used.
    """

    findings: tuple[Finding, ...]
    problems: tuple[Problem, ...]
    designs: tuple[AsBuiltFolder, ...]
    job: JobManifest | None = None

    def against_design(self, problems: Sequence[Problem]) -> tuple[Finding, ...]:
        """Return the findings, the last one with the ``problems`` against the design."""
        return (*self.findings, *findings_of(DESIGNED, [*problems], AS_DESIGNED))


def read_back(folder: Path, works: Mapping[str, WrittenDesign] | None = None) -> FolderReadBack:
    """Read an output folder, of one design or several, from the disk.

    ``works``: the designs of a run that has just written the folder, by name, with their expected
    laminates and findings; layers cut exactly as expected are not measured again. Without
    ``works``, both are made from each ``design.toml``. Raises OutputError for a folder without a
    sound manifest or without cut files.
    """
    if is_job(folder):
        return _read_job(folder, works)
    work = next(iter(works.values())) if works is not None else None
    try:
        built = read_folder(folder, work=work)
    except DesignError as error:
        return _by_hashes(folder, read_claims(folder), [f"{error}"])
    built = replace(built, measured=_run_deck(built))
    return FolderReadBack(_findings(built), tuple(layer_departures(built)), (built,))


def _by_hashes(
    folder: Path, claims: Manifest | JobManifest, reasons: Sequence[str]
) -> FolderReadBack:
    """Compare the files of a folder, whose design cannot be used, with the manifest's hashes."""
    problems = file_problems(folder, claims)
    findings = findings_of(CLAIMS, problems, "every file has the hash that the manifest lists")
    unusable = [
        Problem(DESIGNED, f"{reason}; only the hashes of the files were compared")
        for reason in reasons
    ]
    job = claims if isinstance(claims, JobManifest) else None
    return FolderReadBack(tuple(findings), tuple(unusable), (), job)


def _run_deck(built: AsBuiltFolder) -> tuple[Finding, ...]:
    """Return the findings of the rules on the layers as cut."""
    if built.laminate is None:
        return rules_by_layer(built.files, built.claims, built.design)
    if built.is_expected and built.design_findings is not None:
        return built.design_findings
    measures = Measures(built.laminate, built.design)
    return tuple(finding for rule in RULES for finding in findings_as_built(rule, measures))


def _findings(built: AsBuiltFolder) -> tuple[Finding, ...]:
    problems = [*built.problems, *_unlisted_waivers(built.measured, built.claims)]
    count = len(built.files)
    return (
        *findings_of(
            INTEGRITY, problems, f"{count} cut files read back: closed contours in millimetres"
        ),
        *findings_of(CLAIMS, problems, "the manifest's claims hold for what lies on disk"),
        *built.measured,
    )


def _read_job(folder: Path, works: Mapping[str, WrittenDesign] | None) -> FolderReadBack:
    """Read the designs of a job, its sheets, and the places between the parts of an assembly.

    ``works``: the designs of a run that has just written the folder.
    """
    job = read_job(folder)
    findings: list[Finding] = []
    lots: list[DesignLot] = []
    problems: list[Problem] = []
    lowered_limits: list[str] = []
    folders: list[AsBuiltFolder] = []
    unusable: list[str] = []
    for entry in job.designs:
        work = works.get(entry.name) if works is not None else None
        try:
            built = read_folder(path_in_folder(folder, entry.folder), of_job=True, work=work)
        except DesignError as error:
            unusable.append(f"{entry.name}: {error}")
            continue
        built = replace(built, measured=_run_deck(built))
        folders.append(built)
        lowered_limits += lowered(built.design)
        design_findings = [*_findings(built)]
        layers = layer_departures(built)
        design_findings += findings_of(DESIGNED, layers, AS_DESIGNED) if layers else []
        findings += [replace(f, message=f"{entry.name}: {f.message}") for f in design_findings]
        lots.append(
            DesignLot(
                entry.name, entry.copies, _cut_parts(built.files), built.design.order.spare_parts
            )
        )
        identity = (built.claims.name, built.claims.copies, built.claims.design_sha256)
        if identity != (entry.name, entry.copies, entry.design_sha256):
            message = f"{entry.folder}: name, copies or design_sha256 are not those of its manifest"
            problems.append(claim(message))
    if unusable:
        return _by_hashes(folder, job, unusable)
    first = folders[0]
    problems += file_problems(folder, job)
    order = SheetOrder(job, first.design, first.claims.kerf, lots)
    problems += sheet_problems(folder, order)
    if is_assembly(job):
        lowered_limits += lowered_between(folder)
        between, between_problems = assembly_findings(folder)
        findings += between
        problems += between_problems
    problems += lowered_problems(job.lowered_limits, lowered_limits)
    count = len(job.sheets)
    all_findings = (
        *findings,
        *findings_of(INTEGRITY, problems, f"{count} sheets read back: closed contours, no overlap"),
        *findings_of(CLAIMS, problems, "the sheets hold what the job's designs are made of"),
    )
    designed = tuple(problem for problem in problems if problem.rule == DESIGNED)
    return FolderReadBack(all_findings, designed, tuple(folders), job)


def read_folder(
    folder: Path, of_job: bool = False, work: WrittenDesign | None = None
) -> AsBuiltFolder:
    """Read the laminate of a folder's cut files, with the problems of files and claims.

    The folder of a design ``of_job`` does not hold film sheets: they are in the job's folder.
    ``work``: the design of a run that has just written the folder. Raises OutputError like
    ``read_back``, and DesignError if ``design.toml`` is missing or does not make a laminate.
    """
    claims = read_claims(folder)
    if all(layer.file is None for layer in claims.layers):
        raise OutputError(f"{folder} holds no cut files; write them with sbafab cut or generate")
    design, digest = _design(folder)
    expected = work.expected if work is not None else expected_laminate(design, claims.curves)
    problems = design_problems(claims, design, digest)
    problems += order_problems(claims, design)
    problems += file_problems(folder, claims)
    layers_expected = expected.layers(len(claims.layers))
    files, file_errors = read_layers(folder, claims, _drawn_in_chords(design), layers_expected)
    problems += file_errors
    files = _as_laid(files, expected)
    seams, file_errors = read_seams(folder, claims, design, expected)
    problems += file_errors
    layers = stacked_layers(files, design)
    problems += height_problems(claims, layers, design)
    problems += property_problems(files, claims, design)
    problems += layer_problems(files, claims)
    problems += pattern_problems(layers, claims)
    if not of_job:
        problems += _design_sheet_problems(folder, claims, design, files)
    laminate: Laminate | None = None
    parts = [file.part for file in files if file.part is not None]
    chord_error = max((part.chord_error for part in parts), default=0.0)
    if len(parts) == len(files) == len(expected.laminate.layers):
        try:
            laminate = _laminate(files, design, expected.laminate)
            if seams is not None:
                laminate = replace(laminate, seams=seams)
            problems += _laminate_problems(folder, laminate, claims, parts, design)
            room = 2 * (TOLERANCE + chord_error)
            problems += size_problems(claims, sizes(design, laminate), room)
            laminate = with_plate_pins(folder, laminate, claims)
        except UNMEASURED as error:
            laminate = None
            message = f"the layers do not lie over each other as films of one stack ({error})"
            problems.append(Problem(INTEGRITY, message))
    design_findings = work.findings if work is not None else None
    return AsBuiltFolder(
        claims, design, tuple(files), laminate, tuple(problems), expected, design_findings
    )


def _as_laid(files: Sequence[LayerFile], expected: ExpectedLaminate) -> list[LayerFile]:
    """Return the files with each layer as assembled: turned over, or its half of a folded film.

    The design's layers already have this position.
    """
    laminate = expected.laminate
    if len(files) != len(laminate.layers):
        return [*files]
    roots = {fold.lower for fold in laminate.folds}
    laid = []
    for file in files:
        part = file.part
        if part is not None and not part.is_expected:
            root = laminate.cut_with(laminate.layer(file.position))
            region = part.region.mirrored() if laminate.layer(root).turned else part.region
            if root in roots:
                region = halves(root, laminate.folds, region)[file.position]
            part = replace(part, region=region)
        laid.append(replace(file, part=part))
    return laid


def _cut_parts(files: Sequence[LayerFile]) -> list[LayerFile]:
    """Return each file once; layers of a folded film share one."""
    return [*{file.claim.file or str(file.position): file for file in reversed(files)}.values()][
        ::-1
    ]


def _laminate(files: Sequence[LayerFile], design: Design, designed: Laminate) -> Laminate:
    """Return the laminate as cut, with bores, inlets and pins of the design."""
    if all(file.part is not None and file.part.is_expected for file in files):
        return designed
    layers = zip(stacked_layers(files, design), designed.layers, strict=True)
    cut = tuple(replace(layer, pieces=expected.pieces) for layer, expected in layers)
    return replace(designed, layers=cut)


def layer_departures(built: AsBuiltFolder) -> list[Problem]:
    """Return the layers whose files differ from the design."""
    problems = []
    expected = built.expected.layers(len(built.files))
    for file, layer in zip(built.files, expected, strict=True):
        if file.part is None or file.part.is_expected or layer is None:
            continue
        difference = departure(file.part.path, layer.path)
        if difference:
            message = (
                f"{file.label} is not what design.toml makes: {difference}; regenerate the folder"
            )
            problems.append(Problem(DESIGNED, message, (file.position,)))
    if built.laminate is not None:
        problems += seam_departures(built.laminate, built.expected)
    if built.files and expected[0] is None:
        count = len(built.expected.laminate.layers)
        message = f"design.toml makes {count} layers, and the manifest lists {len(built.files)}"
        problems.append(Problem(DESIGNED, message))
    return problems


def as_designed(built: AsBuiltFolder) -> Checked:
    """Return the folder's design with its findings."""
    in_chords = built.claims.curves is not None
    laminate = build(built.design) if in_chords else built.expected.laminate
    is_known = built.is_expected and not in_chords
    findings = built.measured if is_known else run_deck(laminate, built.design)
    return Checked(built.design, laminate, findings)


def _design_sheet_problems(
    folder: Path, claims: Manifest, design: Design, files: Sequence[LayerFile]
) -> list[Problem]:
    if not claims.sheets and is_job(folder.absolute().parent):
        message = "the film sheets are those of the job, and were not looked at; check the folder "
        return [Problem(CLAIMS, f"{message}above this one", verdict="warn")]
    parts = _cut_parts(files)
    lots = [DesignLot(claims.name, claims.copies, parts, design.order.spare_parts)]
    return sheet_problems(folder, SheetOrder(claims, design, claims.kerf, lots))


def _laminate_problems(
    folder: Path,
    laminate: Laminate,
    claims: Manifest,
    parts: Sequence[CutPart],
    design: Design,
) -> list[Problem]:
    return [
        *interface_problems(laminate, claims, parts),
        *place_problems(laminate, claims),
        *fixture_problems(folder, laminate, claims),
        *batch_problems(laminate, claims, design),
    ]


def _design(folder: Path) -> tuple[Design, str]:
    """Return the folder's design and its hash. Raises DesignError for one that cannot be used."""
    path = folder / "design.toml"
    if not path.exists():
        raise DesignError("design.toml is missing")
    try:
        design = load_design(path)
        return design, design_sha256(design)
    except (DesignError, OSError) as error:
        raise DesignError(f"design.toml cannot be used: {error or type(error).__name__}") from None


def _drawn_in_chords(design: Design) -> bool:
    """Return True if an outline of the user's has chords in place of arcs."""
    try:
        return any(chords_for_arc(outline) is not None for outline in design.outlines())
    except (DesignError, OSError):
        return False


def _unlisted_waivers(measured: Sequence[Finding], claims: Manifest) -> list[Problem]:
    """Return the waived rules that fail as built and are not in the manifest."""
    rules = dict.fromkeys(finding.rule for finding in measured if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in rules
        if rule not in claims.waived
    ]


# Rules as built: on a whole stack, or on the layers that could be read.


BY_LAYER = (film_limits.NAME,)
"""Rules that measure single layers."""
UNMEASURED = (ArithmeticError, ValueError, LookupError, StopIteration)
"""Errors that rules raise on shapes no design makes; programming errors are not included."""


def findings_as_built(rule: Rule, measures: Measures) -> list[Finding]:
    """Return the findings of a rule; a shape that the rule cannot measure fails it."""
    try:
        return run_rule(rule, measures)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); regenerate them"
        return [Finding(rule.name, "fail", None, None, "", Place(), message)]


def rules_by_layer(
    files: Sequence[LayerFile], claims: Manifest, design: Design
) -> tuple[Finding, ...]:
    """Return the findings of rules on single layers; every other rule fails as not run."""
    layers = stacked_layers(files, design)
    lost = tuple(file.position for file in files if file.part is None)
    some = Laminate(
        name=claims.name,
        family=claims.family,
        layers=layers,
        chambers=(),
        bores=(),
        inlets=(),
        pins=(),
        lumen=None,
        balloons=0,
        registration=design.registration.method,
    )
    why = "it needs every layer, and not all could be read" if lost else "there is no whole stack"
    findings: list[Finding] = []
    measures = Measures(some, design)
    for rule in RULES:
        if layers and rule.name in BY_LAYER:
            findings += findings_as_built(rule, measures)
        elif rule.name != nets.NAME or design.has_nets:
            message = f"not run: {why}"
            findings.append(Finding(rule.name, "warn", None, None, "", Place(None, lost), message))
    return tuple(findings)


# The assembly of a folder: its parts as design.toml joins them, and the manifest's claims.


def assembly_findings(folder: Path) -> tuple[tuple[Finding, ...], list[Problem]]:
    """Return the findings between parts of an assembly, and differences of its manifest.

    Parts are taken as designed: their films are checked design by design.
    """
    claims = read_assembly(folder)
    try:
        assembled = assemble(load_assembly(folder / DESIGN_FILE))
    except (DesignError, OSError) as error:
        return (), [claim(f"the parts were not put together, for {error or type(error).__name__}")]
    between = run_checks(assembled)
    return between, [
        *_assembly_problems(claims, assembled),
        *_unlisted_assembly_waivers(claims, between),
    ]


def lowered_between(folder: Path) -> tuple[str, ...]:
    """Return the lowered limits between parts of the assembly in a folder; () if unreadable."""
    try:
        return lowered_checks(load_assembly(folder / DESIGN_FILE).rules)
    except (DesignError, OSError):
        return ()


def _assembly_problems(claims: AssemblyManifest, assembled: Assembled) -> list[Problem]:
    problems = []
    if claims.name != assembled.assembly.name:
        problems.append(claim(f"design.toml names the assembly {assembled.assembly.name}"))
    if claims.design_sha256 != assembly_sha256(assembled):
        problems.append(claim("design_sha256 is not that of design.toml and its parts' designs"))
    claimed = [(entry.name, entry.copies, entry.design_sha256) for entry in claims.designs]
    designed = [
        (part.design.name, part.design.order.quantity, design_sha256(part.design))
        for part in assembled.designs
    ]
    if claimed != designed:
        problems.append(claim("designs or their copies are not those that the parts ask for"))
    if list(claims.parts) != [part_entry(placed) for placed in assembled.parts]:
        problems.append(claim("parts or their places are not those of design.toml"))
    return problems


def _unlisted_assembly_waivers(
    claims: AssemblyManifest, between: tuple[Finding, ...]
) -> list[Problem]:
    waived = dict.fromkeys(finding.rule for finding in between if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in waived
        if rule not in claims.waived
    ]
