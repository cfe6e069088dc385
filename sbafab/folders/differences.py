"""Problems of a folder's files, and differences of two files: bytes first, then contents.

Another program or library version may write the same contents in different bytes.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import math
import re
import tomllib
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from io import BytesIO
from itertools import zip_longest
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree.ElementTree import canonicalize
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.laser_programs import ENDING, PROGRAMS, rdworks_difference
from sbafab.cutting.verify import TOLERANCE, check_contours, check_sequence
from sbafab.errors import OutputError
from sbafab.folders.swap import CUT_FOLDERS, sound_bytes
from sbafab.geometry.edges import Edge, Point
from sbafab.meshing.surface import Surface, open_edges
from sbafab.rules.finding import Finding, Place, Verdict

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-6, 1e-6
"""Tolerances of numbers, since libraries round differently."""
GREY = 1.0
"""Mean difference of two pictures by antialiasing, of 255 levels."""
VISIBLE, VISIBLE_SHARE = 48, 2e-4
"""Visible difference of a pixel, of 255 levels, and permitted share of such pixels."""
UNREADABLE = (
    *(ValueError, LookupError, ArithmeticError, RecursionError, csv.Error, BadZipFile, OSError),
    *(NotImplementedError, SyntaxError, zlib.error),
)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
PICTURE = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")
LONGEST_SHOWN = 40

INTEGRITY = "file-integrity"
CLAIMS = "manifest-claims"
DESIGNED = "as-designed"
MAX_SHOWN = 12
"""Problems of a rule that are reported one by one."""
MAX_BYTES = 20_000_000
MAX_ENTITIES = 300_000
"""Entities and points of a cut file: more would take minutes to check."""
MARK = re.compile(rb"\n *1?0\r?\n")


def problem(
    rule: str, message: str, layers: Sequence[int] = (), verdict: Verdict = "fail"
) -> Finding:
    """Return the finding of a fault outside the rule deck, in these layers."""
    return Finding(rule, verdict, None, None, "", Place(None, tuple(layers)), message)


def findings_of(rule: str, problems: Sequence[Finding], passed: str) -> list[Finding]:
    """Return the findings of a rule: at most MAX_SHOWN problems in full, or a pass."""
    of_rule = [each for each in problems if each.rule == rule]
    if not any(each.verdict == "fail" for each in of_rule):
        of_rule.append(problem(rule, f"otherwise {passed}" if of_rule else passed, verdict="pass"))
    shown, rest = of_rule[:MAX_SHOWN], of_rule[MAX_SHOWN:]
    if rest:
        layers = dict.fromkeys(index for each in rest for index in each.where.layers)
        verdict: Verdict = "fail" if any(each.verdict == "fail" for each in rest) else "warn"
        shown.append(problem(rule, f"and {len(rest)} more like these", [*layers], verdict))
    return shown


def reason_of(error: Exception, file: str) -> str:
    """Return an error's message about a file, without the file's name."""
    return str(error).removeprefix(f"{PurePosixPath(file).name}: ")


# Files that are sound.


def sound_digest(path: Path) -> str:
    """Return the sha256 of a cut file. Raises OutputError if it is missing, unreadable or too
    large.
    """
    data = sound_bytes(path, MAX_BYTES)
    # Each mark is on a separate line, and counting lines is fast.
    is_long = data.count(b"\n") > MAX_ENTITIES
    marks = sum(1 for _ in MARK.finditer(data)) if is_long else 0
    if marks > MAX_ENTITIES:
        raise OutputError(
            f"drawn with {marks:,} entities and points; the limit is {MAX_ENTITIES:,}"
        )
    return hashlib.sha256(data).hexdigest()


# Two files compared.


SAVED_ANEW = {
    ".dxf": "same cuts to 1 um",
    **dict.fromkeys((".svg", ENDING), "same elements and values"),
    **dict.fromkeys((".stl", ".glb"), "same surfaces to 1 um"),
}
"""Sameness of cut files and meshes of which only the bytes differ, by suffix."""


def is_saved_anew(actual: Path, expected: Path) -> bool:
    """Return True if a file without a ``file_difference`` is a cut file or mesh that another
    program may save: its contours and strokes match the expected ones in order.
    """
    if actual.parent.name not in (*CUT_FOLDERS, "mesh") or actual.suffix not in SAVED_ANEW:
        return False
    if not _is_cut(actual):
        return True
    runs = (_ends(read_profile(path)) for path in (actual, expected))
    return all(math.dist(p, q) <= 2 * TOLERANCE for p, q in zip(*runs, strict=True))


def _ends(drawing: ReadBack) -> list[Point]:
    """Return two points of every contour and stroke, in the order of the file."""
    boxes = [contour.bounds for contour in drawing.region.contours]
    corners = [point for box in boxes for point in (box[:2], box[2:])]
    return [*corners, *(p for _, edges in drawing.strokes for p in (edges[0].start, edges[-1].end))]


def saved_anew(layer_of: Mapping[str, int | None]) -> list[Finding]:
    """Warnings about files saved again, one for each kind; ``layer_of`` gives their layers."""
    problems = []
    kinds: dict[str, list[str]] = {}
    for path in layer_of:
        kinds.setdefault(SAVED_ANEW[PurePosixPath(path).suffix], []).append(path)
    for sameness, paths in kinds.items():
        more = f" and {len(paths) - MAX_SHOWN} more" if len(paths) > MAX_SHOWN else ""
        message = f"saved anew by another program, {sameness}: {', '.join(paths[:MAX_SHOWN])}{more}"
        layers = tuple(index for path in paths if (index := layer_of[path]) is not None)
        problems.append(problem(CLAIMS, message, layers, "warn"))
    return problems


def file_difference(actual: Path, expected: Path, name: str) -> str:
    """Return the difference of a file from the expected one as a sentence; "" if there is none.

    ``name`` is the file's name in the sentence.
    """
    compare = _readers().get(expected.suffix)
    if expected.name.endswith(PROGRAMS["rdworks"].ending):
        compare = rdworks_difference
    try:
        difference = compare(actual, expected) if compare else "its bytes differ"
    except (OutputError, *UNREADABLE) as error:
        difference = f"it cannot be read ({error})"
    return f"{name} is not what design.toml makes: {difference}" if difference else ""


def has_lost_properties(path: Path) -> bool:
    """Return True for a sheet or plate without custom properties, which other programs drop."""
    return _is_cut(path) and not read_profile(path).properties


def unreadable(path: Path) -> str:
    """Return why a layer, sheet or plate is invalid: its file, units, contours or cutting order; ""
    if it is valid, and for other files.
    """
    if not _is_cut(path):
        return ""
    try:
        sound_digest(path)
        check_sequence(read_profile(path))
    except (OutputError, *UNREADABLE) as error:
        return reason_of(error, path.name).rstrip(".")
    return ""


def _is_cut(path: Path) -> bool:
    is_ours = path.suffix == ".dxf" and not path.name.endswith(PROGRAMS["rdworks"].ending)
    return is_ours and path.parent.name in CUT_FOLDERS


def _readers() -> dict[str, Callable[[Path, Path], str]]:
    def values(parse: Callable[[str], Any]) -> Callable[[Path, Path], str]:
        return lambda *paths: value_difference(*(parse(_text(path)) for path in paths))

    return {
        ".json": values(json.loads),
        ".csv": values(_table),
        ".toml": values(tomllib.loads),
        ".dxf": _drawing_difference,
        ".png": lambda *paths: _picture_difference(*(path.read_bytes() for path in paths)),
        **dict.fromkeys((".svg", ".html", ENDING), _text_difference),
        ".3mf": lambda here, there: value_difference(_members(here), _members(there)),
        **dict.fromkeys((".stl", ".glb"), mesh_difference),
    }


def _text(path: Path) -> str:
    with path.open(encoding="utf-8", newline="") as file:
        return file.read()


def _members(path: Path) -> dict[str, str]:
    """Return the texts in an archive by name, since compression depends on the library."""
    with ZipFile(path) as archive:
        if sum(info.file_size for info in archive.infolist()) > MAX_MESH_BYTES:
            raise OutputError(f"holds more than {MAX_MESH_BYTES:,} bytes")
        return {name: archive.read(name).decode() for name in sorted(archive.namelist())}


def _table(text: str) -> dict[str, Any]:
    """Return the rows of a CSV table by column; rows count from 1 below the column names."""
    names, *rows = [*csv.reader(text.splitlines(True))] or [[]]
    return {"columns": names, "row": [dict(zip_longest(names, row)) for row in rows]}


def value_difference(actual: Any, expected: Any, where: str = "") -> str:
    """The first difference of two JSON values, with its dotted place; "" if there is none."""
    if isinstance(expected, dict) and isinstance(actual, dict):
        for key in expected | actual:
            if key not in actual or key not in expected:
                return f"{where}{key} is {'missing' if key not in actual else 'one too many'}"
            difference = value_difference(actual[key], expected[key], f"{where}{key}.")
            if difference:
                return difference
        return ""
    if isinstance(expected, list) and isinstance(actual, list):
        if len(expected) != len(actual):
            return f"{where.rstrip('.')} has {len(actual)} entries, not {len(expected)}"
        pairs = zip(actual, expected, strict=True)
        differences = (
            value_difference(*pair, f"{where}{n}.") for n, pair in enumerate(pairs, start=1)
        )
        return next(filter(None, differences), "")
    if _is_number(expected) and _is_number(actual):
        same = _is_close(float(actual), float(expected))
    elif isinstance(expected, str) and isinstance(actual, str):
        same = not _words_difference(actual, expected)
    else:
        same = type(actual) is type(expected) and actual == expected
    return "" if same else f"{where.rstrip('.')} is {_shown(actual)}, not {_shown(expected)}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=RELATIVE_TOLERANCE, abs_tol=ABSOLUTE_TOLERANCE)


def _shown(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _text_difference(*paths: Path) -> str:
    """Return the first difference of two XML or HTML texts, ignoring comments."""
    actual, expected = map(_markup, paths)
    pictures = [[*map(base64.b64decode, PICTURE.findall(text))] for text in (actual, expected)]
    if len(pictures[0]) != len(pictures[1]):
        return f"it has {len(pictures[0])} pictures, not {len(pictures[1])}"
    for number, pair in enumerate(zip(*pictures, strict=True), start=1):
        difference = _picture_difference(*pair)
        if difference:
            return f"picture {number}: {difference}"
    return _words_difference(PICTURE.sub("", actual), PICTURE.sub("", expected))


def _markup(path: Path) -> str:
    """Return the text of a page without comments, or of XML in canonical form."""
    text = _text(path)
    if path.suffix == ".html":
        return COMMENT.sub("", text)
    return canonicalize(text, strip_text=True, rewrite_prefixes=True)


def _words_difference(actual: str, expected: str) -> str:
    """Return the first different word or number, ignoring line breaks."""
    words, expected_words = [*_tokens(actual)], [*_tokens(expected)]
    for word, expected_word in zip(words, expected_words, strict=False):
        if word != expected_word and not (
            NUMBER.fullmatch(word)
            and NUMBER.fullmatch(expected_word)
            and _is_close(float(word), float(expected_word))
        ):
            return f"{_shown(word)} stands where {_shown(expected_word)} should"
    if len(words) != len(expected_words):
        return f"it has {len(words)} words and numbers, not {len(expected_words)}"
    return ""


def _tokens(text: str) -> Iterator[str]:
    last = 0
    for match in NUMBER.finditer(text):
        yield from text[last : match.start()].split()
        yield match[0]
        last = match.end()
    yield from text[last:].split()


def _picture_difference(actual: bytes, expected: bytes) -> str:
    """Compare the pixels of two pictures, since compression depends on the library."""
    from PIL import Image, UnidentifiedImageError

    try:
        pixels, expected_pixels = (
            np.asarray(Image.open(BytesIO(data)).convert("RGBA"), dtype=np.int16)
            for data in (actual, expected)
        )
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        return f"it is not a valid picture ({error})"
    if pixels.shape != expected_pixels.shape:
        return f"it measures {pixels.shape[1]} x {pixels.shape[0]} pixels"
    difference = np.abs(pixels - expected_pixels).max(axis=2)
    if difference.mean() > GREY or (difference >= VISIBLE).mean() > VISIBLE_SHARE:
        y, x = np.unravel_index(int(difference.argmax()), difference.shape)
        return f"pixels differ, as at {x}, {y}"
    return ""


def _drawing_difference(actual: Path, expected: Path) -> str:
    """A difference of contours, strokes or properties of two drawings; "" if there is none."""
    drawing, designed = read_profile(actual), read_profile(expected)
    try:
        check_contours(drawing.region, designed.region, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    # A version of DXF that knows no properties drops all of them: see ``has_lost_properties``.
    for name, value in designed.properties.items() if drawing.properties else ():
        if drawing.properties.get(name) != value:
            return f"custom property {name} is {drawing.properties.get(name)!r}, not {value!r}"
    missing = [(layer, _points(edges)) for layer, edges in designed.strokes]
    for layer, edges in drawing.strokes:
        points = _points(edges)
        stroke = next((s for s in missing if s[0] == layer and _are_same(points, s[1])), None)
        if stroke is None:
            x, y = points[0]
            return f"the stroke on {layer} at x {x:.3f}, y {y:.3f} should not be there"
        missing.remove(stroke)
    for layer, ((x, y), *_) in missing:
        return f"the stroke on {layer} at x {x:.3f}, y {y:.3f} is missing"
    return ""


def _points(edges: Sequence[Edge]) -> list[Point]:
    return [edges[0].start, *(edge.end for edge in edges)]


def _are_same(points: Sequence[Point], points_there: Sequence[Point]) -> bool:
    """Return True if two strokes agree within the tolerance, in either direction."""
    return len(points) == len(points_there) and any(
        all(math.dist(p, q) <= TOLERANCE for p, q in zip(points, run, strict=True))
        for run in (points_there, points_there[::-1])
    )


# Surfaces read back from STL and GLB files, and compared.


POINT_TOLERANCE = 2e-5
"""Rounding error of points in single precision or with 6 decimals, mm."""
MESH_SHARE = 1e-5
"""Relative difference of volume between triangulations of one solid."""
MAX_MESH_BYTES = 500_000_000
MAX_COORDINATE = 1e5
"""Largest coordinate, mm."""


MeshBody = tuple[Surface, str]
"""A surface, and the other data of its body in the file as text."""


def mesh_difference(actual: Path, expected: Path) -> str:
    """Return a difference of two mesh files of one format; "" if their bodies are equal.

    Points, enclosed volume, area and watertightness are compared; triangles may differ.
    """
    actual_bodies, designed = bodies(actual), bodies(expected)
    if len(actual_bodies) != len(designed):
        return f"it holds {len(actual_bodies)} bodies, not {len(designed)}"
    return next(filter(None, map(_body_difference, actual_bodies, designed)), "")


def bodies(path: Path) -> list[MeshBody]:
    """Read the bodies of an STL or GLB file, mm or m. Raises OutputError for an invalid file."""
    if path.stat().st_size > MAX_MESH_BYTES:
        raise OutputError(f"larger than {MAX_MESH_BYTES:,} bytes")
    # Only a mesh that differs is read.
    import trimesh

    read: list[MeshBody] = []
    try:
        scene = trimesh.load_scene(path, process=False)
        for node in sorted(scene.graph.nodes_geometry):
            transform, name = scene.graph[node]
            mesh = scene.geometry[name]
            points, places = np.unique(np.array(mesh.vertices), axis=0, return_inverse=True)
            material = getattr(mesh.visual, "material", None)
            looks = ("name", "baseColorFactor", "roughness")
            paint = [str(getattr(material, look, None)) for look in looks]
            surface = Surface(points, places.reshape(-1)[mesh.faces])
            read.append((surface, json.dumps([node, transform.tolist(), paint])))
    except Exception as error:  # readers of libraries raise anything on a damaged file
        raise OutputError(f"not a valid mesh: {error}") from error
    return read


def _body_difference(body: MeshBody, designed: MeshBody) -> str:
    (surface, metadata), (expected, expected_metadata) = body, designed
    if metadata != expected_metadata:
        return "names, materials or scales of its bodies are others"
    if not (np.abs(surface.points) <= MAX_COORDINATE).all():
        return "it has a point that is nowhere"
    if not len(surface.faces) or len(open_edges(surface)):
        return "it is not watertight"
    for points, points_there, fault in (
        (surface.points, expected.points, "too many"),
        (expected.points, surface.points, "missing"),
    ):
        point = _unmatched_point(points, points_there)
        if point is not None:
            x, y, z = point
            return f"the point at x {x:.3f}, y {y:.3f}, z {z:.3f} is {fault}"
    for what, here, there in (
        ("mm3 inside", surface.volume, expected.volume),
        ("mm2 of surface", surface.trimesh().area, expected.trimesh().area),
    ):
        if abs(here - there) > MESH_SHARE * abs(there):
            return f"it has {here:.4f} {what}, not {there:.4f}"
    return ""


def _unmatched_point(
    points: NDArray[np.float64], reference: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return a point farther than POINT_TOLERANCE from all reference points, or None."""

    def cells(of: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(of / (4 * POINT_TOLERANCE) + shift).astype(np.int64)

    # A point and its like share a cell of one grid or of another one shifted by half a cell.
    unmatched = np.unique(points, axis=0)
    for shift in np.ndindex(2, 2, 2):
        if not len(unmatched):
            return None
        by = np.array(shift) / 2
        reference_cells = {row.tobytes() for row in cells(reference, by)}
        point_cells = cells(unmatched, by)
        unmatched = unmatched[[row.tobytes() not in reference_cells for row in point_cells]]
    stray: NDArray[np.float64] | None = unmatched[0] if len(unmatched) else None
    return stray
