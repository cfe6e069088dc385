"""A stock file: pieces of film on the shelf, what a run takes of them, and what it leaves.

A run only reads it: each film is cut from the smallest pieces that hold its parts. ``take`` books
a written folder out of the file, and its rests in, each a rectangle.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
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
from sbafab.laminate.films import FIRST, Material
from sbafab.nesting.nest import nest, of_material
from sbafab.nesting.records import NestPart, field
from sbafab.output.checked import RunPart, plan_design, stocks
from sbafab.output.job import CheckedJob
from sbafab.output.manifest import JobManifest, Manifest, SheetClaim
from sbafab.output.swap import MANIFEST

PieceSize = Annotated[float, Millimetres(SHORTEST, 10000)]
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
    taken: tuple[Taken, ...] = Field(default=(), strict=False)
    """The runs that were booked."""
    rests: int = Field(default=0, ge=0)
    """Rests that were numbered."""


def read_stock(path: Path) -> StockFile:
    """Return a stock file. Raises DesignError with one sentence where it cannot be read."""
    stock = checked(StockFile, read_toml(path), {}, f"{path.name}: ")
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
    pieces = [
        piece
        for piece in stock.piece
        if piece.film == film.product and abs(piece.thickness - film.thickness) < 1e-9
    ]
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


def rests(folder: Path) -> Iterator[tuple[SheetClaim, str, Rest | None]]:
    """Yield each sheet of a written folder, its piece, and its rest if that is worth keeping.

    The cut files are read. Raises OutputError where the folder was not cut from a stock file, or
    a file is not the one that was written.
    """
    claims: Manifest | JobManifest = read_job(folder) if is_job(folder) else read_claims(folder)
    first = claims.designs[0].name if isinstance(claims, JobManifest) else ""
    design = load_design(folder / first / "design.toml")
    for sheet in claims.sheets:
        name = sheet.material.lower()
        held = design.films.others[name].sheet if name in design.films.others else None
        piece = (held or getattr(design.sheets, name)).piece
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


def take(folder: Path, path: Path) -> StockFile:
    """Book a written folder out of a stock file and its rests in; return the file as written.

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
        _write(path, after)
    return after


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
