"""Film sheets that are not what layers, copies and stock ask for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from sbafab.cutting.cut_settings import CUT_SHEET, ENGRAVE
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.placements import least_distance
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from tests.faults.files import inches
from tests.faults.holes import EARS
from tests.faults.record import Fault, Kind, edited, of_text, told
from tests.faults.specimen import Specimen

INTEGRITY, DESIGNED = "file-integrity", "as-designed"
KERF = 0.2
PIN: Point = (139.0, 139.0)
FREE: Point = (142.0, 142.0)
"""Just inside the border, where the sheets are empty."""
Claims = dict[str, Any]
Pieces = list[Region]
Rearrange = Callable[[Pieces], Pieces]


def sheet_of(specimen: Specimen, material: str = "TPE") -> tuple[Claims, Path]:
    """What the manifest says of the first sheet of a material, and its file."""
    claims = specimen.doctor.manifest["sheets"]
    told = next(sheet for sheet in claims if sheet["material"] == material)
    return told, specimen.doctor.folder / told["file"]


def drawn(
    found: ReadBack,
    contours: Sequence[Contour],
    frame: Point,
    engraved: Sequence[Sequence[Point]] = (),
    parting: Sequence[Sequence[Point]] = (),
) -> str:
    """A sheet's text: its properties and engraving, with other contours, and strokes added."""
    own = [
        (edges[0].start, *(edge.end for edge in edges))
        for layer, edges in found.strokes
        if layer == ENGRAVE
    ]
    around = Surroundings([*own, *engraved], parting, frame)
    return dxf_text(contours, found.properties, sheet=around)


NO_SPARES = ("order.spares=0", "order.spare_share=0")
"""Settings that leave the corner FREE free with the larger parts of ears too."""


def rearranged(
    name: str,
    change: Rearrange,
    settings: tuple[str, ...] = (),
) -> Fault:
    """Pieces of the first TPE sheet changed."""

    def put(specimen: Specimen) -> None:
        told, path = sheet_of(specimen)
        found = read_profile(path)
        region = Region(tuple(c for p in change(list(found.region.pieces)) for c in p.contours))
        path.write_text(
            drawn(found, cutting_sequence(region), (told["width"], told["length"])), newline="\n"
        )

    return Fault(name, DESIGNED, put, settings=settings)


def retold(name: str, rule: str, change: Callable[[str], str]) -> Fault:
    """The sheet's file with another text."""
    return edited(name, rule, lambda s: sheet_of(s)[1], of_text(change))


def with_first(change: Callable[[Region], Region]) -> Rearrange:
    """The largest piece changed, and put into the free upper right corner."""

    def rearrange(pieces: Pieces) -> Pieces:
        first, *others = sorted(pieces, key=lambda piece: -piece.area)
        return [to_corner(change(first), FREE), *others]

    return rearrange


def to_corner(piece: Region, corner: Point) -> Region:
    """The piece with the upper right corner of its box at a place."""
    _, _, high_x, high_y = piece.bounds
    return piece.moved(corner[0] - high_x, corner[1] - high_y)


def doubled(pieces: Pieces) -> Pieces:
    """One piece once more, in the free upper right corner."""
    return [*pieces, to_corner(pieces[0], FREE)]


def onto_pin(pieces: Pieces) -> Pieces:
    first, *others = pieces
    return [to_corner(first, (PIN[0] - 0.7, FREE[1])), *others]


def too_near(pieces: Pieces) -> Pieces:
    """One of the two nearest pieces moved towards the other."""
    reach = 3.0
    one, other = min(combinations(pieces, 2), key=lambda two: least_distance(*two, reach).value)
    gap = least_distance(one, other, reach).value
    for x, y in ((gap / 2, 0.0), (-gap / 2, 0.0), (0.0, gap / 2), (0.0, -gap / 2)):
        moved = other.moved(x, y)
        if 0 < least_distance(one, moved, reach).value < 0.8 * gap:
            return [moved if piece is other else piece for piece in pieces]
    raise AssertionError


def over_border(pieces: Pieces) -> Pieces:
    outermost = min(pieces, key=lambda piece: piece.bounds[0])
    return [p.moved(-0.5, 0.0) if p is outermost else p for p in pieces]


def of_another(pieces: Pieces) -> Pieces:
    """The last piece whose outline is unlike the first's in the place of the first."""
    first, *others = pieces
    other = next(p for p in reversed(others) if abs(p.outers[0].area - first.outers[0].area) > 0.1)
    return [to_corner(other, FREE), *others]


def undrilled(pieces: Pieces) -> Pieces:
    """One piece without its smallest hole."""
    drilled = next(piece for piece in pieces if piece.holes)
    least = max(drilled.holes, key=lambda hole: hole.area)
    whole = Region(tuple(contour for contour in drilled.contours if contour is not least))
    return [whole if piece is drilled else piece for piece in pieces]


def engraved_through(specimen: Specimen) -> None:
    claims, path = sheet_of(specimen)
    found = read_profile(path)
    low_x, low_y, high_x, high_y = found.region.pieces[0].bounds
    middle = (low_y + high_y) / 2
    stroke = ((low_x - 0.3, middle), (high_x + 0.3, middle))
    frame = claims["width"], claims["length"]
    path.write_text(drawn(found, cutting_sequence(found.region), frame, [stroke]), newline="\n")


def parted(specimen: Specimen) -> None:
    claims, path = sheet_of(specimen)
    found = read_profile(path)
    frame = claims["width"], claims["length"]
    stroke = ((0.0, 76.2), (frame[0], 76.2))
    contours = cutting_sequence(found.region)
    path.write_text(drawn(found, contours, frame, parting=[stroke]), newline="\n")
    assert CUT_SHEET in read_profile(path).layers


def framed(specimen: Specimen) -> None:
    claims, path = sheet_of(specimen)
    found = read_profile(path)
    frame = claims["width"] + 1.0, claims["length"]
    path.write_text(drawn(found, cutting_sequence(found.region), frame), newline="\n")


def holes_last(specimen: Specimen) -> None:
    claims, path = sheet_of(specimen)
    found = read_profile(path)
    contours = [*found.region.outers, *found.region.holes]
    path.write_text(drawn(found, contours, (claims["width"], claims["length"])), newline="\n")


def swapped(specimen: Specimen) -> None:
    """The TPE sheet's file in the place of the PTFE sheet's, and the other way round."""
    paths = [sheet_of(specimen, material)[1] for material in ("TPE", "PTFE")]
    texts = [path.read_text() for path in paths]
    for path, text in zip(paths, reversed(texts), strict=True):
        path.write_text(text, newline="\n")


def missing(specimen: Specimen) -> None:
    """Deleted, and struck from the list of hashes."""
    claims, path = sheet_of(specimen)
    path.unlink()
    specimen.doctor.set_manifest(lambda manifest: manifest["files"].pop(claims["file"]))


KIND = Kind(
    "Film sheets",
    "The layers' files are as they were written; the sheet is the first of TPE, with its hash put "
    "right. The mirrored part is put in with "
    '`registration.method = "ears"`, of 4 balloons: other parts have a mirror line.',
    (
        rearranged("part missing on a sheet", lambda pieces: pieces[1:]),
        rearranged("part doubled on a sheet", doubled),
        rearranged("part of another pattern on a sheet", of_another),
        rearranged(
            "part mirrored on a sheet",
            with_first(Region.mirrored),
            settings=(*EARS, *NO_SPARES),
        ),
        rearranged("part turned 2 degrees on a sheet", with_first(lambda p: p.turned(2.0))),
        rearranged("part scaled by 1.002 on a sheet", with_first(lambda p: p.scaled(1.002))),
        rearranged("bore missing on a sheet", undrilled),
        rearranged(
            "kerf applied twice on a sheet",
            lambda pieces: [grow(piece, KERF / 2) for piece in pieces],
            settings=(f"laser.kerf_tpe={KERF}",),
        ),
        rearranged(
            "part turned across an uneven kerf",
            with_first(lambda p: p.turned(90.0)),
            settings=("laser.kerf_tpe=[0.2, 0.1]",),
        ),
        rearranged("part too near to its neighbour", too_near),
        rearranged("part over the border", over_border),
        rearranged(
            "part on a pin", onto_pin, settings=(f"sheets.tpe.pins=[[{PIN[0]}, {PIN[1]}, 1.0]]",)
        ),
        Fault("engraving through a part", DESIGNED, engraved_through),
        Fault("parting cut through a sheet", DESIGNED, parted),
        Fault("frame of another size", DESIGNED, framed),
        retold("inch header of a sheet", INTEGRITY, inches),
        Fault("holes cut after outlines", INTEGRITY, holes_last),
        retold(
            "sheet that tells another kerf",
            DESIGNED,
            lambda text: text.replace("\nuncalibrated: nominal edges\n", "\ncompensated\n", 1),
        ),
        Fault("sheets of two films swapped", DESIGNED, swapped),
        Fault("sheet missing", DESIGNED, missing),
        told("no sheets in the manifest", lambda m: m.update(sheets=[])),
        told("wrong copies", lambda m: m.update(copies=2)),
        told("wrong spacing of a sheet", lambda m: m["sheets"][0].update(spacing=0.5)),
        told("wrong parts of a sheet", lambda m: m["sheets"][0]["parts"][0].update(count=9)),
        told("wrong area of a sheet's parts", lambda m: m["sheets"][0].update(parts_area=9.0)),
        told("wrong cut length of a sheet", lambda m: m["sheets"][0].update(cut_length=9.0)),
        told("wrong number of sheets", lambda m: m["films"][0].update(sheets=2)),
    ),
)
