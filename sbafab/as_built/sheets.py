"""Film sheets as on disk: pieces, layout and claims."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from sbafab.as_built.claims import bare_problem, claim
from sbafab.as_built.cut_files import LayerFile, check_sequence, path_in_folder, sound_digest
from sbafab.as_built.expected import AGREEMENT
from sbafab.as_built.measures import SHARE
from sbafab.as_built.records import CLAIMS, INTEGRITY, Problem
from sbafab.cutting.beam_check import BeamRun
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.entries import PLAIN
from sbafab.cutting.lightburn import ENDING, read_project
from sbafab.cutting.machine_files import ENDINGS
from sbafab.cutting.properties import (
    CUT_SHEET,
    ENGRAVE,
    LIMITS,
    SEAM,
    kerf_properties,
    kerf_suffix,
    limit_properties,
)
from sbafab.cutting.sheets import FOLDER, check_cuts, parts_cut
from sbafab.cutting.verify import TOLERANCE, check_contours, check_surroundings
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.contour import Mark
from sbafab.geometry.edges import Edge, Point, meeting_points
from sbafab.geometry.nearby import widened
from sbafab.geometry.offset import Kerf
from sbafab.geometry.region import Region
from sbafab.laminate.films import Material, in_order
from sbafab.nesting.check import check_placed, edge_distance
from sbafab.nesting.records import TURNS, Stock, Turn, no_spares
from sbafab.output.checked import entries, stocks
from sbafab.output.manifest import (
    FilmUseClaim,
    JobManifest,
    KerfClaim,
    Manifest,
    SheetClaim,
)

# Pieces on film sheets, compared with the pieces of the layer files.


@dataclass(frozen=True)
class CutSheet:
    """The claim of a sheet, and the beam's path in its file."""

    claim: SheetClaim
    path: Region


@dataclass(frozen=True)
class DesignLot:
    """The layer files of a design, its number of copies, and spares by number of pieces."""

    design: str
    copies: int
    files: Sequence[LayerFile]
    spares: Callable[[int], int] = no_spares


_Outline = frozenset[tuple[Mark, ...]]
_Pattern = tuple[str, str]
"""A design and one of its patterns."""


@dataclass(frozen=True)
class _PieceKind:
    """Congruent pieces of layer files; ``needed`` counts them by pattern."""

    forms: tuple[Region, ...]
    needed: Counter[_Pattern] = field(default_factory=Counter)

    @property
    def name(self) -> str:
        return _names(self.needed)


def _names(patterns: Iterable[_Pattern]) -> str:
    return ", ".join(f"{design} {pattern}" for design, pattern in patterns)


class _PieceKinds:
    """The kinds of pieces of a material, found by shape."""

    def __init__(self, turns: Sequence[Turn], room: float) -> None:
        self.all: list[_PieceKind] = []
        self._turns = turns
        self._room = room
        self._kinds: dict[_Outline, _PieceKind] = {}

    def find(self, piece: Region) -> _PieceKind | None:
        """Return the kind of a piece in any place and permitted turn, or None."""
        outline = _outline(piece)
        match = self._kinds.get(outline)
        if match is None:
            lying = _at_origin(piece)
            match = next(
                (
                    kind
                    for kind in self.all
                    if any(_agree(lying, form, self._room) for form in kind.forms)
                ),
                None,
            )
            if match is not None:
                self._kinds[outline] = match
        return match

    def add(self, piece: Region) -> _PieceKind:
        forms = (_at_origin(piece.turned(90.0 * turn)) for turn in self._turns)
        kind = _PieceKind(tuple({form.key: form for form in forms}.values()))
        self.all.append(kind)
        return kind


def piece_problems(
    sheets: Sequence[CutSheet],
    lots: Sequence[DesignLot],
    turns: Mapping[Material, Sequence[Turn]],
) -> list[Problem]:
    """Return pieces on the sheets that no layer has, and kinds with a wrong count."""
    problems = []
    claimed = {sheet.claim.material for sheet in sheets}
    drawn = {file.claim.material for lot in lots for file in lot.files}
    for material in in_order(claimed | drawn):
        material_sheets = [sheet for sheet in sheets if sheet.claim.material == material]
        kinds = _kinds_of(lots, material, turns.get(material, TURNS), AGREEMENT)
        cut: Counter[int] = Counter()
        for sheet in material_sheets:
            counts, strangers = _counted_pieces(sheet, kinds)
            problems += strangers
            problems += _count_problems(sheet, kinds.all, counts)
            cut += counts
        problems += [
            claim(
                f"the {material} sheets cut {cut[id(kind)]} pieces of {kind.name}, and the layers, "
                f"copies and spares take {kind.needed.total()}"
            )
            for kind in kinds.all
            if cut[id(kind)] != kind.needed.total()
        ]
    return problems


def _kinds_of(
    lots: Sequence[DesignLot], material: Material, turns: Sequence[Turn], room: float
) -> _PieceKinds:
    kinds = _PieceKinds(turns, room)
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
                kind.needed[lot.design, pattern] += count * lot.copies + more
    return kinds


def _counted_pieces(sheet: CutSheet, kinds: _PieceKinds) -> tuple[Counter[int], list[Problem]]:
    """Return the counts of a sheet's pieces by id of kind, and problems of pieces of no kind."""
    counts: Counter[int] = Counter()
    problems = []
    for piece in sheet.path.pieces:
        kind = kinds.find(piece)
        if kind is not None:
            counts[id(kind)] += 1
            continue
        low_x, low_y, high_x, high_y = piece.bounds
        x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
        over = kinds.find(piece.mirrored())
        why = f"is {over.name} turned over" if over else "is no piece of any layer's file"
        message = f"{sheet.claim.file}: the piece about x {x:.1f}, y {y:.1f} {why}"
        problems.append(Problem(CLAIMS, message, x=x, y=y))
    return counts, problems


def _count_problems(
    sheet: CutSheet, kinds: Sequence[_PieceKind], counts: Counter[int]
) -> list[Problem]:
    """Return wrong counts by pattern of a sheet; patterns that share a piece count together."""
    claimed: Counter[_Pattern] = Counter()
    for part in sheet.claim.parts:
        claimed[part.design, part.pattern] += part.count
    groups = _groups(kinds)
    problems = [
        claim(f"{sheet.claim.file}: no layer is of pattern {_names([pattern])}")
        for pattern in claimed
        if pattern not in groups
    ]
    for group in dict.fromkeys(groups.values()):
        patterns = [pattern for pattern, joined in groups.items() if joined == group]
        claimed_count = sum(claimed[pattern] for pattern in patterns)
        cut = sum(counts[id(kind)] for kind in kinds if groups[next(iter(kind.needed))] == group)
        if claimed_count != cut:
            message = f"{claimed_count} pieces of {_names(patterns)} in the manifest, {cut} as cut"
            problems.append(claim(f"{sheet.claim.file}: {message}"))
    return problems


def _groups(kinds: Sequence[_PieceKind]) -> dict[_Pattern, _Pattern]:
    """Return the group of every pattern, named by its first: patterns that share pieces."""
    groups: dict[_Pattern, _Pattern] = {}
    for kind in kinds:
        joined = {groups.get(pattern, pattern) for pattern in kind.needed}
        first = min(joined)
        groups |= dict.fromkeys(kind.needed, first)
        groups |= {pattern: first for pattern, group in groups.items() if group in joined}
    return groups


def _outline(piece: Region) -> _Outline:
    """Return the contours of a piece from the lower left corner of its box, rounded to 1e-6 mm."""
    x, y, _, _ = piece.bounds
    return frozenset(
        tuple(
            [
                (round(px - x, 6), round(py - y, 6), round(third, 6))
                for px, py, third in contour.marks
            ]
        )
        for contour in piece.contours
    )


def _at_origin(piece: Region) -> Region:
    """Return the piece with the lower left corner of its box at the origin."""
    x, y, _, _ = piece.bounds
    return piece.moved(-x, -y)


def _agree(piece: Region, form: Region, room: float) -> bool:
    """Return True if two regions at the origin agree within ``room`` mm."""
    if len(piece.contours) != len(form.contours):
        return False
    if math.dist(piece.bounds, form.bounds) > 4 * room:
        return False
    try:
        check_contours(piece, form, room)
    except OutputError:
        return False
    return True


ROUNDED = 2e-3
"""Rounding error of a claim, mm, mm2 or share."""


@dataclass(frozen=True)
class SheetOrder:
    """The manifest's claims on film sheets, and the lots that they must hold.

    ``design`` states the stock; all designs of a job have the same, and the same ``kerf``.
    """

    claims: Manifest | JobManifest
    design: Design
    kerf: Mapping[Material, KerfClaim]
    lots: Sequence[DesignLot]

    @property
    def sha256(self) -> str:
        """The hash of the design, or of all designs of a job."""
        claims = self.claims
        return claims.design_sha256 if isinstance(claims, Manifest) else claims.designs_sha256


def sheet_problems(folder: Path, order: SheetOrder) -> list[Problem]:
    """Return the problems of all sheets: soundness, layout, claims and pieces."""
    if not order.claims.sheets:
        return [claim("the manifest lists no film sheets; write them with sbafab cut")]
    problems = _order_problems(order)
    stock_of = stocks(order.design)
    files = [file for lot in order.lots for file in lot.files]
    parts = [file.part for file in files if file.part is not None]
    curves = parts[0].properties.get("CURVES") if parts else None
    sheets: list[CutSheet] = []
    bare: list[ReadBack] = []
    for sheet_claim in order.claims.sheets:
        if sheet_claim.material not in stock_of:
            problems.append(
                claim(f"{sheet_claim.file} is of {sheet_claim.material}, no film of design.toml")
            )
            continue
        try:
            drawing = _read(folder, sheet_claim)
        except OutputError as error:
            problems.append(_integrity_problem(sheet_claim, error))
            continue
        sheets.append(CutSheet(sheet_claim, drawing.region))
        if drawing.properties:
            problems += _property_problems(sheet_claim, drawing, order, curves)
        else:
            bare.append(drawing)
        problems += _layout_problems(sheet_claim, drawing, stock_of[sheet_claim.material])
        problems += _number_problems(sheets[-1], drawing)
        problems += _machine_problems(folder, sheet_claim, drawing.region, order.design)
    if bare:
        of = "the files of " + (f"{len(bare)} film sheets" if len(bare) > 1 else "a film sheet")
        problems.append(bare_problem(of, all(drawing.units for drawing in bare)))
    if len(sheets) == len(order.claims.sheets) and len(parts) == len(files):
        turns = {material: stock.turns for material, stock in stock_of.items()}
        problems += piece_problems(sheets, order.lots, turns)
    return problems


def _read(folder: Path, sheet_claim: SheetClaim) -> ReadBack:
    """Read the drawing of a sheet. Raises OutputError if it is not sound."""
    path = path_in_folder(folder, sheet_claim.file)
    sound_digest(path)
    try:
        drawing = read_profile(path)
        check_sequence(drawing)
        if any(layer == SEAM for layer, _ in drawing.strokes):
            raise OutputError(f"it holds a path on {SEAM}, which is no sheet's; regenerate it")
        if drawing.region.is_empty:
            raise OutputError("it cuts nothing; regenerate it")
        return drawing
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"holds no sound contours ({error}); regenerate it") from error


def _integrity_problem(
    sheet_claim: SheetClaim, error: OutputError, place: Point | None = None
) -> Problem:
    reason = str(error).removeprefix(f"{PurePosixPath(sheet_claim.file).name}: ")
    x, y = place or (None, None)
    return Problem(INTEGRITY, f"{sheet_claim.file}: {reason}", x=x, y=y)


def _order_problems(order: SheetOrder) -> list[Problem]:
    """Return differences of sheets from the design, and of films from sheets."""
    problems = []
    for material, stock in stocks(order.design).items():
        sheets = [sheet for sheet in order.claims.sheets if sheet.material == material]
        if [sheet.number for sheet in sheets] != [*range(1, len(sheets) + 1)] or len(
            sheets
        ) > stock.most:
            message = f"the {material} sheets are not numbered from 1 to at most {stock.most}"
            problems.append(claim(message))
        for sheet in sheets:
            problems += _name_problems(sheet, order)
            problems += _stock_problems(sheet, stock)
        problems += [
            problem
            for film in order.claims.films
            if film.material == material
            for problem in _film_problems(film, sheets)
        ]
    return problems


def _name_problems(sheet: SheetClaim, order: SheetOrder) -> list[Problem]:
    stem = f"{FOLDER}/{sheet.material}_{sheet.number}{kerf_suffix(_kerf(order, sheet.material))}"
    program = order.design.sheets.program
    other = None if program is None else f"{stem}{ENDINGS[program]}"
    return [
        *(
            claim(f"{sheet.material} sheet {sheet.number} is {claimed!r}, not {name}")
            for claimed, name in (
                (sheet.file, f"{stem}.dxf"),
                (sheet.picture, f"{stem}.svg"),
                (sheet.project, f"{stem}{ENDING}"),
                (sheet.machine_file, other),
            )
            if claimed != name
        ),
        *(
            claim(f"{path} has no hash in the manifest")
            for path in (sheet.file, sheet.picture, sheet.project, sheet.machine_file)
            if path is not None and path not in order.claims.files
        ),
    ]


def _kerf(order: SheetOrder, material: Material) -> Kerf | None:
    kerf = order.kerf.get(material)
    return kerf.width if kerf is not None else None


def _stock_problems(sheet: SheetClaim, stock: Stock) -> list[Problem]:
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in sheet.pins)
    agree: list[tuple[str, object, object]] = [
        ("width", sheet.width, stock.width),
        ("border", sheet.border, stock.border),
        ("spacing", sheet.spacing, stock.spacing),
        ("pins", pins, stock.pins),
    ]
    is_long = sheet.length > stock.length + ROUNDED
    if is_long or not (stock.roll or abs(sheet.length - stock.length) < ROUNDED):
        agree.append(("length", sheet.length, stock.length))
    return [
        claim(f"{sheet.file}: {key} is {claimed} in the manifest and {stated} by design.toml")
        for key, claimed, stated in agree
        if claimed != stated
    ]


def _film_problems(film: FilmUseClaim, sheets: Sequence[SheetClaim]) -> list[Problem]:
    area = sum(sheet.width * sheet.length for sheet in sheets)
    parts = sum(sheet.parts_area for sheet in sheets)
    density = parts / area if area else 0.0
    agree: list[tuple[str, float, float]] = [
        ("sheets", film.sheets, len(sheets)),
        ("sheet_area", film.sheet_area, area),
        ("waste", film.waste, area - parts),
        ("density", film.density, density),
    ]
    return [
        claim(f"films: {key} of {film.material} is {claimed:g}, and its sheets sum to {sum_:g}")
        for key, claimed, sum_ in agree
        if abs(claimed - sum_) > ROUNDED
    ]


def _property_problems(
    sheet_claim: SheetClaim, drawing: ReadBack, order: SheetOrder, curves: str | None
) -> list[Problem]:
    """Return custom properties that differ from the manifest, or curves from the layers'."""
    of = sum(sheet.material == sheet_claim.material for sheet in order.claims.sheets)
    expected: dict[str, str | None] = {
        "DESIGN": order.claims.name,
        "DESIGN_SHA256": order.sha256,
        "PATTERN": f"sheet {sheet_claim.number} of {of}",
        "MATERIAL": sheet_claim.material,
        "UNITS": "mm",
        **kerf_properties(_kerf(order, sheet_claim.material)),
        "WAIVED": ", ".join(order.claims.waived) or "none",
        LIMITS: limit_properties(order.claims.lowered_limits).get(LIMITS),
        "PARTS": ", ".join(
            f"{part.count} x {part.design} {part.pattern}" for part in sheet_claim.parts
        ),
        "CURVES": curves,
    }
    return [
        claim(
            f"{sheet_claim.file}: custom property {name} is {drawing.properties.get(name)!r}, "
            f"not {value!r}"
        )
        for name, value in expected.items()
        if drawing.properties.get(name) != value
    ]


def _layout_problems(sheet_claim: SheetClaim, drawing: ReadBack, stock: Stock) -> list[Problem]:
    """Return problems of frame, parting cut, engraving, borders, gaps and pins."""
    problems = []
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in sheet_claim.pins)
    laid = Stock.model_construct(
        width=sheet_claim.width,
        length=sheet_claim.length,
        border=sheet_claim.border,
        spacing=sheet_claim.spacing,
        pins=pins,
    )
    parting = (
        (((0.0, sheet_claim.length), (sheet_claim.width, sheet_claim.length)),)
        if stock.roll
        else ()
    )
    around = Surroundings((), parting, (sheet_claim.width, sheet_claim.length))
    beside = tuple(stroke for stroke in drawing.strokes if stroke[0] != ENGRAVE)
    pieces = [(_placed_piece(piece.bounds), piece) for piece in drawing.region.pieces]
    try:
        check_surroundings(replace(drawing, strokes=beside), around)
        check_placed(pieces, laid, AGREEMENT)
    except OutputError as error:
        problems.append(_integrity_problem(sheet_claim, error))
    top = drawing.region.bounds[3] + sheet_claim.border
    if stock.roll and abs(sheet_claim.length - top) > TOLERANCE:
        length = f"is {sheet_claim.length:g} mm long, and its parts and border {top:g}"
        message = f"{sheet_claim.file}: {length}"
        problems.append(claim(message))
    off_waste = _engraving_off_waste(drawing, sheet_claim)
    if off_waste is not None:
        x, y = off_waste
        message = f"engraving at x {x:.3f}, y {y:.3f} is not in the waste; regenerate it"
        problems.append(_integrity_problem(sheet_claim, OutputError(message), off_waste))
    near = _mark_near_part(drawing, sheet_claim)
    if near is not None:
        x, y = near
        message = (
            f"engraving at x {x:.3f}, y {y:.3f} is nearer to a part than "
            f"{_mark_clearance(sheet_claim):g} mm; regenerate it"
        )
        problems.append(_integrity_problem(sheet_claim, OutputError(message), near))
    return problems


MARK_CLEARANCE = 0.5
"""mm that an index mark keeps from every part; half the spacing if that is less."""


def _mark_clearance(sheet_claim: SheetClaim) -> float:
    return min(MARK_CLEARANCE, sheet_claim.spacing / 2)


def _mark_near_part(drawing: ReadBack, sheet_claim: SheetClaim) -> Point | None:
    """Return a point of an index mark, inside the border, that is too near to a part, or None."""
    apart, border = _mark_clearance(sheet_claim) - AGREEMENT, sheet_claim.border
    for layer, edges in drawing.strokes:
        if layer != ENGRAVE:
            continue
        for edge in edges:
            low_x, low_y, high_x, high_y = edge.bounds
            is_inside = min(low_x, low_y) >= border and (
                high_x <= sheet_claim.width - border and high_y <= sheet_claim.length - border
            )
            around = drawing.region.index.touching(widened(edge.bounds, apart))
            if is_inside and any(edge_distance(edge, other).value < apart for other in around):
                return edge.start
    return None


def _placed_piece(box: tuple[float, float, float, float]) -> str:
    return f"the piece about x {(box[0] + box[2]) / 2:.1f}, y {(box[1] + box[3]) / 2:.1f}"


def _engraving_off_waste(drawing: ReadBack, sheet_claim: SheetClaim) -> Point | None:
    """Return a point of engraving that is not in the waste of the sheet, or None."""
    strokes = [edge for layer, edges in drawing.strokes if layer == ENGRAVE for edge in edges]
    return next((edge.start for edge in strokes if not _in_waste(edge, drawing, sheet_claim)), None)


def _in_waste(edge: Edge, drawing: ReadBack, sheet_claim: SheetClaim) -> bool:
    low_x, low_y, high_x, high_y = edge.bounds
    if low_x < 0 or low_y < 0 or high_x > sheet_claim.width or high_y > sheet_claim.length:
        return False
    left, bottom, right, top = drawing.region.bounds
    if high_x < left or low_x > right or high_y < bottom or low_y > top:
        return True
    near = drawing.region.index.touching(edge.bounds)
    crossed = any(meeting_points(edge, crossing) for crossing in near)
    return not crossed and not drawing.region.contains(edge.start)


def _number_problems(sheet: CutSheet, drawing: ReadBack) -> list[Problem]:
    """Return differences of claimed areas, contours and lengths of a sheet."""
    sheet_claim, region = sheet.claim, sheet.path
    parting = [edge for layer, edges in drawing.strokes if layer == CUT_SHEET for edge in edges]
    length = sum(c.length for c in region.contours) + sum(edge.length for edge in parting)
    area_room = SHARE * region.area + ROUNDED + TOLERANCE * length
    length_room = SHARE * length + ROUNDED
    agree: list[tuple[str, float, float, float]] = [
        ("parts_area", sheet_claim.parts_area, region.area, area_room),
        (
            "density",
            sheet_claim.density,
            sheet_claim.parts_area / (sheet_claim.width * sheet_claim.length),
            ROUNDED,
        ),
        ("contours", sheet_claim.contours, len(region.contours), 0.0),
        ("cut_length", sheet_claim.cut_length, length, length_room),
    ]
    return [
        claim(f"{sheet_claim.file}: {key} is {claimed:g} in the manifest and {measured:g} as cut")
        for key, claimed, measured, room in agree
        if abs(claimed - measured) > room
    ]


def _machine_problems(
    folder: Path, sheet_claim: SheetClaim, region: Region, design: Design
) -> list[Problem]:
    """Return differences of a sheet's machine files from its cuts, with lead-ins and tabs."""
    asked = entries(design).get(sheet_claim.material, PLAIN)
    files: list[tuple[str, Callable[[Path], Sequence[BeamRun]]]] = []
    if not asked.is_plain:
        files.append((sheet_claim.project, lambda path: read_project(path).cut_runs))
    program, other = design.sheets.program, sheet_claim.machine_file
    if program is not None and other is not None:
        files.append((other, lambda path: parts_cut(path, program)))
    problems = []
    for name, read in files:
        try:
            path = path_in_folder(folder, name)
            check_cuts(path, read(path), region, asked)
        except OutputError as error:
            reason = str(error).removeprefix(f"{PurePosixPath(name).name}: ")
            problems.append(Problem(INTEGRITY, f"{name}: {reason}"))
    return problems
