"""Doing a thing again whenever a file changes, until Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import click

from sbafab.cli.ending import say
from sbafab.errors import SbafabError

READ = (".toml", ".dxf", ".svg")
"""What a design is made of: its file, a kit, drawings, the designs of an assembly."""
EVERY = 0.4
"""Seconds between two looks: a file system tells of changes in as many ways as there are."""

Stamps = dict[Path, tuple[int, int]]


def repeated(once: Callable[[], object], source: Path, looks: int | None = None) -> None:
    """Calls ``once`` now and after every change in the folder of ``source``.

    Bad input is said and waited out. ``looks`` bounds how often is looked (None: for ever).
    """
    seen: Stamps | None = None
    while looks is None or looks > 0:
        now = stamps(source)
        if now != seen:
            seen = now
            click.echo(f"{datetime.now():%H:%M:%S}  watching {source}; Ctrl-C ends")
            try:
                once()
            except SbafabError as error:
                say(str(error))
        looks = None if looks is None else looks - 1
        time.sleep(EVERY)


def stamps(source: Path) -> Stamps:
    """Time and size of every file that the source may be made of."""
    found: Stamps = {}
    for path in _files(source):
        # One that an editor is just replacing is there again at the next look.
        with suppress(OSError):
            state = path.stat()
            found[path] = state.st_mtime_ns, state.st_size
    return found


def _files(source: Path) -> Iterator[Path]:
    if source.is_dir():
        yield from (path for path in source.rglob("*") if path.is_file())
    elif source.parent.is_dir():
        yield from (path for path in source.parent.iterdir() if path.suffix.lower() in READ)
