"""``docs/faults.md``: the text, and the cells read back from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tests.faults.catalogue import BALLOONS, FAULTS, KINDS, TEMPLATES
from tests.faults.specimen import LEFT_OUT

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
Cells = Mapping[tuple[str, str], str]
"""By fault and template."""


def text(cells: Cells) -> str:
    """The page for what was found."""
    applied = sum(not cell.startswith("n/a") for cell in cells.values())
    lines = [
        "# The fault catalogue",
        "",
        f"{len(FAULTS)} faults, put one at a time into the cut files and manifest of every "
        f"template they apply to, {applied} folders in all, and what `sbafab check` says of each. "
        "The tests in `tests/faults/` put them there and check every cell; "
        "`python -m tests.faults` writes this page.",
        "",
        f"The templates have {BALLOONS} balloons here, so that the tests are quick. A fault of "
        "geometry comes with a manifest that agrees with the faulty files (hashes, areas, pieces, "
        "bores, interfaces), so that the rule has to see it in the profiles. "
        f"`{LEFT_OUT[0]}` and `{LEFT_OUT[1]}`, which foresee errors on the bench, are not run. "
        "The film sheets are looked at in the table of their own only: they are cut as the layers "
        "were before the fault, and would tell every fault in a layer's profile besides. The rules "
        "on the layers, which are sound there, are not run for that table. "
        "Whether all is as the design makes it (`as-designed`) is asked in the last table only: "
        "it would tell every other fault as well; the folders of that table hold all that "
        "`sbafab generate` writes, and every rule is run on them.",
        "",
        "`SBAFAB_FAULTS=500 python -m pytest tests/faults/test_mutants.py` puts 500 faults drawn "
        "at random into any of the files of such folders, with the hashes put right: each is "
        "caught, or other readers (ezdxf, trimesh, parsers of the formats) find nothing changed "
        "that is cut, pressed or read.",
        "",
        "**caught**: the rule named for the fault fails; what fails besides it stands after the "
        "semicolon. **n/a**: the fault does not apply, and why.",
    ]
    for kind in KINDS:
        lines += ["", f"## {kind.title}", "", kind.note, ""]
        lines += [_row("fault", "rule", *TEMPLATES), _row(*["---"] * (2 + len(TEMPLATES)))]
        lines += [
            _row(fault.name, f"`{fault.rule}`", *(cells[fault.name, t] for t in TEMPLATES))
            for fault in kind.faults
        ]
    return "\n".join(lines) + "\n"


def cells_of(page: str) -> Cells:
    """The cells that a page of this catalogue holds."""
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    names = {fault.name for fault in FAULTS}
    return {
        (row[0], template): cell
        for row in rows
        if row[0] in names
        for template, cell in zip(TEMPLATES, row[2:], strict=True)
    }


def _row(*columns: str) -> str:
    return f"| {' | '.join(columns)} |"
