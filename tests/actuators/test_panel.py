"""Registered sheets hold every part until the second cut, which leaves just the parts."""

from __future__ import annotations

import math
from functools import cache

import pytest
from shapely.geometry import MultiPolygon

from sbafab.actuators import build, load_design
from sbafab.errors import DesignError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, SheetPanel

SHEET = ('registration.method="sheet"', "registration.experimental=true")
ONE = ("1dof-5mm", "stack.balloons=2", "order.copies=2")
LOBED = ("3dof-15mm", "stack.balloons=2", "order.copies=3")
EIGHT = ("3dof-15mm", "stack.balloons=2", "chamber.count=8")


@cache
def made(template: str, *changes: str) -> Laminate:
    return build(load_design(template, [*SHEET, *changes]))


def panel_of(laminate: Laminate) -> SheetPanel:
    assert laminate.panel is not None
    return laminate.panel


def polygons(region: Region) -> MultiPolygon:
    return region.shapely(chord_error=1e-4)


@pytest.mark.parametrize("design", [ONE, LOBED])
def test_the_second_cut_frees_every_copy_as_shapely_sees_it(design: tuple[str, ...]) -> None:
    laminate = made(*design)
    panel = panel_of(laminate)
    for layer in laminate.layers:
        sheet = polygons(panel.sheets[layer.index - 1])
        if layer.is_mask:
            pieces = list(sheet.geoms)
        else:
            assert len(sheet.geoms) == 1, "every part hangs in its sheet before the second cut"
            left = sheet - polygons(panel.second)
            pieces = list(getattr(left, "geoms", [left]))
        frame = max(pieces, key=lambda piece: piece.envelope.area)
        parts = MultiPolygon([piece for piece in pieces if piece is not frame])
        wanted = MultiPolygon(
            [
                piece
                for place in panel.places
                for piece in polygons(layer.profile.moved(*place)).geoms
            ]
        )
        assert parts.symmetric_difference(wanted).area < 0.02 * len(panel.places)


@pytest.mark.parametrize("design", [ONE, EIGHT])
def test_three_bridges_hold_a_film_of_every_copy(design: tuple[str, ...]) -> None:
    panel = panel_of(made(*design))
    assert len(panel.second.pieces) == 3 * len(panel.places)
    # 1.0 wide, of which the slot takes 0.6 along.
    for piece in (panel.sheets[0] & panel.second).pieces:
        assert piece.area == pytest.approx(0.6)


def test_no_sheet_goes_on_its_pins_turned_or_flipped() -> None:
    laminate = made(*ONE)
    x0, y0, x1, y1 = panel_of(laminate).outline.bounds
    middle = (x0 + x1) / 2, (y0 + y1) / 2
    corners = [(p.centre[0] - middle[0], p.centre[1] - middle[1]) for p in laminate.pins]
    for sx, sy in ((-1, 1), (1, -1), (-1, -1)):
        worst = max(min(math.dist((sx * x, sy * y), c) for c in corners) for x, y in corners)
        assert worst > laminate.pins[0].diameter


def test_mask_sheets_are_cut_turned_over_and_films_are_not() -> None:
    laminate = made(*ONE)
    base, mask = laminate.layers[:2]
    sheets = panel_of(laminate).sheets
    assert laminate.first_cut(base) == sheets[0]
    assert laminate.first_cut(mask) == sheets[1].mirrored() != sheets[1]


@pytest.mark.parametrize(("copies", "each", "batches"), [(1, 1, 1), (70, 35, 2), (71, 24, 3)])
def test_copies_are_spread_over_as_few_batches_as_film_and_platen_allow(
    copies: int, each: int, batches: int
) -> None:
    # Films of 152.4 with borders of 10 leave 132.4. A window reaches 2 mm past disc (3.25 and a
    # stub), tab's end (8.25) and strip (0.5); 12 mm lie round all, 4 between: 5 by 7 fit.
    panel = panel_of(made("1dof-5mm", "stack.balloons=2", f"order.copies={copies}"))
    assert (len(panel.places), panel.batches) == (each, batches)
    assert max(panel.size) <= 132.4


@pytest.mark.parametrize(
    ("design", "said"),
    [
        (("radial-15mm",), "a radial design cannot be made in registered sheets"),
        (
            ("1dof-5mm", "stack.balloons=2", "chamber.diameter=[5, 7]"),
            "balloons of different sizes cannot be made in registered sheets",
        ),
        (("1dof-5mm", "chamber.diameter=110"), "film and platen take 132.4 x 132.4"),
        (("3dof-15mm", "panel.bridge_width=9"), "leave no room for 3 bridges"),
    ],
)
def test_what_sheets_cannot_make_is_refused_with_the_reason(
    design: tuple[str, ...], said: str
) -> None:
    with pytest.raises(DesignError, match=said):
        made(*design)
