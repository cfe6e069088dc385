"""Checks of written folders raise no false alarm: same verdicts as the design's own check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.cutting.cut_settings import Curves, DxfProfile
from sbafab.design.files import rule_names
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.rules.finding import Finding
from tests.quick import few

DROP = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="12mm" height="12mm" viewBox="-6 -6 12 12">'
    '<path d="M3.5,0 C3.5,2 2,3 0,3 C-2,2.6 -3,1.5 -3.4,0 C-3,-1.5 -2,-2.6 0,-3 C2,-3 3.5,-2 3.5,0 '
    'Z"/></svg>'
)
EARS = "registration.method=ears"
FEW_BUILDS = "rules.yield_builds=100"
KERF = ("laser.kerf_tpe=0.2", "laser.kerf_ptfe=0.12")
SHARP = 'rules.waive=["film-limits"]'
"""Without a fillet lobes meet in points of less than 30 degrees."""
UNEVEN = "laser.kerf_tpe=[0.2, 0.1]"
PINS = "sheets.ptfe.pins=[[30, 30, 3], [120, 120, 3]]"
ROLLS = ("sheets.tpe.roll=true", "sheets.ptfe.roll=true", "sheets.tpe.length=400")
SMALL = ("sheets.tpe.width=70", "sheets.tpe.length=50", "sheets.label=false")

CLEAN: list[tuple[str, tuple[str, ...], DxfProfile]] = [
    ("1dof-5mm", ("stack.balloons=1",), "arcs"),
    ("1dof-5mm", ("stack.balloons=21",), "bulges"),
    ("1dof-10mm", ("chamber.outline=drop.svg", "stack.balloons=2"), "bulges"),
    ("3dof-15mm", ("chamber.count=8", "stack.balloons=1"), "bulges"),
    ("3dof-15mm", ("chamber.count=2", "stack.balloons=2"), "bulges"),
    ("radial-15mm", (), "bulges"),
    ("1dof-5mm", ("rules.bond_width=0.8", 'rules.waive=["bond-width", "tube-fit"]'), "bulges"),
    ("1dof-5mm", ("stack.balloons=2", EARS), "bulges"),
    ("3dof-15mm", ("stack.balloons=1", PINS, UNEVEN, "order.copies=2"), "bulges"),
    ("1dof-5mm", ("stack.balloons=2", *ROLLS, "order.copies=3", *KERF), "arcs"),
    ("1dof-10mm", ("stack.balloons=1", *ROLLS, "order.copies=3"), "chords"),
    ("radial-15mm", (*SMALL, "order.copies=3"), "bulges"),
]
MORE: list[tuple[str, tuple[str, ...], DxfProfile]] = [
    ("1dof-5mm", ("chamber.diameter=[6, 5, 4.5]", "stack.balloons=3"), "chords"),
    ("1dof-10mm", ("chamber.outline=drop.svg", "stack.balloons=1"), "chords"),
    ("3dof-15mm", ("stack.balloons=6",), "bulges"),
    ("3dof-15mm", ("stack.balloons=2",), "arcs"),
    ("1dof-5mm", ("stack.balloons=2", *KERF), "chords"),
    ("3dof-15mm", (SHARP, "fillet.radius=0", "stack.balloons=2", *KERF), "bulges"),
    ("3dof-15mm", ("chamber.count=5", "stack.balloons=1"), "bulges"),
    ("3dof-15mm", ("chamber.count=4", "stack.balloons=2"), "bulges"),
    ("radial-15mm", ("chamber.count=2", *KERF), "arcs"),
    ("radial-15mm", ("inlet.manifold=true",), "arcs"),
    ("3dof-15mm", ("stack.balloons=2", EARS), "bulges"),
    ("radial-15mm", ("stack.balloons=2", EARS), "bulges"),
    ("3dof-15mm", ("stack.balloons=1", "order.copies=3", *KERF), "bulges"),
    ("1dof-10mm", ("stack.balloons=2", UNEVEN, EARS), "arcs"),
]
CASES = [*CLEAN, *(pytest.param(*case, marks=pytest.mark.long) for case in MORE)]


@pytest.mark.parametrize(("template", "changes", "profile"), few(CASES, 5, names=3))
def test_what_was_written_checks_as_designed(
    template: str,
    changes: tuple[str, ...],
    profile: DxfProfile,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drop.svg").write_text(DROP)
    run = generate(
        RunRequest(
            load_design(template, (*changes, FEW_BUILDS)), tmp_path, ("cut",), Curves(profile)
        )
    )
    findings = check_folder(run.folder)
    own = [finding for finding in findings if finding.rule not in rule_names()]
    assert [(finding.rule, finding.verdict) for finding in own] == [
        ("file-integrity", "pass"),
        ("manifest-claims", "pass"),
        ("as-designed", "pass"),
    ]
    assert verdicts(f for f in findings if f.rule in rule_names()) == verdicts(run.findings)


def verdicts(findings: Iterable[Finding]) -> Counter[tuple[str, str]]:
    return Counter((finding.rule, finding.verdict) for finding in findings)


def test_chords_make_no_better_builds(tmp_path: Path) -> None:
    design = load_design("3dof-15mm", ("stack.balloons=1",))
    run = generate(RunRequest(design, tmp_path, ("cut",), Curves("chords", 0.05)))
    shares = [
        next(f.measured for f in findings if f.rule == "registration-yield")
        for findings in (run.findings, check_folder(run.folder))
    ]
    # Counted over the same draws; edges lie up to 0.05 mm elsewhere before arcs are put back.
    assert shares[0] is not None
    assert 0.1 < shares[0] < 0.9
    assert shares[1] == pytest.approx(shares[0], abs=0.03)
