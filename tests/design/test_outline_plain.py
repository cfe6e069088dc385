"""Plain drawings are read as ezdxf reads them; all others are left to ezdxf.

``SBAFAB_PLAIN_CHANGES`` sets how many changed files are read both ways.
"""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from sbafab.design.outline import read_outline
from sbafab.design.outline_dxf import dxf_strands, strands_by_ezdxf
from sbafab.design.outline_plain import as_plain
from sbafab.errors import DesignError
from tests.design.drawing import dxf

CHANGES = int(os.environ.get("SBAFAB_PLAIN_CHANGES", "60"))
VERSIONS = ("R2000", "R2004", "R2007", "R2010", "R2013", "R2018")


def told(path: Path, by_ezdxf: bool) -> object:
    try:
        traced = strands_by_ezdxf(path, path.read_bytes()) if by_ezdxf else dxf_strands(path)
        return traced.scale, list(traced.strands)
    except DesignError as error:
        return str(error)


def drawn(chance: random.Random) -> str:
    """A file of a few plain entities, with what other entities and layers may say of them."""
    document = ezdxf.new(chance.choice(VERSIONS), units=chance.choice((0, 1, 4, 4, 5, 6)))
    document.layers.add("OUTLINE", color=chance.randrange(1, 8))
    space = document.modelspace()

    def number(least: float = -20.0) -> float:
        return round(chance.uniform(least, 20.0), chance.randrange(17))

    for _ in range(chance.randrange(1, 5)):
        looks = {"layer": chance.choice(("0", "OUTLINE", "no layer")), "color": 3}
        match chance.randrange(4):
            case 0:
                space.add_line((number(), number()), (number(), number()), looks)
            case 1:
                space.add_circle((number(), number()), number(0.0), looks)
            case 2:
                angles = 9 * number(), 9 * number()
                space.add_arc((number(), number()), number(0.0), *angles, dxfattribs=looks)
            case _:
                points = [(number(), number(), number() / 9) for _ in range(chance.randrange(2, 6))]
                closed = chance.random() < 0.5
                space.add_lwpolyline(points, "xyb", close=closed, dxfattribs=looks)
    stream = StringIO()
    document.write(stream)
    return stream.getvalue()


def drawn_part(text: str) -> tuple[str, str]:
    """What stands before the tables, and the entities."""
    header, _, rest = text.partition("\nTABLES\n")
    return header, rest.partition("\nENTITIES\n")[2].partition("\nENDSEC\n")[0]


def changed(text: str, chance: random.Random) -> str:
    """A line changed: a digit, another line in its place, none, twice, or two exchanged."""
    lines = text.split("\n")
    start, end = 0, len(lines) - 1
    if chance.random() < 0.7:
        start = lines.index(chance.choice(("ENTITIES", "ENTITIES", "TABLES", "BLOCKS", "OBJECTS")))
        end = lines.index("ENDSEC", start)
    at = chance.randrange(start, end)
    # A tag is two lines.
    tag = at - at % 2
    match chance.randrange(7):
        case 0:
            at = chance.choice([i for i in range(start, end) if re.search(r"\d", lines[i])])
            place = chance.choice([i for i, c in enumerate(lines[at]) if c.isdigit()])
            lines[at] = lines[at][:place] + chance.choice("0123456789") + lines[at][place + 1 :]
        case 1:
            lines[at] = chance.choice([*lines[start:end], "0.0", "-1", " 60", "ABC", "330", ""])
        case 2:
            del lines[tag : tag + chance.choice((1, 2, 2, 4))]
        case 3:
            lines[tag:tag] = lines[tag : tag + chance.choice((1, 2, 2, 4))]
        case 4:
            other = chance.randrange(start, end)
            lines[at], lines[other] = lines[other], lines[at]
        case 5:
            extra = chance.choice(
                ("60\n1", "67\n1", " 62\n-3", " 70\n1", "38\n1", "230\n-1", "999\nx")
            )
            lines[tag:tag] = extra.split("\n")
        case _:
            other = chance.randrange(start, end) & ~1
            moved = lines[other : other + 2]
            del lines[other : other + 2]
            lines[tag:tag] = moved
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("AcDbEntity\n  8\nOUTLINE\n", "AcDbEntity\n  8\nOUTLINE\n 60\n1\n"),
        ("AcDbEntity\n  8\nOUTLINE\n", "AcDbEntity\n 67\n1\n  8\nOUTLINE\n"),
        ("  2\nOUTLINE\n 70\n0\n", "  2\nOUTLINE\n 70\n1\n"),
        ("  2\nOUTLINE\n 70\n0\n 62\n7\n", "  2\nOUTLINE\n 70\n0\n 62\n-7\n"),
        (" 10\n1.0\n 20\n2.0\n 30\n0.0\n", " 10\n1.0\n 20\n2.0\n 30\n0.5\n"),
        (" 40\n3.0\n", " 40\n3.0\n210\n0.0\n220\n0.0\n230\n-1.0\n"),
        (" 40\n3.0\n", " 40\n3.0\n 40\n4.0\n"),
        ("  0\nCIRCLE\n", "  0\nTEXT\n"),
        ("  1\nAC1024\n", "  1\nAC1014\n"),
        ("OUTLINE", "Umriß"),
    ],
)
def test_what_is_not_plain_is_left_to_ezdxf(old: str, new: str, tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        space.doc.layers.add("OUTLINE")
        space.add_circle((1, 2), 3, {"layer": "OUTLINE"})

    path = dxf(tmp_path, draw)
    text = path.read_text()
    assert old in text
    assert as_plain(path.read_bytes()) is not None
    assert as_plain(text.replace(old, new).encode()) is None


def test_a_plain_outline_needs_no_ezdxf(tmp_path: Path) -> None:
    path = dxf(tmp_path, lambda space: space.add_circle((1, 2), 3))
    program = (
        "import pathlib, sys; from sbafab.design.outline import read_outline\n"
        f"read_outline(pathlib.Path({str(path)!r}))\n"
        "sys.exit('ezdxf' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)


def test_a_block_among_the_entities_is_refused(tmp_path: Path) -> None:
    path = dxf(tmp_path, lambda space: space.add_circle((1, 2), 3))
    path.write_text(path.read_text().replace("  0\nCIRCLE\n", "  0\nBLOCK\n"))
    with pytest.raises(DesignError, match="BLOCK"):
        read_outline(path)


def test_changed_files_are_read_alike_or_left_to_ezdxf(tmp_path: Path) -> None:
    """The plain reader never takes a file for something else than ezdxf does."""
    chance = random.Random(7)
    path = tmp_path / "outline.dxf"
    taken = 0
    for number in range(CHANGES):
        if number % 20 == 0:
            texts = [drawn(chance) for _ in range(4)]
        text = chance.choice(texts)
        text = changed(text, chance) if number % 10 else text
        path.write_text(text, newline=chance.choice(("\n", "\r\n")))
        if as_plain(path.read_bytes()) is not None:
            taken += 1
            ours, theirs = told(path, False), told(path, True)
            if ours != theirs:
                # Damaged where nothing is drawn.
                assert str(theirs).startswith("is not a DXF file that can be read"), text
                assert drawn_part(text) in map(drawn_part, texts), text
    assert 0.1 * CHANGES < taken < 0.9 * CHANGES
