"""Stated sizes against closed formulas, and against shapely on fine chords, over random designs."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest
from shapely import Polygon

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.models.sizes import sizes

SAGITTA = 1e-4
BOND = 0.75
BLOB = "M -4 -2 L 5 -3 A 3 3 0 0 1 5 3 L -4 2 Z"


def farthest(regions: list[Region]) -> float:
    """Twice the farthest point from the axis, on chords."""
    points = [
        p for region in regions for contour in region.contours for p in contour.polygon(SAGITTA)
    ]
    return 2 * max(math.hypot(x, y) for x, y in points)


def overall(laminate: Laminate) -> float:
    return farthest([layer.profile for layer in laminate.layers])


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("diameters", [[5, 5, 12], [5, 12, 5], [12, 5, 5], [5], [5, 5, 5]])
def test_a_stack_of_discs_fits_its_widest_one(diameters: list[int], method: str) -> None:
    changes = {"stack.balloons": len(diameters), "chamber.diameter": diameters}
    design = load_design("1dof-5mm", [{**changes, "registration.method": method}])
    laminate = build(design)
    found = sizes(design, laminate)
    assert found["outline_diameter"] == pytest.approx(max(diameters) + 2 * BOND, abs=1e-6)
    assert found["overall_diameter"] == pytest.approx(overall(laminate), abs=2e-3)


@pytest.mark.parametrize("seed", range(8))
def test_lobes_reach_from_their_axes(seed: int) -> None:
    draw = random.Random(seed)
    diameters = [round(draw.uniform(4.0, 9.0), 2) for _ in range(draw.randint(1, 3))]
    bond = round(draw.uniform(0.75, 1.2), 3)
    changes = {
        "stack.balloons": len(diameters),
        "chamber.diameter": diameters,
        "chamber.count": draw.randint(2, 4),
        "bond.width": bond,
        "mask.overhang": draw.uniform(0.5, 0.7),
        "inlet.tab_length": draw.uniform(2, 8),
    }
    design = load_design("3dof-15mm", [changes])
    laminate = build(design)
    reach = math.hypot(*laminate.chambers[0].centres[0])
    found, outline = sizes(design, laminate), 2 * reach + max(diameters) + 2 * bond
    assert found["outline_diameter"] == pytest.approx(outline, abs=1e-6)
    assert found["overall_diameter"] == pytest.approx(overall(laminate), abs=2e-3)


@pytest.mark.parametrize("method", ["channel-pin", "ears"])
@pytest.mark.parametrize("balloons", [1, 3])
def test_a_drawn_outline_is_measured_round_the_axis(
    balloons: int, method: str, tmp_path: Path
) -> None:
    drawing = tmp_path / "blob.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="40mm" height="40mm" '
        f'viewBox="-20 -20 40 40"><path d="{BLOB}"/></svg>'
    )
    settings = [
        f'chamber.outline="{drawing}"',
        "chamber.diameter=5.0",
        f"stack.balloons={balloons}",
        f'registration.method="{method}"',
    ]
    design = load_design("1dof-5mm", settings)
    laminate = build(design)
    arc = [
        (5 + 3 * math.sin(i * math.pi / 2000), 3 * math.cos(i * math.pi / 2000))
        for i in range(2001)
    ]
    pocket = Polygon([(-4, -2), (-4, 2), *arc])
    grown = pocket.buffer(BOND, quad_segs=720)
    far = 2 * max(math.hypot(x, y) for x, y in grown.exterior.coords)
    assert sizes(design, laminate)["outline_diameter"] == pytest.approx(far, abs=2e-3)


@pytest.mark.parametrize("name", ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"])
@pytest.mark.parametrize("method", ["channel-pin", "ears"])
def test_width_and_length_hold_all_that_is_cut(name: str, method: str) -> None:
    settings = ["stack.balloons=2", f'registration.method="{method}"']
    design = load_design(name, settings)
    laminate = build(design)
    boxes = [
        Polygon(contour.polygon(SAGITTA)).bounds
        for layer in laminate.layers
        for contour in layer.profile.outers
    ]
    found = sizes(design, laminate)
    assert found["width"] == pytest.approx(max(b[2] for b in boxes) - min(b[0] for b in boxes))
    assert found["length"] == pytest.approx(max(b[3] for b in boxes) - min(b[1] for b in boxes))
    thickness = sum(layer.film.thickness for layer in laminate.layers)
    assert found["thickness"] == pytest.approx(thickness)
