"""The cut files and seams of a folder read back: the part or seam of each file, and its faults."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path, PurePosixPath

from sbafab.actuators.stacking import film_of
from sbafab.as_built.expected import (
    Expected,
    ExpectedLaminate,
    departure,
    in_agreement,
    with_circles,
    without_specks,
)
from sbafab.as_built.kerf_removed import chords_for_arc, remove_kerf
from sbafab.as_built.records import CLAIMS, DESIGNED, INTEGRITY, Problem
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.properties import (
    CUT_INNER,
    CUT_OUTER,
    CUT_SEQUENCE,
    REFERENCE,
    CutSettings,
    chord_error_of,
    curves_property,
    kerf_of,
    kerf_properties,
    kerf_text,
)
from sbafab.cutting.seam_files import (
    CENTRED,
    WIDTH,
    deviation,
    moved,
    read_seam,
    seam_path,
    seam_properties,
    stated_width,
)
from sbafab.cutting.verify import check_datum
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.films import Film, Material
from sbafab.laminate.joints import Seam, balloon_numbers
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.output.manifest import LayerClaim, Manifest, SeamClaim
from sbafab.rules.limits import TOLERANCE

MAX_BYTES = 20_000_000
MAX_ENTITIES = 300_000
"""Entities and points of a cut file: more would take minutes to check."""
MARK = re.compile(rb"\n *1?0\r?\n")
DATUM = "LINE"
"""Entity of the datum cross, the only one in a layer file beside its contours."""


@dataclass(frozen=True)
class CutPart:
    """The part that a cut file cuts: ``region`` without the kerf, round contours as circles.

    ``path`` is the beam's path as drawn. ``chord_error``: as the file claims, mm, 0 for true arcs.
    ``corner_room``: mm2 by which the area may differ since the beam rounds corners. ``properties``
    and ``units`` are empty if the file does not state them. ``is_expected``: the path agrees with
    the design's layer, and ``region`` is that layer.
    """

    region: Region
    path: Region
    properties: dict[str, str]
    chord_error: float
    corner_room: float
    units: str = "mm"
    is_expected: bool = False


@dataclass(frozen=True)
class LayerFile:
    """A layer of the manifest with its place in the stack (from 1) and the part its file cuts."""

    position: int
    claim: LayerClaim
    part: CutPart | None

    @property
    def label(self) -> str:
        return f"layer {self.position} ({self.claim.file or self.claim.name})"


def read_layers(
    folder: Path,
    claims: Manifest,
    chords_drawn: bool,
    expected: Sequence[Expected | None],
) -> tuple[list[LayerFile], list[Problem]]:
    """Read the file of every layer, equal files once; agreeing contours become one.

    ``chords_drawn``: the design's outline is drawn in chords, so chords are permitted. ``expected``
    holds the design's layers, None if unknown.
    """
    parts: dict[tuple[str, Material, str], CutPart] = {}
    files, problems = [], []
    for position, (claim, layer) in enumerate(zip(claims.layers, expected, strict=True), start=1):
        part: CutPart | None = None
        try:
            path = path_in_folder(folder, claim.file)
            key = sound_digest(path), claim.material, layer.profile.key if layer is not None else ""
            if key not in parts:
                properties = claimed_properties(claims, claim.material)
                parts[key] = read_part(path, chords_drawn, properties, layer)
            part = parts[key]
        except OutputError as error:
            name = claim.file or claim.name
            reason = str(error).removeprefix(f"{PurePosixPath(name).name}: ")
            message = f"layer {position} ({name}): {reason}"
            problems.append(Problem(INTEGRITY, message, (position,)))
        files.append(LayerFile(position, claim, part))
    return _in_agreement(files), problems


def stacked_layers(files: Sequence[LayerFile], design: Design) -> tuple[Layer, ...]:
    """Return the layers of readable files in order; equal profiles share a pattern."""
    patterns: dict[tuple[str, str, int, bool], str] = {}
    layers = []
    z = 0.0
    folded = {index for fold in design.stated_folds for index in (fold.lower, fold.upper)}
    balloons = balloon_numbers([file.claim.role for file in files], design.seamed_layers)
    for file, balloon in zip(files, balloons, strict=True):
        claim = file.claim
        if file.part is not None:
            # Folded layers are cut as one part, so that none is of another layer's pattern.
            number = file.position if file.position in folded else 0
            turned = file.position in design.turned_layers
            shape = (claim.material, file.part.region.key, number, turned)
            layers.append(
                Layer(
                    index=file.position,
                    role=claim.role,
                    film=_film(claim, design),
                    profile=file.part.region,
                    balloon=balloon,
                    z=round(z, 9),
                    pieces=1,
                    pattern=patterns.setdefault(shape, f"P{len(patterns) + 1:02d}"),
                )
            )
        z += claim.thickness
    return tuple(layers)


def _film(claim: LayerClaim, design: Design) -> Film:
    """Return the film of a layer's role, with the claimed name and thickness."""
    film = film_of(design, claim.role, claim.index)
    return replace(film, material=claim.material, thickness=claim.thickness)


def claimed_properties(claims: Manifest, material: str) -> dict[str, str]:
    """Return the properties that the manifest claims for the cut files of a material."""
    kerf = next((kerf.width for name, kerf in claims.kerf.items() if name == material), None)
    return {**kerf_properties(kerf), **curves_property(claims.curves)}


def _in_agreement(files: Sequence[LayerFile]) -> list[LayerFile]:
    parts = {id(file.part): file.part for file in files if file.part is not None}
    if all(part.is_expected for part in parts.values()):
        return list(files)
    regions = in_agreement([part.region for part in parts.values()])
    agreed = {
        key: replace(part, region=region)
        for (key, part), region in zip(parts.items(), regions, strict=True)
    }
    return [replace(file, part=agreed.get(id(file.part))) for file in files]


def path_in_folder(folder: Path, file: str | None) -> Path:
    """Return the path of a file of the manifest. Raises OutputError if it is outside the folder."""
    if file is None:
        raise OutputError("the manifest names no cut file for it; regenerate the folder")
    pure = PurePosixPath(file)
    if pure.is_absolute() or ".." in pure.parts or "\\" in file or "\0" in file:
        raise OutputError("its path leads out of the folder; regenerate the folder")
    return folder / pure


def sound_digest(path: Path) -> str:
    """Return the sha256 of a file. Raises OutputError if it is missing, unreadable or too large."""
    try:
        # Reading a pipe or a device would never end.
        if path.exists() and not path.is_file():
            raise OutputError("no plain file; regenerate it")
        if path.stat().st_size > MAX_BYTES:
            raise OutputError(f"larger than {MAX_BYTES:,} bytes; regenerate it")
        data = path.read_bytes()
        # Each mark is on a separate line, and counting lines is fast.
        is_long = data.count(b"\n") > MAX_ENTITIES
        marks = sum(1 for _ in MARK.finditer(data)) if is_long else 0
        if marks > MAX_ENTITIES:
            raise OutputError(
                f"drawn with {marks:,} entities and points, where at most {MAX_ENTITIES:,} may be"
            )
        return hashlib.sha256(data).hexdigest()
    except (FileNotFoundError, NotADirectoryError):
        raise OutputError("missing; regenerate it") from None
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"cannot be read ({error.strerror or error}); regenerate it") from None


def read_part(
    path: Path,
    chords_drawn: bool = False,
    properties: Mapping[str, str] | None = None,
    expected: Expected | None = None,
    has_letters: bool = False,
) -> CutPart:
    """Read the part that a cut file cuts. Raises OutputError if the file is not sound.

    ``properties`` are used if the file has no properties. ``expected``: the design's layer, if
    known. ``has_letters``: letters on REFERENCE are permitted, as on a base plate.
    """
    try:
        drawing = read_profile(path)
        if has_letters:
            drawing = _without_letters(drawing)
        return _part(drawing, chords_drawn, drawing.properties or properties or {}, expected)
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"holds no sound contours ({error}); regenerate it") from error


def _part(
    drawing: ReadBack,
    chords_drawn: bool,
    properties: Mapping[str, str],
    expected: Expected | None,
) -> CutPart:
    _check_drawn(drawing)
    kerf = kerf_of(properties) or 0.0
    chord_error = chord_error_of(properties)
    if chord_error and isinstance(kerf, tuple):
        raise OutputError("its chords do not tell how its kerf was compensated; regenerate it")
    if not chord_error and not chords_drawn:
        place = chords_for_arc(drawing.region)
        if place is not None:
            raise OutputError(
                f"an arc is drawn as chords at x {place[0]:.3f}, y {place[1]:.3f}, and the file "
                "does not say so; regenerate it with arcs"
            )
    if expected is not None and not departure(drawing.region, expected.path):
        # A path within tolerance needs no estimate of the part that the beam leaves.
        return CutPart(
            expected.profile,
            drawing.region,
            drawing.properties,
            chord_error,
            0.0,
            drawing.units,
            is_expected=True,
        )
    region, corner_room = remove_kerf(with_circles(drawing.region), kerf)
    if region.is_empty:
        raise OutputError(f"nothing is left inside a kerf of {kerf_text(kerf)} mm; regenerate it")
    return CutPart(
        with_circles(without_specks(region)),
        drawing.region,
        drawing.properties,
        chord_error,
        corner_room,
        drawing.units,
    )


LETTERS = ("LWPOLYLINE", "POLYLINE")
"""Types of the strokes of letters, the latter before R2000."""


def _without_letters(drawing: ReadBack) -> ReadBack:
    """Return the drawing without polylines on REFERENCE, which are letters; the datum is lines."""
    remaining = [
        (kind, stroke)
        for kind, stroke in zip(drawing.other, drawing.strokes, strict=True)
        if kind not in LETTERS or stroke[0] != REFERENCE
    ]
    kinds, strokes = tuple(kind for kind, _ in remaining), tuple(stroke for _, stroke in remaining)
    return replace(drawing, other=kinds, strokes=strokes)


def _check_drawn(drawing: ReadBack) -> None:
    if drawing.region.is_empty:
        raise OutputError(f"no contour on {CUT_INNER} or {CUT_OUTER}; regenerate it")
    for kind in drawing.other:
        if kind != DATUM:
            raise OutputError(
                f"a {kind} lies on a layer other than {CUT_INNER} and {CUT_OUTER}, so it would "
                "not be cut in its turn; move it"
            )
    check_datum(drawing)
    check_sequence(drawing)


def check_sequence(drawing: ReadBack) -> None:
    """Raise OutputError if an outline is cut before a hole, or any other layer out of sequence."""
    ranks = [CUT_SEQUENCE.index(layer) for layer in drawing.layers if layer in CUT_SEQUENCE]
    for before, after in pairwise(ranks):
        if before > after:
            raise OutputError(
                f"{CUT_SEQUENCE[before]} is cut before {CUT_SEQUENCE[after]}; regenerate it"
            )


def read_seams(
    folder: Path, claims: Manifest, design: Design, expected: ExpectedLaminate
) -> tuple[tuple[Seam, ...] | None, list[Problem]]:
    """Return the seams as their files draw them, and problems; None if the design has no seams.

    A path within a micrometre of the design's is replaced by it. Each seam lies where its tool
    runs when the machine's head follows the file; the design states the tool's offset from the
    head.
    """
    designed = expected.laminate.seams
    problems = _seam_problems(claims, designed)
    if not designed:
        return None, problems
    seams = []
    claimed = {claim.name: claim for claim in claims.seams}
    settings = CutSettings(
        claims.name,
        claims.design_sha256,
        generator=claims.generator,
        seam_offsets=design.seam_offsets,
    )
    for seam in designed:
        claim = claimed.get(seam.name)
        if claim is None:
            continue
        try:
            seams.append(_read_seam(folder, claim, seam, settings, problems))
        except OutputError as error:
            reason = str(error).removeprefix(f"{PurePosixPath(claim.file or claim.name).name}: ")
            problems.append(Problem(INTEGRITY, f"seam {seam.name} ({claim.file}): {reason}"))
    return tuple(seams), problems


def _seam_problems(claims: Manifest, designed: tuple[Seam, ...]) -> list[Problem]:
    """Return the differences between manifest and design in the seams."""
    problems = []
    by_name = {seam.name: seam for seam in designed}
    for claim in claims.seams:
        seam = by_name.pop(claim.name, None)
        if seam is None:
            problems.append(Problem(CLAIMS, f"seam {claim.name} is of no seam of design.toml"))
            continue
        agree = (
            ("below", claim.below, seam.below),
            ("above", claim.above, seam.above),
            ("tool", claim.tool, seam.tool),
            ("kind", claim.kind, seam.kind),
            ("width", claim.width, seam.width),
            ("order", claim.order, seam.order),
            ("file", claim.file, seam_path(seam)),
        )
        problems += [
            Problem(
                CLAIMS,
                f"seam {claim.name}: {key} is {claimed} in the manifest and {stated} by "
                "design.toml",
            )
            for key, claimed, stated in agree
            if claimed != stated
        ]
    problems += [Problem(CLAIMS, f"the manifest lists no seam {name}") for name in by_name]
    return problems


def _read_seam(
    folder: Path,
    claim: SeamClaim,
    seam: Seam,
    settings: CutSettings,
    problems: list[Problem],
) -> Seam:
    path = path_in_folder(folder, claim.file)
    sound_digest(path)
    chains, properties = read_seam(path)
    chains = moved(chains, settings.seam_offsets.get(seam.tool, CENTRED))
    stated: dict[str, str | None] = {"TOOL_OFFSET": None, **seam_properties(seam, settings)}
    del stated[WIDTH]
    problems += [
        Problem(
            CLAIMS,
            f"seam {seam.name} ({claim.file}): {name} is {properties.get(name)!r}, and by "
            f"design.toml {value!r}",
        )
        for name, value in stated.items()
        if properties.get(name) != value
    ]
    width = stated_width(properties)
    if width is None or abs(width - claim.width) > TOLERANCE:
        problems.append(
            Problem(
                CLAIMS,
                f"seam {seam.name} ({claim.file}): {WIDTH} is {properties.get(WIDTH)!r}, and the "
                f"manifest says {claim.width:g} mm",
            )
        )
    drawn = seam if deviation(chains, seam.path) is None else replace(seam, path=chains)
    if width is not None and abs(width - seam.width) > TOLERANCE:
        drawn = replace(drawn, width=width)
    return drawn


def seam_departures(laminate: Laminate, expected: ExpectedLaminate) -> list[Problem]:
    """Return the seams whose files differ from the design."""
    designed = {seam.name: seam for seam in expected.laminate.seams}
    problems = []
    for seam in laminate.seams:
        own = designed.pop(seam.name, None)
        if own is None or seam == own:
            continue
        what = deviation(seam.path, own.path) or f"it is {seam.width:g} mm wide, not {own.width:g}"
        problems.append(
            Problem(
                DESIGNED,
                f"seam {seam.name} is not what design.toml makes: {what}; regenerate the folder",
                (seam.below, seam.above),
            )
        )
    return problems
