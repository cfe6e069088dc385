"""A sweep of real designs: its rows against what check and predict say, one by one."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

import sbafab
from sbafab.design.identity import design_sha256
from sbafab.errors import DesignError, OutputError
from sbafab.models.quantity import Conditions, FigureKey, ModelId, Quantity
from sbafab.search import sweep as module
from sbafab.search.sweep import SweepDocument, SweptDesigns
from sbafab.search.sweep_report import Table, _objectives
from sbafab.search.trials import MeasureJob, measured
from tests.site.formats import hold

VARY = ("chamber.diameter=2,5", "bond.width=0.7,0.75")
QUICK: dict[str, Any] = {"rules": {"yield_builds": 100}, "pressures_kpa": (10.0,)}

FIXED = "bond.width=0.75:0.76:0.01"


def _swept(out: Path, **more: Any) -> SweptDesigns:
    return sbafab.sweep("1dof-5mm", vary=VARY, out=out, **{**QUICK, **more})


def _rows(found: SweptDesigns, name: str = "sweep.csv") -> list[dict[str, str]]:
    with (found.folder / name).open(newline="") as opened:
        return list(csv.DictReader(opened))


def _here(
    pool: object, jobs: Iterable[tuple[str, MeasureJob]], seconds: float
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Measures in this process, which begins no other: the long tests do."""
    for key, job in jobs:
        del job["program"]
        yield key, {**measured(**job), "seconds": 0.5}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> SweptDesigns:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "run_jobs", _here)
        return _swept(tmp_path_factory.mktemp("sweep"))


def test_a_table_opens_with_what_was_varied_asked_for_and_binding(found: SweptDesigns) -> None:
    first = list(_rows(found)[0])
    assert len(first) < 30
    varied = [text.partition("=")[0] for text in VARY]
    assert first[4 : 4 + len(varied)] == varied
    for asked in ("mass [g]", "reference stroke [mm]", "free stroke at 10 kPa [mm]", "yield.low"):
        assert asked in first
    # A narrow bond fails bond-width, and the others have nothing to spare.
    assert {"bond-width.verdict", "bond-width.margin"} <= set(first)
    assert "piece-count.verdict" not in first
    # Its force is the one that ``predict`` designs with, of the four that it has.
    row = next(row for row in _rows(found) if row["outcome"] == "passes")
    # The paper's pockets of 5 mm burst at 367 kPa (Sec. 4), others in proportion to d.
    burst = 367 * 5 / float(row["chamber.diameter"])
    assert float(row[first[first.index("burst pressure [kPa]")]]) == pytest.approx(burst, rel=1e-3)
    changes = {key: float(row[key]) for key in varied}
    predicted = sbafab.predict("1dof-5mm", changes, pressures_kpa=QUICK["pressures_kpa"]).figures
    forces = [one for one in predicted if one.name == "blocked force at 10 kPa, flat"]
    (force,) = (one for one in forces if not one.other)
    column = f"{force.name}, {force.model.id.words} [N]"
    assert len(forces) > 1
    assert [name for name in first if name.startswith("blocked force")] == [column]
    assert float(row[column]) == pytest.approx(force.value, rel=1e-4)


def test_each_row_says_what_check_and_predict_say(found: SweptDesigns) -> None:
    hold("sweep", SweepDocument.of(found))
    rows = _rows(found)
    assert [row["outcome"] for row in rows] == ["refused", "refused", "fails", "passes"]
    assert found.outcomes == {"refused": 2, "fails": 1, "passes": 1}
    assert "neck ring" in rows[0]["reason"]
    for row, whole in list(zip(rows, found.table.rows(), strict=True))[2:]:
        design = sbafab.load(
            "1dof-5mm", {"bond.width": float(row["bond.width"]), "rules.yield_builds": 100}
        )
        assert row["sha256"] == design_sha256(design)
        for finding in sbafab.check(design):
            if finding.rule in ("bond-width", "tube-fit", "press-fit", "registration-yield"):
                verdict, _, measured, limit, _ = whole["rules"][finding.rule]
                assert (verdict, measured, limit) == (
                    *(finding.verdict, finding.measured, finding.limit),
                )
                if finding.rule == "registration-yield":
                    good = round(100 * float(row["yield"]))
                    assert good == round(100 * (finding.measured or 0))
                    ends = binomtest(good, 100).proportion_ci(0.95, "wilson")
                    assert [float(row["yield.low"]), float(row["yield.high"])] == (
                        pytest.approx([*ends], abs=1e-6)
                    )
        said = sbafab.predict(design, pressures_kpa=[10.0])
        assert float(row["mass [g]"]) == pytest.approx(said.value("mass"), rel=1e-6)
        stroke = float(row["free stroke at 10 kPa [mm]"])
        assert stroke == pytest.approx(said.value("free_stroke", kpa=10), rel=1e-6)
    assert float(rows[2]["bond-width.margin"]) == pytest.approx(-0.05, abs=1e-5)
    assert rows[2]["reason"].startswith("bond-width: ")
    # Every key stands in the journal, defaults too; times are not in the table.
    (*_, last) = found.table.rows()
    assert last["keys"]["mask.overhang"] == 0.5
    assert last["seconds"] > 0
    assert "seconds" not in rows[3]


def test_the_page_stands_alone_and_counts_right(found: SweptDesigns) -> None:
    page = (found.folder / "sweep.html").read_text()
    assert "4 designs" in page
    assert "<b>1</b>pass every rule" in page
    assert "<b>2</b>cannot be made" in page
    # Names of XML vocabularies are no addresses to fetch.
    assert not re.findall(r"(?:src|href)=[\"'](?!#)", page)
    assert "@import" not in page


def test_what_was_measured_before_is_not_measured_again(
    found: SweptDesigns, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {name: (found.folder / name).read_bytes() for name in found.files}

    def refuse(*_: Any) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(module, "run_jobs", refuse)
    again = _swept(found.folder.parent)
    assert again.measured == 0
    assert {name: (again.folder / name).read_bytes() for name in again.files} == before
    # Another pressure, another design or another program asks for something else.
    for more in ({"pressures_kpa": (20.0,)}, {"bore": {"clearance": 0.05}}):
        with pytest.raises(AssertionError, match="again"):
            _swept(found.folder.parent, **more)
    monkeypatch.setattr(module, "fingerprint", lambda: "0.0+other")
    with pytest.raises(AssertionError, match="again"):
        _swept(found.folder.parent)


def test_a_sweep_of_arrays_is_that_of_texts_and_has_its_table_as_rows(
    found: SweptDesigns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "run_jobs", _here)
    vary = {"chamber.diameter": np.linspace(2, 5, 2), "bond.width": [np.float64(0.7), 0.75]}
    swept = sbafab.sweep("1dof-5mm", vary=vary, out=tmp_path, **QUICK)
    assert (swept.folder / "sweep.csv").read_bytes() == (found.folder / "sweep.csv").read_bytes()
    assert [list(row) for row in swept.rows] == [list(row) for row in _rows(swept)]
    table = swept.frame()
    assert list(table["chamber.diameter"]) == [2, 2, 5, 5]
    for name in ("mass [g]", "bond-width.margin"):
        written = [float(row[name] or "nan") for row in _rows(swept)]
        assert table[name].tolist() == pytest.approx(written, nan_ok=True)


def test_rows_that_miss_a_limit_fail_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The paper's pockets of 5 mm burst at 367 kPa (Sec. 4), others in proportion to d."""
    monkeypatch.setattr(module, "run_jobs", _here)
    limits: dict[str, Any] = {
        "least": {"burst": 300, "force@1mm@320kPa": "1 N", "stack.balloons": 6},
        "most": {"stroke@12kPa": 9, "burst": "0.35 MPa"},
    }
    vary = {"chamber.diameter": [5, 5.5, 6]}
    swept = sbafab.sweep("1dof-5mm", vary=vary, out=tmp_path, **limits, **QUICK)
    paper, middle, wide = swept.rows
    assert [row["outcome"] for row in swept.rows] == ["fails", "passes", "fails"]
    assert (paper["burst.verdict"], paper["burst.margin"]) == ("fail", pytest.approx(-17, abs=0.1))
    assert paper["reason"] == "burst: 367 kPa, not at most 350 kPa"
    assert middle["burst.margin"] == pytest.approx(350 - 367 * 5 / 5.5, abs=0.1)
    assert wide["burst.margin"] == pytest.approx(367 * 5 / 6 - 300, abs=0.1)
    assert swept.failed == {"burst": 1, "force@1mm@320kPa": 1, "stroke@12kPa": 1}
    for row in swept.rows:
        changes = {"chamber.diameter": row["chamber.diameter"], "rules.yield_builds": 100}
        said = sbafab.predict("1dof-5mm", changes, pressures_kpa=[12.0])
        stroke = row["free stroke at 12 kPa [mm]"]
        assert stroke == pytest.approx(said.value("free_stroke", kpa=12), rel=1e-4)
        assert row["stroke@12kPa.margin"] == pytest.approx(9 - stroke, abs=1e-5)
        assert row["stroke@12kPa.verdict"] == ("pass" if stroke <= 9 else "fail")
    # Past its burst a force is not known, in the words of ``find``.
    forces = [name for name in paper if name.startswith("blocked force at 320 kPa")]
    assert [wide[name] for name in forces] == [None]
    assert wide["force@1mm@320kPa.verdict"] == "fail"
    with pytest.raises(DesignError) as refused:
        sbafab.find("1dof-5mm", {"chamber.diameter": 6}, least=limits["least"], free=FIXED)
    (told,) = re.findall("320 kPa exceeds [^(]*[^( ]", str(refused.value))
    assert f"force@1mm@320kPa: {told}" in wide["reason"]
    page = (swept.folder / "sweep.html").read_text()
    assert "burst: at least 300 kPa" in page
    assert "<td>stroke@12kPa</td><td>1</td>" in page
    hold("sweep", SweepDocument.of(swept))
    # Another limit of the same quantities measures nothing anew.
    again = {"least": limits["least"] | {"burst": 100}, "most": limits["most"]}
    assert sbafab.sweep("1dof-5mm", vary=vary, out=tmp_path, **again, **QUICK).measured == 0
    with pytest.raises(DesignError, match="1dof-5mm has no lumen"):
        sbafab.sweep("1dof-5mm", vary=vary, out=tmp_path, least=["lumen=3"])


def test_tables_of_an_earlier_sweep_are_not_replaced_in_silence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three designs, then two of which one is among them: two are no longer asked for."""
    monkeypatch.setattr(module, "run_jobs", _here)

    def swept(values: str) -> SweptDesigns:
        return sbafab.sweep("1dof-5mm", vary=(f"stack.balloons={values}",), out=tmp_path, **QUICK)

    assert swept("2,3,4").no_longer_asked == 0
    again = swept("4,5")
    assert again.no_longer_asked == 2
    assert again.measured == 1
    back = swept("2,3,4")
    assert (back.measured, back.no_longer_asked) == (0, 1)


def test_a_table_that_no_sweep_wrote_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def measuring(*_: object) -> None:
        raise AssertionError("measured before it was refused")

    monkeypatch.setattr(module, "run_jobs", measuring)
    folder = tmp_path / "1dof-5mm-sweep"
    folder.mkdir()
    (folder / "sweep.csv").write_text("mine")
    with pytest.raises(OutputError, match="not written by sbafab sweep"):
        _swept(tmp_path)
    assert (folder / "sweep.csv").read_text() == "mine"
    (folder / "manifest.json").write_text("{}")
    with pytest.raises(OutputError, match="contains a design of that name"):
        _swept(tmp_path)


@pytest.mark.parametrize("is_calibrated", [False, True])
def test_page_and_table_lead_with_one_force(is_calibrated: bool) -> None:
    """Without a calibration ``predict`` designs with Eq. 4, the first."""
    models = ModelId.WORK_ON_EQ_4, ModelId.ELASTIC_STACK
    flat = [Conditions(kpa=kpa, share=0.0) for kpa in (10.0, 100.0)]
    keys = [FigureKey(Quantity.BLOCKED_FORCE, at, model) for model in models for at in flat]
    row = {"outcome": "passes", "reason": "", "figures": dict.fromkeys(map(str, keys), 1.0)}
    table = Table(lambda: iter([row]), [{}], (10.0, 100.0), is_calibrated=is_calibrated)
    leading = [name for name in table.written if name.startswith("blocked")]
    assert leading == [
        f"blocked force at {kpa} kPa, flat, {models[is_calibrated].words} [N]" for kpa in (10, 100)
    ]
    assert leading[-1] in _objectives(table)[1]
