"""Joints of a laminate beside pressed bonds: seams of a moving tool, folds, and the nets of ports.

Lengths are mm, in the frame of the laminate as it lies when it is finished. Layers are named by
their index, counted from 1 at the bottom.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sbafab.geometry.edges import Edge, Point

SeamTool = Literal["laser", "hot-tip", "ultrasonic", "roller"]
"""A moving tool that bonds two films along a path."""
SeamKind = Literal["lap", "fin"]
"""A lap seam bonds films that lie flat on each other; a fin seam bonds edges that stand out."""


@dataclass(frozen=True)
class Seam:
    """A bond that a tool makes along a path, between the structural layers ``below`` and ``above``.

    ``path`` holds chains of edges, each open or closed; the bond reaches half of ``width`` to both
    sides of it. ``order`` counts the seams in the order in which they are made, from 1.
    """

    name: str
    below: int
    above: int
    path: tuple[tuple[Edge, ...], ...]
    width: float
    tool: SeamTool
    kind: SeamKind = "lap"
    order: int = 1


@dataclass(frozen=True)
class Fold:
    """A film folded along a straight line: layers ``lower`` and ``upper`` are halves of one part.

    ``line`` are two points of the fold. Film goes on from one half to the other there, so that
    nothing leaks through a fold. The part is cut flat: the upper half mirrored about the line.
    """

    lower: int
    upper: int
    line: tuple[Point, Point]


@dataclass(frozen=True)
class Port:
    """A named place at ``at`` in the gap between the structural layers ``below`` and ``above``.

    Nets are declared between ports: the mouth of an inlet, a pocket, the end of a channel.
    """

    name: str
    below: int
    above: int
    at: Point


@dataclass(frozen=True)
class Net:
    """Ports that are meant to be joined by voids, and to no other port nor to the outside."""

    name: str
    ports: tuple[str, ...]
