"""The table of ``predict --sensitivity``, against predictions of changed designs."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

import sbafab
from sbafab.cli import app
from sbafab.errors import DesignError
from sbafab.models.sensitivities import KEYS, sensitivity_table
from tests.site.formats import hold


@pytest.fixture(scope="module")
def rows() -> dict[str, tuple[float, float | None]]:
    table = sensitivity_table(sbafab.load("3dof-15mm"), 10.0)
    return {row.key: (row.stroke, row.bend) for row in table}


def test_a_stiffer_film_rises_and_bends_less(rows: dict[str, tuple[float, float | None]]) -> None:
    """Against the stack of a film that is 2 % stiffer, and one 2 % softer."""
    modulus = sbafab.load("3dof-15mm").films.tpe.modulus
    assert modulus is not None
    soft, stiff = (
        sbafab.stack("3dof-15mm", {"films.tpe.modulus": modulus * share}) for share in (0.98, 1.02)
    )
    rises = [each.pose((10.0,) * 3).height - each.flat_height for each in (soft, stiff)]
    bends = [each.pose((10.0, 0.0, 0.0)).bend for each in (soft, stiff)]
    by_ratio = math.log(1.02 / 0.98)
    stroke, bend = rows["films.tpe.modulus"]
    assert stroke == pytest.approx(math.log(rises[1] / rises[0]) / by_ratio, abs=0.03)
    assert bend == pytest.approx(math.log(bends[1] / bends[0]) / by_ratio, abs=0.03)
    assert stroke < 0


def test_films_so_much_stiffer_under_as_much_more_pressure_rise_and_bend_as_before(
    rows: dict[str, tuple[float, float | None]],
) -> None:
    """Film energies are in proportion to the modulus: Euler's theorem of homogeneous functions."""
    for pressures, change, measure in (
        ((10.0,) * 3, rows["films.tpe.modulus"][0], lambda pose: pose.height - 15 * pose.pitch),
        ((10.0, 0.0, 0.0), rows["films.tpe.modulus"][1], lambda pose: pose.bend),
    ):
        whole = sbafab.stack("3dof-15mm")
        ends = [
            measure(whole.pose([ratio * each for each in pressures])) for ratio in (0.999, 1.001)
        ]
        by_pressure = (ends[1] - ends[0]) / 0.002 / measure(whole.pose(pressures))
        assert change == pytest.approx(-by_pressure, rel=5e-3)


def test_wider_pockets_raise_the_stroke_and_a_taper_has_no_one_diameter(
    rows: dict[str, tuple[float, float | None]],
) -> None:
    assert rows["chamber.diameter"][0] > 1
    taper = sbafab.load("1dof-5mm", "chamber.diameter=[6, 5.5, 5, 5, 5, 5]")
    with pytest.raises(DesignError, match=r"chamber.diameter is not a number above 0"):
        sensitivity_table(taper, 10.0)


def test_an_actuator_of_one_chamber_has_no_bend() -> None:
    assert {row.bend for row in sensitivity_table(sbafab.load("1dof-5mm"), 10.0)} == {None}


def test_the_command_prints_the_table(tmp_path: Path) -> None:
    arguments = ["predict", "1dof-5mm", "--sensitivity", "-o", str(tmp_path)]
    shown = CliRunner().invoke(app, arguments).output
    assert "1 % more of" in shown
    assert all(key in shown for key in KEYS)
    document = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    hold("predict", document)
    assert [row["key"] for row in document["sensitivity"]] == list(KEYS)


def test_a_row_a_key_and_strokes_in_proportion_to_the_balloons(
    rows: dict[str, tuple[float, float | None]],
) -> None:
    assert tuple(rows) == KEYS
    assert rows["stack.balloons"][0] == pytest.approx(1.0, abs=1e-6)
