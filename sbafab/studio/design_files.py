"""Design files in the chosen folder, the files they reference, and folders of runs."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import stat
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sbafab.api import files
from sbafab.errors import DesignError, OutputError

MOST_LISTED = 200
MOST_BYTES = 2_000_000  # largest design file, bytes
MOST_NAME = 240
"""Longest name of a design file, bytes: systems allow 255, and saving uses a longer name first."""
REFERRING = ("outline", "kit", "design", "file", "calibration")
"""Keys whose values may be paths of files."""


class ChangedError(OutputError):
    """Another program has written a file since the page read it."""


def design_file(folder: Path, name: str) -> Path:
    """Return the design file of this name in the folder. Raises DesignError for any other place."""
    size = len(os.fsencode(name))
    if size > MOST_NAME:
        raise DesignError(
            f"the name {name[:20]}... has {size} bytes; the limit for a design file is "
            f"{MOST_NAME}; shorten it"
        )
    path = folder / name
    if not name.endswith(".toml") or "\0" in name or not _lies_in(path, folder):
        raise DesignError(f"{name[:80]!r} is not a design file (.toml) in {folder}")
    return path


def listed(folder: Path) -> list[str]:
    """Return the names of the design files directly in the folder."""
    files = (path for path in folder.glob("*.toml") if _lies_in(path, folder) and path.is_file())
    return sorted(path.name for path in files)[:MOST_LISTED]


def read(path: Path) -> tuple[str, str]:
    """Return text and hash of a design file. Raises DesignError if it cannot be read."""
    try:
        content = content_of(path, MOST_BYTES)
        return content.decode("utf-8-sig"), _hash(content)
    except UnicodeDecodeError:
        raise DesignError(f"{path.name} is not a text file in UTF-8; save it as UTF-8") from None
    except OSError as error:
        raise DesignError(f"{path.name} cannot be read: {error.strerror or error}") from None


def content_of(path: Path, most: int | None = None) -> bytes:
    """Return the bytes of a file.

    Raises DesignError for files that are not regular or exceed ``most`` bytes, and OSError.
    """
    about = path.stat()
    # A pipe without a writer would block whoever opens it, and with it the whole server.
    if not stat.S_ISREG(about.st_mode):
        raise DesignError(f"{path.name} is not a regular file; choose another file")
    if most is not None and about.st_size > most:
        raise DesignError(
            f"{path.name} holds {about.st_size:,} bytes; a design file holds at most {most:,}"
        )
    return path.read_bytes()


def state(path: Path) -> str:
    """Return the hash of the file on disk; empty without a readable file."""
    try:
        return _hash(content_of(path))
    except (OSError, DesignError):
        return ""


def _mode(path: Path) -> int:
    """Return the mode of the file at a path; 0 if there is none, or its name is too long."""
    try:
        return path.stat().st_mode
    except OSError:
        return 0


def save(path: Path, text: str, expected: str | None) -> str:
    """Write the file in one step and return its hash.

    ``expected`` is the hash that the page has read; if the file has a different one, raises
    ChangedError. Raises OutputError if it cannot be written.
    """
    mode = _mode(path)
    if mode and not stat.S_ISREG(mode):
        raise OutputError(f"{path.name} is not a regular file; save under another name")
    if expected is not None and state(path) != expected:
        raise ChangedError(f"{path.name} was changed on disk meanwhile; load it, or save over it")
    content = text.encode("utf-8")
    try:
        number, fresh = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(number, "wb") as opened:
                opened.write(content)
            Path(fresh).chmod(mode & 0o777 or 0o644)
            Path(fresh).replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(fresh).unlink()
            raise
    except OSError as error:
        raise OutputError(f"{path.name} cannot be written: {error.strerror or error}") from None
    return _hash(content)


def named_files(text: str, folder: Path, above: frozenset[Path] = frozenset()) -> tuple[str, ...]:
    """Return the states of the files referenced by a design's text, to detect changes in them.

    Raises DesignError for one outside the folder. The reader handles text that is not TOML and
    values of another type.
    """
    try:
        tables = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        return ()
    named: list[str] = []
    for key, value in _references(tables):
        if value in (*files.template_names(), "paper"):
            continue
        path = folder / value
        if "\0" in value or not _lies_in(path, folder):
            raise DesignError(f"{key} = {value[:60]!r} lies outside {folder}; copy it there")
        mode = _mode(path)
        if mode and not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise DesignError(f"{key} = {value[:60]!r} is not a regular file; name another one")
        named.append(state(path))
        # A link to itself is refused by the reader.
        if path.suffix == ".toml" and stat.S_ISREG(mode) and path not in above:
            named += named_files(read(path)[0], path.parent, above | {path})
    return tuple(named)


def _references(tables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in tables.items():
        rows = value if isinstance(value, list) else [value]
        for row in rows:
            if isinstance(row, Mapping):
                yield from _references(row, f"{prefix}{key}.")
        if isinstance(value, str) and key in REFERRING:
            yield prefix + key, value


def _lies_in(path: Path, folder: Path) -> bool:
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):
        return False


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


# Folders written by runs, as the page shows and serves them.


DAY_ONE = (1980, 1, 1, 0, 0, 0)  # the date of every file in a zip: equal runs give equal zips


def file_in(folder: Path, path: str) -> Path | None:
    """Return a file of a run's folder; None for any other path."""
    try:
        resolved = (folder / path).resolve()
        inside = resolved.is_relative_to(folder.resolve())
        return resolved if inside and resolved.is_file() else None
    except (OSError, ValueError):  # a name too long for any file, or with a NUL
        return None


def zipped(folder: Path) -> bytes:
    """Return a run's folder as a zip, its files byte for byte, in order of their names."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(f"{folder.name}/{path.relative_to(folder).as_posix()}", DAY_ONE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, path.read_bytes())
    return content.getvalue()
