"""Registered sheets: whole films on corner pins that hold several copies until a second cut.

Of every layer the first cut leaves one sheet. Films hold their parts by bridges, mask sheets hold
theirs by the transfer film they lie on. All stacked and pressed, the second cut takes a slot out of
every bridge and so frees the actuators. Lengths mm, in the frame of the first copy.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Layer


@dataclass(frozen=True)
class SheetPanel:
    """The registered sheets of a laminate, pressed together as a batch.

    ``places`` are the axes of the copies, the first at the origin; ``sheets`` what the first cut
    leaves of each layer, bottom to top and seen from above; ``second`` all slots of the second cut;
    ``window`` the room that every film sheet leaves round one copy; ``batches`` how many such
    panels make all copies.
    """

    outline: Region
    places: tuple[Point, ...]
    sheets: tuple[Region, ...]
    second: Region
    fiducials: tuple[Point, ...]
    fiducial_diameter: float
    window: Region
    batches: int

    @property
    def size(self) -> tuple[float, float]:
        """Width and length of a sheet."""
        low_x, low_y, high_x, high_y = self.outline.bounds
        return high_x - low_x, high_y - low_y

    def holds(self, p: Point, place: Point) -> bool:
        """Whether a point of a sheet lies in the window of the copy at ``place``."""
        return self.window.contains((p[0] - place[0], p[1] - place[1]))


@dataclass(frozen=True)
class Freed:
    """A sheet after the second cut: ``parts`` of each copy in its own frame, frame and crumbs.

    A part that is still held is part of the ``frame``, and missing.
    """

    frame: Region
    parts: tuple[Region, ...]
    crumbs: tuple[Region, ...] = field(default=())


def freed(panel: SheetPanel, layer: Layer) -> Freed:
    """What the sheet of a layer falls into.

    Mask sheets fall apart in the first cut; what the second one takes of a mask is past the part.
    """
    cut = Region() if layer.is_mask else panel.second
    return _freed(panel.sheets[layer.index - 1], cut, panel)


@lru_cache(maxsize=64)
def _freed(sheet: Region, cut: Region, panel: SheetPanel) -> Freed:
    places = panel.places
    pieces = (sheet - cut).pieces if not cut.is_empty else sheet.pieces
    if not pieces:
        return Freed(Region(), tuple(Region() for _ in places))
    frame = max(pieces, key=lambda piece: Region(piece.outers).area)
    found: list[list[Region]] = [[] for _ in places]
    crumbs = []
    for piece in pieces:
        if piece is frame:
            continue
        p = piece.outers[0].edges[0].at(0.5)
        home = next((i for i, place in enumerate(places) if panel.holds(p, place)), None)
        if home is None:
            crumbs.append(piece)
        else:
            x, y = places[home]
            found[home].append(piece.moved(-x, -y))
    parts = tuple(Region(tuple(c for piece in own for c in piece.contours)) for own in found)
    return Freed(frame, parts, tuple(crumbs))
