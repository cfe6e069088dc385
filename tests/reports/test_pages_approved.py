"""The words of the pages, approved by reading: SBAFAB_APPROVE=1 writes them anew, to be reviewed.

Figures in them are held elsewhere, against the paper, closed formulas and the judge of folders.
"""

from __future__ import annotations

import os
from typing import Any

import pytest

from sbafab.assemblies.build import assemble
from sbafab.assemblies.checks import run_checks
from sbafab.assemblies.files import assembly_of
from sbafab.design.files import read_toml, templates_folder
from sbafab.reports.traveller.assembly_page import AssemblyWork, assembly_html
from sbafab.reports.traveller.bench import bench_html
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.traveller.work import Work
from sbafab.rules.finding import Finding, Place
from tests.reports.pages import APPROVED, DOUBLE, EARS, TPU, lines_of, work_of

WAIVED = Finding(
    "bond-width", "waived", 0.75, 0.5, "mm", Place(), "too narrow", waived_by="the design"
)
WARNS = Finding("film-limits", "warn", 1.0, 2.0, "mm", Place(), "too near the limit")
BATCH = ("order.copies=9", "order.at_once=4", "order.batch=24", "order.made_for=Ward 7")
DESIGNS: dict[str, tuple[str, ...]] = {
    "1dof": ("1dof-5mm", "stack.balloons=5"),
    "3dof": ("3dof-15mm", "stack.balloons=4"),
    "ears": ("3dof-15mm", EARS, "stack.balloons=2", *BATCH),
    "radial": ("radial-15mm", "sheets.program=rdworks", "laser.hold_tpe=carrier"),
    "tpu": (
        "1dof-5mm",
        "stack.balloons=2",
        *TPU,
        "laser.hold_ptfe=vacuum",
        "press.time_constant=2",
    ),
    "array": ("array",),
    "double": (str(DOUBLE),),
    "diode": ("diode",),
    "folded": ("folded", "seam_tools.hot_tip.offset=[12, -3.5]"),
    "gripper": ("gripper",),
    "vacuum": ("vacuum", "laser.kerf_tpe=[0.1, 0.14]"),
}


def approve(name: str, text: str) -> None:
    file = APPROVED / f"{name}.txt"
    if "SBAFAB_APPROVE" in os.environ:
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", DESIGNS)
def test_pages_of_a_design(name: str, sheet_files: Any) -> None:
    is_cut = name in ("1dof", "3dof", "ears", "radial", "tpu")
    findings = (WAIVED, WARNS) if name == "tpu" else ()
    work = work_of(*DESIGNS[name], sheets=sheet_files if is_cut else None, findings=findings)
    pages = [traveller_html(work)]
    if name in ("1dof", "ears", "folded", "radial", "tpu"):
        pages.append(bench_html(work.design.name, work.sha256, [work]))
    approve(name, "\n".join(map(lines_of, pages)))


@pytest.mark.parametrize("name", ["brace", "aperture"])
def test_pages_of_an_assembly(name: str) -> None:
    data = read_toml(templates_folder() / f"{name}.toml")
    assembled = assemble(assembly_of(data, templates_folder() / "some.toml"))
    works = []
    for part in assembled.designs:
        folder = f"{part.design.name}/"
        works.append(Work(part.design, part.laminate, (), folder=folder))
    checks = tuple(run_checks(assembled))
    made = AssemblyWork(assembled, "0" * 64, works, (), checks, (), (), b"\x89PNG")
    bench = bench_html(name, "0" * 64, works, assembled)
    approve(name, f"{lines_of(assembly_html(made))}\n{lines_of(bench)}")
