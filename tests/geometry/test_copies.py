"""Copies of a contour are told from what only looks like one."""

from __future__ import annotations

from sbafab.geometry.contour import Copies
from sbafab.geometry.region import disc, polygon, stadium


def test_moved_contours_are_copies_and_others_are_not() -> None:
    copies = Copies()
    [slot] = stadium((1.0, 2.0), 3.0, 8.0).contours
    assert copies.first(slot) is slot
    assert copies.first(stadium((-7.3, 0.1), 3.0, 8.0).contours[0]) is slot
    for b in (
        stadium((1.0, 2.0), 3.0, 8.0 + 1e-6),
        stadium((1.0, 2.0), 8.0, 3.0).turned(90.0),
        stadium((1.0, 2.0), 3.0, 8.0).mirrored().scaled(1.0000001),
        disc((1.0, 2.0), 1.5),
        polygon([(0.0, 0.0), (3.0, 0.0), (3.0, 8.0), (0.0, 8.0)]),
    ):
        [contour] = b.contours
        assert copies.first(contour) is not slot
    assert copies.first(slot.reversed()) is not slot
