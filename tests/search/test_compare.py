"""Two designs side by side: differences against each design's own check and prediction."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import sbafab
from sbafab.cli import app
from sbafab.design.identity import design_sha256
from sbafab.design.records import design_toml
from sbafab.errors import DesignError
from sbafab.reports.solid_pictures import PictureRequest, pictures_at_one_scale
from sbafab.search import compare as module
from sbafab.search.compare import compare, compare_html, load_compared
from sbafab.search.sweep_report import PageSection
from tests.site.formats import hold

TWELVE = {"stack": {"balloons": 12}}


def test_each_figure_and_interval_is_the_one_of_predict() -> None:
    first, second = sbafab.load("1dof-5mm"), sbafab.load("1dof-5mm", **TWELVE)
    found = sbafab.compare(first, second, pressures_kpa=[8.0], flow_ml_min=20.0)
    assert [(row.key, row.values) for row in found.keys] == [("stack.balloons", (6, 12))]
    for number, design in enumerate((first, second)):
        said = sbafab.predict(design, pressures_kpa=[8.0], flow_ml_min=20.0)
        for figure in said.figures:
            if figure.other:
                continue
            (pair,) = (p for p in found.figures if (p.name, p.unit) == (figure.name, figure.unit))
            mine = pair.values[number], pair.intervals[number]
            assert mine == (figure.value, figure.interval)
    pairs = {pair.name: pair for pair in found.figures}
    # Twice the balloons rise twice as far, on the same outline.
    six, twelve = pairs["free stroke at 8 kPa"].values
    assert six is not None
    assert twelve == pytest.approx(2 * six, rel=1e-9)
    assert pairs["free stroke at 8 kPa"].differs
    assert not pairs["outline diameter"].differs
    assert pairs["lateral tip stiffness at 8 kPa, chambers shut"].main


def test_rules_that_differ_have_their_margins() -> None:
    """0.75 mm is the least width of a bond."""
    design = sbafab.load("1dof-5mm", "rules.yield_builds=100")
    found = compare(design, design.with_("bond.width=0.7"))
    (row,) = (row for row in found.rules if row.rule == "bond-width")
    assert row.verdicts == ("pass", "fail")
    assert row.margins == (pytest.approx(0.0), pytest.approx(-0.05))
    assert found.designs[0].failed == []
    assert "bond-width" in found.designs[1].failed
    # A rule that finds the same in both is left out.
    assert "piece-count" not in [row.rule for row in found.rules]
    same = compare(design, design)
    assert (same.keys, same.rules) == ((), ())
    assert not any(pair.differs for pair in same.figures)
    with pytest.raises(DesignError, match="at least one pressure"):
        compare(design, design, pressures_kpa=[])


def test_an_output_folder_is_a_design(tmp_path: Path) -> None:
    design = sbafab.load("3dof-15mm", "chamber.diameter=6")
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "design.toml").write_text(design_toml(design), encoding="utf-8")
    assert design_sha256(load_compared(tmp_path / "made")) == design_sha256(design)
    for source, said in (
        (tmp_path, "is a folder"),
        ("brace", "is an assembly"),
    ):
        with pytest.raises(DesignError, match=said):
            load_compared(source)


@pytest.mark.long
def test_the_command_writes_one_page_and_prints_what_differs(tmp_path: Path) -> None:
    asked = ["compare", "1dof-5mm", "radial-15mm", "-o", str(tmp_path)]
    ended = CliRunner().invoke(app, asked)
    assert ended.exit_code == 0, ended.output
    lines = [" ".join(line.split()) for line in ended.output.splitlines()]
    assert "chamber.width - 11.5" in lines
    assert lines[-1].endswith("compare: compare.html")
    page = tmp_path / "compare" / "compare.html"
    text = page.read_text(encoding="utf-8")
    # Two flat ones and the 1-DoF inflated; of pockets round a tube the reason.
    assert text.count("data:image/png;base64,") == 3
    assert "no model inflates pockets" in text
    assert "http" not in text
    assert [path.name for path in page.parent.iterdir()] == ["compare.html"]
    ended = CliRunner().invoke(app, [*asked, "--json"])
    said = json.loads(ended.stdout)
    hold("compare", said)
    assert [each["name"] for each in said["designs"]] == ["1dof-5mm", "radial-15mm"]
    assert page.read_text(encoding="utf-8") == text


def test_what_is_printed_is_of_its_schema(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "write_page", lambda *_: None)
    found = sbafab.compare("1dof-5mm", "radial-15mm")
    hold("compare", json.loads(json.dumps(found.as_dict())))
    assert found.names == ("1dof-5mm", "radial-15mm")
    pairs = {pair.name: pair for pair in found.figures}
    assert pairs["reached diameter"].values[0] is None
    assert pairs["reached diameter"].differs


def test_yields_without_a_target_are_held_against_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Figures take the longest, and are none of a rule's.
    monkeypatch.setattr(module, "predict", lambda *_, **__: SimpleNamespace(figures=()))
    small = sbafab.load("1dof-5mm", "stack.balloons=1", "rules.yield_builds=400")
    found = compare(small, small.with_("registration.cutting_error=0.12"))
    (row,) = (row for row in found.rules if row.rule == "registration-yield")
    first, second = row.measured
    assert first is not None
    assert second is not None
    assert first > second
    page = " ".join(compare_html(found).split())
    for verdict, measured in zip(row.verdicts, row.measured, strict=True):
        assert f"{verdict}, {measured:.3g}<" in page
    hold("compare", json.loads(json.dumps(found.as_dict())))


def test_a_page_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "compare").write_text("mine")
    asked = ["compare", "1dof-5mm", "1dof-5mm", "-o", str(tmp_path)]
    ended = CliRunner().invoke(app, asked)
    assert ended.exit_code == 2
    assert "cannot be written" in ended.output
    assert (tmp_path / "compare").read_text() == "mine"


def test_names_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    design = sbafab.load("1dof-5mm", "rules.yield_builds=100")
    found = compare(design, design, ("<b>", "b.toml"))
    nothing = PageSection("Flat")
    monkeypatch.setattr(module, "_flat", lambda _: nothing)
    monkeypatch.setattr(module, "_inflated", lambda _: nothing)
    text = compare_html(found)
    assert "&lt;b&gt;" in text
    assert "<b>" not in text


def test_pictures_have_one_scale() -> None:
    """The small one is drawn smaller beside the large one, which fills its picture either way."""
    bodies = []
    for balloons in (2, 40):
        design = sbafab.load("1dof-5mm", stack={"balloons": balloons})
        together = sbafab.stack(design)
        bodies.append((sbafab.build(design), together, together.pose((5.0,))))
    wish = PictureRequest({}, width=100, height=80)

    def inked(png: bytes) -> int:
        # Films are bluish or orange, paper and caption grey.
        pixels = np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(int)
        return int((np.ptp(pixels, axis=2) > 8).sum())

    small, large = map(inked, pictures_at_one_scale(bodies, wish))
    (alone,) = map(inked, pictures_at_one_scale(bodies[:1], wish))
    assert small < 0.8 * alone
    assert small < large


@pytest.mark.long
def test_pictures_go_to_the_pressure_that_is_compared() -> None:
    """As far as predict: the paper's pockets burst at 367 kPa."""
    designs = (sbafab.load("1dof-5mm", stack={"balloons": balloons}) for balloons in (1, 2))
    page = compare_html(sbafab.compare(*designs, pressures_kpa=[150.0]))
    assert "balloon's map" not in page
