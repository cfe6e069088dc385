"""The burst estimate against the working pressure: the paper's 367 kPa by closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.laminate.burst import burst
from sbafab.rules.finding import Finding


def rating(source: str, *changes: object, **tables: object) -> Finding:
    findings = sbafab.check(source, *changes, **tables)  # type: ignore[arg-type]
    (finding,) = (f for f in findings if f.rule == "pressure-rating")
    return finding


@pytest.mark.parametrize(
    ("design", "changes", "kpa"),
    [
        ("1dof-5mm", (), 367.0),
        ("3dof-15mm", ("registration.method=ears",), 367.0),
        ("3dof-15mm", ("chamber.diameter=50",), 36.7),
        ("1dof-10mm", ("films.tpe.thickness=0.057",), 367 / 2 * 1.5),
        ("1dof-5mm", ("stack.balloons=3", "chamber.diameter=[7, 6, 5]"), 367 * 5 / 7),
        # Cylinders of radius w / pi, whose film bears p r / t, twice a sphere's.
        ("radial-15mm", (), 367 * 2.5 * math.pi / 20),
    ],
)
def test_burst_by_film_stress(design: str, changes: tuple[str, ...], kpa: float) -> None:
    estimate = burst(sbafab.build(sbafab.load(design, *changes)))
    assert estimate is not None
    assert estimate.kpa == pytest.approx(kpa, rel=1e-6)


def test_a_drawn_square_is_taken_for_a_long_pocket(tmp_path: Path) -> None:
    """Eight wide: less than its inscribed disc bears, and no more than a strip as wide."""
    (tmp_path / "pocket.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="20mm" height="20mm" '
        'viewBox="-10 -10 20 20"><path d="M-4 -4 L4 -4 L4 4 L-4 4 Z"/></svg>'
    )
    drawn = f'chamber.outline="{tmp_path / "pocket.svg"}"'
    estimate = burst(sbafab.build(sbafab.load("1dof-10mm", drawn)))
    assert estimate is not None
    assert not estimate.is_round
    assert estimate.kpa == pytest.approx(367 * 2.5 * math.pi / 16, rel=1e-4)


def test_a_stated_pressure_fails_and_an_unstated_one_warns() -> None:
    wide = {"chamber": {"diameter": 25.0}}
    unstated = rating("1dof-5mm", **wide)
    assert (unstated.verdict, unstated.limit) == ("warn", 200.0)
    assert unstated.measured == pytest.approx(73.4)
    assert "at most 36.7 kPa" in unstated.message
    for pressure, verdict in ((36.0, "pass"), (37.0, "fail"), (-80.0, "pass")):
        stated = rating("1dof-5mm", acceptance={"working_pressure_kpa": pressure}, **wide)
        assert stated.verdict == verdict
    safer = {"working_pressure_kpa": 36.0, "safety_factor": 3.0}
    assert rating("1dof-5mm", acceptance=safer, **wide).verdict == "fail"


def test_a_film_that_nobody_burst_is_not_compared() -> None:
    film = {"product": "TPU", "thickness": 0.1}
    assert rating("1dof-5mm", films={"tpe": film}).verdict == "pass"
    tpu = ["--set", "films.tpe.product=TPU", "--set", "films.tpe.thickness=0.1"]
    lines = CliRunner().invoke(app, ["check", "1dof-5mm", *tpu]).output.splitlines()
    (row,) = (line.split(maxsplit=2) for line in lines if line.startswith("pressure-rating"))
    assert row[1:] == ["pass", "not compared"]
    explained = CliRunner().invoke(app, ["explain", "pressure-rating"]).output
    assert "not compared" in " ".join(explained.split())
    stated = rating("1dof-5mm", films={"tpe": film}, acceptance={"working_pressure_kpa": 10.0})
    # No key takes a burst pressure: what cannot clear the warning is not said to.
    assert "this warning stays" in stated.remedy
    assert (stated.verdict, stated.measured) == ("warn", None)
