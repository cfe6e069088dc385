"""Nests: numbers known by closed forms, and shapely as the other judge of gaps."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import STRtree, unary_union
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry import Polygon, box

from sbafab.actuators import build, load_design
from sbafab.cutting.lattice import Lattice, lattices_of
from sbafab.cutting.nesting import as_dict, from_dict, nest, of_material
from sbafab.cutting.placements import (
    TURNS,
    Nest,
    NestPart,
    Placement,
    Stock,
    check_nest,
    check_placed,
    least_distance,
    parts_of,
    placed,
)
from sbafab.errors import DesignError, OutputError
from sbafab.folders.build import make_build, stocks
from sbafab.geometry.region import Region, disc, polygon, rectangle, stadium


def part(region: Region, count: int, pattern: str = "P01") -> NestPart:
    return NestPart("demo", pattern, 1, "TPE", region, count)


def nested(parts: Sequence[NestPart], stock: Stock) -> Nest:
    (result,) = nest(parts, {"TPE": stock})
    check_nest(result)
    return result


@pytest.mark.parametrize(("spacing", "a_row"), [(1.0, 5), (0.4, 5), (2.0, 3)])
def test_squares_fill_the_grid_they_fit_in_exactly(spacing: float, a_row: int) -> None:
    """A row of n squares of 10 mm takes 10 n + spacing (n - 1); by area, none can be added."""
    usable = 10 * a_row + spacing * (a_row - 1)
    stock = Stock(width=usable + 20, length=usable + 20, spacing=spacing)
    square = rectangle((3.0, 4.0), (13.0, 14.0))
    assert nested([part(square, a_row**2)], stock).sheets == 1
    assert nested([part(square, a_row**2 + 1)], stock).sheets == 2


def test_no_part_goes_into_a_hole_which_is_cut_before_it() -> None:
    frame = rectangle((0.0, 0.0), (40.0, 40.0)) - rectangle((5.0, 5.0), (35.0, 35.0))
    stock = Stock(width=60, length=60)
    result = nested([part(frame, 1), part(disc((0.0, 0.0), 14.0), 1, "P02")], stock)
    assert result.sheets == 2


def test_only_turns_that_the_stock_allows_are_used() -> None:
    upright = Stock(width=60, length=200, turns=(0, 2))
    result = nested([part(rectangle((0.0, 0.0), (39.0, 5.0)), 12)], upright)
    assert {place.turn % 2 for place in result.placements} == {0}


def test_a_part_as_large_as_the_usable_area_is_nested() -> None:
    stock = Stock(width=52.437, length=61.291)
    whole = rectangle((1.0, 1.0), (33.437, 42.291))
    assert nested([part(whole, 2)], stock).sheets == 2


def test_parts_keep_clear_of_pins() -> None:
    pins = ((20.0, 20.0, 6.0), (50.0, 61.0, 3.0))
    stock = Stock(width=80, length=80, border=5, spacing=1.5, pins=pins)
    result = nested([part(rectangle((0.0, 0.0), (11.0, 9.0)), 30)], stock)
    assert result.sheets == 1
    for x, y, diameter in pins:
        pin = ShapelyPoint(x, y)
        nearest = min(pin.distance(shapely_of(result.region(p))) for p in result.placements)
        assert nearest >= diameter / 2 + 1.5 - 1e-6


def test_a_roll_is_cut_off_after_its_parts() -> None:
    """Twelve squares of 10 mm, four across: three rows and two spacings between borders."""
    stock = Stock(width=63, length=5000, roll=True)
    result = nested([part(rectangle((0.0, 0.0), (10.0, 10.0)), 12)], stock)
    assert result.sheets == 1
    assert result.length(0) == pytest.approx(10 + 3 * 10 + 2 * 1 + 10)


sizes = st.floats(2.0, 14.0)
regions = st.one_of(
    sizes.map(lambda d: disc((d, -d), d / 2)),
    st.tuples(sizes, sizes).map(lambda s: rectangle((-1.0, 2.0), (s[0] - 1.0, s[1] + 2.0))),
    st.tuples(sizes, sizes).map(lambda s: stadium((0.0, 0.0), min(s), max(s))),
    st.tuples(sizes, sizes).map(
        lambda s: polygon([(0.0, 0.0), (s[0], 0.0), (s[0], 1.0), (1.0, 1.0), (1.0, s[1] + 1)])
    ),
)


@settings(max_examples=12)
@given(st.lists(st.tuples(regions, st.integers(1, 5)), min_size=1, max_size=4), st.floats(0.1, 3.0))
def test_shapely_agrees_that_random_parts_are_apart(
    chosen: list[tuple[Region, int]], spacing: float
) -> None:
    stock = Stock(width=45.0, length=50.0, border=4.0, spacing=spacing, pins=((22.0, 25.0, 2.0),))
    result = nested(
        [part(region, count, f"P{i}") for i, (region, count) in enumerate(chosen)], stock
    )
    assert len(result.placements) == sum(count for _, count in chosen)
    judged(result)


# Faulty nests are refused with the place; distances agree with closed forms and shapely.


SQUARE = rectangle((0.0, 0.0), (10.0, 10.0))
STOCK = Stock(width=60, length=60, border=5, pins=((50.0, 50.0, 4.0),), most=2)


def nest_of(*shifts: tuple[float, float, int], count: int | None = None) -> Nest:
    placements = len(shifts) if count is None else count
    return Nest(
        material="TPE",
        stock=STOCK,
        parts=(NestPart("demo", "P01", 1, "TPE", SQUARE, placements),),
        placements=tuple(Placement(0, sheet, 0, (x, y)) for x, y, sheet in shifts),
    )


@pytest.mark.parametrize(
    ("faulty", "message"),
    [
        (nest_of((5, 5, 0), (15.9, 5, 0)), r"are 0\.9000 mm apart at x 15\.\d+, y \d+\.\d+"),
        (nest_of((5, 5, 0), (12, 8, 0)), r"overlap at x"),
        (nest_of((5, 5, 0), (5, 5, 0)), r"overlap at x"),
        (nest_of((4.9, 5, 0)), r"0\.1000 mm into the border"),
        (nest_of((5, 45.01, 0)), r"0\.0100 mm into the border"),
        (nest_of((45, 30, 0), (45, 45, 0)), r"pin at x 50, y 50 overlap"),
        (nest_of((37.5, 45, 0)), r"pin at x 50, y 50 are 0\.5000 mm apart"),
        (nest_of((5, 5, 0), count=2), r"not nested 2 times"),
        (nest_of((5, 5, 1)), r"too many parts or sheets"),
        (nest_of((5, 5, 0), (5, 5, 1), (5, 5, 2)), r"too many parts or sheets"),
    ],
)
def test_a_faulty_nest_is_refused(faulty: Nest, message: str) -> None:
    with pytest.raises(OutputError, match=message):
        check_nest(faulty)


def test_slack_allows_for_the_rounding_of_a_file() -> None:
    regions = [("a", SQUARE.moved(5, 5)), ("b", SQUARE.moved(15.9995, 5))]
    check_placed(regions, STOCK, slack=1e-3)
    with pytest.raises(OutputError, match="a and b"):
        check_placed(regions, STOCK)


def test_nothing_may_lie_in_a_hole_which_is_cut_first() -> None:
    frame = rectangle((34.0, 34.0), (55.0, 55.0)) - rectangle((36.0, 36.0), (53.0, 53.0))
    with pytest.raises(OutputError, match="frame and inside overlap"):
        check_placed([("frame", frame), ("inside", disc((40.0, 40.0), 2.5))], STOCK)
    with pytest.raises(OutputError, match="pin"):
        check_placed([("frame", frame)], STOCK)


spots = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


widths = st.floats(0.5, 3)
shapes = st.one_of(
    st.builds(disc, spots, widths),
    st.builds(lambda p, w, h: stadium(p, w, w + h), spots, widths, st.floats(0, 3)),
    st.builds(lambda p, w: polygon([p, (p[0] + w, p[1]), (p[0], p[1] + 2 * w)]), spots, widths),
)


@settings(max_examples=80)
@given(shapes, shapes, spots)
def test_shapely_finds_the_same_distance(a: Region, b: Region, shift: tuple[float, float]) -> None:
    b = b.moved(*shift)
    judge = Polygon(a.polygons(1e-5)[0][0]).distance(Polygon(b.polygons(1e-5)[0][0]))
    assert least_distance(a, b, 30.0).value == pytest.approx(judge, abs=3e-5)


# Saved placements come back for the same parts, and for nothing else.


PARTS = (
    NestPart("demo", "P01", 1, "TPE", rectangle((0.1, 0.2), (9.3, 7.7)), 7),
    NestPart("demo", "P02", 1, "PTFE", disc((0.0, 0.0), 3.3), 5),
    NestPart("demo", "P03", 1, "TPE", disc((1.0, 0.0), 4.1), 3),
)
STOCKS = {
    "TPE": Stock(width=40, length=40, border=5),
    "PTFE": Stock(width=50, length=40, border=5, spacing=0.7),
}


@pytest.fixture
def saved() -> Any:
    return json.loads(json.dumps(as_dict(nest(PARTS, STOCKS))))


def test_the_same_nests_come_back(saved: Any) -> None:
    assert from_dict(saved, PARTS, STOCKS) == nest(PARTS, STOCKS)


@pytest.mark.parametrize(
    "parts",
    [
        PARTS[:2],
        (replace(PARTS[0], count=8), *PARTS[1:]),
        (replace(PARTS[0], region=rectangle((0.1, 0.2), (9.3, 7.70001))), *PARTS[1:]),
        (replace(PARTS[0], design="other"), *PARTS[1:]),
    ],
)
def test_other_parts_are_nested_anew(saved: Any, parts: tuple[NestPart, ...]) -> None:
    assert from_dict(saved, parts, STOCKS) is None


@pytest.mark.parametrize("data", [None, [], "x", 3, {}, {"key": 1}])
def test_what_is_no_saved_nest_is_ignored(data: object) -> None:
    assert from_dict(data, PARTS, STOCKS) is None


@pytest.mark.parametrize(
    "row",
    [
        [0, 0, 0, 1.0],
        [9, 0, 0, 1.0, 2.0],
        [0, -1, 0, 1.0, 2.0],
        [0, 0, 5, 1.0, 2.0],
        [0, 0, 0, float("nan"), 2.0],
        [0, 0, 0, "1", 2.0],
        [1, 0, 0, 1.0, 2.0],
        None,
    ],
)
def test_a_spoilt_row_is_ignored(saved: Any, row: object) -> None:
    saved["nests"]["TPE"][0] = row
    assert from_dict(saved, PARTS, STOCKS) is None


def test_another_stock_and_a_missing_row_or_material_are_nested_anew(saved: Any) -> None:
    stocks = {**STOCKS, "PTFE": STOCKS["PTFE"].model_copy(update={"spacing": 0.8})}
    assert from_dict(saved, PARTS, stocks) is None
    del saved["nests"]["TPE"][0]
    assert from_dict(saved, PARTS, STOCKS) is None
    del saved["nests"]["TPE"]
    assert from_dict(saved, PARTS, STOCKS) is None


# What cannot be nested is refused in one sentence that names the field.


PLATE = NestPart("demo", "P02", 1, "TPE", rectangle((0.0, 0.0), (92.0, 40.0)), 1)
COINS, MANY = (
    NestPart("demo", "P03", 1, "PTFE", disc((0.0, 0.0), 5.0), n) for n in (30, 1_000_000)
)


def test_a_part_that_fits_in_another_turn_only_is_no_error() -> None:
    (result,) = nest([PLATE], {"TPE": Stock(width=62, length=120)})
    assert result.sheets == 1


@pytest.mark.parametrize(
    ("part", "stock", "says"),
    [
        (
            PLATE,
            Stock(width=72.4, length=72.4),
            r"P02 of demo \(92.0 x 40.0 mm\) .* usable 52.4 x 52.4 mm of sheets.tpe",
        ),
        (
            PLATE,
            Stock(width=80, length=60, border=30.0),
            "sheets.tpe.border of 30 mm .* below 30 mm",
        ),
        (
            PLATE,
            Stock(spacing=40.0, pins=((76.2, 76.2, 3.0),)),
            "does not fit 40 mm clear of the 1 sheets.tpe.pins",
        ),
        # Nine coins a sheet of 32 usable mm: 30 take four sheets.
        (
            COINS,
            Stock(width=52, length=52, most=3),
            "30 parts of PTFE need 4 sheets of 52 x 52 mm, sheets.ptfe.most allows 3",
        ),
        (MANY, Stock(), "need at least 4481 sheets"),
    ],
)
def test_what_does_not_fit_is_refused(part: NestPart, stock: Stock, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        nest([part], {"TPE": stock, "PTFE": stock})


# The parts of a laminate: every piece, counted over layers and copies.


@pytest.mark.parametrize(("copies", "template"), [(1, "3dof-15mm"), (4, "radial-15mm")])
def test_the_parts_hold_all_film_of_the_laminate(copies: int, template: str) -> None:
    laminate = build(load_design(template))
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    parts = parts_of(laminate, paths, copies)
    for material in ("TPE", "PTFE"):
        layers = [layer for layer in laminate.layers if layer.film.material == material]
        chosen = [part for part in parts if part.material == material]
        area = copies * sum(layer.profile.area for layer in layers)
        assert sum(part.count * part.region.area for part in chosen) == pytest.approx(area)
        pieces = copies * sum(len(layer.profile.pieces) for layer in layers)
        assert sum(part.count for part in chosen) == pieces
    assert {part.design for part in parts} == {laminate.name}


@pytest.mark.parametrize(
    ("copies", "wall", "base"),
    # Two films a balloon of six, less base, cap and the wall with the tab: 9 walls. A twentieth of
    # 9 is 0.45, of 54 is 2.7, of 180 is 9; of 1, 6 and 20 bases it is 0.05, 0.3 and 1.
    [(1, 1, 1), (6, 3, 1), (20, 9, 1)],
)
def test_every_pattern_has_a_twentieth_of_its_number_as_spares(
    copies: int, wall: int, base: int
) -> None:
    design = load_design("1dof-5mm", [f"order.copies={copies}"])
    laminate = build(design)
    paths = {pattern: layers[0].profile for pattern, layers in laminate.patterns.items()}
    plain = parts_of(laminate, paths, copies)
    spared = parts_of(laminate, paths, copies, design.order.spare_parts)
    more = {}
    for few, many in zip(plain, spared, strict=True):
        layers = laminate.patterns[few.pattern]
        pieces = few.count / (copies * len(layers))
        more[layers[0].role, len(layers)] = (many.count - few.count) / pieces
    assert min(more.values()) >= 1
    assert more["wall", 9] == wall
    assert more["base", 1] == base


# Lattices against packings known by closed forms, with shapely as the other judge of the gaps.


def best(shape: Region, spacing: float, width: float, length: float) -> Lattice:
    return lattices_of(shape, spacing, (0.0, 0.0, width, length), TURNS)[0]


def shapely_of(region: Region) -> Polygon:
    return Polygon(region.polygons(1e-4)[0][0])


def least_gap(shapes: Sequence[Polygon], near: float) -> float:
    """Return the least distance of two shapes, if it is less than ``near``."""
    outlines = np.array(shapes)
    first, second = STRtree(outlines).query(outlines, predicate="dwithin", distance=near)
    apart = first < second
    return float(
        shapely.distance(outlines[first[apart]], outlines[second[apart]]).min(initial=near)
    )


@pytest.mark.parametrize(("rows", "a_row"), [(7, 8), (8, 8), (15, 13)])
def test_discs_lie_in_the_densest_packing(rows: int, a_row: int) -> None:
    """Rows of discs half a pitch apart, sqrt(3)/2 of a pitch above each other (Thue)."""
    pitch = 11.0
    length = 10 + (rows - 1) * pitch * math.sqrt(3) / 2 + 0.002 * rows
    laid = best(disc((3.0, -2.0), 5.0), 1.0, 10 + (a_row - 1) * pitch + 0.002 * a_row, length)
    assert len(laid.places) == a_row * rows - rows // 2


@pytest.mark.parametrize("turned", [False, True])
def test_rectangles_fill_a_sheet_that_takes_two_lattices(turned: bool) -> None:
    """Two columns of 11 lying and one of 4 standing fill it: 26 x 44 mm, each with 0.5 mm of gap
    11 x 4 mm. Rows of one sort alone hold 22 or 24.
    """
    width, length = (43.5, 25.5) if turned else (25.5, 43.5)
    laid = best(rectangle((0.0, 0.0), (10.5, 3.5)), 0.5, width, length)
    assert len(laid.places) == 26 * 44 // (11 * 4)


def test_eighteen_membranes_of_a_finger_lie_on_one_sheet() -> None:
    """16 in pairs whose tabs pass each other, 117 mm wide, and two in the strip of 14.4 mm left."""
    design = load_design("finger")
    parts = of_material(make_build(design).pieces, "PTFE")
    (result,) = nest([replace(parts[0], count=18)], {"PTFE": stocks(design)["PTFE"]})
    assert result.sheets == 1
    judged(result)


def test_right_triangles_lie_in_pairs() -> None:
    """Turned by half, a triangle lies on the other's long side: 0.3 sqrt(2) mm off along x."""
    across, up = 9, 10
    pair = 10 + 0.3 * math.sqrt(2)
    width = across * pair + (across - 1) * 0.3 + 0.02
    laid = best(polygon([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)]), 0.3, width, up * 10.3 - 0.28)
    assert len(laid.places) >= 2 * across * up


lengths = st.floats(3.0, 12.0)
shapes_of_parts = st.one_of(
    lengths.map(lambda d: disc((d, -d), d / 2)),
    st.tuples(lengths, lengths).map(lambda s: stadium((0.0, 0.0), min(s), max(s))),
    st.tuples(lengths, lengths, lengths).map(
        lambda s: polygon([(0.0, 0.0), (s[0], 0.0), (s[1], s[2])])
    ),
    st.tuples(lengths, lengths).map(
        lambda s: polygon(
            [(0.0, 0.0), (s[0], 0.0), (s[0], 1.0), (1.0, 1.0), (1.0, s[1] + 1), (0.0, s[1] + 1)]
        )
    ),
    lengths.map(lambda d: rectangle((0.0, 0.0), (d, 9.0)) - disc((d, 4.5), 0.4 * d)),
)


@settings(max_examples=3)
@given(shapes_of_parts, st.floats(0.05, 3.0), st.floats(30.0, 60.0), st.floats(30.0, 60.0))
def test_shapely_agrees_that_copies_are_apart(
    shape: Region, spacing: float, width: float, length: float
) -> None:
    for laid in lattices_of(shape, spacing, (2.0, 3.0, 2.0 + width, 3.0 + length), TURNS)[:2]:
        shapes = [shapely_of(placed(shape, turn, shift)) for turn, shift in laid.places]
        assert shapes
        assert least_gap(shapes, spacing) >= spacing - 2e-4
        assert box(2, 3, 2 + width, 3 + length).buffer(1e-5).contains(unary_union(shapes))


def judged(result: Nest) -> None:
    """Ask shapely for the gaps between parts and to pins."""
    stock = result.stock
    for sheet in range(result.sheets):
        shapes = [shapely_of(result.region(place)) for place in result.on_sheet(sheet)]
        pins = [ShapelyPoint(x, y).buffer(d / 2, quad_segs=100) for x, y, d in stock.pins]
        assert least_gap([*shapes, *pins], stock.spacing) >= stock.spacing - 5e-4
        assert box(*stock.usable).buffer(1e-5).contains(unary_union(shapes))


TRIANGLE = polygon([(0.0, 0.0), (9.0, 0.0), (4.0, 7.0)])
BENT = polygon([(0.0, 0.0), (8.0, 0.0), (8.0, 1.0), (1.0, 1.0), (1.0, 7.0), (0.0, 7.0)])
BITTEN = rectangle((0.0, 0.0), (6.0, 9.0)) - disc((6.0, 4.5), 2.4)


@pytest.mark.parametrize(
    ("shapes", "spacing"),
    [((TRIANGLE, BENT, disc((1.0, 2.0), 4.0)), 0.6), ((BITTEN, TRIANGLE, BENT), 1.3)],
)
def test_parts_round_lattices_and_pins_are_apart(
    shapes: tuple[Region, ...], spacing: float
) -> None:
    stock = Stock(width=64.0, length=58.0, border=4.0, spacing=spacing, pins=((31.0, 22.0, 2.5),))
    rows = enumerate(zip(shapes, (70, 14, 5), strict=True))
    result = nested([part(shape, count, f"P{i}") for i, (shape, count) in rows], stock)
    assert result.sheets > 1
    judged(result)


def test_five_folded_pouches_lie_on_one_sheet() -> None:
    """As sparrow packs them; two lattices hold four, as bottom-left alone does."""
    design = load_design("folded", ("order.copies=4",))
    parts = of_material(make_build(design).pieces, "PE")
    stock = stocks(design)["PE"]
    low_x, low_y, high_x, high_y = stock.usable
    assert len(best(parts[0].region, stock.spacing, high_x - low_x, high_y - low_y).places) == 4
    (result,) = nest(parts, {"PE": stock})
    assert len(result.placements) == 5
    assert result.sheets == 1
    judged(result)


def test_only_allowed_turns_are_in_lattices() -> None:
    triangle = polygon([(0.0, 0.0), (7.0, 0.0), (2.0, 11.0)])
    for laid in lattices_of(triangle, 1.0, (0.0, 0.0, 50.0, 80.0), (0, 2)):
        assert {turn for turn, _ in laid.places} <= {0, 2}


def commonest(role: str, count: int) -> NestPart:
    """The shape that most layers of the 15 mm actuator have in a role."""
    patterns = build(load_design("3dof-15mm")).patterns.values()
    layer = max((own for own in patterns if own[0].role == role), key=len)[0]
    return NestPart("3dof", role, 1, "TPE", layer.profile, count)


def test_the_commonest_plate_lies_closer_than_bottom_left_puts_it() -> None:
    """Walls of the 15 mm actuator at 1.23 mm on 132.4 mm: 105 a sheet, 96 by bottom-left alone."""
    result = nested([commonest("wall", 210)], Stock(spacing=1.23))
    assert result.sheets == 2
    judged(result)


def test_forty_lobed_plates_and_39_separators_lie_on_one_sheet() -> None:
    """On the 132.4 mm square that a border of 10 mm leaves of the press's heated area."""
    parts = [commonest("wall", 40), commonest("separator-mask", 39)]
    result = nested(parts, Stock())
    assert (len(result.placements), result.sheets) == (79, 1)
