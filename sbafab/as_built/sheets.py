"""The film sheets of a folder as they lie on disk: what is really cut, against what is claimed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from sbafab.as_built.agreement import AGREED
from sbafab.as_built.claims import bare_problem, claim
from sbafab.as_built.cut_files import check_sequence, inside, sound_digest
from sbafab.as_built.measures import SHARE
from sbafab.as_built.pieces import CutSheet, Lot, piece_problems
from sbafab.as_built.records import INTEGRITY, Problem
from sbafab.cutting.cut_layers import CUT_SHEET, ENGRAVE
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.properties import LIMITS, kerf_properties, kerf_suffix, limit_properties
from sbafab.cutting.sheets import FOLDER
from sbafab.cutting.verify import TOLERANCE, check_surroundings
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.geometry.beam import Kerf
from sbafab.geometry.edges import Edge, Point
from sbafab.geometry.intersect import meeting_points
from sbafab.laminate.films import Material
from sbafab.nesting.check import check_placed
from sbafab.nesting.records import Stock
from sbafab.output.manifest_records import (
    FilmUseClaim,
    JobManifest,
    KerfClaim,
    Manifest,
    SheetClaim,
)
from sbafab.output.settings import stocks

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
