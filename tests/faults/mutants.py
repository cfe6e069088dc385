"""Faults at random: one change in one file of a written folder, by the number of a draw."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any
from zipfile import ZipFile

from sbafab.meshing.formats import write_zip

Change = Callable[[bytes, Random], bytes]
NUMBER = re.compile(r"(?<![\w.#-])-?\d+(?:\.\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z]{3,}")
LAYERS = ("ENGRAVE", "CUT_INNER", "CUT_OUTER", "CUT_SHEET", "REFERENCE", "0")
HEADER_END = "  0\nENDSEC\n"


def changed_number(text: str, draw: Random) -> str:
    """A number as far off as a slip of the hand, or of a unit."""
    value = float(text)
    off = draw.choice(
        [value + 0.01, value - 0.1, value + 1, 2 * value + 1, -value - 0.5, 10 * value + 3]
    )
    return f"{off:.6f}" if "." in text else str(round(off) if round(off) != value else int(off) + 1)


def _replaced(pattern: re.Pattern[str], new: Callable[[str, Random], str]) -> Change:
    def change(data: bytes, draw: Random) -> bytes:
        text = data.decode("utf-8")
        match = draw.choice([*pattern.finditer(text)])
        return (text[: match.start()] + new(match[0], draw) + text[match.end() :]).encode()

    return change


def _other_word(word: str, draw: Random) -> str:
    n = draw.randrange(len(word))
    return word[:n] + draw.choice([c for c in "aeioxk" if c != word[n]]) + word[n + 1 :]


def without_a_line(data: bytes, draw: Random) -> bytes:
    lines = data.splitlines(keepends=True)
    lines.pop(draw.choice([n for n, line in enumerate(lines) if line.strip()]))
    return b"".join(lines)


def emptied(data: bytes, draw: Random) -> bytes:
    return b""


def cut_short(data: bytes, draw: Random) -> bytes:
    return data[: draw.randrange(len(data) // 4, len(data) - 8)]


def flipped_byte(data: bytes, draw: Random) -> bytes:
    n = draw.randrange(len(data))
    return data[:n] + bytes([data[n] ^ (1 << draw.randrange(8))]) + data[n + 1 :]


def json_leaf(data: bytes, draw: Random) -> bytes:
    """A value changed, an entry lost, doubled or out of turn."""
    document = json.loads(data)
    spots: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        keys = node if isinstance(node, dict) else range(len(node))
        for key in keys:
            spots.append((node, key))
            if isinstance(node[key], dict | list):
                walk(node[key])

    walk(document)
    node, key = draw.choice(spots)
    value = node[key]
    if isinstance(value, bool) or value is None:
        node[key] = draw.choice([1, "x", not value])
    elif isinstance(value, int | float):
        node[key] = draw.choice([value + 1, value * 1.01 + 0.01, -value - 1, None])
    elif isinstance(value, str):
        node[key] = _other_word(value, draw) if value else "x"
    elif isinstance(value, list) and len(value) > 1 and draw.random() < 0.5:
        value.insert(0, value.pop())
    elif isinstance(value, list) and value:
        draw.choice([value.pop, lambda: value.append(value[0])])()
    else:
        del node[key]
    return json.dumps(document).encode()


def _pairs(text: str) -> tuple[str, list[str], str]:
    """The text before the entities, the entities, and what follows."""
    start = text.index("  2\nENTITIES\n") + len("  2\nENTITIES\n")
    end = text.index(HEADER_END, start)
    body = text[start:end]
    return text[:start], ["  0\n" + part for part in body.split("  0\n") if part], text[end:]


def _entities(change: Callable[[list[str], Random], object]) -> Change:
    def edit(data: bytes, draw: Random) -> bytes:
        head, entities, tail = _pairs(data.decode())
        change(entities, draw)
        return (head + "".join(entities) + tail).encode()

    return edit


def _entity_number(entities: list[str], draw: Random) -> None:
    n = draw.randrange(len(entities))
    groups = [*re.finditer(r"\n ((?:10|20|11|21|40|42|50|51|30|70))\n(-?[\d.]+)\n", entities[n])]
    group = draw.choice(groups)
    new = changed_number(group[2], draw)
    entities[n] = entities[n][: group.start(2)] + new + entities[n][group.end(2) :]


def _entity_with(*groups: str) -> Callable[[list[str], Random], None]:
    def add(entities: list[str], draw: Random) -> None:
        n = draw.randrange(len(entities))
        head, layer, rest = entities[n].partition("  8\n")
        name, _, rest = rest.partition("\n")
        entities[n] = f"{head}{layer}{name}\n{draw.choice(groups)}{rest}"

    return add


def _entity_layer(entities: list[str], draw: Random) -> None:
    n = draw.randrange(len(entities))
    match = re.search(r"  8\n(\w+)\n", entities[n])
    assert match is not None
    other = draw.choice([layer for layer in LAYERS if layer != match[1]])
    entities[n] = entities[n].replace(match[0], f"  8\n{other}\n")


def _stray_line(entities: list[str], draw: Random) -> None:
    x, y, u, v = (draw.uniform(-12, 40) for _ in range(4))
    line = (
        "  0\nLINE\n  5\nFFF1\n330\n17\n100\nAcDbEntity\n"
        f"  8\n{draw.choice(LAYERS)}\n100\nAcDbLine\n"
        f" 10\n{x}\n 20\n{y}\n 30\n0.0\n 11\n{u}\n 21\n{v}\n 31\n0.0\n"
    )
    entities.insert(draw.randrange(len(entities) + 1), line)


def _entity_twice(entities: list[str], draw: Random) -> None:
    n = draw.randrange(len(entities))
    entities.insert(n, re.sub(r"\n  5\n\w+\n", "\n  5\nFFF2\n", entities[n]))


def _mirrored(entities: list[str], draw: Random) -> None:
    """All of it, as if seen from below: x the other way round, bulges too."""
    for n, entity in enumerate(entities):
        flip = lambda m: f"{m[1]}{-float(m[2])}\n"  # noqa: E731
        entities[n] = re.sub(r"(\n (?:10|11|42)\n)(-?[\d.]+)\n", flip, entity)


def layer_table(data: bytes, draw: Random) -> bytes:
    """A layer off, frozen, not plotted, of another colour or linetype."""
    text = data.decode()
    name = draw.choice(LAYERS[:5])
    match = re.search(rf"AcDbLayerTableRecord\n  2\n{name}\n 70\n0\n 62\n(\d+)\n  6\n(\w+)\n", text)
    assert match is not None
    flags, colour, line, plot = "0", match[1], match[2], ""
    which = draw.randrange(5)
    if which == 0:
        colour = f"-{colour}"
    elif which == 1:
        flags = "1"
    elif which == 2:
        plot = "290\n0\n"
    elif which == 3:
        colour = str(int(colour) % 7 + 1)
    else:
        line = "DASHED"
    record = f"AcDbLayerTableRecord\n  2\n{name}\n 70\n{flags}\n 62\n{colour}\n  6\n{line}\n{plot}"
    rest = text[match.end() :]
    if plot:
        rest = re.sub(r"^((?:(?!  0\n).*\n)*?)290\n\d\n", r"\1", rest, count=1)
    return (text[: match.start()] + record + rest).encode()


def custom_property(data: bytes, draw: Random) -> bytes:
    text = data.decode()
    match = draw.choice([*re.finditer(r"\$CUSTOMPROPERTY\n  1\n(.+)\n", text)])
    n = draw.randrange(match.start(1), match.end(1))
    return (text[:n] + draw.choice("7kQ") + text[n + 1 :]).encode()


def units(data: bytes, draw: Random) -> bytes:
    name, good = draw.choice([("INSUNITS", 4), ("MEASUREMENT", 1)])
    return re.sub(rf"(\${name}\n 70\n){good}\n".encode(), rb"\g<1>0\n", data)


def painted(data: bytes, draw: Random) -> bytes:
    from PIL import Image

    image = Image.open(BytesIO(data)).convert("RGB")
    x, y = draw.randrange(image.width - 60), draw.randrange(image.height - 60)
    image.paste((200, 30, 30), (x, y, x + 60, y + 60))
    out = BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def stl_triangle(data: bytes, draw: Random) -> bytes:
    """A triangle lost, doubled, turned over, or with a corner elsewhere."""
    import numpy as np

    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.frombuffer(data[84:], kind).copy()
    n, which = draw.randrange(len(rows)), draw.randrange(5)
    if which == 0:
        rows = np.delete(rows, n)
    elif which == 1:
        rows = np.append(rows, rows[n : n + 1])
    elif which == 2:
        rows["corners"][n] = rows["corners"][n][::-1]
    elif which == 3:
        rows["corners"][n, draw.randrange(3), draw.randrange(3)] += draw.choice([0.01, 1.0])
    else:
        rows["corners"] *= draw.choice([1.001, 25.4, -1.0])
    return data[:80] + len(rows).to_bytes(4, "little") + rows.tobytes()


def zipped_number(data: bytes, draw: Random) -> bytes:
    with ZipFile(BytesIO(data)) as archive:
        parts = {name: archive.read(name).decode() for name in archive.namelist()}
    model = parts["3D/3dmodel.model"]
    match = draw.choice([*re.finditer(r'(?<=")-?\d+(?:\.\d+)?(?=")', model)])
    new = changed_number(match[0], draw)
    parts["3D/3dmodel.model"] = model[: match.start()] + new + model[match.end() :]
    out = BytesIO()
    write_zip(out, parts)  # type: ignore[arg-type]
    return out.getvalue()


number = _replaced(NUMBER, changed_number)
word = _replaced(WORD, _other_word)
TEXT = (number, number, number, word, without_a_line, cut_short, emptied)
DRAWING = (
    *(_entities(_entity_number),) * 4,
    *(_entities(_stray_line),) * 3,
    *(layer_table,) * 3,
    *(
        _entities(change)
        for change in (
            _entity_layer,
            _entity_twice,
            _mirrored,
            lambda entities, draw: entities.pop(draw.randrange(len(entities))),
            lambda entities, draw: entities.append(entities.pop(0)),
            _entity_with(" 62\n3\n", " 62\n1\n", " 62\n5\n"),
            _entity_with(" 60\n1\n"),
            _entity_with("  6\nDASHED\n", "  6\nHIDDEN\n"),
            _entity_with("420\n65280\n"),
            _entity_with(" 67\n1\n"),
            _entity_with(" 39\n2.0\n"),
            _entity_with("370\n50\n"),
        )
    ),
    custom_property,
    units,
    number,
    without_a_line,
    cut_short,
    emptied,
)
CHANGES: dict[str, tuple[Change, ...]] = {
    ".dxf": DRAWING,
    ".json": (json_leaf, json_leaf, json_leaf, number, without_a_line, cut_short, emptied),
    **dict.fromkeys((".csv", ".svg", ".html", ".toml", ".lbrn2"), TEXT),
    ".png": (painted, painted, flipped_byte, cut_short, emptied),
    ".stl": (stl_triangle, stl_triangle, stl_triangle, cut_short, emptied),
    ".3mf": (zipped_number, zipped_number, cut_short, emptied),
    ".glb": (flipped_byte, flipped_byte, cut_short, emptied),
}
WEIGHTS = {".dxf": 12, ".json": 6, ".csv": 2, ".html": 2, ".toml": 2, ".svg": 2}
"""Of the kinds of files, what is cut and pressed is drawn most often."""


def mutated(folder: Path, number: int) -> tuple[str, bytes]:
    """The file of a folder that draw ``number`` changes, and its new contents."""
    draw = Random(number)
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix in CHANGES)
    kinds = sorted({path.suffix for path in paths})
    kind = draw.choices(kinds, [WEIGHTS.get(kind, 1) for kind in kinds])[0]
    path = draw.choice([path for path in paths if path.suffix == kind])
    data = path.read_bytes()
    change = draw.choice(CHANGES[kind])
    return path.relative_to(folder).as_posix(), change(data, draw)
