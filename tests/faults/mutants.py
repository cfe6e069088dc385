"""Faults at random: one change in one file of a written folder, by the number of a draw.

Each changes what is cut, pressed or read, so that each must be caught.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any
from zipfile import ZipFile

import numpy as np
from PIL import Image

from sbafab.meshing.formats import write_zip

Change = Callable[[bytes, Random], bytes]
Edit = Callable[[str, Random], str]
NUMBER = re.compile(r"(?<![\w.#-])-?\d+(?:\.\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z]{3,}")
PROPERTY = re.compile(r"(?<=\$CUSTOMPROPERTY\n  1\n).+(?=\n)")
CUT = ("CUT_INNER", "CUT_OUTER")
LAYERS = (*CUT, "ENGRAVE", "CUT_SHEET", "REFERENCE", "0")


def changed_number(text: str, draw: Random) -> str:
    """A number as far off as a slip of the hand, or of a unit."""
    value = float(text)
    off = draw.choice(
        [value + 0.01, value - 0.1, value + 1, 2 * value + 1, -value - 0.5, 10 * value + 3]
    )
    return (
        f"{off:.6f}"
        if "." in text
        else str(round(off) if round(off) != value else round(value) + 1)
    )


def other_letter(word: str, draw: Random) -> str:
    n = draw.randrange(len(word))
    return word[:n] + draw.choice([c for c in "aeioxk7" if c != word[n]]) + word[n + 1 :]


def of_text(edit: Edit) -> Change:
    return lambda data, draw: edit(data.decode("utf-8"), draw).encode()


def replaced(pattern: re.Pattern[str], new: Edit) -> Change:
    def change(text: str, draw: Random) -> str:
        match = draw.choice([*pattern.finditer(text)])
        return text[: match.start()] + new(match[0], draw) + text[match.end() :]

    return of_text(change)


def without_a_line(data: bytes, draw: Random) -> bytes:
    lines = data.splitlines(keepends=True)
    lines.pop(draw.choice([n for n, line in enumerate(lines) if line.strip()]))
    return b"".join(lines)


def emptied(data: bytes, draw: Random) -> bytes:
    return b""


def cut_short(data: bytes, draw: Random) -> bytes:
    return data[: draw.randrange(len(data) // 4, len(data) - 8)]


def json_leaf(data: bytes, draw: Random) -> bytes:
    """A value changed or lost."""
    document = json.loads(data)
    spots: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        for key in node if isinstance(node, dict) else range(len(node)):
            spots.append((node, key))
            if isinstance(node[key], dict | list):
                walk(node[key])

    walk(document)
    node, key = draw.choice(spots)
    value = node[key]
    if isinstance(value, str) and value:
        node[key] = other_letter(value, draw)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        node[key] = draw.choice([value + 1, value * 1.01 + 0.01, -value - 1, None])
    elif isinstance(value, list) and value:
        draw.choice([value.pop, lambda: value.append(value[0])])()
    elif isinstance(node, dict) and draw.random() < 0.5:
        del node[key]
    else:
        node[key] = "x"
    return json.dumps(document).encode()


# Drawings.


def on_entities(change: Callable[[list[str], int, Random], object]) -> Change:
    """A change of the entities, told the place of one that is cut."""

    def edit(text: str, draw: Random) -> str:
        head, mark, rest = text.partition("  2\nENTITIES\n")
        body, end, tail = rest.partition("  0\nENDSEC\n")
        entities = ["  0\n" + part for part in body.split("  0\n") if part]
        of_cuts = [n for n, text in enumerate(entities) if layer_of(text) in CUT]
        change(entities, draw.choice(of_cuts or [*range(len(entities))]), draw)
        return head + mark + "".join(entities) + end + tail

    return of_text(edit)


def layer_of(entity: str) -> str:
    match = re.search(r"  8\n(\w+)\n", entity)
    assert match is not None
    return match[1]


def entity_number(entities: list[str], n: int, draw: Random) -> None:
    groups = [*re.finditer(r"\n ((?:10|20|11|21|40|42|50|51|30|70))\n(-?[\d.]+)\n", entities[n])]
    group = draw.choice(groups)
    start, end = group.span(2)
    # A bulge a little off leaves a short edge where it was.
    new = f"{float(group[2]) + 0.5}" if group[1] == "42" else changed_number(group[2], draw)
    entities[n] = entities[n][:start] + new + entities[n][end:]


def entity_with(*groups: str) -> Callable[[list[str], int, Random], None]:
    """An attribute of its own, unlike its layer's."""

    def add(entities: list[str], n: int, draw: Random) -> None:
        layer = f"  8\n{layer_of(entities[n])}\n"
        entities[n] = entities[n].replace(layer, layer + draw.choice(groups), 1)

    return add


def entity_layer(entities: list[str], n: int, draw: Random) -> None:
    own = layer_of(entities[n])
    other = draw.choice([layer for layer in LAYERS if layer != own])
    entities[n] = entities[n].replace(f"  8\n{own}\n", f"  8\n{other}\n")


def stray_line(entities: list[str], n: int, draw: Random) -> None:
    x, y, u, v = (draw.uniform(-12, 40) for _ in range(4))
    line = (
        "  0\nLINE\n  5\nFFF1\n330\n17\n100\nAcDbEntity\n"
        f"  8\n{draw.choice(LAYERS)}\n100\nAcDbLine\n"
        f" 10\n{x}\n 20\n{y}\n 30\n0.0\n 11\n{u}\n 21\n{v}\n 31\n0.0\n"
    )
    entities.insert(draw.randrange(len(entities) + 1), line)


def entity_twice(entities: list[str], n: int, draw: Random) -> None:
    entities.insert(n, re.sub(r"\n  5\n\w+\n", "\n  5\nFFF2\n", entities[n]))


def layer_table(text: str, draw: Random) -> str:
    """A layer that is cut off, frozen, not plotted, of another colour or linetype."""
    used = [layer for layer in CUT if f"  8\n{layer}\n" in text.partition("  2\nENTITIES\n")[2]]
    name = draw.choice(used or ["REFERENCE"])
    match = re.search(rf"AcDbLayerTableRecord\n  2\n{name}\n 70\n0\n 62\n(\d+)\n  6\n(\w+)\n", text)
    assert match is not None
    old, colour = match[0], match[1]
    new = draw.choice(
        [
            old.replace(f" 62\n{colour}", f" 62\n-{colour}"),
            old.replace(" 70\n0", " 70\n1"),
            f"{old}290\n0\n",
            old.replace(f" 62\n{colour}", f" 62\n{int(colour) % 7 + 1}"),
            old.replace(f"  6\n{match[2]}", "  6\nDASHED"),
        ]
    )
    rest = text[match.end() :]
    if new.endswith("290\n0\n"):
        rest = re.sub(r"^((?:(?!  0\n).*\n)*?)290\n\d\n", r"\1", rest, count=1)
    return text[: match.start()] + new + rest


def units(data: bytes, draw: Random) -> bytes:
    name, good = draw.choice([("INSUNITS", 4), ("MEASUREMENT", 1)])
    return re.sub(rf"(\${name}\n 70\n){good}\n".encode(), rb"\g<1>0\n", data)


# Pictures and meshes.


def painted(data: bytes, draw: Random) -> bytes:
    image = Image.open(BytesIO(data)).convert("RGB")
    x, y = draw.randrange(image.width - 60), draw.randrange(image.height - 60)
    image.paste((200, 30, 30), (x, y, x + 60, y + 60))
    out = BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def stl_triangle(data: bytes, draw: Random) -> bytes:
    """A triangle lost, doubled, turned over, or with a corner elsewhere."""
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


number, word = replaced(NUMBER, changed_number), replaced(WORD, other_letter)
BROKEN = (cut_short, emptied)
TEXT = (number, number, number, word, without_a_line, *BROKEN)
DRAWING = (
    *(on_entities(entity_number),) * 4,
    *(on_entities(stray_line),) * 3,
    *(of_text(layer_table),) * 3,
    on_entities(entity_layer),
    on_entities(entity_twice),
    on_entities(lambda entities, n, draw: entities.pop(n)),
    on_entities(entity_with(" 62\n3\n", " 62\n4\n", " 62\n6\n", "420\n65280\n")),
    on_entities(entity_with(" 60\n1\n", " 67\n1\n")),
    on_entities(entity_with("  6\nDASHED\n", "  6\nHIDDEN\n")),
    replaced(PROPERTY, other_letter),
    units,
    *BROKEN,
)
CHANGES: dict[str, tuple[Change, ...]] = {
    ".dxf": DRAWING,
    ".json": (json_leaf, json_leaf, json_leaf, number, without_a_line, *BROKEN),
    **dict.fromkeys((".csv", ".svg", ".html", ".toml", ".lbrn2"), TEXT),
    ".png": (painted, painted, *BROKEN),
    ".stl": (stl_triangle, stl_triangle, stl_triangle, *BROKEN),
    ".3mf": (zipped_number, zipped_number, *BROKEN),
    ".glb": BROKEN,
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
    change = draw.choice(CHANGES[kind])
    return path.relative_to(folder).as_posix(), change(path.read_bytes(), draw)
