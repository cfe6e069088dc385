"""The layers and seams of a folder as its cut files define them: read back, without the kerf."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from sbafab.cutting.chaining import check_clear
from sbafab.cutting.cut_settings import (
    CUT_INNER,
    CUT_OUTER,
    CutSettings,
    file_properties,
    kerf_of,
    kerf_text,
    layer_path,
)
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.layer_files import (
    CENTRED,
    WIDTH,
    moved,
    path_difference,
    read_seam,
    seam_path,
    seam_properties,
    stated_width,
)
from sbafab.cutting.verify import check_contours, check_datum, check_sequence
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.folders.build import Build
from sbafab.folders.differences import (
    CLAIMS,
    DESIGNED,
    INTEGRITY,
    problem,
    reason_of,
    sound_digest,
)
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import edge_from_bulge
from sbafab.geometry.offset import Kerf, shrink, widths
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.folding import halves
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate
from sbafab.rules import registration_yield
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.limits import TOLERANCE
from sbafab.rules.measures import Measures

AGREEMENT = 2 * TOLERANCE
"""Largest distance of two contours that are each within TOLERANCE of the expected one, mm."""
DATUM = "LINE"
"""Entity of the datum cross, the only one in a layer file beside its contours."""


@dataclass(frozen=True)
class CutPart:
    """The part defined by a cut file: ``region`` without the kerf, round contours as circles.

    ``departure`` describes the deviation of the file's path from the design's; empty within 1 um,
    and ``region`` is then the design's layer. ``properties`` and ``units`` are empty if the file
    does not state them.
    """

    region: Region
    departure: str
    properties: Mapping[str, str]
    units: str = "mm"


# The layers as read.


def expected_laminate(build: Build) -> Laminate:
    """Return the laminate of a build; with chords, the laminate that these cut."""
    return as_cut(build) if build.curves.in_chords else build.laminate


def read_layers(
    folder: Path, build: Build, expected: Laminate
) -> tuple[dict[int, CutPart], list[Finding]]:
    """Read the file of every layer of the ``expected`` laminate, equal files once; return the parts
    by layer, and problems.

    A contour that agrees with the design's is replaced by it: programs that save a file again round
    its coordinates, and rules would take the gap between two such edges for a bond or a leak.
    """
    read: dict[tuple[str, str, str], CutPart] = {}
    parts: dict[int, CutPart] = {}
    bare: dict[int, str] = {}
    misstated: dict[str, list[int]] = {}
    problems: list[Finding] = []
    contours_designed = {c.marks: c for layer in expected.layers for c in layer.profile.contours}
    for layer, designed in zip(expected.layers, build.laminate.layers, strict=True):
        cut, material = expected.layer(expected.cut_with(layer)), layer.film.material
        name = layer_path(cut.name, build.settings.kerf_width(material))
        pattern = build.laminate.layer(cut.index).pattern
        properties = file_properties(build.settings, material, pattern)
        where = f"layer {layer.index} ({name})"
        try:
            key = sound_digest(folder / name), material, layer.profile.key
            if key not in read:
                beam = build.paths[designed.pattern]
                part = read_part(folder / name, properties, layer.profile, beam)
                read[key] = _snapped(part, contours_designed.values()) if part.departure else part
        except OutputError as error:
            message = f"{where}: {reason_of(error, name)}"
            problems.append(problem(INTEGRITY, message, (layer.index,)))
            continue
        part = parts[layer.index] = read[key]
        if part.departure:
            message = f"{where} is not what design.toml makes: {part.departure}"
            problems.append(problem(DESIGNED, f"{message}; regenerate the folder", (layer.index,)))
        if not part.properties:
            bare[layer.index] = name
            continue
        for difference in property_differences(part.properties, properties):
            misstated.setdefault(difference, []).append(layer.index)
    return parts, [*problems, *_property_problems(parts, bare, misstated)]


def _property_problems(
    parts: Mapping[int, CutPart], bare: Mapping[int, str], misstated: Mapping[str, Sequence[int]]
) -> Iterator[Finding]:
    """Yield files without custom properties, and groups of files with different values."""
    if bare:
        names = [*bare.values()]
        of = f"the files of {len(bare)} layers" if len(bare) > 1 else f"the file {names[0]}"
        has_units = all(parts[index].units for index in bare)
        lost = "custom properties" if has_units else "custom properties and no units"
        message = (
            f"{of} carry no {lost}: save as DXF R2004 or later to keep them; kerf, waivers and "
            "curves are taken to be as the design tells"
        )
        yield problem(CLAIMS, message, [*bare], "warn")
    for message, indices in misstated.items():
        shown = ", ".join(map(str, indices[:5])) + (" ..." if len(indices) > 5 else "")
        plural = "layers" if len(indices) > 1 else "layer"
        yield problem(CLAIMS, f"{plural} {shown}: {message}", indices)


def property_differences(actual: Mapping[str, str], expected: Mapping[str, str]) -> list[str]:
    """Return the custom properties of a file that differ from the expected ones."""
    return [
        f"custom property {name} is {actual.get(name)!r}, not {expected.get(name)!r}"
        for name in dict.fromkeys((*expected, *actual))
        if actual.get(name) != expected.get(name)
    ]


def _snapped(part: CutPart, designed: Iterable[Contour]) -> CutPart:
    """Return a part with each contour that agrees with a ``designed`` one replaced by it."""
    snapped = (
        next((like for like in designed if _agree(contour, like)), contour)
        for contour in part.region.contours
    )
    return replace(part, region=Region(tuple(snapped)))


def _agree(contour: Contour, designed: Contour) -> bool:
    bounds = zip(contour.bounds, designed.bounds, strict=True)
    if contour.is_hole != designed.is_hole or any(abs(a - b) > AGREEMENT for a, b in bounds):
        return False
    return not departure(Region((contour,)), Region((designed,)), AGREEMENT)


def departure(path: Region, expected: Region, tolerance: float = TOLERANCE) -> str:
    """Return the difference of a read-back path from the expected one; "" within 1 um."""
    try:
        check_contours(path, expected, tolerance)
    except OutputError as error:
        return str(error).rstrip(".")
    return ""


def laminate_as_cut(parts: Mapping[int, CutPart], laminate: Laminate) -> Laminate:
    """Return the design's laminate with each layer as cut; layers of equal shape share a pattern.

    Every file must have been read.
    """
    if not any(part.departure for part in parts.values()):
        return laminate
    roots = {fold.lower for fold in laminate.folds}
    folded = roots | {fold.upper for fold in laminate.folds}
    patterns: dict[tuple[str, str, int, bool], str] = {}
    layers = []
    for layer in laminate.layers:
        part = parts[layer.index]
        region = part.region
        if part.departure:
            # As assembled: turned over, or its half of a folded film.
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


def path_in_folder(folder: Path, file: str | None) -> Path:
    """Return the path of a file of the manifest. Raises OutputError if it is outside the folder."""
    if file is None:
        raise OutputError("the manifest has no cut file for it; regenerate the folder")
    pure = PurePosixPath(file)
    if pure.is_absolute() or ".." in pure.parts or "\\" in file or "\0" in file:
        raise OutputError("its path leaves the folder; regenerate the folder")
    return folder / pure


def read_part(path: Path, properties: Mapping[str, str], profile: Region, beam: Region) -> CutPart:
    """Return the part in a cut file. Raises OutputError if the file is invalid.

    ``profile`` and ``beam`` are the design's layer and the beam's path for it; ``properties`` are
    used if the file has none.
    """
    try:
        drawing = read_profile(path)
        _check_drawn(drawing)
        kerf = kerf_of(drawing.properties or properties) or 0.0
        # A path within tolerance needs no estimate of the part that the beam leaves.
        off = departure(drawing.region, beam)
        region = _without_kerf(drawing.region, kerf) if off else profile
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"has no valid contours ({error}); regenerate it") from error
    return CutPart(region, off, drawing.properties, drawing.units)


def _without_kerf(path: Region, kerf: Kerf) -> Region:
    """Return the part left by a beam along a path. Raises OutputError if none is left, or if the
    beam has two widths, which only the design distinguishes.
    """
    if isinstance(kerf, tuple) and kerf[0] != kerf[1]:
        raise OutputError("its path differs from the design's, and the kerf has two widths")
    region = with_circles(_without_specks(shrink(with_circles(path), max(widths(kerf)) / 2)))
    if region.is_empty:
        raise OutputError(f"nothing is left inside a kerf of {kerf_text(kerf)} mm; regenerate it")
    return region


def _check_drawn(drawing: ReadBack) -> None:
    if drawing.region.is_empty:
        raise OutputError(f"no contour on {CUT_INNER} or {CUT_OUTER}; regenerate it")
    for kind in drawing.other:
        if kind != DATUM:
            raise OutputError(
                f"a {kind} lies on a layer other than {CUT_INNER} and {CUT_OUTER}, so it would "
                "be cut out of order; move it"
            )
    check_datum(drawing)
    check_sequence(drawing)


def read_seams(
    folder: Path, designed: Sequence[Seam], settings: CutSettings
) -> tuple[tuple[Seam, ...], list[Finding]]:
    """Return the seams as drawn in their files, and problems.

    A path within a micrometre of the design's is replaced by it. Each seam lies on its tool's path
    when the machine's head follows the file; the design states the tool's offset from the head.
    """
    seams: list[Seam] = []
    problems: list[Finding] = []
    for seam in designed:
        file = seam_path(seam)
        try:
            sound_digest(folder / file)
            chains, properties = read_seam(folder / file)
        except OutputError as error:
            message = f"seam {seam.name} ({file}): {reason_of(error, file)}"
            problems.append(problem(INTEGRITY, message))
            continue
        layers = (seam.below, seam.above)
        for difference in property_differences(properties, seam_properties(seam, settings)):
            message = f"seam {seam.name} ({file}): {difference}"
            problems.append(problem(CLAIMS, message, layers))
        drawn = moved(chains, settings.seam_offsets.get(seam.tool, CENTRED))
        mismatch = path_difference(drawn, seam.path)
        as_drawn = seam if mismatch is None else replace(seam, path=drawn)
        width = stated_width(properties)
        if width is not None and abs(width - seam.width) > TOLERANCE:
            as_drawn = replace(as_drawn, width=width)
            mismatch = mismatch or f"{WIDTH} is {width:g} mm, not {seam.width:g}"
        if mismatch is not None:
            message = f"seam {seam.name} is not what design.toml makes: {mismatch}"
            problems.append(problem(DESIGNED, f"{message}; regenerate the folder", layers))
        seams.append(as_drawn)
    return tuple(seams), problems


# Contours without what saving and cutting leave.


def with_circles(region: Region) -> Region:
    """Return the region with circles for contours within TOLERANCE of one."""
    return Region(tuple(map(_rounded, region.contours)))


def _rounded(contour: Contour) -> Contour:
    low_x, low_y, high_x, high_y = contour.bounds
    if contour.circle is not None or abs(high_x - low_x - high_y + low_y) > 2 * AGREEMENT:
        return contour
    centre = centroid(Region((contour,)))
    least = min(math.dist(edge.nearest(centre), centre) for edge in contour.edges)
    most = max(edge.farthest_from(centre) for edge in contour.edges)
    if most - least > 2 * TOLERANCE:
        return contour
    whole = circle(centre, (least + most) / 2)
    return whole.reversed() if contour.is_hole else whole


def _without_specks(region: Region) -> Region:
    """Return the region without edges shorter than AGREEMENT, which rounded corners leave."""
    return Region(tuple(map(_without_contour_specks, region.contours)))


def _without_contour_specks(contour: Contour) -> Contour:
    edges = [edge for edge in contour.edges if math.dist(edge.start, edge.end) >= AGREEMENT]
    if len(edges) == len(contour.edges) or len(edges) < 3:
        return contour
    ends = [edge.start for edge in (*edges[1:], edges[0])]
    return Contour(
        tuple(
            edge if edge.end == end else edge_from_bulge(edge.start, end, edge.bulge)
            for edge, end in zip(edges, ends, strict=True)
        )
    )


# Laminates cut in chords, against their limits.


def refuse_coarse(build: Build) -> None:
    """Raise DesignError if a laminate cut in chords fails a rule other than the yield."""
    error = build.curves.chord_error
    try:
        measures = Measures(as_cut(build), build.design)
        rules = (rule for rule in RULES if rule.name != registration_yield.NAME)
        findings = (finding for rule in rules for finding in run_rule(rule, measures))
        failed = next((finding for finding in findings if finding.verdict == "fail"), None)
    except (OutputError, GeometryError) as failure:
        raise DesignError(_refusal(error, f"leave no valid contours: {failure}")) from failure
    if failed is not None:
        raise DesignError(_refusal(error, f"break {failed.rule}: {failed.message}"))


def _refusal(error: float, why: str) -> str:
    return (
        f"chords within {error:g} mm {why}; take a smaller --chord-error, or true arcs with "
        "--dxf-profile bulges or arcs"
    )


def as_cut(build: Build) -> Laminate:
    """Return the laminate of the parts left by a beam along the paths of a build."""
    parts = {}
    for layer in build.laminate.layers:
        path = build.paths[layer.pattern]
        check_clear(path.contours)
        region = _without_kerf(path, build.settings.kerf_width(layer.film.material) or 0.0)
        parts[layer.index] = CutPart(region, "drawn in chords", {})
    return laminate_as_cut(parts, build.laminate)
