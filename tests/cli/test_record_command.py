"""``sbafab record``: from the actuator on the bench to what all records say."""

from __future__ import annotations

import json
import socket
import sqlite3
from pathlib import Path

import pytest

from sbafab.models.calibration import load_calibration
from sbafab.reports.traveller.page import record_text
from tests.cli.conftest import Run
from tests.site.formats import hold


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object, **named: object) -> None:
        raise AssertionError("a record left the machine")

    for name in ("connect", "connect_ex", "sendto"):
        monkeypatch.setattr(socket.socket, name, refused)
    monkeypatch.setattr(socket, "getaddrinfo", refused)


@pytest.mark.usefixtures("offline")
def test_from_the_first_record_to_the_report(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    told = ["--leak", "pass", "--burst", "3.5 bar", "--height", "500 um", "--operator", "Ada"]
    code, out, err = run("record", "1dof-5mm", "--serial", "A1", *told)
    assert (code, err) == (0, "")
    assert "serial A1: operator Ada, kit paper, leak pass, burst_kpa 350.0, height_mm 0.5" in out
    Path("batch.csv").write_text(
        "serial,leak,height_mm,operator\nA2,fail,0.48,Bo\nA3,pass,0.52,Bo\n"
    )
    assert run("record", "1dof-5mm", "--table", "batch.csv")[0] == 0
    code, out, _ = run("record", "--correct", "2", "--leak", "pass", "--json")
    hold("records", json.loads(out))
    [new] = json.loads(out)["records"]
    assert (code, new["corrects"], new["leak"], new["numbers"]) == (
        0,
        2,
        "pass",
        {"height_mm": 0.48},
    )

    # The code on the traveller finds the record, and with the serial the one actuator.
    scanned = record_text("1dof-5mm", new["design_sha256"])
    _, out, _ = run("record", "--find", scanned, "--serial", "A2")
    assert [line.split(",")[0] for line in out.splitlines()] == [
        "record 2",
        "record 4",
        "2 records found in lab.sqlite",
    ]
    assert "corrected by 4" in out
    # As its last line says, to be typed by hand.
    arguments = scanned.splitlines()[-1].split()[1:]
    assert len(run(*arguments)[1].splitlines()) == 5

    monkeypatch.setenv("SBAFAB_LAB", str(Path("lab.sqlite").resolve()))
    _, out, _ = run("record", "--report", "--json")
    said = json.loads(out)
    hold("report", said)
    assert (said["records"], said["actuators"]) == (4, 3)
    shares = {(s["by"], s["name"]): (s["passed"], s["tested"]) for s in said["success"]}
    assert shares["design", "1dof-5mm"] == (3, 3)
    assert shares["operator", "Bo"] == (2, 2)
    assert shares["method", "channel-pin"] == shares["kit", "paper"] == (3, 3)
    [height] = (c for c in said["measured"] if c["quantity"] == "height_mm")
    assert height["mean"] == pytest.approx(0.5)
    paper = load_calibration("paper")
    assert paper is not None
    pressed = 11 * 0.025 + 12 * 0.038 * paper.values["press_factor"]
    assert height["predicted"] == pytest.approx(pressed)
    assert height["high"] - 0.5 == pytest.approx(4.30265 * 0.02 / 3**0.5, rel=1e-4)
    assert height["verdict"] == "differs"
    advice = "1dof-5mm: sbafab calibrate fits the models to its height_mm"
    assert advice in run("record", "--report")[1]


def test_what_was_mended_is_recorded_again(run: Run) -> None:
    assert run("record", "1dof-5mm", "--serial", "A1", "--leak", "fail")[0] == 0
    again = ["record", "1dof-5mm", "--serial", "A1", "--leak", "pass"]
    code, _, err = run(*again, "--set", "order.copies=8")
    assert code == 2
    assert "serial A1 has leak = fail in record 1" in err
    assert "--again" in err
    code, out, _ = run(*again, "--again")
    assert code == 0
    assert "serial A1: kit paper, leak pass, attempt 2" in out
    _, out, _ = run("record", "--report")
    assert "Success: leak test passed at the first attempt" in out
    [row] = (line for line in out.splitlines() if line.startswith("all"))
    assert row.split()[:4] == ["all", "all", "0", "1"]
    assert row.split()[-1] == "1"


def test_a_folder_is_recorded_as_the_design_that_it_was_built_from(
    run: Run,
) -> None:
    arguments = ["press", "1dof-5mm", "--set", "stack.balloons=2", "--set", "name=two"]
    assert run(*arguments)[0] == 0
    _, out, _ = run("record", "out/two", "--serial", "1", "--leak", "pass", "--json")
    [record] = json.loads(out)["records"]
    manifest = json.loads(Path("out/two/manifest.json").read_text())
    assert record["design_sha256"] == manifest["design_sha256"]


def test_a_file_of_another_program_is_one_sentence(run: Run) -> None:
    with sqlite3.connect("lab.sqlite") as rows:
        rows.execute("CREATE TABLE photos (id)")
    rows.close()
    code, _, err = run("record", "--report")
    assert code == 2
    assert err == (
        "sbafab: lab.sqlite is another program's database; name the lab's file with --lab\n"
    )
    assert run("record", "--find", "A1", "--serial", "B")[0] == 2


def test_history_is_recorded_corrected_and_exported(run: Run) -> None:
    lines = ["--entry", "item=TPE lot=L7 expires=2026-01-31 date=2026-05-04", "--entry"]
    arguments = ["record", "1dof-5mm", "--serial", "A1, A2", *lines, "step=1 temperature_c=134,5"]
    code, out, err = run(*arguments)
    assert (code, err) == (0, "")
    assert "warning: entry e1: TPE lot L7 expired on 2026-01-31, before 2026-05-04" in out
    assert out.endswith("4 entries added to lab.sqlite\n")
    change = ["record", "--correct", "e3", "--entry", "temperature_c=135", "--json"]
    document = json.loads(run(*change)[1])
    hold("records", document)
    [entry] = document["entries"]
    readings = {"temperature_c": 135.0}
    assert (entry["corrects"], entry["readings"], entry["step"]) == (3, readings, "1")
    exported = run("record", "--find", "A1", "--export", "a.csv")
    assert exported[:2] == (0, "a.csv: 1 device\n")
    assert Path("a.csv").read_text().count("\n") == 4
    _, out, err = run("record", "--find", "Z9")
    assert "no record matches 'Z9'" in err


def test_the_share_of_success_is_drawn(run: Run) -> None:
    assert run("record", "1dof-5mm", "--serial", "A1", "--leak", "pass")[0] == 0
    assert run("record", "--chart", "rate.svg")[:2] == (0, "rate.svg\n")
    assert Path("rate.svg").read_text().startswith("<?xml")
