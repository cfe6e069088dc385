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

from sbafab.errors import OutputError, SbafabError

SCHEMA = "sbafab/manifest@1"
JOB_SCHEMA = "sbafab/job@1"
"""Of a folder that holds several designs cut together."""
BEGUN, ASIDE = ".part", ".old.part"
"""Endings of a folder that is being written, and of an old one that is moved out of its way."""
LONGEST_SHOWN = 120


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
            _tidy_up(target)
            fresh = Path(
                tempfile.mkdtemp(prefix=f".{target.name}.", suffix=BEGUN, dir=target.parent)
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
    except OutputError:
        raise
    except OSError as error:
        raise _unwritten(target, error.strerror or str(error)) from None
    except (ValueError, NotImplementedError) as error:
        # A path with a NUL; a file system without locks.
        if isinstance(error, SbafabError):
            raise
        raise _unwritten(target, str(error)) from None


def _unwritten(target: Path, reason: str) -> OutputError:
    shown = str(target)
    if len(shown) > LONGEST_SHOWN:
        shown = f"{shown[:LONGEST_SHOWN]}..."
    return OutputError(
        f"{shown} cannot be written: {reason[:1].lower()}{reason[1:]}; what was there is "
        "unchanged; make room there, or choose another folder with -o"
    )


def _tidy_up(target: Path) -> None:
    """Removes what a killed run left, and puts a folder back that it had only moved aside."""
    # Eight characters, as mkdtemp makes them: a longer match belongs to another design's run.
    begun = f".{target.name}.{'?' * 8}"
    for aside in sorted(target.parent.glob(f"{begun}{ASIDE}")):
        if not target.exists():
            aside.rename(target)
        shutil.rmtree(aside, ignore_errors=True)
    for stale in target.parent.glob(f"{begun}{BEGUN}"):
        shutil.rmtree(stale, ignore_errors=True)


def _refuse_foreign(target: Path) -> None:
    if target.is_symlink():
        raise OutputError(f"{target} is a link; remove it or choose another folder with -o")
    if not target.exists():
        return
    if not target.is_dir():
        raise OutputError(f"{target} is a file; remove it or choose another folder with -o")
    if not os.access(target, os.W_OK):
        raise OutputError(f"{target} is read-only; choose another folder with -o")
    if any(target.iterdir()) and read_manifest(target) is None:
        raise OutputError(
            f"{target} holds files that sbafab did not write; choose another folder with -o"
        )


def read_manifest(folder: Path) -> dict[str, object] | None:
    """The manifest of an output folder, or None if there is none."""
    path = folder / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, ValueError, RecursionError):
        return None
    is_ours = isinstance(manifest, dict) and manifest.get("schema") in (SCHEMA, JOB_SCHEMA)
    return manifest if is_ours else None


def _swap(fresh: Path, target: Path) -> None:
    """Puts ``fresh`` in the place of ``target``; the old folder ends up where ``fresh`` was."""
    if not target.exists():
        fresh.rename(target)
        return
    if _exchange(fresh, target):
        return
    # Where the system cannot exchange two names in one step, a moment without target remains.
    aside = fresh.with_suffix(ASIDE)
    target.rename(aside)
    try:
        fresh.rename(target)
    except BaseException:
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
