"""The film sheets of a folder as they lie on disk: what is really cut, against what is claimed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from sbafab.as_built.claims import bare_problem, claim
from sbafab.as_built.cut_files import LayerFile, check_sequence, inside, sound_digest
from sbafab.as_built.expected import AGREED, Meant, departure
from sbafab.as_built.kerf_removed import uncut
from sbafab.as_built.measures import SHARE
from sbafab.as_built.records import CLAIMS, INTEGRITY, Problem
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.properties import (
    CUT_SHEET,
    ENGRAVE,
    LIMITS,
    kerf_properties,
    kerf_suffix,
    limit_properties,
)
from sbafab.cutting.second_cut import PATH, ROOM, marks, second_path, severed, stack_kerf
from sbafab.cutting.sheets import FOLDER
from sbafab.cutting.verify import TOLERANCE, check_contours, check_surroundings
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.contour import Mark
from sbafab.geometry.edges import Edge, Point, meeting_points
from sbafab.geometry.nearby import widened
from sbafab.geometry.offset import Kerf
from sbafab.geometry.region import Region, rectangle
from sbafab.laminate.films import Material, in_order
from sbafab.laminate.laminate import Layer, SheetPanel, freed
from sbafab.nesting.check import check_placed
from sbafab.nesting.records import TURNS, Stock, Turn, no_spares
from sbafab.output.checked import stocks
from sbafab.output.manifest import (
    FilmUseClaim,
    JobManifest,
    KerfClaim,
    Manifest,
    SheetClaim,
)
from sbafab.rules.bridges import apart

# The pieces on film sheets, each held against the pieces that the layers' files cut.


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


ROUNDED = 2e-3
"""mm, mm2 or share by which a rounded claim may be off beside its share."""


@dataclass(frozen=True)
class SheetOrder:
    """What a manifest claims of film sheets, and the layers that they must hold.

    ``design`` states the stock; all designs of a job have the same, and the same ``kerf``.
    """

    claims: Manifest | JobManifest
    design: Design
    kerf: Mapping[Material, KerfClaim]
    lots: Sequence[Lot]

    @property
    def sha256(self) -> str:
        """That of the design, or of all designs of a job."""
        claims = self.claims
        return claims.design_sha256 if isinstance(claims, Manifest) else claims.designs_sha256


def sheet_problems(folder: Path, order: SheetOrder) -> list[Problem]:
    """Every sheet: sound, laid out as its stock asks, and cutting the layers' pieces, no others."""
    if not order.claims.sheets:
        return [claim("the manifest lists no film sheets; write them with sbafab cut")]
    problems = _order_problems(order)
    stock_of = stocks(order.design)
    files = [file for lot in order.lots for file in lot.files]
    parts = [file.part for file in files if file.part is not None]
    curves = parts[0].properties.get("CURVES") if parts else None
    sheets: list[CutSheet] = []
    bare: list[ReadBack] = []
    for told in order.claims.sheets:
        if told.material not in stock_of:
            problems.append(claim(f"{told.file} is of {told.material}, no film of design.toml"))
            continue
        try:
            found = _read(folder, told)
        except OutputError as error:
            problems.append(_unsound(told, error))
            continue
        sheets.append(CutSheet(told, found.region))
        if found.properties:
            problems += _property_problems(told, found, order, curves)
        else:
            bare.append(found)
        problems += _layout_problems(told, found, stock_of[told.material])
        problems += _number_problems(sheets[-1], found)
    if bare:
        of = "the files of " + (f"{len(bare)} film sheets" if len(bare) > 1 else "a film sheet")
        problems.append(bare_problem(of, all(found.units for found in bare)))
    if len(sheets) == len(order.claims.sheets) and len(parts) == len(files):
        turns = {material: stock.turns for material, stock in stock_of.items()}
        problems += piece_problems(sheets, order.lots, turns)
    return problems


def _read(folder: Path, told: SheetClaim) -> ReadBack:
    """What a sheet's file holds. Raises OutputError where it is not sound."""
    path = inside(folder, told.file)
    sound_digest(path)
    try:
        found = read_profile(path)
        check_sequence(found)
        if found.region.is_empty:
            raise OutputError("it cuts nothing; regenerate it")
        return found
    except OutputError:
        raise
    except (ArithmeticError, ValueError, LookupError) as error:
        raise OutputError(f"holds no sound contours ({error}); regenerate it") from error


def _unsound(told: SheetClaim, error: OutputError, place: Point | None = None) -> Problem:
    said = str(error).removeprefix(f"{PurePosixPath(told.file).name}: ")
    x, y = place or (None, None)
    return Problem(INTEGRITY, f"{told.file}: {said}", x=x, y=y)


def _order_problems(order: SheetOrder) -> list[Problem]:
    """Sheets by number, name and stock against the design; films against sheets."""
    problems = []
    for material, stock in stocks(order.design).items():
        own = [sheet for sheet in order.claims.sheets if sheet.material == material]
        if [sheet.number for sheet in own] != [*range(1, len(own) + 1)] or len(own) > stock.most:
            message = f"the {material} sheets are not numbered from 1 to at most {stock.most}"
            problems.append(claim(message))
        for sheet in own:
            problems += _name_problems(sheet, order)
            problems += _stock_problems(sheet, stock, order.design.sheets.engine)
        problems += [
            problem
            for film in order.claims.films
            if film.material == material
            for problem in _film_problems(film, own)
        ]
    return problems


def _name_problems(sheet: SheetClaim, order: SheetOrder) -> list[Problem]:
    stem = f"{FOLDER}/{sheet.material}_{sheet.number}{kerf_suffix(_kerf(order, sheet.material))}"
    return [
        *(
            claim(f"{sheet.material} sheet {sheet.number} is {said!r}, not {name}")
            for said, name in (
                (sheet.file, f"{stem}.dxf"),
                (sheet.picture, f"{stem}.svg"),
                (sheet.project, f"{stem}{ENDING}"),
            )
            if said != name
        ),
        *(
            claim(f"{path} has no hash in the manifest")
            for path in (sheet.file, sheet.picture, sheet.project)
            if path not in order.claims.files
        ),
    ]


def _kerf(order: SheetOrder, material: Material) -> Kerf | None:
    said = order.kerf.get(material)
    return said.width if said is not None else None


def _stock_problems(sheet: SheetClaim, stock: Stock, engine: str) -> list[Problem]:
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in sheet.pins)
    agree: list[tuple[str, object, object]] = [
        ("width", sheet.width, stock.width),
        ("border", sheet.border, stock.border),
        ("spacing", sheet.spacing, stock.spacing),
        ("pins", pins, stock.pins),
        ("engine", sheet.engine, engine),
    ]
    is_long = sheet.length > stock.length + ROUNDED
    if is_long or not (stock.roll or abs(sheet.length - stock.length) < ROUNDED):
        agree.append(("length", sheet.length, stock.length))
    return [
        claim(f"{sheet.file}: {what} is {said} in the manifest and {stated} by design.toml")
        for what, said, stated in agree
        if said != stated
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
        claim(f"films: {what} of {film.material} is {said:g}, and its sheets sum to {sum_:g}")
        for what, said, sum_ in agree
        if abs(said - sum_) > ROUNDED
    ]


def _property_problems(
    told: SheetClaim, found: ReadBack, order: SheetOrder, curves: str | None
) -> list[Problem]:
    """Custom properties that are not what the manifest says, or curves unlike the layers'."""
    of = sum(sheet.material == told.material for sheet in order.claims.sheets)
    expected: dict[str, str | None] = {
        "DESIGN": order.claims.name,
        "DESIGN_SHA256": order.sha256,
        "PATTERN": f"sheet {told.number} of {of}",
        "MATERIAL": told.material,
        "UNITS": "mm",
        **kerf_properties(_kerf(order, told.material)),
        "WAIVED": ", ".join(order.claims.waived) or "none",
        LIMITS: limit_properties(order.claims.lowered_limits).get(LIMITS),
        "PARTS": ", ".join(f"{part.count} x {part.design} {part.pattern}" for part in told.parts),
        "CURVES": curves,
    }
    return [
        claim(
            f"{told.file}: custom property {name} is {found.properties.get(name)!r}, not {said!r}"
        )
        for name, said in expected.items()
        if found.properties.get(name) != said
    ]


def _layout_problems(told: SheetClaim, found: ReadBack, stock: Stock) -> list[Problem]:
    """Frame, parting cut and engraving; borders, gaps and pins."""
    problems = []
    pins = tuple((pin.x, pin.y, pin.diameter) for pin in told.pins)
    laid = Stock(told.width, told.length, told.border, told.spacing, pins)
    parting = (((0.0, told.length), (told.width, told.length)),) if stock.roll else ()
    around = Surroundings((), parting, (told.width, told.length))
    beside = tuple(stroke for stroke in found.strokes if stroke[0] != ENGRAVE)
    pieces = [(_placed_piece(piece.bounds), piece) for piece in found.region.pieces]
    try:
        check_surroundings(replace(found, strokes=beside), around)
        check_placed(pieces, laid, AGREED)
    except OutputError as error:
        problems.append(_unsound(told, error))
    top = found.region.bounds[3] + told.border
    if stock.roll and abs(told.length - top) > TOLERANCE:
        message = f"{told.file}: is {told.length:g} mm long, and its parts and border {top:g}"
        problems.append(claim(message))
    bad = _badly_engraved(found, told)
    if bad is not None:
        x, y = bad
        message = f"engraving at x {x:.3f}, y {y:.3f} is not in the waste; regenerate it"
        problems.append(_unsound(told, OutputError(message), bad))
    return problems


def _placed_piece(box: tuple[float, float, float, float]) -> str:
    return f"the piece about x {(box[0] + box[2]) / 2:.1f}, y {(box[1] + box[3]) / 2:.1f}"


def _badly_engraved(found: ReadBack, told: SheetClaim) -> Point | None:
    """Where engraving crosses a part's edge, lies in a part or leaves the sheet."""
    strokes = [edge for layer, edges in found.strokes if layer == ENGRAVE for edge in edges]
    return next((edge.start for edge in strokes if not _in_waste(edge, found, told)), None)


def _in_waste(edge: Edge, found: ReadBack, told: SheetClaim) -> bool:
    low_x, low_y, high_x, high_y = edge.bounds
    if low_x < 0 or low_y < 0 or high_x > told.width or high_y > told.length:
        return False
    left, bottom, right, top = found.region.bounds
    if high_x < left or low_x > right or high_y < bottom or low_y > top:
        return True
    near = found.region.index.touching(edge.bounds)
    crossed = any(meeting_points(edge, other) for other in near)
    return not crossed and not found.region.contains(edge.start)


def _number_problems(sheet: CutSheet, found: ReadBack) -> list[Problem]:
    """Areas, contours and lengths that the manifest claims of a sheet."""
    told, region = sheet.told, sheet.path
    parting = [edge for layer, edges in found.strokes if layer == CUT_SHEET for edge in edges]
    length = sum(c.length for c in region.contours) + sum(edge.length for edge in parting)
    area_room = SHARE * region.area + ROUNDED + TOLERANCE * length
    length_room = SHARE * length + ROUNDED
    agree: list[tuple[str, float, float, float]] = [
        ("parts_area", told.parts_area, region.area, area_room),
        ("density", told.density, told.parts_area / (told.width * told.length), ROUNDED),
        ("contours", told.contours, len(region.contours), 0.0),
        ("cut_length", told.cut_length, length, length_room),
    ]
    return [
        claim(f"{told.file}: {what} is {said:g} in the manifest and {own:g} as cut")
        for what, said, own, room in agree
        if abs(said - own) > room
    ]


# Registered sheets as they lie on disk: what the second cut frees from the sheets of the first.


def read_panel(
    folder: Path, claims: Manifest, files: Sequence[LayerFile], meant: Meant | None
) -> tuple[SheetPanel | None, list[LayerFile], list[Problem]]:
    """The panel of a folder's files, each layer's file with the part that it frees.

    The panel is the design's own where all files are what it makes. Of copies that differ, the
    one that departs most from what the design makes stands for its layer.
    """
    panel = meant.laminate.panel if meant is not None else None
    if meant is None or panel is None or len(files) != len(panel.sheets):
        return panel, list(files), []
    kerfs = {material: kerf.width for material, kerf in claims.kerf.items()}
    kerf = stack_kerf(kerfs, severed(meant.laminate))
    second, problems = _second(folder, kerf or 0.0, panel)
    parts = [file.part for file in files]
    if second is panel.second and all(part is None or part.is_meant for part in parts):
        return panel, list(files), problems
    sheets = tuple(
        own if part is None or part.is_meant else _upward(part.region, layer)
        for own, part, layer in zip(panel.sheets, parts, meant.laminate.layers, strict=True)
    )
    found = replace(panel, sheets=sheets, second=second)
    layers = meant.laminate.layers
    return (
        found,
        [_with_part(f, found, one) for f, one in zip(files, layers, strict=True)],
        problems,
    )


def _upward(sheet: Region, layer: Layer) -> Region:
    """A sheet as it is seen from above: those of masks are cut turned over."""
    return sheet.mirrored() if layer.is_mask else sheet


def _with_part(file: LayerFile, panel: SheetPanel, layer: Layer) -> LayerFile:
    if file.part is None or file.part.is_meant:
        return file
    parts = [part for part in freed(panel, layer).parts if not part.is_empty]
    # What is not freed at all is told by the rule bridges.
    region = max(parts, key=lambda part: apart(part, layer.profile), default=layer.profile)
    return replace(file, part=replace(file.part, region=region))


def _second(folder: Path, width: Kerf, panel: SheetPanel) -> tuple[Region, list[Problem]]:
    """The slots of the second cut's file, the panel's own where they agree."""
    try:
        sound_digest(folder / PATH)
        found = read_profile(folder / PATH)
        check_sequence(found)
        check_surroundings(found, marks(panel))
    except (OutputError, ArithmeticError, ValueError, LookupError) as error:
        said = str(error).removeprefix(f"{Path(PATH).name}: ")
        return panel.second, [Problem(INTEGRITY, f"{PATH}: {said}")]
    if not departure(found.region, second_path(panel, width)):
        return panel.second, []
    return _slots(found.region, width), []


def _slots(path: Region, kerf: Kerf) -> Region:
    """What a beam takes out that is led round inside slots."""
    x0, y0, x1, y1 = widened(path.bounds, ROOM)
    inner = [contour.reversed() for contour in path.contours]
    left = uncut(Region((*rectangle((x0, y0), (x1, y1)).contours, *inner)), kerf).region
    return Region(tuple(hole.reversed() for hole in left.holes))
