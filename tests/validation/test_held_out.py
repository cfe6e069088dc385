"""Coverage of left-out points over all evidence: the record, beside the evidence and a new fit."""

from __future__ import annotations

import math

import pytest

from docs.scripts import held_out
from docs.scripts.measured import FOLDER, record
from docs.scripts.tables import Table
from sbafab.models.calibration import load_calibration
from sbafab.validation.evidence import load_evidence

TABLES = record(held_out.NAME).tables


def cells(table: Table, column: str) -> list[str]:
    return [row[list(table.columns).index(column)] for row in table.rows]


def numbers(table: Table, column: str) -> list[float]:
    return [float(cell) for cell in cells(table, column)]


def test_every_value_of_every_source_is_left_out_once_or_has_a_reason() -> None:
    sources, points = TABLES["sources"], TABLES["points"]
    *named, whole = sources.rows
    paper = load_evidence("paper")
    assert [row[0] for row in named] == [paper.id]
    for source, row in zip([paper], named, strict=True):
        may = [c for c in source.curves if c.comparable and c.discrepancy_group]
        told = cells(points, "curve")
        assert [told.count(f"{source.id}: {curve.id}") for curve in may] == [
            len(curve.y) for curve in may
        ]
        values, held = sum(len(c.y) for c in source.curves), sum(len(c.y) for c in may)
        tests = {curve.test for curve in may}
        assert row[1:5] == [str(n) for n in (values, held, len(may), len(tests))]
        for curve in source.curves:
            assert (f"{curve.id}: " in row[-1]) == (curve not in may)
    for column in range(1, 6):
        assert int(whole[column]) == sum(int(row[column]) for row in named)
    assert len(points.rows) == int(whole[2])


def test_counts_are_those_of_the_points() -> None:
    points, coverage = TABLES["points"], TABLES["coverage"]
    ranks, curves = numbers(points, "rank"), cells(points, "curve")
    ends = zip(*(numbers(points, name) for name in ("low", "measured", "high")), strict=True)
    inside = [low <= value <= high for low, value, high in ends]
    assert sum(inside) == int(TABLES["sources"].rows[-1][5])
    by_test = [row[1:] for row in coverage.rows if row[0] == "test"]
    for row, share in zip(by_test, held_out.SHARES, strict=True):
        within = [abs(rank - 0.5) < share / 2 for rank in ranks]
        outside = {curve for curve, is_in in zip(curves, within, strict=True) if not is_in}
        assert row[1] == f"{sum(within)} of {len(ranks)}"
        assert row[4] == f"{len(set(curves) - outside)} of {len(set(curves))}"
        # Right intervals hold their share; points of one test depend on each other, so that chance
        # moves the number by more than it would independent ones.
        mean, spread = (float(text) for text in row[2].split(" +- "))
        assert mean == pytest.approx(share * len(ranks), abs=0.2)
        assert spread > math.sqrt(len(ranks) * share * (1 - share))
    paper = load_calibration("paper")
    assert paper is not None
    assert (paper.held_out.points, paper.held_out.inside) == (len(ranks), sum(inside))


def test_what_the_calibration_assumes_is_adopted_by_its_score_on_what_was_left_out() -> None:
    """A pocket loss for each actuator, a weight on probed tips, bent forces by themselves: with all
    three what was left out is likelier than with none, and than without the weight; a loss for each
    actuator costs nothing, and axial forces are sharper.
    """
    rows = {(name, what): cells for name, what, *cells in TABLES["variants"].rows}
    for what in held_out.KEYS:
        score, _, force, _ = map(float, rows["as it is", what])
        for name in ("nothing on the tip", "all three"):
            assert score > float(rows[name, what][0])
        assert score >= float(rows["one pocket loss for all actuators", what][0])
        assert force < float(rows["all three", what][2])


def test_the_page_says_what_the_record_has() -> None:
    half, _, most, _ = (row[1:] for row in TABLES["coverage"].rows if row[0] == "test")
    page = " ".join((FOLDER.parent / "validation.md").read_text(encoding="utf-8").split())
    assert f"left out in turn, {most[1]} values ({most[4]} curves) lay in their 90 % inter" in page
    assert f"right ones would hold {most[2]}. The 50 % intervals hold {half[1]}." in page


@pytest.mark.long
def test_a_new_fit_without_a_test_gives_the_record() -> None:
    """The sampler's seeds are fixed: only other versions of numpy and emcee may move a figure."""
    pytest.importorskip("emcee")
    paper = load_evidence("paper")
    only = ("force-3dof",)
    rows = list(held_out.point_rows(list(held_out.left_out_curves([paper], only))))
    kept = [row for row in TABLES["points"].rows if row[1] in only]
    assert len(rows) == len(kept) > 0
    for new, old in zip(rows, kept, strict=True):
        assert new[:4] == list(old[:4])
        ends = [[float(cell) for cell in row[4:7]] for row in (new, old)]
        assert ends[0] == pytest.approx(ends[1], rel=0.1)
        assert float(new[7]) == pytest.approx(float(old[7]), abs=0.05)
