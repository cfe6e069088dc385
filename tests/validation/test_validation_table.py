"""docs/measured/validation.csv is what its command writes, with every figure that was measured."""

from __future__ import annotations

import re

import pytest

from docs.scripts.tables import table
from docs.scripts.validate import PATH, validation
from sbafab.models.calibration import UNKNOWNS, load_calibration
from sbafab.models.closed_forms import eq_4, eqs_1_to_3
from sbafab.validation.evidence import load_evidence

MEASURED = """
367 +- 18 kPa | burst
90 % | success
1.75 h | build
15 mm | circle round
15.33 mm | deflated
28 mm | inflated
9.25 mm | folded
0.95 mm | deflated
17.5 mm | height
1.2 mm | stroke of one balloon
0.13 mm | air
0.12 mm | water
0.95 kPa | geometric regime
19 ul | SOFA
0.531 mJ | energy in at 1 kPa
0.055 mJ | energy lost at 1 kPa
45.3 mJ | energy in at 10 kPa
4.2 mJ | energy lost at 10 kPa
1.48 +- 0.04 N | flat
1.01 +- 0.01 N | 25 %
0.64 +- 0.01 N | 75 %
4.87 +- 0.02 N | flat
4.07 +- 0.07 N | 25 %
2.4 +- 0.03 N | 75 %
3.22 +- 0.12 N | 30 deg
1.41 +- 0.05 N | 60 deg
0.55 +- 0.02 N | 90 deg
35 kPa | modulus, 1-DoF
60 kPa | modulus, 3-DoF
0.067 +- 0.011 s | air
0.92 +- 0.08 s | water
81 +- 6 deg | bend
0.56 s | 30.3 deg
0.78 s | 58.5 deg
0.91 s | 89.7 deg
13.3 % | SOFA
4.9 % | SOFA
"""
"""Values as printed in the paper, and a word of their rows."""
RESIDUAL = re.compile(r"([+-][\d.e+-]+), [+-][\d.]+%")


def rows() -> list[list[str]]:
    return [list(row[1:]) for row in table("validation").rows]


@pytest.mark.long
def test_the_files_are_what_the_command_writes() -> None:
    for name, written in zip(("validation", "calibrated"), validation(), strict=True):
        assert PATH.with_name(f"{name}.csv").read_text(encoding="utf-8") == written.csv


def test_a_calibrated_value_is_inside_as_its_row_says() -> None:
    rows = table("calibrated").rows
    assert len(rows) == 28
    for figure, measured, _, model, interval, inside, _ in rows:
        value = float(measured.split()[0])
        low, high = map(float, interval.split(" to "))
        ends = [float(text) for text in re.findall(r"[\d.]+", model)]
        # The set-ups that the source leaves open count by their probability, so that the range of
        # all of them may be wider.
        assert low < ends[-1], figure
        assert ends[0] < high, figure
        assert inside == ("yes" if low <= value <= high else "no"), figure


def test_the_page_says_how_often_the_intervals_held() -> None:
    page = " ".join((PATH.parents[1] / "validation.md").read_text(encoding="utf-8").split())
    calibration = load_calibration("paper")
    assert calibration is not None
    assert f"{calibration.held_out.inside} of {calibration.held_out.points} values" in page
    for sentence in calibration.sentences:
        assert sentence in page
    for group, spread in calibration.discrepancy.items():
        assert f"{group} {100 * spread:.0f} %" in page
    for unknown in UNKNOWNS:
        low, high = calibration.bounds(unknown.field)
        value = unknown.shown(calibration.values[unknown.field])
        cells = [unknown.title, value, f"{low:.3g} to {high:.3g}", f"{unknown.middle:g}"]
        assert f"| {' | '.join(cells)} |" in page


def test_every_measured_figure_has_its_row() -> None:
    """As printed, and as in the evidence, but for inputs of the models; shares in per cent."""
    for line in MEASURED.strip().splitlines():
        printed, word = line.split(" | ")
        assert any(row[1] == printed and word in row[0] for row in rows()), line
    found = {float(row[1].split()[0]) for row in rows() if row[1]}
    inputs = ("cutting-error", "pin-error", "density", "loss-share", "stroke-15-balloons")
    for curve in load_evidence("paper").curves:
        # Of Fig. 7a the row holds the end of the curve, of bends their times.
        values = curve.y[-1:] if curve.id.startswith("stroke-10mm") else curve.y
        for value in values if curve.id not in inputs else ():
            assert found & {value, 100 * value}, curve.id


def test_every_row_has_a_prediction_or_says_that_there_is_none_and_why() -> None:
    for what, measured, where, predicted, residual, _, why in rows():
        assert where.startswith(("Sec.", "Table")), what
        assert len(why) > 5, what
        if predicted == "not":
            assert residual == "", what
            continue
        found = RESIDUAL.match(residual)
        assert found is not None, what
        apart = float(predicted.split()[0]) - float(measured.split()[0])
        # Four digits of the prediction, three of the residual.
        rounding = 0.006 * abs(apart) + 6e-4 * float(predicted.split()[0])
        assert abs(float(found[1]) - apart) <= rounding, what


def test_comparison_of_eq_4_in_the_documentation() -> None:
    text = (PATH.parents[1] / "prediction.md").read_text(encoding="utf-8")
    table = [re.findall(r"[\d.]+", line) for line in text.splitlines() if line.startswith("| 0.")]
    assert len(table) == 5
    for share, h, by_eqs, by_eq_4, ratio, slopes in [map(float, row) for row in table]:
        assert h == pytest.approx(2.5 * share)
        assert by_eqs == pytest.approx(float(eqs_1_to_3(2.5).volume(2 * h)) / 2, abs=6e-4)
        assert by_eq_4 == pytest.approx(float(eq_4(2.5).volume(h)), abs=6e-4)
        assert ratio == pytest.approx(by_eq_4 / by_eqs, abs=1e-3)
        exact = float(eq_4(2.5).rate(h) / eqs_1_to_3(2.5).rate(2 * h))
        assert slopes == pytest.approx(exact, abs=6e-3)


def test_what_the_misses_hang_on_begins_with_the_calibrated_figures() -> None:
    lines = table("sensitivity").rows
    (three, one) = [cells[2:] for cells in lines if cells[1] == "calibrated"]
    measured = [cells[2:] for cells in lines if cells[1] == "**measured**"]
    every = {row[0].partition(" (")[2]: row for row in table("calibrated").rows}
    shares = [f"height share {share}" for share in ("0", "0.25", "0.75")]
    names = [f"force-3dof), {share}" for share in shares]
    names += [f"force-bent), bend {angle} deg" for angle in (30, 60, 90)]
    # The largest bend was measured with a probe on the tip, whose weight is not here.
    names += ["full-height)"]
    others = [f"force-1dof), {share}" for share in shares]
    for values, figures, paper in ((three, names, measured[0]), (one, others, measured[1])):
        for name, value, wanted in zip(figures, values, paper, strict=False):
            # What the paper leaves open is one of its possibilities here.
            ends = [float(text) for text in re.findall(r"[\d.]+", every[name][3])]
            assert ends[0] - 0.06 <= float(value) <= ends[-1] + 0.06, name
            assert float(wanted) == pytest.approx(float(every[name][1].split()[0])), name
