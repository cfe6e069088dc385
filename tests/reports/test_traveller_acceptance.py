"""What an actuator must stand, and what that is measured with: the paper's figures, and tables."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest
from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.laminate.burst import burst
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.acceptance import proof
from sbafab.reports.traveller.bench import bench_html, film_classes, pressure_range
from sbafab.reports.traveller.bill import times
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.page import traveller_html

SHA = "0123456789abcdef" * 4
TPU = ("films.tpe.product=TPU", "films.tpe.thickness=0.1")


def work_of(template: str, *changes: str) -> Work:
    design = load_design(template, changes)
    laminate = build(design)
    plan = schedule(laminate, design)
    return Work(design, laminate, plan, [], Job(SHA, "sbafab 1"))


def bench_words(work: Work) -> str:
    text = bench_html(work.design.name, SHA, "sbafab 1", [work])
    return " ".join(lxml_html.fromstring(text).text_content().split())


def words_of(work: Work) -> str:
    text = traveller_html(work)
    return " ".join(lxml_html.fromstring(text).text_content().split())


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
    assert "367 ± 18" in found.basis


def test_the_page_has_proof_acceptance_and_fitting() -> None:
    words = words_of(work_of("3dof-15mm"))
    at = words.index("Leak test, proof test, acceptance")
    section = words[at:]
    places = [
        section.index(text)
        for text in (
            "blunt dispensing needle, 22 G (outer diameter 0.718 mm), Luer lock",
            "hold for 60 s.",
            "to 150 kPa, hold for 60 s",
            "Leak test again",
            "Accepted:",
        )
    ]
    assert places == sorted(places)
    # 0.02825 in of 22 gauge and 0.02525 in of 23 over the tube's 0.025 in (0.635 mm).
    assert pytest.approx(0.718, abs=0.001) == 0.02825 * 25.4
    assert pytest.approx(0.13, abs=0.001) == 0.02825 / 0.025 - 1
    assert pytest.approx(0.01, abs=0.001) == 0.02525 / 0.025 - 1


def test_a_film_that_nobody_burst_gets_a_blank() -> None:
    words = words_of(work_of("1dof-5mm", "films.tpe.product=TPU", "films.tpe.thickness=0.038"))
    assert re.search(r"to _+ kPa, hold for 60 s", words)
    assert "Burst one actuator, write down the pressure" in words


def test_a_stated_proof_pressure_is_printed_for_any_film() -> None:
    words = words_of(work_of("1dof-5mm", *TPU, "acceptance.proof_pressure_kpa=60"))
    assert "to 60 kPa, hold for 60 s" in words
    assert "proof test 60 kPa for 60 s" in words


@pytest.mark.parametrize(
    ("template", "changes", "is_said"),
    [
        ("3dof-15mm", (), True),
        ("1dof-10mm", (), False),
        ("3dof-15mm", TPU, False),
        ("radial-15mm", (), False),
    ],
)
def test_what_the_papers_balloons_unfold_at_is_said_of_them_alone(
    template: str, changes: tuple[str, ...], is_said: bool
) -> None:
    assert ("0.95 kPa" in words_of(work_of(template, *changes))) == is_said


def test_another_film_is_named_where_it_is_taken_in_hand(sheet_files: Any) -> None:
    work = work_of("1dof-5mm", *TPU)
    on_sheets = replace(work, sheets=sheet_files(work.laminate))
    page = lxml_html.fromstring(traveller_html(on_sheets))
    words = " ".join(page.text_content().split())
    heads = ["".join(cell.itertext()) for cell in page.xpath("//thead//th")]
    assert heads.count("Film: TPE (TPU)") == 2
    assert "TPE (TPU), 0.1 mm thick: lay it flat" in words
    assert "sheets/TPE_1.dxf: TPE (TPU), " in words
    (lot,) = page.xpath("//table[@class='record']//th[starts-with(., 'TPE')]")
    assert " ".join(lot.itertext()) == "TPE TPU"
    assert "TPE (" not in words_of(work_of("1dof-5mm"))


def test_the_total_counts_what_is_known_where_press_minutes_are_not() -> None:
    work = work_of("1dof-5mm", *TPU)
    rows = {row.what: row.took for row in times(work)}
    minutes = [float(rows[n].split()[0]) for n in ("Handling", "Tests")]
    minutes += [float(rows[f"{n} the plate"].split()[0]) for n in ("Warming", "Cooling")]
    assert rows["In the press"] == "________ min"
    cure = float(rows["Curing the adhesive"].split()[0])
    least = f"{sum(minutes) / 60 + cure:.1f}"
    assert rows["Total, one actuator"] == f"at least {least} h and the press minutes"


def test_another_films_bond_and_glue_are_tried_before_the_first_actuator() -> None:
    words = bench_words(work_of("1dof-5mm", *TPU, "press.temperature_c=150"))
    once = words[words.index("Once, before") : words.index("What may be done without")]
    assert "Trial bond of TPU, 0.1 mm at 150 °C" in once
    assert "Glue trial: a tube glued to scrap of TPU with ________" in once
    thin = bench_words(work_of("1dof-5mm", "films.tpe.thickness=0.05"))
    assert "Trial bond of Stretchlon 200, 0.05 mm at 135 °C" in thin
    for usual in (thin, bench_words(work_of("1dof-5mm"))):
        assert "Glue trial" not in usual
    assert "Trial bond" not in bench_words(work_of("1dof-5mm"))


def test_every_copy_has_its_proof_test() -> None:
    work = work_of("1dof-5mm", "order.copies=3")
    text = traveller_html(work)
    page = lxml_html.fromstring(text)
    assert [
        len(page.xpath(f"//*[@id='{name}-{copy}']"))
        for copy in (1, 2, 3)
        for name in ("result", "proof")
    ] == [1] * 6


def test_the_indicating_film_covers_what_the_films_get() -> None:
    work = work_of("3dof-15mm")
    low, high = pressure_range([work])
    # The platen's 110 kPa to the 216 at the edge of the last step (docs, In the press).
    assert (round(low), round(high)) == (110, 216)
    classes = film_classes(low, high)
    assert min(one.low for one in classes) <= low
    assert max(one.high for one in classes) >= high
    assert [one.product for one in classes] == ["4LW", "LLLW"]
    assert [one.product for one in film_classes(110, 190)] == ["4LW"]
    assert "4LW, 50 to 200 kPa" in bench_words(work)


def test_what_a_pound_on_the_gauge_is_on_the_platen() -> None:
    """2.555 kN are 574 lbf on 6 x 6 in: a pound-force is 1 / 36 psi, 0.19 kPa."""
    words = bench_words(work_of("1dof-5mm"))
    assert "2555 N = 2.555 kN = 574 lbf; 1 lbf is 0.19 kPa" in words
    assert pytest.approx(0.1915, abs=1e-4) == 6.894757 / 36
    # Half a division within 5 % of 574 lbf.
    assert "a division every 57 lbf" in words


def test_the_page_says_what_of_time_is_the_papers_and_what_ours() -> None:
    words = bench_words(work_of("1dof-5mm"))
    assert "it does not say when its clock starts. Ours:" in words
    assert "T = 135 - 115 exp(-t/τ) °C from 20 °C, τ of this bench ________ min" in words
    assert "120 °C, is reached after 2.04 τ = ________ min" in words
    assert (
        "the clock starts after 3.14 τ = ________ min: the films are above it for 1.10 τ" in words
    )
    pages = words_of(work_of("1dof-5mm"))
    assert (
        pages.count("120 °C (melting, 2.04 τ)") == pages.count("130 °C (clock starts, 3.14 τ)") == 4
    )
    measured = work_of("1dof-5mm", "press.time_constant=2")
    assert "τ of this bench 2 min" in bench_words(measured)
    assert "the clock starts after 3.14 τ = 6.3 min" in bench_words(measured)
    assert "130 °C (clock starts, 6.3 min) ; end (12 min later)" in words_of(measured)
    assert "If it does not within 5 τ (10 min): do not start the clock." in words_of(measured)


def test_blanks_and_a_warning_for_minutes_that_nobody_stated() -> None:
    words = words_of(work_of("1dof-5mm", "films.tpe.product=TPU 85A", "films.tpe.thickness=0.05"))
    assert "Press schedule: the minutes are blank" in words
    assert '"TPU 85A, 0.05 mm"' in words
    assert "Start the clock, ________ min, only when" in words
    assert "________ + ________ + ________ + ________ min, one actuator" in words
    assert not re.search(r"Start the clock, \d", words)
