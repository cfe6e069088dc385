"""The pages and pictures that a build of the site makes from the program itself."""

from __future__ import annotations

import shutil
from pathlib import Path

from docs.scripts import (
    reference_cli,
    reference_formats,
    reference_keys,
    reference_rules,
)
from docs.scripts.gallery import write_gallery


def write_all(folder: Path) -> None:
    """Writes every generated page into ``folder``, anew."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "cli.md").write_text(reference_cli.page(), encoding="utf-8")
    (folder / "keys.md").write_text(reference_keys.page(), encoding="utf-8")
    reference_formats.write(folder)
    reference_rules.write(folder)
    write_gallery(folder)
