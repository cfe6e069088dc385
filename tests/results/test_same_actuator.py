"""One actuator is one in the records, however many are ordered; what is tested again has a history.

Also the tolerances that a promise rests on: those that were measured.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

import sbafab
from sbafab.design.identity import actuator_sha256, design_sha256
from sbafab.errors import DesignError
from sbafab.results.recording import found_by
from sbafab.results.records import Build, LabResult, Record, promised
from sbafab.results.report import most_of, report
from sbafab.results.store import Lab, rebuilt, yield_with

SMALL = {"stack": {"balloons": 2}, "rules": {"yield_builds": 100}}
Make = Callable[..., Build]


@pytest.mark.parametrize(
    "change",
    [
        "order.copies=8",
        "order.spares=5",
        'order.made_for="Ada"',
        "sheets.tpe.width=300",
        "sheets.ptfe.roll=true",
        "laser.cut_speed=40",
        "rules.bond_width=0.7",
        "registration.hand_placement=0.12",
        "registration.pin_lengths=[8]",
        "films.tpe.density=1100",
        "name=another",
    ],
)
def test_what_is_no_part_of_an_actuator_makes_no_other(change: str) -> None:
    design = sbafab.load("3dof-15mm")
    other = design.with_(change)
    assert design_sha256(other) != design_sha256(design)
    assert actuator_sha256(other) == actuator_sha256(design)


@pytest.mark.parametrize(
    "change",
    [
        "bond.width=0.8",
        "stack.balloons=4",
        "chamber.diameter=4.8",
        "films.tpe.thickness=0.05",
        'films.tpe={product="another", thickness=0.038}',
        "inlet.tab_length=6",
        "bore.diameter=1.2",
        "registration.method=ears",
        "press.bond_all_minutes=25",
        "press.platen_width=200",
        "laser.kerf_tpe=0.1",
    ],
)
def test_what_an_actuator_is_makes_another(change: str) -> None:
    design = sbafab.load("3dof-15mm")
    assert actuator_sha256(design.with_(change)) != actuator_sha256(design)


def test_the_width_of_a_kerf_makes_no_other_actuator() -> None:
    """Compensated parts come out as drawn, whatever the beam takes."""
    wide, narrow = (
        sbafab.load("1dof-5mm", {"laser": {"kerf_tpe": kerf}}) for kerf in (0.12, [0.1, 0.11])
    )
    assert actuator_sha256(wide) == actuator_sha256(narrow)


def test_batches_of_one_and_of_eight_are_one_design(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    sbafab.record("1dof-5mm", SMALL, lab=lab, serial="A1", leak="pass")
    table = tmp_path / "batch.csv"
    table.write_text("serial,leak\nA2,pass\nA3,fail\n")
    eight = {**SMALL, "order": {"copies": 8}, "sheets": {"tpe": {"roll": True}}}
    sbafab.record("1dof-5mm", eight, lab=lab, table=table)
    told = sbafab.report(lab)
    shares = {(s.by, s.name): (s.share.good, s.share.builds) for s in told.success}
    assert shares["design", "1dof-5mm"] == (2, 3)
    assert [(p.design, p.success.builds) for p in told.promises] == [("1dof-5mm", 3)]
    with pytest.raises(DesignError, match=r"serial A1 has leak = pass in record 1; .* --again"):
        sbafab.record("1dof-5mm", eight, lab=lab, serial="A1", leak="fail")
    records, builds = Lab(lab).contents()
    # Either traveller's code finds all three.
    assert len(builds) == 2
    for sha256 in builds:
        assert len(found_by(sha256, "", records, builds)) == 3


def test_a_lot_of_another_design_may_use_the_same_serials(tmp_path: Path) -> None:
    lab = tmp_path / "lab.sqlite"
    sbafab.record("1dof-5mm", SMALL, lab=lab, serial="A1", leak="pass")
    wider = {**SMALL, "bond": {"width": 0.8}}
    sbafab.record("1dof-5mm", wider, lab=lab, serial="A1", leak="fail")
    assert sbafab.report(lab).items == 2


def test_a_mended_actuator_counts_by_its_first_attempt(lab: Lab, make_build: Make) -> None:
    build = make_build()
    lab.add(build.sha256, build, [LabResult("A1", "fail"), LabResult("A2", "pass")])
    lab.add(build.sha256, None, [LabResult("A1", note="seam glued")])
    [again] = lab.add(
        build.sha256, None, [LabResult("A1", "pass", numbers={"stroke_mm": 16.0})], is_again=True
    )
    assert again.attempt == 2
    # What follows adds to the newest attempt, and may not contradict it.
    [more] = lab.add(build.sha256, None, [LabResult("A1", numbers={"burst_kpa": 300.0})])
    assert more.attempt == 2
    with pytest.raises(DesignError, match="has leak = pass in record 4"):
        lab.add(build.sha256, None, [LabResult("A1", "fail")])
    found = report(*lab.contents())
    overall = found.success[0]
    assert (overall.share.good, overall.share.builds, overall.passed_later) == (1, 2, 1)
    assert (found.items, found.contradictions) == (2, ())
    assert {c.quantity for c in found.comparisons} == {"stroke_mm", "burst_kpa"}
    # A correction stays in its attempt.
    assert lab.correct(1, LabResult("A1", "fail", note="torn")).attempt == 1
    assert lab.correct(again.id, LabResult(withdrawn=True)).attempt == 2


def test_there_is_no_second_attempt_without_a_first(lab: Lab, make_build: Make) -> None:
    build = make_build()
    lab.add(build.sha256, build, [LabResult("A1", "fail")])
    with pytest.raises(DesignError, match="serial A9 has no record yet"):
        both = [LabResult("A1", "pass"), LabResult("A9", "pass")]
        lab.add(build.sha256, None, both, is_again=True)
    assert len(lab.contents()[0]) == 1


VERSION_1 = """
CREATE TABLE design (
    sha256 TEXT NOT NULL, generator TEXT NOT NULL, name TEXT NOT NULL, family TEXT NOT NULL, \
method TEXT NOT NULL, toml TEXT NOT NULL, predicted TEXT NOT NULL, tolerances TEXT NOT NULL, \
good_builds TEXT NOT NULL,
    PRIMARY KEY (sha256, generator)
);
CREATE TABLE result (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    recorded TEXT NOT NULL,
    design_sha256 TEXT NOT NULL,
    corrects INTEGER UNIQUE REFERENCES result (id),
    withdrawn INTEGER NOT NULL,
    serial TEXT NOT NULL, leak TEXT NOT NULL, operator TEXT NOT NULL, kit TEXT NOT NULL, \
note TEXT NOT NULL,
    burst_kpa REAL, stroke_mm REAL, force_n REAL, height_mm REAL, mass_g REAL,
    offset_mm TEXT NOT NULL, turn_deg TEXT NOT NULL, cut_mm TEXT NOT NULL
);
CREATE INDEX item ON result (design_sha256, serial);
PRAGMA application_id = 0x5BAFAB;
PRAGMA user_version = 1;
"""
"""As the first version made it; its triggers follow."""
REFUSED = "SELECT RAISE(ABORT, 'records are never changed; add one that corrects');"


def file_of_version_1(path: Path) -> None:
    """Two orders of one design, and a serial that is in both: once pass, once fail."""
    triggers = {
        **{
            f"{table}_{verb}": f"{verb} ON {table}"
            for table in ("design", "result")
            for verb in ("UPDATE", "DELETE")
        },
        "design_twice": "INSERT ON design WHEN EXISTS "
        "(SELECT 1 FROM design WHERE sha256 = NEW.sha256 AND generator = NEW.generator)",
        "result_twice": "INSERT ON result WHEN EXISTS "
        "(SELECT 1 FROM result WHERE id = NEW.id OR corrects = NEW.corrects)",
    }
    with closing(sqlite3.connect(path)) as rows:
        rows.executescript(VERSION_1)
        for name, what in triggers.items():
            rows.execute(f"\nCREATE TRIGGER {name} BEFORE {what} BEGIN\n    {REFUSED}\nEND\n")
        for copies, leak in ((1, "pass"), (8, "fail")):
            build = promised(sbafab.load("1dof-5mm", {**SMALL, "order": {"copies": copies}}))
            texts = (build.sha256, "sbafab 0.0.9", build.name, build.family, build.method)
            rows.execute(
                "INSERT INTO design VALUES (?, ?, ?, ?, ?, ?, '{}', ?, '[90, 100]')",
                (*texts, build.toml, '{"offset_mm": 0.08, "turn_deg": 0.4, "cut_mm": 0.1}'),
            )
            rows.execute(
                "INSERT INTO result VALUES (NULL, '2025-01-01T00:00:00Z', ?, NULL, 0, 'A1', ?, "
                "'', '', '', NULL, 16.0, NULL, NULL, NULL, '[]', '[]', '[]')",
                (build.sha256, leak),
            )
        rows.commit()


def test_a_file_of_the_first_version_opens_and_its_contradiction_is_told(tmp_path: Path) -> None:
    path = tmp_path / "lab.sqlite"
    file_of_version_1(path)
    before = path.read_bytes()
    told = sbafab.report(path)
    assert (told.records, told.items) == (2, 1)
    assert told.contradictions == (
        "serial A1 has leak = pass in record 1 and fail in record 2; correct one of them with "
        "--correct",
    )
    assert path.read_bytes() == before
    [new] = sbafab.record("1dof-5mm", SMALL, lab=path, serial="A2", leak="pass")
    Lab(path).correct(2, LabResult(withdrawn=True))
    told = sbafab.report(path)
    assert (new.attempt, told.items, told.contradictions) == (1, 2, ())
    assert told.success[0].share[:2] == (2, 2)


def recorded(sha256: str, offsets: list[float], passed: int) -> list[Record]:
    return [
        Record(
            serial=f"A{n}",
            leak="pass" if n < passed else "fail",
            operator="Ada",
            kit="paper",
            errors={"offset_mm": (offset,)},
            id=n + 1,
            design_sha256=sha256,
        )
        for n, offset in enumerate(offsets)
    ]


def test_a_promise_rests_on_the_errors_that_were_measured() -> None:
    """18 of 20 hold, the hand is up to 0.15 mm off where 0.08 is stated: that is not as promised.

    The yield is the rule's own at 0.15 and at 0.15 / 0.05 ** (1 / 40), each with its interval.
    """
    design = sbafab.load("1dof-5mm", {"rules": {"yield_builds": 2000}})
    build = promised(design)
    offsets = [0.15 * ((n + 1) / 20) ** 0.5 for n in range(20)]
    found = report(recorded(build.sha256, offsets, 18), {build.sha256: build})
    [promise] = found.promises
    assert promise.measured is not None
    ends = promise.measured.tolerances["registration.hand_placement"]
    assert ends == pytest.approx((0.15, 0.15 / 0.05 ** (1 / 40)))
    largest, highest = (
        next(f.measured for f in findings if f.rule == "registration-yield")
        for findings in (
            sbafab.check(design.with_({"registration.hand_placement": end})) for end in ends
        )
    )
    assert largest is not None
    assert highest is not None
    assert promise.measured.low < highest <= largest < promise.measured.high
    assert promise.measured.high - promise.measured.low < largest - highest + 0.1
    assert promise.promised > 0.85 > promise.measured.high
    assert promise.verdict == "more hold than the limits ask, by the measured errors"
    assert [t.verdict for t in found.tolerances] == ["too small"]


def test_errors_of_the_same_hand_on_another_design_count() -> None:
    design = sbafab.load("1dof-5mm", SMALL)
    build, other = promised(design), promised(design.with_("bond.width=0.8"))
    records = [
        *recorded(other.sha256, [0.15], 1),
        Record(
            serial="B1", leak="pass", operator="Ada", kit="paper", id=9, design_sha256=build.sha256
        ),
        Record(
            serial="B2", leak="pass", operator="Bo", kit="paper", id=10, design_sha256=build.sha256
        ),
    ]
    promises = report(records, {b.sha256: b for b in (build, other)}).promises
    assert all(promise.measured is not None for promise in promises)
    without_ada = report(records[2:], {build.sha256: build}).promises
    assert [promise.measured for promise in without_ada] == [None]


def test_a_record_that_cannot_be_read_again_is_not_called_as_promised(make_build: Make) -> None:
    build = make_build(tolerances={"offset_mm": 0.08, "turn_deg": 0.4, "cut_mm": 0.1})
    assert rebuilt(build) is None
    [promise] = report(recorded(build.sha256, [0.15] * 20, 18), {build.sha256: build}).promises
    assert promise.verdict == "not comparable: larger errors than stated were measured"


def test_yield_falls_with_the_hand_s_error() -> None:
    design = sbafab.load("1dof-5mm", SMALL)
    shares = [yield_with(design, {"placement": error}).value for error in (0.02, 0.08, 0.2)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > shares[2]
    assert most_of([0.1], 2).highest > 0.1
