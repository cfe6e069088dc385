"""Records that functions of ``api`` take and return, by name: for annotations."""

from __future__ import annotations

from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.design.records import Design
from sbafab.folders.checks_json import FindingEntry
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Surface
from sbafab.models.stack import Motion, Pose, Stack
from sbafab.reports.nets_svg import NetMap
from sbafab.rules.finding import Finding

__all__ = [
    "Assembled",
    "Design",
    "Finding",
    "FindingEntry",
    "Laminate",
    "Motion",
    "NetMap",
    "PlacedPart",
    "Pose",
    "Region",
    "Stack",
    "Surface",
]
