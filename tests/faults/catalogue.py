"""The fault catalogue: every kind of fault, put into the output of a template and checked."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import cache
from pathlib import Path

from filelock import FileLock

from docs.scripts.tables import FOLDER, Table, from_csv
from sbafab.actuators import load_design
from sbafab.design.identity import design_sha256
from sbafab.errors import DesignError
from sbafab.folders.check import read_folder
from sbafab.folders.differences import DESIGNED
from sbafab.folders.run import RunRequest, generate
from tests.faults import beside, claims, files, holes, joints, layers, masks, sheets
from tests.faults.record import PAPER, Fault, Kind
from tests.faults.specimen import Specimen, failing, unabridged
from tests.folders.doctoring import Doctor

TEMPLATES = (*PAPER, joints.TEMPLATE)
BALLOONS = 2
KINDS: tuple[Kind, ...] = (
    layers.KIND,
    holes.KIND,
    holes.EARS_KIND,
    masks.KIND,
    masks.CHORDS_KIND,
    files.KIND,
    claims.KIND,
    sheets.KIND,
    beside.KIND,
    joints.KIND,
)
FAULTS = tuple(fault for kind in KINDS for fault in kind.faults)

Goods = Callable[[str, tuple[str, ...], bool], Specimen]
"""The good folder of a template with settings; all that a run writes, or the cut files alone."""


def good_folders(root: Path) -> Goods:
    """Good folders of BALLOONS balloons under ``root``, each written when first asked for.

    Several processes may share a root.
    """

    @cache
    def good(template: str, settings: tuple[str, ...], whole: bool) -> Specimen:
        balloons = (f"stack.balloons={BALLOONS}",) if template in PAPER else ()
        few = (*balloons, "rules.yield_builds=100")
        design = load_design(template, [*few, *settings])
        out = root / f"{design_sha256(design)}{'-whole' if whole else ''}"
        folder = out / design.name
        with FileLock(out.with_suffix(".lock")):
            if not folder.exists():
                if whole:
                    with unabridged():
                        generate(RunRequest(design, out))
                else:
                    generate(RunRequest(design, out, ("cut",)))
        clean = read_folder(folder).laminate
        assert clean is not None
        return Specimen(Doctor(folder), clean)

    return good


def caught_by(fault: Fault, template: str, goods: Goods, folder: Path) -> tuple[str, ...] | str:
    """The rules that fail once the fault is in a copy at ``folder``, or why it does not apply."""
    if template not in fault.templates:
        return "not planted"
    try:
        good = goods(template, fault.settings, fault.beside)
    except DesignError:
        return "cannot be made so"
    reason = fault.why_not(good.clean)
    if reason:
        return reason
    shutil.copytree(good.doctor.folder, folder)
    fault.put(Specimen(Doctor(folder), good.clean))
    if fault.hashes:
        Doctor(folder).rehash()
    with unabridged() if fault.beside else nullcontext():
        rules = failing(folder)
    shutil.rmtree(folder)
    return rules


def cell(fault: Fault, found: tuple[str, ...] | str) -> str:
    """What the table says of a fault in a template."""
    if isinstance(found, str):
        return f"n/a: {found}"
    others = ", ".join(rule for rule in found if rule not in (fault.rule, DESIGNED))
    caught = "caught" if fault.rule in found else "MISSED"
    return f"{caught}; {others}" if others else caught


# ``docs/measured/faults.csv``: what the checks find of every fault, and the cells read back.


PAGE = FOLDER / "faults.csv"
Cells = Mapping[tuple[str, str], str]
"""By fault and template."""
COLUMNS = ("section", "note", "fault", "rule", *TEMPLATES)


def text(cells: Cells) -> str:
    """Return the file for what was found."""
    rows = [
        [kind.title, kind.note, fault.name, f"`{fault.rule}`"]
        + [cells[fault.name, template] for template in TEMPLATES]
        for kind in KINDS
        for fault in kind.faults
    ]
    return Table(COLUMNS, rows).csv


def cells_of(page: str) -> Cells:
    """Return the cells that the file holds."""
    names = {fault.name for fault in FAULTS}
    return {
        (row[2], template): cell
        for row in from_csv(page).rows
        if row[2] in names
        for template, cell in zip(TEMPLATES, row[4:], strict=True)
    }
