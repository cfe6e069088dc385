"""The rule deck on the cut files of an output folder as they lie on disk (``as-built``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sbafab.actuators import build, load_design, records
from sbafab.design.reading import validated
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.boolean import GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.models.sizes import sizes
from sbafab.output.as_built.chords import chorded_place
from sbafab.output.as_built.claims import (
    claim,
    design_problems,
    file_problems,
    height_problems,
    lowered_problems,
    order_problems,
    property_problems,
)
from sbafab.output.as_built.cut_files import CutPart, LayerFile, inside, read_layers
from sbafab.output.as_built.joined import joined_findings, lowered_between
from sbafab.output.as_built.measures import (
    fixture_problems,
    interface_problems,
    layer_problems,
    pattern_problems,
    place_problems,
    size_problems,
    with_plate_pins,
)
from sbafab.output.as_built.pieces import Lot
from sbafab.output.as_built.records import (
    CLAIMS,
    INTEGRITY,
    Manifest,
    Problem,
    findings_of,
    is_job,
    is_joined,
    read_claims,
    read_job,
)
from sbafab.output.as_built.sheets import Order, sheet_problems
from sbafab.output.as_built.stack import laminate_of, stacked_layers
from sbafab.output.settings import limits as limits_of
from sbafab.rules import film_limits
from sbafab.rules.deck import RULES, Rule, run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import TOLERANCE, Limits
from sbafab.rules.lowered import lowered

BY_LAYER = (film_limits.NAME,)
"""Rules that need no layer but the one they look at."""
UNMEASURED = (ArithmeticError, ValueError, LookupError, StopIteration, AttributeError, TypeError)


@dataclass(frozen=True)
class AsBuilt:
    """A folder read back: ``laminate`` is None where a layer's file could not be read."""

    claims: Manifest
    design: Design
    limits: Limits
    files: tuple[LayerFile, ...]
    laminate: Laminate | None
    problems: tuple[Problem, ...]


def check_folder(folder: Path) -> tuple[Finding, ...]:
    """Everything found in an output folder: file integrity, the manifest's claims, the deck.

    Of a job's folder, that of every design, and of the film sheets they share. Raises OutputError
    with one sentence for a folder that holds no sound manifest or no cut files.
    """
    if is_job(folder):
        return _check_job(folder)
    return _findings(read_folder(folder))


def _findings(built: AsBuilt) -> tuple[Finding, ...]:
    if built.laminate is None:
        measured = _by_layer(built)
    else:
        measured = tuple(
            finding for rule in RULES for finding in _measured(rule, built.laminate, built.limits)
        )
    problems = [*built.problems, *_unsaid_waivers(measured, built.claims)]
    count = len(built.files)
    return (
        *findings_of(
            INTEGRITY, problems, f"{count} cut files read back: closed contours in millimetres"
        ),
        *findings_of(CLAIMS, problems, "the manifest's claims hold for what lies on disk"),
        *measured,
    )


def _check_job(folder: Path) -> tuple[Finding, ...]:
    """What is found in every design of a job, its name before it, and on the job's sheets.

    In an assembly's folder, also what is found between its parts.
    """
    job = read_job(folder)
    found: list[Finding] = []
    lots: list[Lot] = []
    problems: list[Problem] = []
    first: AsBuilt | None = None
    weak: list[str] = []
    for told in job.designs:
        built = read_folder(inside(folder, told.folder), of_job=True)
        first = first or built
        weak += lowered(limits_of(built.design))
        found += [replace(f, message=f"{told.name}: {f.message}") for f in _findings(built)]
        lots.append(Lot(told.name, told.copies, built.files))
        own = (built.claims.name, built.claims.copies, built.claims.design_sha256)
        if own != (told.name, told.copies, told.design_sha256):
            message = f"{told.folder}: name, copies or design_sha256 are not those of its manifest"
            problems.append(claim(message))
    assert first is not None
    problems += file_problems(folder, job)
    problems += sheet_problems(
        folder,
        Order(
            job.name,
            job.designs_sha256,
            first.design,
            first.claims.kerf,
            job.waived,
            job.lowered_limits,
            job.films,
            job.sheets,
            job.files,
            lots,
        ),
    )
    if is_joined(job):
        weak += lowered_between(folder)
        between, wrong = joined_findings(folder)
        found += between
        problems += wrong
    problems += lowered_problems(job.lowered_limits, weak)
    count = len(job.sheets)
    return (
        *found,
        *findings_of(INTEGRITY, problems, f"{count} sheets read back: closed contours, no overlap"),
        *findings_of(CLAIMS, problems, "the sheets hold what the job's designs are made of"),
    )


def read_folder(folder: Path, of_job: bool = False) -> AsBuilt:
    """The laminate that a folder's cut files make, and what is wrong with files and claims.

    The folder of a design ``of_job`` has no film sheets of its own. Raises OutputError as
    ``check_folder`` does.
    """
    claims = read_claims(folder)
    if all(layer.file is None for layer in claims.layers):
        raise OutputError(f"{folder} holds no cut files; write them with sbafab cut or generate")
    design, problems = _design(folder, claims)
    problems += order_problems(claims)
    try:
        problems += file_problems(folder, claims)
    except OSError as error:
        raise OutputError(f"{folder} cannot be read: {error.strerror or error}") from None
    files, unread = read_layers(folder, claims, _drawn_in_chords(design))
    problems += unread
    layers = stacked_layers(files, design)
    problems += height_problems(claims, layers, design)
    problems += property_problems(files, claims)
    problems += layer_problems(files, claims)
    problems += pattern_problems(layers, claims)
    if not of_job:
        problems += _own_sheet_problems(folder, claims, design, files)
    laminate: Laminate | None = None
    parts = [file.part for file in files if file.part is not None]
    chord_error = max((part.chord_error for part in parts), default=0.0)
    if len(parts) == len(files):
        try:
            laminate = laminate_of(files, claims, design)
            problems += _laminate_problems(folder, laminate, claims, parts)
            room = 2 * (TOLERANCE + chord_error)
            outlined = replace(laminate, outline=_outline(design))
            problems += size_problems(claims, sizes(design, outlined), room)
            laminate = with_plate_pins(folder, laminate, claims)
        except UNMEASURED as error:
            laminate = None
            message = f"the layers do not lie over each other as films of one stack ({error})"
            problems.append(Problem(INTEGRITY, message))
    return AsBuilt(claims, design, limits_of(design), tuple(files), laminate, tuple(problems))


def _outline(design: Design) -> Region:
    """Where the design has its films without tabs and ears; empty if it cannot be built."""
    try:
        return build(design).outline
    except (DesignError, GeometryError, OSError):
        return Region()


def _own_sheet_problems(
    folder: Path, claims: Manifest, design: Design, files: Sequence[LayerFile]
) -> list[Problem]:
    if not claims.sheets and is_job(folder.absolute().parent):
        message = "the film sheets are those of the job, and were not looked at; check the folder "
        return [Problem(CLAIMS, f"{message}above this one", verdict="warn")]
    return sheet_problems(
        folder,
        Order(
            claims.name,
            claims.design_sha256,
            design,
            claims.kerf,
            claims.waived,
            claims.lowered_limits,
            claims.films,
            claims.sheets,
            claims.files,
            [Lot(claims.name, claims.copies, files)],
        ),
    )


def _laminate_problems(
    folder: Path,
    laminate: Laminate,
    claims: Manifest,
    parts: Sequence[CutPart],
) -> list[Problem]:
    return [
        *interface_problems(laminate, claims, parts),
        *place_problems(laminate, claims),
        *fixture_problems(folder, laminate, claims),
    ]


def _design(folder: Path, claims: Manifest) -> tuple[Design, list[Problem]]:
    """The folder's design; the family's defaults, and a problem, where it cannot be read."""
    try:
        design = load_design(folder / "design.toml")
        digest = design_sha256(design)
    except (DesignError, OSError) as error:
        said = str(error) or type(error).__name__
        try:
            design = validated({"name": "unknown", "family": claims.family}, records(), folder)
        except DesignError as unknown:
            raise OutputError(f"manifest.json: {unknown}") from None
        return design, [claim(f"checked against default limits, for {said}")]
    return design, design_problems(claims, design, digest)


def _drawn_in_chords(design: Design) -> bool:
    """Whether the user drew the outline itself with chords for arcs."""
    if design.drawing is None:
        return False
    from sbafab.design.outline import read_outline

    try:
        return chorded_place(read_outline(design.drawing)) is not None
    except (DesignError, OSError):
        return False


def _measured(rule: Rule, laminate: Laminate, limits: Limits) -> list[Finding]:
    """What a rule finds; doctored files can make shapes that no rule can measure, which fails."""
    try:
        return run_rule(rule, laminate, limits)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); write them anew"
        return [Finding(rule.name, "fail", None, None, "", Place(), message)]


def _by_layer(built: AsBuilt) -> tuple[Finding, ...]:
    """The rules that can run on the layers that could be read; the others say that they did not."""
    layers: tuple[Layer, ...] = stacked_layers(built.files, built.design)
    lost = tuple(file.position for file in built.files if file.part is None)
    some = Laminate(
        name=built.claims.name,
        family=built.claims.family,
        layers=layers,
        chambers=(),
        bores=(),
        inlets=(),
        pins=(),
        lumen=None,
        balloons=0,
        registration=built.design.registration.method,
    )
    why = "it needs every layer, and not all could be read" if lost else "there is no whole stack"
    found: list[Finding] = []
    for rule in RULES:
        if layers and rule.name in BY_LAYER:
            found += _measured(rule, some, built.limits)
        else:
            message = f"not run: {why}"
            found.append(Finding(rule.name, "warn", None, None, "", Place(None, lost), message))
    return tuple(found)


def _unsaid_waivers(measured: Sequence[Finding], claims: Manifest) -> list[Problem]:
    """Rules that the design waives, that fail as built, and that no cut file names as waived."""
    rules = dict.fromkeys(finding.rule for finding in measured if finding.by_user)
    return [
        claim(f"{rule} fails and is waived by design.toml, which the manifest does not say")
        for rule in rules
        if rule not in claims.waived
    ]
