"""``python -m tests``: checks beside the tests, the same rows and exit codes in every order."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks import checking, plates_sbafab
from benchmarks.scaling import rules_and_cut_files
from benchmarks.task import plates
from tests import __main__ as command
from tests.quick import few

WAITS_FOR = """
import pathlib, time
until = time.monotonic() + 30
while not pathlib.Path({!r}).exists():
    assert time.monotonic() < until
    time.sleep(0.01)
"""


def run(
    monkeypatch: pytest.MonkeyPatch,
    capfdbinary: pytest.CaptureFixture[bytes],
    checks: dict[str, str],
    tests: str,
) -> tuple[int, list[str]]:
    """Exit code and lines of the command with Python code for its checks and its tests."""
    monkeypatch.setattr(command, "CHECKS", {name: ["-c", code] for name, code in checks.items()})
    monkeypatch.setattr(command, "PYTEST", ["-c", tests])
    monkeypatch.setattr(command.sys, "argv", ["tests"])
    code = command.main()
    lines = capfdbinary.readouterr().out.decode().splitlines()
    return code, [re.sub(r" +[0-9.]+ s$", "", line) for line in lines]


def test_rows_of_the_checks_stand_before_the_tests_that_run_beside_them(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:
    written = tmp_path / "written"
    # The check ends only after the tests have written: one after the other it would fail.
    checks = {"first": WAITS_FOR.format(str(written)), "second": "pass"}
    tests = f"import pathlib\nprint('2 passed', flush=True)\npathlib.Path({str(written)!r}).touch()"
    assert run(monkeypatch, capfdbinary, checks, tests) == (
        0,
        ["first             passed", "second            passed", "2 passed"],
    )


@pytest.mark.parametrize("tests_pass", [True, False])
def test_a_check_that_fails_is_shown_and_named_at_the_end(
    tests_pass: bool,
    monkeypatch: pytest.MonkeyPatch,
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:
    checks = {"good": "print('unseen')", "bad": "print('seen'); raise SystemExit(3)"}
    tests = f"print('counts'); raise SystemExit({0 if tests_pass else 5})"
    code, lines = run(monkeypatch, capfdbinary, checks, tests)
    assert (code, [line for line in lines if line]) == (
        1,
        ["good              passed", "bad               FAILED", "seen", "counts", "failed: bad"],
    )


def test_tests_that_fail_fail_the_command(
    monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    assert run(monkeypatch, capfdbinary, {"good": "pass"}, "raise SystemExit(5)")[0] == 1


def is_long(case: object) -> bool:
    return any(mark.name == "long" for mark in getattr(case, "marks", ()))


@pytest.mark.parametrize(
    ("size", "count", "stay"),
    [(10, 4, {0, 3, 6, 9}), (5, 1, {0}), (3, 9, {0, 1, 2}), (7, 2, {0, 6}), (0, 2, set())],
)
def test_a_few_cases_stay_in_the_suite_and_the_rest_is_long(
    size: int, count: int, stay: set[int]
) -> None:
    cases = few(range(size), count)
    assert [getattr(case, "values", (case,)) for case in cases] == [(n,) for n in range(size)]
    assert {n for n, case in enumerate(cases) if not is_long(case)} == stay


# The benchmarks' tasks are done as they say; how fast is for them to tell.


def test_plates_are_right_and_have_true_arcs(tmp_path: Path) -> None:
    plates_sbafab.main(tmp_path)
    assert len(list(tmp_path.iterdir())) == len(plates())
    assert checking.complaint(tmp_path) is None
    assert checking.has_true_arcs(tmp_path)


def test_rules_and_cut_files_are_timed() -> None:
    assert rules_and_cut_files(1, 0) > 0
