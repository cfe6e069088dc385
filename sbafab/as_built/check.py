"""The rule deck on the cut files of an output folder as they lie on disk (``as-built``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sbafab.actuators import build, load_design, records
from sbafab.as_built.claims import (
    claim,
    design_problems,
    file_problems,
    height_problems,
    lowered_problems,
    order_problems,
    property_problems,
)
from sbafab.as_built.cut_files import CutPart, LayerFile, inside, read_layers
from sbafab.as_built.expected import Meant, RunWork, departure, meant_by
from sbafab.as_built.kerf_removed import chorded_place
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
    is_job,
    is_joined,
    read_claims,
    read_job,
    read_joined,
)
from sbafab.as_built.sheets import Lot, SheetOrder, read_panel, sheet_problems
from sbafab.as_built.stack import laminate_of, stacked_layers
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.checks import lowered_checks, run_checks
from sbafab.assemblies.files import DESIGN_FILE, assembly_sha256, load_assembly, part_entry
from sbafab.design.files import design_sha256, validated
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, SheetPanel
from sbafab.models.formulas import sizes
from sbafab.output.checked import Checked
from sbafab.output.checked import limits as limits_of
from sbafab.output.manifest import AssemblyManifest, JobManifest, Manifest
from sbafab.rules import film_limits
from sbafab.rules.deck import RULES, Rule, run_deck, run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, Limits, lowered
from sbafab.rules.measures import Measures

AS_DESIGNED = "all that lies here is what design.toml makes"


@dataclass(frozen=True)
class AsBuilt:
    """A folder read back: ``laminate`` is None where a layer's file could not be read.

    ``meant`` is what the design makes, if it can be made; ``is_meant``: every layer's file cuts
    just that, so that ``laminate`` is the design's own.
    """

    claims: Manifest
    design: Design
    limits: Limits
    files: tuple[LayerFile, ...]
    laminate: Laminate | None
    problems: tuple[Problem, ...]
    meant: Meant | None
    known: tuple[Finding, ...] | None = None
    """What the rules found in ``meant``, where a run has just measured it."""
    measured: tuple[Finding, ...] = ()
    """What the rules find in the layers as they are cut."""

    @property
    def is_meant(self) -> bool:
        own, meant = self.laminate, self.meant
        if own is not None and meant is not None and own.panel is not meant.laminate.panel:
            return False
        return all(file.part is not None and file.part.is_meant for file in self.files)


@dataclass(frozen=True)
class FolderReadBack:
    """An output folder read back and measured, nothing of it made again.

    ``findings`` are those on files, claims, rules, and on the layers of each design of a job;
    ``problems``: where a folder of one design cuts other layers than its ``design.toml`` makes.
    """

    findings: tuple[Finding, ...]
    problems: tuple[Problem, ...]
    designs: tuple[AsBuilt, ...]
    job: JobManifest | None = None

    def against_design(self, problems: Sequence[Problem]) -> tuple[Finding, ...]:
        """Return the findings, last whether all is as designed, with its ``problems``."""
        return (*self.findings, *findings_of(DESIGNED, [*problems], AS_DESIGNED))


def read_back(folder: Path, works: Mapping[str, RunWork] | None = None) -> FolderReadBack:
    """Return an output folder, of one design or several, as it lies on the disk.

    ``works``: the laminates that are expected, by their designs' names, and what the rules found in
    them: where every layer's file cuts just that it is not measured again. Without, both are made
    from each ``design.toml``. Raises OutputError with one sentence for a folder that holds no sound
    manifest or no cut files.
    """
    if is_job(folder):
        return _read_job(folder, works)
    work = next(iter(works.values())) if works is not None else None
    built = read_folder(folder, work=work)
    built = replace(built, measured=_deck(built))
    return FolderReadBack(_findings(built), tuple(layer_departures(built)), (built,))


def _deck(built: AsBuilt) -> tuple[Finding, ...]:
    """What the rules find in the layers as they are cut."""
    if built.laminate is None:
        return rules_by_layer(built.files, built.claims, built.design, built.limits)
    if built.is_meant and built.known is not None:
        return built.known
    measures = Measures(built.laminate, built.limits)
    return tuple(finding for rule in RULES for finding in findings_as_built(rule, measures))


def _findings(built: AsBuilt) -> tuple[Finding, ...]:
    problems = [*built.problems, *_unsaid_waivers(built.measured, built.claims)]
    count = len(built.files)
    return (
        *findings_of(
            INTEGRITY, problems, f"{count} cut files read back: closed contours in millimetres"
        ),
        *findings_of(CLAIMS, problems, "the manifest's claims hold for what lies on disk"),
        *built.measured,
    )


def _read_job(folder: Path, works: Mapping[str, RunWork] | None) -> FolderReadBack:
    """Return what is found in every design of a job, its name before it, and on the job's sheets.

    In an assembly's folder, also what is found between its parts.
    """
    job = read_job(folder)
    found: list[Finding] = []
    lots: list[Lot] = []
    problems: list[Problem] = []
    weak: list[str] = []
    folders: list[AsBuilt] = []
    for told in job.designs:
        work = works.get(told.name) if works is not None else None
        built = read_folder(inside(folder, told.folder), of_job=True, work=work)
        built = replace(built, measured=_deck(built))
        folders.append(built)
        weak += lowered(limits_of(built.design))
        named = [*_findings(built)]
        layers = layer_departures(built)
        named += findings_of(DESIGNED, layers, AS_DESIGNED) if layers else []
        found += [replace(f, message=f"{told.name}: {f.message}") for f in named]
        lots.append(Lot(told.name, told.copies, built.files, built.design.order.spare_parts))
        own = (built.claims.name, built.claims.copies, built.claims.design_sha256)
        if own != (told.name, told.copies, told.design_sha256):
            message = f"{told.folder}: name, copies or design_sha256 are not those of its manifest"
            problems.append(claim(message))
    first = folders[0]
    problems += file_problems(folder, job)
    order = SheetOrder(job, first.design, first.claims.kerf, lots)
    problems += sheet_problems(folder, order)
    if is_joined(job):
        weak += lowered_between(folder)
        between, wrong = joined_findings(folder)
        found += between
        problems += wrong
    problems += lowered_problems(job.lowered_limits, weak)
    count = len(job.sheets)
    findings = (
        *found,
        *findings_of(INTEGRITY, problems, f"{count} sheets read back: closed contours, no overlap"),
        *findings_of(CLAIMS, problems, "the sheets hold what the job's designs are made of"),
    )
    designed = tuple(problem for problem in problems if problem.rule == DESIGNED)
    return FolderReadBack(findings, designed, tuple(folders), job)


def read_folder(folder: Path, of_job: bool = False, work: RunWork | None = None) -> AsBuilt:
    """The laminate that a folder's cut files make, and what is wrong with files and claims.

    The folder of a design ``of_job`` has no film sheets of its own. ``work``: what the run that has
    just written it knows. Raises OutputError as ``read_back`` does.
    """
    claims = read_claims(folder)
    if all(layer.file is None for layer in claims.layers):
        raise OutputError(f"{folder} holds no cut files; write them with sbafab cut or generate")
    design, is_own, problems = _design(folder, claims)
    if work is not None:
        meant: Meant | None = work.meant
    else:
        meant = meant_by(design, claims.curves) if is_own else None
    problems += order_problems(claims, design)
    try:
        problems += file_problems(folder, claims)
    except OSError as error:
        raise OutputError(f"{folder} cannot be read: {error.strerror or error}") from None
    count = len(claims.layers)
    expected = meant.layers(count) if meant is not None else [None] * count
    files, unread = read_layers(folder, claims, _drawn_in_chords(design), expected)
    problems += unread
    panel, files, unread = read_panel(folder, claims, files, meant)
    problems += unread
    layers = stacked_layers(files, design)
    problems += height_problems(claims, layers, design)
    problems += property_problems(files, claims, design)
    problems += layer_problems(files, claims)
    problems += pattern_problems(layers, claims)
    if not of_job and panel is None:
        problems += _own_sheet_problems(folder, claims, design, files)
    laminate: Laminate | None = None
    parts = [file.part for file in files if file.part is not None]
    chord_error = max((part.chord_error for part in parts), default=0.0)
    if len(parts) == len(files):
        try:
            laminate = _laminate(files, claims, design, meant, panel)
            problems += _laminate_problems(folder, laminate, claims, parts, design)
            room = 2 * (TOLERANCE + chord_error)
            outline = meant.laminate.outline if meant is not None else Region()
            outlined = replace(laminate, outline=outline)
            problems += size_problems(claims, sizes(design, outlined), room)
            laminate = with_plate_pins(folder, laminate, claims)
        except UNMEASURED as error:
            laminate = None
            message = f"the layers do not lie over each other as films of one stack ({error})"
            problems.append(Problem(INTEGRITY, message))
    known = work.findings if work is not None else None
    limits = limits_of(design)
    return AsBuilt(claims, design, limits, tuple(files), laminate, tuple(problems), meant, known)


def _laminate(
    files: Sequence[LayerFile],
    claims: Manifest,
    design: Design,
    meant: Meant | None,
    panel: SheetPanel | None,
) -> Laminate:
    """The layers as they are cut, with bores, inlets and pins where the design wants them.

    What an opening is for cannot be told from its shape alone: a window may look like a tooling
    hole, and an ear like a tab. Only where no design tells are they guessed from the profiles.
    """
    if meant is None or len(meant.laminate.layers) != len(files):
        return laminate_of(files, claims, design)
    if all(file.part is not None and file.part.is_meant for file in files):
        own = meant.laminate
        return own if panel is own.panel else replace(own, panel=panel)
    layers = zip(stacked_layers(files, design), meant.laminate.layers, strict=True)
    cut = tuple(replace(layer, pieces=wanted.pieces) for layer, wanted in layers)
    return replace(meant.laminate, layers=cut, panel=panel)


def layer_departures(built: AsBuilt) -> list[Problem]:
    """Layers whose files cut something else than the design makes there."""
    if built.meant is None:
        return [Problem(DESIGNED, "design.toml makes no laminate to hold the cut files against")]
    problems = []
    expected = built.meant.layers(len(built.files))
    for file, own in zip(built.files, expected, strict=True):
        if file.part is None or file.part.is_meant or own is None:
            continue
        off = departure(file.part.path, own.path)
        if off:
            message = f"{file.label} is not what design.toml makes: {off}; regenerate the folder"
            problems.append(Problem(DESIGNED, message, (file.position,)))
    if built.files and expected[0] is None:
        count = len(built.meant.laminate.layers)
        message = f"design.toml makes {count} layers, and the manifest lists {len(built.files)}"
        problems.append(Problem(DESIGNED, message))
    return problems


def as_designed(built: AsBuilt) -> Checked | None:
    """The folder's design with what the rules find in it; None where it makes no laminate."""
    if built.meant is None:
        return None
    in_chords = built.claims.curves is not None
    laminate = build(built.design) if in_chords else built.meant.laminate
    is_known = built.is_meant and not in_chords
    findings = built.measured if is_known else run_deck(laminate, limits_of(built.design))
    return Checked(built.design, laminate, findings)


def _own_sheet_problems(
    folder: Path, claims: Manifest, design: Design, files: Sequence[LayerFile]
) -> list[Problem]:
    if not claims.sheets and is_job(folder.absolute().parent):
        message = "the film sheets are those of the job, and were not looked at; check the folder "
        return [Problem(CLAIMS, f"{message}above this one", verdict="warn")]
    lots = [Lot(claims.name, claims.copies, files, design.order.spare_parts)]
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


def _design(folder: Path, claims: Manifest) -> tuple[Design, bool, list[Problem]]:
    """The folder's design, and whether it could be read; else the family's defaults."""
    try:
        design = load_design(folder / "design.toml")
        digest = design_sha256(design)
    except (DesignError, OSError) as error:
        said = str(error) or type(error).__name__
        try:
            design = validated({"name": "unknown", "family": claims.family}, records(), folder)
        except DesignError as unknown:
            raise OutputError(f"manifest.json: {unknown}") from None
        return design, False, [claim(f"checked against default limits, for {said}")]
    return design, True, design_problems(claims, design, digest)


def _drawn_in_chords(design: Design) -> bool:
    """Whether the user drew the outline itself with chords for arcs."""
    if design.drawing is None:
        return False
    from sbafab.design.outline import read_outline

    try:
        return chorded_place(read_outline(design.drawing)) is not None
    except (DesignError, OSError):
        return False


def _unsaid_waivers(measured: Sequence[Finding], claims: Manifest) -> list[Problem]:
    """Rules that the design waives, that fail as built, and that no cut file names as waived."""
    rules = dict.fromkeys(finding.rule for finding in measured if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in rules
        if rule not in claims.waived
    ]


# What rules find on files as they lie: on a whole stack, or on the layers that can be read.


BY_LAYER = (film_limits.NAME,)
"""Rules that need no layer but the one they look at."""
UNMEASURED = (ArithmeticError, ValueError, LookupError, StopIteration)
"""What shapes that no rule foresees can raise; a mistake of the program's own is not among them."""


def findings_as_built(rule: Rule, measures: Measures) -> list[Finding]:
    """What a rule finds; doctored files can make shapes that no rule can measure, which fails."""
    try:
        return run_rule(rule, measures.laminate, measures.limits, measures)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); regenerate them"
        return [Finding(rule.name, "fail", None, None, "", Place(), message)]


def rules_by_layer(
    files: Sequence[LayerFile], claims: Manifest, design: Design, limits: Limits
) -> tuple[Finding, ...]:
    """The rules that can run on the layers that could be read; the others say that they did not."""
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
    found: list[Finding] = []
    measures = Measures(some, limits)
    for rule in RULES:
        if layers and rule.name in BY_LAYER:
            found += findings_as_built(rule, measures)
        else:
            message = f"not run: {why}"
            found.append(Finding(rule.name, "warn", None, None, "", Place(None, lost), message))
    return tuple(found)


# The assembly of a folder: its parts as design.toml puts them together, and what is claimed.


def joined_findings(folder: Path) -> tuple[tuple[Finding, ...], list[Problem]]:
    """What is found between the parts, and where the manifest says otherwise than design.toml.

    Parts are as their designs make them: how films were cut is checked design by design.
    """
    claims = read_joined(folder)
    try:
        assembled = assemble(load_assembly(folder / DESIGN_FILE))
    except (DesignError, OSError) as error:
        return (), [claim(f"the parts were not put together, for {error or type(error).__name__}")]
    between = run_checks(assembled)
    return between, [
        *_assembly_problems(claims, assembled),
        *_unsaid_assembly_waivers(claims, between),
    ]


def lowered_between(folder: Path) -> tuple[str, ...]:
    """The limits between parts that the assembly in a folder weakens; none if it is unreadable."""
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
    told = [(one.name, one.copies, one.design_sha256) for one in claims.designs]
    own = [
        (one.design.name, one.design.order.quantity, design_sha256(one.design))
        for one in assembled.designs
    ]
    if told != own:
        problems.append(claim("designs or their copies are not those that the parts ask for"))
    if list(claims.parts) != [part_entry(placed) for placed in assembled.parts]:
        problems.append(claim("parts or their places are not those of design.toml"))
    return problems


def _unsaid_assembly_waivers(
    claims: AssemblyManifest, between: tuple[Finding, ...]
) -> list[Problem]:
    waived = dict.fromkeys(finding.rule for finding in between if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in waived
        if rule not in claims.waived
    ]
