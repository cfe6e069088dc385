"""Whether two files hold the same: bytes first, then what a reader takes from them.

Bytes may differ where another program has saved a drawing, or another version of a library has
made a mesh or a picture, and nothing differs that is cut, pressed or read.
"""

from __future__ import annotations

import base64
import csv
import json
import math
import re
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from sbafab.as_built.cut_files import sound_digest
from sbafab.as_built.meshes import mesh_difference
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.verify import TOLERANCE, check_contours
from sbafab.errors import OutputError

SHARE, LEAST = 1e-6, 1e-6
"""Numbers that differ by less, relatively or at all, say the same: libraries round otherwise."""
GREY = 1.0
"""Mean difference of two pictures, of 255 levels, that antialiasing may make."""
SEEN, FEW = 48, 2e-4
"""A pixel that differs by as much is seen; that share of them may be."""
UNREADABLE = (ValueError, LookupError, ArithmeticError, RecursionError, csv.Error)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
PICTURE = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")
LONGEST_SHOWN = 40


def file_difference(found: Path, meant: Path, name: str) -> str:
    """What differs between a file and what it should be, in a sentence; empty where nothing does.

    ``name`` is what the sentence calls the file.
    """
    data, wanted = found.read_bytes(), meant.read_bytes()
    if data == wanted:
        return ""
    try:
        said = _readers()[meant.suffix](found, meant)
    except (
        OutputError,
        ValueError,
        LookupError,
        ArithmeticError,
        RecursionError,
        csv.Error,
    ) as error:
        said = f"it cannot be read ({error})"
    return f"{name} is not what design.toml makes: {said}" if said else ""


def index_difference(found: Any, meant: Any, left_out: Collection[str]) -> str:
    """Where a manifest differs from one, but for the keys left out; empty where nowhere."""
    if not isinstance(found, dict):
        return "it is no index"
    own, wanted = (
        {key: value for key, value in index.items() if key not in left_out}
        for index in (found, meant)
    )
    return _value_difference(own, wanted, "")


def _readers() -> dict[str, Callable[[Path, Path], str]]:
    return {
        ".json": _json_difference,
        ".dxf": _drawing_difference,
        ".png": lambda found, meant: _picture_difference(found.read_bytes(), meant.read_bytes()),
        ".csv": _table_difference,
        ".pdf": lambda found, meant: "it shows something else",
        **dict.fromkeys((".svg", ".toml", ".html", ENDING), _text_difference),
        **dict.fromkeys((".stl", ".3mf", ".glb"), mesh_difference),
    }


def _text(path: Path) -> str:
    with path.open(encoding="utf-8", newline="") as file:
        return file.read()


def _json_difference(found: Path, meant: Path) -> str:
    own, wanted = (json.loads(_text(path)) for path in (found, meant))
    return _value_difference(own, wanted, "")


def _table_difference(found: Path, meant: Path) -> str:
    """Where two tables differ, by row and column; rows are counted below the columns' names."""
    own, wanted = ([*csv.reader(_text(path).splitlines(True))] for path in (found, meant))
    if own[:1] != wanted[:1]:
        names, others = (", ".join(row) for table in (own, wanted) for row in table[:1] or [[]])
        return f"its columns are {_shown(names)}, not {_shown(others)}"
    if len(own) != len(wanted):
        return f"it has {_rows(len(own) - 1)}, not {len(wanted) - 1}"
    for number, (row, other) in enumerate(zip(own[1:], wanted[1:], strict=True), start=1):
        if len(row) != len(other):
            return f"row {number} has {len(row)} cells, not {len(other)}"
        for name, cell, meant_cell in zip(wanted[0], row, other, strict=True):
            said = _value_difference(cell, meant_cell, f"row {number}, column {name}")
            if said:
                return said
    return ""


def _rows(count: int) -> str:
    return f"{count} row{'' if count == 1 else 's'}"


def _value_difference(found: Any, meant: Any, where: str) -> str:
    if isinstance(meant, dict) and isinstance(found, dict):
        for key in meant | found:
            if key not in found or key not in meant:
                return f"{where}{key} is {'missing' if key not in found else 'one too many'}"
            said = _value_difference(found[key], meant[key], f"{where}{key}.")
            if said:
                return said
        return ""
    if isinstance(meant, list) and isinstance(found, list):
        if len(meant) != len(found):
            return f"{where.rstrip('.')} has {len(found)} entries, not {len(meant)}"
        pairs = zip(found, meant, strict=True)
        told = (_value_difference(*pair, f"{where}{n}.") for n, pair in enumerate(pairs, start=1))
        return next(filter(None, told), "")
    if _is_number(meant) and _is_number(found):
        same = _alike(float(found), float(meant))
    elif isinstance(meant, str) and isinstance(found, str):
        same = not _words_difference(found, meant)
    else:
        same = type(found) is type(meant) and found == meant
    return "" if same else f"{where.rstrip('.')} is {_shown(found)}, not {_shown(meant)}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _alike(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=SHARE, abs_tol=LEAST)


def _shown(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _text_difference(found: Path, meant: Path) -> str:
    own, wanted = _text(found), _text(meant)
    pictures, others = PICTURE.findall(own), PICTURE.findall(wanted)
    if len(pictures) != len(others):
        return f"it has {len(pictures)} pictures, not {len(others)}"
    for number, (one, other) in enumerate(zip(pictures, others, strict=True), start=1):
        said = _picture_difference(base64.b64decode(one), base64.b64decode(other))
        if said:
            return f"picture {number}: {said}"
    return _words_difference(PICTURE.sub("", own), PICTURE.sub("", wanted))


def _words_difference(found: str, meant: str) -> str:
    """The first word or number that differs; how texts are broken into lines does not count."""
    own, wanted = [*_tokens(found)], [*_tokens(meant)]
    for one, other in zip(own, wanted, strict=False):
        if one != other and not (
            NUMBER.fullmatch(one) and NUMBER.fullmatch(other) and _alike(float(one), float(other))
        ):
            return f"{_shown(one)} stands where {_shown(other)} should"
    if len(own) != len(wanted):
        return f"it has {len(own)} words and numbers, not {len(wanted)}"
    return ""


def _tokens(text: str) -> Iterator[str]:
    last = 0
    for match in NUMBER.finditer(text):
        yield from text[last : match.start()].split()
        yield match[0]
        last = match.end()
    yield from text[last:].split()


def _picture_difference(found: bytes, meant: bytes) -> str:
    """Pixels are compared, so that another library's compression is no difference."""
    import numpy as np
    from PIL import Image, UnidentifiedImageError

    try:
        own, wanted = (
            np.asarray(Image.open(BytesIO(data)).convert("RGBA"), dtype=np.int16)
            for data in (found, meant)
        )
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        return f"it is no sound picture ({error})"
    if own.shape != wanted.shape:
        return f"it measures {own.shape[1]} x {own.shape[0]} pixels"
    off = np.abs(own - wanted).max(axis=2)
    seen = np.argwhere(off >= SEEN)
    if off.mean() > GREY or len(seen) > FEW * off.size:
        y, x = seen[0] if len(seen) else np.unravel_index(int(off.argmax()), off.shape)
        return f"pixels differ, as at {x}, {y}"
    return ""


def _drawing_difference(found: Path, meant: Path) -> str:
    """Contours, strokes and properties of two drawings."""
    sound_digest(found)
    own, wanted = read_profile(found), read_profile(meant)
    try:
        check_contours(own.region, wanted.region, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    # A version of DXF that knows no properties drops all of them, which is told once elsewhere.
    for name, value in wanted.properties.items() if own.properties else ():
        if own.properties.get(name) != value:
            return f"custom property {name} is {own.properties.get(name)!r}, not {value!r}"
    return _stroke_difference(own, wanted)


def _stroke_difference(own: ReadBack, wanted: ReadBack) -> str:
    """Engraving, parting cut, frame or datum that another drawing has, or has not."""
    left = [*wanted.strokes]
    for layer, edges in own.strokes:
        points = [edges[0].start, *(edge.end for edge in edges)]
        match = next((one for one in left if one[0] == layer and _follows(points, one[1])), None)
        if match is None:
            x, y = points[0]
            return f"the stroke on {layer} at x {x:.3f}, y {y:.3f} should not be there"
        left.remove(match)
    if left:
        (x, y) = left[0][1][0].start
        return f"the stroke on {left[0][0]} at x {x:.3f}, y {y:.3f} is missing"
    return ""


def _follows(points: list[tuple[float, float]], edges: Any) -> bool:
    wanted = [edges[0].start, *(edge.end for edge in edges)]
    return len(wanted) == len(points) and any(
        all(math.dist(p, q) <= TOLERANCE for p, q in zip(points, run, strict=True))
        for run in (wanted, wanted[::-1])
    )
