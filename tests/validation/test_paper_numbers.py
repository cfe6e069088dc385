"""The paper's numbers, and what geometry makes of them (paper Sec. 2 and 2.1)."""

from __future__ import annotations

import math

import pytest

from sbafab.actuators import build, load_design
from sbafab.actuators.radial import RadialDesign
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import Factors
from sbafab.models.sizes import sizes


def laminate(name: str, *assignments: str) -> Laminate:
    return build(load_design(name, assignments))


def of_role(lam: Laminate, role: str) -> list[Region]:
    return [layer.profile for layer in lam.layers if layer.role == role]


def radius_about_axis(region: Region) -> float:
    return max(edge.farthest_from((0.0, 0.0)) for edge in region.edges)


def test_layers_of_the_3dof() -> None:
    """30 TPE, 15 chamber masks of three discs of 5 round 4.25, 14 separators in a circle of 16;
    walls in one of 15, a lumen of 2 in every layer, 1.865 thick (docs/paper.md).
    """
    lam = laminate("3dof-15mm")
    chambers, separators = of_role(lam, "chamber-mask"), of_role(lam, "separator-mask")
    assert (len(lam.tpe_layers), len(chambers), len(separators)) == (30, 15, 14)
    plain = [layer.profile for layer in lam.tpe_layers if layer.balloon != 1]
    assert len(plain) == 28
    for profiles, diameter in ((plain, 15.0), (separators, 16.0)):
        for profile in profiles:
            assert 2 * radius_about_axis(profile) == pytest.approx(diameter, abs=0.002)
    assert sizes(load_design("3dof-15mm"), lam)["outline_diameter"] == pytest.approx(15.0)
    for layer in lam.layers:
        if layer.role == "chamber-mask":
            assert layer.profile.distance_to_edge((0.0, 0.0)) > 1.0
            assert not layer.profile.contains((0.0, 0.0))
        else:
            lumen = [hole for hole in layer.profile.holes if hole.circle == ((0.0, 0.0), 1.0)]
            assert len(lumen) == 1
    for profile in chambers[1:]:
        circles = [outer.circle for outer in profile.outers]
        assert [circle and circle[1] for circle in circles] == pytest.approx([2.5] * 3)
        assert [circle and math.hypot(*circle[0]) for circle in circles] == pytest.approx(
            [4.25] * 3
        )
    # 30 x 0.038 + 29 x 0.025; the paper measures 0.95.
    assert lam.thickness == pytest.approx(1.865, abs=1e-9)


@pytest.mark.parametrize(("name", "diameter"), [("1dof-5mm", 6.5), ("1dof-10mm", 11.5)])
def test_1dof_caps_are_discs(name: str, diameter: float) -> None:
    (cap,) = of_role(laminate(name), "cap")
    (contour,) = cap.contours
    assert contour.circle is not None
    assert 2 * contour.circle[1] == pytest.approx(diameter)


def test_radial_sizes() -> None:
    design = load_design("radial-15mm")
    assert isinstance(design, RadialDesign)
    found = sizes(design, build(design), Factors())
    assert found["pitch"] == pytest.approx(15.708, abs=0.0005)
    assert found["deflated_diameter"] == pytest.approx(15.328, abs=1e-9)
    assert found["inflated_diameter"] == pytest.approx(28.06, abs=0.005)
    # Sec. 2.1: about 28; balloons that hold the most stay below the cylinder.
    assert found["reached_diameter"] == pytest.approx(28, rel=0.03)
    assert found["reached_diameter"] < found["inflated_diameter"]


def test_radial_sbas_are_11_5_by_20_and_120_degrees_apart() -> None:
    lam = laminate("radial-15mm")
    (cap,) = of_role(lam, "cap")
    boxes = sorted(piece.bounds for piece in cap.pieces)
    assert len(boxes) == 3
    for low_x, low_y, high_x, _ in boxes:
        assert high_x - low_x == pytest.approx(11.5)
        assert low_y == pytest.approx(-10.0)
    steps = [b[0] - a[0] for a, b in zip(boxes, boxes[1:], strict=False)]
    assert steps == pytest.approx([math.pi * 15 / 3] * 2)
    (sheet,) = of_role(lam, "sheet")
    assert sheet.bounds[2] - sheet.bounds[0] == pytest.approx(math.pi * 15)


@pytest.mark.parametrize("name", ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"])
def test_inlets_open_to_the_rpt040_tube(name: str) -> None:
    for inlet in laminate(name).inlets:
        assert inlet.width >= math.pi * 1.016 / 2
        assert inlet.width >= 1.596
