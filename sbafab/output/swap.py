"""Writing a folder beside the old one and swapping it in whole."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from sbafab.errors import OutputError

SCHEMA = "sbafab/manifest@1"


@contextlib.contextmanager
def replaced_folder(target: Path) -> Iterator[Path]:
    """Yields an empty folder beside ``target`` that takes its place when the block ends well.

    Whatever happens, ``target`` is the old folder or the new one, whole. Raises OutputError where
    the place cannot be written or holds something that is not an output of this program.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _refuse_foreign(target)
        with FileLock(target.parent / f".{target.name}.lock", timeout=0):
            for stale in target.parent.glob(f".{target.name}.*.part"):
                shutil.rmtree(stale, ignore_errors=True)
            fresh = Path(
                tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
            )
            try:
                fresh.chmod(0o755)
                yield fresh
                _swap(fresh, target)
            finally:
                shutil.rmtree(fresh, ignore_errors=True)
    except Timeout:
        raise OutputError(
            f"another run is writing {target}; wait for it to end or choose another folder with -o"
        ) from None
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(
            f"{target} cannot be written: {error.strerror or error}; what was there is unchanged"
        ) from None


def _refuse_foreign(target: Path) -> None:
    if target.is_symlink():
        raise OutputError(f"{target} is a link; remove it or choose another folder with -o")
    if not target.exists():
        return
    if not target.is_dir():
        raise OutputError(f"{target} is a file; remove it or choose another folder with -o")
    if any(target.iterdir()) and read_manifest(target) is None:
        raise OutputError(
            f"{target} holds files that sbafab did not write; choose another folder with -o"
        )


def read_manifest(folder: Path) -> dict[str, object] | None:
    """The manifest of an output folder, or None if there is none."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_ours = isinstance(manifest, dict) and manifest.get("schema") == SCHEMA
    return manifest if is_ours else None


def _swap(fresh: Path, target: Path) -> None:
    """Puts ``fresh`` in the place of ``target``; the old folder ends up where ``fresh`` was."""
    if not target.exists():
        fresh.rename(target)
        return
    if _exchange(fresh, target):
        return
    # Where the system cannot exchange two names in one step, a moment without target remains.
    aside = fresh.with_suffix(".old.part")
    target.rename(aside)
    try:
        fresh.rename(target)
    except OSError:
        aside.rename(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _exchange(a: Path, b: Path) -> bool:
    """Exchanges two names in one step (Linux renameat2); False where that is not to be had."""
    if not sys.platform.startswith("linux"):
        return False
    at_cwd, exchange = -100, 2
    try:
        renameat2 = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    return bool(
        renameat2(at_cwd, os.fsencode(a.absolute()), at_cwd, os.fsencode(b.absolute()), exchange)
        == 0
    )
