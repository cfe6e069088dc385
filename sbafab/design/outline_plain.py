"""Plain DXF drawings: whole files of lines, arcs, circles and light polylines, all of them shown.

Most outlines are such, and to read them here spares the import of ezdxf. Whatever a drawing holds
beyond that, or says in another way than is usual, is left to ezdxf; a test that changes files at
random (``tests/design/test_outline_plain.py``) holds the two against each other. A file that is
damaged where nothing is drawn, in a dictionary or the like, may be read though ezdxf refuses it.
"""

from __future__ import annotations

import re
from binascii import unhexlify
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from sbafab.design.strands import Strand, line, through, turn

VERSIONS = frozenset({"AC1015", "AC1018", "AC1021", "AC1024", "AC1027", "AC1032"})
"""R2000 to R2018; in older ones the model space is told otherwise."""
SECTIONS = frozenset({"HEADER", "TABLES", "BLOCKS", "ENTITIES", "OBJECTS"})
TABLES = frozenset(
    {"APPID", "BLOCK_RECORD", "DIMSTYLE", "LAYER", "LTYPE", "STYLE", "UCS", "VIEW", "VPORT"}
)
KINDS = {
    "LINE": ("AcDbEntity", "AcDbLine"),
    "ARC": ("AcDbEntity", "AcDbCircle", "AcDbArc"),
    "CIRCLE": ("AcDbEntity", "AcDbCircle"),
    "LWPOLYLINE": ("AcDbEntity", "AcDbPolyline"),
}
"""The entities that are plain, and the marks of their parts."""
DRAWN_BY = {"LINE": (10, 20, 11, 21), "ARC": (10, 20, 40, 50, 51), "CIRCLE": (10, 20, 40)}
LEVEL = {30: 0.0, 31: 0.0, 38: 0.0, 67: 0.0, 210: 0.0, 220: 0.0, 230: 1.0}
"""What may be said besides: that it lies in the model space at z = 0 and is seen from above."""
LOOKS = frozenset({5, 6, 8, 39, 43, 48, 62, 370, 420, 440})
"""Handle, layer, line type, thickness, line width, colour, transparency."""
BASE = frozenset({0, 2, 5, 102, 105, 330, 360})
"""Kind, name, handles: what stands before the first part of a record."""
_COMMENT = 999
_ODD = re.compile(rb"[^\n\r\t -~]|\r(?!\n)")
_HANDLE = re.compile(r"[0-9A-F]{1,16}")
_OWN_HANDLE = (5, 105)
_X = frozenset({*range(10, 19), 110, 111, 112, *range(210, 214), *range(1010, 1014)})
_Y = frozenset(code + 10 for code in _X)
_Z = frozenset(code + 20 for code in _X) - {38}
"""Codes of coordinates, which have to follow each other; 38 is an elevation."""

DxfTag = tuple[int, str]
DxfRecord = list[DxfTag]


class PlainDrawing(NamedTuple):
    """Its $INSUNITS, 0 where none is said, and its entities."""

    unit: int
    entities: list[DxfRecord]

    def strands(self, factor: float) -> Iterator[Strand]:
        """What is drawn, at ``factor`` mm a unit. Raises DesignError."""
        for entity in self.entities:
            kind = entity[0][1]
            if kind == "LWPOLYLINE":
                yield through(_vertices(entity), 1.0, factor, _is_closed(entity))
                continue
            said = dict(entity)
            x, y, *more = (float(said[code]) for code in DRAWN_BY[kind])
            if kind == "LINE":
                yield line((x, y), (more[0], more[1]), factor)
            else:
                yield turn(kind, (x, y), more[0], more[1:], 1.0, factor)


class _NotPlainError(Exception):
    """The drawing is left to ezdxf."""


def as_plain(content: bytes) -> PlainDrawing | None:
    """What a file of this content draws; None for what is not plain."""
    # Custom properties may say that the edges are those of a compensated cut file.
    if _ODD.search(content) or b"$CUSTOMPROPERTY" in content:
        return None
    try:
        return _drawing(_records(content.decode().replace("\r\n", "\n")))
    except (_NotPlainError, ValueError, LookupError):
        return None


def _require(holds: object) -> None:
    if not holds:
        raise _NotPlainError


def _records(text: str) -> list[DxfRecord]:
    """All tags but comments, parted before each of code 0; every value is of its code's type."""
    lines = text.removesuffix("\n").split("\n")
    found = [*zip(map(int, lines[::2]), lines[1::2], strict=True)]
    tags = [tag for tag in found if tag[0] != _COMMENT]
    types = {code: _type_of(code) for code, _ in tags}
    for code, value in set(tags):
        types[code](value)
    for (code, _), (after, _) in pairwise(tags):
        _require((code in _X) == (after in _Y) and (code not in _X or after == code + 10))
        _require(after not in _Z or after == code + 10)
    starts = [place for place, (code, _) in enumerate(tags) if code == 0]
    _require(starts and starts[0] == 0)
    return [tags[first:end] for first, end in pairwise([*starts, len(tags)])]


def _type_of(code: int) -> Callable[[str], object]:
    """What reads a value of this code, or raises ValueError."""
    for read, spans in _TYPES.items():
        if any(first <= code <= last for first, last in spans):
            return read
    return str


def _handle(value: str) -> None:
    _require(_HANDLE.fullmatch(value))


_TYPES: dict[Callable[[str], object], Sequence[tuple[int, int]]] = {
    float: ((10, 59), (110, 149), (210, 239), (460, 469), (1010, 1059)),
    int: (
        *((60, 79), (90, 99), (160, 179), (270, 299), (370, 389), (400, 409), (420, 429)),
        *((440, 459), (1060, 1071)),
    ),
    _handle: ((5, 5), (105, 105), (320, 369), (390, 399), (480, 481), (1005, 1005)),
    unhexlify: ((310, 319), (1004, 1004)),
}


def _drawing(records: list[DxfRecord]) -> PlainDrawing:
    sections = _sections(records)
    header = _header(sections["HEADER"][0])
    _require(header["$ACADVER"][1] in VERSIONS)
    named = [sections[name][1:] for name in ("TABLES", "BLOCKS", "ENTITIES", "OBJECTS")]
    own = [
        tuple(int(value, 16) for code, value in one if code in _OWN_HANDLE)
        for part in named
        for one in part
        if one != [(0, "ENDTAB")]
    ]
    _require(len(set(own)) == len(own) and all(len(one) == 1 and one[0] for one in own))
    for part in named:
        for one in part:
            _refuse_broken(one)
    tables, blocks, entities, objects = named
    space = _model_space(tables)
    # Blocks are empty, so none draws anything.
    _require([one[0][1] for one in blocks] == ["BLOCK", "ENDBLK"] * (len(blocks) // 2))
    _require(all([code for code, _ in one].count(2) == 1 for one in blocks[::2]))
    _refuse_layouts(objects, space)
    for entity in entities:
        _refuse_unusual(entity, space)
    return PlainDrawing(int(header.get("$INSUNITS", (70, "0"))[1]), entities)


def _sections(records: list[DxfRecord]) -> dict[str, list[DxfRecord]]:
    """By name, with the record that opens it."""
    *content, end = records
    _require(end == [(0, "EOF")])
    found: dict[str, list[DxfRecord]] = {}
    name = ""
    for record in content:
        kind = record[0][1]
        if kind == "SECTION":
            (code, said), *more = record[1:]
            _require(not name and code == 2 and said not in found)
            _require(not more or said == "HEADER")
            name, found[said] = said, [record]
        elif kind == "ENDSEC":
            _require(name and len(record) == 1)
            name = ""
        else:
            _require(name and name != "HEADER")
            found[name].append(record)
    _require(not name and found.keys() - {"CLASSES"} == SECTIONS)
    return found


def _header(head: DxfRecord) -> dict[str, DxfTag]:
    """The variables: each a name and one value, of a point its x."""
    found: dict[str, DxfTag] = {}
    tags = head[2:]
    starts = [place for place, (code, _) in enumerate(tags) if code == 9]
    _require(not tags or starts[:1] == [0])
    for first, end in pairwise([*starts, len(tags)]):
        (_, name), value, *more = tags[first:end]
        _require(name.startswith("$") and name not in found)
        if more:
            _require([code for code, _ in more] in ([20], [20, 30]) and value[0] == 10)
        found[name] = value
    _require(found.get("$HANDSEED", (5, "1"))[0] == 5)
    _require(found.get("$INSUNITS", (70, "0"))[0] == 70)
    return found


def _refuse_broken(record: DxfRecord) -> None:
    """Its parts are marked, each once, what is opened is closed, extended data stand last."""
    marks = [place for place, (code, _) in enumerate(record) if code == 100]
    _require(len({record[place] for place in marks}) == len(marks))
    first = marks[0] if marks else len(record)
    _require(all(code in BASE for code, _ in record[:first]))
    groups = [value[:1] for code, value in record if code == 102]
    _require(groups == ["{", "}"] * (len(groups) // 2))
    extended = [place for place, (code, _) in enumerate(record) if code >= 1000]
    if extended:
        _require(record[extended[0]][0] == 1001 and len(record) - extended[0] == len(extended))


def _model_space(tables: list[DxfRecord]) -> str:
    """The handle of its block record. Every layer has to be shown."""
    spaces = []
    table = ""
    for record in tables:
        kind, said = record[0][1], dict(record)
        if kind == "TABLE":
            _require(not table and said[2] in TABLES)
            table = said[2]
        elif kind == "ENDTAB":
            _require(table)
            table = ""
        else:
            codes = [code for code, _ in record]
            start = codes.index(100)
            _require(kind == table and codes.count(2) == 1 and codes.count(100) == 2)
            _require(codes[start + 1] == 100 and record[start][1] == "AcDbSymbolTableRecord")
        if kind == "LAYER":
            _require(said[2] and not int(said.get(70, "0")) & 1 and int(said.get(62, "7")) >= 0)
        elif kind == "BLOCK_RECORD" and said[2].lower() == "*model_space":
            spaces.append(said[5])
    _require(not table and len(spaces) == 1)
    return spaces[0]


def _refuse_layouts(objects: list[DxfRecord], space: str) -> None:
    """The layout Model has to be that of the model space."""
    _require(objects and objects[0][0] == (0, "DICTIONARY"))
    models = [
        after
        for one in objects
        for (code, name), after in pairwise(one)
        if code == 3 and name.upper() == "MODEL"
    ]
    layouts = [dict(one) for one in objects if one[0] == (0, "LAYOUT")]
    _require(len(models) == 1)
    _require([one[330] for one in layouts if one[5] == models[0][1]] == [space])


def _refuse_unusual(entity: DxfRecord, space: str) -> None:
    """An entity has its parts in their order, each code once but for vertices."""
    kind = entity[0][1]
    _require(kind in KINDS)
    _require(tuple(value for code, value in entity if code == 100) == KINDS[kind])
    before = entity[1 : entity.index((100, KINDS[kind][1]))]
    _require(all(code in LOOKS or code in (67, 100, 330) for code, _ in before))
    rest = [tag for tag in entity[1:] if tag[0] != 100]
    if kind == "LWPOLYLINE":
        rest = [tag for tag in rest if tag[0] not in (10, 20, 40, 41, 42, 91)]
        _require(int(dict(rest)[90]) == len(_vertices(entity)))
        rest = [tag for tag in rest if tag[0] not in (70, 90)]
    own = DRAWN_BY.get(kind, ())
    codes = [code for code, _ in rest]
    _require(len(set(codes)) == len(codes) and set(own) <= set(codes))
    for code, value in rest:
        if code == 330:
            _require(value == space)
        elif code in LEVEL:
            _require(float(value) == LEVEL[code])
        else:
            _require(code in own or code in LOOKS)


def _vertices(entity: DxfRecord) -> list[tuple[float, float, float]]:
    """x, y and bulge."""
    found: list[list[float]] = []
    for code, value in entity:
        if code == 10:
            found.append([float(value), 0.0, 0.0])
        elif code in (20, 42):
            found[-1][1 if code == 20 else 2] = float(value)
    return [(x, y, bulge) for x, y, bulge in found]


def _is_closed(entity: Mapping[int, str] | DxfRecord) -> bool:
    return bool(int(dict(entity).get(70, "0")) & 1)
