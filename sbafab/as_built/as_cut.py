"""The layers and seams of a folder as its cut files leave them: read back, the kerf removed."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import NamedTuple

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
    CutSettings,
    chord_error_of,
    file_properties,
    kerf_of,
    kerf_text,
    layer_path,
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
from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.folding import halves
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate, Layer
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

    ``path`` is the beam's path as drawn. ``properties`` and ``units`` are empty if the file does
    not state them. ``is_expected``: the path agrees with the design's layer, and ``region`` is that
    layer.
    """

    region: Region
    path: Region
    properties: Mapping[str, str]
    units: str = "mm"
    is_expected: bool = False


class LayerFile(NamedTuple):
    """A layer of the design, the path of its file in the folder, and the part that this cuts."""

    layer: Layer
    path: str
    part: CutPart | None

    @property
    def label(self) -> str:
        return f"layer {self.layer.index} ({self.path})"


def read_layers(
    folder: Path, expected: ExpectedLaminate, settings: CutSettings, has_chords: bool
) -> tuple[list[LayerFile], list[Problem]]:
    """Read the file of every layer, equal files once; agreeing contours become one.

    ``has_chords``: an outline of the design is drawn in chords, so chords are permitted.
    """
    parts: dict[tuple[str, str, str], CutPart] = {}
    files: list[LayerFile] = []
    problems: list[Problem] = []
    laminate = expected.laminate
    for layer, aim in zip(laminate.layers, expected.layers, strict=True):
        cut, material = laminate.layer(laminate.cut_with(layer)), layer.film.material
        name = layer_path(cut.name, settings.kerf_width(material))
        properties = file_properties(settings, material, cut.pattern)
        part: CutPart | None = None
        try:
            path = folder / name
            key = sound_digest(path), material, aim.profile.key
            if key not in parts:
                parts[key] = read_part(path, has_chords, properties, aim)
            part = parts[key]
        except OutputError as error:
            reason = str(error).removeprefix(f"{PurePosixPath(name).name}: ")
            message = f"layer {layer.index} ({name}): {reason}"
            problems.append(Problem(INTEGRITY, message, (layer.index,)))
        files.append(LayerFile(layer, name, part))
    return _in_agreement(files), problems + _property_problems(files, laminate, settings)


def _property_problems(
    files: Sequence[LayerFile], laminate: Laminate, settings: CutSettings
) -> list[Problem]:
    """Return custom properties of the files that are not the design's, joined by value."""
    layers_of: dict[str, list[int]] = {}
    bare: list[LayerFile] = []
    for file in files:
        if file.part is None:
            continue
        if not file.part.properties:
            bare.append(file)
            continue
        pattern = laminate.layer(laminate.cut_with(file.layer)).pattern
        expected = file_properties(settings, file.layer.film.material, pattern)
        for message in property_differences(file.part.properties, expected):
            layers_of.setdefault(message, []).append(file.layer.index)
    problems = []
    if bare:
        of = f"the files of {len(bare)} layers" if len(bare) > 1 else f"the file of {bare[0].label}"
        has_units = all(file.part is not None and file.part.units for file in bare)
        lost = "custom properties" if has_units else "custom properties and no units"
        message = (
            f"{of} carry no {lost}: save as DXF R2004 or later to keep them; kerf, waivers and "
            "curves are taken to be as the design tells"
        )
        layers = tuple(file.layer.index for file in bare)
        problems.append(Problem(CLAIMS, message, layers, verdict="warn"))
    for message, indices in layers_of.items():
        shown = ", ".join(map(str, indices[:5])) + (" ..." if len(indices) > 5 else "")
        plural = "layers" if len(indices) > 1 else "layer"
        problems.append(Problem(CLAIMS, f"{plural} {shown}: {message}", tuple(indices)))
    return problems


def property_differences(actual: Mapping[str, str], expected: Mapping[str, str]) -> list[str]:
    """Return the custom properties of a file that are not the expected ones."""
    return [
        f"custom property {name} is {actual.get(name)!r}, not {expected.get(name)!r}"
        for name in dict.fromkeys((*expected, *actual))
        if actual.get(name) != expected.get(name)
    ]


def _in_agreement(files: Sequence[LayerFile]) -> list[LayerFile]:
    parts = {id(file.part): file.part for file in files if file.part is not None}
    if all(part.is_expected for part in parts.values()):
        return list(files)
    regions = in_agreement([part.region for part in parts.values()])
    agreed = {
        key: replace(part, region=region)
        for (key, part), region in zip(parts.items(), regions, strict=True)
    }
    return [file._replace(part=agreed.get(id(file.part))) for file in files]


def laminate_as_cut(files: Sequence[LayerFile], laminate: Laminate) -> Laminate:
    """Return the design's laminate with each layer as cut; layers of equal shape share a pattern.

    Every file must have been read.
    """
    parts = [file.part for file in files if file.part is not None]
    if all(part.is_expected for part in parts):
        return laminate
    roots = {fold.lower for fold in laminate.folds}
    folded = roots | {fold.upper for fold in laminate.folds}
    patterns: dict[tuple[str, str, int, bool], str] = {}
    layers = []
    for layer, part in zip(laminate.layers, parts, strict=True):
        region = part.region
        if not part.is_expected:
            # As it lies: turned over, or its half of a folded film.
            root = laminate.cut_with(layer)
            region = region.mirrored() if laminate.layer(root).turned else region
            if root in roots:
                region = halves(root, laminate.folds, region)[layer.index]
        # Folded layers are cut as one part, so that none is of another layer's pattern.
        number = layer.index if layer.index in folded else 0
        shape = (layer.film.material, region.key, number, layer.turned)
        pattern = patterns.setdefault(shape, f"P{len(patterns) + 1:02d}")
        layers.append(replace(layer, profile=region, pattern=pattern))
    return replace(laminate, layers=tuple(layers))


def layer_departures(files: Sequence[LayerFile], expected: ExpectedLaminate) -> list[Problem]:
    """Return the layers whose files differ from the design."""
    problems = []
    for file, aim in zip(files, expected.layers, strict=True):
        if file.part is None or file.part.is_expected:
            continue
        difference = departure(file.part.path, aim.path)
        if difference:
            message = (
                f"{file.label} is not what design.toml makes: {difference}; regenerate the folder"
            )
            problems.append(Problem(DESIGNED, message, (file.layer.index,)))
    return problems


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
    has_chords: bool = False,
    properties: Mapping[str, str] | None = None,
    expected: Expected | None = None,
) -> CutPart:
    """Read the part that a cut file cuts. Raises OutputError if the file is not sound.

    ``properties`` are used if the file has no properties. ``expected``: the design's layer, if
    known.
    """
    try:
        drawing = read_profile(path)
        return _part(drawing, has_chords, drawing.properties or properties or {}, expected)
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"holds no sound contours ({error}); regenerate it") from error


def _part(
    drawing: ReadBack, has_chords: bool, properties: Mapping[str, str], expected: Expected | None
) -> CutPart:
    _check_drawn(drawing)
    kerf = kerf_of(properties) or 0.0
    chord_error = chord_error_of(properties)
    if chord_error and isinstance(kerf, tuple):
        raise OutputError("its chords do not tell how its kerf was compensated; regenerate it")
    if not chord_error and not has_chords:
        place = chords_for_arc(drawing.region)
        if place is not None:
            raise OutputError(
                f"an arc is drawn as chords at x {place[0]:.3f}, y {place[1]:.3f}, and the file "
                "does not say so; regenerate it with arcs"
            )
    path, stated, units = drawing.region, drawing.properties, drawing.units
    if expected is not None and not departure(path, expected.path):
        # A path within tolerance needs no estimate of the part that the beam leaves.
        return CutPart(expected.profile, path, stated, units, is_expected=True)
    region = remove_kerf(with_circles(path), kerf)
    if region.is_empty:
        raise OutputError(f"nothing is left inside a kerf of {kerf_text(kerf)} mm; regenerate it")
    return CutPart(with_circles(without_specks(region)), path, stated, units)


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
    folder: Path, designed: Sequence[Seam], settings: CutSettings
) -> tuple[tuple[Seam, ...], list[Problem]]:
    """Return the seams as their files draw them, and problems.

    A path within a micrometre of the design's is replaced by it. Each seam lies where its tool
    runs when the machine's head follows the file; the design states the tool's offset from the
    head.
    """
    seams: list[Seam] = []
    problems: list[Problem] = []
    for seam in designed:
        file = seam_path(seam)
        try:
            sound_digest(folder / file)
            chains, properties = read_seam(folder / file)
        except OutputError as error:
            reason = str(error).removeprefix(f"{PurePosixPath(file).name}: ")
            problems.append(Problem(INTEGRITY, f"seam {seam.name} ({file}): {reason}"))
            continue
        layers = (seam.below, seam.above)
        for difference in property_differences(properties, seam_properties(seam, settings)):
            message = f"seam {seam.name} ({file}): {difference}"
            problems.append(Problem(CLAIMS, message, layers))
        drawn = moved(chains, settings.seam_offsets.get(seam.tool, CENTRED))
        what = deviation(drawn, seam.path)
        as_drawn = seam if what is None else replace(seam, path=drawn)
        width = stated_width(properties)
        if width is not None and abs(width - seam.width) > TOLERANCE:
            as_drawn = replace(as_drawn, width=width)
            what = what or f"{WIDTH} is {width:g} mm, not {seam.width:g}"
        if what is not None:
            message = f"seam {seam.name} is not what design.toml makes: {what}"
            problems.append(Problem(DESIGNED, f"{message}; regenerate the folder", layers))
        seams.append(as_drawn)
    return tuple(seams), problems
