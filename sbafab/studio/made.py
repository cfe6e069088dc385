"""Folders that runs wrote, as the page shows them and hands them out."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

DAY_ONE = (1980, 1, 1, 0, 0, 0)
"""The date of every file in a zip: equal runs give equal zips."""


@dataclass(frozen=True)
class Made:
    """The folder of a run and the name that it goes by."""

    folder: Path
    name: str

    def file(self, path: str) -> Path | None:
        """A file of the run, None for any other place."""
        try:
            found = (self.folder / path).resolve()
            inside = found.is_relative_to(self.folder.resolve())
            return found if inside and found.is_file() else None
        except (OSError, ValueError):  # a name too long for any file, or one with a NUL
            return None


def zipped(made: Made) -> bytes:
    """The run's folder as a zip, its files byte for byte, in the order of their names."""
    paths = sorted(path for path in made.folder.rglob("*") if path.is_file())
    return packed(
        (f"{made.name}/{path.relative_to(made.folder).as_posix()}", path.read_bytes())
        for path in paths
    )


def packed(files: Iterable[tuple[str, bytes]]) -> bytes:
    """Names and contents as a zip, in this order; equal files give equal bytes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, file in files:
            entry = zipfile.ZipInfo(name, DAY_ONE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, file)
    return content.getvalue()
