"""What is summed up over the edges of a closed chain: area, length, boxes, turns round a point."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sbafab.geometry.edges import EPSILON, Bounds, Edge, Point, turns_round


def enclosed_area(edges: tuple[Edge, ...]) -> float:
    """Area in mm2 to the left of a closed chain: negative where it runs clockwise."""
    ox, oy = edges[0].start
    twice = 0.0
    bulges = 0.0
    for edge in edges:
        x0, y0 = edge.start
        x1, y1 = edge.end
        twice += (x0 - ox) * (y1 - oy) - (x1 - ox) * (y0 - oy)
        bulges += edge.segment_area
    return twice / 2 + bulges


def length_of(edges: tuple[Edge, ...]) -> float:
    """Length in mm."""
    return sum([edge.length for edge in edges])


def boxes_of(edges: tuple[Edge, ...]) -> tuple[Bounds, ...]:
    """The bounds of each edge."""
    return tuple([edge.bounds for edge in edges])


def box_round(boxes: Sequence[Bounds]) -> Bounds:
    """The box that holds all of them; of none, one that holds nothing."""
    left = low = math.inf
    right = high = -math.inf
    for box in boxes:
        left = min(left, box[0])
        low = min(low, box[1])
        right = max(right, box[2])
        high = max(high, box[3])
    return left, low, right, high


def times_round(edges: tuple[Edge, ...], boxes: tuple[Bounds, ...], p: Point) -> int:
    """How many times a closed chain runs counter-clockwise round ``p`` (not on an edge)."""
    y = p[1]
    turns = 0
    for edge, box in zip(edges, boxes, strict=True):
        if box[1] - EPSILON <= y <= box[3] + EPSILON:
            turns += turns_round(edge, p)
    return turns
