"""Named shapes of a design file, and the regions that they enclose.

A shape may be composed of others by name; several layers may use the same shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, model_validator

from sbafab.design.files import hint, shown
from sbafab.design.outline import read_drawing, refuse_crossings
from sbafab.design.polylines import Polyline, polyline
from sbafab.design.toml_table import NamedTables, Section
from sbafab.design.units import LONGEST, Length, Millimetres
from sbafab.errors import DesignError
from sbafab.geometry.contour import Mark, tidy
from sbafab.geometry.edges import EPSILON, Point
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, difference, disc, polygon, stadium, strip, union


def is_pair(row: object) -> bool:
    return isinstance(row, list | tuple) and len(row) == 2


Coordinate = Annotated[float, Millimetres(-LONGEST, LONGEST)]
Coordinates = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Bulge = Annotated[float, Field(ge=-100, le=100)]
BulgedCoordinates = Annotated[tuple[Coordinate, Coordinate, Bulge], Field(strict=False)]
Vertex = Annotated[
    Annotated[Coordinates, Tag("(x, y)")] | Annotated[BulgedCoordinates, Tag("(x, y, bulge)")],
    Discriminator(lambda row: "(x, y)" if is_pair(row) else "(x, y, bulge)"),
]
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=200)]
Angle = Annotated[float, Field(ge=-360, le=360)]

NEEDS: Mapping[str, tuple[str, ...]] = {
    "disc": (),
    "ring": (),
    "slot": ("width",),
    "stadium": (),
    "polygon": (),
    "path": (),
    "file": (),
    "offset": ("by",),
    "fillet": ("radius",),
    "union": (),
    "difference": (),
    "pattern": ("count",),
}
"""Keys of a shape, exactly one per shape, and the keys required beside it."""
MOST_EDGES = 5000
"""Most edges of one shape; patterns of patterns would have any number."""
CENTRE = (0.0, 0.0)
PLACING = ("at", "turned")
PATTERNS = ("round", "step")
FURTHER: Mapping[str, tuple[str, ...]] = {"pattern": PATTERNS, "file": ("layer",)}
"""Keys optional for a shape of this kind."""


class NamedShape(Section):
    """A shape: a disc, ring, slot, stadium, polygon, path or drawing, or one composed of others."""

    disc: Length | None = None
    """Diameter of a disc."""
    ring: Annotated[tuple[Length, Length], Field(strict=False)] | None = None
    """Outer and inner diameter of a ring."""
    slot: Annotated[tuple[Coordinates, Coordinates], Field(strict=False)] | None = None
    """Ends of a straight slot with square ends, as wide as ``width``."""
    stadium: Annotated[tuple[Length, Length], Field(strict=False)] | None = None
    """Width along x and length along y of a slot with round ends."""
    polygon: Annotated[tuple[Coordinates, ...], Field(strict=False, min_length=3)] | None = None
    """Corners, in either order."""
    path: Annotated[tuple[Vertex, ...], Field(strict=False, min_length=2)] | None = None
    """Corners ``[x, y]`` in either order; ``[x, y, bulge]`` where an arc goes on to the next one.
    Its bulge is the tangent of a quarter of its angle: 1 for half a circle, less than 0 clockwise.
    """
    file: str | None = Field(default=None, min_length=1, max_length=1000)
    """A DXF or SVG file, or a ``laminate.json``: the area enclosed by its closed contours, at their
    place in it; a contour within another is a hole."""
    layer: str | None = Field(default=None, min_length=1, max_length=255)
    """The layer of a DXF file, the group of an SVG file (label or id) or the pattern of a
    ``laminate.json`` that is the shape; by default everything that a drawing shows."""
    offset: str | None = None
    """A shape that is grown ``by`` a distance; less than 0 shrinks it."""
    fillet: str | None = None
    """A shape whose concave corners are rounded to ``radius``."""
    union: Names | None = None
    """Shapes that are joined."""
    difference: Names | None = None
    """A shape, and the shapes that are cut out of it."""
    pattern: str | None = None
    """A shape repeated ``count`` times, evenly ``round`` a point or in steps of ``step``."""
    width: Length | None = None
    """Width of a slot."""
    by: Coordinate | None = None
    """Distance of an offset."""
    radius: Length | None = None
    """Radius of a fillet."""
    count: int | None = Field(default=None, ge=1, le=200)
    """Copies in a pattern."""
    round: Coordinates | None = None
    """The point that a pattern goes round."""
    step: Coordinates | None = None
    """From one copy of a pattern to the next, along x and y."""
    at: Coordinates = CENTRE
    """Position of the shape's origin."""
    turned: Angle = 0.0
    """Degrees by which it is first turned about its origin, counter-clockwise."""

    @property
    def kind(self) -> str:
        """The key that defines the shape."""
        return next(kind for kind in NEEDS if getattr(self, kind) is not None)

    @model_validator(mode="after")
    def _is_one_shape(self) -> Self:
        keys = [key for key in type(self).model_fields if getattr(self, key) is not None]
        kinds = [key for key in keys if key in NEEDS]
        if len(kinds) != 1:
            how = f"has {' and '.join(kinds)}" if kinds else "has none of its keys"
            raise ValueError(f"{how}; a shape is one of {', '.join(NEEDS)}")
        (kind,) = kinds
        missing = [key for key in NEEDS[kind] if key not in keys]
        if missing:
            raise ValueError(f"is a {kind} without {missing[0]}; add it")
        ways = [key for key in PATTERNS if key in keys]
        if kind == "pattern" and len(ways) != 1:
            raise ValueError(
                "is a pattern with both round and step, or neither; give one of the two"
            )
        for key in keys:
            allowed = (kind, *NEEDS[kind], *PLACING, *FURTHER.get(kind, ()))
            if key not in allowed:
                raise ValueError(f"is a {kind}, which has no {key}; remove it")
        if self.ring is not None and self.ring[0] <= self.ring[1]:
            raise ValueError(
                "is a ring whose first diameter, the outer one, must be larger than the second"
            )
        if self.stadium is not None and self.stadium[0] > self.stadium[1]:
            raise ValueError("is a stadium wider than it is long; swap the two and add turned = 90")
        if self.slot is not None and self.slot[0] == self.slot[1]:
            raise ValueError("is a slot with coincident ends; move one of them")
        return self


class NamedShapes(NamedTables):
    """Shapes by name, one table each."""

    what, names = "shape", "[a-z][a-z0-9_-]{0,31}"
    names_are = "a small letter and up to 31 small letters, digits, - or _"
    __pydantic_extra__: dict[str, NamedShape] = Field(init=False)


class ShapeRegions:
    """The shapes of a design as regions, each computed once."""

    def __init__(self, shapes: Mapping[str, NamedShape], files: Mapping[str, Path]) -> None:
        """Take shapes by name, and their drawings by key, such as ``shapes.rim.file``."""
        self.shapes = shapes
        self.files = files
        self._regions: dict[str, Region] = {}
        self._open: list[str] = []

    def of(self, name: str, user: str) -> Region:
        """Return the shape of this name for its ``user``, a key. Raises DesignError."""
        if name not in self.shapes:
            raise DesignError(
                f"{user} names a missing shape, {shown(name)}; {hint(name, self.shapes)}"
            )
        if name in self._open:
            raise DesignError(
                f"shapes.{name} is defined by itself through {' and '.join(self._open)}; use "
                "another shape"
            )
        if name not in self._regions:
            self._open.append(name)
            try:
                region = self._placed(name, self.shapes[name])
            finally:
                self._open.pop()
            if region.is_empty:
                raise DesignError(f"shapes.{name} encloses no area; change its dimensions")
            self._regions[name] = region
        return self._regions[name]

    def _placed(self, name: str, shape: NamedShape) -> Region:
        region = self._made(name, shape)
        if shape.turned:
            region = region.turned(shape.turned)
        return region.moved(*shape.at) if shape.at != CENTRE else region

    def _made(self, name: str, shape: Any) -> Region:
        def region(other: str) -> Region:
            return self.of(other, f"shapes.{name}.{shape.kind}")

        def cut() -> Region:
            first, *others = map(region, shape.difference)
            return difference(first, union(others))

        ways: Mapping[str, Callable[[], Region]] = {
            "disc": lambda: disc(CENTRE, shape.disc / 2),
            "ring": lambda: disc(CENTRE, shape.ring[0] / 2) - disc(CENTRE, shape.ring[1] / 2),
            "slot": lambda: strip(shape.slot[0], shape.slot[1], shape.width),
            "stadium": lambda: stadium(CENTRE, *shape.stadium),
            "polygon": lambda: _polygon(name, shape.polygon),
            "path": lambda: _path(name, shape.path),
            "file": lambda: read_drawing(self.files[f"shapes.{name}.file"], shape.layer),
            "offset": lambda: grow(region(shape.offset), shape.by),
            "fillet": lambda: fillet(region(shape.fillet), shape.radius),
            "union": lambda: union(map(region, shape.union)),
            "difference": cut,
            "pattern": lambda: _copies(name, region(shape.pattern), shape),
        }
        return ways[shape.kind]()


def _copies(name: str, region: Region, shape: Any) -> Region:
    count, about = shape.count, shape.round
    if len(region.edges) * count > MOST_EDGES:
        raise DesignError(
            f"shapes.{name}.count = {count} gives more than {MOST_EDGES} edges; use fewer copies"
        )
    if about is not None:
        return union(region.turned(360 * i / count, about) for i in range(count))
    x, y = shape.step
    return union(region.moved(i * x, i * y) for i in range(count))


def _polygon(name: str, points: Sequence[Point]) -> Region:
    loop = _simple_loop(f"shapes.{name}.polygon", [(x, y, 0.0) for x, y in points])
    return polygon([edge.start for edge in loop])


def _path(name: str, vertices: Sequence[tuple[float, ...]]) -> Region:
    key = f"shapes.{name}.path"
    contour = tidy(_simple_loop(key, marks_of(vertices)))
    if contour is None:
        raise DesignError(f"{key} encloses no area; move a corner, or give an edge a bulge")
    return Region((contour.reversed() if contour.is_hole else contour,))


def marks_of(vertices: Sequence[tuple[float, ...]]) -> list[Mark]:
    """Return x, y and bulge of each corner of a path."""
    marks = []
    for here, there in pairwise([*vertices, vertices[0]]):
        x, y, bulge = (*here, 0.0)[:3]
        # A nearly straight arc has a circle beyond all numbers.
        height = abs(bulge) * math.dist((x, y), there[:2]) / 2
        marks.append((x, y, bulge if height > EPSILON else 0.0))
    return marks


def _simple_loop(key: str, vertices: Sequence[Mark]) -> Polyline:
    """Return the closed loop through x, y and bulge of each corner. Raises DesignError."""
    corners = [(x, y) for x, y, _ in vertices]
    if any(start == end for start, end in pairwise([*corners, corners[0]])):
        raise DesignError(f"{key} repeats a corner; remove one")
    loop = polyline(vertices, closed=True)
    try:
        refuse_crossings(loop)
    except DesignError as error:
        raise DesignError(f"{key} {error}") from None
    return loop
