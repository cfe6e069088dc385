"""What an actuator must stand: the proof pressure, and the fitting that it is tested with."""

from __future__ import annotations

import math

import pytest

from sbafab.design.sections import Acceptance
from sbafab.laminate.burst import burst
from sbafab.reports.traveller.page import acceptance, proof
from tests.reports.pages import TPU, work_of


@pytest.mark.parametrize(
    ("template", "changes", "expected", "proved"),
    [
        # 367 kPa with pockets of 5 mm in 0.038 (paper, Sec. 4): p r / 2 t is what the film bears.
        ("1dof-5mm", (), 367.0, 150.0),
        ("3dof-15mm", (), 367.0, 150.0),
        ("1dof-10mm", (), 367.0 / 2, 110.0),
        ("1dof-10mm", ("films.tpe.thickness=0.057",), 367.0 / 2 * 1.5, 150.0),
        # A pocket 10 wide is a cylinder of radius 10 / pi, whose film bears p r / t.
        ("radial-15mm", (), 367.0 * 2.5 / (2 * 10 / math.pi), 85.0),
        ("1dof-5mm", ("acceptance.proof_pressure_kpa=120",), 367.0, 120.0),
        ("1dof-5mm", ("films.tpe.product=TPU", "films.tpe.thickness=0.038"), None, None),
        ("1dof-5mm", (*TPU, "acceptance.proof_pressure_kpa=60"), None, 60.0),
    ],
)
def test_proof_pressure_stays_well_below_the_burst(
    template: str, changes: tuple[str, ...], expected: float | None, proved: float | None
) -> None:
    work = work_of(template, *changes)
    estimate = burst(work.laminate)
    assert (estimate is None) == (expected is None)
    if estimate is not None:
        assert estimate.kpa == pytest.approx(expected, rel=1e-6)
    found = proof(work)
    assert found.kilopascals == proved
    if expected is not None and found.kilopascals is not None:
        assert found.kilopascals <= 0.6 * expected
    assert (found.paper_kpa, found.paper_error) == (367, 18)


def test_the_needle_holds_in_the_tubes_bore() -> None:
    """0.02825 in of 22 gauge over the tube's 0.025 in: 13 % wider."""
    assert "22 G (outer diameter 0.718 mm)" in Acceptance().fitting
    assert (
        acceptance(work_of("3dof-15mm"))["bore"] == 0.635 == pytest.approx(0.718 / 1.13, abs=1e-3)
    )


def test_chambers_of_one_net_are_filled_by_its_first_tube() -> None:
    """What comes out of the other is no leak between chambers."""
    diode, gripper = (acceptance(work_of(name)) for name in ("diode", "gripper"))
    assert diode["shared"] == {"through": ["in", "out"]}
    assert diode["filled"] == []
    # The channel lies between base and wall, the pocket between wall and cap.
    assert diode["tab_films"] == {(1, 3): ["in"], (3, 5): ["out"]}
    assert gripper["shared"] == {}
    assert len(gripper["filled"]) > 1
