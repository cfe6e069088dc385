"""KLayout's own checks find the widths and overhangs that our rules measure."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region, disc, polygon, rectangle, strip
from sbafab.geometry.width import least_gap, least_width
from sbafab.laminate.laminate import Laminate
from tests.interop.judging import TOLERANCE, compared, overhang, widths
from tests.properties.designs import Draft, valid

pytestmark = pytest.mark.long

RING = disc((0.0, 0.0), 3.25) - disc((0.0, 0.0), 2.5)


def built(draft: Draft) -> Laminate:
    with TemporaryDirectory() as folder:
        return build(load_design(draft.write(Path(folder))))


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        (RING, 0.75),
        (disc((0.0, 0.0), 3.25) - disc((0.1, 0.0), 2.5), 0.65),
        (RING | strip((2.8, 0.0), (6.0, 0.0), 0.4), 0.4),
        # Square on the shorter side of the slanted bar: 3 x 4 / 5.
        (polygon([(0.0, 0.0), (3.0, 4.0), (3.0, 8.0), (0.0, 4.0)]), 2.4),
    ],
)
def test_both_measure_the_width_that_a_closed_formula_gives(
    region: Region, expected: float
) -> None:
    ours = least_width(region, 30.0)
    found = compared("bond", region, 1, ours)
    assert ours is not None
    assert found is not None
    assert found.how == "square"
    assert ours.value == pytest.approx(expected)
    assert found.theirs == pytest.approx(expected, abs=TOLERANCE)


def bulging() -> tuple[Region, float]:
    """Two lobes 60 degrees off an axis, and the disc between them that ends their slot.

    Hub and lobe meet where the law of cosines says; the slot ends between two such corners.
    """
    hub, lobe, away, turn = 5.565, 5.721, 8.0, math.radians(60.0)
    region = disc((0.0, 0.0), hub)
    for side in (-1, 1):
        region = region | disc((away * math.cos(turn), side * away * math.sin(turn)), lobe)
    corner = turn - math.acos((hub**2 + away**2 - lobe**2) / (2 * hub * away))
    return region, 2 * hub * math.sin(corner)


@pytest.mark.parametrize(
    ("region", "expected"),
    [(rectangle((0.0, 0.0), (4.0, 4.0)) | disc((5.6, 2.0), 1.2), 0.4), bulging()],
)
def test_both_measure_the_slot_that_a_closed_formula_gives(region: Region, expected: float) -> None:
    found = compared("slot", region, 1, least_gap(region, 15.0))
    assert found is not None
    assert found.ours == pytest.approx(expected)
    assert found.agrees, found


@settings(max_examples=6)
@given(valid())
def test_klayout_finds_the_least_bonds_webs_and_slots_of_random_designs(draft: Draft) -> None:
    found = list(widths(built(draft)))
    assert [measure for measure in found if not measure.agrees] == []
    assert {measure.how for measure in found if measure.what == "bond"} == {"square"}


@settings(max_examples=6)
@given(valid())
def test_klayout_finds_the_least_overhang_of_random_designs(draft: Draft) -> None:
    found = overhang(built(draft))
    assert found is not None
    assert found.theirs is not None
    assert found.agrees, found
    assert found.ours >= draft.tables["mask"]["overhang"] - 0.001
