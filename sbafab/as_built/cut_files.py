"""The cut files of a folder read back: the part each will cut, or what is wrong with it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path, PurePosixPath

from sbafab.as_built.expected import Expected, departure, in_agreement, with_circles, without_specks
from sbafab.as_built.kerf_removed import chords_for_arc, remove_kerf
from sbafab.as_built.records import INTEGRITY, Problem
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.properties import (
    CUT_INNER,
    CUT_OUTER,
    CUT_SEQUENCE,
    REFERENCE,
    chord_error_of,
    curves_property,
    kerf_of,
    kerf_properties,
    kerf_text,
)
from sbafab.cutting.verify import check_datum
from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material
from sbafab.output.manifest_records import LayerClaim, Manifest

MAX_BYTES = 20_000_000
MAX_ENTITIES = 300_000
"""Entities and points a cut file may be drawn with: more would take minutes to be kept apart."""
MARK = re.compile(rb"\n *1?0\r?\n")
DATUM = "LINE"
"""What the datum cross is drawn with: all that a layer file holds beside its contours."""


@dataclass(frozen=True)
class CutPart:
    """What a cut file cuts: ``region`` with the kerf undone, round contours as circles.

    ``path`` is the beam's path as it is drawn. ``chord_error`` is what the file says, in mm, 0 for
    true arcs; ``corner_room`` the mm2 by which the area may be off because the beam rounds corners.
    ``properties`` and ``units`` are empty where the file does not say.
    ``is_meant``: the path is that of the design's own layer, and ``region`` what that one cuts.
    """

    region: Region
    path: Region
    properties: dict[str, str]
    chord_error: float
    corner_room: float
    units: str = "mm"
    is_meant: bool = False


@dataclass(frozen=True)
class LayerFile:
    """A layer of the manifest with its place in the stack (from 1) and what its file cuts."""

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
    """Every layer's file, files of equal bytes that should be equal read once.

    Contours that differ by less than what files promise are made one.

    ``chords_drawn``: the design's own outline is drawn in chords, so they are no fault.
    ``expected`` holds what each layer should be, where that is known.
    """
    known: dict[tuple[str, Material, str], CutPart] = {}
    files, problems = [], []
    for position, (claim, own) in enumerate(zip(claims.layers, expected, strict=True), start=1):
        part: CutPart | None = None
        try:
            path = path_in_folder(folder, claim.file)
            key = sound_digest(path), claim.material, own.profile.key if own is not None else ""
            if key not in known:
                told = claimed_properties(claims, claim.material)
                known[key] = read_part(path, chords_drawn, told, own)
            part = known[key]
        except OutputError as error:
            name = claim.file or claim.name
            said = str(error).removeprefix(f"{PurePosixPath(name).name}: ")
            message = f"layer {position} ({name}): {said}"
            problems.append(Problem(INTEGRITY, message, (position,)))
        files.append(LayerFile(position, claim, part))
    return _in_agreement(files), problems


def claimed_properties(claims: Manifest, material: str) -> dict[str, str]:
    """The properties that the manifest tells of the cut files of a material."""
    kerf = next((kerf.width for name, kerf in claims.kerf.items() if name == material), None)
    return {**kerf_properties(kerf), **curves_property(claims.curves)}


def _in_agreement(files: Sequence[LayerFile]) -> list[LayerFile]:
    parts = {id(file.part): file.part for file in files if file.part is not None}
    if all(part.is_meant for part in parts.values()):
        return list(files)
    regions = in_agreement([part.region for part in parts.values()])
    agreed = {
        key: replace(part, region=region)
        for (key, part), region in zip(parts.items(), regions, strict=True)
    }
    return [replace(file, part=agreed.get(id(file.part))) for file in files]


def path_in_folder(folder: Path, file: str | None) -> Path:
    """Where a file of the manifest lies. Raises OutputError where that is not in the folder."""
    if file is None:
        raise OutputError("the manifest names no cut file for it; regenerate the folder")
    pure = PurePosixPath(file)
    if pure.is_absolute() or ".." in pure.parts or "\\" in file or "\0" in file:
        raise OutputError("its path leads out of the folder; regenerate the folder")
    return folder / pure


def sound_digest(path: Path) -> str:
    """sha256 of a file that is there and can be read in time. Raises OutputError."""
    try:
        # A pipe or a device would be read for ever.
        if path.exists() and not path.is_file():
            raise OutputError("no plain file; regenerate it")
        if path.stat().st_size > MAX_BYTES:
            raise OutputError(f"larger than {MAX_BYTES:,} bytes; regenerate it")
        data = path.read_bytes()
        # A mark has a line of its own, and lines are counted in a moment.
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
    told: Mapping[str, str] | None = None,
    expected: Expected | None = None,
    noted: bool = False,
) -> CutPart:
    """The part that a cut file cuts. Raises OutputError where it is not what the format says.

    ``told`` stands in for the properties of a file that has none; ``expected`` is what it should
    be, where that is known. ``noted``: it may have letters on REFERENCE, as a base plate has.
    """
    try:
        found = read_profile(path)
        if noted:
            found = _without_letters(found)
        return _part(found, chords_drawn, found.properties or told or {}, expected)
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"holds no sound contours ({error}); regenerate it") from error


def _part(
    found: ReadBack,
    chords_drawn: bool,
    properties: Mapping[str, str],
    expected: Expected | None,
) -> CutPart:
    _check_drawn(found)
    kerf = kerf_of(properties) or 0.0
    chord_error = chord_error_of(properties)
    if chord_error and isinstance(kerf, tuple):
        raise OutputError("its chords do not tell how its kerf was compensated; regenerate it")
    if not chord_error and not chords_drawn:
        place = chords_for_arc(found.region)
        if place is not None:
            raise OutputError(
                f"an arc is drawn as chords at x {place[0]:.3f}, y {place[1]:.3f}, and the file "
                "does not say so; regenerate it with arcs"
            )
    if expected is not None and not departure(found.region, expected.path):
        # What is cut within its tolerance needs no guess at what the beam may have left.
        return CutPart(
            expected.profile,
            found.region,
            found.properties,
            chord_error,
            0.0,
            found.units,
            is_meant=True,
        )
    region, corner_room = remove_kerf(with_circles(found.region), kerf)
    if region.is_empty:
        raise OutputError(f"nothing is left inside a kerf of {kerf_text(kerf)} mm; regenerate it")
    return CutPart(
        with_circles(without_specks(region)),
        found.region,
        found.properties,
        chord_error,
        corner_room,
        found.units,
    )


LETTERS = ("LWPOLYLINE", "POLYLINE")
"""Types of the strokes of letters, the latter before R2000."""


def _without_letters(found: ReadBack) -> ReadBack:
    """The same without polylines on REFERENCE, which are letters: the datum cross is two lines."""
    kept = [
        (kind, stroke)
        for kind, stroke in zip(found.other, found.strokes, strict=True)
        if kind not in LETTERS or stroke[0] != REFERENCE
    ]
    kinds, strokes = tuple(kind for kind, _ in kept), tuple(stroke for _, stroke in kept)
    return replace(found, other=kinds, strokes=strokes)


def _check_drawn(found: ReadBack) -> None:
    if found.region.is_empty:
        raise OutputError(f"no contour on {CUT_INNER} or {CUT_OUTER}; regenerate it")
    for kind in found.other:
        if kind != DATUM:
            raise OutputError(
                f"a {kind} lies on a layer other than {CUT_INNER} and {CUT_OUTER}, so it would "
                "not be cut in its turn; move it"
            )
    check_datum(found)
    check_sequence(found)


def check_sequence(found: ReadBack) -> None:
    """Raises OutputError where an outline is cut before a hole, or anything out of its turn."""
    ranks = [CUT_SEQUENCE.index(layer) for layer in found.layers if layer in CUT_SEQUENCE]
    for before, after in pairwise(ranks):
        if before > after:
            raise OutputError(
                f"{CUT_SEQUENCE[before]} is cut before {CUT_SEQUENCE[after]}; regenerate it"
            )
