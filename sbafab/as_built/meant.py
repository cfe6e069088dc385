"""What a folder's design makes: the laminate that every cut file is held against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from sbafab.actuators import build
from sbafab.as_built.coarse import as_cut
from sbafab.cutting.files import compensated_paths
from sbafab.cutting.properties import CutSettings, curves_of
from sbafab.cutting.verify import check_contours
from sbafab.rules.limits import TOLERANCE
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.output.settings import cut_settings
from sbafab.rules.finding import Finding


class Expected(NamedTuple):
    """A layer's profile, and the path on which the beam leaves it."""

    profile: Region
    path: Region


class Meant(NamedTuple):
    """A design's laminate, and the path of the beam for each of its patterns."""

    laminate: Laminate
    paths: Mapping[str, Region]

    def layers(self, count: int) -> Sequence[Expected | None]:
        """What ``count`` layers, bottom to top, should be; None where the design has not so many.

        A layer too many or too few may be missing anywhere, so that none has its place then.
        """
        layers = self.laminate.layers
        if len(layers) != count:
            return [None] * count
        return [Expected(layer.profile, self.paths[layer.pattern]) for layer in layers]


class RunWork(NamedTuple):
    """What a run that has just written a folder knows of it: its design's part and findings."""

    meant: Meant
    findings: tuple[Finding, ...]


def meant_by(design: Design, curves: str | None) -> Meant | None:
    """The laminate of a design, drawn with such ``curves``; None where it cannot be built or cut.

    Of one in chords, the laminate that these cut.
    """
    try:
        settings = drawn_settings(design, (), curves)
        laminate = build(design)
        paths = compensated_paths(laminate, settings)
        if settings.curves.in_chords:
            laminate = as_cut(laminate, paths, settings)
        return Meant(laminate, paths)
    except (DesignError, GeometryError, OutputError, ArithmeticError):
        return None


def drawn_settings(design: Design, waived: tuple[str, ...], curves: str | None) -> CutSettings:
    """How a design's files are drawn with what the manifest says of their ``curves``."""
    return cut_settings(design, waived, curves_of(curves))


def departure(path: Region, expected: Region) -> str:
    """Where a path that was read back is not the expected one; empty where they agree.

    They agree where no edge is further off than the cut files promise (1 um).
    """
    try:
        check_contours(path, expected, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    return ""
