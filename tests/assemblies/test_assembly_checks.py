"""Every check has a faulty assembly that it alone catches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from sbafab.assemblies.build import Assembled
from sbafab.assemblies.checks import CHECKS, run_checks
from sbafab.catalogue import names
from sbafab.rules.finding import Finding
from tests.quick import few

Together = Callable[[dict[str, Any]], Assembled]
Tables = Callable[[str], dict[str, Any]]

INLET = {
    "kind": "line",
    "on": "arm",
    "at": "inlet",
    "chamber": "chamber2",
    "outer_diameter": 1.4,
    "length": 20,
}
FAULTS: dict[str, tuple[str, dict[str, Any]]] = {
    "tube-match": ("brace", {"tube": {"outer_diameter": 14.9}}),
    "inlet-match": ("brace", {"feed": INLET}),
    "line-clearance": ("brace", {"vacuum": {"outer_diameter": 1.95}, "cup": {"bore": 2.5}}),
    "seat": ("aperture", {"magnet": {"offset": [0, 0]}}),
    "collision": ("standing", {"right": {"along": 25, "angle": -40}}),
    "aperture": ("aperture", {"arm": {"set": {"chamber": {"diameter": 6}}}}),
    "lumen-pass": ("brace", {"cup": {"diameter": 26}}),
    "lumen-brace": ("brace", {"grip": {"set": {"chamber": {"width": 9}}}}),
    "supply-tubes": ("brace", {"arm": {"turn": 0}}),
}


def changed(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    for name, keys in changes.items():
        data["parts"].setdefault(name, {}).update(keys)
    return data


def test_every_check_has_a_fault() -> None:
    assert list(CHECKS) == list(names("assemblies")) == list(FAULTS)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_caught_by_its_check_alone(
    name: str, tables: Tables, put_together: Together
) -> None:
    template, changes = FAULTS[name]
    assembled = put_together(changed(tables(template), changes))
    failed = [finding for finding in run_checks(assembled) if finding.verdict == "fail"]
    assert {finding.rule for finding in failed} == {name}
    assert all("; " in finding.message for finding in failed), "no remedy"
    # The studio picks these out.
    names = {part.name for part in assembled.parts}
    assert all(set(finding.parts) <= names for finding in failed)
    assert all(finding.parts and finding.parts[0] in finding.message for finding in failed)


@pytest.mark.parametrize("template", ["aperture", "brace", "standing"])
def test_templates_hold(template: str, tables: Tables, put_together: Together) -> None:
    findings = run_checks(put_together(tables(template)))
    verdicts = {finding.rule: finding.verdict for finding in findings}
    assert set(verdicts.values()) <= {"pass", "warn"}
    assert [rule for rule, verdict in verdicts.items() if verdict == "warn"] == (
        ["aperture"] if template == "aperture" else []
    )


def test_a_waived_check_says_so(tables: Tables, put_together: Together) -> None:
    data = changed(tables("aperture"), FAULTS["seat"][1])
    data["rules"] = {"waive": ["seat"]}
    seat = only_finding(run_checks(put_together(data)), "seat")
    assert (seat.verdict, seat.by_user) == ("waived", True)
    assert seat.message.startswith("waived by the assembly: ")


def only_finding(findings: tuple[Finding, ...], rule: str) -> Finding:
    (found,) = [finding for finding in findings if finding.rule == rule]
    return found


def test_shared_space_is_measured(tables: Tables, put_together: Together) -> None:
    # A line 0.4 thicker than the cup's bore, as far as it runs into the cup's bottom.
    data = tables("brace")
    changed(data, {"vacuum": {"outer_diameter": 1.5}})
    finding = only_finding(run_checks(put_together(data)), "collision")
    inside = 50 - 47.5 - 1.865
    expected = math.pi / 4 * (1.5**2 - 1.1**2) * inside
    assert finding.measured == pytest.approx(expected, rel=0.01)


def test_parts_that_touch_do_not_collide(put_together: Together) -> None:
    data = {
        "name": "stacked",
        "family": "assembly",
        "parts": {
            "plate": {
                "kind": "base",
                "width": 60,
                "length": 30,
                "thickness": 2,
                "material": "acrylic",
            },
            "one": {**leg(), "offset": [-14, 0]},
            "two": {**leg(), "offset": [14, 0], "turn": 180},
        },
    }
    assert only_finding(run_checks(put_together(data)), "collision").verdict == "pass"


def leg() -> dict[str, Any]:
    return {"kind": "sba", "design": "1dof-10mm", "on": "plate", "at": "top"}


def test_a_stiff_part_on_a_round_one_warns(tables: Tables, put_together: Together) -> None:
    data = tables("standing")
    data["parts"]["tag"] = {"kind": "magnet", "on": "tube", "at": "outside", "angle": 180}
    seats = [f for f in run_checks(put_together(data)) if f.rule == "seat"]
    assert [f.remedy for f in seats if f.verdict == "warn"] == [
        "build the joint of tag up with adhesive"
    ]


@pytest.mark.parametrize(
    ("along", "share"),
    few([(-50, 0), (-10, 1 / 22), (5, 16 / 22), (18, 1), (31, 20 / 22), (90, 0)], 3, names=2),
)
def test_a_sheet_round_a_tube_must_lie_on_it(
    along: float, share: float, tables: Tables, put_together: Together
) -> None:
    # The sheet is 22 long, the tube 40.
    data = changed(tables("brace"), {"grip": {"along": along}})
    seat = next(f for f in run_checks(put_together(data)) if f.rule == "seat")
    assert seat.verdict == ("fail" if share < 0.25 else "pass" if share == 1 else "warn")
    assert seat.measured == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize(
    ("along", "verdict"), [(-47.5, "pass"), (-50.1, "fail"), (2, "fail"), (500, "fail")]
)
def test_a_line_must_run_through_its_lumen(
    along: float, verdict: str, tables: Tables, put_together: Together
) -> None:
    data = changed(tables("brace"), {"vacuum": {"along": along}})
    seats = [f for f in run_checks(put_together(data)) if f.rule == "seat"]
    assert seats[-1].verdict == verdict
    assert "vacuum" in seats[-1].message


def test_nothing_to_hold_with_fails(tables: Tables, put_together: Together) -> None:
    data = tables("standing")
    data["deploy"] = {"lumen_diameter": 25.4}
    brace = only_finding(run_checks(put_together(data)), "lumen-brace")
    assert brace.verdict == "fail"
    assert "no part expands" in brace.message
