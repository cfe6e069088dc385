"""What has been measured so far, a line a design, only ever added to: runs that end go on in it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from sbafab.errors import OutputError
from sbafab.search.measure import SweepRow


class Journal:
    """The rows in a file, by the hash of what was asked; the file is read where it is needed.

    A line that a killed run left unfinished is passed over, and its design measured again; so is
    one that took too long in less than ``seconds``. Raises OutputError where the file cannot be
    written.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        self.path = path
        self._seconds = seconds
        self._places: dict[str, int] = {}
        try:
            self._file: IO[bytes] = path.open("a+b")
            self._read()
        except OSError as error:
            raise OutputError(
                f"{path} cannot be written: {error.strerror or error}; choose another folder "
                "with -o"
            ) from None

    def _read(self) -> None:
        self._file.seek(0)
        at, line = 0, b""
        for line in self._file:
            key = self._key(line)
            if key is not None:
                self._places[key] = at
            at += len(line)
        if line and not line.endswith(b"\n"):
            self._file.write(b"\n")

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def add(self, key: str, row: SweepRow) -> None:
        """Writes a row, unless there is one already."""
        if key in self._places:
            return
        line = json.dumps({"key": key, "row": row}, ensure_ascii=False, separators=(",", ":"))
        self._file.seek(0, os.SEEK_END)
        self._places[key] = self._file.tell()
        self._file.write(line.encode() + b"\n")
        self._file.flush()

    def rows(self, keys: Iterator[str]) -> Iterator[SweepRow]:
        """The rows of these keys, in their order, one in memory at a time."""
        with self.path.open("rb") as opened:
            for key in keys:
                opened.seek(self._places[key])
                yield json.loads(opened.readline())["row"]

    def close(self) -> None:
        """Has what was written reach the disk."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def _key(self, line: bytes) -> str | None:
        """The key of a whole line that need not be measured again."""
        try:
            entry = json.loads(line)
            key, row = entry["key"], entry["row"]
            was_short = row["outcome"] == "too long" and row["seconds"] < self._seconds
        except (ValueError, KeyError, TypeError):
            return None
        is_whole = line.endswith(b"\n") and isinstance(key, str)
        return key if is_whole and not was_short else None
