"""Several designs cut together: a folder with each design's own, and film sheets for all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.cutting.dxf_write import DxfProfile
from sbafab.design.records import NAME_PATTERN, Design
from sbafab.errors import DesignError
from sbafab.output.batch import Drawing, batch_manifest, plan_batch, refuse_unlike, write_batch
from sbafab.output.contents import Checked, Part, close_folder
from sbafab.output.earlier import removed_files
from sbafab.output.run import check
from sbafab.output.self_check import refuse_batch
from sbafab.output.shop import Progress
from sbafab.output.swap import JOB_SCHEMA, listed_files, replaced_folder

RESERVED = {
    "sheets": "the job's folder of film sheets",
    "manifest.json": "the job's index",
}
"""What lies in a job's folder beside those of its designs."""
PARTS: tuple[Part, ...] = ("press", "mesh", "preview")


@dataclass(frozen=True)
class Job:
    """What was made of several designs; nothing was written if one of them ``failed``."""

    checked: tuple[Checked, ...]
    folder: Path
    manifest: dict[str, Any]
    dropped: tuple[str, ...] = ()
    """Files of an earlier run in the folder that this one removed."""

    @property
    def failed(self) -> bool:
        return any(checked.failed for checked in self.checked)


def generate_job(
    designs: Sequence[Design],
    name: str,
    out: Path = Path("out"),
    progress: Progress | None = None,
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
) -> Job:
    """Writes ``out/<name>/``: a folder for each design, and ``sheets/`` with the parts of all.

    Film sheets, kerf and machine are those of the first design, and must be alike in all.
    Raises DesignError where they are not, or where two designs have one name. If a rule fails in
    any design, nothing is written.
    """
    tell = progress or (lambda what, done, total: None)
    _refuse_names([design.name for design in designs], name)
    refuse_unlike(designs)
    checked = tuple(Checked(design, *check(design, tell)) for design in designs)
    target = out / name
    if any(one.failed for one in checked):
        return Job(checked, target, {})
    batch = plan_batch(checked, name, target, Drawing(dxf_profile, chord_error), tell)
    listed = listed_files(target)
    with replaced_folder(target) as folder:
        written = write_batch(batch, folder, PARTS, True, tell)
        index = batch_manifest(JOB_SCHEMA, name, checked, batch, written.sheets)
        close_folder(folder, index)
        refuse_batch(batch, folder, tell)
    return Job(checked, target, index, removed_files(listed, index))


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
