"""Seams and folds made otherwise than designed: the paths of tools, and film cut at its fold."""

from __future__ import annotations

from collections.abc import Callable

from sbafab.cutting.dxf_write import seam_text
from sbafab.cutting.layer_files import read_seam, seam_path
from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.region import Region, strip
from sbafab.laminate.laminate import Laminate, Layer
from tests.faults.record import Fault, Kind, redrawn
from tests.faults.specimen import Specimen

TEMPLATE = "folded"
DESIGNED = "as-designed"
Chain = tuple[Edge, ...]
"""The path of the template's seams, all straight."""


def seamed(name: str, rule: str, change: Callable[[Chain], Chain], beside: bool = False) -> Fault:
    """A fault in the path of the first seam."""

    def put(specimen: Specimen) -> None:
        path = specimen.doctor.folder / seam_path(specimen.clean.seams[0])
        (chain,), properties = read_seam(path)
        path.write_text(seam_text((change(chain),), properties), newline="\n")

    return Fault(name, rule, put, beside=beside, templates=(TEMPLATE,))


def narrowed(specimen: Specimen) -> None:
    """A tool half as wide, in the seam's file."""
    seam = specimen.clean.seams[0]
    path = specimen.doctor.folder / seam_path(seam)
    (chain,), properties = read_seam(path)
    width = NARROW * seam.width
    text = seam_text((chain,), {**properties, "TOOL_WIDTH": f"{width:g}"})
    path.write_text(text, newline="\n")


NARROW = 0.3
SHIFT = 0.15


def shifted(chain: Chain) -> Chain:
    def moved(p: Point) -> Point:
        return p[0] + SHIFT, p[1]

    return tuple(Line(moved(edge.start), moved(edge.end)) for edge in chain)


def cut_short(chain: Chain) -> Chain:
    """Without its last edge, toward the mouth."""
    return chain[:-1]


def folded(laminate: Laminate) -> Layer:
    return laminate.layer(laminate.folds[0].lower)


def slit(region: Region, laminate: Laminate) -> Region:
    """The film cut through along its fold: a slit of 0.2 mm between its halves."""
    return region - strip(*laminate.folds[0].line, 0.2)


KIND = Kind(
    "Seams and folds",
    "Put into the template of a folded film: a seam's path is moved by 0.15 mm or loses its last "
    "edge, its tool has 0.3 of its width, and the film is slit by 0.2 mm along its fold.",
    (
        seamed("seam's path shifted", DESIGNED, shifted, beside=True),
        seamed("seam's path cut short", "sealing", cut_short),
        Fault("seam too narrow", "bond-width", narrowed, templates=(TEMPLATE,)),
        redrawn("film slit along its fold", "sealing", folded, slit, templates=(TEMPLATE,)),
    ),
)
