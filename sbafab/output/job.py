"""Several designs cut together: a folder with each design's own, and film sheets for all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.cutting.properties import TRUE_ARCS, Curves
from sbafab.design.records import NAME_PATTERN, Design
from sbafab.errors import DesignError
from sbafab.output.batch import plan_batch, refuse_other_film, write_batch
from sbafab.output.checked import (
    EVERYTHING,
    Checked,
    check,
    plan,
)
from sbafab.output.run import Run, swapped_in
from sbafab.output.swap import JOB_SCHEMA
from sbafab.process import Progress, unheard

if TYPE_CHECKING:
    pass


RESERVED = {
    "sheets": "the job's folder of film sheets",
    "manifest.json": "the job's index",
}
"""What lies in a job's folder beside those of its designs."""


def generate_job(
    designs: Sequence[Design],
    name: str,
    out: Path = Path("out"),
    progress: Progress | None = None,
    curves: Curves = TRUE_ARCS,
) -> Run:
    """Writes ``out/<name>/``: a folder for each design, and ``sheets/`` with the parts of all.

    Film sheets, kerf and machine are those of the first design, and must be alike in all.
    Raises DesignError where they are not, or where two designs have one name. If a rule fails in
    any design, nothing is written (``Run.kept``).
    """
    tell = progress or unheard
    _refuse_names([design.name for design in designs], name)
    refuse_other_film(designs)
    checked = tuple(Checked(design, *check(design, tell)) for design in designs)
    target = out / name
    if any(one.failed for one in checked):
        return Run(checked, target, kept=True)
    planned = [plan(one, EVERYTHING, curves) for one in checked]
    batch = plan_batch(JOB_SCHEMA, name, planned, target, tell)
    return swapped_in(batch, target, lambda folder: write_batch(batch, folder, tell)[0], tell)


def _refuse_names(names: Sequence[str], name: str) -> None:
    if re.fullmatch(NAME_PATTERN.strip("^$"), name) is None:
        raise DesignError(
            f"--name {name!r} must be a folder's name of letters, digits, dots, dashes and "
            "underscores; for another place use -o"
        )
    twice = next((own for own in names if names.count(own) > 1), None)
    if twice is not None:
        raise DesignError(
            f"two designs are named {twice}; give each a name of its own, or say --copies"
        )
    folders = {own.lower(): own for own in reversed(names)}
    # Some systems hold names that differ in small and capital letters for one.
    alike = next((own for own in names if folders[own.lower()] != own), None)
    if alike is not None:
        raise DesignError(
            f"two designs are named {folders[alike.lower()]} and {alike}, which is one folder on "
            "some machines; give one of them another name"
        )
    kept = next((own for own in names if own.lower() in RESERVED), None)
    if kept is not None:
        raise DesignError(
            f"a design is named {kept}, as {RESERVED[kept.lower()]} is; give it another name in "
            "its design file"
        )
    if name.lower() in (*folders, *RESERVED):
        raise DesignError(f"the job is named {name} as one of its folders; choose another --name")
