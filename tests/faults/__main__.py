"""Writes ``docs/measured/faults.csv`` from what the checks find: ``python -m tests.faults``.

With ``--check`` the page is compared, not written.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.faults.catalogue import FAULTS, PAGE, TEMPLATES, caught_by, cell, good_folders, text
from tests.faults.once import remembering
from tests.faults.specimen import quick


def main() -> int:
    """Puts every fault into every template; 1 if a rule missed one, or the page is another."""
    cells: dict[tuple[str, str], str] = {}
    with TemporaryDirectory() as folder, quick({}), remembering(Path(folder) / "anew")():
        root = Path(folder)
        (root / "good").mkdir()
        goods = good_folders(root / "good")
        for fault in FAULTS:
            for template in TEMPLATES:
                found = caught_by(fault, template, goods, root / "faulty")
                cells[fault.name, template] = cell(fault, found)
    written = text(cells)
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(written, newline="\n")
    elif PAGE.read_text() != written:
        print(f"{PAGE.name} does not say what was found; run python -m tests.faults")
        return 1
    missed = [key for key, said in cells.items() if said.startswith("MISSED")]
    for name, template in missed:
        print(f"{name}, {template}: {cells[name, template]}")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
