"""Write a folder beside the old one and swap it in as a whole."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Any, Final, Literal

from filelock import FileLock, Timeout

from sbafab.design.files import refuse_file_as_folder
from sbafab.errors import OutputError, SbafabError

MANIFEST = "manifest.json"
MAX_MANIFEST_BYTES = 50_000_000
SCHEMA: Final = "sbafab/manifest@1"
JOB_SCHEMA: Final = "sbafab/job@1"
"""Schema of a folder with several designs cut together."""
ASSEMBLY_SCHEMA: Final = "sbafab/assembly@1"
"""Schema of a folder with the designs of an assembly, cut together."""
SCHEMAS = (SCHEMA, JOB_SCHEMA, ASSEMBLY_SCHEMA)
Schema = Literal["sbafab/manifest@1", "sbafab/job@1", "sbafab/assembly@1"]
"""Schema of a folder's ``manifest.json``."""
CUT_FOLDERS = ("layers", "sheets")
"""Folders in which a foreign file would be cut together with the run's."""
SYSTEM_FILES = (".DS_Store", "Thumbs.db", "desktop.ini")
"""Files that file managers leave in folders; no laser program opens them."""
BEGUN, ASIDE = ".part", ".old.part"
"""Endings of a folder that is being written, and of an old one that is moved out of its way."""
LONGEST_SHOWN = 120


@contextlib.contextmanager
def replaced_folder(target: Path) -> Iterator[Path]:
    """Yield an empty folder beside ``target`` that replaces it if the block succeeds.

    In any case ``target`` is the complete old folder or the complete new one; files that others
    have put there stay. Raises OutputError if the place cannot be written, holds something other
    than output of this program, or foreign files among the cut files.
    """
    try:
        with _locked(target):
            _tidy_up(target)
            fresh = Path(
                tempfile.mkdtemp(prefix=f".{target.name}.", suffix=BEGUN, dir=target.parent)
            )
            try:
                fresh.chmod(0o755)
                yield fresh
                for path in _foreign_files(target):
                    _keep(target / path, fresh / path)
                _put_in_place(fresh, target)
            finally:
                shutil.rmtree(fresh, ignore_errors=True)
    except OutputError:
        raise
    except OSError as error:
        raise _unwritten(target, error.strerror or str(error)) from None


def refuse_busy(target: Path) -> None:
    """Raise OutputError if ``replaced_folder`` could not write now; creates nothing."""
    refuse_file_as_folder(target.parent)
    _refuse_foreign(target)
    if _lock_file(target).exists():
        with _locked(target):
            pass


def _lock_file(target: Path) -> Path:
    return target.parent / f".{target.name}.lock"


@contextlib.contextmanager
def _locked(target: Path) -> Iterator[None]:
    """Hold the lock of a folder that may be written. Raises OutputError or OSError."""
    refuse_file_as_folder(target.parent)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _refuse_foreign(target)
        lock = FileLock(_lock_file(target), timeout=0)
        lock.acquire()
    except Timeout:
        raise OutputError(
            f"another run is writing {target}; wait for it to end or choose another folder with -o"
        ) from None
    except (ValueError, NotImplementedError) as error:
        # A path with a NUL; a file system without locks.
        if isinstance(error, SbafabError):
            raise
        raise _unwritten(target, str(error)) from None
    try:
        yield
    finally:
        lock.release()


def _unwritten(target: Path, reason: str) -> OutputError:
    shown = str(target)
    if len(shown) > LONGEST_SHOWN:
        shown = f"{shown[:LONGEST_SHOWN]}..."
    return OutputError(
        f"{shown} cannot be written: {reason[:1].lower()}{reason[1:]}; what was there is "
        "unchanged; make room there, or choose another folder with -o"
    )


def _tidy_up(target: Path) -> None:
    """Remove leftovers of a killed run, and restore a folder that it had only moved aside."""
    # Eight characters, as mkdtemp makes them: a longer match belongs to another design's run.
    begun = f".{target.name}.{'?' * 8}"
    for aside in sorted(target.parent.glob(f"{begun}{ASIDE}")):
        if not target.exists():
            aside.rename(target)
        shutil.rmtree(aside, ignore_errors=True)
    for stale in target.parent.glob(f"{begun}{BEGUN}"):
        shutil.rmtree(stale, ignore_errors=True)


def _refuse_foreign(target: Path) -> None:
    around = read_manifest(target.parent)
    if around is not None and around["schema"] != SCHEMA:
        raise OutputError(
            f"{target.parent} holds several designs made together, all listed in its manifest; "
            f"choose a folder outside it for {target.name} with -o"
        )
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
    among = next((p for p in _foreign_files(target) if is_among_cut_files(p)), None)
    if among is not None:
        raise OutputError(
            f"{target / among} was not written by sbafab but lies among the cut files; move it "
            "away, or choose another folder with -o"
        )


def _foreign_files(target: Path) -> list[Path]:
    """Return files of a run's folder, relative to it, that the run did not write."""
    listed = listed_files(target)
    if not listed:
        return []
    ours = {*listed, MANIFEST}
    return [
        path.relative_to(target)
        for path in sorted(target.rglob("*"))
        if (path.is_symlink() or not path.is_dir())
        and path.relative_to(target).as_posix() not in ours
    ]


def is_among_cut_files(path: PurePath) -> bool:
    """Return True if a file, given relative to a run's folder, lies among the laser's files."""
    return bool({*path.parts} & {*CUT_FOLDERS}) and path.name not in SYSTEM_FILES


def listed_files(folder: Path) -> list[str]:
    """Return the files in the manifest of a folder; none without a manifest."""
    files = (read_manifest(folder) or {}).get("files")
    return list(files) if isinstance(files, dict) else []


def _keep(old: Path, new: Path) -> None:
    """Move a foreign file to the new folder, unless the run wrote a file of that name."""
    if not os.path.lexists(new):
        new.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(old, new, follow_symlinks=False)


def sound_bytes(path: Path, most: int) -> bytes:
    """Return a file's contents. Raises OutputError, without the file's name, if it is missing, not
    a regular file, unreadable, or larger than ``most`` bytes.
    """
    try:
        # Reading a pipe or a device would never end.
        if path.exists() and not path.is_file():
            raise OutputError("not a regular file; regenerate it")
        if path.stat().st_size > most:
            raise OutputError(f"larger than {most:,} bytes; regenerate it")
        return path.read_bytes()
    except OutputError:
        raise
    except (FileNotFoundError, NotADirectoryError):
        raise OutputError("missing; regenerate it") from None
    except OSError as error:
        raise OutputError(f"cannot be read ({error.strerror or error}); regenerate it") from None


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Return the manifest of an output folder, or None if there is none."""
    try:
        manifest = json.loads(sound_bytes(folder / MANIFEST, MAX_MANIFEST_BYTES))
    except (OutputError, ValueError, RecursionError):
        return None
    is_ours = isinstance(manifest, dict) and manifest.get("schema") in SCHEMAS
    return manifest if is_ours else None


def _put_in_place(fresh: Path, target: Path) -> None:
    """Put ``fresh`` in the place of ``target``; the old folder ends up at ``fresh``."""
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
    """Exchange two names in one step (Linux renameat2); False if unavailable."""
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


def replace_text(path: Path, text: str) -> None:
    """Write a text file beside an old one and swap it in. Raises OSError."""
    begun = path.with_name(path.name + BEGUN)
    try:
        begun.write_text(text, encoding="utf-8", newline="\n")
        begun.replace(path)
    finally:
        begun.unlink(missing_ok=True)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError of the block into an OutputError: ``path`` cannot be written."""
    try:
        yield
    except SbafabError:
        raise
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(
            f"{path} cannot be written: {reason}; choose another folder with -o"
        ) from None
