"""Pins that are too thick for the corners of a registered sheet ended in a ValueError."""

from __future__ import annotations

import re

import pytest
import shapely

from sbafab.actuators import build, load_design
from sbafab.cli import main
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from tests.quick import few

SHEET = (
    "stack.balloons=1",
    'registration.method="sheet"',
    "registration.experimental=true",
    "rules.yield_builds=100",
)


def made(template: str, diameter: float, *settings: str) -> Laminate:
    return build(
        load_design(template, [*SHEET, f"registration.pin_diameter={diameter}", *settings])
    )


@pytest.mark.parametrize("diameter", [7.5, 12.0, 16.0, 100.0, 1000.0])
def test_pins_too_thick_are_refused_in_one_sentence(
    diameter: float, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = [f"--set={one}" for one in (*SHEET, f"registration.pin_diameter={diameter}")]
    with pytest.raises(SystemExit) as ended:
        main(["check", "1dof-5mm", *settings])
    _, err = capsys.readouterr()
    assert ended.value.code == 2
    assert err.startswith(f"sbafab: registration.pin_diameter = {diameter:g} leaves less than 1 mm")
    assert err.count("\n") == 1
    assert "make it smaller" in err


@pytest.mark.parametrize("template", ["1dof-5mm", "1dof-10mm", "3dof-15mm"])
@pytest.mark.parametrize("margin", few([10, 12, 30], 1))
def test_the_thickest_pins_that_fit_leave_a_millimetre_of_film(template: str, margin: int) -> None:
    """Held by shapely: every hole of a sheet keeps off its edges, its windows and other holes."""
    setting = f"panel.margin={margin}"
    with pytest.raises(DesignError) as refused:
        made(template, 100.0, setting)
    most = float(re.search(r"at most ([\d.]+) fits", str(refused.value))[1])
    with pytest.raises(DesignError, match="at most"):
        made(template, most + 0.11, setting)
    laminate = made(template, most, setting, "order.copies=2")
    panel = laminate.panel
    assert panel is not None
    (base,) = panel.sheets[0].shapely().geoms
    rings = [base.exterior, *base.interiors]
    marked = [shapely.Point(p) for p in (*(pin.centre for pin in laminate.pins), *panel.fiducials)]
    holes = [ring for ring in rings[1:] if min(ring.centroid.distance(p) for p in marked) < 0.1]
    assert len(holes) == len(marked)
    gaps = [one.distance(other) for one in holes for other in rings if other is not one]
    # Allowed is what fits, rounded down to 0.1 mm.
    assert 1.0 - 2e-3 <= min(gaps) <= 1.1
