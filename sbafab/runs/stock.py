"""A stock file: pieces of film on the shelf, what a run takes of them, and what it leaves.

A run only reads it: each film is cut from the smallest pieces that hold its parts. ``take`` books
a written folder out of the file, and its rests in, each a rectangle.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Annotated

from filelock import FileLock, Timeout
from pydantic import Field

from sbafab.actuators import load_design
from sbafab.actuators.stacking import used_films
from sbafab.as_built.cut_files import path_in_folder
from sbafab.as_built.records import is_job, read_claims, read_job
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.properties import ENGRAVE
from sbafab.design.files import checked, read_toml, shown
from sbafab.design.films import OtherFilm, Sheet
from sbafab.design.records import Design
from sbafab.design.toml_table import Section
from sbafab.design.units import SHORTEST, Millimetres
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.edges import Bounds
from sbafab.geometry.on_demand import np
from sbafab.laminate.films import FIRST, Film, Material
from sbafab.nesting.nest import nest, of_material
from sbafab.nesting.records import NestPart, field
from sbafab.output.checked import RunPart, plan_design, stocks
from sbafab.output.job import CheckedJob
from sbafab.output.manifest import JobManifest, Manifest, SheetClaim
from sbafab.output.swap import MANIFEST
from sbafab.spreadsheet import csv_text

PieceSize = Annotated[float, Millimetres(SHORTEST, 10000)]
BILL = "bill.csv"
"""The bill of materials in a batch's folder."""
CELLS = 400
"""Cells along a sheet's longer side in which its rest is sought; they are 1 mm at least."""
LEAST_REST = 20.0
"""mm: a rest is kept if it has so much within its border, either way."""


class FilmPiece(Section):
    """Equal pieces of film on the shelf: full sheets, or the rest of one."""

    id: str = Field(min_length=1, max_length=40)
    """What is written on them."""
    film: str = Field(min_length=1, max_length=80)
    """The film's product, as in films.*.product."""
    thickness: Annotated[float, Millimetres(SHORTEST, 1)]
    """The film's thickness."""
    width: PieceSize
    """Size along x, as it lies on the machine."""
    length: PieceSize
    """Size along y."""
    count: int = Field(default=1, ge=1, le=1000)
    """How many there are."""
    rest: bool = False
    """Whether it is what a run left of a sheet."""

    @property
    def size(self) -> str:
        return f"{self.width:g} x {self.length:g} mm"


class StockItem(Section):
    """What else is on the shelf: tubes, pins, release film and the rest of a bill."""

    item: str = Field(min_length=1, max_length=80)
    """Its name in the bill of materials, as Tube."""
    specification: str = Field(default="", max_length=200)
    """Words of the bill's specification, which tell it from others of that name."""
    count: int = Field(ge=0, le=1_000_000)
    """How many there are."""
    reusable: bool = False
    """Whether a run leaves it as it was, as a base plate."""


class Taken(Section):
    """A run that was booked."""

    run: str
    """Its folder's name."""
    manifest: str
    """SHA-256 of its manifest."""
    pieces: tuple[str, ...] = Field(strict=False)
    """The pieces that it was cut from."""


class StockFile(Section):
    """The pieces on the shelf, and the runs that were cut from them."""

    piece: tuple[FilmPiece, ...] = Field(default=(), max_length=10_000, strict=False)
    """The pieces."""
    item: tuple[StockItem, ...] = Field(default=(), max_length=10_000, strict=False)
    """What else is on the shelf."""
    taken: tuple[Taken, ...] = Field(default=(), strict=False)
    """The runs that were booked."""
    rests: int = Field(default=0, ge=0)
    """Rests that were numbered."""


def read_stock(path: Path) -> StockFile:
    """Return a stock file. Raises DesignError with one sentence where it cannot be read."""
    if not path.exists():
        raise DesignError(f"there is no stock file {path}; write one, as docs/cutting.md shows")
    stock = checked(StockFile, read_toml(path), {}, f"{path.name}: ", "stock file")
    names = [piece.id for piece in stock.piece]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise DesignError(
            f"{path} has two pieces with id {shown(repeated)}; give each its own, or one a count"
        )
    return stock


# What a run takes.


def cut_from_stock(job: CheckedJob) -> CheckedJob:
    """Return a job whose sheets are the pieces that it takes, if its designs name a stock file.

    Raises DesignError where the file has no piece of a film, or not enough of them.
    """
    design = job.designs[0].design
    name = design.sheets.stock
    if name is None or job.failed:
        return job
    if job.assembled is not None:
        raise DesignError(
            "sheets.stock goes with generate, cut and nest of designs, not with an assembly; take "
            "it out of the designs of the assembly"
        )
    path = design.folder / name
    stock = read_stock(path)
    only_cut: tuple[RunPart, ...] = ("cut",)
    parts = [part for each in job.designs for part in plan_design(each, only_cut).parts]
    pieces = {
        material: _piece_for(design, material, of_material(parts, material), stock, path)
        for material in dict.fromkeys(part.material for part in parts)
    }
    return replace(
        job,
        designs=tuple(
            replace(each, design=_on_pieces(each.design, pieces)) for each in job.designs
        ),
    )


def _piece_for(
    design: Design, material: Material, parts: Sequence[NestPart], stock: StockFile, path: Path
) -> FilmPiece:
    """Return the smallest piece that holds all parts; else that of which fewest are needed."""
    film, plain = used_films(design)[material], stocks(design)[material]
    where = field(material)
    if plain.roll or plain.pins:
        raise DesignError(
            f"{where}.{'roll' if plain.roll else 'pins'} does not go with sheets.stock, whose "
            "pieces differ in size; leave it out, or leave sheets.stock out"
        )
    pieces = [piece for piece in stock.piece if _is_of(piece, film)]
    if not pieces:
        raise DesignError(
            f"{path} has no piece of film {shown(film.product)}, {film.thickness:g} mm thick, of "
            f"which the {material} parts are cut; add it, or leave sheets.stock out"
        )
    smallest_first = sorted(pieces, key=lambda piece: (piece.width * piece.length, piece.id))
    needed: list[tuple[int, FilmPiece]] = []
    for piece in smallest_first:
        sheet = replace(plain, width=piece.width, length=piece.length, most=piece.count)
        try:
            (laid,) = nest(parts, {material: sheet})
        except DesignError:
            continue
        if laid.sheets == 1:
            return piece
        needed.append((laid.sheets, piece))
    if not needed:
        raise DesignError(
            f"no piece of film {shown(film.product)} in {path} holds the {material} parts in the "
            "number that there is; add full sheets, or order fewer copies"
        )
    return min(needed, key=lambda entry: entry[0])[1]


def _on_pieces(design: Design, pieces: Mapping[Material, FilmPiece]) -> Design:
    """Return a design whose sheets are pieces, and that names no stock file."""
    sheets: dict[str, Sheet | None] = {"stock": None}
    films: dict[str, OtherFilm] = {}
    for material, piece in pieces.items():
        change = {
            "width": piece.width,
            "length": piece.length,
            "most": piece.count,
            "piece": piece.id,
        }
        name = material.lower()
        if material in FIRST:
            sheet: Sheet = getattr(design.sheets, name)
            sheets[name] = sheet.model_copy(update=change)
        else:
            film = design.films.others[name]
            films[name] = film.model_copy(update={"sheet": film.sheet.model_copy(update=change)})
    return design.model_copy(
        update={
            "sheets": design.sheets.model_copy(update=sheets),
            "films": design.films.model_copy(update=films),
        }
    )


# What a written folder took, and what it leaves.


@dataclass(frozen=True)
class Rest:
    """The largest rectangle that a cut sheet leaves: lower left corner and size in mm."""

    piece: str
    x: float
    y: float
    width: float
    length: float

    @property
    def size(self) -> str:
        return f"{self.width:g} x {self.length:g} mm"

    @property
    def place(self) -> str:
        """The lower left corner."""
        return f"x {self.x:g}, y {self.y:g}"


def is_cut_from_stock(folder: Path) -> bool:
    """Return True if the sheets of a written folder are pieces of a stock file."""
    claims, design = _written(folder)
    return any(_sheet_of(design, sheet.material).piece is not None for sheet in claims.sheets)


def _written(folder: Path) -> tuple[Manifest | JobManifest, Design]:
    """Return the manifest of a folder, and its first design, whose sheets all designs share."""
    claims: Manifest | JobManifest = read_job(folder) if is_job(folder) else read_claims(folder)
    first = claims.designs[0].name if isinstance(claims, JobManifest) else ""
    return claims, load_design(folder / first / "design.toml")


def _sheet_of(design: Design, material: Material) -> Sheet:
    name = material.lower()
    if name in design.films.others:
        return design.films.others[name].sheet
    sheet: Sheet = getattr(design.sheets, name)
    return sheet


def rests(folder: Path) -> Iterator[tuple[SheetClaim, str, Rest | None]]:
    """Yield each sheet of a written folder, its piece, and its rest if that is worth keeping.

    The cut files are read. Raises OutputError where the folder was not cut from a stock file, or
    a file is not the one that was written.
    """
    claims, design = _written(folder)
    for sheet in claims.sheets:
        piece = _sheet_of(design, sheet.material).piece
        if piece is None:
            raise OutputError(
                f"{folder} was not cut from a stock file; name it in sheets.stock of the design "
                "and generate it again"
            )
        file = path_in_folder(folder, sheet.file)
        if hashlib.sha256(file.read_bytes()).hexdigest() != claims.files.get(sheet.file):
            raise OutputError(f"{file} was changed since it was written; generate the run again")
        drawing = read_profile(file)
        gap = sheet.spacing
        boxes = [
            (x0 - gap, y0 - gap, x1 + gap, y1 + gap)
            for x0, y0, x1, y1 in (part.bounds for part in drawing.region.pieces)
        ]
        for layer, edges in drawing.strokes:
            if layer == ENGRAVE:
                boxes += [edge.bounds for edge in edges]
        x0, y0, x1, y1 = largest_rectangle((sheet.width, sheet.length), boxes)
        least = LEAST_REST + 2 * sheet.border
        rest = Rest(piece, x0, y0, x1 - x0, y1 - y0)
        yield sheet, piece, rest if min(rest.width, rest.length) >= least else None


def largest_rectangle(size: tuple[float, float], boxes: Sequence[Bounds]) -> Bounds:
    """Return the largest rectangle of a sheet that meets no box, in whole cells of 1 mm or more."""
    width, length = size
    cell = max(1.0, max(size) / CELLS)
    columns, rows = int(width / cell + 1e-9), int(length / cell + 1e-9)
    taken = np.zeros((rows, columns), dtype=np.bool_)
    for x0, y0, x1, y1 in boxes:
        taken[
            max(0, math.floor(y0 / cell + 1e-9)) : max(0, math.ceil(y1 / cell - 1e-9)),
            max(0, math.floor(x0 / cell + 1e-9)) : max(0, math.ceil(x1 / cell - 1e-9)),
        ] = True
    best, corner = 0, (0, 0, 0, 0)
    heights = [0] * columns
    for row in range(rows):
        heights = [0 if full else heights[i] + 1 for i, full in enumerate(taken[row].tolist())]
        for first, last, height in _bars(heights):
            if (last - first) * height > best:
                best, corner = (last - first) * height, (first, row + 1 - height, last, row + 1)
    x0, y0, x1, y1 = (cell * number for number in corner)
    return x0, y0, x1, y1


def _bars(heights: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Yield the rectangles under a histogram that cannot be widened: first, past last, height."""
    open_bars: list[tuple[int, int]] = []
    for column, height in enumerate([*heights, 0]):
        first = column
        while open_bars and open_bars[-1][1] >= height:
            first, lower = open_bars.pop()
            yield first, column, lower
        open_bars.append((first, height))


# The bill of materials against the stock.


@dataclass(frozen=True)
class Need:
    """A counted row of a bill of materials, and how many of it are in stock."""

    item: str
    specification: str
    needed: int
    in_stock: int

    @property
    def lacking(self) -> int:
        return max(0, self.needed - self.in_stock)


def bill_against(folder: Path, stock: StockFile) -> list[Need]:
    """Return the films of a written folder and the counted rows of its bill, against a stock.

    One copy has films alone. What the stock holds goes to the first row that it serves, and what
    is left to the next. Raises OutputError where a bill is not the one that was written.
    """
    return [*_film_needs(folder, stock), *(need for need, _ in _item_needs(folder, stock))]


def _film_needs(folder: Path, stock: StockFile) -> Iterator[Need]:
    claims, design = _written(folder)
    films = used_films(design)
    needed = Counter((sheet.material, sheet.width, sheet.length) for sheet in claims.sheets)
    for (material, width, length), count in needed.items():
        film, piece_id = films[material], _sheet_of(design, material).piece
        pieces = (
            piece.count
            for piece in stock.piece
            if _is_of(piece, film)
            and piece_id in (None, piece.id)
            and min(piece.width - width, piece.length - length) >= 0
        )
        words = f"{film.product}, {film.thickness:g} mm thick, {width:g} x {length:g} mm"
        yield Need(f"{material} film", words, count, sum(pieces))


def _is_of(piece: FilmPiece, film: Film) -> bool:
    return piece.film == film.product and abs(piece.thickness - film.thickness) < 1e-9


def _item_needs(folder: Path, stock: StockFile) -> Iterator[tuple[Need, tuple[int, ...]]]:
    """Yield the counted rows that are no films, and how many of each stock item they take."""
    counts = [item.count for item in stock.item]
    for (name, words), needed in _counted_rows(folder).items():
        serving = [
            i
            for i, item in enumerate(stock.item)
            if item.item.casefold() == name.casefold()
            and item.specification.casefold() in words.casefold()
        ]
        taken = [0] * len(counts)
        in_stock = sum(counts[i] for i in serving)
        for i in serving:
            taken[i] = min(counts[i], needed - sum(taken))
            counts[i] -= taken[i]
        yield Need(name, words, needed, in_stock), tuple(taken)


def _counted_rows(folder: Path) -> Counter[tuple[str, str]]:
    """Return name, specification and number of the counted rows of a folder's bills; no films."""
    counted: Counter[tuple[str, str]] = Counter()
    claims, _ = _written(folder)
    designs = [each.name for each in claims.designs] if isinstance(claims, JobManifest) else [""]
    films = {f"{sheet.material} film" for sheet in claims.sheets}
    for name in designs:
        file = folder / name / BILL
        if not file.exists():
            continue
        content = file.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if digest != read_claims(folder / name).files.get(BILL):
            raise OutputError(f"{file} was changed since it was written; generate the run again")
        for row in csv.DictReader(StringIO(content.decode())):
            if row["needed"] and row["item"] not in films:
                counted[row["item"], row["specification"]] += int(row["needed"])
    return counted


def bill_csv(needs: Sequence[Need]) -> str:
    """Return a bill against a stock as a table."""
    columns = ("item", "specification", "needed", "in_stock", "lacking")
    rows = [(n.item, n.specification, n.needed, n.in_stock, n.lacking) for n in needs]
    return csv_text([columns, *rows])


def take(folder: Path, path: Path) -> StockFile:
    """Book a written folder out of a stock file and its rests in; return the file as written.

    Items of its bill are booked out as far as there are any.

    Raises OutputError or DesignError, with the file unchanged, where the folder was booked before
    or its pieces are not in the file.
    """
    cut = list(rests(folder))
    digest = hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()
    with _locked(path):
        stock = read_stock(path)
        if any(taken.manifest == digest for taken in stock.taken):
            raise OutputError(
                f"{folder} was taken from {path} before; a second set is a run of its own: "
                "generate it again"
            )
        after = _booked(stock, folder.name, digest, cut, path)
        after = after.model_copy(update={"item": _items_left(folder, stock)})
        _write(path, after)
    return after


def _items_left(folder: Path, stock: StockFile) -> tuple[StockItem, ...]:
    """Return the items of a stock without those that a written folder uses up."""
    counts = [item.count for item in stock.item]
    for _, taken in _item_needs(folder, stock):
        counts = [count - number for count, number in zip(counts, taken, strict=True)]
    return tuple(
        item if item.reusable else item.model_copy(update={"count": count})
        for item, count in zip(stock.item, counts, strict=True)
    )


def _booked(
    stock: StockFile,
    run: str,
    digest: str,
    cut: Sequence[tuple[SheetClaim, str, Rest | None]],
    path: Path,
) -> StockFile:
    pieces = {piece.id: piece for piece in stock.piece}
    counts = {piece.id: piece.count for piece in stock.piece}
    number, new = stock.rests, []
    for sheet, name, rest in cut:
        piece = pieces.get(name)
        if piece is None or counts[name] < 1:
            raise OutputError(
                f"{path} has no piece {shown(name)} left, which {sheet.file} is cut from; generate "
                "the run again, which takes what there is"
            )
        if (piece.width, piece.length) != (sheet.width, sheet.length):
            raise OutputError(
                f"piece {shown(name)} in {path} is {piece.size}, and {sheet.file} is cut from "
                f"{sheet.width:g} x {sheet.length:g} mm; generate the run again"
            )
        counts[name] -= 1
        if rest is not None:
            number += 1
            while f"R{number}" in pieces:
                number += 1
            size = {"width": rest.width, "length": rest.length}
            more = {"id": f"R{number}", "count": 1, "rest": True}
            new.append(piece.model_copy(update=size | more))
    left = [
        piece.model_copy(update={"count": counts[piece.id]})
        for piece in stock.piece
        if counts[piece.id]
    ]
    taken = Taken(run=run, manifest=digest, pieces=tuple(name for _, name, _ in cut))
    return StockFile(piece=(*left, *new), taken=(*stock.taken, taken), rests=number)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    lock = FileLock(path.with_name(f".{path.name}.lock"), timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise OutputError(f"another run is writing {path}; wait for it to end") from None
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None
    try:
        yield
    finally:
        lock.release()


def _write(path: Path, stock: StockFile) -> None:
    """Write a stock file beside the old one and put it in its place."""
    import tomli_w

    text = tomli_w.dumps(stock.model_dump(mode="json"))
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None
