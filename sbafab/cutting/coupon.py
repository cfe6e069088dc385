"""The calibration piece: four frames of film whose sizes tell how wide the beam cuts.

A frame's outside comes out smaller by the kerf, its window larger, and the piece that falls out of
the window smaller again. Sides along x and y differ, so that a frame that fell out still tells
which is which. A window and its piece are drawn alike, so that they tell a reading error, which
makes both larger, from kerf; several sizes tell a scale from both.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.lettering import Stroke, strokes
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import coupon_properties
from sbafab.cutting.svg_write import sheet_svg
from sbafab.cutting.verify import check_surroundings, verify_file
from sbafab.errors import DesignError
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import rectangle
from sbafab.spreadsheet import csv_text

SIZE = 60.0
"""Side in mm of the film that the piece needs."""
COLUMNS = ("feature", "axis", "nominal_mm", "measured_mm")
HINTS = (
    "# Cut coupon.dxf with kerf offset 0; measure each size in the middle of the side; "
    "leave what you cannot measure empty",
    "# A piece is what fell out of the window of A: keep it",
    "# A scan at 2400 dpi or a microscope touches no edge; a calliper bends thin film",
)
LETTER = 2.4
TITLE = "KERF COUPON"


class CouponFrame(NamedTuple):
    """A frame of film: its name, lower left corner, outside and window along x and y, in mm."""

    name: str
    corner: Point
    outer: tuple[float, float]
    window: tuple[float, float]

    @property
    def region(self) -> Region:
        return self._box(self.outer) - self._box(self.window)

    def _box(self, size: tuple[float, float]) -> Region:
        x, y = self.corner[0] + self.outer[0] / 2, self.corner[1] + self.outer[1] / 2
        return rectangle((x - size[0] / 2, y - size[1] / 2), (x + size[0] / 2, y + size[1] / 2))


FRAMES = (
    CouponFrame("A", (4.0, 34.0), (24.0, 20.0), (14.0, 10.0)),
    CouponFrame("B", (32.0, 34.0), (24.0, 20.0), (14.0, 10.0)),
    CouponFrame("C", (8.0, 12.0), (16.0, 12.0), (8.0, 6.0)),
    CouponFrame("D", (36.0, 12.0), (16.0, 12.0), (8.0, 6.0)),
)


def coupon() -> Region:
    """The frames, nominal, on a square of film with its lower left corner at the origin."""
    return union(frame.region for frame in FRAMES)


def coupon_csv() -> str:
    """The table to fill in: a row for each size along each axis."""
    rows: list[Sequence[str]] = [COLUMNS]
    for frame in FRAMES:
        sizes = {"outer": frame.outer, "window": frame.window, "piece": frame.window}
        rows += [
            (f"{frame.name} {kind}", axis, f"{nominal:g}", "")
            for kind, size in sizes.items()
            for axis, nominal in zip("xy", size, strict=True)
        ]
    return "".join(f"{hint}\n" for hint in HINTS) + csv_text(rows)


def write_coupon(folder: Path, generator: str) -> tuple[Path, ...]:
    """Writes ``coupon.dxf``, ``.svg`` and ``.csv``, read back; never over an old one.

    Raises DesignError where one exists, OutputError where the file does not read back as drawn.
    """
    paths = tuple(folder / f"coupon.{ending}" for ending in ("dxf", "svg", "csv"))
    for path in paths:
        if path.exists():
            raise DesignError(f"{path} exists; choose another folder or remove it first")
    folder.mkdir(parents=True, exist_ok=True)
    region, properties = coupon(), coupon_properties(generator)
    contours = cutting_order(region)
    sheet = Surroundings(engraved=_labels(), frame=(SIZE, SIZE))
    drawing, picture, table = paths
    drawing.write_bytes(dxf_text(contours, properties, sheet=sheet).encode())
    verify_file(drawing, region, properties)
    check_surroundings(read_profile(drawing), sheet)
    picture.write_bytes(sheet_svg(contours, sheet, SIZE, SIZE, TITLE).encode())
    table.write_bytes(coupon_csv().encode())
    return paths


def _labels() -> tuple[Stroke, ...]:
    """Names in the waste over each frame; a title that shows which way x runs."""
    names = [strokes(f.name, (f.corner[0], f.corner[1] + f.outer[1] + 1.2), LETTER) for f in FRAMES]
    title = strokes(f"{TITLE} - X", (8.0, 4.0), LETTER)
    x, y = 44.5, 4.0 + LETTER / 2
    tip = (x + 8, y)
    arrow = (((x, y), tip), ((x + 6.5, y + 1), tip, (x + 6.5, y - 1)))
    return (*(stroke for name in names for stroke in name), *title, *arrow)
