"""The layers and seams of a folder as its cut files leave them: read back, the kerf removed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from sbafab.cutting.chaining import check_clear
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.properties import (
    CUT_INNER,
    CUT_OUTER,
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
from sbafab.cutting.verify import check_contours, check_datum
from sbafab.design.records import Design
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.folders.build import Build
from sbafab.folders.differences import (
    CLAIMS,
    DESIGNED,
    INTEGRITY,
    Problem,
    check_sequence,
    sound_digest,
)
from sbafab.geometry.contour import Contour, circle
from sbafab.geometry.edges import Arc, Point, edge_from_bulge
from sbafab.geometry.offset import Kerf, shrink, widths
from sbafab.geometry.region import Region, centroid
from sbafab.laminate.folding import halves
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate, Layer
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


# The laminate of a folder's design.


class Expected(NamedTuple):
    """A layer's profile and the beam's path for it."""

    profile: Region
    path: Region


class ExpectedLaminate(NamedTuple):
    """A design's laminate, and the beam's path for each of its patterns."""

    laminate: Laminate
    paths: Mapping[str, Region]

    @property
    def layers(self) -> list[Expected]:
        """The expected layers, bottom to top."""
        layers = self.laminate.layers
        return [Expected(layer.profile, self.paths[layer.pattern]) for layer in layers]


def expected_laminate(build: Build) -> ExpectedLaminate:
    """Return the laminate and paths of a build; with chords, the laminate that these cut."""
    laminate = as_cut(build) if build.curves.in_chords else build.laminate
    return ExpectedLaminate(laminate, build.paths)


def departure(path: Region, expected: Region) -> str:
    """Return the difference of a path read back from the expected one; "" within 1 um."""
    try:
        check_contours(path, expected, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    return ""


# The layers as read.


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
    return _snapped(files, expected), problems + _property_problems(files, laminate, settings)


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


def _snapped(files: Sequence[LayerFile], expected: ExpectedLaminate) -> list[LayerFile]:
    """Return the files with contours that agree with the design's replaced by these.

    Programs that save a file again round its coordinates, and rules would take the gap between two
    such edges for a bond or a leak.
    """
    own = {contour.marks: contour for aim in expected.layers for contour in aim.profile.contours}

    def snapped(contour: Contour) -> Contour:
        return next((one for one in own.values() if _agree(contour, one)), contour)

    found = []
    for file in files:
        part = file.part
        if part is not None and not part.is_expected:
            part = replace(part, region=Region(tuple(map(snapped, part.region.contours))))
        found.append(file._replace(part=part))
    return found


def _agree(contour: Contour, other: Contour) -> bool:
    bounds = zip(contour.bounds, other.bounds, strict=True)
    if contour.is_hole != other.is_hole or any(abs(a - b) > AGREEMENT for a, b in bounds):
        return False
    try:
        check_contours(Region((contour,)), Region((other,)), AGREEMENT)
    except OutputError:
        return False
    return True


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
    return CutPart(_without_kerf(path, kerf), path, stated, units)


def _without_kerf(path: Region, kerf: Kerf) -> Region:
    """Return the part that a beam along a path leaves. Raises OutputError if none is left, or if
    the beam has two widths, which only the design tells apart.
    """
    if isinstance(kerf, tuple) and kerf[0] != kerf[1]:
        raise OutputError("cut with another path than the design's by a kerf along x and y")
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
                "not be cut in its turn; move it"
            )
    check_datum(drawing)
    check_sequence(drawing)


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


# Contours without what saving and cutting leave.


def with_circles(region: Region) -> Region:
    """Return the region with circles for contours that stay within TOLERANCE of one."""
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


# Runs of chords that stand for an arc: detected where chords are not permitted, and replaced.


ON_CIRCLE = 1e-5
"""Largest distance of the ends of chords from their circle, mm."""
MIN_CHORDS = 5
MAX_STEP = math.radians(20)
"""MIN_CHORDS or more chords on one circle, each turning less than this, replace an arc."""


class ChordRun(NamedTuple):
    """Consecutive chords of one circle: their ends, and the circle."""

    points: tuple[Point, ...]
    centre: Point
    radius: float


def chords_for_arc(region: Region) -> Point | None:
    """Return the start of a run of chords that replaces an arc, or None."""
    for contour in region.contours:
        for run in _runs(_line_starts(contour)):
            if len(run.points) > MIN_CHORDS:
                return run.points[0]
    return None


def _line_starts(contour: Contour) -> list[Point]:
    """Return the starts of the contour's lines; an arc adds a point that lies on no circle."""
    points: list[Point] = []
    for edge in contour.edges:
        points.append(edge.start)
        if isinstance(edge, Arc):
            points.append((math.nan, math.nan))
    return points


def _runs(points: list[Point]) -> Iterator[ChordRun]:
    """Yield the longest runs of at least three short chords on one circle, turning one way."""
    count = len(points)
    if count < 4:
        return
    first = next((i for i in range(count) if not _on_one_circle(points, i - 1)), None)
    if first is None:
        fitted = _circle(points[0], points[count // 3], points[2 * count // 3])
        if fitted is not None:
            yield ChordRun((*points, points[0]), *fitted)
        return
    # No run reaches over both ends of this ring, whose first chord comes again as its last.
    ring = [points[(first + i) % count] for i in range(count + 2)]
    start, last = 0, count + 1
    while start + 2 <= last:
        end = start + 2
        while end + 1 <= last and _on_one_circle(ring, end - 2):
            end += 1
        run = tuple(ring[start : end + 1])
        fitted = _circle(run[0], run[len(run) // 2], run[-1])
        if fitted is None or len(run) < 4:
            start += 1
            continue
        if start == 0:
            last -= 1
        yield ChordRun(run, *fitted)
        start = end


def _on_one_circle(points: list[Point], first: int) -> bool:
    """Return True if four points from ``first`` on are ends of short chords of one circle."""
    a, b, c, d = (points[(first + i) % len(points)] for i in range(4))
    fitted = _circle(a, b, c)
    if fitted is None or _angle_between(a, b, c) * _angle_between(b, c, d) <= 0:
        return False
    centre, radius = fitted
    longest = max(math.dist(a, b), math.dist(b, c), math.dist(c, d))
    return abs(math.dist(d, centre) - radius) < ON_CIRCLE and _is_short(longest, radius)


def _is_short(length: float, radius: float) -> bool:
    """Return True if a chord is short enough on its circle to replace an arc."""
    return length < 2 * math.sin(MAX_STEP / 2) * radius


def _angle_between(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _circle(a: Point, b: Point, c: Point) -> tuple[Point, float] | None:
    """Return centre and radius of the circle through three points; None if they lie on a line."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    cross = 2 * (ux * vy - uy * vx)
    if abs(cross) < 1e-9:
        return None
    uu, vv = ux * ux + uy * uy, vx * vx + vy * vy
    x, y = (vy * uu - uy * vv) / cross, (ux * vv - vx * uu) / cross
    return (a[0] + x, a[1] + y), math.hypot(x, y)


# Laminates cut in chords, against their limits.


def refuse_coarse(build: Build) -> None:
    """Raise DesignError if a passing laminate fails a rule when its paths are cut in chords."""
    error = build.curves.chord_error
    try:
        failed = _first_failure(as_cut(build), build.design)
    except (OutputError, GeometryError) as failure:
        raise DesignError(_refusal(error, f"leave no sound contours: {failure}")) from failure
    if failed is not None:
        raise DesignError(_refusal(error, f"break {failed.rule}: {failed.message}"))


def _refusal(error: float, why: str) -> str:
    return (
        f"chords within {error:g} mm {why}; take a smaller --chord-error, or true arcs with "
        "--dxf-profile bulges or arcs"
    )


def as_cut(build: Build) -> Laminate:
    """Return the laminate of the parts that a beam along the paths of a build leaves."""
    laminate, files = build.laminate, []
    for layer in laminate.layers:
        path = build.paths[laminate.layer(laminate.cut_with(layer)).pattern]
        check_clear(path.contours)
        region = _without_kerf(path, build.settings.kerf_width(layer.film.material) or 0.0)
        files.append(LayerFile(layer, "", CutPart(region, path, {})))
    return laminate_as_cut(files, laminate)


def _first_failure(laminate: Laminate, design: Design) -> Finding | None:
    """Return the first failure that is not waived, without the yield, or None."""
    measures = Measures(laminate, design)
    return next(
        (
            finding
            for rule in RULES
            if rule.name != registration_yield.NAME
            for finding in run_rule(rule, measures)
            if finding.verdict == "fail"
        ),
        None,
    )
