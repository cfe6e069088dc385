"""The report: invented lots with known truth that its intervals hold; one actuator is one."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import NamedTuple

import pytest
from scipy.stats import binomtest

import sbafab
from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import assembly_sha256, assembly_toml, load
from sbafab.assemblies.records import Assembly
from sbafab.design.identity import actuator_sha256, design_sha256
from sbafab.design.records import design_toml
from sbafab.errors import DesignError
from sbafab.lab.builds import RecordedDesign, promised
from sbafab.lab.recording import matching
from sbafab.lab.records import Record
from sbafab.lab.report import Report, report, success_svg
from sbafab.lab.store import Lab
from sbafab.reports.traveller.page import record_text
from tests.lab.conftest import SHA, build, result

SMALL = {"stack": {"balloons": 2}, "rules": {"yield_builds": 100}}


class Lot(NamedTuple):
    """The truth about a lot: share of success, mean stroke; and the promised share."""

    name: str
    method: str
    kit: str
    operator: str
    size: int
    success: float
    stroke: float
    promised: float


LOTS = (
    Lot("as the paper's", "channel-pin", "paper", "Ada", 60, 0.9, 17.5, 0.9),
    Lot("a rough hand", "channel-pin", "paper", "Bo", 40, 0.55, 16.1, 0.9),
    Lot("a fine laser", "ears", "second", "Ada", 80, 0.97, 17.5, 0.6),
)


def invented(lot: Lot, number: int, seed: int) -> tuple[list[Record], RecordedDesign]:
    """A record for each actuator of a lot."""
    draw = random.Random(seed)
    sha256 = f"{number:064x}"
    records = [
        Record(
            serial=f"{number}-{n}",
            leak="pass" if draw.random() < lot.success else "fail",
            operator=lot.operator,
            kit=lot.kit,
            stroke_mm=draw.gauss(lot.stroke, 0.4),
            id=1000 * number + n,
            design_sha256=sha256,
        )
        for n in range(lot.size)
    ]
    good = (round(1000 * lot.promised), 1000)
    return records, build(sha256=sha256, name=lot.name, method=lot.method, good_builds=good)


def of_lots(lots: tuple[Lot, ...], seed: int) -> Report:
    records, builds = [], {}
    for number, lot in enumerate(lots):
        rows, recorded = invented(lot, number, seed * 10 + number)
        records += rows
        builds[recorded.sha256] = recorded
    return report(records, builds)


def test_the_truth_of_three_lots_lies_in_every_interval() -> None:
    found = of_lots(LOTS, 1)
    rows = {(s.by, s.name): s for s in found.success}
    strokes = {c.design: c for c in found.comparisons}
    for lot in LOTS:
        success = rows["design", lot.name]
        assert (success.share.builds, success.promised) == (lot.size, lot.promised)
        assert success.share.interval[0] <= lot.success <= success.share.interval[1]
        ends = binomtest(success.share.good, lot.size).proportion_ci(0.95, "wilson")
        assert success.share.interval == pytest.approx([*ends], abs=1e-6)
        stroke = strokes[lot.name]
        assert stroke.low is not None
        assert stroke.high is not None
        assert stroke.low <= lot.stroke <= stroke.high
        assert stroke.verdict == ("agrees" if lot.stroke == 17.5 else "differs")
        assert stroke.ratio == pytest.approx(stroke.mean / 17.5)
    assert (rows["kit", "paper"].share.builds, rows["kit", "paper"].promised) == (100, None)
    assert rows["method", "ears"].share == rows["design", "a fine laser"].share
    assert rows["operator", "Ada"].share.builds == 140
    assert rows["all", "all"].share.builds == 180


OTHER_ORDER = """
order.copies=8 order.spares=5 order.made_for="Ada" sheets.tpe.width=300 sheets.ptfe.roll=true
laser.cut_speed=40 rules.bond_width=0.7 registration.hand_placement=0.12
registration.pin_lengths=[8] films.tpe.density=1100 name=another
"""
OTHER_ACTUATOR = """
bond.width=0.8 stack.balloons=4 chamber.diameter=4.8 films.tpe.thickness=0.05
films.tpe={product="another",thickness=0.038} inlet.tab_length=6 bore.diameter=1.2
registration.method=ears press.bond_all_minutes=25 press.platen_width=200 laser.kerf_tpe=0.1
"""


def test_an_actuator_is_what_is_built_and_not_how_many_or_of_which_sheet() -> None:
    design = sbafab.load("3dof-15mm")
    for change in (*OTHER_ORDER.split(), *OTHER_ACTUATOR.split()):
        other = design.with_(change)
        assert design_sha256(other) != design_sha256(design), change
        is_same = actuator_sha256(other) == actuator_sha256(design)
        assert is_same == (change in OTHER_ORDER.split()), change
    # Compensated parts come out as drawn, whatever the beam takes.
    kerfs = ("laser.kerf_tpe=0.12", "laser.kerf_tpe=[0.1, 0.11]")
    assert len({actuator_sha256(design.with_(kerf)) for kerf in kerfs}) == 1


def test_a_build_is_read_again_as_this_version_counts_it() -> None:
    """An earlier version's hash of the actuator groups with today's; a drawn outline's stays."""
    recorded = promised(sbafab.load("1dof-5mm", SMALL))
    assert recorded.design is not None
    old = build(toml=recorded.toml, actuator_sha256="0" * 64)
    assert old.actuator == recorded.actuator
    for toml in ("", "family = 'assembly'", "family = 'gone'", "no TOML"):
        assert build(toml=toml).design is None
        assert build(toml=toml).actuator == SHA


def test_batches_of_one_and_of_eight_are_one_design(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    sbafab.record("1dof-5mm", SMALL, lab=lab, serial="A1", leak="pass")
    table = tmp_path / "batch.csv"
    table.write_text("serial,leak\nA2,pass\nA3,fail\n")
    eight = {**SMALL, "order": {"copies": 8}, "sheets": {"tpe": {"roll": True}}}
    sbafab.record("1dof-5mm", eight, lab=lab, table=table)
    shares = {(s.by, s.name): s.share[:2] for s in sbafab.report(lab).success}
    assert shares["design", "1dof-5mm"] == (2, 3)
    with pytest.raises(DesignError, match=r"serial A1 has leak = pass in record 1; .* --again"):
        sbafab.record("1dof-5mm", eight, lab=lab, serial="A1", leak="fail")
    records, _, builds = Lab(lab).contents()
    # Either traveller's code finds all three.
    assert len(builds) == 2
    for sha256 in builds:
        assert len(matching(sha256, "", records, builds)) == 3


def test_a_mended_actuator_counts_by_its_first_attempt(lab: Lab) -> None:
    lab.add(SHA, build(), [result("A1", "fail"), result("A2", "pass")])
    lab.add(SHA, None, [result("A1", note="seam glued")])
    [again] = lab.add(SHA, None, [result("A1", "pass", stroke_mm=16.0)], is_again=True)
    # What follows adds to the newest attempt, and may not contradict it.
    [more] = lab.add(SHA, None, [result("A1", burst_kpa=300.0)])
    assert (again.attempt, more.attempt) == (2, 2)
    with pytest.raises(DesignError, match="has leak = pass in record 4"):
        lab.add(SHA, None, [result("A1", "fail")])
    records, _, builds = lab.contents()
    found = report(records, builds)
    overall = found.success[0]
    assert (overall.share.good, overall.share.builds, overall.passed_later) == (1, 2, 1)
    assert found.items == 2
    assert {c.quantity for c in found.comparisons} == {"stroke_mm", "burst_kpa"}


def test_a_lot_of_another_design_may_use_the_same_serials(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    sbafab.record("1dof-5mm", SMALL, lab=lab, serial="A1", leak="pass")
    wider = {**SMALL, "bond": {"width": 0.8}}
    sbafab.record("1dof-5mm", wider, lab=lab, serial="A1", leak="fail")
    found = sbafab.report(lab)
    assert found.items == 2
    assert [s.name[:9] for s in found.success if s.by == "design"] == ["1dof-5mm "] * 2


def test_the_chart_draws_the_share_so_far_and_of_the_last() -> None:
    records, recorded = invented(LOTS[0], 0, 3)
    svg = success_svg(records, {recorded.sha256: recorded})
    curves = re.findall(r'id="curve1.\d">(.*?)</g>', svg)
    assert [len(re.findall(r"[ML]\d", curve)) for curve in curves] == [60, 60, 60, 41]
    assert "Success of 60 actuators" in svg
    assert "last 20" not in success_svg(records[:19], {recorded.sha256: recorded})
    with pytest.raises(DesignError, match="no leak test is recorded yet"):
        success_svg([], {})


# Recording from Python, and of whole assemblies.


def test_python_records_what_the_command_does(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    design = sbafab.load("1dof-5mm", **SMALL)
    [first] = sbafab.record(
        design, lab=lab, serial="A1", leak="pass", stroke_mm=2.2, offset_mm=(0.03, 0.05)
    )
    [second] = sbafab.record("1dof-5mm", lab=lab, serial="A1", burst_kpa=350, cut_mm=0.1, **SMALL)
    assert (first.id, second.id) == (1, 2)
    assert first.design_sha256 == second.design_sha256
    assert first.kit == "paper"
    assert first.errors["offset_mm"] == (0.03, 0.05)
    table = tmp_path / "batch.csv"
    table.write_text("serial;leak\nB1;pass\nB2;fail\n")
    assert [one.serial for one in sbafab.record(design, lab=lab, table=table)] == ["B1", "B2"]
    told = sbafab.report(lab)
    assert (told.records, told.items) == (4, 3)
    assert Lab(lab).contents().records[0] == first


def test_an_assembly_is_recorded_as_a_whole(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    [made] = sbafab.record("standing", lab=lab, serial="S1", leak="pass", mass_g=12.5)
    whole = load("standing")
    assert isinstance(whole, Assembly)
    put = assemble(whole)
    assert made.design_sha256 == assembly_sha256(put)
    # The folder that it was built from is the same assembly.
    folder = tmp_path / "standing"
    folder.mkdir()
    (folder / "design.toml").write_text(assembly_toml(put))
    for own in put.designs:
        (folder / own.design.name).mkdir()
        (folder / own.design.name / "design.toml").write_text(design_toml(own.design))
    [again] = sbafab.record(folder, lab=lab, serial="S1", note="dropped")
    assert again.design_sha256 == made.design_sha256
    records, _, builds = Lab(lab).contents()
    build = builds[made.design_sha256]
    assert (build.name, build.family, build.predicted) == ("standing", "assembly", {})
    assert made.kit == "paper"
    # Three actuators of one design: the whole holds where all three do.
    sbafab.record("3dof-15mm", lab=lab, serial="P1", leak="pass")
    part = next(b for b in Lab(lab).contents().builds.values() if b.name == "3dof-15mm")
    assert build.promise == pytest.approx(part.promise**3, abs=1e-4)
    scanned = record_text("standing", made.design_sha256)
    assert matching(scanned, "", records, builds) == [made, again]


def test_a_proof_test_is_recorded_and_the_burst_is_scaled(tmp_path: Path) -> None:
    """367 kPa of pockets of 5 mm (paper, Sec. 4) is less for wider ones by as much."""
    lab = tmp_path / "lab.sqlite"
    [found] = sbafab.record("1dof-5mm", lab=lab, serial="A1", leak="pass", proof_kpa=150, **SMALL)
    assert found.numbers == {"proof_kpa": 150.0}
    small = sbafab.load("1dof-5mm", **SMALL)
    wide = small.with_({"chamber.diameter": 6.0})
    burst = [promised(design).predicted["burst_kpa"][0] for design in (small, wide)]
    assert burst == pytest.approx([367, 367 * 5 / 6])
    other = small.with_({"films.tpe": {"product": "TPU", "thickness": 0.038}})
    assert "burst_kpa" not in promised(other).predicted
