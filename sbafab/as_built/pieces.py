"""The pieces on film sheets, each held against the pieces that the layers' files cut."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from sbafab.as_built.agreement import AGREED
from sbafab.as_built.claims import claim
from sbafab.as_built.cut_files import LayerFile
from sbafab.as_built.records import CLAIMS, Problem
from sbafab.cutting.verify import check_contours
from sbafab.errors import OutputError
from sbafab.geometry.region import Mark, Region
from sbafab.laminate.films import Material, in_order
from sbafab.nesting.parts import no_spares
from sbafab.nesting.records import TURNS, Turn
from sbafab.output.manifest_records import SheetClaim


@dataclass(frozen=True)
class CutSheet:
    """A sheet of the manifest and the beam's path that its file holds."""

    told: SheetClaim
    path: Region


@dataclass(frozen=True)
class Lot:
    """The layers' files of a design, of which ``copies`` are cut, and ``spares`` by the number."""

    design: str
    copies: int
    files: Sequence[LayerFile]
    spares: Callable[[int], int] = no_spares


_Outline = frozenset[tuple[Mark, ...]]
_Pattern = tuple[str, str]
"""A design and one of its patterns."""


@dataclass(frozen=True)
class _Kind:
    """Pieces that a layer file cuts, alike up to a turn: ``wanted`` counts them by pattern."""

    forms: tuple[Region, ...]
    wanted: Counter[_Pattern] = field(default_factory=Counter)

    @property
    def name(self) -> str:
        return _names(self.wanted)


def _names(patterns: Iterable[_Pattern]) -> str:
    return ", ".join(f"{design} {pattern}" for design, pattern in patterns)


class _Kinds:
    """The kinds of one material, found by shape; whether two shapes agree is asked once."""

    def __init__(self, turns: Sequence[Turn], room: float) -> None:
        self.all: list[_Kind] = []
        self._turns = turns
        self._room = room
        self._known: dict[_Outline, _Kind] = {}

    def find(self, piece: Region) -> _Kind | None:
        """The kind that a piece is of, wherever it lies and however it may be turned."""
        outline = _outline(piece)
        known = self._known.get(outline)
        if known is None:
            lying = _at_origin(piece)
            known = next(
                (
                    kind
                    for kind in self.all
                    if any(_alike(lying, form, self._room) for form in kind.forms)
                ),
                None,
            )
            if known is not None:
                self._known[outline] = known
        return known

    def add(self, piece: Region) -> _Kind:
        forms = (_at_origin(piece.turned(90.0 * turn)) for turn in self._turns)
        kind = _Kind(tuple({form.key: form for form in forms}.values()))
        self.all.append(kind)
        return kind


def piece_problems(
    sheets: Sequence[CutSheet],
    lots: Sequence[Lot],
    turns: Mapping[Material, Sequence[Turn]],
) -> list[Problem]:
    """Pieces on the sheets that no layer has, or not as often as layers and copies ask for."""
    problems = []
    told = {sheet.told.material for sheet in sheets}
    drawn = {file.claim.material for lot in lots for file in lot.files}
    for material in in_order(told | drawn):
        own = [sheet for sheet in sheets if sheet.told.material == material]
        kinds = _kinds_of(lots, material, turns.get(material, TURNS), AGREED)
        cut: Counter[int] = Counter()
        for sheet in own:
            found, strangers = _sorted_out(sheet, kinds)
            problems += strangers
            problems += _count_problems(sheet, kinds.all, found)
            cut += found
        problems += [
            claim(
                f"the {material} sheets cut {cut[id(kind)]} pieces of {kind.name}, and the layers, "
                f"copies and spares take {kind.wanted.total()}"
            )
            for kind in kinds.all
            if cut[id(kind)] != kind.wanted.total()
        ]
    return problems


def _kinds_of(
    lots: Sequence[Lot], material: Material, turns: Sequence[Turn], room: float
) -> _Kinds:
    kinds = _Kinds(turns, room)
    for lot in lots:
        drawn = Counter(
            (file.part.path, file.claim.pattern)
            for file in lot.files
            if file.part is not None and file.claim.material == material
        )
        needed: Counter[str] = Counter()
        for (_, pattern), count in drawn.items():
            needed[pattern] += count * lot.copies
        # Files of one pattern that differ by a hair share its spares.
        spares = {pattern: lot.spares(number) for pattern, number in needed.items()}
        for (path, pattern), count in drawn.items():
            more = spares.pop(pattern, 0)
            for piece in path.pieces:
                kind = kinds.find(piece) or kinds.add(piece)
                kind.wanted[lot.design, pattern] += count * lot.copies + more
    return kinds


def _sorted_out(sheet: CutSheet, kinds: _Kinds) -> tuple[Counter[int], list[Problem]]:
    """How many pieces of each kind a sheet holds, and those that are of none."""
    found: Counter[int] = Counter()
    strangers = []
    for piece in sheet.path.pieces:
        kind = kinds.find(piece)
        if kind is not None:
            found[id(kind)] += 1
            continue
        low_x, low_y, high_x, high_y = piece.bounds
        x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
        over = kinds.find(piece.mirrored())
        why = f"is {over.name} turned over" if over else "is no piece of any layer's file"
        message = f"{sheet.told.file}: the piece about x {x:.1f}, y {y:.1f} {why}"
        strangers.append(Problem(CLAIMS, message, x=x, y=y))
    return found, strangers


def _count_problems(sheet: CutSheet, kinds: Sequence[_Kind], found: Counter[int]) -> list[Problem]:
    """Counts by pattern that a sheet claims; patterns that share a piece are counted as one."""
    told: Counter[_Pattern] = Counter()
    for part in sheet.told.parts:
        told[part.design, part.pattern] += part.count
    groups = _groups(kinds)
    problems = [
        claim(f"{sheet.told.file}: no layer is of pattern {_names([own])}")
        for own in told
        if own not in groups
    ]
    for group in dict.fromkeys(groups.values()):
        named = [pattern for pattern, own in groups.items() if own == group]
        said = sum(told[pattern] for pattern in named)
        cut = sum(found[id(kind)] for kind in kinds if groups[next(iter(kind.wanted))] == group)
        if said != cut:
            message = f"{said} pieces of {_names(named)} in the manifest, {cut} as cut"
            problems.append(claim(f"{sheet.told.file}: {message}"))
    return problems


def _groups(kinds: Sequence[_Kind]) -> dict[_Pattern, _Pattern]:
    """Every pattern's group, by its first pattern: one pattern, or those that share pieces."""
    groups: dict[_Pattern, _Pattern] = {}
    for kind in kinds:
        joined = {groups.get(pattern, pattern) for pattern in kind.wanted}
        first = min(joined)
        groups |= dict.fromkeys(kind.wanted, first)
        groups |= {pattern: first for pattern, group in groups.items() if group in joined}
    return groups


def _outline(piece: Region) -> _Outline:
    """Its contours from the lower left corner of its box, in nm: most copies have one."""
    x, y, _, _ = piece.bounds
    return frozenset(
        tuple(
            [(round(px - x, 6), round(py - y, 6), round(third, 6)) for px, py, third in own.marks]
        )
        for own in piece.contours
    )


def _at_origin(piece: Region) -> Region:
    """The piece with the lower left corner of its box at the origin."""
    x, y, _, _ = piece.bounds
    return piece.moved(-x, -y)


def _alike(piece: Region, form: Region, room: float) -> bool:
    """Whether two regions at the origin agree within ``room`` mm."""
    if len(piece.contours) != len(form.contours):
        return False
    if math.dist(piece.bounds, form.bounds) > 4 * room:
        return False
    try:
        check_contours(piece, form, room)
    except OutputError:
        return False
    return True
